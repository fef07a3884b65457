//! A cheap test that five points are no image of five others, before the exact comparison: it never refuses what that
//! accepts.
//!
//! **Affine.** The comparison of four points `q` with `p` ([`Quad::deviation`](super::quad::Quad::deviation)) accepts only
//! residuals `r = sum l_i q_i` with `|r|² <= gate sigma² |l|² (1 + s²)`, `s` the larger singular value of the map's linear
//! part `L`. Of `sum l_i q_i` only two terms have area with two of the points `q_j, q_k`:
//! `l_i [q_i q_j q_k] + l_m [q_m q_j q_k] = r x (q_j - q_k)`. So the ratio of two areas of `q` that share an edge differs
//! from that of `p` by at most
//!
//! ```text
//! |r| |q_j - q_k| / (|l_m| |[q_i q_j q_k]|) <= reach(p) width(q) sqrt(1 + stretch(p)² size(q)²)
//! ```
//!
//! with `s <= |Q| / s_min(P)`, where `P` and `Q` are the triangles that make `L`, each about its centroid: `|Q|²` is a third
//! of the sum of the squared sides, and so is the sum of the squared singular values of `P`, whose product is
//! `|det| / sqrt 3`.
//!
//! **Perspective.** The squared Mahalanobis distance of two numbers is at least that of one of them alone.

use super::cross_ratio::FivePoints;
use super::predicate::twice_area;
use super::proposal::GATE;
use super::quad::Expected;
use crate::point::{ImagePoint, SUBPIXEL};

/// Room for the rounding of the bounds and of the comparison itself, relative.
const ROOM: f64 = 1.01;
/// Room for the rounding of two near ratios to `f32`: `(x + y)² <= 1.005 x² + 201 y²` with `y` four units of the last place.
const RATIO_ROOM: f32 = 1e-10;
/// Room for the rounding of a logarithm to an `f32`, bits.
const LOGARITHM_ROOM: f32 = 1e-4;

/// What the sieve knows of five points: a corner and four neighbours `a, b, c, d`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Shape {
    /// Affine: two ratios of areas, of (c, corner, a) and of (d, corner, b) to (b, c, corner).
    /// Perspective: `log2 |C2|`, and the signs of both cross-ratios.
    values: [f32; 2],
    /// Affine: the square of the longer shared edge by the area below. Perspective: the variance of the logarithm.
    width: f32,
    /// Affine: the square of the width times the size of the largest triangle.
    width_size: f32,
}

/// The square of a distance, px².
fn square(a: ImagePoint, b: ImagePoint) -> f64 {
    let unit = f64::from(SUBPIXEL);
    let (x, y) = ((f64::from(a.x) - f64::from(b.x)) / unit, (f64::from(a.y) - f64::from(b.y)) / unit);
    x * x + y * y
}

/// Twice the area, px².
fn area(a: ImagePoint, b: ImagePoint, c: ImagePoint) -> f64 {
    twice_area(a, b, c) as f64 / f64::from(SUBPIXEL * SUBPIXEL)
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Shape {
    /// The triangle (b, c, corner) must have an area.
    pub(super) fn affine([corner, a, b, c, d]: [ImagePoint; 5]) -> Self {
        let below = area(b, c, corner);
        let [to_a, to_b, to_c, to_d] = [a, b, c, d].map(|neighbour| square(corner, neighbour));
        let [ab, ac, bc, bd, cd] = [(a, b), (a, c), (b, c), (b, d), (c, d)].map(|(one, two)| square(one, two));
        // Of the corner, a, b and c, and of the corner, b, c and d.
        let triangles =
            [to_a + to_b + ab, to_a + to_c + ac, ab + bc + ac, to_b + to_d + bd, to_c + to_d + cd, bc + cd + bd];
        let largest = triangles.into_iter().fold(to_b + to_c + bc, larger);
        let width = larger(to_b, to_c) / (below * below);
        Self {
            values: [(area(c, corner, a) / below) as f32, (area(d, corner, b) / below) as f32],
            width: width as f32,
            width_size: (width * largest / 3.0) as f32,
        }
    }

    pub(super) fn perspective(five: &FivePoints, sigma: f32) -> Self {
        let (logarithm, variance, signs) = five.second(sigma);
        Self { values: [logarithm as f32, f32::from(signs)], width: variance as f32, width_size: 0.0 }
    }
}

/// A ratio, and the square of how far another may be from it.
#[derive(Debug, Clone, Copy)]
pub(super) struct RatioSieve {
    value: f32,
    room: f32,
    reach: f32,
    stretched: f32,
}

impl RatioSieve {
    #[inline(always)]
    fn passes(&self, other: f32, shape: &Shape) -> bool {
        let away = self.value - other;
        away * away <= self.room + self.reach * shape.width + self.stretched * shape.width_size
    }
}

/// What the shape of an image of five points must be like.
#[derive(Debug, Clone, Copy)]
pub(super) enum Sieve {
    Affine([RatioSieve; 2]),
    Perspective(Shape),
}

impl Sieve {
    /// For five points of this shape whose quads without `d` and without `a` expect their images so.
    pub(super) fn affine(shape: Shape, [corner, _, b, c, _]: [ImagePoint; 5], expected: &[Expected; 2]) -> Self {
        let below = area(b, c, corner);
        let [one, two] = expected;
        let [one_value, two_value] = shape.values;
        Self::Affine([(one_value, one), (two_value, two)].map(|(value, expected)| {
            let (residual, stretch) = expected.bounds(GATE);
            let reach = ROOM * residual / (below * below);
            let room = RATIO_ROOM * value * value;
            RatioSieve { value, room, reach: reach as f32, stretched: (reach * stretch) as f32 }
        }))
    }

    /// Calls `visit`, in order, with each entry that the comparison could accept.
    ///
    /// Which of a group do is found out without a branch, since most do not and chance decides.
    pub(super) fn each_passing<T>(&self, entries: &[T], shape: impl Fn(&T) -> &Shape, mut visit: impl FnMut(&T)) {
        for group in entries.chunks(u32::BITS as usize) {
            let mut passing = 0_u32;
            for (number, entry) in group.iter().enumerate() {
                passing |= u32::from(self.passes(shape(entry))) << number;
            }
            while passing != 0 {
                if let Some(entry) = group.get(passing.trailing_zeros() as usize) {
                    visit(entry);
                }
                passing &= passing - 1;
            }
        }
    }

    /// `false` only if the comparison would refuse.
    #[inline(always)]
    fn passes(&self, shape: &Shape) -> bool {
        let [first, second] = shape.values;
        match self {
            Self::Affine([one, two]) => one.passes(first, shape) & two.passes(second, shape),
            Self::Perspective(own) => {
                let away = (own.values[0] - first).abs() - LOGARITHM_ROOM;
                let variance = (ROOM * GATE) as f32 * (own.width + shape.width);
                (own.values[1] == second) & ((away <= 0.0) | (away * away <= variance))
            }
        }
    }
}
