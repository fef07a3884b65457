//! What goes wrong with a source of frames, and what is done about it.

use std::fmt;
use std::io::{self, ErrorKind};
use std::time::Duration;

/// What went wrong with one frame, or with the source of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fault {
    /// Nothing yet, or a signal came between (EAGAIN, EINTR).
    Again,
    /// No frame came for this long.
    NoFrame {
        /// How long was waited.
        waited: Duration,
    },
    /// A frame has too few bytes.
    Short {
        /// Bytes that came.
        found: usize,
        /// Bytes of a frame of this format and size.
        expected: usize,
    },
    /// A frame cannot be decoded.
    Corrupt(String),
    /// A frame has another size than was agreed.
    WrongSize {
        /// Width and height of the frame.
        found: (usize, usize),
        /// Width and height that were agreed.
        expected: (usize, usize),
    },
    /// The driver itself says that the frame is damaged.
    Marked,
    /// The stream is broken (EIO and the like).
    Stream(String),
    /// The device is not there (any more).
    Gone(String),
    /// Another program has the device.
    Busy(String),
    /// There are no more frames, as was to be expected of a file.
    End,
    /// It cannot work, however often it is tried: what was asked for has to be changed.
    Refused(String),
}

/// What is done about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// Ask again at once.
    Again,
    /// Leave out the frame and go on. After many in a row the source is reopened.
    Drop,
    /// Close the source and open it again, later and later.
    Reopen,
    /// The end of a run that went well.
    Finish,
    /// The end of a run that cannot go on.
    GiveUp,
}

impl Fault {
    /// The fault that an error of the operating system means.
    pub fn of_io(doing: &str, error: &io::Error) -> Self {
        use rustix::io::Errno;
        let says = format!("{doing}: {error}");
        match (error.kind(), Errno::from_io_error(error)) {
            (_, Some(Errno::AGAIN | Errno::INTR)) | (ErrorKind::WouldBlock | ErrorKind::Interrupted, _) => Self::Again,
            (_, Some(Errno::NODEV | Errno::NXIO | Errno::NOENT)) => Self::Gone(says),
            (_, Some(Errno::BUSY)) => Self::Busy(says),
            (_, Some(Errno::ACCESS | Errno::PERM)) => Self::Refused(says),
            _ => Self::Stream(says),
        }
    }

    /// A name that programs may rely on.
    pub const fn code(&self) -> &'static str {
        match self {
            Self::Again => "again",
            Self::NoFrame { .. } => "no_frame",
            Self::Short { .. } => "short_frame",
            Self::Corrupt(_) => "corrupt_frame",
            Self::WrongSize { .. } => "wrong_size",
            Self::Marked => "marked_by_driver",
            Self::Stream(_) => "stream_error",
            Self::Gone(_) => "unplugged",
            Self::Busy(_) => "busy",
            Self::End => "end",
            Self::Refused(_) => "refused",
        }
    }

    /// What is done about it.
    pub const fn remedy(&self) -> Remedy {
        match self {
            Self::Again => Remedy::Again,
            Self::NoFrame { .. } | Self::Short { .. } | Self::Corrupt(_) | Self::WrongSize { .. } | Self::Marked => {
                Remedy::Drop
            }
            Self::Stream(_) | Self::Gone(_) | Self::Busy(_) => Remedy::Reopen,
            Self::End => Remedy::Finish,
            Self::Refused(_) => Remedy::GiveUp,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Again => out.write_str("interrupted, asked again"),
            Self::NoFrame { waited } => write!(out, "no frame for {:.1} s", waited.as_secs_f64()),
            Self::Short { found, expected } => write!(out, "a frame of {found} bytes instead of {expected}"),
            Self::Corrupt(why) => write!(out, "a frame that cannot be decoded: {why}"),
            Self::WrongSize { found, expected } => {
                write!(out, "a frame of {} x {} px instead of {} x {}", found.0, found.1, expected.0, expected.1)
            }
            Self::Marked => out.write_str("a frame that the driver marked as damaged"),
            Self::Stream(why) => write!(out, "the stream broke: {why}"),
            Self::Gone(why) => write!(out, "the camera is not there: {why}"),
            Self::Busy(why) => write!(out, "another program has the camera: {why}"),
            Self::End => out.write_str("no more frames"),
            Self::Refused(why) => out.write_str(why),
        }
    }
}

impl std::error::Error for Fault {}
