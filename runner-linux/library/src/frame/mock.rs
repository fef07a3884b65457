//! Another source with faults put into it: what happens when a camera fails, without one that does.
//!
//! The frames go through the same conversion, recovery and queue as a camera's. Time is the source's.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::convert::{Layout, PixelFormat};
use super::{Delivery, Fault, Frame, FrameSource, Opener};

/// A fault that can be rehearsed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mishap {
    /// No frame in time.
    NoFrame,
    /// A frame whose second half is missing.
    Short,
    /// A JPEG picture that ends in the middle.
    Corrupt,
    /// A JPEG picture of another size.
    WrongSize,
    /// EAGAIN.
    Again,
    /// EIO.
    Io,
    /// EBUSY when it is opened again, after EIO.
    Busy,
    /// ENODEV, and again the first three times that it is opened.
    Unplugged,
    /// From here on the clock is an hour ahead.
    ClockForward,
    /// From here on the clock is an hour behind.
    ClockBack,
}

impl Mishap {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::NoFrame,
        Self::Short,
        Self::Corrupt,
        Self::WrongSize,
        Self::Again,
        Self::Io,
        Self::Busy,
        Self::Unplugged,
        Self::ClockForward,
        Self::ClockBack,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoFrame => "no-frame",
            Self::Short => "short",
            Self::Corrupt => "corrupt",
            Self::WrongSize => "wrong-size",
            Self::Again => "again",
            Self::Io => "io",
            Self::Busy => "busy",
            Self::Unplugged => "unplugged",
            Self::ClockForward => "clock-forward",
            Self::ClockBack => "clock-back",
        }
    }
}

/// A mishap and the frame before which it happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// Number of the frame, from 0.
    pub at: u64,
    /// What happens.
    pub mishap: Mishap,
}

impl FromStr for Planned {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = || Mishap::ALL.map(Mishap::name).join(", ");
        let form = || format!("write FRAME:FAULT, as in 12:unplugged; the faults are {}", known());
        let (at, name) = text.split_once(':').ok_or_else(form)?;
        let mishap = Mishap::ALL.into_iter().find(|mishap| mishap.name() == name).ok_or_else(form)?;
        Ok(Self { at: at.parse().map_err(|_| form())?, mishap })
    }
}

impl fmt::Display for Planned {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}", self.at, self.mishap.name())
    }
}

/// A source with mishaps.
pub struct Mock {
    inner: Box<dyn Opener>,
    shared: Arc<Mutex<Shared>>,
}

impl fmt::Debug for Mock {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Mock").finish_non_exhaustive()
    }
}

/// What outlives a source that is closed and opened again.
struct Shared {
    source: Option<Box<dyn FrameSource>>,
    planned: BTreeMap<u64, VecDeque<Mishap>>,
    /// Number of the next frame.
    next: u64,
    /// Faults of the next attempts to open it.
    closed: VecDeque<Fault>,
    clock_ms: i64,
}

const HOUR_MS: i64 = 3_600_000;

impl Mock {
    /// `inner` with these mishaps.
    pub fn new(inner: Box<dyn Opener>, planned: &[Planned]) -> Self {
        let mut by_frame: BTreeMap<u64, VecDeque<Mishap>> = BTreeMap::new();
        for Planned { at, mishap } in planned {
            by_frame.entry(*at).or_default().push_back(*mishap);
        }
        let closed = VecDeque::new();
        let shared = Shared { source: None, planned: by_frame, next: 0, closed, clock_ms: 10 * HOUR_MS };
        Self { inner, shared: Arc::new(Mutex::new(shared)) }
    }
}

impl Opener for Mock {
    fn name(&self) -> String {
        self.inner.name()
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(fault) = shared.closed.pop_front() {
            return Err(fault);
        }
        if shared.source.is_none() {
            shared.source = Some(self.inner.open()?);
        }
        Ok(Box::new(OpenMock(Arc::clone(&self.shared))))
    }

    fn delivery(&self) -> Delivery {
        self.inner.delivery()
    }

    fn clock_may_jump(&self) -> bool {
        true
    }
}

struct OpenMock(Arc<Mutex<Shared>>);

impl FrameSource for OpenMock {
    fn describe(&self) -> String {
        let shared = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let what = shared.source.as_ref().map_or_else(String::new, |source| source.describe());
        format!("{what}, with faults on purpose")
    }

    fn next(&mut self, frame: &mut Frame, patience: Duration) -> Result<(), Fault> {
        let mut shared = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let shared = &mut *shared;
        let next = shared.next;
        while let Some(mishap) = shared.planned.get_mut(&next).and_then(VecDeque::pop_front) {
            shared.happen(mishap, frame, patience)?;
        }
        shared.source.as_mut().map_or(Err(Fault::End), |source| source.next(frame, patience))?;
        shared.next += 1;
        let ms = i64::try_from(frame.time.as_millis()).unwrap_or(i64::MAX);
        frame.time = Duration::from_millis(ms.saturating_add(shared.clock_ms).max(0).unsigned_abs());
        Ok(())
    }
}

impl Shared {
    fn happen(&mut self, mishap: Mishap, frame: &mut Frame, patience: Duration) -> Result<(), Fault> {
        use rustix::io::Errno;
        let system = |doing: &str, errno: Errno| Fault::of_io(doing, &errno.into());
        let layout = |format| Layout::new(format, 64, 64, None).map_err(Fault::Refused);
        match mishap {
            Mishap::NoFrame => {
                std::thread::sleep(patience);
                Err(Fault::NoFrame { waited: patience })
            }
            Mishap::Short => layout(PixelFormat::Grey)?.to_gray(&[7; 32 * 64], &mut frame.gray),
            Mishap::Corrupt => {
                let picture = jpeg(64);
                layout(PixelFormat::Mjpg)?.to_gray(&picture[..picture.len() / 2], &mut frame.gray)
            }
            Mishap::WrongSize => layout(PixelFormat::Mjpg)?.to_gray(&jpeg(96), &mut frame.gray),
            Mishap::Again => Err(system("read a frame", Errno::AGAIN)),
            Mishap::Io => Err(system("read a frame", Errno::IO)),
            Mishap::Busy => {
                self.closed.push_back(system("open", Errno::BUSY));
                Err(system("read a frame", Errno::IO))
            }
            Mishap::Unplugged => {
                self.closed.extend((0..3).map(|_| system("open", Errno::NODEV)));
                Err(system("read a frame", Errno::NODEV))
            }
            Mishap::ClockForward => {
                self.clock_ms += HOUR_MS;
                Ok(())
            }
            Mishap::ClockBack => {
                self.clock_ms -= HOUR_MS;
                Ok(())
            }
        }
    }
}

/// A gray square as a JPEG picture.
fn jpeg(side: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = image::GrayImage::from_pixel(side, side, image::Luma([90]));
    // Writing to memory does not fail.
    let _ = image::codecs::jpeg::JpegEncoder::new(&mut bytes).encode_image(&picture);
    bytes
}
