//! Binary signatures: 128 comparisons of box sums around a corner, upright, without learned weights.
//!
//! Bit `t` says whether the 5 x 5 sum at the test's first point is below the one at its second (BRIEF, Calonder et al.
//! 2010, on box sums). A comparison of brightnesses survives any change of gain, bias and gamma. Where the two sums
//! are within half a gray level the bit is a hash of the place instead, so that blank walls and saturated sky match
//! nothing.

use crate::feature::Signature;
use crate::image::GrayView;
use crate::kernel::{BoxSums, Kernels, PATCH, PATCH_STRIDE, Patch, WINDOW_STRIDE};
use crate::model::TESTS;

/// Sums that differ by no more than this (half a gray level over 25 pixels) are a tie.
const TIE: i32 = 12;
/// Pixels from a corner to the edge of its patch.
const REACH: usize = PATCH / 2;

/// Both points of every test as indices of [`BoxSums`].
const OFFSETS: [[u16; 2]; TESTS.len()] = {
    let mut offsets = [[0; 2]; TESTS.len()];
    let mut t = 0;
    while t < TESTS.len() {
        let [ax, ay, bx, by] = TESTS[t];
        offsets[t] = [index(ax, ay), index(bx, by)];
        t += 1;
    }
    offsets
};

const fn index(x: i8, y: i8) -> u16 {
    ((y as i32 + 18) * WINDOW_STRIDE as i32 + x as i32 + 18) as u16
}

/// Memory for one patch and its box sums.
#[derive(Debug, Clone)]
pub struct SignatureScratch {
    patch: Patch,
    sums: BoxSums,
}

impl SignatureScratch {
    /// Empty memory.
    pub const fn new() -> Self {
        Self { patch: [0; PATCH * PATCH_STRIDE], sums: [0; 2_048] }
    }
}

impl Default for SignatureScratch {
    fn default() -> Self {
        Self::new()
    }
}

/// The signature of the pixel `column`, `row` of a level. Pixels beyond the border repeat the border.
pub fn describe<K: Kernels + ?Sized>(
    kernels: &K,
    level: GrayView<'_>,
    column: u16,
    row: u16,
    scratch: &mut SignatureScratch,
) -> Signature {
    copy_patch(level, usize::from(column), usize::from(row), &mut scratch.patch);
    kernels.box_sums(&scratch.patch, &mut scratch.sums);
    let mut less = [0_u64; 2];
    let mut tied = [0_u64; 2];
    for ((less, tied), tests) in less.iter_mut().zip(&mut tied).zip(OFFSETS.chunks_exact(64)) {
        for (bit, &[a, b]) in tests.iter().enumerate() {
            let at = |index: u16| i32::from(scratch.sums[usize::from(index) & 2_047]);
            let difference = at(a) - at(b);
            *less |= u64::from(difference < 0) << bit;
            *tied |= u64::from(difference.unsigned_abs() <= TIE.unsigned_abs()) << bit;
        }
    }
    let mut words = [0; 2];
    for (number, ((word, less), tied)) in words.iter_mut().zip(less).zip(tied).enumerate() {
        *word = (less & !tied) | (hash_bits(column, row, number as u32 * 64, tied) & tied);
    }
    Signature(words)
}

/// For each bit that is set in `wanted`: a bit that depends on the place and the test only.
fn hash_bits(column: u16, row: u16, first_test: u32, mut wanted: u64) -> u64 {
    let place = u32::from(column).wrapping_mul(73_856_093) ^ u32::from(row).wrapping_mul(19_349_663);
    let mut bits = 0;
    while wanted != 0 {
        let bit = wanted.trailing_zeros();
        wanted &= wanted - 1;
        let mut hash = place ^ (first_test + bit).wrapping_mul(83_492_791);
        hash ^= hash >> 15;
        hash = hash.wrapping_mul(0x2c1b_3c6d);
        hash ^= hash >> 13;
        bits |= u64::from(hash >> 7 & 1) << bit;
    }
    bits
}

fn copy_patch(level: GrayView<'_>, column: usize, row: usize, patch: &mut Patch) {
    let (right, bottom) = (level.width() - 1, level.height() - 1);
    let inside = column >= REACH && column + REACH <= right;
    for (y, out) in patch.chunks_exact_mut(PATCH_STRIDE).enumerate() {
        let pixels = level.row((row + y).saturating_sub(REACH).min(bottom));
        let out = out.iter_mut().take(PATCH);
        match pixels.get(column.wrapping_sub(REACH)..).and_then(|pixels| pixels.first_chunk::<PATCH>()) {
            Some(pixels) if inside => out.zip(pixels).for_each(|(out, &pixel)| *out = pixel),
            _ => {
                for (x, out) in out.enumerate() {
                    let x = (column + x).saturating_sub(REACH).min(right);
                    *out = pixels.get(x).copied().unwrap_or(0);
                }
            }
        }
    }
}
