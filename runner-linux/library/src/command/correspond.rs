//! `daymark correspond`: which corner of one picture is which corner of another.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use daymark_core::geometry::correspond::Sources;
use daymark_core::geometry::quad::Tolerance;

use super::{CommandError, Outcome};
use crate::correspond::automatic::{self, CORNERS_PER_IMAGE};
use crate::correspond::corner_file::read_corners;
use crate::correspond::drawing::Drawing;
use crate::correspond::fate::Judge;
use crate::correspond::finding::Finding;
use crate::correspond::matching::{Matcher, Rule};
use crate::correspond::{Corners, MOST_CORNERS, text};
use crate::engine::FRAME_SIDE;
use crate::picture::read_gray;

/// Noise of automatic corners in the working frame, px.
const AUTOMATIC_NOISE_PX: f32 = 0.7;
/// Noise of corners that a person picked, px.
const PICKED_NOISE_PX: f32 = 0.5;

/// Arguments of `daymark correspond`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Corners are compared by their places alone, by what an affine map keeps of them; what the pictures
look like there is not asked. This is the way for corners picked by hand, for night, infrared and
drawings. Automatic corners of photographs match so only from nearly the same place: pictures rich
in texture are better matched by what they look like, as `daymark recognize` does.

A file of corners is CSV with the columns number, x_px, y_px (a line with #: a remark) or JSON:
  {\"corners\": [{\"number\": 1, \"x_px\": 209.9, \"y_px\": 202.4}]}

Exit codes: 0 there are correspondences, 1 there are none and it is said why, 2 an error.")]
pub struct Args {
    /// The first picture; with --corners it is only drawn
    #[arg(value_name = "A", required_unless_present = "corners", requires = "second")]
    first: Option<PathBuf>,
    /// The second picture
    #[arg(value_name = "B")]
    second: Option<PathBuf>,
    /// Match these corners, picked by hand, instead of automatic ones
    #[arg(long, value_name = "CORNERS", num_args = 2)]
    corners: Vec<PathBuf>,
    /// Automatic corners of each picture, the strongest; more find more and take longer
    #[arg(long, value_name = "N", default_value_t = CORNERS_PER_IMAGE as u16,
          value_parser = clap::value_parser!(u16).range(4..=MOST_CORNERS as i64))]
    corners_per_image: u16,
    /// How exact the corners are: standard deviation of each coordinate, px (for automatic corners, of a picture 640 px long)
    /// [default: 0.5 with --corners, otherwise 0.7]
    #[arg(long, value_name = "PX", value_parser = noise)]
    noise_px: Option<f32>,
    /// What proposes matches: quads of nested hulls, corners with their neighbours, or both
    #[arg(long, value_enum, default_value_t = Source::Both)]
    source: Source,
    /// Match by the thesis' plain rule: layer by layer, the circular shift at which most area ratios agree; not verified
    #[arg(long, conflicts_with_all = ["source", "noise_px"])]
    plain: bool,
    /// How much two area ratios may differ, relatively, by the plain rule
    #[arg(long, default_value_t = 0.05, requires = "plain", value_parser = epsilon)]
    epsilon: f64,
    /// The same number means the same corner in both files: count right and wrong matches
    #[arg(long, requires = "corners")]
    check_numbers: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Draw both pictures with their layers, the matches, and why the other quads were refused
    #[arg(long, value_name = "OUT.svg")]
    svg: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Source {
    /// Quads of nested hulls
    Layers,
    /// Corners with their neighbours
    Arrangements,
    /// Both
    Both,
}

impl From<Source> for Sources {
    fn from(source: Source) -> Self {
        match source {
            Source::Layers => Self::Layers,
            Source::Arrangements => Self::Arrangements,
            Source::Both => Self::Both,
        }
    }
}

fn noise(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value <= 20.0 => Ok(value),
        _ => Err("give pixels above 0 and at most 20, such as 0.5".to_owned()),
    }
}

fn epsilon(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        _ => Err("give a part above 0 and below 1, such as 0.05".to_owned()),
    }
}

/// A relative tolerance as core has it, in millionths.
fn tolerance(epsilon: f64) -> Tolerance {
    Tolerance { part: (epsilon * 1e6).round_ties_even() as u32, whole: 1_000_000 }
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read, corners that cannot be matched, a drawing that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let first = corners(args, 0)?;
    let second = corners(args, 1)?;
    let rule = if args.plain {
        Rule::Plain { epsilon: tolerance(args.epsilon) }
    } else {
        let usual = if args.corners.is_empty() { AUTOMATIC_NOISE_PX } else { PICKED_NOISE_PX };
        Rule::Tolerant { sources: args.source.into(), noise_px: args.noise_px.unwrap_or(usual) }
    };
    let matching = Matcher::default().run(&first, &second, rule)?;
    let judge = Judge::new(&matching, &first.places, &second.places);
    let finding = Finding::new(&matching, [&first, &second], &judge, args.check_numbers);
    if let Some(path) = &args.svg {
        let drawing = Drawing { corners: [&first, &second], matching: &matching, finding: &finding, judge: &judge };
        std::fs::write(path, drawing.to_svg()).map_err(|error| {
            format!(
                "cannot write the drawing {}: {error}; give a path in a folder that exists and is yours",
                path.display()
            )
        })?;
    }
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&finding)?)?;
    } else {
        out.write_all(text::finding(&finding).as_bytes())?;
    }
    Ok(if finding.correspondences.is_empty() { Outcome::NoAnswer } else { Outcome::Done })
}

/// The corners of one side, with the picture that they are drawn on.
fn corners(args: &Args, side: usize) -> Result<Corners, CommandError> {
    let picture = if side == 0 { args.first.as_deref() } else { args.second.as_deref() };
    match (args.corners.get(side), picture) {
        (None, Some(picture)) => automatic_corners(picture, args.corners_per_image),
        (None, None) => Err("give two pictures, or two files of corners with --corners".into()),
        (Some(file), picture) => {
            let mut corners = read_corners(file)?;
            if let Some(picture) = picture {
                let image = read_gray(picture)?;
                corners.size_px = [image.width as u32, image.height as u32];
                corners.picture = Some(image);
            }
            Ok(corners)
        }
    }
}

fn automatic_corners(path: &Path, count: u16) -> Result<Corners, CommandError> {
    let image = read_gray(path)?;
    let file_side = image.width.max(image.height);
    let image = image.scaled_to(FRAME_SIDE);
    let places =
        automatic::corners(&image, usize::from(count)).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(Corners {
        name: path.to_string_lossy().into_owned(),
        numbers: (0..).take(places.len()).collect(),
        places,
        size_px: [image.width as u32, image.height as u32],
        file_from_working: file_side as f64 / FRAME_SIDE as f64,
        picture: Some(image),
    })
}
