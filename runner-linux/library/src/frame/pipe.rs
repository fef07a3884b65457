//! Raw video from standard input, a pipe or a file: `rpicam-vid --codec yuv420 -o - | daymark watch --input - ...`.

use std::fs::File;
use std::io::Read;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::convert::{Layout, PixelFormat};
use super::{Delivery, Fault, Frame, FrameSource, Opener};

/// What a stream of bytes holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Frames one after the other, all alike.
    Raw(Layout),
    /// YUV4MPEG2, which says by itself what it holds.
    Y4m,
}

/// The longest line of a Y4M stream, in bytes.
const LINE: usize = 256;

/// A stream of bytes as a source of frames.
#[derive(Debug)]
pub struct Pipe {
    path: Option<PathBuf>,
    content: Content,
    /// Frames a second of a file, whose times are counted; a live stream's are taken when they come.
    rate_hz: f64,
    live: bool,
    opened: bool,
}

impl Pipe {
    /// The stream at `path`, `-` for standard input.
    ///
    /// # Errors
    /// What is wrong with the path.
    pub fn new(path: &Path, content: Content, rate_hz: f64) -> Result<Self, String> {
        let standard = path == Path::new("-");
        let status = if standard { rustix::fs::fstat(std::io::stdin()) } else { rustix::fs::stat(path) };
        let status = status.map_err(|error| format!("cannot read the input {}: {error}", path.display()))?;
        let live = rustix::fs::FileType::from_raw_mode(status.st_mode) != rustix::fs::FileType::RegularFile;
        Ok(Self { path: (!standard).then(|| path.to_owned()), content, rate_hz, live, opened: false })
    }
}

impl Opener for Pipe {
    fn name(&self) -> String {
        self.path.as_ref().map_or_else(|| "standard input".to_owned(), |path| path.display().to_string())
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        let name = self.name();
        if self.opened {
            return Err(Fault::Refused(format!("{name} broke, and a stream cannot be opened again")));
        }
        self.opened = true;
        let file: OwnedFd = match &self.path {
            None => std::io::stdin().as_fd().try_clone_to_owned().map_err(|error| Fault::of_io(&name, &error))?,
            Some(path) => File::open(path).map_err(|error| Fault::of_io(&name, &error))?.into(),
        };
        let mut stream = Stream { file: file.into(), bytes: Vec::new(), filled: 0 };
        let mut rate_hz = self.rate_hz;
        let (layout, frame_bytes, marked) = match self.content {
            Content::Raw(layout) => (layout, layout.frame_bytes(), false),
            Content::Y4m => {
                let header = Y4m::parse(&stream.line(Duration::from_secs(10))?).map_err(Fault::Refused)?;
                rate_hz = header.rate_hz.unwrap_or(rate_hz);
                (header.layout, header.frame_bytes, true)
            }
        };
        stream.bytes.reserve(frame_bytes);
        let what =
            Open { name, stream, layout, frame_bytes, marked, in_frame: false, number: 0, rate_hz, live: self.live };
        Ok(Box::new(what))
    }

    fn delivery(&self) -> Delivery {
        if self.live { Delivery::Newest } else { Delivery::Every }
    }

    fn clock_may_jump(&self) -> bool {
        false
    }
}

/// Bytes that came so far of what is waited for.
struct Stream {
    file: File,
    bytes: Vec<u8>,
    filled: usize,
}

impl Stream {
    /// Fills up to `expected` bytes; what came stays for the next call if it takes too long.
    fn fill(&mut self, expected: usize, patience: Duration) -> Result<(), Fault> {
        let until = Instant::now() + patience;
        self.bytes.resize(expected.max(self.filled), 0);
        while self.filled < expected {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Fault::NoFrame { waited: patience });
            }
            let timeout = Timespec::try_from(left).ok();
            let waited = poll(&mut [PollFd::new(&self.file, PollFlags::IN)], timeout.as_ref());
            match waited {
                Ok(0) => return Err(Fault::NoFrame { waited: patience }),
                Ok(_) => {}
                Err(error) => return Err(Fault::of_io("wait for the input", &error.into())),
            }
            match self.file.read(&mut self.bytes[self.filled..expected]) {
                Ok(0) if self.filled == 0 => return Err(Fault::End),
                Ok(0) => {
                    let found = std::mem::take(&mut self.filled);
                    return Err(Fault::Short { found, expected });
                }
                Ok(count) => self.filled += count,
                Err(error) => return Err(Fault::of_io("read the input", &error)),
            }
        }
        Ok(())
    }

    /// A line, byte by byte; the next frame begins after it.
    fn line(&mut self, patience: Duration) -> Result<String, Fault> {
        while !self.bytes[..self.filled].ends_with(b"\n") {
            if self.filled >= LINE {
                return Err(Fault::Refused(format!("a line of more than {LINE} bytes: this is not Y4M")));
            }
            self.fill(self.filled + 1, patience)?;
        }
        let line = String::from_utf8_lossy(&self.bytes[..self.filled - 1]).into_owned();
        self.filled = 0;
        Ok(line)
    }
}

struct Open {
    name: String,
    stream: Stream,
    layout: Layout,
    frame_bytes: usize,
    /// Each frame begins with a line.
    marked: bool,
    /// That line was read.
    in_frame: bool,
    number: u64,
    rate_hz: f64,
    live: bool,
}

impl FrameSource for Open {
    fn describe(&self) -> String {
        let Layout { format, width, height, stride } = self.layout;
        let kind = if self.marked { "Y4M".to_owned() } else { format!("{format}, rows of {stride} bytes") };
        format!("{}: {width} x {height} px, {kind}, {} bytes a frame", self.name, self.frame_bytes)
    }

    fn next(&mut self, frame: &mut Frame, patience: Duration) -> Result<(), Fault> {
        if self.marked && !self.in_frame {
            let line = self.stream.line(patience)?;
            if !line.starts_with("FRAME") {
                return Err(Fault::Refused(format!(
                    "{}: frame {} of the Y4M stream does not begin with FRAME; the stream lost its step",
                    self.name, self.number
                )));
            }
            self.in_frame = true;
        }
        self.stream.fill(self.frame_bytes, patience)?;
        let begin = Instant::now();
        self.stream.filled = 0;
        self.in_frame = false;
        frame.number = self.number;
        self.number += 1;
        let since_epoch = || SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
        (frame.time, frame.utc) = if self.live {
            (monotonic(), since_epoch())
        } else {
            (Duration::from_secs_f64(frame.number as f64 / self.rate_hz), None)
        };
        self.layout.to_gray(&self.stream.bytes, &mut frame.gray)?;
        frame.decode = begin.elapsed();
        Ok(())
    }
}

/// The clock that frames of cameras are stamped with.
pub(super) fn monotonic() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Duration::try_from(now).unwrap_or_default()
}

/// The first line of a Y4M stream.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Y4m {
    layout: Layout,
    frame_bytes: usize,
    rate_hz: Option<f64>,
}

impl Y4m {
    fn parse(line: &str) -> Result<Self, String> {
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some("YUV4MPEG2") {
            return Err("the input does not begin as Y4M: give --format, --width and --height for raw video".to_owned());
        }
        let (mut width, mut height, mut rate_hz, mut colours) = (0, 0, None, "420");
        for word in words {
            let (Some(tag), Some(value)) = (word.get(..1), word.get(1..)) else { continue };
            let number = || value.parse::<usize>().map_err(|_| format!("the Y4M stream says {word:?}"));
            match tag {
                "W" => width = number()?,
                "H" => height = number()?,
                "F" => rate_hz = rate(value),
                "C" => colours = value,
                _ => {}
            }
        }
        // Only the gray levels are looked at, which lie in front; the colours are skipped.
        let layout = Layout::new(PixelFormat::Grey, width, height, None)?;
        let (half, luma) = (width.div_ceil(2), width * height);
        let frame_bytes = match colours {
            "420" | "420jpeg" | "420mpeg2" | "420paldv" => luma + 2 * half * height.div_ceil(2),
            "422" => luma + 2 * half * height,
            "444" => 3 * luma,
            "mono" => luma,
            other => return Err(format!("the Y4M stream has the colours {other:?}; 420, 422, 444 and mono are read")),
        };
        Ok(Self { layout, frame_bytes, rate_hz })
    }
}

fn rate(text: &str) -> Option<f64> {
    let (frames, seconds) = text.split_once(':')?;
    let rate = frames.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_y4m_header_says_size_rate_and_colours() {
        let header = Y4m::parse("YUV4MPEG2 W640 H481 F30000:1001 Ip A1:1 C420jpeg XCOLORRANGE=FULL").expect("a header");
        assert_eq!(
            (header.layout.width, header.layout.height, header.frame_bytes),
            (640, 481, 640 * 481 + 2 * 320 * 241)
        );
        assert!(header.rate_hz.is_some_and(|rate| (rate - 29.97).abs() < 0.01));
        assert_eq!(Y4m::parse("YUV4MPEG2 W64 H48 Cmono").map(|header| header.frame_bytes), Ok(3_072));
        for wrong in ["", "RIFF", "YUV4MPEG2 W640", "YUV4MPEG2 Wx H480", "YUV4MPEG2 W640 H480 C420p10"] {
            assert!(Y4m::parse(wrong).is_err(), "{wrong}");
        }
    }
}
