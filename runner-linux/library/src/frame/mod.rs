//! Frames from a camera, a pipe, files or a mock, behind one trait, and what is done when they fail.
//!
//! ```text
//!  v4l2 ─┐                                      fault ── what went wrong, and the remedy
//!  pipe ─┤  FrameSource ── capture (a thread:   convert ── GREY YUYV UYVY NV12 YU12 MJPG to gray
//! folder ┤                 waits, drops,         stamp ── a clock that never jumps
//!  mock ─┘                 reopens) ── queue (every frame, or the newest)
//! ```
//!
//! Nothing waits for ever: a source waits at most as long as it is told, the queue has a bound, and the thread looks
//! whether it shall stop at least four times a second.

pub mod fault;
pub mod convert;
pub mod stamp;
pub mod queue;
pub mod capture;
pub mod folder;
pub mod pipe;
pub mod mock;
pub mod v4l2;

use std::time::Duration;

pub use fault::{Fault, Remedy};

use crate::picture::GrayImage;

/// A frame as a source gives it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The picture, in the size that the source gives.
    pub gray: GrayImage,
    /// Its number in the source's own count; missing numbers were lost before they came here.
    pub number: u64,
    /// When it was taken, by the source's clock.
    pub time: Duration,
    /// When it came, since 1970 UTC; sources that are replayed do not say.
    pub utc: Option<Duration>,
    /// Its file's name, if it is one.
    pub file: Option<String>,
    /// How long it took to make gray pixels of what the device gave.
    pub decode: Duration,
}

impl Frame {
    /// A frame without pixels, to be filled by a source.
    pub const fn empty() -> Self {
        Self {
            gray: GrayImage { pixels: Vec::new(), width: 0, height: 0 },
            number: 0,
            time: Duration::ZERO,
            utc: None,
            file: None,
            decode: Duration::ZERO,
        }
    }
}

/// Whatever gives frames.
pub trait FrameSource: Send {
    /// What was opened: device, format and size as they were *given*, in one line.
    fn describe(&self) -> String;

    /// Waits for the next frame, at most about `patience`, and writes it to `frame`.
    ///
    /// # Errors
    /// A [`Fault`]; its [`Remedy`] says whether the source may be asked again.
    fn next(&mut self, frame: &mut Frame, patience: Duration) -> Result<(), Fault>;
}

/// Opens a source as often as need be: a camera that was unplugged comes back as a new one.
pub trait Opener: Send {
    /// What will be opened, as the user named it.
    fn name(&self) -> String;

    /// Opens it.
    ///
    /// # Errors
    /// A [`Fault`], as from a source.
    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault>;

    /// Which frames are wanted when they come faster than they are looked at.
    fn delivery(&self) -> Delivery;

    /// Whether the times of frames come from a device's clock, which may jump.
    fn clock_may_jump(&self) -> bool {
        self.delivery() == Delivery::Newest
    }
}

/// Which frames are wanted when they come faster than they are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delivery {
    /// Every one: the source waits. For files.
    Every,
    /// The newest: older ones are dropped and counted. For whatever does not wait.
    Newest,
}
