//! Which corners of the frame look like each stored corner: found once for a view, asked in every round.
//!
//! A device with little memory has no room for it (`BLOCKS = 0`) and asks the grid of [`crate::query`] instead; the
//! answers are the same.

use crate::candidate::{farthest, gain};
use crate::kernel::{Kernels, LANES, LookAlikes, NUMBER_LIMIT, places};
use crate::refine::Pairing;

/// Where nothing is looked for.
const FAR: f32 = 1e9;
const EMPTY: LookAlikes =
    LookAlikes { x: [FAR; LANES], y: [0.0; LANES], gain: [0; LANES], level: [0; LANES], number: [0; LANES] };

/// For each stored corner the corners of the frame with a gain, in whole blocks, one list after the other.
#[derive(Debug, Clone)]
pub struct Shortlist<const STORED: usize, const BLOCKS: usize> {
    blocks: [LookAlikes; BLOCKS],
    /// Where the list of each stored corner ends, and the next one's begins; a corner without an end has no list.
    ends: heapless::Vec<u16, STORED>,
}

impl<const STORED: usize, const BLOCKS: usize> Shortlist<STORED, BLOCKS> {
    /// No lists.
    pub const fn new() -> Self {
        const { assert!(BLOCKS <= u16::MAX as usize, "a list begins at a 16-bit number") };
        Self { blocks: [EMPTY; BLOCKS], ends: heapless::Vec::new() }
    }

    /// Lists the corners of the frame for as many stored corners as there is room.
    pub fn fill<K: Kernels + ?Sized, const QUERY: usize>(&mut self, kernels: &K, pairing: &Pairing<'_, QUERY>) {
        self.ends.clear();
        let mut end = 0;
        let mut marks = [0; (NUMBER_LIMIT as usize + 1) / 64];
        for (stored, &commonness) in pairing.stored.commonness.iter().enumerate() {
            let row = pairing.row(stored);
            kernels.marks_at_most(row, farthest(commonness), &mut marks);
            let (mut lane, mut fits) = (LANES, true);
            for number in places(marks.get(..row.len().div_ceil(64)).unwrap_or(&[])) {
                let (Some(&distance), Some(position), Some(&level)) =
                    (row.get(number), pairing.query.positions.get(number), pairing.query.levels.get(number))
                else {
                    continue;
                };
                if lane == LANES {
                    match self.blocks.get_mut(end) {
                        Some(block) => (block.x, block.gain) = ([FAR; LANES], [0; LANES]),
                        None => fits = false,
                    }
                    (lane, end) = (0, end + 1);
                }
                if let Some(block) = self.blocks.get_mut(end - 1) {
                    let slot = lane % LANES;
                    [block.x[slot], block.y[slot]] = position.to_pixels();
                    block.gain[slot] = gain(distance, commonness);
                    block.level[slot] = 1 << level;
                    block.number[slot] = number as i32;
                }
                lane += 1;
            }
            if !fits || self.ends.push(end as u16).is_err() {
                // A list that does not fit ends them all.
                return;
            }
        }
    }

    /// The list of a stored corner, if there was room for it.
    #[inline]
    pub fn of(&self, stored: usize) -> Option<&[LookAlikes]> {
        let begin = stored.checked_sub(1).map_or(Some(0), |before| self.ends.get(before).copied())?;
        self.blocks.get(usize::from(begin)..usize::from(*self.ends.get(stored)?))
    }
}

impl<const STORED: usize, const BLOCKS: usize> Default for Shortlist<STORED, BLOCKS> {
    fn default() -> Self {
        Self::new()
    }
}
