//! From the bytes of a frame to gray pixels.

use std::fmt;

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::Fault;
use crate::cut_jpeg::is_cut_jpeg;
use crate::picture::GrayImage;

/// How a frame's bytes are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// 8 bit gray.
    Grey,
    /// Y U Y V.
    Yuyv,
    /// U Y V Y.
    Uyvy,
    /// A plane of Y, then one of U V.
    Nv12,
    /// A plane of Y, then one of U and one of V; "yuv420" for `rpicam-vid`.
    Yu12,
    /// A JPEG picture each.
    Mjpg,
}

impl PixelFormat {
    /// All of them, the ones that are least work first.
    pub const ALL: [Self; 6] = [Self::Grey, Self::Nv12, Self::Yu12, Self::Yuyv, Self::Uyvy, Self::Mjpg];

    /// The name that V4L2 has for it.
    pub const fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Yuyv => *b"YUYV",
            Self::Uyvy => *b"UYVY",
            Self::Nv12 => *b"NV12",
            Self::Yu12 => *b"YU12",
            Self::Mjpg => *b"MJPG",
        }
    }

    /// The format of this V4L2 name; JPEG is the same as MJPG for us.
    pub fn from_fourcc(fourcc: [u8; 4]) -> Option<Self> {
        let fourcc = if &fourcc == b"JPEG" { *b"MJPG" } else { fourcc };
        Self::ALL.into_iter().find(|format| format.fourcc() == fourcc)
    }

    /// Bytes from one gray level to the next, and to the first.
    const fn spacing(self) -> (usize, usize) {
        match self {
            Self::Yuyv => (2, 0),
            Self::Uyvy => (2, 1),
            _ => (1, 0),
        }
    }

    /// Bytes of a row without padding.
    pub const fn row_bytes(self, width: usize) -> usize {
        width * self.spacing().0
    }

    /// Bytes of a frame with rows of `stride` bytes; of a JPEG picture, none are sure.
    pub const fn frame_bytes(self, stride: usize, height: usize) -> usize {
        match self {
            Self::Mjpg => 0,
            Self::Nv12 => stride * height + stride.div_ceil(2) * 2 * height.div_ceil(2),
            Self::Yu12 => stride * height + 2 * stride.div_ceil(2) * height.div_ceil(2),
            _ => stride * height,
        }
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fourcc().into_iter().try_for_each(|letter| write!(out, "{}", char::from(letter)))
    }
}

/// Format and size of the frames of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// How bytes are arranged.
    pub format: PixelFormat,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bytes from one row of gray levels to the next; 0 for JPEG.
    pub stride: usize,
}

impl Layout {
    /// A layout with rows of `stride` bytes, or without padding.
    ///
    /// # Errors
    /// Sizes that cannot be, in a sentence that says what to change.
    pub fn new(format: PixelFormat, width: usize, height: usize, stride: Option<usize>) -> Result<Self, String> {
        if !(64..=16_384).contains(&width.max(height)) || width.min(height) == 0 {
            return Err(format!("{width} x {height} px is no size of a frame: the longer side is 64 to 16384"));
        }
        let least = format.row_bytes(width);
        let stride = if format == PixelFormat::Mjpg { 0 } else { stride.unwrap_or(least) };
        if stride < least && format != PixelFormat::Mjpg {
            return Err(format!("a stride of {stride} bytes is less than the {least} of a row of {width} px {format}"));
        }
        if stride > 16 * 16_384 {
            return Err(format!("a stride of {stride} bytes is more than any row has"));
        }
        Ok(Self { format, width, height, stride })
    }

    /// Bytes of a frame.
    pub const fn frame_bytes(&self) -> usize {
        self.format.frame_bytes(self.stride, self.height)
    }

    /// Writes the gray levels of a frame to `gray`. Bytes after the frame are left alone.
    ///
    /// # Errors
    /// [`Fault::Short`], [`Fault::Corrupt`] or [`Fault::WrongSize`]; `gray` may be half written.
    pub fn to_gray(&self, bytes: &[u8], gray: &mut GrayImage) -> Result<(), Fault> {
        if self.format == PixelFormat::Mjpg {
            return self.decode_jpeg(bytes, gray);
        }
        // The planes of colour are not looked at; that they are there tells that the frame is whole.
        let expected = self.frame_bytes();
        if bytes.len() < expected {
            return Err(Fault::Short { found: bytes.len(), expected });
        }
        let (spacing, first) = self.format.spacing();
        gray.pixels.clear();
        gray.pixels.reserve(self.width * self.height);
        for row in bytes.chunks_exact(self.stride).take(self.height) {
            if spacing == 1 {
                gray.pixels.extend_from_slice(&row[..self.width]);
            } else {
                gray.pixels.extend(row.iter().skip(first).step_by(spacing).take(self.width));
            }
        }
        (gray.width, gray.height) = (self.width, self.height);
        Ok(())
    }

    fn decode_jpeg(&self, bytes: &[u8], gray: &mut GrayImage) -> Result<(), Fault> {
        if !bytes.starts_with(&[0xFF, 0xD8]) {
            return Err(Fault::Corrupt("it does not begin as a JPEG picture".to_owned()));
        }
        if is_cut_jpeg(bytes) {
            return Err(Fault::Corrupt("the end of the JPEG picture is missing".to_owned()));
        }
        let options = DecoderOptions::default()
            .jpeg_set_out_colorspace(ColorSpace::Luma)
            // Cameras leave out tables and pad segments; strictness would refuse all that such a one gives.
            .set_strict_mode(false)
            .set_max_width(16_384)
            .set_max_height(16_384);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
        let corrupt = |error: &dyn fmt::Debug| Fault::Corrupt(format!("{error:?}"));
        decoder.decode_headers().map_err(|error| corrupt(&error))?;
        let found = decoder.dimensions().unwrap_or_default();
        let expected = (self.width, self.height);
        if found != expected {
            return Err(Fault::WrongSize { found, expected });
        }
        let pixels = decoder.decode().map_err(|error| corrupt(&error))?;
        if pixels.len() != self.width * self.height {
            return Err(Fault::Corrupt(format!(
                "{} gray levels instead of {}",
                pixels.len(),
                self.width * self.height
            )));
        }
        *gray = GrayImage { pixels, width: self.width, height: self.height };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 66;
    const HEIGHT: usize = 5;

    fn level(x: usize, y: usize) -> u8 {
        (x * 3 + y * 40) as u8
    }

    fn empty() -> GrayImage {
        GrayImage { pixels: vec![9; 3], width: 3, height: 1 }
    }

    /// A frame of this layout with `level` as its gray, other bytes 0xEE.
    fn bytes_of(layout: &Layout) -> Vec<u8> {
        let mut bytes = vec![0xEE; layout.frame_bytes()];
        let (spacing, first) = layout.format.spacing();
        for y in 0..layout.height {
            for x in 0..layout.width {
                bytes[y * layout.stride + x * spacing + first] = level(x, y);
            }
        }
        bytes
    }

    #[test]
    fn every_raw_format_gives_the_same_gray_with_and_without_padding() {
        let expected: Vec<u8> = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| level(x, y))).collect();
        for format in PixelFormat::ALL.into_iter().filter(|format| *format != PixelFormat::Mjpg) {
            for padding in [0, 62] {
                let stride = format.row_bytes(WIDTH) + padding;
                let layout = Layout::new(format, WIDTH, HEIGHT, Some(stride)).expect("a layout");
                let bytes = bytes_of(&layout);
                let mut gray = empty();
                layout.to_gray(&bytes, &mut gray).expect("gray");
                assert_eq!(gray, GrayImage { pixels: expected.clone(), width: WIDTH, height: HEIGHT }, "{format}");
                let short = layout.to_gray(&bytes[..bytes.len() - 1], &mut gray);
                assert_eq!(short, Err(Fault::Short { found: bytes.len() - 1, expected: bytes.len() }), "{format}");
            }
        }
    }

    #[test]
    fn sizes_are_those_of_the_kernel() {
        // V4L2: NV12 and YU12 take one and a half bytes a pixel, with half strides for YU12's colour.
        let bytes = |format: PixelFormat, stride, height| format.frame_bytes(stride, height);
        assert_eq!(bytes(PixelFormat::Yu12, 640, 480), 460_800);
        assert_eq!(bytes(PixelFormat::Nv12, 640, 480), 460_800);
        assert_eq!(bytes(PixelFormat::Yu12, 704, 480), 506_880);
        assert_eq!(bytes(PixelFormat::Yuyv, 1_280, 480), 614_400);
        assert!(Layout::new(PixelFormat::Yuyv, 640, 480, Some(640)).is_err_and(|why| why.contains("1280")));
        assert!(Layout::new(PixelFormat::Grey, 0, 480, None).is_err());
    }

    fn jpeg(width: u32, height: u32) -> Vec<u8> {
        let picture = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x + y) as u8]));
        let mut bytes = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(&picture).expect("a JPEG");
        bytes
    }

    #[test]
    fn a_jpeg_frame_is_whole_of_the_right_size_or_named() {
        let layout = Layout::new(PixelFormat::Mjpg, 160, 120, None).expect("a layout");
        let mut gray = empty();
        let mut whole = jpeg(160, 120);
        // A driver may give its whole buffer.
        whole.extend([0; 500]);
        layout.to_gray(&whole, &mut gray).expect("gray");
        let error = |x: usize, y: usize| gray.pixels[y * 160 + x].abs_diff((x + y) as u8);
        assert!((0..120).all(|y| (0..130).all(|x| error(x, y) <= 6)));
        let said = |bytes: &[u8]| layout.to_gray(bytes, &mut empty()).expect_err("a fault").to_string();
        assert!(said(&whole[..whole.len() / 2]).contains("end of the JPEG picture is missing"));
        assert!(said(b"no picture").contains("does not begin"));
        assert_eq!(said(&jpeg(80, 64)), "a frame of 80 x 64 px instead of 160 x 120");
        let mut broken = jpeg(160, 120);
        let middle = broken.len() / 3;
        broken[4..middle].fill(0x11);
        assert!(said(&broken).contains("cannot be decoded"));
    }
}
