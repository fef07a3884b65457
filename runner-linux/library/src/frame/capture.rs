//! The thread that takes frames: whatever the source, faults are met in the same way.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::queue::{Item, Queue, SourceCounts, Tidings};
use super::stamp::Stamps;
use super::{Fault, Frame, FrameSource, Opener, Remedy};

/// How patient the thread is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// A frame that takes longer is missing.
    pub frame: Duration,
    /// Frames left out in a row, missing ones included, after which the source is opened again.
    pub left_out: u32,
    /// Pause before the source is opened again, the first time; it doubles with each failure.
    pub pause: Duration,
    /// The longest pause.
    pub longest_pause: Duration,
}

impl Patience {
    /// For a camera.
    pub const CAMERA: Self = Self {
        frame: Duration::from_secs(2),
        left_out: 8,
        pause: Duration::from_millis(500),
        longest_pause: Duration::from_secs(30),
    };
    /// The same without waiting, for tests and rehearsals.
    pub const REHEARSAL: Self = Self {
        frame: Duration::from_millis(2),
        left_out: 8,
        pause: Duration::from_millis(1),
        longest_pause: Duration::from_millis(4),
    };
}

/// "Again" that often in a row is a missing frame.
const AGAIN_LIMIT: u32 = 64;
/// Between two times "again".
const AGAIN_PAUSE: Duration = Duration::from_millis(2);

/// A running capture. When it is dropped the thread ends.
#[derive(Debug)]
pub struct Capture {
    queue: Arc<Queue>,
    thread: Option<JoinHandle<()>>,
}

impl Capture {
    /// Starts the thread. It ends by itself after [`Item::End`].
    ///
    /// # Errors
    /// What the system says if it cannot start a thread.
    pub fn start(opener: Box<dyn Opener>, patience: Patience) -> std::io::Result<Self> {
        let queue = Arc::new(Queue::new(opener.delivery()));
        let own = Arc::clone(&queue);
        let body = move || Worker { stamps: Stamps::new(opener.clock_may_jump()), queue: own, opener, patience }.run();
        let thread = std::thread::Builder::new().name("frames".to_owned()).spawn(body)?;
        Ok(Self { queue, thread: Some(thread) })
    }

    /// The next item, or nothing if none came for `longest`.
    pub fn next(&self, longest: Duration) -> Option<Item> {
        self.queue.pop(longest)
    }

    /// What was counted so far.
    pub fn counts(&self) -> SourceCounts {
        self.queue.counts()
    }
}

impl Drop for Capture {
    fn drop(&mut self) {
        self.queue.stop();
        if let Some(thread) = self.thread.take() {
            // It panicked or it did not: there is nothing left to do for it.
            let _ = thread.join();
        }
    }
}

struct Worker {
    opener: Box<dyn Opener>,
    patience: Patience,
    queue: Arc<Queue>,
    stamps: Stamps,
}

/// How the use of an opened source ended.
enum Ended {
    Stopped,
    Finished(Result<(), String>),
    /// It has to be opened again; there were good frames before, or not.
    Failed(Fault, bool),
}

impl Worker {
    fn run(mut self) {
        let mut attempt = 0_u32;
        loop {
            let ended = match self.opener.open() {
                Ok(source) => self.take_frames(source),
                Err(fault) => self.after(fault, false),
            };
            let (fault, after_good_frames) = match ended {
                Ended::Stopped => return,
                Ended::Finished(how) => return self.queue.push(Item::End(how)),
                Ended::Failed(fault, good) => (fault, good),
            };
            attempt = if after_good_frames { 1 } else { attempt + 1 };
            let doubled = self.patience.pause.saturating_mul(1 << (attempt - 1).min(16));
            let again_in = doubled.min(self.patience.longest_pause);
            if attempt.is_power_of_two() {
                self.tell(Tidings::Lost { fault, attempt, again_in });
            }
            self.stamps.interrupted();
            self.queue.pause(again_in);
            if self.queue.is_stopped() {
                return;
            }
        }
    }

    /// A fault outside of the stream: only opening again helps, if anything does.
    fn after(&self, fault: Fault, good: bool) -> Ended {
        self.count(&fault);
        match fault.remedy() {
            Remedy::Finish => Ended::Finished(Ok(())),
            Remedy::GiveUp => Ended::Finished(Err(fault.to_string())),
            _ => Ended::Failed(fault, good),
        }
    }

    fn take_frames(&mut self, mut source: Box<dyn FrameSource>) -> Ended {
        self.queue.count(|counts| counts.opened += 1);
        self.tell(Tidings::Opened(source.describe()));
        let (mut good, mut left_out, mut again) = (false, 0_u32, 0_u32);
        let mut latest_number = None;
        while !self.queue.is_stopped() {
            let mut frame = Frame::empty();
            let mut fault = match source.next(&mut frame, self.patience.frame) {
                Ok(()) => {
                    (good, left_out, again) = (true, 0, 0);
                    self.note_gap(latest_number.replace(frame.number), frame.number);
                    self.pass_on(frame);
                    continue;
                }
                Err(fault) => fault,
            };
            if fault == Fault::Again {
                self.count(&fault);
                again += 1;
                if again < AGAIN_LIMIT {
                    self.queue.pause(AGAIN_PAUSE);
                    continue;
                }
                again = 0;
                fault = Fault::NoFrame { waited: AGAIN_PAUSE * AGAIN_LIMIT };
            }
            if fault.remedy() != Remedy::Drop {
                return self.after(fault, good);
            }
            self.count(&fault);
            left_out += 1;
            if matches!(fault, Fault::NoFrame { .. }) {
                self.stamps.interrupted();
            }
            if left_out >= self.patience.left_out {
                return Ended::Failed(fault, good);
            }
            if left_out.is_power_of_two() {
                self.tell(Tidings::LeftOut { fault, in_a_row: left_out });
            }
        }
        Ended::Stopped
    }

    fn pass_on(&mut self, mut frame: Frame) {
        let (time, jump) = self.stamps.enter(frame.time);
        frame.time = time;
        if let Some(seconds) = jump {
            self.queue.count(|counts| counts.clock_jumps += 1);
            self.tell(Tidings::ClockJumped(seconds));
        }
        self.queue.push_frame(frame);
    }

    fn note_gap(&self, before: Option<u64>, number: u64) {
        let missing = before.map_or(0, |before| number.saturating_sub(before).saturating_sub(1));
        if missing > 0 {
            self.queue.count(|counts| counts.missing += missing);
        }
    }

    fn count(&self, fault: &Fault) {
        if *fault != Fault::End {
            let code = fault.code();
            self.queue.count(|counts| *counts.faults.entry(code).or_default() += 1);
        }
    }

    fn tell(&self, tidings: Tidings) {
        self.queue.push(Item::Tidings(tidings));
    }
}
