//! Times of frames that never jump.
//!
//! Devices' clocks do: a driver that stamps with the time of day is set by the network, a camera that is plugged in again
//! begins at 0. Times are therefore counted from the first frame of the run, and a step that cannot be is replaced by the
//! latest good one.

use std::time::Duration;

/// Frames further apart than this, without a word about missing frames, do not come from a steady clock.
const LONGEST_STEP: Duration = Duration::from_secs(5);
/// The step before there was one.
const FIRST_STEP: Duration = Duration::from_millis(100);

/// Turns a source's times into times since the first frame of the run.
#[derive(Debug, Clone)]
pub struct Stamps {
    /// Time of the latest frame by the source and by the run.
    latest: Option<(Duration, Duration)>,
    step: Duration,
    /// The source was opened again, or frames were missing: a long step is no jump.
    interrupted: bool,
    may_jump: bool,
}

impl Stamps {
    /// No frame yet. Times of sources that cannot jump are taken as they are.
    pub const fn new(may_jump: bool) -> Self {
        Self { latest: None, step: FIRST_STEP, interrupted: false, may_jump }
    }

    /// The next step may be as long as it likes.
    pub const fn interrupted(&mut self) {
        self.interrupted = true;
    }

    /// The time of a frame since the first one, and by how many seconds the source's clock jumped, if it did.
    pub fn enter(&mut self, time: Duration) -> (Duration, Option<f64>) {
        let Some((source, run)) = self.latest else {
            self.latest = Some((time, Duration::ZERO));
            return (Duration::ZERO, None);
        };
        let step = time.checked_sub(source).filter(|step| !self.may_jump || self.interrupted || *step <= LONGEST_STEP);
        let jump = match step {
            Some(_) => None,
            None => Some(time.as_secs_f64() - source.as_secs_f64()),
        };
        if let Some(step) = step.filter(|_| !self.interrupted) {
            self.step = step;
        }
        let run = run + step.unwrap_or(self.step);
        self.latest = Some((time, run));
        self.interrupted = false;
        (run, jump)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_either_way_is_told_and_time_goes_on() {
        let mut stamps = Stamps::new(true);
        let mut enter = |ms: u64| {
            let (time, jump) = stamps.enter(Duration::from_millis(ms));
            (time.as_millis(), jump.map(|seconds| (seconds * 1e3).round()))
        };
        assert_eq!([enter(7_000), enter(7_040), enter(7_080)], [(0, None), (40, None), (80, None)]);
        assert_eq!(enter(3_607_120), (120, Some(3_600_040.0)));
        assert_eq!(enter(3_607_160), (160, None));
        assert_eq!(enter(1_000), (200, Some(-3_606_160.0)));
        assert_eq!(enter(1_040), (240, None));
    }

    #[test]
    fn a_pause_that_was_told_is_no_jump_and_files_never_jump() {
        let mut stamps = Stamps::new(true);
        stamps.enter(Duration::ZERO);
        stamps.interrupted();
        assert_eq!(stamps.enter(Duration::from_secs(60)), (Duration::from_secs(60), None));
        assert!(stamps.enter(Duration::from_secs(120)).1.is_some());
        let mut stamps = Stamps::new(false);
        stamps.enter(Duration::ZERO);
        assert_eq!(stamps.enter(Duration::from_secs(60)), (Duration::from_secs(60), None));
    }
}
