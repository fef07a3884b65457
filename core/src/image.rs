//! A gray image in somebody else's memory.

use core::fmt;

/// The largest width or height of a frame, in pixels.
///
/// Candidate corners pack their column and row into 12 bits each.
pub const MAX_SIDE: usize = 4_096;

/// 8-bit gray pixels with a stride, borrowed from the caller.
///
/// Rows outside the image read as empty, so no reader can reach beyond the pixels.
#[derive(Debug, Clone, Copy)]
pub struct GrayView<'a> {
    pixels: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> GrayView<'a> {
    /// A view of `height` rows of `width` pixels, row `y` starting at byte `y * stride`.
    ///
    /// # Errors
    /// Blames the caller: see [`FrameError`].
    pub const fn new(pixels: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, FrameError> {
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            return Err(FrameError::Size { width, height });
        }
        if stride < width {
            return Err(FrameError::Stride { stride, width });
        }
        let needed = stride.saturating_mul(height - 1).saturating_add(width);
        if pixels.len() < needed {
            return Err(FrameError::TooFewBytes { needed, found: pixels.len() });
        }
        Ok(Self { pixels, width, height, stride })
    }

    /// Pixels in a row.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Row `y`, or an empty slice below the last row.
    #[inline]
    pub fn row(&self, y: usize) -> &'a [u8] {
        if y >= self.height {
            return &[];
        }
        let start = y.saturating_mul(self.stride);
        self.pixels.get(start..start.saturating_add(self.width)).unwrap_or(&[])
    }
}

/// What is wrong with a frame that the caller described. Nothing was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// A side is zero or beyond [`MAX_SIDE`]. Scale the frame down first.
    Size {
        /// Width that was found, in pixels.
        width: usize,
        /// Height that was found, in pixels.
        height: usize,
    },
    /// Rows overlap. Give the bytes from one row to the next.
    Stride {
        /// Stride that was found, in bytes.
        stride: usize,
        /// The least that is possible, in bytes.
        width: usize,
    },
    /// The buffer ends before the last row does.
    TooFewBytes {
        /// Bytes that the described frame has.
        needed: usize,
        /// Bytes in the buffer.
        found: usize,
    },
    /// The extractor's scratch memory is too small for this frame; see [`crate::pyramid::level_bytes`].
    ScratchTooSmall {
        /// Bytes that this frame needs.
        needed: usize,
        /// Bytes that were given.
        found: usize,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => {
                write!(f, "a frame of {width} x {height} px cannot be read: each side must be 1..={MAX_SIDE} px")
            }
            Self::Stride { stride, width } => {
                write!(f, "a stride of {stride} bytes is shorter than a row of {width} px")
            }
            Self::TooFewBytes { needed, found } => write!(f, "the frame needs {needed} bytes, the buffer has {found}"),
            Self::ScratchTooSmall { needed, found } => {
                write!(f, "the frame needs {needed} bytes of scratch memory, {found} were given")
            }
        }
    }
}

impl core::error::Error for FrameError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_the_stride_and_end_with_the_image() {
        let pixels = [1, 2, 0, 3, 4];
        let view = GrayView::new(&pixels, 2, 2, 3).unwrap();
        assert_eq!((view.row(0), view.row(1), view.row(2)), (&[1, 2][..], &[3, 4][..], &[][..]));
    }

    #[test]
    fn bad_frames_are_refused_with_their_numbers() {
        assert_eq!(GrayView::new(&[], 0, 1, 1).unwrap_err(), FrameError::Size { width: 0, height: 1 });
        assert_eq!(GrayView::new(&[0; 9], 3, 3, 2).unwrap_err(), FrameError::Stride { stride: 2, width: 3 });
        assert_eq!(GrayView::new(&[0; 8], 3, 3, 3).unwrap_err(), FrameError::TooFewBytes { needed: 9, found: 8 });
        assert!(GrayView::new(&[], 30_000, 30_000, 30_000).is_err());
    }
}
