//! A cloud of points with gray levels, ready to be compared.

use nalgebra::{Matrix3, Vector3};

use crate::synthesize::dense::DenseCloud;
use daymark_numerics::nearest::NearestPoints;

/// Points of a model with what is known of each.
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Positions, in units of the model.
    pub positions: Vec<[f32; 3]>,
    /// Gray levels, 0 black to 1 white; NaN where unknown.
    pub gray: Vec<f32>,
    /// Root mean square deviation of the positions; 0 if unknown.
    pub deviation: f64,
    /// Answers which point is nearest.
    pub tree: NearestPoints,
}

impl Cloud {
    /// A cloud with its tree.
    pub fn new(positions: Vec<[f32; 3]>, gray: Vec<f32>, deviation: f64) -> Self {
        let tree = NearestPoints::new(&positions);
        Self { positions, gray, deviation, tree }
    }

    /// The points of a dense cloud that lie on a triangle.
    pub fn of_dense(dense: &DenseCloud) -> Self {
        let cloud = Self::asking(dense);
        Self::new(cloud.positions, cloud.gray, cloud.deviation)
    }

    /// The same without a tree: it asks others, and is not asked.
    pub fn asking(dense: &DenseCloud) -> Self {
        let mut used = vec![false; dense.positions.len()];
        for &point in dense.triangles.iter().flatten() {
            used[point as usize] = true;
        }
        let kept = |number: &usize| used[*number];
        let numbers = || (0..used.len()).filter(kept);
        let squares: f64 = numbers().map(|n| f64::from(dense.deviations[n]) * f64::from(dense.deviations[n])).sum();
        let positions: Vec<_> = numbers().map(|n| dense.positions[n]).collect();
        let deviation = libm::sqrt(squares / positions.len().max(1) as f64);
        let gray = numbers().map(|n| dense.gray[n]).collect();
        Self { positions, gray, deviation, tree: NearestPoints::new(&[]) }
    }

    /// The middle of all points.
    pub fn centroid(&self) -> Vector3<f64> {
        let sum = self.positions.iter().fold(Vector3::zeros(), |sum, &point| sum + vector(point));
        sum / self.positions.len().max(1) as f64
    }

    /// Lowest and highest coordinates.
    pub fn extent(&self) -> [Vector3<f64>; 2] {
        let infinite = Vector3::repeat(f64::INFINITY);
        self.positions
            .iter()
            .fold([infinite, -infinite], |[low, high], &point| [low.inf(&vector(point)), high.sup(&vector(point))])
    }

    /// At most `count` points, evenly taken from the order.
    pub fn sample(&self, count: usize) -> Vec<[f32; 3]> {
        let step = self.positions.len().div_ceil(count.max(1)).max(1);
        self.positions.iter().copied().step_by(step).collect()
    }
}

pub(super) fn vector(point: [f32; 3]) -> Vector3<f64> {
    Vector3::from(point.map(f64::from))
}

/// `x -> s R x + t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// `s`.
    pub scale: f64,
    /// `R`.
    pub rotation: Matrix3<f64>,
    /// `t`.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// A shift.
    pub fn shift(translation: Vector3<f64>) -> Self {
        Self { scale: 1.0, rotation: Matrix3::identity(), translation }
    }

    /// The image of a point.
    pub fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point * self.scale + self.translation
    }

    /// The image of a cloud's point.
    pub fn apply_f32(&self, point: [f32; 3]) -> [f32; 3] {
        <[f64; 3]>::from(self.apply(&vector(point))).map(|c| c as f32)
    }

    /// The map back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        let scale = 1.0 / self.scale;
        Self { scale, rotation, translation: -(rotation * self.translation * scale) }
    }

    /// The similarity with the least sum of squared distances from `from` to `to` (Umeyama, PAMI 1991); a rigid motion if
    /// `rigid`. `None` for fewer than three pairs, or if the points of `from` fall on one another.
    pub fn fit(from: &[Vector3<f64>], to: &[Vector3<f64>], rigid: bool) -> Option<Self> {
        let count = from.len().min(to.len());
        if count < 3 {
            return None;
        }
        let mean = |points: &[Vector3<f64>]| {
            points.iter().take(count).fold(Vector3::zeros(), |sum, point| sum + point) / count as f64
        };
        let (a, b) = (mean(from), mean(to));
        let mut covariance = Matrix3::zeros();
        let mut variance = 0.0;
        for (p, q) in from.iter().zip(to) {
            covariance += (q - b) * (p - a).transpose();
            variance += (p - a).norm_squared();
        }
        if !(variance > 0.0) {
            return None;
        }
        let svd = covariance.svd(true, true);
        let (u, v) = (svd.u?, svd.v_t?);
        let mut signs = Vector3::repeat(1.0);
        if (u.determinant() * v.determinant()) < 0.0 {
            signs[svd.singular_values.imin()] = -1.0;
        }
        let rotation = u * Matrix3::from_diagonal(&signs) * v;
        let scale = if rigid { 1.0 } else { svd.singular_values.dot(&signs) / variance };
        (scale > 0.0).then(|| Self { scale, rotation, translation: b - rotation * a * scale })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_similarity_is_found_again() {
        let rotation = *nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0).matrix();
        let truth = Similarity { scale: 1.7, rotation, translation: Vector3::new(4.0, -2.0, 0.5) };
        let from: Vec<_> =
            (0..9).map(|i| Vector3::new(f64::from(i % 3), f64::from(i / 3), f64::from(i * i % 5))).collect();
        let to: Vec<_> = from.iter().map(|point| truth.apply(point)).collect();
        let found = Similarity::fit(&from, &to, false).unwrap();
        assert!((found.scale - 1.7).abs() < 1e-12 && (found.rotation - rotation).norm() < 1e-12, "{found:?}");
        for (a, b) in from.iter().zip(&to) {
            assert!((found.inverse().apply(b) - a).norm() < 1e-12);
        }
        // A mirror image is no similarity: the rotation stays one.
        let mirrored: Vec<_> = to.iter().map(|p| Vector3::new(-p.x, p.y, p.z)).collect();
        assert!(Similarity::fit(&from, &mirrored, false).unwrap().rotation.determinant() > 0.99);
        assert_eq!(Similarity::fit(&from[..2], &to[..2], false), None);
        assert_eq!(Similarity::fit(&[from[0]; 4], &to[..4], false), None);
    }
}
