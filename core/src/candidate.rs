//! Candidate correspondences between a stored view and a frame, from the distances of their signatures.

use heapless::Vec;

use crate::extract::Features;
use crate::feature::COMMONNESS;
use crate::heap;
use crate::kernel::{Kernels, NUMBER_BITS, VoteColumns};
use crate::model::SURPRISE;
use crate::pyramid::scale;

/// Gains are in 1/64 bit.
pub const GAIN_UNIT: i32 = 64;
/// Surprise that gains nothing: every pair of corners is this much alike.
const FREE_BITS: i32 = 5;
/// A single corner cannot gain more than this.
const MOST_BITS: i32 = 12;
/// Distances up to this have a gain, for the least common corner.
const FARTHEST: u8 = farthest_of_all();
/// Neighbours whose distance is within this count as equally near.
const TIE: u8 = 4;

const fn farthest_of_all() -> u8 {
    let mut distance = 0;
    while SURPRISE[distance as usize + 1] as i32 > 8 * (FREE_BITS + *COMMONNESS.start() as i32) {
        distance += 1;
    }
    distance
}

/// Surprise of a distance between unrelated corners: `-log2 P(at most this)`, in 1/8 bit.
pub fn surprise(distance: u8) -> u8 {
    SURPRISE.get(usize::from(distance)).copied().unwrap_or(0)
}

/// The gain of a distance to a stored corner: `clamp(surprise - commonness - 5, 0, 12)` bits, in 1/64 bit.
#[inline]
pub fn gain(distance: u8, commonness: i8) -> i32 {
    let free = (FREE_BITS + i32::from(commonness)) * GAIN_UNIT;
    (i32::from(surprise(distance)) * (GAIN_UNIT / 8) - free).clamp(0, MOST_BITS * GAIN_UNIT)
}

/// The largest distance to a corner of this commonness that has a gain.
pub fn farthest(commonness: i8) -> u8 {
    let mut distance = FARTHEST;
    while distance > 0 && gain(distance, commonness) == 0 {
        distance -= 1;
    }
    distance
}

/// `gain / sqrt(n)` for 1, 2 or 3 neighbours that are equally near: a soft ratio test that keeps repeated windows.
fn shared(gain: i32, n: usize) -> i32 {
    /// 1 / sqrt(n) in Q16.
    const ROOT: [i32; 4] = [65_536, 65_536, 46_341, 37_837];
    (gain * ROOT.get(n).copied().unwrap_or(37_837)) >> 16
}

/// At most `CANDIDATES` correspondences as columns, the strongest first.
#[derive(Debug, Clone)]
pub struct Candidates<const CANDIDATES: usize> {
    from_x: Vec<f32, CANDIDATES>,
    from_y: Vec<f32, CANDIDATES>,
    to_x: Vec<f32, CANDIDATES>,
    to_y: Vec<f32, CANDIDATES>,
    step: Vec<f32, CANDIDATES>,
    gain: Vec<i32, CANDIDATES>,
    scale: Vec<f32, CANDIDATES>,
    stored: Vec<u16, CANDIDATES>,
    order: Vec<u32, CANDIDATES>,
}

impl<const CANDIDATES: usize> Candidates<CANDIDATES> {
    /// No candidates.
    pub const fn new() -> Self {
        Self {
            from_x: Vec::new(),
            from_y: Vec::new(),
            to_x: Vec::new(),
            to_y: Vec::new(),
            step: Vec::new(),
            gain: Vec::new(),
            scale: Vec::new(),
            stored: Vec::new(),
            order: Vec::new(),
        }
    }

    /// How many candidates.
    pub fn len(&self) -> usize {
        self.gain.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.gain.is_empty()
    }

    /// The candidates as columns.
    pub fn view(&self) -> CandidateView<'_> {
        CandidateView {
            votes: VoteColumns {
                from_x: &self.from_x,
                from_y: &self.from_y,
                to_x: &self.to_x,
                to_y: &self.to_y,
                step: &self.step,
                gain: &self.gain,
            },
            scale: &self.scale,
            stored: &self.stored,
        }
    }

    /// Collects the three nearest query corners of every stored corner and keeps the `CANDIDATES` of most gain.
    ///
    /// `distances` holds a row of `query.len()` distances for each stored corner. Ties: stored corner, then query
    /// corner, in their order.
    pub fn collect<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        stored: Features<'_>,
        query: Features<'_>,
        distances: &[u8],
    ) {
        self.order.clear();
        let rows = distances.chunks_exact(query.len().max(1)).zip(stored.commonness).enumerate();
        for (number, (row, &commonness)) in rows {
            let nearest = kernels.nearest_three(row, FARTHEST + TIE);
            for (&distance, &place) in nearest.distances.iter().zip(&nearest.places) {
                if distance > FARTHEST {
                    break;
                }
                let equals = nearest.distances.iter().filter(|&&other| other <= distance + TIE).count();
                let gain = shared(gain(distance, commonness), equals);
                if gain > 0 {
                    keep_largest(&mut self.order, key(gain, number as u16, place));
                }
            }
        }
        heap::sort(&mut self.order);
        self.fill_columns(stored, query);
    }

    fn fill_columns(&mut self, stored: Features<'_>, query: Features<'_>) {
        self.from_x.clear();
        self.from_y.clear();
        self.to_x.clear();
        self.to_y.clear();
        self.step.clear();
        self.gain.clear();
        self.scale.clear();
        self.stored.clear();
        for &key in &self.order {
            let (gain, from_number, to_number) = parts(key);
            let (Some(from), Some(to)) = (stored.get(usize::from(from_number)), query.get(usize::from(to_number)))
            else {
                continue;
            };
            let ([from_x, from_y], [to_x, to_y]) = (from.position.to_pixels(), to.position.to_pixels());
            // All columns have the capacity of `order`, which these come from.
            let _ = self.from_x.push(from_x);
            let _ = self.from_y.push(from_y);
            let _ = self.to_x.push(to_x);
            let _ = self.to_y.push(to_y);
            let _ = self.step.push(f32::from(to.level) - f32::from(from.level));
            let _ = self.gain.push(gain);
            let _ = self.scale.push(scale(to.level) / scale(from.level));
            let _ = self.stored.push(from_number);
        }
    }
}

impl<const CANDIDATES: usize> Default for Candidates<CANDIDATES> {
    fn default() -> Self {
        Self::new()
    }
}

/// Candidates as columns of equal length, the strongest first.
#[derive(Debug, Clone, Copy)]
pub struct CandidateView<'a> {
    /// What hypotheses are voted with.
    pub votes: VoteColumns<'a>,
    /// Scale of frame over view, from the two levels.
    pub scale: &'a [f32],
    /// Number of the stored corner.
    pub stored: &'a [u16],
}

/// Larger is better: gain, then the lower stored number, then the lower query number.
///
/// 10 bits of gain, then the stored number in 10 bits and the query number in 11.
fn key(gain: i32, stored: u16, query: u16) -> u32 {
    let (stored, query) = (!u32::from(stored) & STORED_LAST, !u32::from(query) & QUERY_LAST);
    (gain as u32) << (STORED_BITS + NUMBER_BITS) | stored << NUMBER_BITS | query
}

fn parts(key: u32) -> (i32, u16, u16) {
    let (stored, query) = (!(key >> NUMBER_BITS) & STORED_LAST, !key & QUERY_LAST);
    ((key >> (STORED_BITS + NUMBER_BITS)) as i32, stored as u16, query as u16)
}

const STORED_BITS: u32 = 10;
/// Stored corners have numbers up to this.
pub(crate) const STORED_LAST: u32 = (1 << STORED_BITS) - 1;
/// The frame's corners have numbers up to this.
const QUERY_LAST: u32 = (1 << NUMBER_BITS) - 1;
const _: () = assert!(((MOST_BITS * GAIN_UNIT) as u64) < 1 << (u32::BITS - STORED_BITS - NUMBER_BITS));

/// A heap with the smallest key on top, which the next larger one replaces when the heap is full.
fn keep_largest<const N: usize>(largest: &mut Vec<u32, N>, key: u32) {
    if largest.push(key).is_ok() {
        heap::sift_up(largest);
    } else if let Some(top) = largest.first_mut()
        && *top < key
    {
        *top = key;
        let end = largest.len();
        heap::sift_down(largest, end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_gain_comes_first_then_the_lower_numbers() {
        let sorted = [(768, 0, 0), (768, 0, 2_047), (768, 1, 0), (768, 1_023, 0), (767, 0, 0), (1, 1_023, 2_047)];
        let keys = sorted.map(|(gain, stored, query)| key(gain, stored, query));
        assert!(keys.is_sorted_by(|a, b| a > b));
        assert_eq!(keys.map(parts), sorted);
    }
}
