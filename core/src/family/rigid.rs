//! Rotations with a translation.

use super::moments::Moments;
use super::{Affine, Correspondence, Family, Invariance, Invariant, Perspective, Similarity};
use crate::math::sqrt_f64;

/// `R x + t`, `R = (c -s; s c)` with `c² + s² = 1`, no reflection (thesis 4.2, Fig 8).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid {
    direction: [f64; 2],
    translation: [f64; 2],
}

impl Rigid {
    /// Turns the x axis into a direction, of any length: cosine and sine of the angle, positive from +x to +y. `None` for
    /// a direction of length 0 and for numbers that are not finite.
    pub fn new(direction: [f64; 2], translation: [f64; 2]) -> Option<Self> {
        let [c, s] = direction;
        let norm = sqrt_f64(c * c + s * s);
        let finite = norm.is_finite() && translation.iter().all(|t| t.is_finite());
        (finite && norm > 0.0).then(|| Self { direction: [c / norm, s / norm], translation })
    }

    /// Cosine and sine of the angle, positive from +x to +y.
    pub fn direction(&self) -> [f64; 2] {
        self.direction
    }

    /// `t`, in the target frame.
    pub fn translation(&self) -> [f64; 2] {
        self.translation
    }

    /// The image of a point.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([c, s], [u, v]) = (self.direction, self.translation);
        [c * x - s * y + u, s * x + c * y + v]
    }
}

impl Family for Rigid {
    const MINIMAL: usize = 2;
    const FREEDOM: usize = 3;
    const IDENTITY: Self = Self { direction: [1.0, 0.0], translation: [0.0, 0.0] };

    fn image(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        Some(self.apply(point))
    }

    fn inverse(&self) -> Option<Self> {
        let ([c, s], [u, v]) = (self.direction, self.translation);
        Self::new([c, -s], [-(c * u + s * v), s * u - c * v])
    }

    /// The direction is scaled to length 1 again, so that chains do not grow or shrink.
    fn after(&self, first: &Self) -> Self {
        let ([c, s], [d, r]) = (self.direction, first.direction);
        let [x, y] = [c * d - s * r, s * d + c * r];
        let norm = sqrt_f64(x * x + y * y);
        Self { direction: [x / norm, y / norm], translation: self.apply(first.translation) }
    }

    /// Least squared distance in the target frame: Umeyama's closed form (IEEE PAMI 13(4), 1991) without scale, in the
    /// plane, where the best rotation is the direction of `(Σ x·u, Σ x×u)` and needs no singular values. Two pairs
    /// determine a map and overdetermine its three numbers: their distances need not agree. `None` also if no rotation is
    /// better than another, as for the mirror image of a symmetrical figure.
    fn fit(pairs: &[Correspondence]) -> Option<Self> {
        let moments = Moments::of(pairs).filter(|_| pairs.len() >= Self::MINIMAL)?;
        let [c, s] = rotation(&moments)?;
        let rotation = Self::new([c, s], [0.0; 2])?;
        let [c, s] = rotation.direction;
        Self::new([c, s], moments.translation([[c, -s], [s, c]]))
    }

    fn determinant(&self) -> Option<f64> {
        Some(1.0)
    }

    fn invariance(_: Invariant) -> Invariance {
        Invariance::Absolute
    }
}

/// `(Σ x·u, Σ x×u)` about the centroids; `None` if it is no direction.
pub(super) fn rotation(moments: &Moments) -> Option<[f64; 2]> {
    /// Rounding makes 1e-16 of the two extents.
    const NO_DIRECTION: f64 = 1e-12;
    let [[ux, uy], [vx, vy]] = moments.cross;
    let (c, s) = (ux + vy, vx - uy);
    let least = NO_DIRECTION * NO_DIRECTION * moments.from.total() * moments.to.total();
    (moments.from.has_extent() && moments.to.has_extent() && c * c + s * s > least).then_some([c, s])
}

impl From<Rigid> for Similarity {
    fn from(map: Rigid) -> Self {
        Self::of_parts(map.direction, map.translation)
    }
}

impl From<Rigid> for Affine {
    fn from(map: Rigid) -> Self {
        Similarity::from(map).into()
    }
}

impl From<Rigid> for Perspective {
    fn from(map: Rigid) -> Self {
        Similarity::from(map).into()
    }
}
