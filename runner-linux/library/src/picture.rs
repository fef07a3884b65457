//! Image files as gray frames: upright, longer side at most a given number of pixels, with the same bytes everywhere.

use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};

pub use daymark_engine::gray::{GrayImage, scaled_colours};

use crate::cut_jpeg::is_cut_jpeg;

/// Pixels of a picture, at most: larger ones are refused before they are decoded.
pub const MAX_PIXELS: u64 = 200_000_000;
/// Memory that decoding may take, in bytes.
const MAX_DECODE_BYTES: u64 = 1 << 30;
/// A picture whose longer side is shorter has no place for corners.
pub const MIN_SIDE: u32 = 64;

/// Reads a picture: turned upright by its EXIF orientation, gray by the Rec. 601 luma, transparent parts over black.
///
/// # Errors
/// [`PictureError`], which names the file and what to do.
pub fn read_gray(path: &Path) -> Result<GrayImage, PictureError> {
    read(path, false).map(|picture| picture.0)
}

/// The same with its colours: red, green and blue of each pixel, rows packed.
///
/// # Errors
/// [`PictureError`].
pub fn read_colour(path: &Path) -> Result<(GrayImage, Vec<u8>), PictureError> {
    read(path, true)
}

fn read(path: &Path, colour: bool) -> Result<(GrayImage, Vec<u8>), PictureError> {
    let fail = |reason| PictureError { path: path.to_owned(), reason };
    let io = |error: std::io::Error| fail(Reason::Io(error.to_string()));
    let metadata = std::fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return Err(fail(Reason::Folder));
    }
    let mut file = BufReader::new(File::open(path).map_err(io)?);
    if !file.fill_buf().map_err(io)?.starts_with(&[0xFF, 0xD8]) {
        return decode(&mut file, colour).map_err(fail);
    }
    // A JPEG is looked through for its end first; other files are decoded as they are read.
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(io)?;
    if is_cut_jpeg(&bytes) {
        return Err(fail(Reason::Damaged("its end is missing".to_owned())));
    }
    decode(&mut Cursor::new(bytes), colour).map_err(fail)
}

/// A file, or one in memory: the decoders are compiled once for both.
pub(crate) trait PictureFile: BufRead + Seek {}

impl<T: BufRead + Seek> PictureFile for T {}

fn decode(file: &mut dyn PictureFile, colour: bool) -> Result<(GrayImage, Vec<u8>), Reason> {
    if file.fill_buf().map_err(|error| Reason::Io(error.to_string()))?.is_empty() {
        return Err(Reason::Empty);
    }
    let reader = ImageReader::new(file).with_guessed_format().map_err(|error| Reason::Io(error.to_string()))?;
    if reader.format().is_none() {
        return Err(Reason::NotAnImage);
    }
    let mut decoder = reader.into_decoder().map_err(Reason::of_decoder)?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_DECODE_BYTES);
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Reason::TooLarge { width, height });
    }
    if width.max(height) < MIN_SIDE {
        return Err(Reason::TooSmall { width, height });
    }
    decoder.set_limits(limits).map_err(Reason::of_decoder)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut image = DynamicImage::from_decoder(decoder).map_err(Reason::of_decoder)?;
    let rgb = if colour {
        let mut upright = DynamicImage::ImageRgb8(image.to_rgb8());
        upright.apply_orientation(orientation);
        upright.into_rgb8().into_raw()
    } else {
        Vec::new()
    };
    let mut gray = DynamicImage::ImageLuma8(luma(&mut image));
    drop(image);
    gray.apply_orientation(orientation);
    let gray = gray.into_luma8();
    let (width, height) = (gray.width() as usize, gray.height() as usize);
    Ok((GrayImage { pixels: gray.into_raw(), width, height }, rgb))
}

/// Rec. 601 luma in integers, as JPEG files and most cameras define gray; alpha multiplies.
fn luma(image: &mut DynamicImage) -> image::GrayImage {
    let weigh = |[r, g, b]: [u8; 3]| {
        ((u32::from(r) * 19_595 + u32::from(g) * 38_470 + u32::from(b) * 7_471 + 32_768) >> 16) as u8
    };
    let (width, height) = (image.width(), image.height());
    let pixels = match image {
        DynamicImage::ImageLuma8(gray) => return std::mem::take(gray),
        DynamicImage::ImageRgb8(rgb) => rgb.as_raw().as_chunks::<3>().0.iter().map(|&rgb| weigh(rgb)).collect(),
        other => {
            let rgba = other.to_rgba8();
            let over_black = |&[r, g, b, a]: &[u8; 4]| {
                let by_alpha = |c: u8| ((u32::from(c) * u32::from(a) + 127) / 255) as u8;
                weigh([by_alpha(r), by_alpha(g), by_alpha(b)])
            };
            rgba.as_raw().as_chunks::<4>().0.iter().map(over_black).collect()
        }
    };
    image::GrayImage::from_raw(width, height, pixels).unwrap_or_default()
}

/// A picture that cannot be used. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PictureError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub reason: Reason,
}

/// Why a picture cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// The system refused to read it.
    Io(String),
    /// It is a folder.
    Folder,
    /// It has no bytes.
    Empty,
    /// Its first bytes are those of no image format that is read here.
    NotAnImage,
    /// It is damaged, cut off, or of a kind within its format that is not read here.
    Damaged(String),
    /// It has too many pixels.
    TooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// It has too few pixels.
    TooSmall {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
}

impl Reason {
    fn of_decoder(error: ImageError) -> Self {
        match error {
            ImageError::IoError(error) => Self::Damaged(format!("it ends too early ({error})")),
            error => Self::Damaged(error.to_string()),
        }
    }
}

impl fmt::Display for PictureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match &self.reason {
            Reason::Io(error) => write!(f, "cannot read the picture {path}: {error}"),
            Reason::Folder => write!(f, "{path} is a folder, not a picture; name the pictures in it"),
            Reason::Empty => write!(f, "the picture {path} has zero bytes; copy or take it again"),
            Reason::NotAnImage => {
                write!(f, "{path} is not a picture that can be read here; use JPEG, PNG, WebP, TIFF, BMP or PNM")
            }
            Reason::Damaged(error) => {
                write!(f, "the picture {path} is damaged or of an unusual kind: {error}; save it again as JPEG or PNG")
            }
            Reason::TooLarge { width, height } => write!(
                f,
                "the picture {path} has {width} x {height} pixels, more than {MAX_PIXELS} in all; scale it down"
            ),
            Reason::TooSmall { width, height } => write!(
                f,
                "the picture {path} has only {width} x {height} pixels; its longer side must have at least {MIN_SIDE}"
            ),
        }
    }
}

impl std::error::Error for PictureError {}
