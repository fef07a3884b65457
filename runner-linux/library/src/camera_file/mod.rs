//! Cameras: lenses, distortion, places; and the files that hold them.
//!
//! | file | holds | pixels there |
//! |---|---|---|
//! | COLMAP `cameras` and `images`, `.txt` or `.bin` | lens, distortion, place | the first pixel's centre is (0.5, 0.5) |
//! | `.camera` of the Strecha sets | lens, place | (0, 0), as here |
//! | OpenCV `FileStorage` YAML, ROS `camera_info` YAML | lens, distortion | (0, 0) |
//! | plain text with the 12 numbers of a 3 x 4 matrix | lens, place | (0, 0) |

pub mod distortion;
pub mod lens;
pub mod colmap;
pub mod matrix;
pub mod strecha;
pub mod yaml;

use std::fmt;
use std::path::{Path, PathBuf};

use distortion::Distortion;
use lens::{Lens, Pose};

/// What a file says about the camera of one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct FileCamera {
    /// Name of the picture, where the file has one.
    pub picture: Option<String>,
    /// Pixels in a row and rows, where the file says.
    pub size: Option<[u32; 2]>,
    /// Focal length in widths and heights of a pixel.
    pub focal: [f64; 2],
    /// Principal point, pixels.
    pub centre: [f64; 2],
    /// Skew, pixels.
    pub skew: f64,
    /// Distortion.
    pub distortion: Distortion,
    /// Relative error of the focal length (one standard deviation), where the file says.
    pub focal_error: Option<f64>,
    /// The place, where the file says.
    pub pose: Option<Pose>,
}

/// A camera whose file is for another picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OtherSize {
    /// Size that the file says.
    pub said: [u32; 2],
    /// Size of the picture.
    pub found: [u32; 2],
}

impl FileCamera {
    /// The lens for a picture of this size.
    ///
    /// # Errors
    /// [`OtherSize`] if the file says another size that is not the same picture scaled: sides in another ratio (1 %), or
    /// turned.
    pub fn lens(&self, width: u32, height: u32) -> Result<Lens, OtherSize> {
        let [said_width, said_height] = self.size.unwrap_or([width, height]);
        let ratio = f64::from(said_width) * f64::from(height) / (f64::from(said_height) * f64::from(width));
        if !((ratio - 1.0).abs() < 0.01) {
            return Err(OtherSize { said: [said_width, said_height], found: [width, height] });
        }
        let lens = Lens {
            width: said_width,
            height: said_height,
            focal: self.focal,
            centre: self.centre,
            skew: self.skew,
            distortion: self.distortion.simplified(),
        };
        Ok(if [said_width, said_height] == [width, height] { lens } else { lens.scaled_to(width, height) })
    }
}

/// A camera file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraFileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, and what to do.
    pub what: String,
}

impl CameraFileError {
    pub(crate) fn new(path: &Path, what: impl Into<String>) -> Self {
        Self { path: path.to_owned(), what: what.into() }
    }
}

impl fmt::Display for CameraFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot use the cameras of {}: {}", self.path.display(), self.what)
    }
}

impl std::error::Error for CameraFileError {}

/// The largest camera file that is read.
const MAX_BYTES: u64 = 1 << 30;

pub(crate) fn read(path: &Path) -> Result<Vec<u8>, CameraFileError> {
    let fail = |error: std::io::Error| CameraFileError::new(path, error.to_string());
    let length = std::fs::metadata(path).map_err(fail)?.len();
    if length > MAX_BYTES {
        return Err(CameraFileError::new(path, format!("it has {length} bytes, more than {MAX_BYTES}")));
    }
    std::fs::read(path).map_err(fail)
}

/// The cameras of a file or of a COLMAP folder. What kind it is shows its name, or its content.
///
/// # Errors
/// [`CameraFileError`].
pub fn cameras(path: &Path) -> Result<Vec<FileCamera>, CameraFileError> {
    if path.is_dir() {
        return colmap::folder(path);
    }
    let bytes = read(path)?;
    let text = String::from_utf8(bytes).map_err(|_| {
        CameraFileError::new(path, "it is not text; for a COLMAP model give the folder with cameras.bin")
    })?;
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let result = match ending.as_str() {
        "camera" => strecha::parse(&text),
        "yaml" | "yml" => yaml::parse(&text),
        _ if text.trim_start().starts_with("%YAML") || text.contains("camera_matrix") => yaml::parse(&text),
        _ => matrix::parse(&text),
    };
    result.map(|camera| vec![camera]).map_err(|what| CameraFileError::new(path, what))
}

/// All numbers of a text, between blanks and commas.
pub(crate) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split(|c: char| c.is_whitespace() || c == ',' || c == ';')
        .filter(|word| !word.is_empty())
        .map(|word| match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("\"{}\" is not a number", word.chars().take(40).collect::<String>())),
        })
        .collect()
}
