//! `daymark classify`: which of several models a model is, by shape and, where shapes tie, by appearance.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{CommandError, Outcome};
use crate::classify::align::Align;
use crate::classify::cloud::Cloud;
use crate::classify::decide::{Answer, Intensity, Refusal, Rule};
use crate::classify::experiment::{Method, Row, compare_with_each, size};
use crate::classify::histogram::{Histogram, coloured};
use crate::model_file::{self, Format};
use crate::order;
use crate::table_file::replace_file;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;

/// Arguments of `daymark classify`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 every test is one of the bases, 1 some test is none of them, 2 an error.")]
pub struct Args {
    /// Models to classify: .ply, .glb or .obj files, as `daymark synthesize` writes them
    #[arg(required = true, value_name = "TESTS")]
    tests: Vec<PathBuf>,
    /// The folder with the known models: each .ply, .glb or .obj file is one, its name is the building's
    #[arg(long, value_name = "DIR")]
    bases: PathBuf,
    /// How the clouds come together
    #[arg(long, value_enum, default_value_t = Align::Centered)]
    align: Align,
    /// Which intensity error decides among equal shapes
    #[arg(long, value_enum, default_value_t = Intensity::Free)]
    intensity: Intensity,
    /// Bases whose shape error is at most this many times the least are told apart by appearance
    #[arg(long, value_name = "RATIO", default_value_t = Rule::default().ambiguity_ratio)]
    ambiguity: f64,
    /// Largest shape error of an answer, as a share of the test's size
    #[arg(long, value_name = "SHARE", default_value_t = Rule::default().max_shape_share)]
    max_shape: f64,
    /// Largest intensity error of an answer
    #[arg(long, value_name = "ERROR", default_value_t = Rule::default().max_intensity)]
    max_intensity: f64,
    /// Write each test, its points coloured by their distance from the nearest base, into this folder
    #[arg(long, value_name = "DIR")]
    coloured: Option<PathBuf>,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    program_version: &'static str,
    align: Align,
    rule: Rule,
    bases: Vec<String>,
    tests: Vec<Test>,
}

#[derive(Debug, Serialize)]
struct Test {
    #[serde(flatten)]
    row: Row,
    /// Distances of the test's points from the nearest base.
    distances: Option<Histogram>,
}

/// Runs the command.
///
/// # Errors
/// Models that cannot be read, a folder without models.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let (names, bases) = read_bases(&args.bases)?;
    let method = Method {
        align: args.align,
        intensity: args.intensity,
        rule: Rule {
            ambiguity_ratio: args.ambiguity,
            max_shape_share: args.max_shape,
            max_intensity: args.max_intensity,
        },
        ..Method::default()
    };
    let mut tests = Vec::new();
    for path in &args.tests {
        let test = read_cloud(path)?;
        let comparisons = compare_with_each(&test, &bases, &method);
        let row = Row::new(path.display().to_string(), size(&test), &comparisons, &method);
        let nearest = row.decision.nearest.and_then(|base| comparisons.get(base));
        if let (Some(folder), Some(nearest)) = (&args.coloured, nearest) {
            let file = folder.join(path.file_name().unwrap_or(path.as_os_str())).with_extension("ply");
            replace_file(&file, &coloured(&test.positions, &nearest.distances))
                .map_err(|error| format!("cannot write {}: {error}", file.display()))?;
        }
        tests.push(Test { row, distances: nearest.map(|nearest| Histogram::new(&nearest.distances)) });
    }
    let known = tests.iter().all(|test| matches!(test.row.decision.answer, Answer::Known { .. }));
    let mut out = io::stdout().lock();
    if args.json {
        let (schema_version, program_version) = (SCHEMA_VERSION, env!("CARGO_PKG_VERSION"));
        let document =
            Document { schema_version, program_version, align: args.align, rule: method.rule, bases: names, tests };
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        out.write_all(text(&names, &tests).as_bytes())?;
    }
    Ok(if known { Outcome::Done } else { Outcome::NoAnswer })
}

fn read_cloud(path: &Path) -> Result<Cloud, CommandError> {
    let points = model_file::read(path).map_err(|what| format!("cannot use the model {}: {what}", path.display()))?;
    let squares: f64 = points.deviations.iter().map(|&d| f64::from(d) * f64::from(d)).sum();
    let deviation = libm::sqrt(squares / points.positions.len().max(1) as f64);
    Ok(Cloud::new(points.positions, points.gray, deviation))
}

fn read_bases(folder: &Path) -> Result<(Vec<String>, Vec<Cloud>), CommandError> {
    let entries =
        std::fs::read_dir(folder).map_err(|error| format!("cannot read the folder {}: {error}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| Format::of_path(path).is_ok());
    order::sort(&mut paths);
    if paths.is_empty() {
        return Err(format!(
            "{} has no models (.ply, .glb, .obj): write some there with `daymark synthesize -o`",
            folder.display()
        )
        .into());
    }
    let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let clouds = paths.iter().map(|path| read_cloud(path)).collect::<Result<_, _>>()?;
    Ok((paths.iter().map(name).collect(), clouds))
}

/// The tables. Writing to a string cannot fail.
fn text(names: &[String], tests: &[Test]) -> String {
    let mut text = String::new();
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(9) + 2;
    let mut table = |what: &str, value: &dyn Fn(&Row, usize) -> String| {
        let _ = write!(text, "{what}\n{:32}", "");
        for name in names {
            let _ = write!(text, "{name:>width$}");
        }
        text.push('\n');
        for test in tests {
            let _ = write!(text, "{:<32}", test.row.test);
            for base in 0..names.len() {
                let _ = write!(text, "{:>width$}", value(&test.row, base));
            }
            text.push('\n');
        }
        text.push('\n');
    };
    table(
        "Shape: root mean square distance from the test's points to the nearest of the base, 1/1000 of the unit (mm)",
        &|row, base| format!("{:.1}", row.one_sided_rms[base] * 1_000.0),
    );
    table("Shape, both directions, 1/1000 of the unit (mm)", &|row, base| {
        format!("{:.1}", row.symmetric_rms[base] * 1_000.0)
    });
    table(
        "Intensity: share of the test's variance that the base does not explain (gain and bias free)",
        &|row, base| format!("{:.3}", row.intensity_free[base]),
    );
    for test in tests {
        let decision = &test.row.decision;
        let _ = match decision.answer {
            Answer::Known { base, by_appearance } => {
                let how = if by_appearance { "appearance" } else { "shape" };
                writeln!(text, "{}: {} by {how}, next / nearest {:.2}", test.row.test, names[base], decision.margin)
            }
            Answer::Unknown(why) => {
                let nearest = decision.nearest.and_then(|base| names.get(base)).map_or("none", String::as_str);
                let reason = match why {
                    Refusal::NoBases => "there are no bases".to_owned(),
                    Refusal::Shape => format!("the shape is off by {:.2} % of the size", decision.shape_share * 100.0),
                    Refusal::Appearance => {
                        format!("the shape fits, the intensities do not ({:.3})", decision.intensity)
                    }
                    Refusal::Tie => "several fit alike".to_owned(),
                };
                writeln!(text, "{}: unknown; nearest is {nearest}, but {reason}", test.row.test)
            }
        };
        if let Some(distances) = &test.distances {
            text.push_str(&distances.to_text());
        }
    }
    text
}
