//! Pose from scaled orthography, and from scaled orthography with its error taken out again and again: POSIT.
//!
//! Weak perspective sees a model point M at `x = I . M + x0`, `y = J . M + y0` with `I = R1 / Z`, `J = R2 / Z`: linear. Full
//! perspective is the same with `x (1 + e)`, `e = (R3 . M) / Z`, in place of `x` (D. `DeMenthon`, L. Davis, *Model-based object
//! pose in 25 lines of code*, IJCV 15, 1995, doi:10.1007/BF01450852), so solving, taking `e` from the solution and solving again
//! converges for objects that are not much deeper than far. A flat model leaves the parts of I and J along its normal open;
//! that R1 and R2 are orthogonal and of equal length gives them in two ways (D. Oberkampf et al., *Iterative pose estimation
//! using coplanar feature points*, CVIU 63, 1996, doi:10.1006/cviu.1996.0037).

use super::placement::CameraFromModel;
use super::space::{Axes, Matrix, Vector, apply, cross, dot, minus, plus, scaled, unit};
use crate::math::sqrt_f64;

/// Rounds of POSIT from all points.
const ROUNDS: usize = 8;
/// Rounds from three points, whose pose is only a start.
const ROUNDS_OF_THREE: usize = 4;
/// Half the root of two.
const HALF_ROOT: f64 = core::f64::consts::FRAC_1_SQRT_2;

/// A point of the model and the direction (x/z, y/z) in which the camera sees it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sight {
    pub(super) point: Vector,
    pub(super) ray: [f64; 2],
}

/// Weak perspective: a point M is seen at `(right . M, down . M) + at`.
#[derive(Debug, Clone, Copy)]
struct Orthography {
    right: Vector,
    down: Vector,
    at: [f64; 2],
}

impl Orthography {
    /// The pose with the nearest rotation to the two rows: their sum and difference are made orthogonal, so neither is
    /// preferred.
    fn place(&self) -> Option<CameraFromModel> {
        let scale = sqrt_f64(sqrt_f64(dot(self.right, self.right) * dot(self.down, self.down)));
        let (i, j) = (unit(self.right)?, unit(self.down)?);
        let (sum, difference) = (unit(plus(i, j))?, unit(minus(i, j))?);
        let right = scaled(plus(sum, difference), HALF_ROOT);
        let down = scaled(minus(sum, difference), HALF_ROOT);
        let depth = 1.0 / scale;
        let translation = [self.at[0] * depth, self.at[1] * depth, depth];
        depth.is_finite().then(|| CameraFromModel::of_parts([right, down, cross(right, down)], translation))
    }

    /// The parts `l` and `m` of right and down along the normal, which a flat model leaves open: `l m = -right . down` and
    /// `l^2 - m^2 = down^2 - right^2`, that is `(l + i m)^2 = down^2 - right^2 - 2 i right . down`. Both signs do.
    fn open_parts(&self) -> [f64; 2] {
        let real = dot(self.down, self.down) - dot(self.right, self.right);
        let imaginary = -2.0 * dot(self.right, self.down);
        let modulus = sqrt_f64(real * real + imaginary * imaginary);
        // The larger part of the root first: the other follows by a division that loses nothing.
        if real >= 0.0 {
            let l = sqrt_f64(f64::midpoint(modulus, real));
            [l, if l > 0.0 { imaginary / (2.0 * l) } else { 0.0 }]
        } else {
            let m = sqrt_f64((modulus - real) / 2.0);
            [imaginary / (2.0 * m), m]
        }
    }

    /// The pose with these parts along the normal: its rows are orthogonal and equally long up to rounding.
    fn completed(&self, normal: Vector, [l, m]: [f64; 2]) -> Option<CameraFromModel> {
        let (right, down) = (plus(self.right, scaled(normal, l)), plus(self.down, scaled(normal, m)));
        let depth = 1.0 / sqrt_f64(dot(right, right));
        let (right, down) = (scaled(right, depth), scaled(down, depth));
        let translation = [self.at[0] * depth, self.at[1] * depth, depth];
        depth.is_finite().then(|| CameraFromModel::of_parts([right, down, cross(right, down)], translation))
    }

    /// Both completions.
    fn both(&self, normal: Vector) -> [Option<CameraFromModel>; 2] {
        let [l, m] = self.open_parts();
        [self.completed(normal, [l, m]), self.completed(normal, [-l, -m])]
    }

    /// The completion that is turned like the pose before: only what changes with the sign is compared, of
    /// `trace(A B^T)`.
    fn nearer(&self, normal: Vector, before: &CameraFromModel) -> Option<CameraFromModel> {
        let [l, m] = self.open_parts();
        let [right, down, axis] = *before.rotation();
        let turned = plus(scaled(cross(self.right, normal), m), scaled(cross(normal, self.down), l));
        let same = l * dot(normal, right) + m * dot(normal, down) + dot(turned, axis) * before.translation()[2];
        self.completed(normal, if same >= 0.0 { [l, m] } else { [-l, -m] })
    }
}

/// `e` of a point under a pose; `None` where the point would lie at or behind the camera.
#[inline]
fn depth_ratio(pose: &CameraFromModel, point: Vector) -> Option<f64> {
    let ratio = 1.0 + dot(pose.axis(), point) / pose.translation()[2];
    (ratio > 1e-3).then_some(ratio)
}

/// The points about their centroid, with what POSIT needs of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape<'a> {
    /// Points relative to their centroid.
    pub(super) sights: &'a [Sight],
    /// Axes of their scatter.
    pub(super) axes: &'a Axes,
}

impl Shape<'_> {
    /// The inverse of the scatter, without its smallest axis if `flat`.
    fn inverse(&self, flat: bool) -> Matrix {
        let mut inverse = [[0.0; 3]; 3];
        let axes = self.axes.values.iter().zip(&self.axes.directions);
        for (&value, &direction) in axes.take(if flat { 2 } else { 3 }) {
            for (row, entry) in inverse.iter_mut().zip(direction) {
                *row = plus(*row, scaled(direction, entry / value));
            }
        }
        inverse
    }

    /// Scaled orthography of all points, by least squares; rays are multiplied by `1 + e` of the pose, if there is one.
    fn orthography(&self, inverse: &Matrix, pose: Option<&CameraFromModel>) -> Option<Orthography> {
        let (mut right, mut down, mut at) = ([0.0; 3], [0.0; 3], [0.0; 2]);
        for &Sight { point, ray: [x, y] } in self.sights {
            let ratio = pose.map_or(Some(1.0), |pose| depth_ratio(pose, point))?;
            let (x, y) = (x * ratio, y * ratio);
            right = plus(right, scaled(point, x));
            down = plus(down, scaled(point, y));
            at = [at[0] + x, at[1] + y];
        }
        let share = 1.0 / self.sights.len() as f64;
        Some(Orthography { right: apply(inverse, right), down: apply(inverse, down), at: at.map(|sum| sum * share) })
    }

    /// POSIT of a model that is not flat. `None` if it does not converge to something in front of the camera.
    pub(super) fn solid(&self) -> Option<CameraFromModel> {
        let inverse = self.inverse(false);
        let mut pose = self.orthography(&inverse, None)?.place()?;
        for _ in 0..ROUNDS {
            pose = self.orthography(&inverse, Some(&pose))?.place()?;
        }
        Some(pose)
    }

    /// POSIT of a model that is taken as flat: both poses.
    pub(super) fn flat(&self) -> [Option<CameraFromModel>; 2] {
        let inverse = self.inverse(true);
        let [.., normal] = self.axes.directions;
        let Some(first) = self.orthography(&inverse, None) else { return [None; 2] };
        first.both(normal).map(|start| {
            let mut pose = start?;
            for _ in 0..ROUNDS {
                pose = self.orthography(&inverse, Some(&pose))?.nearer(normal, &pose)?;
            }
            Some(pose)
        })
    }
}

/// Both poses of three points, the fewest: coplanar POSIT about the first of them. The translation is that of the origin of
/// the points' frame.
pub(super) fn of_three([first, second, third]: [Sight; 3]) -> [Option<CameraFromModel>; 2] {
    let (a, b) = (minus(second.point, first.point), minus(third.point, first.point));
    let across = cross(a, b);
    let square = dot(across, across);
    if !(square > 1e-12 * dot(a, a) * dot(b, b)) {
        return [None; 2];
    }
    let normal = scaled(across, 1.0 / sqrt_f64(square));
    // The dual basis: `dual_a . a = 1`, `dual_a . b = 0`.
    let (dual_a, dual_b) = (scaled(cross(b, across), 1.0 / square), scaled(cross(across, a), 1.0 / square));
    let orthography = |ratio_a: f64, ratio_b: f64| {
        let part = |at: f64, a: f64, b: f64| plus(scaled(dual_a, a * ratio_a - at), scaled(dual_b, b * ratio_b - at));
        let ([x, y], [xa, ya], [xb, yb]) = (first.ray, second.ray, third.ray);
        Orthography { right: part(x, xa, xb), down: part(y, ya, yb), at: first.ray }
    };
    orthography(1.0, 1.0).both(normal).map(|start| {
        let mut pose = start?;
        for _ in 0..ROUNDS_OF_THREE {
            pose = orthography(depth_ratio(&pose, a)?, depth_ratio(&pose, b)?).nearer(normal, &pose)?;
        }
        Some(pose.about(scaled(first.point, -1.0)))
    })
}
