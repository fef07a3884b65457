//! Affine epipolar geometry: what two views of a solid body keep, whatever its relief.
//!
//! Under weak perspective the correspondences of any scene satisfy one linear equation
//! `a x + b y + c x' + d y' + e = 0` (Shapiro, Zisserman, Brady, "3D motion recovery via affine epipolar geometry", 1995):
//! total least squares, the smallest principal axis of the four-vectors `(x, y, x', y')`. Perspective adds an error that
//! grows with relief over distance.

use crate::math::sqrt_f64;

/// The affine epipolar constraint as a unit normal through the mean of the pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineEpipolar {
    normal: [f64; 4],
    mean: [f64; 4],
}

/// A correspondence of two places in pixels, as one vector `(x, y, x', y')`.
pub type JointPoint = [f64; 4];

impl AffineEpipolar {
    /// Fits by total least squares. `None` for fewer than five pairs. Pairs of one plane satisfy many constraints: then
    /// this is one of them.
    pub fn fit(pairs: &[JointPoint]) -> Option<Self> {
        if pairs.len() < 5 {
            return None;
        }
        let count = pairs.len() as f64;
        let mut mean = [0.0; 4];
        for pair in pairs {
            for (sum, value) in mean.iter_mut().zip(pair) {
                *sum += value / count;
            }
        }
        let mut moments = [[0.0; 4]; 4];
        for pair in pairs {
            let [a, b, c, d] = *pair;
            let away = [a - mean[0], b - mean[1], c - mean[2], d - mean[3]];
            for (row, x) in moments.iter_mut().zip(away) {
                for (sum, y) in row.iter_mut().zip(away) {
                    *sum += x * y;
                }
            }
        }
        Some(Self { normal: smallest_axis(moments), mean })
    }

    /// Distance of a pair from the constraint in the joint space, px: half of it is in each picture.
    pub fn distance(&self, pair: &JointPoint) -> f64 {
        let dot = pair.iter().zip(self.mean).zip(self.normal).fold(0.0, |sum, ((x, m), n)| sum + (x - m) * n);
        dot.abs()
    }
}

/// The unit eigenvector of the smallest eigenvalue of a symmetric matrix: Jacobi rotations in a fixed order
/// (Golub and Van Loan, Matrix Computations, 8.5).
fn smallest_axis(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    const PLANES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let mut axes = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    // Four by four converges in five sweeps to the last bit.
    for _ in 0..8 {
        for (p, q) in PLANES {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let root = sqrt_f64(theta * theta + 1.0);
            let tangent = if theta < 0.0 { -1.0 / (root - theta) } else { 1.0 / (root + theta) };
            let cosine = 1.0 / sqrt_f64(tangent * tangent + 1.0);
            let sine = tangent * cosine;
            for row in &mut a {
                (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
            }
            let (upper, lower) = (a[p], a[q]);
            for (k, (x, y)) in upper.into_iter().zip(lower).enumerate() {
                (a[p][k], a[q][k]) = (cosine * x - sine * y, sine * x + cosine * y);
            }
            for row in &mut axes {
                (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
            }
        }
    }
    let mut least = 0;
    for axis in 1..4 {
        if a[axis][axis] < a[least][least] {
            least = axis;
        }
    }
    axes.map(|row| row[least])
}
