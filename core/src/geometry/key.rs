//! A point as one number that sorts as the point does, and the sort.

use super::error::GeometryError;
use super::predicate::COORDINATE_LIMIT;
use crate::point::ImagePoint;

const NUMBER_BITS: u32 = 16;
const COORDINATE_BITS: u32 = 24;
const COORDINATE_MASK: u64 = (1 << COORDINATE_BITS) - 1;

/// x, y and the point's number, from the highest bit to the lowest: the order of keys is the order of (x, y), at the
/// same place the lowest number first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key(pub(super) u64);

impl Key {
    pub(super) const NONE: Self = Self(0);

    #[inline]
    fn new(point: ImagePoint, number: usize) -> Self {
        let offset = |coordinate: i32| (coordinate + COORDINATE_LIMIT) as u64;
        Self(
            offset(point.x) << (COORDINATE_BITS + NUMBER_BITS)
                | offset(point.y) << NUMBER_BITS
                | (number as u64 & 0xffff),
        )
    }

    /// From the left end of the allowed range.
    #[inline]
    pub(super) fn x(self) -> i64 {
        (self.0 >> (COORDINATE_BITS + NUMBER_BITS)) as i64
    }

    /// From the upper end of the allowed range.
    #[inline]
    pub(super) fn y(self) -> i64 {
        (self.0 >> NUMBER_BITS & COORDINATE_MASK) as i64
    }

    #[inline]
    pub(super) fn number(self) -> u16 {
        self.0 as u16
    }

    /// Whether both stand at the same place.
    #[inline]
    pub(super) fn is_at(self, other: Self) -> bool {
        self.0 >> NUMBER_BITS == other.0 >> NUMBER_BITS
    }
}

/// As [`super::predicate::twice_area`]: below 2^48.
#[inline]
pub(super) fn twice_area(a: Key, b: Key, c: Key) -> i64 {
    (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x())
}

/// The keys of all points, in their order.
pub(super) fn fill<'a>(storage: &'a mut [Key], points: &[ImagePoint]) -> Result<&'a mut [Key], GeometryError> {
    let capacity = storage.len();
    let too_many = GeometryError::TooManyPoints { found: points.len(), capacity };
    let keys = storage.get_mut(..points.len()).ok_or(too_many)?;
    for (number, (key, &point)) in keys.iter_mut().zip(points).enumerate() {
        for coordinate in [point.x, point.y] {
            if coordinate.unsigned_abs() > COORDINATE_LIMIT as u32 {
                return Err(GeometryError::out_of_range(number, coordinate));
            }
        }
        *key = Key::new(point, number);
    }
    Ok(keys)
}

/// Shell sort with the gaps of Ciura.
pub(super) fn sort(keys: &mut [Key]) {
    for gap in [701, 301, 132, 57, 23, 10, 4, 1] {
        for end in gap..keys.len() {
            let mut at = end;
            while at >= gap
                && let Some([before, .., after]) = keys.get_mut(at - gap..=at)
                && *before > *after
            {
                core::mem::swap(before, after);
                at -= gap;
            }
        }
    }
}

/// Moves one key of each place to the front, in order, and returns their number; `merged` gets the number of each
/// other point and of the one that stands for it.
pub(super) fn distinct(keys: &mut [Key], mut merged: impl FnMut(u16, u16)) -> usize {
    let mut count = 0;
    let mut latest: Option<Key> = None;
    for at in 0..keys.len() {
        let Some(&key) = keys.get(at) else { break };
        match latest {
            Some(same) if same.is_at(key) => merged(key.number(), same.number()),
            _ => {
                if let Some(slot) = keys.get_mut(count) {
                    *slot = key;
                }
                latest = Some(key);
                count += 1;
            }
        }
    }
    count
}
