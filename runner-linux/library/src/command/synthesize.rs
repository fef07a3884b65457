//! `daymark synthesize`: pictures in, a textured model out.

pub(super) mod cameras;
mod output;

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;

use daymark_core::mesh::SubdivisionLevel;
use indicatif::ProgressBar;

use super::{CommandError, Outcome};
use crate::classify::cloud::Similarity;
use crate::enroll::upright::upright as upright_by_walls;
use crate::model_file::Format;
use crate::parallel;
use crate::picture::{PictureError, read_colour, scaled_colours};
use crate::synthesize::frame::{Scale, moved, upright};
use crate::synthesize::reconstruct::{Cameras, Corners, NoModel, Reconstruction, Shape, reconstruct};
use crate::synthesize::report::facts;
use crate::synthesize::triangulate::Rules;
use crate::synthesize::view::View;

/// Arguments of `daymark synthesize`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 the model is written, 1 the pictures give no model (the reason has a figure), 2 an error. \
                        No file is written unless all is done.\n\n\
                        Memory: pictures take 4 bytes a pixel of the size used, the dense model 47 bytes a point; 47 corners \
                        have 672,385 points at level 7 (32 MB), and more than 24,000,000 points (1.2 GB) are refused."
)]
pub struct Args {
    /// Pictures of one building, from two or more places
    #[arg(required = true, value_name = "IMAGES")]
    images: Vec<PathBuf>,
    /// Where the model goes: .glb (glTF 2.0), .ply or .obj
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Known cameras: a COLMAP folder (pictures by name), one lens for all (OpenCV or ROS YAML), or one file for each picture
    /// in their order (.camera, YAML, or a 3 x 4 projection matrix as text)
    #[arg(long, value_name = "PATHS", num_args = 1..)]
    cameras: Vec<PathBuf>,
    /// Focal length in pixels of the pictures as they are, if EXIF does not say it. Without any, cameras are taken as affine:
    /// coarser, without scale, and from two pictures without angles
    #[arg(long, value_name = "PIXELS", conflicts_with = "cameras")]
    focal_px: Option<f64>,
    /// The lens is exactly as given: do not adjust focal length and distortion to the pictures
    #[arg(long)]
    fixed_lens: bool,
    /// Corners picked by hand, one file for each picture with lines number,x,y; the same number is the same corner
    #[arg(long, value_name = "FILES", num_args = 1..)]
    corners: Vec<PathBuf>,
    /// Metres between the cameras of the first two pictures
    #[arg(long, value_name = "METRES", group = "scale")]
    distance_m: Option<f64>,
    /// Metres from the lowest to the highest point of what the pictures show
    #[arg(long, value_name = "METRES", group = "scale")]
    height_m: Option<f64>,
    /// How often every triangle is divided in four, for smoother textures and denser clouds
    #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=7))]
    levels: u8,
    /// What colours a glTF: the pictures themselves, or one colour for each triangle, the mean of its points
    #[arg(long, value_enum, default_value_t = output::Texture::Pictures)]
    texture: output::Texture,
    /// Longer side to which pictures are scaled down before anything else
    #[arg(long, value_name = "PIXELS", default_value_t = 1600, value_parser = clap::value_parser!(u32).range(256..=4000))]
    side: u32,
    /// Points with less parallax are refused, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 1.5)]
    min_parallax: f64,
    /// Points with a larger reprojection error are refused, pixels of the size used
    #[arg(long, value_name = "PIXELS", default_value_t = 3.0)]
    max_error_px: f64,
    /// Draw the model as the first picture's camera sees it
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Write the report as a page with pictures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Tell why matches, points and triangles were left out: counts for each pair, and matches one by one (with --json, too)
    #[arg(long)]
    explain: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Pictures, cameras or corners that cannot be used, files that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let format = Format::of_path(&args.output)?;
    if args.images.len() < 2 {
        return Err("one picture has no depth: give two or more, from different places".into());
    }
    for (what, count) in [("--corners", args.corners.len())] {
        if count > 0 && count != args.images.len() {
            return Err(format!(
                "{what} needs one file for each picture: {} pictures, {count} files",
                args.images.len()
            )
            .into());
        }
    }
    let level = SubdivisionLevel::new(args.levels).ok_or("levels go from 0 to 7")?;
    let progress = Steps::new();
    progress.step("reading pictures");
    let (views, known, corners) = inputs(args)?;
    let rules =
        Rules { min_parallax_degree: args.min_parallax, max_reprojection_px: args.max_error_px, ..Rules::default() };
    progress.step("matching corners and placing cameras");
    let mut made = match reconstruct(views, &known, &corners, &rules) {
        Ok(made) => made,
        Err(NoModel::Picture(what)) => return Err(what.into()),
        Err(reason) => {
            progress.done();
            writeln!(io::stderr(), "no model: {reason}")?;
            if args.json {
                let document = serde_json::json!({
                    "schema_version": crate::synthesize::report::SCHEMA_VERSION,
                    "model": null,
                    "reason": reason.to_string(),
                });
                writeln!(io::stdout(), "{document:#}")?;
            }
            return Ok(Outcome::NoAnswer);
        }
    };
    let unit = place(args, &mut made)?;
    progress.step("subdividing");
    let dense = made.model.dense(level, &made.views, &made.stations)?;
    let mut facts = facts(&made, &dense, unit);
    facts.explained = args.explain.then(|| std::mem::take(&mut made.explained));
    progress.step("writing");
    output::write(&args.output, format, args.texture, &made, &dense, &facts)?;
    if let Some(path) = &args.preview {
        output::save(path, &output::preview(&made, &dense))?;
    }
    if let Some(path) = &args.report {
        output::save(path, output::page(&made, &dense, &facts).as_bytes())?;
    }
    progress.done();
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&facts)?)?;
    } else {
        out.write_all(output::text(&facts, &args.output, args.explain).as_bytes())?;
    }
    Ok(Outcome::Done)
}

type Inputs = (Vec<View>, Cameras, Corners);

fn inputs(args: &Args) -> Result<Inputs, CommandError> {
    let side = args.side as usize;
    let pictures = parallel::try_map(&args.images, |path| {
        let (gray, rgb) = read_colour(path)?;
        let size = [gray.width, gray.height];
        if gray.width.max(gray.height) <= side {
            return Ok((gray, rgb, size));
        }
        let rgb = scaled_colours(&rgb, gray.width, gray.height, side);
        Ok::<_, PictureError>((gray.scaled_to(side), rgb, size))
    })?;
    let sizes: Vec<[u32; 2]> = pictures.iter().map(|picture| picture.2.map(|length| length as u32)).collect();
    let (lenses, known) = cameras::cameras(&args.images, &sizes, &args.cameras, args.focal_px, args.fixed_lens)?;
    let corners = if args.corners.is_empty() {
        Corners::Automatic
    } else {
        let scale = |at: f64, from: u32, to: usize| (at + 0.5) * to as f64 / f64::from(from) - 0.5;
        let picked = args.corners.iter().zip(&pictures).zip(&sizes).map(|((path, (gray, ..)), [width, height])| {
            let text = std::fs::read_to_string(path)
                .map_err(|error| format!("cannot read the corners {}: {error}", path.display()))?;
            let corners = crate::synthesize::corner_file::parse(&text)
                .map_err(|what| format!("cannot use the corners {}: {what}", path.display()))?;
            Ok::<_, String>(
                corners
                    .into_iter()
                    .map(|(corner, [x, y])| (corner, [scale(x, *width, gray.width), scale(y, *height, gray.height)]))
                    .collect(),
            )
        });
        Corners::Picked(picked.collect::<Result<_, _>>()?)
    };
    let views = pictures
        .into_iter()
        .zip(lenses)
        .zip(&args.images)
        .map(|(((gray, rgb, _), lens), path)| View {
            name: View::name_of(path),
            lens: lens.scaled_to(gray.width as u32, gray.height as u32),
            gray,
            rgb,
        })
        .collect();
    Ok((views, known, corners))
}

/// Takes a model to the frame that the arguments ask for; returns what a length of one means.
fn place(args: &Args, made: &mut Reconstruction) -> Result<&'static str, CommandError> {
    let asked = match (args.distance_m, args.height_m) {
        (Some(metres), _) | (_, Some(metres)) if !(metres > 0.0 && metres < 1e6) => {
            return Err(format!("{metres} m is no distance or height of a building").into());
        }
        (Some(_), _) if made.shape == Shape::UpToMirror => {
            return Err("affine cameras have no distance between them: give --focal-px, or --height-m instead".into());
        }
        (Some(metres), _) => Scale::Distance(metres),
        (_, Some(metres)) => Scale::Height(metres),
        _ if made.shape == Shape::Metric => return Ok("camera_file_unit"),
        // An affine model has no lengths, and its frame no up.
        _ if made.shape == Shape::Affine => return Ok("affine"),
        _ if made.shape == Shape::UpToMirror => {
            let map = upright(made, &Scale::Height(1.0)).ok_or("the cameras do not say where up is")?;
            moved(made, &map);
            return Ok("model_height");
        }
        _ => Scale::Places(cameras::places(&args.images)),
    };
    if made.shape == Shape::Affine {
        return Err("without a focal length two pictures have no scale: give --focal-px, or a third picture".into());
    }
    if made.shape == Shape::Metric {
        return Err("the cameras' file says how long everything is: leave out --distance-m and --height-m".into());
    }
    let (map, unit) = match levelled(made, &asked) {
        Some(map) => (map, "metre"),
        None if matches!(asked, Scale::Places(_)) => {
            (levelled(made, &Scale::None).ok_or("the cameras do not say where up is")?, "first_baseline")
        }
        None => {
            return Err(
                "the first two pictures are not both part of the model, so their distance gives no scale".into()
            );
        }
    };
    moved(made, &map);
    Ok(unit)
}

/// Upright by walls and level cameras, as landmarks are enrolled; by the cameras' mean up where those say nothing.
fn levelled(made: &Reconstruction, scale: &Scale) -> Option<Similarity> {
    let by_walls = upright_by_walls(made, (scale.clone(), None), &[], 0.0, None);
    by_walls.map(|frame| frame.map).or_else(|| upright(made, scale))
}

/// Says on a terminal what is going on.
struct Steps(ProgressBar);

impl Steps {
    fn new() -> Self {
        let bar = if io::stderr().is_terminal() { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
        bar.enable_steady_tick(std::time::Duration::from_millis(120));
        Self(bar)
    }

    fn step(&self, what: &'static str) {
        self.0.set_message(what);
    }

    fn done(&self) {
        self.0.finish_and_clear();
    }
}
