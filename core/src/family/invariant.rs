//! Quantities of a few points that a family of maps keeps, or changes by a known factor (thesis 4.1, 4.2, 5.1).
//!
//! All are `None` where they are not defined: coincident points, a zero denominator, numbers that are not finite.

use crate::math::sqrt_f64;

type Point = [f64; 2];

/// How maps of a family change an invariant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Invariance {
    /// Not at all.
    Absolute,
    /// By `|det|^(half_powers / 2)` of the map's linear part, whatever the points: lengths by 1/2, areas (with the
    /// determinant's sign) by 1.
    Relative {
        /// The power of the determinant, in halves.
        half_powers: u8,
    },
    /// By a factor that depends on the points.
    Broken,
}

/// The invariants of chapter 4.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Invariant {
    /// [`length`]: 2 points.
    Length,
    /// [`angle`]: 3 points.
    Angle,
    /// [`length_ratio`]: 3 points.
    LengthRatio,
    /// [`area`]: 3 points.
    Area,
    /// [`area_ratio`]: 4 points.
    AreaRatio,
    /// [`cross_ratios`]: 5 points.
    CrossRatios,
}

impl Invariant {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Length, Self::Angle, Self::LengthRatio, Self::Area, Self::AreaRatio, Self::CrossRatios];

    /// How many points it is of.
    pub const fn points(self) -> usize {
        match self {
            Self::Length => 2,
            Self::Angle | Self::LengthRatio | Self::Area => 3,
            Self::AreaRatio => 4,
            Self::CrossRatios => 5,
        }
    }

    /// Its value for the first [`Self::points`] of the points; the second number is 0 where there is but one.
    pub fn measure(self, points: [Point; 5]) -> Option<[f64; 2]> {
        if !points.as_flattened().iter().take(2 * self.points()).all(|coordinate| coordinate.is_finite()) {
            return None;
        }
        let [a, b, c, d, e] = points;
        let one = |value: f64| [value, 0.0];
        match self {
            Self::Length => finite(length([a, b])).map(one),
            Self::Angle => angle([a, b, c]),
            Self::LengthRatio => length_ratio([a, b, c]).map(one),
            Self::Area => finite(area([a, b, c])).map(one),
            Self::AreaRatio => area_ratio(&[a, b, c, d]).map(one),
            Self::CrossRatios => cross_ratios(&[a, b, c, d, e]),
        }
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// A quotient that is defined.
fn quotient(value: f64, by: f64) -> Option<f64> {
    if by == 0.0 { None } else { finite(value / by) }
}

fn difference([x, y]: Point, [from_x, from_y]: Point) -> Point {
    [x - from_x, y - from_y]
}

/// Distance of two points.
pub fn length([a, b]: [Point; 2]) -> f64 {
    let [x, y] = difference(b, a);
    sqrt_f64(x * x + y * y)
}

/// Cosine and sine of the angle at `b` from `a` to `c`, positive from +x to +y.
pub fn angle([a, b, c]: [Point; 3]) -> Option<[f64; 2]> {
    let ([ax, ay], [cx, cy]) = (difference(a, b), difference(c, b));
    let both = length([b, a]) * length([b, c]);
    Some([quotient(ax * cx + ay * cy, both)?, quotient(ax * cy - ay * cx, both)?])
}

/// `|ab| / |bc|`.
pub fn length_ratio([a, b, c]: [Point; 3]) -> Option<f64> {
    quotient(length([a, b]), length([b, c]))
}

/// Area of the triangle, positive if a, b, c turn from +x to +y.
pub fn area([a, b, c]: [Point; 3]) -> f64 {
    let ([bx, by], [cx, cy]) = (difference(b, a), difference(c, a));
    (bx * cy - by * cx) / 2.0
}

/// `area(a, b, c) / area(b, c, d)`: I(k) of four consecutive vertices (thesis 5.1).
pub fn area_ratio(&[a, b, c, d]: &[Point; 4]) -> Option<f64> {
    quotient(area([a, b, c]), area([b, c, d]))
}

/// The two independent cross-ratios of five points of a plane, no three on a line:
/// `|431||521| / (|421||531|)` and `|421||532| / (|432||521|)`, where `|ijk|` is the area of points i, j, k.
///
/// Each point stands as often above as below, so its denominator under a projective map cancels, and so does the map's
/// determinant. Mundy and Zisserman, Geometric Invariance in Computer Vision (1992), chapter 1, section 1.3.
pub fn cross_ratios(&[p1, p2, p3, p4, p5]: &[Point; 5]) -> Option<[f64; 2]> {
    let (a431, a521, a421) = (area([p4, p3, p1]), area([p5, p2, p1]), area([p4, p2, p1]));
    let (a531, a532, a432) = (area([p5, p3, p1]), area([p5, p3, p2]), area([p4, p3, p2]));
    Some([quotient(a431 * a521, a421 * a531)?, quotient(a421 * a532, a432 * a521)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_by_hand() {
        let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        assert_eq!(length([a, c]), 5.0);
        assert_eq!(angle([a, b, c]), Some([0.0, -1.0]));
        assert_eq!(angle([b, a, c]), Some([0.8, 0.6]));
        assert_eq!(length_ratio([a, b, c]), Some(4.0 / 3.0));
        assert_eq!((area([a, b, c]), area([a, c, b])), (6.0, -6.0));
        assert_eq!(area_ratio(&[a, b, c, d]), Some(1.0));
        // |431|, |521|, |421|, |531|, |532|, |432|.
        let e = [1.0, 2.0];
        let areas = [[d, c, a], [e, b, a], [d, b, a], [e, c, a], [e, c, b], [d, c, b]].map(area);
        assert_eq!(areas, [-6.0, -4.0, -6.0, -2.5, -4.5, -6.0]);
        assert_eq!(cross_ratios(&[a, b, c, d, e]), Some([24.0 / 15.0, 27.0 / 24.0]));
    }

    #[test]
    fn what_is_not_defined() {
        let (a, b) = ([1.0, 2.0], [3.0, 5.0]);
        assert_eq!((angle([a, a, b]), length_ratio([a, b, b])), (None, None));
        assert_eq!(area_ratio(&[[0.0, 1.0], a, b, a]), None);
        assert_eq!(cross_ratios(&[a, b, a, b, [0.0, 0.0]]), None);
        assert_eq!(Invariant::Length.measure([a, [f64::NAN, 0.0], a, a, a]), None);
        assert_eq!(Invariant::Length.measure([a, [f64::MAX, 0.0], a, a, a]), None);
    }
}
