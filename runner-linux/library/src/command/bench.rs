//! `daymark bench`: how long the stages take on this machine, on one thread.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use daymark_core::extract::FrontEnd;
use daymark_core::profile::Profile;
use daymark_core::table::{Kind, LandmarkTable};
use daymark_core::verdict::FalseAnswer;
use daymark_engine::stages::Stages;
use daymark_fixtures::{Lens, Tower, Trial, View};
use serde::Serialize;

use super::{CommandError, Outcome};
use crate::engine::{Engine, FRAME_SIDE};
use crate::enroll;
use crate::order;
use crate::parallel;
use crate::picture::{GrayImage, read_gray};
use crate::simd::Processor;
use crate::table_file::{LandmarkEntry, OwnedTable, open_table, read_table};

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
/// What the stages of the front end look for.
const FRONT_END: FrontEnd = FrontEnd { features: 600, cell_share_tenths: 12 };
/// Views of the table that is made if none is given.
const VIEWS: usize = 100;
/// Rounds before the first that counts.
const WARM_UP: usize = 3;

/// Arguments of `daymark bench`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The picture to work on; without it, one that the program draws
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// The table whose views are matched; without it, 100 handheld views of drawn buildings
    #[arg(long, value_name = "TABLE")]
    table: Option<PathBuf>,
    /// How often each stage is timed
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// The least and the median time of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Times {
    min: f64,
    median: f64,
}

impl Times {
    /// Times a stage, in units of `unit` seconds.
    fn measure<E>(runs: u32, unit: f64, mut stage: impl FnMut() -> Result<(), E>) -> Result<Self, E> {
        for _ in 0..WARM_UP {
            stage()?;
        }
        let mut times = Vec::with_capacity(runs as usize);
        for _ in 0..runs {
            let begin = Instant::now();
            stage()?;
            times.push(begin.elapsed().as_secs_f64() / unit);
        }
        Ok(Self::of(times))
    }

    fn of(mut times: Vec<f64>) -> Self {
        order::ascending(&mut times);
        let at = |place: usize| times.get(place).copied().unwrap_or(0.0);
        let middle = times.len() / 2;
        let median = if times.len() % 2 == 1 { at(middle) } else { f64::midpoint(at(middle.max(1) - 1), at(middle)) };
        Self { min: at(0), median }
    }
}

/// The JSON document; `benches/peer/corners.py` reads the four times.
#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    program_version: &'static str,
    kernels: &'static str,
    runs: u32,
    picture: PictureFacts,
    table: TableFacts,
    corners: CornerFacts,
    corners_first_level_ms: Times,
    corners_all_levels_ms: Times,
    features_ms: Times,
    view_match_us: Times,
}

#[derive(Debug, Serialize)]
struct PictureFacts {
    /// Null for the drawn one.
    file: Option<String>,
    width: usize,
    height: usize,
}

#[derive(Debug, Serialize)]
struct TableFacts {
    /// Null for the made one.
    file: Option<String>,
    profile: &'static str,
    views: u32,
}

/// What was found: a picture without texture is quicker.
#[derive(Debug, Clone, Copy, Serialize)]
struct CornerFacts {
    first_level: usize,
    all_levels: usize,
    matched: usize,
}

/// Runs the command.
///
/// # Errors
/// A picture or table that cannot be read, or a table without views.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let image = match &args.image {
        Some(path) => read_gray(path)?.scaled_to(FRAME_SIDE),
        None => drawn(&View::trial(&Tower::eight()[0], Trial::Between, Lens::VGA)),
    };
    let bytes = match &args.table {
        Some(path) => read_table(path)?,
        None => made_table()?,
    };
    let table = match &args.table {
        Some(path) => open_table(path, &bytes)?,
        None => LandmarkTable::open(&bytes).and_then(LandmarkTable::verified)?,
    };
    if table.view_count() == 0 {
        return Err("the table has no views to match: enroll a building, or leave out --table".into());
    }
    let document = measure(args, &image, table)?;
    if args.json {
        writeln!(io::stdout(), "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        io::stdout().write_all(as_text(&document).as_bytes())?;
    }
    Ok(Outcome::Done)
}

fn drawn(view: &View) -> GrayImage {
    let frame = view.render();
    GrayImage { pixels: frame.gray, width: frame.width as usize, height: frame.height as usize }
}

/// A table with the eight drawn towers, seen from the left and enrolled as they should be: over and over, until there
/// are enough views.
fn made_table() -> Result<Vec<u8>, CommandError> {
    let profile = Profile::Handheld;
    let enroll = |tower: &Tower| {
        let [left, _] = View::enrollment(tower, Lens::VGA);
        enroll::view(&drawn(&left), profile)
    };
    let views = parallel::try_map(&Tower::eight(), enroll)?;
    let landmark = |(number, view)| LandmarkEntry {
        name: format!("Tower {number}"),
        kind: Kind::Tower,
        position: None,
        views: vec![view],
        model: None,
    };
    let landmarks = (1..=VIEWS).zip(views.into_iter().cycle()).map(landmark).collect();
    OwnedTable { profile, landmarks }.to_bytes().map_err(|error| error.to_string().into())
}

fn measure(args: &Args, image: &GrayImage, mut table: LandmarkTable<'_>) -> Result<Document, CommandError> {
    let processor = Processor::detect();
    let mut toned = Vec::new();
    let mut stages = Stages::new(processor, image, FRONT_END, &mut toned)?;
    let mut counts = CornerFacts { first_level: 0, all_levels: 0, matched: 0 };
    let first = Times::measure(args.runs, 1e-3, || {
        counts.first_level = stages.corners_of_first_level();
        Ok::<(), CommandError>(())
    })?;
    let all = Times::measure(args.runs, 1e-3, || stages.corners().map(|count| counts.all_levels = count))?;
    let features = Times::measure(args.runs, 1e-3, || stages.features().map(|_| ()))?;
    let mut engine = Engine::with_processor(table.profile(), processor);
    engine.extract(image)?;
    counts.matched = engine.features().len();
    let views = table.view_count();
    let view_match = Times::measure(args.runs, 1e-6 * f64::from(views), || {
        engine.recognize(&mut table, FalseAnswer::ONE_PERCENT).map(|_| ())
    })?;
    let name = |path: &Option<PathBuf>| path.as_ref().map(|path| path.to_string_lossy().into_owned());
    Ok(Document {
        schema_version: SCHEMA_VERSION,
        program_version: env!("CARGO_PKG_VERSION"),
        kernels: processor.name(),
        runs: args.runs,
        picture: PictureFacts { file: name(&args.image), width: image.width, height: image.height },
        table: TableFacts { file: name(&args.table), profile: table.profile().name(), views },
        corners: counts,
        corners_first_level_ms: first,
        corners_all_levels_ms: all,
        features_ms: features,
        view_match_us: view_match,
    })
}

fn as_text(document: &Document) -> String {
    let Document { picture, table, corners, kernels, runs, .. } = document;
    let mut text = format!(
        "{} x {} px, {kernels} kernels, one thread, {runs} runs of each stage\n\n{:<46}{:>10}{:>10}\n",
        picture.width, picture.height, "", "min", "median"
    );
    let rows = [
        (format!("{} corners of the first level", corners.first_level), "ms", document.corners_first_level_ms),
        (format!("{} corners of all levels", corners.all_levels), "ms", document.corners_all_levels_ms),
        (format!("{} corners with signatures", corners.all_levels), "ms", document.features_ms),
        (format!("one view of {} against {} corners", table.views, corners.matched), "us", document.view_match_us),
    ];
    for (stage, unit, times) in rows {
        let stage = format!("{stage}, {unit}");
        let _ = writeln!(text, "{stage:<46}{:>10.3}{:>10.3}", times.min, times.median);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(Times::of(vec![3.0, 1.0, 2.0]), Times { min: 1.0, median: 2.0 });
        assert_eq!(Times::of(vec![4.0, 1.0, 2.0, 9.0]), Times { min: 1.0, median: 3.0 });
        assert_eq!(Times::of(vec![5.0]), Times { min: 5.0, median: 5.0 });
    }
}
