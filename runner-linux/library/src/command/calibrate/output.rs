//! Files and texts about a calibration.

use std::fmt::Write as _;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use serde::Serialize;

use super::Args;
use crate::calibrate::board::Board;
use crate::calibrate::quality::Coverage;
use crate::calibrate::refine::UNKNOWNS;
use crate::calibrate::solve::{Calibration, Fate, NoCalibration};
use crate::calibrate::{FoundBoard, NoBoard, pattern as drawn};
use crate::camera_file::yaml::{FOCAL_ERROR, Form, text as yaml};
use crate::command::CommandError;
use crate::report::page as html;
use crate::table_file::replace_file;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
const NAMES: [&str; UNKNOWNS] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"];

/// Writes bytes to a file that is there whole or not at all.
pub(super) fn save(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    replace_file(path, bytes).map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

/// The board as the ending of the file wants it.
pub(super) fn pattern(path: &Path, board: &Board) -> Result<Vec<u8>, CommandError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match ending.as_str() {
        "svg" => Ok(drawn::svg(board).into_bytes()),
        "png" => {
            let picture = drawn::picture(board);
            let mut png = Vec::new();
            let (width, height) = (picture.width as u32, picture.height as u32);
            PngEncoder::new(&mut png).write_image(&picture.pixels, width, height, ExtendedColorType::L8)?;
            Ok(png)
        }
        _ => Err(format!("{}: a board is written as .svg (to print) or .png (for a screen)", path.display()).into()),
    }
}

pub(super) fn pattern_text(path: &Path, board: &Board) -> String {
    format!(
        "{}: {} x {} inner corners, squares of {} mm if printed at full size. Measure a square and tell it with --square-mm.",
        path.display(),
        board.columns,
        board.rows,
        board.square_mm
    )
}

/// The lens in the forms that were asked for.
pub(super) fn files<'a>(args: &'a Args, calibration: &Calibration) -> Result<Vec<(&'a Path, Vec<u8>)>, CommandError> {
    let notes = [(FOCAL_ERROR, calibration.focal_error()), ("avg_reprojection_error", calibration.rms_px)];
    [(&args.output, Form::OpenCv), (&args.ros, Form::Ros)]
        .into_iter()
        .filter_map(|(path, form)| Some((path.as_deref()?, form)))
        .map(|(path, form)| {
            let text = yaml(&calibration.lens, form, &args.camera_name, &notes).ok_or("no YAML holds this lens")?;
            Ok((path, text.into_bytes()))
        })
        .collect()
}

/// Everything that is said; lengths in pixels.
#[derive(Debug, Serialize)]
pub(super) struct Facts {
    schema_version: u32,
    program_version: &'static str,
    board: BoardFacts,
    width_px: u32,
    height_px: u32,
    lens: Option<LensFacts>,
    reason: Option<ReasonFacts>,
    pictures: Vec<PictureFacts>,
}

#[derive(Debug, Serialize)]
struct BoardFacts {
    columns: u8,
    rows: u8,
    square_mm: f64,
}

#[derive(Debug, Serialize)]
struct LensFacts {
    /// fx, fy, cx, cy in pixels, then coefficients without unit.
    parameters: Vec<ParameterFacts>,
    focal_length_relative_error: f64,
    field_of_view_degrees: [f64; 2],
    rms_px: f64,
    corners: usize,
    coverage: CoverageFacts,
    advice: Vec<AdviceFacts>,
    files: Vec<String>,
}

#[derive(Debug, Serialize)]
struct ParameterFacts {
    name: &'static str,
    value: f64,
    standard_deviation: f64,
}

#[derive(Debug, Serialize)]
struct CoverageFacts {
    share: f64,
    corners_in_columns: [usize; 3],
    corners_in_rows: [usize; 3],
    largest_radius_share: f64,
}

#[derive(Debug, Serialize)]
struct AdviceFacts {
    code: &'static str,
    message: String,
}

#[derive(Debug, Serialize)]
struct ReasonFacts {
    code: &'static str,
    message: String,
}

#[derive(Debug, Serialize)]
struct PictureFacts {
    file: String,
    used: bool,
    corners: usize,
    corners_left_out: usize,
    rms_px: Option<f64>,
    tilt_degrees: Option<f64>,
    by_towers: Option<bool>,
    reason: Option<String>,
}

impl PictureFacts {
    fn new(path: &Path, fate: &Fate) -> Self {
        let mut facts = Self {
            file: path.to_string_lossy().into_owned(),
            used: false,
            corners: 0,
            corners_left_out: 0,
            rms_px: None,
            tilt_degrees: None,
            by_towers: None,
            reason: None,
        };
        match fate {
            Fate::Used { corners, left_out, rms_px, tilt_degrees, towers } => {
                facts.used = rms_px.is_finite();
                facts.corners = *corners;
                facts.corners_left_out = *left_out;
                facts.rms_px = rms_px.is_finite().then_some(*rms_px);
                facts.tilt_degrees = Some(*tilt_degrees);
                facts.by_towers = Some(*towers);
            }
            Fate::NoBoard(reason) => facts.reason = Some(reason.to_string()),
            Fate::Apart { rms_px, middle_px } => {
                facts.rms_px = Some(*rms_px);
                facts.reason = Some(format!(
                    "its corners are {rms_px:.2} px beside where the others want them, and theirs {middle_px:.2} px: motion, \
                     another focus or zoom, or a bent board"
                ));
            }
            Fate::OnALine => facts.reason = Some("its corners lie on a line".to_owned()),
        }
        facts
    }
}

impl Facts {
    pub(super) fn new(
        args: &Args,
        board: &Board,
        [width_px, height_px]: [u32; 2],
        solved: &Result<Calibration, NoCalibration>,
        fates: &[Fate],
    ) -> Self {
        let files = [&args.output, &args.ros];
        let files = files.into_iter().flatten().map(|path| path.to_string_lossy().into_owned()).collect();
        Self {
            schema_version: SCHEMA_VERSION,
            program_version: env!("CARGO_PKG_VERSION"),
            board: BoardFacts { columns: board.columns, rows: board.rows, square_mm: board.square_mm },
            width_px,
            height_px,
            lens: solved.as_ref().ok().map(|calibration| LensFacts::new(calibration, files)),
            reason: solved
                .as_ref()
                .err()
                .map(|reason| ReasonFacts { code: reason.name(), message: reason.to_string() }),
            pictures: args.pictures.iter().zip(fates).map(|(path, fate)| PictureFacts::new(path, fate)).collect(),
        }
    }

    /// The same for people.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let long = self.pictures.iter().map(|picture| picture.file.chars().count()).max().unwrap_or(0).clamp(7, 40);
        let _ = writeln!(text, "{:long$}  corners  left out  rms, px  tilt, deg", "picture");
        for picture in &self.pictures {
            if let Some(reason) = &picture.reason {
                let _ = writeln!(text, "{:long$}  not used: {reason}", picture.file);
                continue;
            }
            let rms = picture.rms_px.map_or_else(|| "-".to_owned(), |rms| format!("{rms:.3}"));
            let tilt = picture.tilt_degrees.unwrap_or_default();
            let (corners, left_out) = (picture.corners, picture.corners_left_out);
            let _ = writeln!(text, "{:long$}  {corners:7}  {left_out:8}  {rms:>7}  {tilt:9.1}", picture.file);
        }
        let Some(lens) = &self.lens else { return text };
        let _ = writeln!(
            text,
            "\n{} x {} px, {} corners, rms {:.3} px",
            self.width_px, self.height_px, lens.corners, lens.rms_px
        );
        // What has no deviation was not looked for.
        for ParameterFacts { name, value, standard_deviation } in
            lens.parameters.iter().filter(|parameter| parameter.standard_deviation > 0.0)
        {
            let digits = decimals(*standard_deviation);
            let _ = writeln!(text, "{name:>4} {value:>14.digits$} +- {standard_deviation:.digits$}");
        }
        let [across, down] = lens.field_of_view_degrees;
        let _ = writeln!(
            text,
            "field of view {across:.1} x {down:.1} degrees; the focal length is known to {:.2} %",
            100.0 * lens.focal_length_relative_error
        );
        let CoverageFacts { share, largest_radius_share, .. } = lens.coverage;
        let _ = writeln!(
            text,
            "the board was in {:.0} % of the frame, and {:.0} % of the way into its corners",
            100.0 * share,
            100.0 * largest_radius_share
        );
        for advice in &lens.advice {
            let _ = writeln!(text, "better: {}", advice.message);
        }
        for file in &lens.files {
            let _ = writeln!(text, "written: {file}");
        }
        text
    }
}

/// Decimals that show two digits of a deviation.
fn decimals(deviation: f64) -> usize {
    (1.0 - libm::floor(libm::log10(deviation))).clamp(0.0, 9.0) as usize
}

impl LensFacts {
    fn new(calibration: &Calibration, files: Vec<String>) -> Self {
        let lens = &calibration.lens;
        let Coverage { share, columns, rows, radius } = calibration.coverage;
        let angle = |length: u32, focal: f64| 2.0 * libm::atan(f64::from(length) / 2.0 / focal).to_degrees();
        Self {
            parameters: NAMES
                .iter()
                .zip(calibration.numbers.iter().zip(&calibration.deviations))
                .map(|(name, (value, deviation))| ParameterFacts {
                    name,
                    value: *value,
                    standard_deviation: *deviation,
                })
                .collect(),
            focal_length_relative_error: calibration.focal_error(),
            field_of_view_degrees: [angle(lens.width, lens.focal[0]), angle(lens.height, lens.focal[1])],
            rms_px: calibration.rms_px,
            corners: calibration.corners,
            coverage: CoverageFacts {
                share,
                corners_in_columns: columns,
                corners_in_rows: rows,
                largest_radius_share: radius,
            },
            advice: calibration
                .advice
                .iter()
                .map(|advice| AdviceFacts { code: advice.name(), message: advice.to_string() })
                .collect(),
            files,
        }
    }
}

/// The report as a page.
pub(super) fn page(
    facts: &Facts,
    found: &[Result<FoundBoard, NoBoard>],
    solved: &Result<Calibration, NoCalibration>,
) -> String {
    let mut body = "<h1>Calibration of a lens</h1>\n".to_owned();
    match solved {
        Ok(calibration) => {
            body.push_str("<div class=\"tiles\">\n");
            body += &html::tile(&format!("{:.1} px", calibration.numbers[0]), "focal length, across");
            body += &html::tile(&format!("{:.2} %", 100.0 * calibration.focal_error()), "its error");
            body += &html::tile(&format!("{:.3} px", calibration.rms_px), "corners beside their places, rms");
            body += &html::tile(&format!("{:.0} %", 100.0 * calibration.coverage.share), "of the frame covered");
            body.push_str("</div>\n");
            for advice in &calibration.advice {
                let _ = writeln!(body, "<p class=\"mark\">{}</p>", html::escape(&advice.to_string()));
            }
            let rows: Vec<Vec<String>> = NAMES
                .iter()
                .zip(calibration.numbers.iter().zip(&calibration.deviations))
                .map(|(name, (value, deviation))| {
                    vec![(*name).to_owned(), format!("{value:.6}"), format!("{deviation:.6}")]
                })
                .collect();
            body += &html::table(&["", "value", "standard deviation"], &rows);
        }
        Err(reason) => {
            let _ = writeln!(body, "<p class=\"bad\">No lens: {}</p>", html::escape(&reason.to_string()));
        }
    }
    let [width, height] = [facts.width_px, facts.height_px];
    let _ = write!(
        body,
        "<h2>Where corners were</h2>\n<div class=\"card wide\"><svg viewBox=\"0 0 {width} {height}\" \
         style=\"background:#8882\">\n"
    );
    let radius = f64::from(width.max(height)) / 320.0;
    for (number, board) in found.iter().enumerate() {
        let Ok(board) = board else { continue };
        // Hues far from each other, one after the other.
        let hue = number * 137 % 360;
        let _ = write!(body, "<g fill=\"hsl({hue} 70% 50%)\">");
        for seen in &board.seen {
            let [x, y] = seen.at.map(|at| at + 0.5);
            let _ = write!(body, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>");
        }
        body.push_str("</g>\n");
    }
    body.push_str("</svg></div>\n<h2>Pictures</h2>\n");
    let rows: Vec<Vec<String>> = facts
        .pictures
        .iter()
        .map(|picture| {
            let number = |value: Option<f64>, digits: usize| value.map_or(String::new(), |v| format!("{v:.digits$}"));
            vec![
                picture.file.clone(),
                picture.corners.to_string(),
                picture.corners_left_out.to_string(),
                number(picture.rms_px, 3),
                number(picture.tilt_degrees, 1),
                picture.reason.clone().unwrap_or_default(),
            ]
        })
        .collect();
    body += &html::table(&["picture", "corners", "left out", "rms, px", "tilt, degrees", "why not"], &rows);
    html::page("Calibration of a lens", &body)
}
