//! `daymark watch`: a camera, a pipe or a folder becomes answers that stand until they are withdrawn.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use daymark_core::verdict::FalseAnswer;

use super::recognize::probability;
use super::{CommandError, Outcome};
use crate::frame::capture::{Capture, Patience};
use crate::frame::convert::{Layout, PixelFormat};
use crate::frame::folder::Folder;
use crate::frame::mock::{Mock, Planned};
use crate::frame::pipe::{Content, Pipe};
use crate::frame::v4l2::{Camera, Controls, list};
use crate::frame::{Delivery, Opener};
use crate::lens_source::LensArgs;
use crate::log;
use crate::near::PriorArgs;
use crate::output::target::{Sink, Target};
use crate::output::{FormName, Wanted};
use crate::watch::look::Recognizing;
use crate::watch::run::{Output, Run};
use crate::watch::session::Session;
use crate::watch::signals::Signals;
use crate::watch::table::{LiveTable, Reloader};

/// Arguments of `daymark watch`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag")]
#[command(
    group(clap::ArgGroup::new("source").required(true).args(["camera", "input", "frames", "list"])),
    after_help = "Exit codes: 0 some answer was given, or it was asked to stop; 1 the frames ended without an answer; 2 an \
                  error.\nSignals: SIGTERM ends cleanly, SIGHUP reads the table again, SIGUSR1 tells the counters."
)]
pub struct Args {
    /// The table to recognize buildings of; when the file changes it is exchanged without a pause
    #[arg(long, value_name = "TABLE", required_unless_present = "list")]
    table: Option<PathBuf>,
    /// A camera: /dev/video0, or a link in /dev/v4l/by-id, which stays the same when others come and go
    #[arg(long, value_name = "DEVICE")]
    camera: Option<PathBuf>,
    /// Raw video: a file, a named pipe, or - for standard input
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Pictures, in the order of their names: a folder, or a file
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// List cameras with their formats and sizes, and end
    #[arg(long)]
    list: bool,

    /// The format to ask a camera for (the least work otherwise), or that raw video has
    #[arg(long, value_name = "FORMAT")]
    format: Option<Format>,
    /// Pixels in a row
    #[arg(long, value_name = "PIXELS", default_value_t = 640)]
    width: u32,
    /// Rows
    #[arg(long, value_name = "PIXELS", default_value_t = 480)]
    height: u32,
    /// Bytes from row to row of raw video, if rows are padded; rpicam-vid pads to 64
    #[arg(long, value_name = "BYTES")]
    stride: Option<usize>,
    /// Frames a second: what a camera is asked for, and the times of pictures and of video in files [default for
    /// files: 10]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Show pictures when they are due, and lose those that come too early, as from a camera
    #[arg(long, requires = "frames")]
    real_time: bool,
    /// Lock a camera's exposure, so that it does not hunt between sky and wall
    #[arg(long, value_name = "MS", requires = "camera")]
    exposure: Option<f64>,
    /// Lock a camera's gain, in its own units
    #[arg(long, value_name = "N", requires = "camera")]
    gain: Option<i64>,
    /// Lock a camera's focus, in its own units; 0 is far for most
    #[arg(long, value_name = "N", requires = "camera")]
    focus: Option<i64>,
    /// Open a camera again after this long without a frame, eight times over
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = rate)]
    frame_timeout: f64,

    /// Answer only if the answer is false with at most this probability, by all frames of a scene; smaller is more careful
    #[arg(long, value_name = "PROBABILITY", default_value_t = 0.01, value_parser = probability)]
    max_false_answer: f64,
    /// A building is recognized from this far at most: how well its place tells yours
    #[arg(long, value_name = "METRES", default_value_t = 100.0, value_parser = rate)]
    reach: f64,

    /// You move with up to about this speed; positions are averaged as far as that allows, and 0 is for a camera that stands
    #[arg(long, value_name = "METRES_PER_SECOND", default_value_t = 2.0, value_parser = speed)]
    speed: f64,
    #[command(flatten)]
    lens: LensArgs,
    #[command(flatten)]
    prior: PriorArgs,

    /// What to write, and where: text, jsonl, nmea or geojson, then :- (standard output), :FILE, :/dev/ttyUSB0@4800 or
    /// :udp://HOST:PORT. May be given several times [default: text:-]
    #[arg(long, value_name = "FORM[:TARGET]")]
    output: Vec<Wanted>,
    /// The same as --output jsonl:-
    #[arg(long)]
    json: bool,
    /// Tell at the end where the time went, by stage, and the memory in use
    #[arg(long)]
    stats: bool,
    /// Tell that this often, too
    #[arg(long, value_name = "SECONDS", value_parser = rate)]
    stats_every: Option<f64>,
    /// Rehearse a fault before a frame of --frames, as in 12:unplugged; --rehearse help lists them. May be given several
    /// times
    #[arg(long, value_name = "FRAME:FAULT", requires = "frames", conflicts_with = "real_time")]
    rehearse: Vec<Planned>,
}

/// A format on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// 8 bit gray, "Y8"
    #[value(alias = "y8", alias = "gray")]
    Grey,
    /// Packed Y U Y V
    Yuyv,
    /// Packed U Y V Y
    Uyvy,
    /// Y, then U V
    Nv12,
    /// Y, then U, then V
    #[value(alias = "yuv420", alias = "i420")]
    Yu12,
    /// JPEG pictures, cameras only
    Mjpg,
    /// A stream that says by itself what it is; pipes and files only
    Y4m,
}

impl Format {
    fn pixels(self) -> Option<PixelFormat> {
        match self {
            Self::Grey => Some(PixelFormat::Grey),
            Self::Yuyv => Some(PixelFormat::Yuyv),
            Self::Uyvy => Some(PixelFormat::Uyvy),
            Self::Nv12 => Some(PixelFormat::Nv12),
            Self::Yu12 => Some(PixelFormat::Yu12),
            Self::Mjpg => Some(PixelFormat::Mjpg),
            Self::Y4m => None,
        }
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-3..=1e6).contains(&value) => Ok(value),
        _ => Err("give a number between 0.001 and 1000000".to_owned()),
    }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1_000.0).contains(&value) => Ok(value),
        _ => Err("give metres a second between 0 and 1000".to_owned()),
    }
}

/// Runs the command.
///
/// # Errors
/// A table, source or output that cannot be used; a run that cannot go on.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if args.list {
        io::stdout().write_all(list().as_bytes())?;
        return Ok(Outcome::Done);
    }
    let path = args.table.as_ref().ok_or("give the table to recognize buildings of: --table TABLE")?;
    let signals = Signals::listen()?;
    log::to_stderr();
    let table = LiveTable::load(path)?;
    let reloader = Reloader::new(path);
    if table.table().view_count() == 0 {
        tracing::warn!(table = %path.display(), "the table has no buildings yet; they can be added while running");
    }
    let (opener, patience) = source(args)?;
    let name = opener.name();
    let delivery = opener.delivery();
    let outputs = outputs(args, delivery == Delivery::Every)?;
    let limit = FalseAnswer::at_most(args.max_false_answer);
    let look = Recognizing::new(table, limit, args.lens.read()?, args.prior.clone(), args.reach);
    let run = Run {
        capture: Capture::start(opener, patience)?,
        session: Session::new(look, args.max_false_answer, args.reach, args.speed),
        outputs,
        signals,
        reloader: Some(reloader),
        stats: args.stats,
        stats_every: args.stats_every.map(Duration::from_secs_f64),
    };
    Ok(if run.run(name)? { Outcome::Done } else { Outcome::NoAnswer })
}

fn source(args: &Args) -> Result<(Box<dyn Opener>, Patience), CommandError> {
    let camera = Patience { frame: Duration::from_secs_f64(args.frame_timeout), ..Patience::CAMERA };
    if let Some(path) = &args.camera {
        let format = match args.format {
            Some(Format::Y4m) => return Err("no camera gives y4m; leave out --format, or see --list".into()),
            format => format.and_then(Format::pixels),
        };
        let controls = Controls { exposure_ms: args.exposure, gain: args.gain, focus: args.focus };
        let size = (args.width, args.height);
        return Ok((Box::new(Camera { path: path.clone(), size, format, rate_hz: args.rate, controls }), camera));
    }
    let rate_hz = args.rate.unwrap_or(10.0);
    if let Some(path) = &args.input {
        let content = match args.format {
            Some(Format::Y4m) => Content::Y4m,
            Some(Format::Mjpg) => {
                return Err("JPEG pictures cannot be told apart in a pipe; use --format yu12 or y4m".into());
            }
            None => return Err("say what the input is: --format yu12 --width 640 --height 480, or --format y4m".into()),
            Some(format) => {
                let format = format.pixels().unwrap_or(PixelFormat::Grey);
                let (width, height) = (args.width as usize, args.height as usize);
                Content::Raw(Layout::new(format, width, height, args.stride)?)
            }
        };
        return Ok((Box::new(Pipe::new(path, content, rate_hz)?), camera));
    }
    let path = args.frames.as_ref().ok_or("give --camera, --input or --frames")?;
    let folder = Box::new(Folder::new(path, rate_hz, args.real_time)?);
    if args.rehearse.is_empty() {
        return Ok((folder, camera));
    }
    Ok((Box::new(Mock::new(folder, &args.rehearse)), Patience::REHEARSAL))
}

fn outputs(args: &Args, patient: bool) -> Result<Vec<Output>, CommandError> {
    let mut wanted = args.output.clone();
    if args.json {
        wanted.push(Wanted { form: FormName::Jsonl, target: Target::Stdout });
    }
    if wanted.is_empty() {
        wanted.push(Wanted { form: FormName::Text, target: Target::Stdout });
    }
    if wanted.iter().filter(|output| output.target == Target::Stdout).count() > 1 {
        return Err("only one form can go to standard output; give the others a file: --output nmea:FILE".into());
    }
    let output = |Wanted { form, target }: Wanted| -> Result<Output, CommandError> {
        Ok(Output { form: form.make(), sink: Sink::start(target, patient)? })
    };
    wanted.into_iter().map(output).collect()
}
