//! A Video4Linux camera: memory-mapped streaming through the `v4l` crate, whose weak places are met here and nowhere else.
//!
//! - After a time-out its `next` queues a buffer that it never got, which is EINVAL for ever: the missing buffer is
//!   dequeued first.
//! - It returns damaged frames as good ones: the flags are looked at.
//! - It gives the whole mapping: it is cut to the bytes that the driver used.
//! - Dropping a stream panics if stopping fails: it is stopped before, and given up if that fails.

mod controls;
mod list;

pub use controls::Controls;
pub use list::list;

use std::io;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use v4l::buffer::{Flags as BufferFlags, Type};
use v4l::capability::{Capabilities, Flags};
use v4l::io::mmap::Stream;
use v4l::io::traits::{CaptureStream, Stream as _};
use v4l::video::Capture;
use v4l::video::capture::Parameters;
use v4l::{Device, Format, FourCC, Fraction};

use super::convert::{Layout, PixelFormat};
use super::pipe::monotonic;
use super::{Delivery, Fault, Frame, FrameSource, Opener};

/// Buffers that the driver fills in turn.
const BUFFERS: u32 = 4;
/// Drivers that give raw Bayer frames, for which libcamera exists.
const RAW_DRIVERS: [&str; 3] = ["unicam", "bcm2835-unicam", "rp1-cfe"];

/// A camera and what is wanted of it.
#[derive(Debug, Clone)]
pub struct Camera {
    /// Its device, such as `/dev/video0` or a link in `/dev/v4l/by-id`.
    pub path: PathBuf,
    /// The size to ask for.
    pub size: (u32, u32),
    /// The format to ask for; the least work otherwise.
    pub format: Option<PixelFormat>,
    /// Frames a second to ask for.
    pub rate_hz: Option<f64>,
    /// What to set on the device.
    pub controls: Controls,
}

impl Opener for Camera {
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        let name = self.name();
        let fault = |doing: &str, error: &io::Error| match Fault::of_io(&format!("{name}: {doing}"), error) {
            Fault::Refused(why) => Fault::Refused(format!(
                "{why}; put your user into the group video (sudo usermod -aG video $USER) and log in again"
            )),
            // Only frames are asked for again.
            Fault::Again => Fault::Busy(format!("{name}: {doing}: {error}")),
            fault => fault,
        };
        let device = Device::with_path(&self.path).map_err(|error| fault("open", &error))?;
        self.check_kind(&device, &fault)?;
        let layout = self.agree(&device, &fault)?;
        if let Some(rate_hz) = self.rate_hz {
            let interval = Fraction::new(1_000, (rate_hz * 1e3) as u32);
            if let Err(error) = device.set_params(&Parameters::new(interval)) {
                tracing::warn!(camera = %name, %error, "the frame rate cannot be set");
            }
        }
        let settings = self.controls.set(&device, &name);
        let rate = device.params().map_or_else(
            |_| String::new(),
            |parameters| {
                let Fraction { numerator, denominator } = parameters.interval;
                if numerator == 0 {
                    String::new()
                } else {
                    format!(", {:.4} a second", f64::from(denominator) / f64::from(numerator))
                }
            },
        );
        let stream =
            Stream::with_buffers(&device, Type::VideoCapture, BUFFERS).map_err(|error| fault("map buffers", &error))?;
        let Layout { format, width, height, stride } = layout;
        let rows = if stride == 0 { String::new() } else { format!(", rows of {stride} bytes") };
        let given = format!("{name}: the driver gives {format}, {width} x {height} px{rows}{rate}{settings}");
        let stream = ManuallyDrop::new(stream);
        Ok(Box::new(Open { name, stream, layout, given, owed: false, sequence: None }))
    }

    fn delivery(&self) -> Delivery {
        Delivery::Newest
    }
}

/// Driver, card and abilities of a device. The crate panics if the card's name is not UTF-8, so that is looked at first,
/// where the kernel tells it, too.
pub(super) fn capabilities(device: &Device, path: &Path) -> Option<Capabilities> {
    let node = std::fs::canonicalize(path).ok()?;
    let known = Path::new("/sys/class/video4linux").join(node.file_name()?).join("name");
    if std::fs::read(known).is_ok_and(|name| std::str::from_utf8(&name).is_err()) {
        return None;
    }
    device.query_caps().ok()
}

impl Camera {
    fn check_kind(&self, device: &Device, fault: &dyn Fn(&str, &io::Error) -> Fault) -> Result<(), Fault> {
        let name = self.name();
        let refuse = |why: String| Err(Fault::Refused(why));
        let Some(capabilities) = capabilities(device, &self.path) else {
            // The device may have gone between two calls; else it is no camera.
            return match device.format() {
                Ok(_) => Ok(()),
                Err(error) if error.raw_os_error() == Some(rustix::io::Errno::NOTTY.raw_os_error()) => {
                    refuse(format!("{name} is not a camera; daymark watch --list shows those that are there"))
                }
                Err(error) => Err(fault("ask what it is", &error)),
            };
        };
        if RAW_DRIVERS.contains(&capabilities.driver.as_str()) {
            let (width, height) = self.size;
            return refuse(format!(
                "{name} gives raw sensor data (driver {}), which libcamera turns into pictures. Run this instead:\n  \
                 rpicam-vid -t 0 --nopreview --codec yuv420 --width {width} --height {height} -o - | daymark watch \
                 --input - --format yu12 --width {width} --height {height} --stride {} --table TABLE",
                capabilities.driver,
                width.next_multiple_of(64)
            ));
        }
        let can = capabilities.capabilities;
        if can.contains(Flags::VIDEO_CAPTURE_MPLANE) && !can.contains(Flags::VIDEO_CAPTURE) {
            return refuse(format!(
                "{name} gives frames in several planes, which is not supported; use a pipe: --input -"
            ));
        }
        if !can.contains(Flags::VIDEO_CAPTURE) || !can.contains(Flags::STREAMING) {
            return refuse(format!(
                "{name} ({}) does not give frames; a camera often has a second device beside it: see daymark watch --list",
                capabilities.card
            ));
        }
        Ok(())
    }

    /// Asks for a format and reads back what the driver made of it.
    fn agree(&self, device: &Device, fault: &dyn Fn(&str, &io::Error) -> Fault) -> Result<Layout, Fault> {
        let offered: Vec<[u8; 4]> = device
            .enum_formats()
            .map_err(|error| fault("ask for its formats", &error))?
            .into_iter()
            .map(|format| format.fourcc.repr)
            .collect();
        let known = PixelFormat::ALL.into_iter().find(|format| offered.contains(&format.fourcc()));
        let wanted = self.format.or(known).unwrap_or(PixelFormat::Yuyv);
        let wanted = Format::new(self.size.0, self.size.1, FourCC::new(&wanted.fourcc()));
        let given = device.set_format(&wanted).map_err(|error| fault("set the format", &error))?;
        let name = self.name();
        let Some(format) = PixelFormat::from_fourcc(given.fourcc.repr) else {
            let text = |fourcc: &[u8; 4]| String::from_utf8_lossy(fourcc).into_owned();
            let (given, offered) = (text(&given.fourcc.repr), offered.iter().map(text).collect::<Vec<_>>().join(", "));
            return Err(Fault::Refused(format!(
                "{name} gives {given}, which cannot be read; it offers {offered}, and one of GREY, NV12, YU12, YUYV, UYVY, \
                 MJPG is needed"
            )));
        };
        let stride = (given.stride > 0).then_some(given.stride as usize);
        Layout::new(format, given.width as usize, given.height as usize, stride)
            .map_err(|why| Fault::Refused(format!("{name}: the driver gave a size that cannot be: {why}")))
    }
}

struct Open {
    name: String,
    stream: ManuallyDrop<Stream<'static>>,
    layout: Layout,
    given: String,
    /// A buffer was queued and did not come back in time.
    owed: bool,
    /// The driver's latest sequence number, and ours.
    sequence: Option<(u32, u64)>,
}

impl FrameSource for Open {
    fn describe(&self) -> String {
        self.given.clone()
    }

    fn next(&mut self, frame: &mut Frame, patience: Duration) -> Result<(), Fault> {
        let fault = |error: &io::Error| match error.kind() {
            io::ErrorKind::TimedOut => Fault::NoFrame { waited: patience },
            _ => Fault::of_io(&format!("{}: read a frame", self.name), error),
        };
        self.stream.set_timeout(patience.min(Duration::from_secs(60)));
        if self.owed {
            // This frame is lost: the crate gives pictures out by `next` only.
            CaptureStream::dequeue(&mut *self.stream).map_err(|error| fault(&error))?;
            self.owed = false;
        }
        let (bytes, meta) = match CaptureStream::next(&mut *self.stream) {
            Ok(next) => next,
            Err(error) => {
                self.owed = true;
                return Err(fault(&error));
            }
        };
        let begin = Instant::now();
        let number = match self.sequence {
            Some((before, number)) => number + u64::from(meta.sequence.wrapping_sub(before)),
            None => u64::from(meta.sequence),
        };
        self.sequence = Some((meta.sequence, number));
        frame.number = number;
        let now = monotonic();
        let steady = meta.flags & BufferFlags::TIMESTAMP_MASK == BufferFlags::TIMESTAMP_MONOTONIC;
        frame.time = if steady { meta.timestamp.into() } else { now };
        let age = now.saturating_sub(frame.time);
        let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
        frame.utc = since_epoch.map(|utc| utc.saturating_sub(age));
        if meta.flags.contains(BufferFlags::ERROR) {
            return Err(Fault::Marked);
        }
        let used = bytes.get(..meta.bytesused as usize).unwrap_or(bytes);
        self.layout.to_gray(used, &mut frame.gray)?;
        frame.decode = begin.elapsed();
        Ok(())
    }
}

impl Drop for Open {
    #[expect(unsafe_code, reason = "the stream's own drop would panic")]
    fn drop(&mut self) {
        let stopped = self.stream.stop();
        let gone = |error: &io::Error| error.raw_os_error() == Some(rustix::io::Errno::NODEV.raw_os_error());
        match stopped {
            Err(error) if !gone(&error) => {
                tracing::error!(camera = %self.name, %error, "the stream cannot be stopped; its buffers are left to the kernel");
                let descriptor = self.stream.handle().fd();
                // SAFETY: nothing uses the descriptor any more: the stream, which holds it, is never touched again and
                // never dropped, and the device beside it was dropped when the stream was made.
                unsafe { rustix::io::close(descriptor) };
            }
            _ => {
                // SAFETY: it is not used after this.
                unsafe { ManuallyDrop::drop(&mut self.stream) };
            }
        }
    }
}
