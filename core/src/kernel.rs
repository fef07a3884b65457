//! The inner loops, each written once as a plain loop over slices.
//!
//! A caller who knows its processor implements [`Kernels`] and compiles the same loops for a wider instruction set;
//! the default methods are these loops as they stand. All of it is integer arithmetic, or single `f32` operations that
//! are never reassociated, so every implementation gives the same bits: a test in the Linux runner compares them.
//!
//! Every function works on the shortest of its slices and never fails.

mod bytes;
mod pixels;
mod search;

pub use bytes::{Nearest, count_below, distances, each_marked, marks_at_most, nearest_three, places};
pub use pixels::{
    box_sums, gradient_row, halve, peak_flags, response_row, shrink_seven_to_five, tensor_row, tone, tone_row,
};
pub use search::{
    LANES, LookAlikes, NUMBER_BITS, NUMBER_LIMIT, SLACK, SLACK_PER_PIXEL, Search, Seed, VoteColumns, closest,
    search_key, votes,
};

use crate::feature::Signature;

/// Side of a signature's window of box sums, in pixels of its level: offsets −18..=18.
pub const WINDOW: usize = 37;
/// Side of the pixel patch under that window: each box reaches 2 px further.
pub const PATCH: usize = WINDOW + 4;
/// Row stride of the box sums; the columns beyond [`WINDOW`] hold nothing of use.
pub const WINDOW_STRIDE: usize = 40;
/// Row stride of a patch.
pub const PATCH_STRIDE: usize = WINDOW_STRIDE + 4;

/// A pixel patch around a corner.
pub type Patch = [u8; PATCH * PATCH_STRIDE];
/// 5 x 5 box sums of a [`Patch`]; the length is a power of two so that an index can be masked instead of checked.
pub type BoxSums = [u16; 2_048];

/// The inner loops of the recognizer. Implement it to compile them for a wider instruction set.
pub trait Kernels {
    /// See [`shrink_seven_to_five`].
    fn shrink_seven_to_five(&self, rows: [&[u8]; 3], weights: [u16; 3], out: &mut [u8]) {
        shrink_seven_to_five(rows, weights, out);
    }
    /// See [`halve`].
    fn halve(&self, upper: &[u8], lower: &[u8], out: &mut [u8]) {
        halve(upper, lower, out);
    }
    /// See [`tone_row`].
    fn tone_row(&self, row: &[u8], out: &mut [u8]) {
        tone_row(row, out);
    }
    /// See [`gradient_row`].
    fn gradient_row(&self, rows: [&[u8]; 3], out: [&mut [i16]; 2]) {
        gradient_row(rows, out);
    }
    /// See [`tensor_row`].
    fn tensor_row(&self, gradients: [&[i16]; 2], out: [&mut [i32]; 3]) {
        tensor_row(gradients, out);
    }
    /// See [`response_row`].
    fn response_row(&self, rows: [[&[i32]; 3]; 5], out: &mut [f32]) {
        response_row(rows, out);
    }
    /// See [`peak_flags`].
    fn peak_flags(&self, rows: [&[f32]; 3], least: f32, flags: &mut [u8]) {
        peak_flags(rows, least, flags);
    }
    /// See [`box_sums`].
    fn box_sums(&self, patch: &Patch, sums: &mut BoxSums) {
        box_sums(patch, sums);
    }
    /// See [`distances`].
    fn distances(&self, signature: Signature, others: &[Signature], out: &mut [u8]) {
        distances(signature, others, out);
    }
    /// See [`count_below`].
    fn count_below(&self, values: &[u8], limit: u8) -> u32 {
        count_below(values, limit)
    }
    /// See [`marks_at_most`].
    fn marks_at_most(&self, values: &[u8], limit: u8, marks: &mut [u64]) {
        marks_at_most(values, limit, marks);
    }
    /// See [`closest`].
    fn closest(&self, blocks: &[LookAlikes], search: Search) -> i32 {
        closest(blocks, search)
    }
    /// See [`nearest_three`].
    fn nearest_three(&self, row: &[u8], limit: u8) -> Nearest {
        nearest_three(row, limit)
    }
    /// See [`votes`].
    fn votes(&self, seed: Seed, columns: VoteColumns<'_>, agrees: &mut [u8]) -> i32 {
        votes(seed, columns, agrees)
    }
}

/// The loops exactly as they stand, for any processor.
#[derive(Debug, Clone, Copy, Default)]
pub struct Portable;

impl Kernels for Portable {}
