//! `daymark study towers`: the thesis' experiment (7.1, 7.2) on the eight towers of `daymark-fixtures`.

use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write};

use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::{Light, Tower};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::super::{CommandError, Outcome};
use crate::classify::align::Align;
use crate::classify::cloud::Cloud;
use crate::classify::decide::Answer;
use crate::classify::experiment::{Method, Row, compare_with_each, size, without};
use crate::classify::towers::{BASE_ANGLES, Conditions, TEST_ANGLES, TowerViews, TrueSurface};

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;

/// Arguments of `daymark study towers`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How often every triangle is divided in four: more takes longer and tells less and less
    #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=7))]
    levels: u8,
    /// Standard deviation of the noise on every corner's coordinates, in pixels of 640 x 480
    #[arg(long, value_name = "PIXELS", default_value_t = 0.5, value_parser = not_negative)]
    noise_px: f64,
    /// Standard deviation of the noise that is added to the gray levels of a test, of 255
    #[arg(long, value_name = "LEVELS", default_value_t = 3.0, value_parser = not_negative)]
    noise_gray: f64,
    /// How often the experiment is repeated with other noise
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    seeds: u32,
    /// How test and base come together
    #[arg(long, value_enum, default_value_t = Align::Centered)]
    align: Align,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..100.0).contains(&value) => Ok(value),
        _ => Err("give a number from 0 to 100".to_owned()),
    }
}

/// The JSON document. Lengths are in millimetres, intensities from 0 to 1.
#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    program_version: &'static str,
    settings: Settings,
    towers: Vec<String>,
    /// The first seed's eight tests.
    rows: Vec<TowerRow>,
    /// How many of them are right.
    right: usize,
    /// How many of them are refused when the true base is removed.
    refused_when_absent: usize,
    /// The least ratio of a wrong error to the right one, over the rows.
    smallest_margin: f64,
    seeds: Seeds,
}

#[derive(Debug, Serialize)]
struct Settings {
    level: u8,
    corner_noise_px: f64,
    gray_noise: f64,
    align: Align,
    base_views_degree: [f64; 12],
    test_views_degree: [f64; 2],
    ambiguity_ratio: f64,
    max_shape_share: f64,
    max_intensity: f64,
}

#[derive(Debug, Serialize)]
struct TowerRow {
    tower: usize,
    shape_rms_millimetre: Vec<f64>,
    shape_symmetric_rms_millimetre: Vec<f64>,
    intensity_error: Vec<f64>,
    intensity_plain_mse: Vec<Option<f64>>,
    ambiguous_towers: Vec<usize>,
    answer_tower: Option<usize>,
    by_appearance: bool,
    margin: f64,
    refused_when_absent: bool,
    /// Median and 95th percentile of the distances of the test's points from the true surface.
    true_surface_median_millimetre: f64,
    true_surface_p95_millimetre: f64,
}

/// All seeds together.
#[derive(Debug, Default, Serialize)]
struct Seeds {
    count: u32,
    tests: usize,
    right: usize,
    refused: usize,
    wrong: usize,
    right_share: f64,
    tests_with_absent_base: usize,
    refused_when_absent: usize,
    false_accepts: usize,
    smallest_margin: f64,
}

/// Runs the study. Without a right answer in every row the exit code is 1.
///
/// # Errors
/// A level whose points do not fit.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let method = Method { align: args.align, ..Method::default() };
    let level = SubdivisionLevel::new(args.levels).ok_or("levels go from 0 to 7")?;
    let towers = Tower::eight();
    let progress = progress_bar(16 + 8 * u64::from(args.seeds));
    let mut bases = Vec::with_capacity(towers.len());
    let mut tests = Vec::with_capacity(towers.len());
    for tower in &towers {
        // Pictures for the bases in the morning; for the tests under a grey sky, from farther away, with other clutter.
        let number = u64::from(tower.number);
        let morning = Conditions { light: Light::morning(), seed: 50 + number, farther: 1.0 };
        let views = TowerViews::new(tower, &BASE_ANGLES, &morning, true);
        bases.push(views.cloud(args.noise_px, 1_000 + number, level)?);
        progress.inc(1);
        let grey = Conditions { light: Light::overcast(), seed: 150 + number, farther: 1.1 };
        tests.push(TowerViews::new(tower, &TEST_ANGLES, &grey, false));
        progress.inc(1);
    }
    let surfaces: Vec<TrueSurface> = towers.iter().map(TrueSurface::new).collect();
    let mut seeds = Seeds { count: args.seeds, smallest_margin: f64::INFINITY, ..Seeds::default() };
    let mut rows = Vec::new();
    for seed in 0..u64::from(args.seeds) {
        for (number, views) in tests.iter().enumerate() {
            let noise_seed = seed * 8 + number as u64;
            let noisy = views.clone().with_gray_noise(args.noise_gray, noise_seed);
            let test = noisy.cloud(args.noise_px, noise_seed, level)?;
            let row = test_row(number, &test, &bases, &surfaces[number], &method);
            seeds.enter(&row);
            if seed == 0 {
                rows.push(row);
            }
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    seeds.right_share = seeds.right as f64 / seeds.tests.max(1) as f64;
    let document = Document {
        schema_version: SCHEMA_VERSION,
        program_version: env!("CARGO_PKG_VERSION"),
        settings: Settings {
            level: args.levels,
            corner_noise_px: args.noise_px,
            gray_noise: args.noise_gray,
            align: args.align,
            base_views_degree: BASE_ANGLES,
            test_views_degree: TEST_ANGLES,
            ambiguity_ratio: method.rule.ambiguity_ratio,
            max_shape_share: method.rule.max_shape_share,
            max_intensity: method.rule.max_intensity,
        },
        towers: towers.iter().map(|tower| tower.name.clone()).collect(),
        right: rows.iter().filter(|row| row.answer_tower == Some(row.tower)).count(),
        refused_when_absent: rows.iter().filter(|row| row.refused_when_absent).count(),
        smallest_margin: rows.iter().map(|row| row.margin).fold(f64::INFINITY, f64::min),
        rows,
        seeds,
    };
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        out.write_all(text(&document).as_bytes())?;
    }
    let all = document.seeds.right == document.seeds.tests && document.seeds.false_accepts == 0;
    Ok(if all { Outcome::Done } else { Outcome::NoAnswer })
}

fn progress_bar(length: u64) -> ProgressBar {
    if !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}

fn test_row(number: usize, test: &Cloud, bases: &[Cloud], surface: &TrueSurface, method: &Method) -> TowerRow {
    let points = test.positions.iter().map(|point| nalgebra::Vector3::from(point.map(f64::from)));
    let [median, p95] = surface.distances(points).map(|metres| metres * 1_000.0);
    let extent = size(test);
    let comparisons = compare_with_each(test, bases, method);
    let row = Row::new(String::new(), extent, &comparisons, method);
    let millimetres = |lengths: Vec<f64>| lengths.into_iter().map(|metres| metres * 1_000.0).collect();
    let (answer, by_appearance) = match row.decision.answer {
        Answer::Known { base, by_appearance } => (Some(base + 1), by_appearance),
        Answer::Unknown(_) => (None, false),
    };
    TowerRow {
        tower: number + 1,
        shape_rms_millimetre: millimetres(row.one_sided_rms),
        shape_symmetric_rms_millimetre: millimetres(row.symmetric_rms),
        intensity_error: row.intensity_free,
        intensity_plain_mse: row.intensity_plain,
        ambiguous_towers: row.decision.ambiguous.iter().map(|base| base + 1).collect(),
        answer_tower: answer,
        by_appearance,
        margin: row.decision.margin,
        true_surface_median_millimetre: median,
        true_surface_p95_millimetre: p95,
        refused_when_absent: matches!(without(number, extent, &comparisons, method), Answer::Unknown(_)),
    }
}

impl Seeds {
    fn enter(&mut self, row: &TowerRow) {
        self.tests += 1;
        match row.answer_tower {
            Some(tower) if tower == row.tower => self.right += 1,
            Some(_) => {
                self.wrong += 1;
                self.false_accepts += 1;
            }
            None => self.refused += 1,
        }
        self.tests_with_absent_base += 1;
        if row.refused_when_absent {
            self.refused_when_absent += 1;
        } else {
            self.false_accepts += 1;
        }
        self.smallest_margin = self.smallest_margin.min(row.margin);
    }
}

/// The tables. Writing to a string cannot fail.
fn text(document: &Document) -> String {
    let mut text = String::new();
    let heads = |text: &mut String, what: &str| {
        let _ = write!(text, "{what:16}");
        for (number, _) in (1..).zip(&document.towers) {
            let _ = write!(text, "{:>9}", format!("base {number}"));
        }
        text.push('\n');
    };
    let _ = writeln!(text, "Shape: root mean square distance from the test's points to the nearest of the base, mm");
    heads(&mut text, "");
    for (row, name) in document.rows.iter().zip(&document.towers) {
        let _ = write!(text, "{:<16}", format!("{} {name}", row.tower));
        for (base, value) in (1..).zip(&row.shape_rms_millimetre) {
            let mark = if base == row.tower { "*" } else { "" };
            let _ = write!(text, "{:>9}", format!("{mark}{value:.0}"));
        }
        text.push('\n');
    }
    let _ = writeln!(text, "\nShape, both directions, mm");
    heads(&mut text, "");
    for (row, name) in document.rows.iter().zip(&document.towers) {
        let _ = write!(text, "{:<16}", format!("{} {name}", row.tower));
        for value in &row.shape_symmetric_rms_millimetre {
            let _ = write!(text, "{value:>9.0}");
        }
        text.push('\n');
    }
    let _ =
        writeln!(text, "\nIntensity: share of the test's variance that the base does not explain (gain and bias free)");
    heads(&mut text, "");
    for (row, name) in document.rows.iter().zip(&document.towers) {
        let _ = write!(text, "{:<16}", format!("{} {name}", row.tower));
        for value in &row.intensity_error {
            let _ = write!(text, "{value:>9.3}");
        }
        text.push('\n');
    }
    let _ = writeln!(text, "\nDecision");
    for (row, name) in document.rows.iter().zip(&document.towers) {
        let answer = row.answer_tower.map_or("unknown".to_owned(), |tower| format!("tower {tower}"));
        let how = if row.by_appearance {
            format!(" by appearance among {:?}", row.ambiguous_towers)
        } else {
            " by shape".to_owned()
        };
        let absent = if row.refused_when_absent { "refused" } else { "ACCEPTED" };
        let _ = writeln!(
            text,
            "{:<16} {answer}{how}, closest wrong / right {:.2}; without its base: {absent}",
            format!("{} {name}", row.tower),
            row.margin
        );
    }
    let _ = writeln!(text, "\nTrue surface: distance of the test's points from it, mm (median, 95 %)");
    for (row, name) in document.rows.iter().zip(&document.towers) {
        let _ = writeln!(
            text,
            "{:<16}{:>9.0}{:>9.0}",
            format!("{} {name}", row.tower),
            row.true_surface_median_millimetre,
            row.true_surface_p95_millimetre
        );
    }
    let seeds = &document.seeds;
    let _ = writeln!(
        text,
        "\nright {} of {}, refused when absent {} of {}, smallest margin {:.2}",
        document.right,
        document.rows.len(),
        document.refused_when_absent,
        document.rows.len(),
        document.smallest_margin
    );
    let _ = writeln!(
        text,
        "{} seeds: right {} of {} ({:.1} %), refused {}, wrong {}; true base absent: refused {} of {}; \
         false accepts {}, smallest margin {:.2}",
        seeds.count,
        seeds.right,
        seeds.tests,
        100.0 * seeds.right_share,
        seeds.refused,
        seeds.wrong,
        seeds.refused_when_absent,
        seeds.tests_with_absent_base,
        seeds.false_accepts,
        seeds.smallest_margin
    );
    text
}
