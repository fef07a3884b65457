//! `daymark study subdivision`: how far subdivision should go (the thesis, 9.2, future work 4).

use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::{Light, Tower};
use indicatif::ProgressBar;
use serde::Serialize;

use super::super::{CommandError, Outcome};
use crate::classify::cloud::{Cloud, Similarity};
use crate::classify::error::{compare_one_sided, mean as mean_squared};
use crate::classify::towers::{BASE_ANGLES, Conditions, TEST_ANGLES, TowerViews};
use crate::report::page;
use crate::report::plot::{Axis, Curve, Plot};
use crate::synthesize::dense::BYTES_PER_POINT;
use crate::synthesize::model::Model;
use crate::table_file::replace_file;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
/// The first level whose signal-to-noise ratio is at least this share of the largest is picked.
const ENOUGH: f64 = 0.95;

/// Arguments of `daymark study subdivision`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The deepest level; the last ones take most of the time: level 7 has 16,384 triangles for one
    #[arg(long, value_name = "LEVEL", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=7))]
    levels: u8,
    /// How often every test is made with other noise
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    seeds: u32,
    /// Standard deviation of the noise on every corner's coordinates, in pixels of 640 x 480
    #[arg(long, value_name = "PIXELS", default_value_t = 0.5)]
    noise_px: f64,
    /// Write the table and a plot as a page
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    program_version: &'static str,
    seeds: u32,
    corner_noise_px: f64,
    levels: Vec<Row>,
    picked_level: u8,
}

#[derive(Debug, Clone, Serialize)]
struct Row {
    level: u8,
    /// Mean of the root mean square distance of tests from their own base.
    within_rms_millimetre: f64,
    /// The same from the other bases that differ in shape.
    between_rms_millimetre: f64,
    /// Mean of the least such distance of each test.
    nearest_wrong_rms_millimetre: f64,
    /// Distance between the classes' means over their pooled standard deviation, of the logarithms of the errors.
    signal_to_noise: f64,
    /// The same for the intensity errors.
    intensity_signal_to_noise: f64,
    /// Points of all tests together, per seed.
    test_points: usize,
    /// Points of all bases together.
    base_points: usize,
    /// Bytes of the largest cloud while it is made.
    largest_cloud_bytes: u64,
    /// Seconds for making the clouds of all bases and tests, and for comparing each with each.
    subdivide_second: f64,
    compare_second: f64,
}

impl Row {
    /// The ratio of the stage that tells less: shape by corners alone is clear already, and appearance needs points.
    fn weaker(&self) -> f64 {
        self.signal_to_noise.min(self.intensity_signal_to_noise)
    }
}

/// Runs the study.
///
/// # Errors
/// A level with too many points, a report that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let towers = Tower::eight();
    let mut bases = Vec::new();
    let mut tests = Vec::new();
    for tower in &towers {
        let number = u64::from(tower.number);
        let morning = Conditions { light: Light::morning(), seed: 50 + number, farther: 1.0 };
        let views = TowerViews::new(tower, &BASE_ANGLES, &morning, true);
        bases.push((views.model(args.noise_px, 1_000 + number), views));
        let grey = Conditions { light: Light::overcast(), seed: 150 + number, farther: 1.1 };
        let views = TowerViews::new(tower, &TEST_ANGLES, &grey, false);
        for seed in 0..u64::from(args.seeds) {
            let noise_seed = seed * 8 + number - 1;
            let noisy = views.clone().with_gray_noise(3.0, noise_seed);
            tests.push((number as usize - 1, noisy.model(args.noise_px, noise_seed), noisy));
        }
    }
    let mut levels = Vec::new();
    let bar = if io::stderr().is_terminal() {
        ProgressBar::new(8 * (u64::from(args.levels) + 1))
    } else {
        ProgressBar::hidden()
    };
    for number in 0..=args.levels {
        let level = SubdivisionLevel::new(number).ok_or("levels go from 0 to 7")?;
        levels.push(study(level, &bases, &tests, &bar)?);
    }
    bar.finish_and_clear();
    let most = levels.iter().map(Row::weaker).fold(0.0, f64::max);
    let picked = levels.iter().find(|level| level.weaker() >= ENOUGH * most).map_or(0, |level| level.level);
    let document = Document {
        schema_version: SCHEMA_VERSION,
        program_version: env!("CARGO_PKG_VERSION"),
        seeds: args.seeds,
        corner_noise_px: args.noise_px,
        levels,
        picked_level: picked,
    };
    if let Some(path) = &args.report {
        replace_file(path, html(&document).as_bytes())
            .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    }
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        out.write_all(text(&document).as_bytes())?;
    }
    Ok(Outcome::Done)
}

type Made = (Model, TowerViews);

/// One level. Two clouds at a time are in memory, a base and a test, whatever the number of tests: those of the last levels
/// have millions of points.
fn study(
    level: SubdivisionLevel,
    bases: &[Made],
    tests: &[(usize, Model, TowerViews)],
    bar: &ProgressBar,
) -> Result<Row, CommandError> {
    let mut largest = 0;
    let mut subdividing = Duration::ZERO;
    let mut cloud = |model: &Model, views: &TowerViews, asked: bool, counts: bool| -> Result<Cloud, CommandError> {
        let begin = Instant::now();
        let dense = model.dense(level, views.views(), views.stations())?;
        largest = largest.max(dense.positions.len() as u64 * BYTES_PER_POINT);
        // Tests ask bases, and nobody asks them.
        let cloud = if asked { Cloud::of_dense(&dense) } else { Cloud::asking(&dense) };
        if counts {
            subdividing += begin.elapsed();
        }
        Ok(cloud)
    };
    let mut comparing = Duration::ZERO;
    let (mut base_points, mut test_points) = (0, 0);
    // Errors of each test: with its own base, and with those of other shape (2 and 5 share one).
    let (mut within, mut between) = (Vec::new(), Vec::new());
    let (mut alike, mut unlike) = (Vec::new(), Vec::new());
    let mut nearest_wrong = vec![f64::INFINITY; tests.len()];
    for (number, (model, views)) in bases.iter().enumerate() {
        let base = cloud(model, views, true, true)?;
        base_points += base.positions.len();
        for (at, (tower, model, views)) in tests.iter().enumerate() {
            // Made anew for each base; the first time says how long that takes.
            let test = cloud(model, views, false, number == 0)?;
            test_points += if number == 0 { test.positions.len() } else { 0 };
            let begin = Instant::now();
            let reach = 0.015 * crate::classify::experiment::size(&test);
            let still = Similarity::shift(nalgebra::Vector3::zeros());
            let (squares, intensity) = compare_one_sided(&test, &base, &still, reach);
            let shape = libm::sqrt(mean_squared(&squares));
            comparing += begin.elapsed();
            let look = intensity.map_or(1.0, |intensity| intensity.free);
            let same_shape = [1, 4].contains(&number) && [1, 4].contains(tower);
            if number == *tower {
                within.push(shape);
                alike.push(look);
            } else {
                unlike.push(look);
                if !same_shape {
                    between.push(shape);
                    nearest_wrong[at] = nearest_wrong[at].min(shape);
                }
            }
        }
        bar.inc(1);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    Ok(Row {
        level: level.number(),
        within_rms_millimetre: 1_000.0 * mean(&within),
        between_rms_millimetre: 1_000.0 * mean(&between),
        nearest_wrong_rms_millimetre: 1_000.0 * mean(&nearest_wrong),
        signal_to_noise: signal_to_noise(&within, &between),
        intensity_signal_to_noise: signal_to_noise(&alike, &unlike),
        test_points: test_points * 8 / tests.len().max(1),
        base_points,
        largest_cloud_bytes: largest,
        subdivide_second: subdividing.as_secs_f64(),
        compare_second: comparing.as_secs_f64(),
    })
}

/// `(mean of ln between - mean of ln within) / sqrt((variance + variance) / 2)`: ratios of errors count.
fn signal_to_noise(within: &[f64], between: &[f64]) -> f64 {
    let moments = |values: &[f64]| {
        let logs: Vec<f64> = values.iter().map(|value| libm::log(value.max(1e-12))).collect();
        let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
        (mean, logs.iter().map(|log| (log - mean) * (log - mean)).sum::<f64>() / logs.len().max(1) as f64)
    };
    let ((a, va), (b, vb)) = (moments(within), moments(between));
    let pooled = libm::sqrt(f64::midpoint(va, vb));
    if pooled > 0.0 { (b - a) / pooled } else { 0.0 }
}

/// The table. Writing to a string cannot fail.
fn text(document: &Document) -> String {
    let mut text =
        "level  within mm  nearest wrong mm  between mm  shape S/N  intensity S/N    points  largest MB  subdivide s  compare s\n"
            .to_owned();
    for level in &document.levels {
        let _ = writeln!(
            text,
            "{:>5}{:>11.0}{:>18.0}{:>12.0}{:>11.2}{:>15.2}{:>10}{:>12.1}{:>13.2}{:>11.2}",
            level.level,
            level.within_rms_millimetre,
            level.nearest_wrong_rms_millimetre,
            level.between_rms_millimetre,
            level.signal_to_noise,
            level.intensity_signal_to_noise,
            level.base_points,
            level.largest_cloud_bytes as f64 / 1e6,
            level.subdivide_second,
            level.compare_second
        );
    }
    let _ = writeln!(
        text,
        "picked: level {}, the first with at least {:.0} % of the largest signal-to-noise ratio; of both the lower counts",
        document.picked_level,
        ENOUGH * 100.0
    );
    text
}

fn html(document: &Document) -> String {
    let last = document.levels.last().map_or(0, |level| level.level);
    let most = document
        .levels
        .iter()
        .map(|level| level.signal_to_noise.max(level.intensity_signal_to_noise))
        .fold(1.0, f64::max);
    let curve = |value: fn(&Row) -> f64, colour, dashed| Curve {
        points: document.levels.iter().map(|level| [f64::from(level.level), value(level)]).collect(),
        colour,
        dashed,
    };
    let plot = Plot {
        title: "Signal-to-noise ratio by level (line: shape; broken: intensity)".to_owned(),
        x: Axis {
            label: "level of subdivision".to_owned(),
            from: 0.0,
            to: f64::from(last),
            logarithmic: false,
            ticks: (0..=last).map(|level| (f64::from(level), level.to_string())).collect(),
        },
        y: Axis {
            label: "signal to noise".to_owned(),
            from: 0.0,
            to: libm::ceil(most),
            logarithmic: false,
            ticks: (0..=libm::ceil(most) as u32).map(|tick| (f64::from(tick), tick.to_string())).collect(),
        },
        curves: vec![
            curve(|level| level.signal_to_noise, "var(--good, #0f8a55)", false),
            curve(|level| level.intensity_signal_to_noise, "var(--mark, #b7791f)", true),
        ],
        marks: Vec::new(),
    };
    let body = format!(
        "<h1>How far should subdivision go?</h1>\n{}\n<pre>{}</pre>\n",
        plot.to_svg(),
        page::escape_lines(&text(document))
    );
    page::page("daymark: subdivision", &body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_that_are_alike_and_far_apart_are_a_good_signal() {
        let (near, far) = ([1.0, 1.1, 0.9], [10.0, 11.0, 9.0]);
        assert!(signal_to_noise(&near, &far) > 10.0);
        assert!(signal_to_noise(&near, &near).abs() < 1e-12);
        // The unit does not count.
        let scaled = near.map(|x| 7.0 * x);
        let difference = signal_to_noise(&near, &far) - signal_to_noise(&scaled, &far.map(|x| 7.0 * x));
        assert!(difference.abs() < 1e-9);
    }
}
