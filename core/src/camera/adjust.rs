//! Gauss-Newton steps from a rough pose to full perspective, and how well the result is known.

use super::intrinsics::Intrinsics;
use super::placement::CameraFromModel;
use super::posit::Sight;
use super::space::{Matrix, Vector, apply, apply_transposed, scaled};
use crate::linear::NormalEquations;

/// Equations of which an unknown keeps less than this share of its own weight determine nothing.
const UNDETERMINED: f64 = 1e-10;

/// Which points count, and how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Weighting {
    /// Tukey's: `(1 - r^2 / gate^2)^2` inside the gate.
    Soft,
    /// One inside the gate.
    Hard,
}

/// A pose problem about the centroid of its points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) sights: &'a [Sight],
    pub(super) intrinsics: &'a Intrinsics,
}

/// How well a pose explains the sights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Agreement {
    /// Points within the gate.
    pub(super) inside: usize,
    /// Sum of their squared distances, px².
    pub(super) squares: f64,
}

impl Agreement {
    /// Squared distances, cut off at the gate, px²: the less the better.
    pub(super) fn cost(&self, points: usize, gate_squared: f64) -> f64 {
        self.squares + points.saturating_sub(self.inside) as f64 * gate_squared
    }
}

impl Problem<'_> {
    /// Squared distance between where a point is seen and where the pose puts it, px²; infinite behind the camera.
    #[inline]
    pub(super) fn distance_squared(&self, pose: &CameraFromModel, sight: &Sight) -> f64 {
        let [x, y, z] = pose.apply(sight.point);
        if !(z > 0.0) {
            return f64::INFINITY;
        }
        let inverse = 1.0 / z;
        let [fx, fy] = self.intrinsics.focal();
        let (u, v) = (fx * (x * inverse - sight.ray[0]), fy * (y * inverse - sight.ray[1]));
        u * u + v * v
    }

    pub(super) fn agreement(&self, pose: &CameraFromModel, gate_squared: f64) -> Agreement {
        let mut sum = Agreement::default();
        for sight in self.sights {
            let square = self.distance_squared(pose, sight);
            if square <= gate_squared {
                sum.inside += 1;
                sum.squares += square;
            }
        }
        sum
    }

    /// The truncated cost, or `None` as soon as it is not below `limit`.
    pub(super) fn cost_below(&self, pose: &CameraFromModel, gate_squared: f64, limit: f64) -> Option<f64> {
        let mut cost = 0.0;
        for sight in self.sights {
            let square = self.distance_squared(pose, sight);
            cost += if square < gate_squared { square } else { gate_squared };
            if !(cost < limit) {
                return None;
            }
        }
        Some(cost)
    }

    /// The equations of a step: three parts of a turn about the centroid in radians, three of a shift in shares of the
    /// centroid's depth; in the camera frame.
    fn equations(
        &self,
        pose: &CameraFromModel,
        gate_squared: f64,
        weighting: Weighting,
    ) -> (NormalEquations<6>, usize) {
        let mut equations = NormalEquations::new();
        let mut inside = 0;
        let [fx, fy] = self.intrinsics.focal();
        let translation = pose.translation();
        let depth = translation[2];
        for sight in self.sights {
            let p = apply(pose.rotation(), sight.point);
            let z = p[2] + depth;
            if !(z > 0.0) {
                continue;
            }
            let inverse = 1.0 / z;
            let (x, y) = ((p[0] + translation[0]) * inverse, (p[1] + translation[1]) * inverse);
            let (u, v) = (fx * (sight.ray[0] - x), fy * (sight.ray[1] - y));
            let square = u * u + v * v;
            if !(square < gate_squared) {
                continue;
            }
            inside += 1;
            let weight = match weighting {
                Weighting::Hard => 1.0,
                Weighting::Soft => {
                    let left = 1.0 - square / gate_squared;
                    left * left
                }
            };
            let (along, across) = (fx * inverse, fy * inverse);
            let shift = depth;
            let row_u = [-x * p[1], p[2] + x * p[0], -p[1], shift, 0.0, -x * shift];
            let row_v = [-p[2] - y * p[1], y * p[0], p[0], 0.0, shift, -y * shift];
            equations.add(&row_u.map(|entry| entry * along), u, weight);
            equations.add(&row_v.map(|entry| entry * across), v, weight);
        }
        (equations, inside)
    }

    /// One Gauss-Newton step; `None` if the points inside the gate do not determine it.
    pub(super) fn step(
        &self,
        pose: &CameraFromModel,
        gate_squared: f64,
        weighting: Weighting,
    ) -> Option<CameraFromModel> {
        let (mut equations, inside) = self.equations(pose, gate_squared, weighting);
        if inside < 3 {
            return None;
        }
        let &[a, b, c, d, e, f] = equations.solve()?;
        if !(equations.determinacy() > UNDETERMINED) {
            return None;
        }
        // A turn of more than a radian is no small step; it is cut, not refused.
        let turn = [a, b, c];
        let size = super::space::length(turn);
        let turn = if size > 1.0 { scaled(turn, 1.0 / size) } else { turn };
        let moved = pose.moved(turn, scaled([d, e, f], pose.translation()[2]))?;
        (moved.translation()[2] > 0.0).then_some(moved)
    }

    /// Covariance of (turn, shift) in radians and metres of the camera frame, for image coordinates of deviation one pixel, from
    /// the points inside the gate. `None` if they do not determine it.
    pub(super) fn covariance(&self, pose: &CameraFromModel, gate_squared: f64) -> Option<[[f64; 6]; 6]> {
        let (equations, _) = self.equations(pose, gate_squared, Weighting::Hard);
        let depth = pose.translation()[2];
        let mut covariance = [[0.0; 6]; 6];
        for (number, row) in covariance.iter_mut().enumerate() {
            let mut of_one = equations.clone();
            let mut one = [0.0; 6];
            *one.get_mut(number)? = 1.0;
            of_one.set_right(one);
            *row = *of_one.solve()?;
            if !(of_one.determinacy() > UNDETERMINED) {
                return None;
            }
        }
        let unit = |number: usize| if number < 3 { 1.0 } else { depth };
        for (i, row) in covariance.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry *= unit(i) * unit(j);
            }
        }
        covariance.as_flattened().iter().all(|entry| entry.is_finite()).then_some(covariance)
    }
}

/// Covariance of (centre in the model frame, turn in the camera frame) from that of (turn about the centroid, shift):
/// `C = -R^T t`, so `dC = R^T (w x t - dt)`.
pub(super) fn of_centre(pose: &CameraFromModel, covariance: &[[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let [tx, ty, tz] = pose.translation();
    // dC in the camera frame by (w, dt): rows of [-[t]x, -I].
    let by_turn: Matrix = [[0.0, tz, -ty], [-tz, 0.0, tx], [ty, -tx, 0.0]];
    let mut jacobian = [[0.0; 6]; 6];
    for axis in 0..3 {
        let mut unit: Vector = [0.0; 3];
        if let Some(entry) = unit.get_mut(axis) {
            *entry = 1.0;
        }
        // Row `axis` of R^T is column `axis` of R.
        let column = apply(pose.rotation(), unit);
        let turn = apply_transposed(&by_turn, column);
        if let Some(row) = jacobian.get_mut(axis) {
            *row = [turn[0], turn[1], turn[2], -column[0], -column[1], -column[2]];
        }
        if let Some(row) = jacobian.get_mut(axis + 3) {
            *row = [unit[0], unit[1], unit[2], 0.0, 0.0, 0.0];
        }
    }
    congruent(&jacobian, covariance)
}

/// `J C J^T`.
fn congruent(jacobian: &[[f64; 6]; 6], covariance: &[[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let dot = |a: &[f64; 6], b: &[f64; 6]| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    let left = jacobian.map(|row| covariance.map(|other| dot(&row, &other)));
    left.map(|row| jacobian.map(|other| dot(&row, &other)))
}
