//! Between the thread that takes frames and the one that looks at them: every frame in its order, or the newest.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::{Delivery, Fault, Frame};

/// Frames that wait where every frame counts.
const FRAMES: usize = 4;
/// Things that wait, frames and tidings.
const ITEMS: usize = 256;
/// How long a thread sleeps at most before it looks whether it shall stop.
const GLANCE: Duration = Duration::from_millis(250);

/// What comes from a source.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A frame, and when it came.
    Frame(Frame, Instant),
    /// Something about the source itself.
    Tidings(Tidings),
    /// Nothing more will come; an error if it should have.
    End(Result<(), String>),
}

/// What there is to tell about a source.
#[derive(Debug, Clone, PartialEq)]
pub enum Tidings {
    /// It was opened, with what it says of itself.
    Opened(String),
    /// Frames were left out.
    LeftOut {
        /// Why the latest was.
        fault: Fault,
        /// How many in a row.
        in_a_row: u32,
    },
    /// It failed and will be opened again.
    Lost {
        /// Why.
        fault: Fault,
        /// Failures since the last good frame.
        attempt: u32,
        /// Pause before it is opened again.
        again_in: Duration,
    },
    /// The source's clock jumped by this many seconds; times of frames go on regardless.
    ClockJumped(f64),
}

/// What was counted so far.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SourceCounts {
    /// Frames that came whole.
    pub frames: u64,
    /// Whole frames that nobody looked at, because a newer one came.
    pub stale: u64,
    /// Frames that the source's own numbers show to be missing.
    pub missing: u64,
    /// How often the source was opened.
    pub opened: u64,
    /// Jumps of the source's clock.
    pub clock_jumps: u64,
    /// Faults by their codes.
    pub faults: BTreeMap<&'static str, u64>,
}

/// A queue with one thread at each end.
#[derive(Debug)]
pub struct Queue {
    delivery: Delivery,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    items: VecDeque<Item>,
    frames: usize,
    counts: SourceCounts,
    stopped: bool,
}

impl Queue {
    /// An empty queue.
    pub fn new(delivery: Delivery) -> Self {
        Self { delivery, state: Mutex::default(), changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Counters and whole items: nothing is half done when a thread ends.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits a little for a change.
    fn wait<'s>(&self, state: MutexGuard<'s, State>, longest: Duration) -> MutexGuard<'s, State> {
        self.changed.wait_timeout(state, longest.min(GLANCE)).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Adds a frame. Where every frame counts, waits for room; else drops an older one.
    pub fn push_frame(&self, frame: Frame) {
        let arrived = Instant::now();
        let mut state = self.state();
        state.counts.frames += 1;
        match self.delivery {
            Delivery::Newest => {
                if let Some(at) = state.items.iter().position(|item| matches!(item, Item::Frame(..))) {
                    state.items.remove(at);
                    state.frames -= 1;
                    state.counts.stale += 1;
                }
            }
            Delivery::Every => {
                while state.frames >= FRAMES && !state.stopped {
                    state = self.wait(state, GLANCE);
                }
            }
        }
        state.frames += 1;
        state.items.push_back(Item::Frame(frame, arrived));
        drop(state);
        self.changed.notify_all();
    }

    /// Adds something to tell. If nobody listens, the oldest tidings are forgotten; what they counted is not.
    pub fn push(&self, item: Item) {
        let mut state = self.state();
        if state.items.len() >= ITEMS
            && let Some(at) = state.items.iter().position(|item| matches!(item, Item::Tidings(_)))
        {
            state.items.remove(at);
        }
        state.items.push_back(item);
        drop(state);
        self.changed.notify_all();
    }

    /// Takes the next item, or nothing if none came for `longest`.
    pub fn pop(&self, longest: Duration) -> Option<Item> {
        let until = Instant::now() + longest;
        let mut state = self.state();
        loop {
            if let Some(item) = state.items.pop_front() {
                state.frames -= usize::from(matches!(item, Item::Frame(..)));
                drop(state);
                self.changed.notify_all();
                return Some(item);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            state = self.wait(state, left);
        }
    }

    /// Changes the counts.
    pub fn count(&self, change: impl FnOnce(&mut SourceCounts)) {
        change(&mut self.state().counts);
    }

    /// The counts so far.
    pub fn counts(&self) -> SourceCounts {
        self.state().counts.clone()
    }

    /// Asks the source's thread to end.
    pub fn stop(&self) {
        self.state().stopped = true;
        self.changed.notify_all();
    }

    /// Whether the source's thread shall end.
    pub fn is_stopped(&self) -> bool {
        self.state().stopped
    }

    /// Waits, but no longer than until it shall stop.
    pub fn pause(&self, length: Duration) {
        let until = Instant::now() + length;
        let mut state = self.state();
        while !state.stopped {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            state = self.wait(state, left);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u64) -> Frame {
        Frame { number, ..Frame::empty() }
    }

    fn numbers(queue: &Queue) -> Vec<u64> {
        let next = || match queue.pop(Duration::from_millis(1)) {
            Some(Item::Frame(frame, _)) => Some(frame.number),
            _ => None,
        };
        std::iter::from_fn(next).collect()
    }

    #[test]
    fn the_newest_frame_wins_and_the_others_are_counted() {
        let queue = Queue::new(Delivery::Newest);
        (0..1_000).for_each(|number| queue.push_frame(frame(number)));
        assert_eq!(numbers(&queue), [999]);
        assert_eq!((queue.counts().frames, queue.counts().stale), (1_000, 999));
    }

    #[test]
    fn where_every_frame_counts_the_source_waits_and_a_stop_frees_it() {
        let queue = Queue::new(Delivery::Every);
        std::thread::scope(|scope| {
            let source = scope.spawn(|| (0..100).for_each(|number| queue.push_frame(frame(number))));
            std::thread::sleep(Duration::from_millis(20));
            assert_eq!(queue.counts().frames, FRAMES as u64 + 1, "it waits with the next in its hand");
            let mut seen = Vec::new();
            while seen.len() < 50 {
                seen.extend(numbers(&queue).into_iter().take(50));
            }
            queue.stop();
            source.join().expect("it ends");
            assert!(seen.iter().copied().eq(0..seen.len() as u64), "{seen:?}");
        });
    }

    #[test]
    fn tidings_that_nobody_takes_do_not_pile_up() {
        let queue = Queue::new(Delivery::Newest);
        (0..10_000).for_each(|n| queue.push(Item::Tidings(Tidings::ClockJumped(f64::from(n)))));
        queue.push(Item::End(Ok(())));
        assert!(queue.state().items.len() <= ITEMS);
        let last = std::iter::from_fn(|| queue.pop(Duration::ZERO)).last();
        assert_eq!(last, Some(Item::End(Ok(()))));
    }
}
