//! `daymark study fix`: an observer walks a loop among the eight towers; where are they, by what their camera sees?
//!
//! The truth is known, so every figure is measured: how often there is a fix, how far it is off, how often the truth lies in the
//! 95 % ellipse, and whether a wrong building ever gives one.

mod score;
mod show;
mod walk;

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use daymark_fixtures::Scene;
use serde::Serialize;

use self::score::{Case, Figures, Track, Wrong};
use self::walk::{Spoil, Stop, stop};
use crate::command::{CommandError, Outcome};
use crate::parallel;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
/// Noise of the lines, px.
const NOISE_PX: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Wrong correspondences of the lines.
const WRONG: [f64; 4] = [0.0, 0.15, 0.3, 0.45];
/// A tower counts as large from this share of the frame.
const LARGE: f64 = 0.25;

/// Arguments of `daymark study fix`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Places on the loop: more give steadier figures
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    poses: u32,
    /// How far a corner is found from where it is, in pixels (one standard deviation)
    #[arg(long, value_name = "PX", default_value_t = 0.5, value_parser = noise)]
    noise_px: f64,
    /// How many of the correspondences are wrong
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = share)]
    wrong: f64,
    /// Corners that are used of a tower, at most
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(4..=120))]
    corners: u32,
    /// Another set of random cases
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
    /// Draw how the errors are distributed
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
    /// Draw the town, the loop, and where the observer is taken to be
    #[arg(long, value_name = "OUT.svg")]
    map: Option<PathBuf>,
}

fn noise(text: &str) -> Result<f64, String> {
    let advice = "give pixels above 0 and at most 10, such as 0.5";
    text.parse().ok().filter(|value| *value > 0.0 && *value <= 10.0).ok_or_else(|| advice.to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    let advice = "give a share from 0 to 0.9, such as 0.3";
    text.parse().ok().filter(|value| (0.0..=0.9).contains(value)).ok_or_else(|| advice.to_owned())
}

/// Everything that is measured.
#[derive(Debug, Serialize)]
struct Report {
    schema_version: u32,
    frame_px: [u32; 2],
    focal_length_px: f64,
    poses: u32,
    corners_at_most: u32,
    noise_px: f64,
    wrong_share: f64,
    seed: u64,
    /// Poses with a tower that takes more than a quarter of the frame.
    large: Figures,
    all: Figures,
    /// All towers of a frame solved together.
    together: Figures,
    track: Track,
    by_noise: Vec<Line>,
    by_wrong: Vec<Line>,
    wrong_buildings: Vec<Wrong>,
}

#[derive(Debug, Serialize)]
struct Line {
    noise_px: f64,
    wrong_share: f64,
    #[serde(flatten)]
    figures: Figures,
}

pub(super) fn run(args: &Args) -> Result<Outcome, CommandError> {
    // Before the work, so that a wrong path costs nobody's time.
    let mut plot = args.plot.as_deref().map(Drawing::create).transpose()?;
    let mut map = args.map.as_deref().map(Drawing::create).transpose()?;
    let scene = Scene::town();
    let count = args.poses as usize;
    let stops: Vec<Stop> = parallel::numbers(count, |number| stop(&scene, number, count, args.seed));
    let asked = Spoil { noise_px: args.noise_px, wrong: args.wrong, most: args.corners as usize };
    let cases = score::cases(&stops, asked, args.seed);
    let line = |noise_px: f64, wrong: f64| {
        let spoil = Spoil { noise_px, wrong, ..asked };
        let cases = score::cases(&stops, spoil, args.seed);
        Line { noise_px, wrong_share: wrong, figures: Figures::of(cases.iter()) }
    };
    let report = Report {
        schema_version: SCHEMA_VERSION,
        frame_px: [walk::LENS.width, walk::LENS.height],
        focal_length_px: walk::LENS.focal,
        poses: args.poses,
        corners_at_most: args.corners,
        noise_px: args.noise_px,
        wrong_share: args.wrong,
        seed: args.seed,
        large: Figures::of(cases.iter().filter(|case| case.share >= LARGE)),
        all: Figures::of(cases.iter()),
        together: Figures::of(score::together(&stops, asked, args.seed).iter()),
        track: Track::of(&cases, &stops),
        by_noise: NOISE_PX.map(|noise| line(noise, args.wrong)).into(),
        by_wrong: WRONG.map(|wrong| line(args.noise_px, wrong)).into(),
        wrong_buildings: score::wrong_buildings(&stops, &scene, asked, args.seed),
    };
    if let Some(plot) = &mut plot {
        plot.write(&show::plot(&cases, &report))?;
    }
    if let Some(map) = &mut map {
        map.write(&show::map(&scene, &stops, &cases))?;
    }
    let text = if args.json { serde_json::to_string_pretty(&report)? + "\n" } else { show::table(&report) };
    io::stdout().write_all(text.as_bytes())?;
    Ok(Outcome::Done)
}

/// A file that a drawing goes to.
struct Drawing<'a> {
    path: &'a Path,
    file: File,
}

impl<'a> Drawing<'a> {
    fn create(path: &'a Path) -> Result<Self, CommandError> {
        let file = File::create(path).map_err(|error| format!("{}: cannot be written: {error}", path.display()))?;
        Ok(Self { path, file })
    }

    fn write(&mut self, svg: &str) -> Result<(), CommandError> {
        let written = self.file.write_all(svg.as_bytes());
        written.map_err(|error| format!("{}: cannot be written: {error}", self.path.display()).into())
    }
}

impl Case {
    /// The error as a share of the range.
    fn relative(&self) -> Option<f64> {
        self.answer.as_ref().map(|answer| answer.error_m / answer.range_m)
    }
}
