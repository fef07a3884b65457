//! Rows of bytes: distances between signatures, and what is asked of them.

use super::{NUMBER_BITS, NUMBER_LIMIT};
use crate::feature::Signature;

/// Hamming distances of one signature to many, 0..=128 each.
#[inline(always)]
pub fn distances(signature: Signature, others: &[Signature], out: &mut [u8]) {
    for (out, &other) in out.iter_mut().zip(others) {
        *out = signature.distance(other) as u8;
    }
}

/// How many values are below the limit.
#[inline(always)]
pub fn count_below(values: &[u8], limit: u8) -> u32 {
    // Byte lanes first: 255 values cannot overflow a lane.
    values.chunks(255).map(|chunk| u32::from(chunk.iter().fold(0_u8, |n, &v| n + u8::from(v < limit)))).sum()
}

/// The three nearest of a row of distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nearest {
    /// Distances, ascending; 255 where there is none.
    pub distances: [u8; 3],
    /// Their places in the row; of equal distances the first come first.
    pub places: [u16; 3],
}

/// The three smallest values of at most `limit`, the first of equal ones first. At most [`NUMBER_LIMIT`] `+ 1` values
/// are looked at.
#[inline(always)]
pub fn nearest_three(row: &[u8], limit: u8) -> Nearest {
    // Each lane keeps the three smallest of its values, as keys of value and chunk: no branches.
    let mut smallest = [[u16::MAX; NEAREST_LANES]; 3];
    let (chunks, rest) = row.as_chunks::<NEAREST_LANES>();
    for (number, chunk) in (0..NEAREST_CHUNKS).zip(chunks) {
        keep_three_smallest(&mut smallest, chunk, number);
    }
    if chunks.len() < usize::from(NEAREST_CHUNKS) {
        keep_three_smallest(&mut smallest, rest, chunks.len() as u16);
    }
    let mut nearest = Nearest { distances: [255; 3], places: [0; 3] };
    for (distance, place) in nearest.distances.iter_mut().zip(&mut nearest.places) {
        let [first, second, third] = &mut smallest;
        let mut best = u32::MAX;
        for (lane, &key) in (0..).zip(first.iter()) {
            let key = u32::from(key) << NEAREST_LANES.ilog2() | lane;
            best = if key < best { key } else { best };
        }
        if best >> NUMBER_BITS > u32::from(limit) {
            break;
        }
        (*distance, *place) = ((best >> NUMBER_BITS) as u8, (best & NUMBER_LIMIT as u32) as u16);
        let lane = best as usize % NEAREST_LANES;
        (first[lane], second[lane], third[lane]) = (second[lane], third[lane], u16::MAX);
    }
    nearest
}

/// Values that [`nearest_three`] looks at side by side.
const NEAREST_LANES: usize = 32;
/// Chunks of as many values; a key of value and chunk has 16 bits.
const NEAREST_CHUNKS: u16 = 1 << (NUMBER_BITS - NEAREST_LANES.ilog2());

#[inline(always)]
fn keep_three_smallest(smallest: &mut [[u16; NEAREST_LANES]; 3], values: &[u8], number: u16) {
    let [first, second, third] = smallest;
    let lanes = first.iter_mut().zip(second).zip(third);
    for (((first, second), third), &value) in lanes.zip(values) {
        let key = u16::from(value) << NEAREST_CHUNKS.ilog2() | number;
        let (a, larger) = (key.min(*first), key.max(*first));
        let (b, larger) = (larger.min(*second), larger.max(*second));
        (*first, *second, *third) = (a, b, larger.min(*third));
    }
}

/// Which of the first 64 values are at most `limit`, a bit each.
#[inline(always)]
fn at_most(values: &[u8], limit: u8) -> u64 {
    let mut marks = [0; 64];
    if let Some(values) = values.first_chunk::<64>() {
        for (mark, &value) in marks.iter_mut().zip(values) {
            *mark = u8::from(value <= limit);
        }
    } else {
        for (mark, &value) in marks.iter_mut().zip(values) {
            *mark = u8::from(value <= limit);
        }
    }
    bits(&marks)
}

/// Bit `i` is byte `i`, each 0 or 1.
#[inline(always)]
fn bits(marks: &[u8; 64]) -> u64 {
    // The product has byte i at bit 56 + i; no two terms meet, so nothing carries.
    let gathered = |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    marks.as_chunks::<8>().0.iter().enumerate().fold(0, |bits, (number, eight)| bits | gathered(eight) << (8 * number))
}

/// Calls `found` with the places of the bytes that are 1; the others are 0.
#[inline(always)]
pub fn each_marked(marks: &[u8], mut found: impl FnMut(usize)) {
    let (chunks, rest) = marks.as_chunks::<64>();
    let mut padded = [0; 64];
    for (padded, &mark) in padded.iter_mut().zip(rest) {
        *padded = mark;
    }
    for (number, marks) in chunks.iter().chain((!rest.is_empty()).then_some(&padded)).enumerate() {
        let mut bits = bits(marks);
        while bits != 0 {
            found(number * 64 + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// Marks the values of at most `limit`: bit `i % 64` of word `i / 64` for value `i`.
#[inline(always)]
pub fn marks_at_most(values: &[u8], limit: u8, marks: &mut [u64]) {
    for (marks, values) in marks.iter_mut().zip(values.chunks(64)) {
        *marks = at_most(values, limit);
    }
}

/// The places of the bits that are 1.
#[inline(always)]
pub fn places(marks: &[u64]) -> impl Iterator<Item = usize> {
    marks.iter().enumerate().flat_map(|(number, &marks)| {
        let mut rest = marks;
        core::iter::from_fn(move || {
            let bit = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
            rest &= rest - 1;
            Some(number * 64 + bit)
        })
    })
}
