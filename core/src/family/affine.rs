//! Affine maps of the plane.

use super::moments::Moments;
use super::{Correspondence, Family, Invariance, Invariant, Perspective};
use crate::transform;

/// `L x + t` with `det L ≠ 0` (thesis 4.2, Fig 10); mirror images, with `det L < 0`, included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    linear: [[f64; 2]; 2],
    translation: [f64; 2],
}

/// A determinant that is as good as none, as a share of the squared norm of `L`.
const SINGULAR: f64 = 1e-14;

impl Affine {
    /// `None` if `|det L|` is at most 1e-14 of the squared norm of `L`, or a number is not finite.
    pub fn new(linear: [[f64; 2]; 2], translation: [f64; 2]) -> Option<Self> {
        let map = Self { linear, translation };
        let norm = linear.as_flattened().iter().fold(0.0, |sum, entry| sum + entry * entry);
        let finite = norm.is_finite() && translation.iter().all(|t| t.is_finite());
        (finite && map.area().abs() > SINGULAR * norm).then_some(map)
    }

    /// From numbers that are known to be right.
    pub(super) fn of_parts(linear: [[f64; 2]; 2], translation: [f64; 2]) -> Self {
        Self { linear, translation }
    }

    /// The recognizer's map, exactly; `None` if it is singular or not finite.
    pub fn widened(map: transform::Affine) -> Option<Self> {
        Self::new(map.linear.map(|row| row.map(f64::from)), map.translation.map(f64::from))
    }

    /// For the recognizer: every number rounded to `f32`.
    pub fn narrowed(&self) -> transform::Affine {
        transform::Affine {
            linear: self.linear.map(|row| row.map(|entry| entry as f32)),
            translation: self.translation.map(|t| t as f32),
        }
    }

    fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.linear;
        a * d - b * c
    }

    /// `L`, row by row.
    pub fn linear(&self) -> [[f64; 2]; 2] {
        self.linear
    }

    /// `t`, in the target frame.
    pub fn translation(&self) -> [f64; 2] {
        self.translation
    }

    /// The image of a point.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([[a, b], [c, d]], [u, v]) = (self.linear, self.translation);
        [a * x + b * y + u, c * x + d * y + v]
    }
}

impl Family for Affine {
    const MINIMAL: usize = 3;
    const FREEDOM: usize = 6;
    const IDENTITY: Self = Self { linear: [[1.0, 0.0], [0.0, 1.0]], translation: [0.0, 0.0] };

    fn image(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        Some(self.apply(point))
    }

    fn inverse(&self) -> Option<Self> {
        let ([[a, b], [c, d]], [u, v], area) = (self.linear, self.translation, self.area());
        let [[a, b], [c, d]] = [[d / area, -b / area], [-c / area, a / area]];
        Self::new([[a, b], [c, d]], [-(a * u + b * v), -(c * u + d * v)])
    }

    fn after(&self, first: &Self) -> Self {
        let ([[a, b], [c, d]], [[e, f], [g, h]]) = (self.linear, first.linear);
        let linear = [[a * e + b * g, a * f + b * h], [c * e + d * g, c * f + d * h]];
        Self { linear, translation: self.apply(first.translation) }
    }

    /// Least squared distance in the target frame, `L = (Σ u xᵀ)(Σ x xᵀ)⁻¹` about the centroids; exact for three pairs.
    /// `None` also if the points of either frame lie on one line (to 1e-7 of its length).
    fn fit(pairs: &[Correspondence]) -> Option<Self> {
        let moments = Moments::of(pairs).filter(|_| pairs.len() >= Self::MINIMAL)?;
        if !(moments.from.spans_plane() && moments.to.spans_plane()) {
            return None;
        }
        let (from, determinant) = (moments.from, moments.from.determinant());
        let linear = moments
            .cross
            .map(|[p, q]| [(p * from.yy - q * from.xy) / determinant, (q * from.xx - p * from.xy) / determinant]);
        Self::new(linear, moments.translation(linear))
    }

    fn determinant(&self) -> Option<f64> {
        Some(self.area())
    }

    fn invariance(invariant: Invariant) -> Invariance {
        match invariant {
            Invariant::Length | Invariant::Angle | Invariant::LengthRatio => Invariance::Broken,
            Invariant::Area => Invariance::Relative { half_powers: 2 },
            Invariant::AreaRatio | Invariant::CrossRatios => Invariance::Absolute,
        }
    }
}

impl From<Affine> for Perspective {
    fn from(map: Affine) -> Self {
        let ([[a, b], [c, d]], [u, v]) = (map.linear, map.translation);
        Self::of_parts([[a, b, u], [c, d, v], [0.0, 0.0, 1.0]])
    }
}
