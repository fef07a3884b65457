//! Perspective maps of the plane: homographies.

use super::moments::{Moments, Spread};
use super::{Correspondence, Family, Invariance, Invariant};
use crate::linear::NormalEquations;
use crate::math::sqrt_f64;
use crate::transform::Homography;

/// `(u, v) = ((h11 x + h12 y + h13) / w, (h21 x + h22 y + h23) / w)`, `w = h31 x + h32 y + h33`, `det H ≠ 0`: how two
/// pinhole views of a plane are related (thesis 4.2, Figs 11 and 12).
///
/// The scale of `H` means nothing, its sign does: points with `w > 0` lie in front of the camera, the others have no
/// image. Composition and inversion keep that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perspective {
    matrix: [[f64; 3]; 3],
}

/// A determinant that rounding alone could have made, as a share of the sum of its terms' magnitudes.
const SINGULAR: f64 = 1e-15;
/// The same for a fit in normalized coordinates, as a share of the cubed norm: points on a line leave about 1e-13.
const COLLINEAR: f64 = 1e-10;
/// Equations of which an unknown keeps less than this share of its own weight determine nothing: rounding of points on
/// a line, 500 px from the origin and less than 1 px apart, leaves up to 2e-9; four points, all triangles of which have a
/// hundredth of the area of their frame, leave 2e-5 and more.
const UNDETERMINED: f64 = 1e-7;

impl Perspective {
    /// `None` if the matrix is singular (its determinant is at most 1e-15 of the sum of its terms' magnitudes) or a number is
    /// not finite.
    pub fn new(matrix: [[f64; 3]; 3]) -> Option<Self> {
        let map = Self { matrix }.scaled()?;
        let [[a, b, c], [d, e, f], [g, h, i]] = map.matrix.map(|row| row.map(f64::abs));
        let terms = a * (e * i + f * h) + b * (d * i + f * g) + c * (d * h + e * g);
        (determinant(&map.matrix).abs() > SINGULAR * terms).then_some(map)
    }

    /// From numbers that are known to be right.
    pub(super) fn of_parts(matrix: [[f64; 3]; 3]) -> Self {
        Self { matrix }
    }

    /// With 1 as its largest magnitude, so that chains neither grow nor shrink; `None` if it is zero or not finite.
    fn scaled(self) -> Option<Self> {
        let entries = self.matrix.as_flattened();
        let largest = entries.iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
        let scaled = self.matrix.map(|row| row.map(|entry| entry / largest));
        scaled.as_flattened().iter().all(|entry| entry.is_finite()).then_some(Self { matrix: scaled })
    }

    /// The recognizer's map; `None` if it is singular or not finite.
    pub fn widened(map: Homography) -> Option<Self> {
        Self::new(map.0.map(|row| row.map(f64::from)))
    }

    /// For the recognizer: `h33 = 1`, every number rounded to `f32`. `None` if the origin of the source frame is not in
    /// front of the camera.
    pub fn narrowed(&self) -> Option<Homography> {
        let [.., [.., h33]] = self.matrix;
        (h33 > 0.0).then(|| Homography(self.matrix.map(|row| row.map(|entry| (entry / h33) as f32))))
    }

    /// `H`, row by row, in an arbitrary positive scale.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        self.matrix
    }

    /// The image of a point; `None` on and behind the vanishing line (`w <= 0`), and where the image is not finite.
    pub fn apply(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [u, v, w] = self.matrix.map(|[a, b, c]| a * x + b * y + c);
        let image = [u / w, v / w];
        (w > 0.0 && image.iter().all(|coordinate| coordinate.is_finite())).then_some(image)
    }
}

fn determinant([[a, b, c], [d, e, f], [g, h, i]]: &[[f64; 3]; 3]) -> f64 {
    a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
}

fn product(left: &[[f64; 3]; 3], right: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let [[a, b, c], [d, e, f], [g, h, i]] = *right;
    left.map(|[p, q, r]| [p * a + q * d + r * g, p * b + q * e + r * h, p * c + q * f + r * i])
}

impl Family for Perspective {
    const MINIMAL: usize = 4;
    const FREEDOM: usize = 8;
    const IDENTITY: Self = Self { matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    fn image(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        self.apply(point)
    }

    fn inverse(&self) -> Option<Self> {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.matrix;
        // The adjugate, with the determinant's sign: a point in front of one camera is in front of the other.
        let adjugate = [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ];
        let sign = if determinant(&self.matrix) < 0.0 { -1.0 } else { 1.0 };
        Self { matrix: adjugate.map(|row| row.map(|entry| sign * entry)) }.scaled()
    }

    fn after(&self, first: &Self) -> Self {
        let map = Self { matrix: product(&self.matrix, &first.matrix) };
        map.scaled().unwrap_or(map)
    }

    /// The direct linear transform in normalized coordinates (Hartley and Zisserman, Multiple View Geometry, 4.1 and 4.4):
    /// the least squared distance in the target frame, weighted with `w²`; exact for four pairs. `h33 = 1` about the
    /// centroid loses nothing, because `w` there is the mean of all `w`, which must be positive.
    ///
    /// `None` also if three of four points, or all but one, lie on a line in either frame, and if a point would have to pass
    /// through the vanishing line: no camera sees a plane so.
    fn fit(pairs: &[Correspondence]) -> Option<Self> {
        let moments = Moments::of(pairs).filter(|_| pairs.len() >= Self::MINIMAL)?;
        if !(moments.from.spans_plane() && moments.to.spans_plane()) {
            return None;
        }
        // The target about its centroid with mean squared distance 2; the source so that its second moments are those of a
        // circle, which leaves the error as it is and tells thin point sets from degenerate ones.
        let t = sqrt_f64(2.0 * moments.count / moments.to.total());
        let ([x0, y0], [u0, v0]) = (moments.from_centre, moments.to_centre);
        let Spread { xx, xy, .. } = moments.from;
        let (along, shear) = (sqrt_f64(moments.count / xx), xy / xx);
        let across = sqrt_f64(moments.count * xx / moments.from.determinant());
        let normalized = |pair: &Correspondence| {
            let ([x, y], [u, v]) = ([pair.from[0] - x0, pair.from[1] - y0], pair.to);
            ([along * x, across * (y - shear * x)], [t * (u - u0), t * (v - v0)])
        };
        let mut equations = NormalEquations::<8>::new();
        for pair in pairs {
            let ([x, y], [u, v]) = normalized(pair);
            equations.add(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, 1.0);
            equations.add(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, 1.0);
        }
        let &[a, b, c, d, e, f, g, i] = equations.solve()?;
        if !(equations.determinacy() > UNDETERMINED) {
            return None;
        }
        if !pairs.iter().all(|pair| {
            let ([x, y], _) = normalized(pair);
            g * x + i * y + 1.0 > 0.0
        }) {
            return None;
        }
        let inner = [[a, b, c], [d, e, f], [g, i, 1.0]];
        let norm = sqrt_f64(inner.as_flattened().iter().fold(0.0, |sum, entry| sum + entry * entry));
        if !(determinant(&inner).abs() > COLLINEAR * norm * norm * norm) {
            return None;
        }
        let (left, down) = (-across * shear, across * (shear * x0 - y0));
        let to_normalized = [[along, 0.0, -along * x0], [left, across, down], [0.0, 0.0, 1.0]];
        let from_normalized = [[1.0 / t, 0.0, u0], [0.0, 1.0 / t, v0], [0.0, 0.0, 1.0]];
        Self { matrix: product(&product(&from_normalized, &inner), &to_normalized) }.scaled()
    }

    fn determinant(&self) -> Option<f64> {
        None
    }

    fn invariance(invariant: Invariant) -> Invariance {
        match invariant {
            Invariant::CrossRatios => Invariance::Absolute,
            _ => Invariance::Broken,
        }
    }
}
