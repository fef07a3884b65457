//! Rotations with a scale and a translation.

use super::moments::Moments;
use super::rigid::rotation;
use super::{Affine, Correspondence, Family, Invariance, Invariant, Perspective};
use crate::math::sqrt_f64;

/// `α R x + t`, `α R = (a -b; b a)`, α > 0, no reflection (thesis 4.2, Fig 9).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    turned: [f64; 2],
    translation: [f64; 2],
}

impl Similarity {
    /// Turns and scales the x axis to `turned = (α cos, α sin)`; angles are positive from +x to +y. `None` for α = 0 and
    /// for numbers that are not finite.
    pub fn new(turned: [f64; 2], translation: [f64; 2]) -> Option<Self> {
        let map = Self { turned, translation };
        let area = map.area();
        (area > 0.0 && area.is_finite() && translation.iter().all(|t| t.is_finite())).then_some(map)
    }

    /// From numbers that are known to be right.
    pub(super) fn of_parts(turned: [f64; 2], translation: [f64; 2]) -> Self {
        Self { turned, translation }
    }

    fn area(&self) -> f64 {
        let [a, b] = self.turned;
        a * a + b * b
    }

    /// α.
    pub fn scale(&self) -> f64 {
        sqrt_f64(self.area())
    }

    /// `(α cos, α sin)`: the image of the x axis.
    pub fn turned(&self) -> [f64; 2] {
        self.turned
    }

    /// `t`, in the target frame.
    pub fn translation(&self) -> [f64; 2] {
        self.translation
    }

    /// The image of a point.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([a, b], [u, v]) = (self.turned, self.translation);
        [a * x - b * y + u, b * x + a * y + v]
    }
}

impl Family for Similarity {
    const MINIMAL: usize = 2;
    const FREEDOM: usize = 4;
    const IDENTITY: Self = Self { turned: [1.0, 0.0], translation: [0.0, 0.0] };

    fn image(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        Some(self.apply(point))
    }

    fn inverse(&self) -> Option<Self> {
        let ([a, b], [u, v], area) = (self.turned, self.translation, self.area());
        let [c, s] = [a / area, b / area];
        Self::new([c, -s], [-(c * u + s * v), s * u - c * v])
    }

    fn after(&self, first: &Self) -> Self {
        let ([a, b], [c, d]) = (self.turned, first.turned);
        Self { turned: [a * c - b * d, b * c + a * d], translation: self.apply(first.translation) }
    }

    /// Least squared distance in the target frame: Umeyama's closed form (IEEE PAMI 13(4), 1991) in the plane; exact for
    /// two pairs. `None` also if no rotation is better than another.
    fn fit(pairs: &[Correspondence]) -> Option<Self> {
        let moments = Moments::of(pairs).filter(|_| pairs.len() >= Self::MINIMAL)?;
        let total = moments.from.total();
        let [a, b] = rotation(&moments)?.map(|sum| sum / total);
        Self::new([a, b], moments.translation([[a, -b], [b, a]]))
    }

    fn determinant(&self) -> Option<f64> {
        Some(self.area())
    }

    fn invariance(invariant: Invariant) -> Invariance {
        match invariant {
            Invariant::Length => Invariance::Relative { half_powers: 1 },
            Invariant::Area => Invariance::Relative { half_powers: 2 },
            _ => Invariance::Absolute,
        }
    }
}

impl From<Similarity> for Affine {
    fn from(map: Similarity) -> Self {
        let [a, b] = map.turned;
        Self::of_parts([[a, -b], [b, a]], map.translation)
    }
}

impl From<Similarity> for Perspective {
    fn from(map: Similarity) -> Self {
        Affine::from(map).into()
    }
}
