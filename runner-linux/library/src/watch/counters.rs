//! What happened and how long it took, in a few kilobytes however long a run lasts.

use std::time::Duration;

use crate::output::record::StageTimes;

/// Steps in an octave.
const STEPS: usize = 16;
/// From 1 µs up: 2^27 µs are two minutes.
const OCTAVES: usize = 27;

/// Times in steps of 4.4 %: 16 to the octave, from 1 µs to two minutes.
#[derive(Debug, Clone)]
pub struct Histogram {
    counts: Box<[u64; STEPS * OCTAVES]>,
    count: u64,
    longest: Duration,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: Box::new([0; STEPS * OCTAVES]), count: 0, longest: Duration::ZERO }
    }
}

impl Histogram {
    /// Enters a time.
    pub fn enter(&mut self, time: Duration) {
        let octaves = libm::log2(time.as_secs_f64() * 1e6).max(0.0);
        let place = ((octaves * STEPS as f64) as usize).min(STEPS * OCTAVES - 1);
        self.counts[place] += 1;
        self.count += 1;
        self.longest = self.longest.max(time);
    }

    /// The time that a share of all times do not exceed, in milliseconds, to the upper end of its step.
    pub fn quantile_ms(&self, share: f64) -> f64 {
        let wanted = libm::ceil(self.count as f64 * share) as u64;
        let mut seen = 0;
        for (place, &count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= wanted && count > 0 {
                let upper = libm::exp2((place + 1) as f64 / STEPS as f64) / 1e3;
                return upper.min(self.longest.as_secs_f64() * 1e3);
            }
        }
        0.0
    }
}

/// The stages of a frame's way, in order.
#[derive(Debug, Clone, Default)]
pub struct Stages {
    /// Making gray pixels of what the device gave.
    pub decode: Histogram,
    /// Lying in the queue.
    pub wait: Histogram,
    /// Scaling to the size that is recognized, and judging the picture.
    pub prepare: Histogram,
    /// Finding corners and describing them.
    pub features: Histogram,
    /// Comparing with every view of the table.
    pub matching: Histogram,
    /// Finding out where the observer stands.
    pub position: Histogram,
    /// Adding up the evidence and writing the records.
    pub tell: Histogram,
    /// From the frame's arrival to the answer, decoding included.
    pub all: Histogram,
}

impl Stages {
    /// What is told about them.
    pub fn times(&self) -> Vec<StageTimes> {
        let stages = [
            ("decode", &self.decode),
            ("wait", &self.wait),
            ("prepare", &self.prepare),
            ("features", &self.features),
            ("matching", &self.matching),
            ("position", &self.position),
            ("tell", &self.tell),
            ("frame_to_answer", &self.all),
        ];
        let times = |(stage, histogram): (&'static str, &Histogram)| StageTimes {
            stage,
            count: histogram.count,
            p50_ms: histogram.quantile_ms(0.5),
            p99_ms: histogram.quantile_ms(0.99),
            max_ms: histogram.longest.as_secs_f64() * 1e3,
        };
        stages.into_iter().map(times).collect()
    }
}

/// Resident memory of this process, as the kernel counts it.
pub fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix(" kB")?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1_024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_within_a_step() {
        let mut histogram = Histogram::default();
        (1..=1_000).for_each(|ms| histogram.enter(Duration::from_millis(ms)));
        for (share, exact) in [(0.5, 500.0), (0.99, 990.0), (1.0, 1_000.0)] {
            let found = histogram.quantile_ms(share);
            assert!(found >= exact && found <= exact * 1.045, "{share}: {found}");
        }
        assert_eq!(Histogram::default().quantile_ms(0.5), 0.0);
        histogram.enter(Duration::from_secs(100_000));
        histogram.enter(Duration::ZERO);
        assert!(histogram.quantile_ms(1.0) >= 100_000.0);
    }

    #[test]
    fn a_process_has_some_memory() {
        assert!(resident_bytes().is_some_and(|bytes| bytes > 100_000));
    }
}
