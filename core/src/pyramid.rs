//! The image pyramid: five levels at scales 1, 7/5, 2, 14/5 and 4, each pixel an exact area average.
//!
//! Level 1 is the base shrunk 7:5 by a box, level 2 the base by 2 x 2, level 3 is level 1 by 2 x 2 and level 4 is
//! level 2 by 2 x 2. The scales are rational, so a position on any level maps to the base in integers; and one buffer
//! of the size of level 1 ([`level_bytes`]) serves all levels, because 1 → 3 and 2 → 4 shrink in place.

use crate::image::{FrameError, GrayView};
use crate::kernel::Kernels;
use crate::point::{ImagePoint, SUBPIXEL};

/// Levels of the pyramid.
pub const LEVELS: usize = 5;

/// Scale of each level in fifths: one pixel of level `l` is `SCALE_FIFTHS[l] / 5` px of the base wide.
pub const SCALE_FIFTHS: [i32; LEVELS] = [5, 7, 10, 14, 20];

/// Scale of a level as a real number; the last level's beyond it.
pub fn scale(level: u8) -> f32 {
    let fifths = SCALE_FIFTHS.get(usize::from(level)).copied().unwrap_or(20);
    fifths as f32 / 5.0
}

/// Bytes of scratch memory for the levels of a `width` x `height` frame: those of level 1 or level 2.
pub const fn level_bytes(width: usize, height: usize) -> usize {
    // No product of sides that a frame may have overflows; of larger ones no such memory exists.
    let one = (width.saturating_mul(5) / 7).saturating_mul(height.saturating_mul(5) / 7);
    let two = (width / 2).saturating_mul(height / 2);
    if one > two { one } else { two }
}

/// A position on a level, in 1/16 px of that level, as a point of the base frame.
///
/// `base = (p + 1/2) s - 1/2` (pixel areas align, not pixel centres), rounded to 1/16 px.
pub fn base_from_level(level: u8, x: i32, y: i32) -> ImagePoint {
    let fifths = SCALE_FIFTHS.get(usize::from(level)).copied().unwrap_or(20);
    let half = SUBPIXEL / 2;
    let map = |p: i32| (2 * (p + half) * fifths + 5).div_euclid(10) - half;
    ImagePoint::new(map(x), map(y))
}

/// Calls `visit` with every level of the frame, in the order 0, 1, 3, 2, 4.
///
/// Cost: about one pass over 1.9 times the frame's pixels. `scratch` holds one level at a time.
///
/// # Errors
/// [`FrameError::ScratchTooSmall`] if `scratch` has fewer than [`level_bytes`]; then nothing was visited.
pub fn visit_levels<K: Kernels + ?Sized>(
    kernels: &K,
    frame: GrayView<'_>,
    scratch: &mut [u8],
    mut visit: impl FnMut(u8, GrayView<'_>),
) -> Result<(), FrameError> {
    let needed = level_bytes(frame.width(), frame.height());
    let found = scratch.len();
    let scratch = scratch.get_mut(..needed).ok_or(FrameError::ScratchTooSmall { needed, found })?;
    visit(0, frame);
    let mut visit_pair = |first: u8, width: usize, height: usize, scratch: &mut [u8]| {
        if let Ok(level) = GrayView::new(scratch, width, height, width) {
            visit(first, level);
            halve_in_place(kernels, scratch, width, height);
        }
        if let Ok(level) = GrayView::new(scratch, width / 2, height / 2, width / 2) {
            visit(first + 2, level);
        }
    };
    let (width, height) = shrink_seven_to_five(kernels, frame, scratch);
    visit_pair(1, width, height, scratch);
    let (width, height) = halve(kernels, frame, scratch);
    visit_pair(2, width, height, scratch);
    Ok(())
}

/// Output row `5 q + k` averages the base rows `7 q + first..` with these weights (sum 7).
const ROWS: [(usize, [u16; 3]); 5] = [(0, [5, 2, 0]), (1, [3, 4, 0]), (2, [1, 5, 1]), (4, [4, 3, 0]), (5, [2, 5, 0])];

/// Writes the frame shrunk 7:5 and returns its size. Columns and rows that do not fill a group of seven give as many
/// outputs as fit.
fn shrink_seven_to_five<K: Kernels + ?Sized>(kernels: &K, frame: GrayView<'_>, out: &mut [u8]) -> (usize, usize) {
    let (width, height) = (frame.width() * 5 / 7, frame.height() * 5 / 7);
    if width == 0 {
        return (0, height);
    }
    let whole = frame.width() / 7 * 7;
    let rest = frame.width() - whole;
    for (y, out) in out.chunks_exact_mut(width).take(height).enumerate() {
        let (first, weights) = ROWS.get(y % 5).copied().unwrap_or_default();
        let first = y / 5 * 7 + first;
        // A row of weight 0 may lie below the frame: any row of the right length will do.
        let rows = [0, 1, 2].map(|k| frame.row((first + k).min(frame.height() - 1)));
        let (body, tail) = out.split_at_mut(out.len().min(whole / 7 * 5));
        kernels.shrink_seven_to_five(rows.map(|row| row.get(..whole).unwrap_or(&[])), weights, body);
        if !tail.is_empty() {
            // The last, incomplete group of columns: padded by its own last pixel, which the outputs that fit never use.
            let mut padded = [[0_u8; 7]; 3];
            for (padded, row) in padded.iter_mut().zip(rows) {
                let end = row.get(row.len() - rest..).unwrap_or(&[]);
                for (padded, &pixel) in padded.iter_mut().zip(end) {
                    *padded = pixel;
                }
            }
            let [a, b, c] = &padded;
            let mut five = [0_u8; 5];
            kernels.shrink_seven_to_five([a, b, c], weights, &mut five);
            for (out, pixel) in tail.iter_mut().zip(five) {
                *out = pixel;
            }
        }
    }
    (width, height)
}

/// Writes the 2 x 2 averages of the frame and returns their size.
fn halve<K: Kernels + ?Sized>(kernels: &K, frame: GrayView<'_>, out: &mut [u8]) -> (usize, usize) {
    let (width, height) = (frame.width() / 2, frame.height() / 2);
    if width == 0 {
        return (0, height);
    }
    for (y, out) in out.chunks_exact_mut(width).take(height).enumerate() {
        kernels.halve(frame.row(2 * y), frame.row(2 * y + 1), out);
    }
    (width, height)
}

/// Replaces an image by its 2 x 2 averages, packed at the front of the same buffer.
fn halve_in_place<K: Kernels + ?Sized>(kernels: &K, image: &mut [u8], width: usize, height: usize) {
    let half = width / 2;
    for y in 0..height / 2 {
        // Output row y ends at or before input row 2 y begins, except for the first.
        if y > 0
            && let Some((out, rows)) = image.split_at_mut_checked(2 * y * width)
            && let (Some(out), Some(upper), Some(lower)) =
                (out.get_mut(y * half..(y + 1) * half), rows.get(..width), rows.get(width..2 * width))
        {
            kernels.halve(upper, lower, out);
            continue;
        }
        for x in 0..half {
            let at = |row: usize, column: usize| image.get(row * width + column).map_or(0, |&p| u16::from(p));
            let sum = at(2 * y, 2 * x) + at(2 * y, 2 * x + 1) + at(2 * y + 1, 2 * x) + at(2 * y + 1, 2 * x + 1);
            if let Some(out) = image.get_mut(y * half + x) {
                *out = ((sum + 2) >> 2) as u8;
            }
        }
    }
}
