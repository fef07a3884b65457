//! `daymark recognize`: which building of a table each frame shows.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use daymark_core::fix::Fix;
use daymark_core::table::LandmarkTable;
use daymark_core::verdict::{Answer, FalseAnswer, Verdict};
use serde::Serialize;

use super::{CommandError, Outcome};
use crate::engine::{Engine, FRAME_SIDE};
use crate::lens_source::{ExifFocal, LensArgs, LensChoice};
use crate::near::PriorArgs;
use crate::observer::Locating;
use crate::picture::{GrayImage, read_gray};
use crate::report::explain::{Explained, ViewExplanation};
use crate::report::finding::{Finding, Times, VerdictName};
use crate::report::map::{Building, Observer, Plan};
use crate::report::overlay::Overlay;
use crate::report::position::ObserverFacts;
use crate::report::text;
use crate::table_file::{open_table, read_table};

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;

/// Arguments of `daymark recognize`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 every frame shows a known building, 1 some frame has no answer, \
                        2 an error; frames that can be read are answered all the same.")]
pub struct Args {
    /// The table to recognize buildings of, as `daymark enroll` makes it
    #[arg(long, value_name = "TABLE")]
    table: PathBuf,
    /// Pictures to recognize: JPEG, PNG, WebP, TIFF, BMP or PNM
    #[arg(required = true, value_name = "FRAMES")]
    frames: Vec<PathBuf>,
    /// Answer only if the answer is false with at most this probability; smaller is more careful
    #[arg(long, value_name = "PROBABILITY", default_value_t = 0.01, value_parser = probability)]
    max_false_answer: f64,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Tell which corners matched, what each was worth, and why the runner-up lost
    #[arg(long)]
    explain: bool,
    /// Draw the frame with its matched corners and the outline of the stored view; several frames are numbered out-1.svg...
    #[arg(long, value_name = "OUT.svg")]
    overlay: Option<PathBuf>,
    /// Draw a plan of the building and where the observer stands; several frames are numbered out-1.svg...
    #[arg(long, value_name = "OUT.svg")]
    map: Option<PathBuf>,
    #[command(flatten)]
    lens: LensArgs,
    #[command(flatten)]
    prior: PriorArgs,
    /// A building is recognized from this far at most; where its distance is not known, the observer is within it
    #[arg(long, value_name = "METRES", default_value_t = REACH_M, value_parser = reach)]
    reach: f64,
}

/// A building is recognized from this far at most, if nobody says otherwise, metres.
pub(super) const REACH_M: f64 = 100.0;

/// A reach on the command line.
///
/// # Errors
/// What is wrong with it.
pub(super) fn reach(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 100_000.0 => Ok(value),
        _ => Err("give metres above 0 and at most 100000".to_owned()),
    }
}

/// A probability on the command line: above 0, at most 1.
///
/// # Errors
/// What is wrong with it.
pub(super) fn probability(text: &str) -> Result<f64, String> {
    let advice = "give a probability above 0 and at most 1, such as 0.01";
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        _ => Err(advice.to_owned()),
    }
}

/// The JSON document.
#[derive(Debug, Serialize)]
struct Document<'a> {
    schema_version: u32,
    program_version: &'static str,
    settings: Settings,
    table: TableFacts,
    frames: &'a [Finding],
    summary: Summary,
}

#[derive(Debug, Serialize)]
struct Settings {
    max_false_answer: f64,
    longer_side_px: usize,
}

#[derive(Debug, Serialize)]
struct TableFacts {
    file: String,
    table_id: String,
    profile: &'static str,
    landmarks: u32,
    views: u32,
}

/// How many frames got which verdict.
#[derive(Debug, Default, Clone, Copy, Serialize)]
struct Summary {
    known: usize,
    ambiguous: usize,
    unknown: usize,
    unreadable: usize,
}

impl Summary {
    fn enter(&mut self, verdict: VerdictName) {
        *match verdict {
            VerdictName::Known => &mut self.known,
            VerdictName::Ambiguous => &mut self.ambiguous,
            VerdictName::Unknown => &mut self.unknown,
            VerdictName::Unreadable => &mut self.unreadable,
        } += 1;
    }
}

/// Runs the command.
///
/// # Errors
/// A table that cannot be read, a frame that cannot be read (after the others were answered), an overlay that cannot be
/// written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let bytes = read_table(&args.table)?;
    let table = open_table(&args.table, &bytes)?;
    let views = args.prior.views(&table, args.reach)?;
    let mut looking = Looking {
        args,
        engine: Engine::new(table.profile()),
        locating: Locating::new(),
        lens: args.lens.read()?,
        views,
    };
    let mut findings = Vec::new();
    let mut summary = Summary::default();
    let mut unreadable = None;
    for (number, path) in (1..).zip(&args.frames) {
        let drawing = |path: &Path| numbered(path, number, args.frames.len());
        let (overlay, map) = (args.overlay.as_deref().map(drawing), args.map.as_deref().map(drawing));
        let finding = looking.look(table, path, overlay.as_deref(), map.as_deref())?;
        summary.enter(finding.verdict);
        if finding.verdict == VerdictName::Unreadable {
            unreadable = finding.reason.as_ref().map(|reason| reason.message.clone());
        }
        if args.json {
            findings.push(finding);
        } else {
            print(args, &finding, number)?;
        }
    }
    if args.json {
        let header = table.header();
        let document = Document {
            schema_version: SCHEMA_VERSION,
            program_version: env!("CARGO_PKG_VERSION"),
            settings: Settings { max_false_answer: args.max_false_answer, longer_side_px: FRAME_SIDE },
            table: TableFacts {
                file: args.table.to_string_lossy().into_owned(),
                table_id: format!("{:016x}", header.table_id()),
                profile: header.profile().name(),
                landmarks: header.landmark_count(),
                views: header.view_count(),
            },
            frames: &findings,
            summary,
        };
        writeln!(io::stdout(), "{}", serde_json::to_string_pretty(&document)?)?;
    }
    match summary {
        Summary { unreadable: 0, ambiguous: 0, unknown: 0, .. } => Ok(Outcome::Done),
        Summary { unreadable: 0, .. } => Ok(Outcome::NoAnswer),
        Summary { unreadable: count, .. } => Err(match unreadable {
            Some(only) if args.frames.len() == 1 => only.into(),
            _ => format!("{count} of {} frames could not be read, as told above", args.frames.len()).into(),
        }),
    }
}

/// What looking at frames needs.
struct Looking<'a> {
    args: &'a Args,
    engine: Engine,
    locating: Locating,
    lens: LensChoice,
    /// Those that are compared, if not all.
    views: Option<Vec<u32>>,
}

impl Looking<'_> {
    /// One frame from its file to what is said about it.
    fn look(
        &mut self,
        mut table: LandmarkTable<'_>,
        path: &Path,
        overlay: Option<&Path>,
        map: Option<&Path>,
    ) -> Result<Finding, CommandError> {
        let Self { args, engine, locating, lens, views } = self;
        let begin = Instant::now();
        let (frame, size) = match read_gray(path) {
            Ok(image) => {
                let size = [image.width as u32, image.height as u32];
                (image.scaled_to(FRAME_SIDE), size)
            }
            Err(error) => {
                // The only frame's error is the command's, which is printed at its end.
                if args.frames.len() > 1 {
                    writeln!(io::stderr(), "error: {error}")?;
                }
                return Ok(Finding::unreadable(&error));
            }
        };
        let read = Instant::now();
        engine.extract(&frame).map_err(|error| format!("{}: {error}", path.display()))?;
        let extracted = Instant::now();
        let recognition =
            engine.recognize_among(&mut table, views.as_deref(), FalseAnswer::at_most(args.max_false_answer))?;
        let matched = Instant::now();

        let mut finding = Finding::new(path, &frame, &recognition, &table)?;
        if let Verdict::Known(answer) = &recognition.verdict {
            let exif = lens.asks_picture().then(|| ExifFocal::of_picture(path)).flatten();
            let lens = lens.lens(size[0], size[1], exif.as_ref())?.scaled_to(frame.width as u32, frame.height as u32);
            let mut observer = locating.observer(engine, &table, answer, &lens, args.reach)?;
            observer.check(&args.prior);
            finding.observer = Some(ObserverFacts::new(&observer, &lens));
            if let (Some(file), Some(fix)) = (map, observer.fix) {
                draw_map(file, &table, answer, fix.fix)?;
                finding.map_file = Some(file.to_string_lossy().into_owned());
            }
        }
        let located = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        finding.times = Some(Times {
            read_ms: ms(begin, read),
            features_ms: ms(read, extracted),
            matching_ms: ms(extracted, matched),
            position_ms: ms(matched, located),
        });
        if args.explain {
            let (best, runner_up) = (recognition.best.as_ref(), recognition.runner_up.as_ref());
            finding.explanation = Some(Explained::new(engine, &table, best, runner_up)?);
        }
        if let Some(file) = overlay {
            let best = match &recognition.best {
                Some(best) => ViewExplanation::new(engine, &table, best)?,
                None => None,
            };
            draw(file, &frame, &finding, best.as_ref())?;
            finding.overlay_file = Some(file.to_string_lossy().into_owned());
        }
        Ok(finding)
    }
}

/// The plan of the building and its observer.
fn draw_map(file: &Path, table: &LandmarkTable<'_>, answer: &Answer, fix: Fix) -> Result<(), CommandError> {
    let landmark = table.landmark(answer.landmark)?;
    let Some(building) = Building::of(table, answer.landmark)? else { return Ok(()) };
    let plan = Plan {
        title: format!("{}, and where it is seen from", landmark.name),
        buildings: vec![building],
        observers: vec![Observer { fix, sees: Some(0) }],
        way: Vec::new(),
    };
    std::fs::write(file, plan.to_svg().unwrap_or_default()).map_err(|error| {
        format!("cannot write the map {}: {error}; give a path in a folder that exists and is yours", file.display())
    })?;
    Ok(())
}

fn draw(file: &Path, frame: &GrayImage, finding: &Finding, best: Option<&ViewExplanation>) -> Result<(), CommandError> {
    let svg = Overlay { frame, finding, best, stored_picture: None }.to_svg();
    std::fs::write(file, svg).map_err(|error| {
        format!(
            "cannot write the overlay {}: {error}; give a path in a folder that exists and is yours",
            file.display()
        )
    })?;
    Ok(())
}

fn print(args: &Args, finding: &Finding, number: usize) -> io::Result<()> {
    if finding.verdict == VerdictName::Unreadable {
        return Ok(());
    }
    let mut out = io::stdout().lock();
    if number > 1 {
        writeln!(out)?;
    }
    out.write_all(text::finding(finding, args.max_false_answer).as_bytes())?;
    if let Some(explained) = &finding.explanation {
        out.write_all(text::explanation(explained).as_bytes())?;
    }
    Ok(())
}

/// `out.svg` for one frame; `out-1.svg` and so on for several.
fn numbered(path: &Path, number: usize, of: usize) -> PathBuf {
    if of == 1 {
        return path.to_owned();
    }
    let part = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
    let stem = part(path.file_stem()).unwrap_or_else(|| "overlay".to_owned());
    path.with_file_name(match part(path.extension()) {
        Some(extension) => format!("{stem}-{number}.{extension}"),
        None => format!("{stem}-{number}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_overlays_are_numbered() {
        assert_eq!(numbered(Path::new("a/out.svg"), 1, 1), Path::new("a/out.svg"));
        assert_eq!(numbered(Path::new("a/out.svg"), 2, 3), Path::new("a/out-2.svg"));
        assert_eq!(numbered(Path::new("out"), 3, 3), Path::new("out-3"));
    }

    #[test]
    fn a_probability_is_above_zero_and_at_most_one() {
        assert_eq!(probability("0.01"), Ok(0.01));
        assert_eq!(probability("1"), Ok(1.0));
        for wrong in ["0", "-0.1", "1.1", "NaN", "inf", "1%", ""] {
            assert!(probability(wrong).is_err(), "{wrong}");
        }
    }
}
