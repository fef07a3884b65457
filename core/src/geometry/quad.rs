//! Four points in order: the areas of their triangles, the affine invariants, and the test whether two quads are affine
//! images of one another.
//!
//! The four triangles of consecutive points have the (twice, signed) areas `t0 = [p0 p1 p2]`, `t1 = [p1 p2 p3]`,
//! `t2 = [p2 p3 p0]`, `t3 = [p3 p0 p1]`, and `t0 + t2 = t1 + t3`. An affine map multiplies all of them by its
//! determinant, so ratios of areas are absolute invariants, and a quad has two independent ones (eight coordinates less
//! the six of an affine map): `I = t0 / t1`, the thesis' I(k), and `J = t3 / t1`.

use super::predicate::twice_area;
use crate::point::{ImagePoint, SUBPIXEL};

/// A ratio of two areas, kept as the two integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AreaRatio {
    /// Twice the upper area, in (1/16 px)², positive for a clockwise triangle.
    pub upper: i64,
    /// Twice the lower area.
    pub lower: i64,
}

/// A relative tolerance as a fraction, so that a comparison is decided in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tolerance {
    /// Numerator.
    pub part: u32,
    /// Denominator.
    pub whole: u32,
}

impl Tolerance {
    /// The 0.05 of the thesis, chapter 5.1. It knows nothing of noise: at 1 px it fails many true quads with a thin triangle
    /// and passes false ones of thick ones. Prefer [`Quad::deviation`].
    pub const FIVE_PERCENT: Self = Self { part: 1, whole: 20 };
}

impl AreaRatio {
    /// The thesis' rule `|I1 - I2| / |I1| < eps`, `self` being `I1`; decided exactly, by cross-multiplication in 128 bits.
    ///
    /// With `I = u / l` it reads `|u1 l2 - u2 l1| whole < part |u1 l2|`. It is not symmetric. `false` if either lower area
    /// or `self`'s upper area is zero: a degenerate triangle says nothing. Exact while the areas are below 2^47, that is,
    /// for pictures of up to 100,000 px a side; beyond, the products saturate.
    pub fn agrees(self, other: Self, eps: Tolerance) -> bool {
        if self.lower == 0 || other.lower == 0 || self.upper == 0 {
            return false;
        }
        if [self.upper, self.lower, other.upper, other.lower].iter().all(|area| area.unsigned_abs() <= 1 << 30) {
            let straight = self.upper * other.lower;
            let difference = straight - other.upper * self.lower;
            return u128::from(difference.unsigned_abs()) * u128::from(eps.whole)
                < u128::from(straight.unsigned_abs()) * u128::from(eps.part);
        }
        let straight = i128::from(self.upper).saturating_mul(i128::from(other.lower));
        let crossed = i128::from(other.upper).saturating_mul(i128::from(self.lower));
        let difference = straight.saturating_sub(crossed).saturating_abs();
        difference.saturating_mul(i128::from(eps.whole))
            < straight.saturating_abs().saturating_mul(i128::from(eps.part))
    }
}

/// Four points in order, with the areas of their four triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quad {
    points: [ImagePoint; 4],
    areas: [i64; 4],
}

/// How far two quads are from being affine images of one another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Squared Mahalanobis distance: two degrees of freedom, 2 on average for a true pair.
    pub squared: f64,
    /// Area in px² of the one-sigma ellipse in which the map of the other three points expects the least certain point.
    pub ellipse: f64,
}

impl Quad {
    /// The quad of four points in this order.
    pub fn new(points: [ImagePoint; 4]) -> Self {
        let [a, b, c, d] = points;
        let areas = [twice_area(a, b, c), twice_area(b, c, d), twice_area(c, d, a), twice_area(d, a, b)];
        Self { points, areas }
    }

    /// The points.
    pub const fn points(&self) -> [ImagePoint; 4] {
        self.points
    }

    /// Twice the signed areas `t0..t3` of the triangles of consecutive points, in (1/16 px)², positive clockwise.
    pub const fn areas(&self) -> [i64; 4] {
        self.areas
    }

    /// The thesis' invariant `I(k) = t0 / t1` (5.1, Fig 15).
    pub const fn ratio(&self) -> AreaRatio {
        AreaRatio { upper: self.areas[0], lower: self.areas[1] }
    }

    /// The second independent invariant `J = t3 / t1`.
    pub const fn second_ratio(&self) -> AreaRatio {
        AreaRatio { upper: self.areas[3], lower: self.areas[1] }
    }

    /// Standard deviation of `ln |I|` for independent noise of `sigma` px on each coordinate; infinite if a triangle
    /// vanishes. First order: good while it is below about 0.3.
    ///
    /// `d(2A) = sum over vertices of (opposite side turned by 90 degrees) . dp`, so a thin triangle is an uncertain one.
    /// The points that both triangles share enter with the difference of their gradients.
    pub fn ratio_uncertainty(&self, sigma: f32) -> f64 {
        let [t0, t1, ..] = self.areas.map(|area| area as f64);
        if t0 == 0.0 || t1 == 0.0 {
            return f64::INFINITY;
        }
        let [p0, p1, p2, p3] = self.points.map(|p| [p.x as f64, p.y as f64]);
        let side = |from: [f64; 2], to: [f64; 2]| [(to[0] - from[0]), (to[1] - from[1])];
        // The gradient of 2A at a vertex is its opposite side turned; the turn does not change a length.
        let first = [side(p1, p2), side(p2, p0), side(p0, p1)];
        let second = [side(p2, p3), side(p3, p1), side(p1, p2)];
        let [a0, a1, a2] = first.map(|g| g.map(|x| x / t0));
        let [b1, b2, b3] = second.map(|g| g.map(|x| x / t1));
        let square = |[x, y]: [f64; 2]| x * x + y * y;
        let less = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let sum = square(a0) + square(less(a1, b1)) + square(less(a2, b2)) + square(b3);
        crate::math::sqrt_f64(sum) * f64::from(sigma) * f64::from(SUBPIXEL)
    }

    /// How far `other` is from an affine image of this quad, given the noise `sigma` px of each coordinate in both.
    ///
    /// The only affine dependency of four points is `sum l_i p_i = 0` with `l = (t1, -t2, t3, -t0)`. An affine map keeps it,
    /// so `r = sum l_i q_i` vanishes for a true pair, and under noise has the covariance
    /// `sigma² |l|² (1 + L L^T)` with `L` the linear part of the map: this is both invariants at once, thin triangles included.
    /// `None` for a mirror image, and for quads without any area.
    pub fn deviation(&self, other: &Self, sigma: f32) -> Option<Deviation> {
        let expected = Expected::new(self, sigma);
        let residual = expected.residual(other.points)?;
        Some(Deviation { squared: residual.squared, ellipse: expected.ellipse(residual) })
    }
}

/// What a quad expects of its affine images, worked out once for many of them: see [`Quad::deviation`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Expected {
    /// The affine dependency `l`, px².
    weights: [f64; 4],
    /// `sigma² |l|²`.
    variance: f64,
    /// The largest weight, and whose it is: the point that the three others hold best.
    most: f64,
    held: Held,
    triangle: Triangle,
}

#[derive(Debug, Clone, Copy)]
enum Held {
    First,
    Second,
    Third,
    Fourth,
}

/// What is left of an affine image when the dependency is applied to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residual {
    /// Squared Mahalanobis distance.
    pub(super) squared: f64,
    /// Of `1 + L L^T`.
    determinant: f64,
}

impl Expected {
    /// For noise of `sigma` px on each coordinate.
    pub(super) fn new(quad: &Quad, sigma: f32) -> Self {
        let unit = f64::from(SUBPIXEL);
        let [t0, t1, t2, t3] = quad.areas.map(|area| area as f64 / (unit * unit));
        let weights = [t1, -t2, t3, -t0];
        let (mut held, mut most, mut magnitude) = (Held::First, t1, t1.abs());
        for (other, weight) in [(Held::Second, t2), (Held::Third, t3), (Held::Fourth, t0)] {
            if weight.abs() > magnitude {
                (held, most, magnitude) = (other, weight, weight.abs());
            }
        }
        let norm = weights.iter().fold(0.0, |sum, weight| sum + weight * weight);
        let variance = f64::from(sigma) * f64::from(sigma) * norm;
        Self { weights, variance, most, held, triangle: Triangle::new(held.others(quad.points.map(pixels))) }
    }

    /// How far the images of the four points are from the dependency; `None` for a mirror image, and without any area.
    pub(super) fn residual(&self, images: [ImagePoint; 4]) -> Option<Residual> {
        let images = images.map(pixels);
        let [[a, b], [c, d]] = self.triangle.linear_part(self.held.others(images))?;
        let [q0, q1, q2, q3] = images;
        let relative = |point: [f64; 2]| [point[0] - q3[0], point[1] - q3[1]];
        // The weights add up to zero: any origin will do, and a near one keeps the digits.
        let [x, y] = [q0, q1, q2]
            .map(relative)
            .into_iter()
            .zip(self.weights)
            .fold([0.0, 0.0], |[x, y], (q, weight)| [x + weight * q[0], y + weight * q[1]]);
        let (xx, xy, yy) = (1.0 + a * a + b * b, a * c + b * d, 1.0 + c * c + d * d);
        let determinant = xx * yy - xy * xy;
        if !(self.variance > 0.0 && determinant > 0.0) {
            return None;
        }
        let squared = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (determinant * self.variance);
        Some(Residual { squared, determinant })
    }

    /// The square of the longest residual within a squared distance of `gate` for a map that shrinks all to nothing, px⁶; and
    /// the inverse square of the smaller singular value of the triangle that makes the map's linear part, about its centroid.
    pub(super) fn bounds(&self, gate: f64) -> (f64, f64) {
        let Triangle { edges: [[ux, uy], [vx, vy]], area } = self.triangle;
        let [wx, wy] = [ux - vx, uy - vy];
        let trace = (ux * ux + uy * uy + vx * vx + vy * vy + wx * wx + wy * wy) / 3.0;
        let determinant = area * area / 3.0;
        let root = crate::math::sqrt_f64(trace * trace - 4.0 * determinant);
        (gate * self.variance, (trace + root) / (2.0 * determinant))
    }

    /// Area in px² of the one-sigma ellipse in which the least certain point is expected.
    pub(super) fn ellipse(&self, residual: Residual) -> f64 {
        let root = crate::math::sqrt_f64(residual.determinant);
        core::f64::consts::PI * self.variance * root / (self.most * self.most)
    }
}

impl Held {
    /// The other three points, in cyclic order.
    const fn others<T: Copy>(self, [a, b, c, d]: [T; 4]) -> [T; 3] {
        match self {
            Self::First => [b, c, d],
            Self::Second => [c, d, a],
            Self::Third => [d, a, b],
            Self::Fourth => [a, b, c],
        }
    }
}

fn pixels(point: ImagePoint) -> [f64; 2] {
    let unit = f64::from(SUBPIXEL);
    [f64::from(point.x) / unit, f64::from(point.y) / unit]
}

/// Two edges of a triangle and twice its area, px.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    edges: [[f64; 2]; 2],
    area: f64,
}

impl Triangle {
    fn new([o, a, b]: [[f64; 2]; 3]) -> Self {
        let edges @ [[ux, uy], [vx, vy]] = [[a[0] - o[0], a[1] - o[1]], [b[0] - o[0], b[1] - o[1]]];
        Self { edges, area: ux * vy - uy * vx }
    }

    /// `L` of the affine map to three other points; `None` for collinear points and mirror images.
    fn linear_part(&self, to: [[f64; 2]; 3]) -> Option<[[f64; 2]; 2]> {
        let Self { edges: [[ux, uy], [vx, vy]], area } = *self;
        let Self { edges: [[gx, gy], [hx, hy]], area: image } = Self::new(to);
        if area == 0.0 || !(image / area > 0.0) {
            return None;
        }
        Some([
            [(gx * vy - hx * uy) / area, (hx * ux - gx * vx) / area],
            [(gy * vy - hy * uy) / area, (hy * ux - gy * vx) / area],
        ])
    }
}
