//! `daymark study repeatability`: how many automatic corners are found again, and what their places alone are good for.
//!
//! On the eight towers, whose every pixel can be carried to another view, against noise, missing corners and the angle
//! between the views; and on photographs, where they are at hand.

mod pair;
mod photos;
mod towers;

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::ValueEnum;
use daymark_fixtures::Tower;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use self::pair::{Method, Pair, TOLERANCE_PX, Tally};
use self::photos::WithCameras;
use self::towers::{CORNER_NOISE_PX, Disturbance, see};
use super::super::{CommandError, Outcome};
use crate::correspond::MOST_CORNERS;
use crate::correspond::automatic::CORNERS_PER_IMAGE;
use crate::correspond::matching::Matcher;
use crate::parallel;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
const ANGLES: [f64; 7] = [0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0];
const NOISE_PX: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];
const MISSING: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
const GRAY_LEVELS: [i32; 4] = [0, 2, 5, 10];
/// Angle between the views of the lines in which something else changes, degrees.
const USUAL_ANGLE: f64 = 5.0;
/// Photographs whose numbers differ by so many.
const STEPS: [usize; 3] = [1, 2, 3];

/// Arguments of `daymark study repeatability`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
A corner is found again if there is one within 2 px of its true place (pictures 640 px long); a match
is right within the same distance. The towers' depths carry any corner to the other view. Of the
photographs in DIR/reconstruction, Herz-Jesus-P8 has cameras: a match is counted as right if it keeps
the true epipolar geometry, which is necessary only; the column of chance says how many arbitrary
pairs do. adelaide-plane-pairs has planes marked by hand: matches within them are counted.")]
pub struct Args {
    /// The folder with photographs; without it only the towers are measured
    #[arg(long, value_name = "DIR", default_value = "../shared/photos")]
    photos: PathBuf,
    /// What to measure on; the towers take longest
    #[arg(long, value_enum, default_value_t = Scenes::All)]
    scenes: Scenes,
    /// Random cases for each tower in lines with noise or missing corners
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..=1_000))]
    seeds: u64,
    /// Automatic corners of each picture, the strongest
    #[arg(long, value_name = "N", default_value_t = CORNERS_PER_IMAGE as u16,
          value_parser = clap::value_parser!(u16).range(4..=MOST_CORNERS as i64))]
    corners_per_image: u16,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Scenes {
    /// Towers, and photographs where they are at hand
    All,
    /// The eight towers
    Towers,
    /// Photographs
    Photos,
}

/// The JSON document.
#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    program_version: &'static str,
    settings: Settings,
    lines: Vec<LineFound>,
}

#[derive(Debug, Serialize)]
struct Settings {
    corners_per_image: u16,
    seeds: u64,
    tolerance_px: f64,
    corner_noise_px: f64,
    plain_epsilon: f64,
}

#[derive(Debug, Serialize)]
struct LineFound {
    group: &'static str,
    setting: String,
    pairs: usize,
    corners: usize,
    /// Of the corners whose place in the second picture is known; null where only the epipolar geometry is.
    repeatability: Option<f64>,
    /// Of arbitrary pairs of corners so many would count as right.
    right_by_chance: f64,
    methods: Vec<MethodFound>,
}

#[derive(Debug, Serialize)]
struct MethodFound {
    method: Method,
    pairs_answered: usize,
    matches: usize,
    right: usize,
    /// Of the matches; null without any.
    right_share: Option<f64>,
    /// Pairs of pictures of which some proposal was right in all its corners.
    pairs_with_right_proposal: usize,
}

/// A line of the table: what is measured.
struct Line {
    group: &'static str,
    setting: String,
    tally: Tally,
}

/// Runs the study.
///
/// # Errors
/// A photograph that cannot be read.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let mut lines = if args.scenes == Scenes::Photos { Vec::new() } else { of_towers(args)? };
    if args.scenes == Scenes::Towers {
        // Asked for no photographs.
    } else if args.photos.join("reconstruction").is_dir() {
        lines.extend(of_photos(args)?);
    } else {
        writeln!(io::stderr(), "no photographs in {}: the towers only (--photos DIR)", args.photos.display())?;
    }
    let document = Document {
        schema_version: SCHEMA_VERSION,
        program_version: env!("CARGO_PKG_VERSION"),
        settings: Settings {
            corners_per_image: args.corners_per_image,
            seeds: args.seeds,
            tolerance_px: TOLERANCE_PX,
            corner_noise_px: CORNER_NOISE_PX,
            plain_epsilon: 0.05,
        },
        lines: lines.iter().map(Line::found).collect(),
    };
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        out.write_all(text(&document).as_bytes())?;
    }
    Ok(Outcome::Done)
}

/// The lines of the towers: group, setting, disturbance, and cases for each tower.
fn settings(seeds: u64) -> Vec<(&'static str, String, Disturbance, u64)> {
    let usual = Disturbance { angle: USUAL_ANGLE, gray_levels: 0, noise_px: 0.0, missing: 0.0 };
    let angles = ANGLES.map(|angle| ("view angle", format!("{angle} degrees"), Disturbance { angle, ..usual }, 1));
    let noise = NOISE_PX.map(|noise_px| {
        (
            "corner noise",
            format!("{noise_px} px"),
            Disturbance { noise_px, ..usual },
            if noise_px > 0.0 { seeds } else { 1 },
        )
    });
    let missing = MISSING.map(|missing| {
        let cases = if missing > 0.0 { seeds } else { 1 };
        ("missing corners", format!("{:.0} %", missing * 100.0), Disturbance { missing, ..usual }, cases)
    });
    let gray = GRAY_LEVELS.map(|gray_levels| {
        ("image noise", format!("{gray_levels} grey levels"), Disturbance { gray_levels, ..usual }, 1)
    });
    angles.into_iter().chain(gray).chain(noise).chain(missing).collect()
}

fn of_towers(args: &Args) -> Result<Vec<Line>, CommandError> {
    let settings = settings(args.seeds);
    let towers = Tower::eight();
    let bar = progress(towers.len() * settings.len(), "towers");
    // Each tower on its own, added up in their order: the same figures for any number of threads.
    let measured: Result<Vec<Vec<Tally>>, CommandError> = parallel::try_map(&towers, |tower| {
        let mut matcher = Matcher::default();
        let count = usize::from(args.corners_per_image);
        let mut tallies = Vec::with_capacity(settings.len());
        let mut last: Option<(f64, i32, towers::Seen, towers::Seen)> = None;
        for (_, _, disturbance, cases) in &settings {
            let Disturbance { angle, gray_levels, .. } = *disturbance;
            let views = match last.take() {
                Some(views) if (views.0, views.1) == (angle, gray_levels) => views,
                _ => (
                    angle,
                    gray_levels,
                    see(tower, 0.0, gray_levels, 0, count)?,
                    see(tower, angle, gray_levels, 1, count)?,
                ),
            };
            let mut tally = Tally::default();
            for case in 0..*cases {
                let seed = case * 100 + u64::from(tower.number);
                tally.add(&towers::pair(&views.2, &views.3, *disturbance, seed).tally(&mut matcher)?);
            }
            tallies.push(tally);
            last = Some(views);
            bar.inc(1);
        }
        Ok(tallies)
    });
    bar.finish_and_clear();
    let mut lines: Vec<Line> =
        settings.into_iter().map(|(group, setting, ..)| Line { group, setting, tally: Tally::default() }).collect();
    for tallies in measured? {
        for (line, tally) in lines.iter_mut().zip(&tallies) {
            line.tally.add(tally);
        }
    }
    Ok(lines)
}

fn of_photos(args: &Args) -> Result<Vec<Line>, CommandError> {
    let count = usize::from(args.corners_per_image);
    let bar = progress(STEPS.len() + 1, "photographs");
    let mut lines = Vec::new();
    let photos = WithCameras::read(&args.photos, count)?;
    for step in STEPS {
        let tally = together(&photos.pairs(step))?;
        lines.push(Line { group: "Herz-Jesus-P8", setting: format!("{step} apart"), tally });
        bar.inc(1);
    }
    let pairs = photos::with_planes(&args.photos, count)?;
    lines.push(Line { group: "marked planes", setting: "pairs".to_owned(), tally: together(&pairs)? });
    bar.finish_and_clear();
    Ok(lines)
}

/// The sum over pairs, in their order.
fn together(pairs: &[Pair]) -> Result<Tally, CommandError> {
    let tallies = parallel::try_map_with(pairs, Matcher::default, |matcher, pair| pair.tally(matcher))?;
    let mut sum = Tally::default();
    for tally in &tallies {
        sum.add(tally);
    }
    Ok(sum)
}

fn progress(length: usize, doing: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64).with_message(doing);
    match ProgressStyle::with_template("{msg:<12} {bar:40} {pos}/{len}  {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

impl Line {
    fn found(&self) -> LineFound {
        let tally = &self.tally;
        let methods = Method::ALL.into_iter().zip(&tally.methods).map(|(method, sum)| MethodFound {
            method,
            pairs_answered: sum.answered,
            matches: sum.matches,
            right: sum.right,
            right_share: share(sum.right, sum.matches),
            pairs_with_right_proposal: sum.proposed,
        });
        LineFound {
            group: self.group,
            setting: self.setting.clone(),
            pairs: tally.pairs,
            corners: tally.corners,
            repeatability: share(tally.repeated, tally.common),
            right_by_chance: share(tally.chance[1], tally.chance[0]).unwrap_or(0.0),
            methods: methods.collect(),
        }
    }
}

/// What stands above the methods' columns, and how wide they are.
const HEADS: [&str; 4] = ["plain hulls", "tolerant hulls", "local arrangements", "both, verified"];
const WIDTHS: [usize; 4] = [19, 23, 23, 23];

/// The table: of each method how many of its matches are right, and for how many pairs of pictures it had an answer; of
/// hulls and arrangements also for how many pairs a proposal was right in all its corners.
fn text(document: &Document) -> String {
    let mut text = format!(
        "{} corners a picture, right within {} px; cells: right of matches, pairs answered / pairs with a right proposal\n",
        document.settings.corners_per_image, document.settings.tolerance_px
    );
    let mut group = "";
    for line in &document.lines {
        if line.group != group {
            group = line.group;
            let _ = write!(text, "\n{:<16} pairs   again  chance   ", line.group);
            for (head, width) in HEADS.into_iter().zip(WIDTHS) {
                let _ = write!(text, "{head:<width$}");
            }
            text.truncate(text.trim_end().len());
            text.push('\n');
        }
        let again = line.repeatability.map_or_else(|| "-".to_owned(), |share| format!("{:.0} %", share * 100.0));
        let chance = format!("{:.1} %", line.right_by_chance * 100.0);
        let _ = write!(text, "{:<16}{:>6}{again:>8}{chance:>8}   ", line.setting, line.pairs);
        for (method, width) in line.methods.iter().zip(WIDTHS) {
            let share = method.right_share.map_or_else(|| "-".to_owned(), |share| format!("{:.0} %", share * 100.0));
            let mut cell = format!("{share:>5} of {:<5}{:>3}", method.matches, method.pairs_answered);
            if method.method != Method::PlainHulls {
                let _ = write!(cell, " /{:>3}", method.pairs_with_right_proposal);
            }
            let _ = write!(text, "{cell:<width$}");
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_all_told() {
        let count = ANGLES.len() + NOISE_PX.len() + MISSING.len() + GRAY_LEVELS.len();
        assert_eq!(settings(2).len(), count);
    }
}
