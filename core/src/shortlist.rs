//! Which corners of the frame look like each stored corner: found once for a view, asked in every round.
//!
//! A device with little memory has no room for it (`ENTRIES = 0`) and asks the grid of [`crate::query`] instead; the
//! answers are the same.

use crate::candidate::{farthest, gain};
use crate::kernel::{Kernels, ShortColumns};
use crate::refine::Pairing;

/// Stored corners whose lists are kept, at most.
const STORED: usize = 1_024;

/// For each stored corner the corners of the frame with a gain, as columns, one list after the other.
#[derive(Debug, Clone)]
pub struct Shortlist<const ENTRIES: usize> {
    x: [f32; ENTRIES],
    y: [f32; ENTRIES],
    gain: [i32; ENTRIES],
    level: [i32; ENTRIES],
    number: [i32; ENTRIES],
    /// Where the list of each stored corner begins; a corner without an end has no list.
    starts: heapless::Vec<u32, STORED>,
}

impl<const ENTRIES: usize> Shortlist<ENTRIES> {
    /// No lists.
    pub const fn new() -> Self {
        Self {
            x: [0.0; ENTRIES],
            y: [0.0; ENTRIES],
            gain: [0; ENTRIES],
            level: [0; ENTRIES],
            number: [0; ENTRIES],
            starts: heapless::Vec::new(),
        }
    }

    /// Lists the corners of the frame for as many stored corners as there is room.
    pub fn fill<K: Kernels, const QUERY: usize>(&mut self, kernels: &K, pairing: &Pairing<'_, QUERY>) {
        self.starts.clear();
        let mut end = 0;
        let _ = self.starts.push(0);
        for (stored, &commonness) in pairing.stored.commonness.iter().enumerate() {
            let row = pairing.row(stored);
            let mut fits = true;
            kernels.each_at_most(row, farthest(commonness), &mut |number| {
                let (Some(&distance), Some(feature)) = (row.get(number), pairing.query.get(number)) else { return };
                let [x, y] = feature.position.to_pixels();
                match (
                    self.x.get_mut(end),
                    self.y.get_mut(end),
                    self.gain.get_mut(end),
                    self.level.get_mut(end),
                    self.number.get_mut(end),
                ) {
                    (Some(to_x), Some(to_y), Some(to_gain), Some(to_level), Some(to_number)) => {
                        (*to_x, *to_y, *to_gain) = (x, y, gain(distance, commonness));
                        (*to_level, *to_number) = (1 << feature.level, number as i32);
                        end += 1;
                    }
                    _ => fits = false,
                }
            });
            if !fits || self.starts.push(end as u32).is_err() {
                // A list that does not fit ends them all.
                return;
            }
        }
    }

    /// The list of a stored corner, if there was room for it.
    #[inline]
    pub fn of(&self, stored: usize) -> Option<ShortColumns<'_>> {
        let range = *self.starts.get(stored)? as usize..*self.starts.get(stored + 1)? as usize;
        Some(ShortColumns {
            x: self.x.get(range.clone())?,
            y: self.y.get(range.clone())?,
            gain: self.gain.get(range.clone())?,
            level: self.level.get(range.clone())?,
            number: self.number.get(range)?,
        })
    }
}
