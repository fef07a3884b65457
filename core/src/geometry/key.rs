//! A point as one number that sorts as the point does.

use super::error::GeometryError;
use super::predicate::COORDINATE_LIMIT;
use super::sort::sort;
use crate::point::ImagePoint;

const COORDINATE_MASK: u64 = (1 << 24) - 1;

/// x, y and the point's number, from the highest bit to the lowest: the order of keys is the order of (x, y), at the
/// same place the lowest number first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key(pub(super) u64);

impl Key {
    pub(super) const NONE: Self = Self(0);

    /// Where x begins.
    pub(super) const X_SHIFT: u32 = 40;
    /// Where y begins.
    pub(super) const Y_SHIFT: u32 = 16;

    #[inline]
    pub(super) fn new(point: ImagePoint, least: ImagePoint, number: usize) -> Self {
        let offset = |coordinate: i32, least: i32| (coordinate - least) as u64;
        let (x, y) = (offset(point.x, least.x), offset(point.y, least.y));
        Self(x << Self::X_SHIFT | y << Self::Y_SHIFT | (number as u64 & 0xffff))
    }

    /// A place without a point.
    #[inline]
    pub(super) fn at(x: u64, y: u64) -> Self {
        Self(x << Self::X_SHIFT | y << Self::Y_SHIFT)
    }

    /// From the leftmost point.
    #[inline]
    pub(super) fn x(self) -> i64 {
        (self.0 >> Self::X_SHIFT) as i64
    }

    /// From the uppermost point.
    #[inline]
    pub(super) fn y(self) -> i64 {
        (self.0 >> Self::Y_SHIFT & COORDINATE_MASK) as i64
    }

    #[inline]
    pub(super) fn number(self) -> u16 {
        self.0 as u16
    }

    /// Whether both stand at the same place.
    #[inline]
    pub(super) fn is_at(self, other: Self) -> bool {
        self.0 >> Self::Y_SHIFT == other.0 >> Self::Y_SHIFT
    }
}

/// The directed line through two keys.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    dx: i64,
    dy: i64,
    offset: i64,
}

impl Line {
    /// From `a` to `b`.
    #[inline(always)]
    pub(super) fn through(a: Key, b: Key) -> Self {
        let (dx, dy) = (b.x() - a.x(), b.y() - a.y());
        Self { dx, dy, offset: dy * a.x() - dx * a.y() }
    }

    /// Twice the area of the triangle of `a`, `b` and this key: positive if it lies to the right, negative to the left.
    /// Each product is below 2^48.
    #[inline(always)]
    pub(super) fn side(self, key: Key) -> i64 {
        self.dx * key.y() - self.dy * key.x() + self.offset
    }
}

/// Sorted keys of all points in `keys`, one of each place, and how many those are; `merged` gets the number of each other
/// point and of the one that stands for it. Coordinates are counted from the least that occur.
pub(super) fn arrange(
    points: &[ImagePoint],
    keys: &mut [Key],
    scratch: &mut [Key],
    merged: impl FnMut(u16, u16),
) -> Result<usize, GeometryError> {
    let too_many = GeometryError::TooManyPoints { found: points.len(), capacity: keys.len() };
    let keys = keys.get_mut(..points.len()).ok_or(too_many)?;
    let [least, most] = bounds(points)?;
    for (number, (key, &point)) in keys.iter_mut().zip(points).enumerate() {
        *key = Key::new(point, least, number);
    }
    sort(keys, scratch, (most.x - least.x) as u64, (most.y - least.y) as u64);
    Ok(distinct(keys, merged))
}

/// The least and the greatest coordinates, if they are within the limit.
pub(super) fn bounds(points: &[ImagePoint]) -> Result<[ImagePoint; 2], GeometryError> {
    let Some((&first, others)) = points.split_first() else { return Ok([ImagePoint::default(); 2]) };
    let (mut least, mut most) = (first, first);
    for point in others {
        least = ImagePoint::new(least.x.min(point.x), least.y.min(point.y));
        most = ImagePoint::new(most.x.max(point.x), most.y.max(point.y));
    }
    let beyond = |coordinate: i32| coordinate.unsigned_abs() > COORDINATE_LIMIT.unsigned_abs();
    if [least.x, least.y, most.x, most.y].into_iter().any(beyond) {
        for (number, point) in points.iter().enumerate() {
            if let Some(found) = [point.x, point.y].into_iter().find(|&coordinate| beyond(coordinate)) {
                return Err(GeometryError::out_of_range(number, found));
            }
        }
    }
    Ok([least, most])
}

/// Moves one key of each place to the front, in order, and returns their number; `merged` gets the number of each
/// other point and of the one that stands for it.
fn distinct(keys: &mut [Key], mut merged: impl FnMut(u16, u16)) -> usize {
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
