//! Image files as gray frames: upright, longer side at most a given number of pixels, with the same bytes everywhere.

use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use crate::cut_jpeg::is_cut_jpeg;
use daymark_core::image::{FrameError, GrayView};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};

/// Pixels of a picture, at most: larger ones are refused before they are decoded.
pub const MAX_PIXELS: u64 = 200_000_000;
/// Memory that decoding may take, in bytes.
const MAX_DECODE_BYTES: u64 = 1 << 30;
/// A picture whose longer side is shorter has no place for corners.
pub const MIN_SIDE: u32 = 64;

/// A gray image that owns its pixels, rows packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    /// Row after row, 0 black to 255 white.
    pub pixels: Vec<u8>,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl GrayImage {
    /// The image as core reads it.
    ///
    /// # Errors
    /// [`FrameError`] if a side is 0 or too long.
    pub fn view(&self) -> Result<GrayView<'_>, FrameError> {
        GrayView::new(&self.pixels, self.width, self.height, self.width)
    }

    /// Scales so that the longer side is `side`: down by exact area averages, up between pixel centres.
    #[must_use]
    pub fn scaled_to(self, side: usize) -> Self {
        let longer = self.width.max(self.height);
        if longer == side {
            return self;
        }
        let scaled = |length: usize| ((length * side * 2 + longer) / (2 * longer)).max(1);
        let (width, height) = (scaled(self.width), scaled(self.height));
        if longer > side { area_average(&self, width, height) } else { interpolated(&self, width, height) }
    }
}

/// Colours of a picture scaled as [`GrayImage::scaled_to`] scales: three channels, one after the other.
#[must_use]
pub fn scaled_colours(rgb: &[u8], width: usize, height: usize, side: usize) -> Vec<u8> {
    if width.max(height) == side || rgb.is_empty() {
        return rgb.to_vec();
    }
    let channels = [0, 1, 2].map(|channel| {
        let pixels = rgb.iter().skip(channel).step_by(3).copied().collect();
        GrayImage { pixels, width, height }.scaled_to(side).pixels
    });
    let [red, green, blue] = &channels;
    red.iter().zip(green).zip(blue).flat_map(|((&r, &g), &b)| [r, g, b]).collect()
}

/// Bilinear enlargement; pixel areas align, the border repeats outwards. Positions in Q16, weights in Q8.
fn interpolated(image: &GrayImage, width: usize, height: usize) -> GrayImage {
    let place = |at: usize, from: usize, to: usize| {
        let q16 = ((((2 * at + 1) * from) << 16) / (2 * to)).saturating_sub(1 << 15);
        let first = (q16 >> 16).min(from - 1);
        (first, (first + 1).min(from - 1), (q16 >> 8 & 255) as u32)
    };
    let columns: Vec<_> = (0..width).map(|x| place(x, image.width, width)).collect();
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        let (upper, lower, fy) = place(y, image.height, height);
        let row = |y: usize| &image.pixels[y * image.width..(y + 1) * image.width];
        let (upper, lower) = (row(upper), row(lower));
        pixels.extend(columns.iter().map(|&(left, right, fx)| {
            let along = |row: &[u8]| u32::from(row[left]) * (256 - fx) + u32::from(row[right]) * fx;
            ((along(upper) * (256 - fy) + along(lower) * fy + 32_768) >> 16) as u8
        }));
    }
    GrayImage { pixels, width, height }
}

/// The weights of a box average along one axis: for each output the first input and the weights from there, of which
/// each sums up to the input's length. Lengths are integers, so that the average is exact.
fn box_weights(input: usize, output: usize) -> Vec<(usize, Vec<u32>)> {
    // In units of 1 / output px an input pixel is `output` long and an output pixel `input`.
    (0..output)
        .map(|i| {
            let (start, end) = (i * input, (i + 1) * input);
            let first = start / output;
            let last = end.div_ceil(output);
            let weight = |p: usize| ((p + 1) * output).min(end) - (p * output).max(start);
            (first, (first..last).map(|p| weight(p) as u32).collect())
        })
        .collect()
}

fn area_average(image: &GrayImage, width: usize, height: usize) -> GrayImage {
    let columns = box_weights(image.width, width);
    let rows = box_weights(image.height, height);
    let total = (image.width * image.height) as u64;
    let mut pixels = Vec::with_capacity(width * height);
    let mut sums = vec![0_u64; image.width];
    for (first, weights) in rows {
        sums.fill(0);
        for (row, weight) in image.pixels.chunks_exact(image.width).skip(first).zip(weights) {
            for (sum, &pixel) in sums.iter_mut().zip(row) {
                *sum += u64::from(pixel) * u64::from(weight);
            }
        }
        pixels.extend(columns.iter().map(|(first, weights)| {
            let sum: u64 = sums[*first..].iter().zip(weights).map(|(&sum, &weight)| sum * u64::from(weight)).sum();
            ((sum + total / 2) / total) as u8
        }));
    }
    GrayImage { pixels, width, height }
}

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

/// A file, or one in memory: the decoders are the same.
trait PictureFile: BufRead + Seek {}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_average_is_exact() {
        let image = GrayImage { pixels: vec![0, 90, 30, 30, 60, 255], width: 3, height: 2 };
        // One output column covers 1.5 inputs: (0 + 45) / 1.5 = 30 in the upper row.
        assert_eq!(area_average(&image, 2, 2).pixels, [30, 50, 40, 190]);
        assert_eq!(area_average(&image, 1, 1).pixels, [78]);
        assert_eq!(image.clone().scaled_to(3), image);
    }

    #[test]
    fn enlargement_interpolates_between_pixel_centres() {
        let image = GrayImage { pixels: vec![0, 100], width: 2, height: 1 };
        let enlarged = image.scaled_to(4);
        assert_eq!((enlarged.width, enlarged.height), (4, 2));
        assert_eq!(enlarged.pixels, [0, 25, 75, 100, 0, 25, 75, 100]);
    }
}
