//! Which way three points turn, and the area between them: exact.

use crate::point::ImagePoint;

/// The largest magnitude of a coordinate that hulls take, in 1/16 px: 2^23 − 1, half a million pixels.
///
/// An offset coordinate then has 24 bits, so that x, y and a 16-bit number are one `u64` that sorts as they do.
/// Differences have 24 bits and a sign, their products 48 bits, twice the area of any polygon less than 2^48.
pub const COORDINATE_LIMIT: i32 = (1 << 23) - 1;

/// Which way the path from `a` over `b` to `c` turns, as seen on the screen: x right, y down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Orientation {
    /// From +y towards +x: to the left.
    CounterClockwise,
    /// On one line, or two of the points at the same place.
    Collinear,
    /// From +x towards +y: to the right.
    Clockwise,
}

impl Orientation {
    /// The orientation of the same points in a mirror, or in the opposite order.
    #[must_use]
    pub const fn reversed(self) -> Self {
        match self {
            Self::CounterClockwise => Self::Clockwise,
            Self::Collinear => Self::Collinear,
            Self::Clockwise => Self::CounterClockwise,
        }
    }
}

/// Which way the path from `a` over `b` to `c` turns: the sign of
/// `(b.x − a.x) (c.y − a.y) − (b.y − a.y) (c.x − a.x)`.
///
/// Exact for every `i32`. Within [`COORDINATE_LIMIT`] two multiplications of 64 bits decide, beyond 2^29 of 128 bits.
///
/// ```
/// use daymark_core::geometry::{Orientation, orientation};
/// use daymark_core::point::ImagePoint;
///
/// let [origin, right, down] = [ImagePoint::new(0, 0), ImagePoint::new(16, 0), ImagePoint::new(0, 16)];
/// assert_eq!(orientation(origin, right, down), Orientation::Clockwise);
/// assert_eq!(orientation(origin, down, right), Orientation::CounterClockwise);
/// assert_eq!(orientation(origin, right, right), Orientation::Collinear);
/// ```
#[inline]
pub fn orientation(a: ImagePoint, b: ImagePoint, c: ImagePoint) -> Orientation {
    match twice_area(a, b, c) {
        1.. => Orientation::Clockwise,
        0 => Orientation::Collinear,
        _ => Orientation::CounterClockwise,
    }
}

/// Twice the area of the triangle `a b c` in (1/16 px)^2; positive if it is [`Orientation::Clockwise`].
///
/// Exact within [`COORDINATE_LIMIT`], and as long as the points span less than 2^31 each way. Beyond that the sign is
/// right and the magnitude at most `i64::MAX`.
#[inline]
pub fn twice_area(a: ImagePoint, b: ImagePoint, c: ImagePoint) -> i64 {
    const NARROW: u64 = 1 << 30;
    let difference = |to: i32, from: i32| i64::from(to) - i64::from(from);
    let [bx, by] = [difference(b.x, a.x), difference(b.y, a.y)];
    let [cx, cy] = [difference(c.x, a.x), difference(c.y, a.y)];
    // Each product is at most 2^60.
    if [bx, by, cx, cy].iter().all(|d| d.unsigned_abs() <= NARROW) {
        return bx * cy - by * cx;
    }
    let wide = i128::from(bx) * i128::from(cy) - i128::from(by) * i128::from(cx);
    wide.clamp(-i128::from(i64::MAX), i128::from(i64::MAX)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: i32, y: i32) -> ImagePoint {
        ImagePoint::new(x, y)
    }

    #[test]
    fn clockwise_is_from_right_to_down() {
        let [o, right, down] = [at(3, 5), at(7, 5), at(3, 8)];
        assert_eq!(orientation(o, right, down), Orientation::Clockwise);
        assert_eq!(orientation(o, down, right), Orientation::CounterClockwise);
        assert_eq!(orientation(o, down, right), orientation(o, right, down).reversed());
        assert_eq!(orientation(o, at(5, 7), at(-1, 1)), Orientation::Collinear);
        assert_eq!(twice_area(o, right, down), 12);
        assert_eq!(twice_area(right, down, o), 12);
        assert_eq!(twice_area(down, right, o), -12);
    }

    #[test]
    fn one_step_decides_at_the_limit() {
        const L: i32 = COORDINATE_LIMIT;
        let (a, b) = (at(-L, -L), at(L, L - 1));
        // The line passes half a step above the origin.
        assert_eq!(twice_area(a, b, at(0, -1)), -i64::from(L));
        assert_eq!(twice_area(a, b, at(0, 0)), i64::from(L));
        assert_eq!(orientation(a, b, at(0, -1)), Orientation::CounterClockwise);
        assert_eq!(orientation(a, b, at(0, 0)), Orientation::Clockwise);
        assert_eq!(orientation(a, at(L, L), at(0, 0)), Orientation::Collinear);
        assert_eq!(twice_area(at(-L, -L), at(L, -L), at(L, L)), 4 * i64::from(L) * i64::from(L));
    }

    #[test]
    fn every_coordinate_has_an_orientation() {
        const LEAST: i32 = i32::MIN;
        const MOST: i32 = i32::MAX;
        // The whole range: 2 (2^32 - 1)^2 / 2 does not fit, its sign does.
        assert_eq!(twice_area(at(LEAST, LEAST), at(MOST, LEAST), at(MOST, MOST)), i64::MAX);
        assert_eq!(twice_area(at(LEAST, LEAST), at(MOST, MOST), at(MOST, LEAST)), -i64::MAX);
        assert_eq!(orientation(at(LEAST, LEAST), at(MOST, MOST), at(0, 0)), Orientation::Collinear);
        assert_eq!(orientation(at(LEAST, LEAST), at(MOST, MOST), at(0, 1)), Orientation::Clockwise);
        assert_eq!(orientation(at(LEAST, LEAST), at(MOST, MOST), at(1, 0)), Orientation::CounterClockwise);
    }

    #[test]
    fn narrow_and_wide_arithmetic_agree_at_the_seam() {
        const HALF: i32 = 1 << 29;
        let wide = |a: ImagePoint, b: ImagePoint, c: ImagePoint| {
            let d = |to: i32, from: i32| i128::from(to) - i128::from(from);
            (d(b.x, a.x) * d(c.y, a.y) - d(b.y, a.y) * d(c.x, a.x)) as i64
        };
        let coordinates = [-HALF - 1, -HALF, -HALF + 1, -1, 0, 1, HALF - 1, HALF, HALF + 1];
        let points = || coordinates.iter().flat_map(|&x| coordinates.map(|y| at(x, y)));
        let a = at(-HALF, HALF);
        for b in points() {
            for c in points() {
                assert_eq!(twice_area(a, b, c), wide(a, b, c), "{b:?} {c:?}");
            }
        }
    }
}
