//! Where a frame's lens comes from: a calibration, what somebody says, EXIF, or an assumption; and how well its focal
//! length is known by each.
//!
//! A position is never better than the lens: an error of the focal length is the same error, relatively, of the
//! distance. So every source states its error, and a lens without a source is never used as if it were known.

mod exif_focal;

pub use exif_focal::{CUT_ERROR, EXIF_ERROR, ExifFocal};

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::camera_file::lens::Lens;
use crate::camera_file::{CameraFileError, FileCamera, OtherSize, cameras};

/// Focal length of the lens that is assumed, as a share of the longer side: 65 degrees across it.
///
/// Main cameras of phones and of small boards lie between 54 and 77 degrees, which is one [`ASSUMED_ERROR`]; 46 to 87
/// degrees are two.
pub const ASSUMED_FOCAL: f64 = 0.784_8;
/// Relative error of the assumed focal length, one standard deviation.
pub const ASSUMED_ERROR: f64 = 0.25;
/// Relative error of a calibrated focal length, if its file does not tell: focus moves it by about as much.
pub const CALIBRATED_ERROR: f64 = 0.002;
/// A file is not believed to be better than this: the calibration's own spread knows nothing of focus and temperature.
const BEST_ERROR: f64 = 0.001;
/// Relative error of a focal length that somebody gives.
pub const GIVEN_ERROR: f64 = 0.01;
/// Relative error by an angle of view: data sheets round it, and measure it before distortion or after.
pub const ANGLE_ERROR: f64 = 0.03;

/// What is said about the lens.
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
pub struct LensArgs {
    /// The camera's calibration, for a position as good as it gets: OpenCV or ROS YAML, as `daymark calibrate` writes it. It
    /// may be for another size of the same picture
    #[arg(long, value_name = "CAMERA.yaml", group = "lens_source")]
    pub lens: Option<PathBuf>,
    /// Focal length in pixels of the frames as they come, if there is no calibration
    #[arg(long, value_name = "PIXELS", group = "lens_source", value_parser = positive)]
    pub focal_px: Option<f64>,
    /// Angle of view across the width of the frames, as data sheets tell it. Without any of these EXIF is asked, and then 65
    /// degrees across the longer side are assumed, give or take a quarter of the focal length
    #[arg(long, value_name = "DEGREES", group = "lens_source", value_parser = angle)]
    pub fov_degrees: Option<f64>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("give a focal length in pixels, such as 560".to_owned()),
    }
}

fn angle(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=170.0).contains(&value) => Ok(value),
        _ => Err("give an angle between 1 and 170 degrees".to_owned()),
    }
}

impl LensArgs {
    /// Reads the file, if one is named.
    ///
    /// # Errors
    /// [`LensError::File`] if it is none of one lens.
    pub fn read(&self) -> Result<LensChoice, LensError> {
        if let Some(path) = &self.lens {
            let found = cameras(path)?;
            let [camera] = found.as_slice() else {
                let what = format!("it has {} cameras, and one lens is wanted", found.len());
                return Err(CameraFileError { path: path.clone(), what }.into());
            };
            return Ok(LensChoice(Choice::File(path.clone(), Box::new(camera.clone()))));
        }
        Ok(LensChoice(match (self.focal_px, self.fov_degrees) {
            (Some(focal), _) => Choice::Focal(focal),
            (_, Some(degrees)) => Choice::Angle(degrees),
            _ => Choice::Picture,
        }))
    }
}

/// What is said about the lens, its file read: ask it for the lens of every frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LensChoice(Choice);

#[derive(Debug, Clone, PartialEq)]
enum Choice {
    File(PathBuf, Box<FileCamera>),
    Focal(f64),
    Angle(f64),
    /// By what the picture says, or nothing.
    Picture,
}

impl LensChoice {
    /// Nothing is said: EXIF, or an assumption.
    pub const fn by_picture() -> Self {
        Self(Choice::Picture)
    }

    /// Whether a picture's EXIF data matter.
    pub const fn asks_picture(&self) -> bool {
        matches!(self.0, Choice::Picture)
    }

    /// The lens of a frame of this size, before it is scaled; [`Lens::scaled_to`] takes it to another size.
    ///
    /// # Errors
    /// [`LensError`] if what was said does not fit such a frame.
    pub fn lens(&self, width: u32, height: u32, exif: Option<&ExifFocal>) -> Result<KnownLens, LensError> {
        let longer = f64::from(width.max(height));
        let of_focal = |focal, relative_error, source| KnownLens {
            lens: Lens::of_focal(width, height, focal),
            relative_error,
            source,
        };
        match &self.0 {
            Choice::File(path, camera) => {
                let lens = camera.lens(width, height).map_err(|other| LensError::Size(path.clone(), other))?;
                let relative_error = camera.focal_error.map_or(CALIBRATED_ERROR, |error| error.max(BEST_ERROR));
                Ok(KnownLens { lens, relative_error, source: LensSource::Calibration })
            }
            Choice::Focal(focal) if !(*focal > 0.1 * longer && *focal < 100.0 * longer) => {
                Err(LensError::Focal { focal_px: *focal, width, height })
            }
            Choice::Focal(focal) => Ok(of_focal(*focal, GIVEN_ERROR, LensSource::GivenFocalLength)),
            Choice::Angle(degrees) => {
                let focal = f64::from(width) / 2.0 / libm::tan(degrees.to_radians() / 2.0);
                Ok(of_focal(focal, ANGLE_ERROR, LensSource::GivenAngleOfView))
            }
            Choice::Picture => Ok(match exif.and_then(|exif| exif.in_pixels(width, height)) {
                Some((focal, error)) => of_focal(focal, error, LensSource::Exif),
                None => of_focal(ASSUMED_FOCAL * longer, ASSUMED_ERROR, LensSource::Assumed),
            }),
        }
    }
}

/// A lens, and how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownLens {
    /// The lens for the frame as it came, distortion included.
    pub lens: Lens,
    /// Relative error of its focal length, one standard deviation.
    pub relative_error: f64,
    /// Where it comes from.
    pub source: LensSource,
}

impl KnownLens {
    /// The same for the frame scaled to another size.
    #[must_use]
    pub fn scaled_to(&self, width: u32, height: u32) -> Self {
        Self { lens: self.lens.scaled_to(width, height), ..*self }
    }
}

/// Where a lens comes from. Serializes as its name: `calibration`, `given_focal_length` and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LensSource {
    /// A calibration's file.
    Calibration,
    /// Somebody gave a focal length.
    GivenFocalLength,
    /// Somebody gave an angle of view.
    GivenAngleOfView,
    /// The picture's EXIF data.
    Exif,
    /// Nobody said anything.
    Assumed,
}

impl LensSource {
    /// The name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::GivenFocalLength => "given_focal_length",
            Self::GivenAngleOfView => "given_angle_of_view",
            Self::Exif => "exif",
            Self::Assumed => "assumed",
        }
    }
}

impl fmt::Display for LensSource {
    /// As it ends the sentence "the lens is known ...".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Calibration => "by its calibration",
            Self::GivenFocalLength => "by the focal length given",
            Self::GivenAngleOfView => "by the angle of view given",
            Self::Exif => "by the picture's EXIF data",
            Self::Assumed => "by nothing but an assumption: 46 to 87 degrees across the longer side",
        })
    }
}

/// Why there is no lens.
#[derive(Debug, Clone, PartialEq)]
pub enum LensError {
    /// The file cannot be used.
    File(CameraFileError),
    /// The file is for another picture.
    Size(PathBuf, OtherSize),
    /// No frame of this size has such a lens.
    Focal {
        /// What was given.
        focal_px: f64,
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

impl From<CameraFileError> for LensError {
    fn from(error: CameraFileError) -> Self {
        Self::File(error)
    }
}

impl fmt::Display for LensError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(error) => error.fmt(f),
            Self::Size(path, OtherSize { said: [a, b], found: [c, d] }) => write!(
                f,
                "the lens {} is for frames of {a} x {b} pixels, and this one has {c} x {d}, which is not the same picture \
                 scaled: calibrate with frames of this shape",
                path.display()
            ),
            Self::Focal { focal_px, width, height } => write!(
                f,
                "a focal length of {focal_px} pixels does not fit frames of {width} x {height} pixels: most lenses have 0.5 \
                 to 2 times the longer side"
            ),
        }
    }
}

impl std::error::Error for LensError {}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Cli {
        #[command(flatten)]
        lens: LensArgs,
    }

    fn choice(line: &[&str]) -> Result<LensChoice, LensError> {
        Cli::try_parse_from([&["x"], line].concat()).expect("arguments").lens.read()
    }

    #[test]
    fn without_any_word_a_lens_is_assumed_and_says_so() {
        let choice = choice(&[]).expect("nothing to read");
        let known = choice.lens(640, 480, None).expect("a lens");
        let half_angle = libm::atan(320.0 / known.lens.focal[0]).to_degrees();
        assert!((2.0 * half_angle - 65.0).abs() < 0.01, "{half_angle}");
        assert_eq!((known.relative_error, known.source), (ASSUMED_ERROR, LensSource::Assumed));
        // Held upright it is the same camera.
        assert_eq!(choice.lens(480, 640, None).expect("a lens").lens.focal, known.lens.focal);
        let two = |factor: f64| 2.0 * libm::atan(320.0 / (known.lens.focal[0] * factor)).to_degrees();
        assert!(
            (two(1.5) - 46.0).abs() < 0.5 && (two(1.0 / 1.5) - 87.0).abs() < 0.5,
            "{} {}",
            two(1.5),
            two(1.0 / 1.5)
        );
    }

    #[test]
    fn what_is_said_goes_before_exif() {
        let exif = ExifFocal::film(36.0);
        let by_exif = choice(&[]).and_then(|choice| choice.lens(3_000, 2_000, Some(&exif))).expect("a lens");
        assert_eq!(by_exif.source, LensSource::Exif);
        let given = choice(&["--focal-px", "2500"]).and_then(|choice| choice.lens(3_000, 2_000, Some(&exif)));
        let given = given.expect("a lens");
        assert_eq!((given.lens.focal, given.relative_error), ([2_500.0; 2], GIVEN_ERROR));
        let half = given.scaled_to(1_500, 1_000);
        assert_eq!((half.lens.focal, half.relative_error), ([1_250.0; 2], GIVEN_ERROR));
        let angle =
            choice(&["--fov-degrees", "90"]).and_then(|choice| choice.lens(640, 480, Some(&exif))).expect("a lens");
        assert!((angle.lens.focal[0] - 320.0).abs() < 1e-9 && angle.source == LensSource::GivenAngleOfView);
    }

    #[test]
    fn a_calibration_knows_its_error_and_its_picture() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("camera.yaml");
        let text = "image_width: 640\nimage_height: 480\ncamera_matrix:\n  data: [560, 0, 320, 0, 561, 240, 0, 0, 1]\n";
        let lens = |text: &str, width, height| {
            std::fs::write(&path, text).expect("written");
            choice(&["--lens", &path.to_string_lossy()]).and_then(|choice| choice.lens(width, height, None))
        };
        let known = lens(text, 640, 480).expect("a lens");
        assert_eq!((known.relative_error, known.lens.focal), (CALIBRATED_ERROR, [560.0, 561.0]));
        let known = lens(&format!("{text}focal_length_relative_error: 0.004\n"), 320, 240).expect("a lens");
        assert_eq!((known.relative_error, known.lens.focal), (0.004, [280.0, 280.5]));
        let error = lens(text, 1280, 720).expect_err("another shape").to_string();
        assert!(error.contains("640 x 480") && error.contains("1280 x 720"), "{error}");
        assert!(matches!(lens("nothing", 640, 480), Err(LensError::File(_))));
    }

    #[test]
    fn what_no_lens_is_like_is_refused() {
        for wrong in [["--focal-px", "-3"], ["--focal-px", "NaN"], ["--fov-degrees", "180"], ["--fov-degrees", "0"]] {
            assert!(Cli::try_parse_from([&["x"], &wrong[..]].concat()).is_err(), "{wrong:?}");
        }
        assert!(Cli::try_parse_from(["x", "--focal-px", "500", "--fov-degrees", "60"]).is_err(), "one source only");
        let error =
            choice(&["--focal-px", "3.6"]).and_then(|choice| choice.lens(640, 480, None)).expect_err("millimetres");
        assert!(error.to_string().contains("3.6 pixels does not fit frames of 640 x 480"), "{error}");
    }
}
