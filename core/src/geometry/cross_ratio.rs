//! Five points of a plane: the two cross-ratios that every perspective view of them keeps.
//!
//! `C1 = [p0 p1 p2] [p0 p3 p4] / ([p0 p1 p3] [p0 p2 p4])` is the cross-ratio of the pencil from `p0` to the others, and
//! `C2` the one from `p1` (Mundy and Zisserman, "Geometric Invariance in Computer Vision", 1992, chapter 23; brackets are
//! areas). Ten coordinates less the eight of a homography leave these two. They need one point more than affine
//! invariants and are less certain: an option where the perspective is strong.

use super::predicate::twice_area;
use crate::math::{log2, sqrt_f64};
use crate::point::{ImagePoint, SUBPIXEL};

/// Natural logarithms of the cross-ratios of buildings' corners lie within about this range, for chance.
const RANGE: f64 = 4.0;

/// Five points in order with their cross-ratios.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FivePoints {
    /// ln |C1| and ln |C2|.
    logarithms: [f64; 2],
    /// Whether C1 and C2 are negative.
    negative: [bool; 2],
    /// Their covariance (xx, xy, yy) for noise of 1 px on each coordinate, to first order.
    covariance: [f64; 3],
}

/// How far two sets of five points are from being perspective views of one another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerspectiveDeviation {
    /// Squared Mahalanobis distance: two degrees of freedom, 2 on average for a true pair.
    pub squared: f64,
    /// Bits of surprise that two sets agree within a squared distance of 1; a gate of `g` costs `log2 g` of them.
    pub bits: f64,
}

impl FivePoints {
    /// The cross-ratios of five points. `None` if three of those that an area needs are on a line.
    pub fn new(points: [ImagePoint; 5]) -> Option<Self> {
        let [p0, p1, p2, p3, p4] = points;
        // Each cross-ratio: two areas above, two below; which points, in order.
        let pencils = [
            [([0, 1, 2], 1.0), ([0, 3, 4], 1.0), ([0, 1, 3], -1.0), ([0, 2, 4], -1.0)],
            [([1, 0, 2], 1.0), ([1, 3, 4], 1.0), ([1, 0, 3], -1.0), ([1, 2, 4], -1.0)],
        ];
        let place = |number: usize| match number {
            0 => p0,
            1 => p1,
            2 => p2,
            3 => p3,
            _ => p4,
        };
        let mut logarithms = [0.0; 2];
        let mut negative = [false; 2];
        let mut gradients = [[[0.0_f64; 2]; 5]; 2];
        for (((logarithm, negative), gradient), areas) in
            logarithms.iter_mut().zip(&mut negative).zip(&mut gradients).zip(pencils)
        {
            for (corners, power) in areas {
                let [a, b, c] = corners.map(place);
                let area = twice_area(a, b, c) as f64;
                if area == 0.0 {
                    return None;
                }
                *logarithm += power * log2(area.abs()) / core::f64::consts::LOG2_E;
                *negative ^= area < 0.0;
                // d ln(2A) / da is the opposite side, turned by 90 degrees, over 2A; in 1/px.
                let unit = f64::from(SUBPIXEL);
                let side = |from: ImagePoint, to: ImagePoint| {
                    [-f64::from(to.y - from.y) * unit, f64::from(to.x - from.x) * unit]
                };
                for (corner, [x, y]) in corners.into_iter().zip([side(b, c), side(c, a), side(a, b)]) {
                    if let Some(sum) = gradient.get_mut(corner) {
                        sum[0] += power * x / area;
                        sum[1] += power * y / area;
                    }
                }
            }
        }
        let [one, two] = &gradients;
        let dot = |a: &[[f64; 2]; 5], b: &[[f64; 2]; 5]| {
            a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a[0] * b[0] + a[1] * b[1])
        };
        Some(Self { logarithms, negative, covariance: [dot(one, one), dot(one, two), dot(two, two)] })
    }

    /// `ln |C1|`.
    pub const fn key(&self) -> f64 {
        self.logarithms[0]
    }

    /// Standard deviation of [`Self::key`] for noise of `sigma` px on each coordinate.
    pub fn key_uncertainty(&self, sigma: f32) -> f64 {
        f64::from(sigma) * sqrt_f64(self.covariance[0])
    }

    /// `log2 |C2|`, its variance in bits² for noise of `sigma` px, and the signs of both cross-ratios as a number. Where
    /// noise moves both cross-ratios almost as one the variance is infinite, since a distance by both is not exact then.
    pub(super) fn second(&self, sigma: f32) -> (f64, f64, u8) {
        const DEPENDENT: f64 = 1.0 - 1e-6;
        let bits = core::f64::consts::LOG2_E;
        let [xx, xy, yy] = self.covariance;
        let variance = f64::from(sigma) * f64::from(sigma) * yy * bits * bits;
        let independent = xy * xy <= DEPENDENT * xx * yy;
        let [one, two] = self.negative.map(u8::from);
        (self.logarithms[1] * bits, if independent { variance } else { f64::INFINITY }, one + 2 * two)
    }

    /// How far `other` is from a perspective view of these points, given the noise `sigma` px of each coordinate in
    /// both. `None` if a cross-ratio has another sign, or nothing is certain.
    pub fn deviation(&self, other: &Self, sigma: f32) -> Option<PerspectiveDeviation> {
        if self.negative != other.negative {
            return None;
        }
        let variance = f64::from(sigma) * f64::from(sigma);
        let [a, b] = [0, 1].map(|k: usize| {
            let of = |points: &Self| if k == 0 { points.logarithms[0] } else { points.logarithms[1] };
            of(self) - of(other)
        });
        let sum = |one: f64, two: f64| variance * (one + two);
        let [[xx, xy, yy], [other_xx, other_xy, other_yy]] = [self.covariance, other.covariance];
        let (xx, xy, yy) = (sum(xx, other_xx), sum(xy, other_xy), sum(yy, other_yy));
        let determinant = xx * yy - xy * xy;
        if !(determinant > 0.0) {
            return None;
        }
        let squared = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / determinant;
        let bits = log2(RANGE * RANGE / (core::f64::consts::PI * sqrt_f64(determinant)));
        Some(PerspectiveDeviation { squared, bits })
    }
}
