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

/// A symmetric matrix on its way to a diagonal one, and the axes that it has then, one a column.
struct Turned {
    matrix: [[f64; 4]; 4],
    axes: [[f64; 4]; 4],
}

impl Turned {
    /// Turns the plane of two axes so that the entry `P`, `Q` vanishes. The indices are constants: none is checked.
    fn turn<const P: usize, const Q: usize>(&mut self) {
        let Self { matrix: a, axes } = self;
        if a[P][Q] == 0.0 {
            return;
        }
        let theta = (a[Q][Q] - a[P][P]) / (2.0 * a[P][Q]);
        let root = sqrt_f64(theta * theta + 1.0);
        let tangent = if theta < 0.0 { -1.0 / (root - theta) } else { 1.0 / (root + theta) };
        let cosine = 1.0 / sqrt_f64(tangent * tangent + 1.0);
        let sine = tangent * cosine;
        let turned = |x: f64, y: f64| (cosine * x - sine * y, sine * x + cosine * y);
        for row in a.iter_mut() {
            (row[P], row[Q]) = turned(row[P], row[Q]);
        }
        let [mut upper, mut lower] = [a[P], a[Q]];
        for (x, y) in upper.iter_mut().zip(&mut lower) {
            (*x, *y) = turned(*x, *y);
        }
        (a[P], a[Q]) = (upper, lower);
        for row in axes {
            (row[P], row[Q]) = turned(row[P], row[Q]);
        }
    }
}

/// The unit eigenvector of the smallest eigenvalue of a symmetric matrix: Jacobi rotations in a fixed order
/// (Golub and Van Loan, Matrix Computations, 8.5).
fn smallest_axis(matrix: [[f64; 4]; 4]) -> [f64; 4] {
    let axes = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let mut turned = Turned { matrix, axes };
    // Four by four converges in five sweeps to the last bit.
    for _ in 0..8 {
        turned.turn::<0, 1>();
        turned.turn::<0, 2>();
        turned.turn::<0, 3>();
        turned.turn::<1, 2>();
        turned.turn::<1, 3>();
        turned.turn::<2, 3>();
    }
    let Turned { matrix: a, axes } = turned;
    let mut least = (a[0][0], axes.map(|row| row[0]));
    for (value, axis) in
        [(a[1][1], axes.map(|row| row[1])), (a[2][2], axes.map(|row| row[2])), (a[3][3], axes.map(|row| row[3]))]
    {
        if value < least.0 {
            least = (value, axis);
        }
    }
    least.1
}
