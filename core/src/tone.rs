//! The tone curve: every frame and every enrolled picture passes through it first.
//!
//! Close to `16 sqrt(gray)`, so that a corner in the dark counts as much as one in the light: the noise of photons grows
//! with the root of the intensity, and under the curve it is about the same everywhere.

use crate::image::{FrameError, GrayView};
use crate::kernel::Kernels;

/// A frame under the tone curve.
#[derive(Debug, Clone, Copy)]
pub struct TonedFrame<'a> {
    view: GrayView<'a>,
}

impl<'a> TonedFrame<'a> {
    /// Writes the toned frame to `out`, rows packed.
    ///
    /// # Errors
    /// [`FrameError::ScratchTooSmall`] if `out` has fewer bytes than the frame pixels.
    pub fn write<K: Kernels + ?Sized>(kernels: &K, frame: GrayView<'_>, out: &'a mut [u8]) -> Result<Self, FrameError> {
        let (width, height) = (frame.width(), frame.height());
        let (needed, found) = (width * height, out.len());
        let out = out.get_mut(..needed).ok_or(FrameError::ScratchTooSmall { needed, found })?;
        for (y, out) in out.chunks_exact_mut(width.max(1)).enumerate() {
            kernels.tone_row(frame.row(y), out);
        }
        Ok(Self { view: GrayView::new(out, width, height, width)? })
    }

    /// Tones a frame where it lies, for a device without memory for a second one.
    ///
    /// # Errors
    /// What [`GrayView::new`] says of the description; the pixels are untouched then.
    pub fn in_place(pixels: &'a mut [u8], width: usize, height: usize, stride: usize) -> Result<Self, FrameError> {
        GrayView::new(pixels, width, height, stride)?;
        for row in pixels.chunks_mut(stride.max(1)).take(height) {
            for pixel in row.iter_mut().take(width) {
                *pixel = crate::kernel::tone(*pixel);
            }
        }
        Ok(Self { view: GrayView::new(pixels, width, height, stride)? })
    }

    /// The toned pixels.
    pub const fn view(&self) -> GrayView<'a> {
        self.view
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Portable, tone};

    #[test]
    fn the_curve_rises_and_stays_close_to_the_root() {
        assert!((1..=255).all(|gray| tone(gray) >= tone(gray - 1)));
        for gray in 1..=255_u8 {
            let root = 16.0 * libm::sqrt(f64::from(gray));
            let found = f64::from(tone(gray));
            assert!((found - root).abs() <= 0.07 * root + 1.0, "{gray}: {found} against {root}");
        }
    }

    #[test]
    fn in_place_and_copied_are_the_same() {
        let mut pixels = [0, 3, 200, 9, 255, 77, 40];
        let copy = pixels;
        let mut out = [0; 4];
        let frame = GrayView::new(&copy, 2, 2, 4).unwrap();
        let written = TonedFrame::write(&Portable, frame, &mut out).unwrap();
        let toned = TonedFrame::in_place(&mut pixels, 2, 2, 4).unwrap();
        for y in 0..2 {
            assert_eq!(toned.view().row(y), written.view().row(y));
        }
        assert_eq!(toned.view().row(1), [tone(255), tone(77)]);
    }

    #[test]
    fn too_little_memory_is_told() {
        let frame = GrayView::new(&[0; 6], 3, 2, 3).unwrap();
        let error = TonedFrame::write(&Portable, frame, &mut [0; 5]).unwrap_err();
        assert_eq!(error, FrameError::ScratchTooSmall { needed: 6, found: 5 });
    }
}
