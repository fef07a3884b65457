//! A polygon deep within a hull: what it holds needs no look until the layers come near.

use super::chain::Outline;
use super::key::{Key, Line};

/// Corners of each chain of a fence, at most.
const CORNERS: usize = 16;

/// Two chains from the same left end to the same right end, both with strictly ascending x. A key is within if it is
/// on or below (as seen) the upper chain and on or above the lower one.
///
/// Corners are rounded to the grid, so a chain may have dents. It does not matter: if the corners of the upper chain are
/// below the upper chain of a hull, which bulges, so is everything below the fence's; likewise for the lower one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fence {
    upper: Chain,
    lower: Chain,
}

#[derive(Debug, Clone, Copy)]
struct Chain {
    corners: [Key; CORNERS],
    count: usize,
}

impl Fence {
    /// A fence whose corners are some of a hull's vertices, each moved by `share / 2^16` of the way to their mean.
    /// None if it would have no width.
    pub(super) fn within(hull: &[Key], outline: Outline, share: u64) -> Option<Self> {
        let hull = hull.get(..outline.vertices)?;
        let count = u64::try_from(outline.vertices).ok().filter(|&count| count > 0)?;
        let (x, y) = hull.iter().fold((0, 0), |(x, y), key| (x + key.x() as u64, y + key.y() as u64));
        let middle = (x / count, y / count);
        let inwards = |key: &Key| {
            let moved = |from: i64, to: u64| ((from as u64 * ((1 << 16) - share)) + to * share) >> 16;
            Key::at(moved(key.x(), middle.0), moved(key.y(), middle.1))
        };
        let first = hull.first()?;
        let upper = hull.get(..=outline.turn)?;
        let lower = hull.get(outline.turn..)?;
        Some(Self {
            upper: Chain::new(upper.len(), upper.iter().map(inwards), 1)?,
            lower: Chain::new(lower.len() + 1, core::iter::once(first).chain(lower.iter().rev()).map(inwards), -1)?,
        })
    }

    /// Whether all of the fence is within a hull.
    pub(super) fn is_within(&self, hull: &[Key], outline: Outline) -> bool {
        let (Some([first, ..]), Some(upper), Some(lower)) =
            (hull.get(..outline.vertices), hull.get(..=outline.turn), hull.get(outline.turn..outline.vertices))
        else {
            return false;
        };
        let lower = core::iter::once(first).chain(lower.iter().rev());
        self.upper.is_beside(upper.iter(), 1) && self.lower.is_beside(lower, -1)
    }
}

impl Chain {
    /// Of ascending corners as many as there is room for, the first and the last among them. Of corners with the same x
    /// the outermost is kept: the lowest y if `side` is 1, else the highest.
    fn new(count: usize, corners: impl Iterator<Item = Key>, side: i64) -> Option<Self> {
        let mut chain = Self { corners: [Key::NONE; CORNERS], count: 0 };
        let step = count.div_ceil(CORNERS - 1).max(1);
        let chosen = corners.enumerate().filter(|(number, _)| number % step == 0 || number + 1 == count);
        for (_, corner) in chosen {
            match chain.corners.get_mut(..chain.count).and_then(<[_]>::last_mut) {
                Some(latest) if latest.x() == corner.x() => {
                    if (latest.y() - corner.y()) * side > 0 {
                        *latest = corner;
                    }
                }
                _ => {
                    *chain.corners.get_mut(chain.count)? = corner;
                    chain.count += 1;
                }
            }
        }
        (chain.count >= 2).then_some(chain)
    }

    /// Whether every corner lies, in x, properly between the ends of a chain of a hull, and on the right of it
    /// (`side` 1) or on the left (−1), or on it.
    fn is_beside<'a>(&self, mut hull: impl Iterator<Item = &'a Key>, side: i64) -> bool {
        let (Some(mut from), Some(mut to)) = (hull.next(), hull.next()) else { return false };
        for corner in self.corners.iter().take(self.count) {
            while to.x() < corner.x() {
                let Some(next) = hull.next() else { return false };
                (from, to) = (to, next);
            }
            if from.x() >= corner.x() || Line::through(*from, *to).side(*corner) * side < 0 {
                return false;
            }
        }
        true
    }

    /// The edges from the right to the left.
    fn edges(&self) -> impl Iterator<Item = &[Key; 2]> {
        let edges = self.corners.get(..self.count).unwrap_or(&[]).windows(2).rev();
        edges.filter_map(|edge| edge.try_into().ok())
    }
}

/// Points of which some, the parked ones, are known to be no vertices: `keys[..active]` are at work, `keys[parked..]` are
/// parked; both are sorted, and what is between is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parking {
    pub(super) active: usize,
    pub(super) parked: usize,
}

impl Parking {
    /// Puts back to work what is parked outside the fence; without a fence all. `scratch` needs room for those.
    pub(super) fn release(&mut self, keys: &mut [Key], scratch: &mut [Key], fence: Option<&Fence>) {
        let (start, end) = (self.parked, keys.len());
        let released = if let Some(fence) = fence {
            self.sift(keys, scratch, fence)
        } else {
            let parked = keys.get(start..).unwrap_or(&[]);
            for (place, &key) in scratch.iter_mut().zip(parked.iter().rev()) {
                *place = key;
            }
            self.parked = end;
            end - start
        };
        // From the right end, so that nothing is overwritten before it has moved.
        let (mut left, mut place) = (self.active, self.active + released);
        self.active = place;
        for &key in scratch.iter().take(released) {
            while let Some(before) = left.checked_sub(1)
                && let Some(&other) = keys.get(before)
                && other > key
            {
                place -= 1;
                left = before;
                if let Some(place) = keys.get_mut(place) {
                    *place = other;
                }
            }
            place -= 1;
            if let Some(place) = keys.get_mut(place) {
                *place = key;
            }
        }
    }

    /// Moves what is parked within the fence to the end, the others to `scratch`, the greatest first; their number.
    fn sift(&mut self, keys: &mut [Key], scratch: &mut [Key], fence: &Fence) -> usize {
        let mut sieve = Sieve { at: keys.len(), parked: keys.len(), released: 0, keys, scratch, end: self.parked };
        // Strips from the right to the left, in each of which the same edges are above and below.
        let (mut uppers, mut lowers) = (fence.upper.edges(), fence.lower.edges());
        let (mut upper, mut lower) = (uppers.next(), lowers.next());
        if let Some([_, last]) = upper {
            sieve.strip(last.x() + 1, |_| false);
        }
        while let (Some(&[above, above_right]), Some(&[below, below_right])) = (upper, lower) {
            let (upper_line, lower_line) = (Line::through(above, above_right), Line::through(below, below_right));
            sieve.strip(above.x().max(below.x()), |key| (upper_line.side(key) >= 0) & (lower_line.side(key) <= 0));
            if above.x() >= below.x() {
                upper = uppers.next();
            }
            if below.x() >= above.x() {
                lower = lowers.next();
            }
        }
        sieve.strip(0, |_| false);
        self.parked = sieve.parked;
        sieve.released
    }
}

/// Goes through parked keys from the greatest to the least.
struct Sieve<'a> {
    keys: &'a mut [Key],
    scratch: &'a mut [Key],
    /// The keys from here on were looked at.
    at: usize,
    /// The least of all.
    end: usize,
    parked: usize,
    released: usize,
}

impl Sieve<'_> {
    /// Goes on as far as `left`, and keeps parked what `stays`.
    #[inline(always)]
    fn strip(&mut self, left: i64, stays: impl Fn(Key) -> bool) {
        let (mut at, mut parked, mut released) = (self.at, self.parked, self.released);
        while at > self.end
            && let Some(&key) = self.keys.get(at - 1)
            && key.x() >= left
        {
            at -= 1;
            let stays = stays(key);
            if let Some(place) = self.keys.get_mut(parked - 1) {
                *place = key;
            }
            parked -= usize::from(stays);
            if let Some(place) = self.scratch.get_mut(released) {
                *place = key;
            }
            released += usize::from(!stays);
        }
        (self.at, self.parked, self.released) = (at, parked, released);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::chain::strict_hull;

    fn hull<const N: usize>(mut keys: [Key; N]) -> ([Key; N], Outline) {
        let mut buffer = [Key::NONE; N];
        keys.sort_unstable();
        let outline = strict_hull(&keys, &mut buffer);
        (buffer, outline)
    }

    fn square(least: u64, most: u64) -> ([Key; 4], Outline) {
        hull([(least, least), (most, least), (most, most), (least, most)].map(|(x, y)| Key::at(x, y)))
    }

    #[test]
    fn a_fence_parks_what_is_within_it() {
        let (hull, outline) = square(0, 100);
        // A quarter of the way from (0, 0) to the middle (50, 50).
        let fence = Fence::within(&hull, outline, 1 << 14).unwrap();
        assert!(fence.is_within(&hull, outline));
        let mut keys = core::array::from_fn::<_, 101, _>(|x| Key::at(x as u64, 20));
        let mut scratch = [Key::NONE; 101];
        let mut parking = Parking { active: 0, parked: 0 };
        parking.release(&mut keys, &mut scratch, Some(&fence));
        // From 12 to 87, ends included.
        assert_eq!(parking, Parking { active: 25, parked: 25 });
        assert!(keys[..25].iter().map(|key| key.x()).eq((0..12).chain(88..=100)));
        assert!(keys[25..].iter().map(|key| key.x()).eq(12..88));
        parking.release(&mut keys, &mut scratch, None);
        assert_eq!(parking, Parking { active: 101, parked: 101 });
        assert!(keys.iter().map(|key| key.x()).eq(0..=100));
    }

    #[test]
    fn above_and_below_are_outside() {
        let (hull, outline) = square(0, 100);
        let fence = Fence::within(&hull, outline, 1 << 14).unwrap();
        let mut keys = core::array::from_fn::<_, 101, _>(|y| Key::at(50, y as u64));
        let mut parking = Parking { active: 0, parked: 0 };
        parking.release(&mut keys, &mut [Key::NONE; 101], Some(&fence));
        assert!(keys[..parking.active].iter().map(|key| key.y()).eq((0..12).chain(88..=100)));
    }

    #[test]
    fn a_fence_knows_when_it_is_reached() {
        let (hull, outline) = square(0, 100);
        let fence = Fence::within(&hull, outline, 1 << 14).unwrap();
        for (least, within) in [(11, true), (12, false), (13, false), (40, false)] {
            let (hull, outline) = square(least, 100 - least);
            assert_eq!(fence.is_within(&hull, outline), within, "{least}");
        }
        // One side only.
        let (hull, outline) = self::hull([(0, 0), (100, 0), (100, 100), (0, 80)].map(|(x, y)| Key::at(x, y)));
        assert!(!fence.is_within(&hull, outline));
    }

    #[test]
    fn without_width_there_is_no_fence() {
        let (hull, outline) = hull([(0, 0), (1, 5), (0, 9)].map(|(x, y)| Key::at(x, y)));
        assert!(Fence::within(&hull, outline, 1 << 15).is_none());
    }
}
