//! Bundle adjustment: places of all cameras, all points and, if asked, what the lenses have in common, for the least robust
//! sum of reprojection errors.
//!
//! Levenberg-Marquardt with the Schur complement: points are eliminated, 3 x 3 each, and a dense system of six unknowns a
//! camera (and two of the lenses) is solved by Cholesky (Triggs et al., "Bundle adjustment, a modern synthesis", 2000). The
//! first camera stands still; the scale is held by the damping. Sums run in the order of the points, on one thread.

use std::ops::Range;

use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, Matrix6, Matrix6x3, Rotation3, SMatrix, Vector2, Vector3, Vector6,
};

use crate::pose::Pose;

/// What one camera sees of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Number of the camera.
    pub camera: usize,
    /// Where, in normalized coordinates of the lens as it was assumed, times the focal length: pixels from the principal
    /// point.
    pub at: [f64; 2],
}

/// What all cameras have in common, beyond what was assumed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Common {
    /// Natural logarithm of the factor on the focal length.
    pub log_focal: f64,
    /// Radial distortion `k1`.
    pub k1: f64,
}

/// The problem and its solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    /// Places of the cameras.
    pub poses: Vec<Pose>,
    /// The points.
    pub points: Vec<Vector3<f64>>,
    /// For each point what cameras see of it.
    pub observations: Vec<Vec<Observation>>,
    /// Assumed focal length of each camera, in pixels.
    pub focal: Vec<f64>,
    /// What the cameras have in common.
    pub common: Common,
}

/// What is adjusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Free {
    /// Places and points.
    Motion,
    /// Also focal length and distortion.
    MotionAndLens,
    /// The place of one camera, and nothing else.
    Camera(usize),
}

/// How it went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Adjusted {
    /// Root mean square of the distances between images and observations, pixels.
    pub rms_px: f64,
    /// Observations.
    pub observations: usize,
    /// Steps that lowered the error.
    pub steps: usize,
}

/// Residuals beyond count linearly (Huber), pixels.
const HUBER_PX: f64 = 1.0;

impl Free {
    /// Whether the observations of a camera count.
    fn counts(self, camera: usize) -> bool {
        !matches!(self, Self::Camera(only) if only != camera)
    }
}

/// What changes from step to step.
#[derive(Debug, Clone)]
struct State {
    poses: Vec<Pose>,
    points: Vec<Vector3<f64>>,
    common: Common,
}

/// A camera as a state has it.
struct Eye<'s> {
    pose: &'s Pose,
    /// With the common factor.
    focal: f64,
    k1: f64,
}

/// A residual and its derivatives.
struct Linear {
    residual: Vector2<f64>,
    /// By the point in the view frame, and that.
    view: Matrix2x3<f64>,
    offset: Vector3<f64>,
    point: Matrix2x3<f64>,
    lens: Matrix2<f64>,
}

impl Linear {
    /// By the camera: a turn w about the pinhole moves the view's point by w x offset; the pinhole moves it by -R.
    fn camera(&self) -> SMatrix<f64, 2, 6> {
        let turn = -(self.view * self.offset.cross_matrix());
        let mut camera = SMatrix::<f64, 2, 6>::zeros();
        camera.fixed_columns_mut::<3>(0).copy_from(&turn);
        camera.fixed_columns_mut::<3>(3).copy_from(&(-self.point));
        camera
    }
}

impl Eye<'_> {
    /// Seen minus predicted; `None` for a point behind the camera.
    fn residual(&self, point: &Vector3<f64>, at: [f64; 2]) -> Option<Vector2<f64>> {
        let view = self.pose.to_view(point);
        if !(view.z > 1e-9) {
            return None;
        }
        let (x, y) = (view.x / view.z, view.y / view.z);
        let r2 = x * x + y * y;
        let scale = self.focal * (1.0 + self.k1 * r2);
        Some(Vector2::new(at[0] - scale * x, at[1] - scale * y))
    }

    fn linear(&self, point: &Vector3<f64>, at: [f64; 2]) -> Option<Linear> {
        let offset = self.pose.to_view(point);
        if !(offset.z > 1e-9) {
            return None;
        }
        let (x, y, depth) = (offset.x / offset.z, offset.y / offset.z, offset.z);
        let (r2, k1) = (x * x + y * y, self.k1);
        let bend = 1.0 + k1 * r2;
        let image = Vector2::new(x, y) * (self.focal * bend);
        let by_image =
            Matrix2::new(bend + 2.0 * k1 * x * x, 2.0 * k1 * x * y, 2.0 * k1 * x * y, bend + 2.0 * k1 * y * y)
                * self.focal;
        let by_view = by_image * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / depth;
        let bent = Vector2::new(x, y) * (self.focal * r2);
        Some(Linear {
            residual: Vector2::from(at) - image,
            view: by_view,
            offset,
            point: by_view * self.pose.view_from_model,
            lens: Matrix2::from_columns(&[image, bent]),
        })
    }
}

impl Bundle {
    fn eyes<'s>(&self, poses: &'s [Pose], common: Common) -> Vec<Eye<'s>> {
        let factor = libm::exp(common.log_focal);
        poses.iter().zip(&self.focal).map(|(pose, focal)| Eye { pose, focal: focal * factor, k1: common.k1 }).collect()
    }

    /// The robust cost; infinite if a point lies behind one of its cameras.
    fn cost(&self, state: &State, free: Free) -> f64 {
        let eyes = self.eyes(&state.poses, state.common);
        let mut cost = 0.0;
        for (point, observations) in state.points.iter().zip(&self.observations) {
            for seen in observations.iter().filter(|seen| free.counts(seen.camera)) {
                let Some(residual) = eyes[seen.camera].residual(point, seen.at) else { return f64::INFINITY };
                let length = residual.norm();
                cost += if length <= HUBER_PX { length * length } else { HUBER_PX * (2.0 * length - HUBER_PX) };
            }
        }
        cost
    }

    /// Lowers the error in at most `steps` steps; one that lowers the cost by a share of less than `least_gain` is the last.
    pub fn adjust(&mut self, free: Free, steps: usize, least_gain: f64) -> Adjusted {
        let mut damping = 1e-4;
        let mut state = State { poses: self.poses.clone(), points: self.points.clone(), common: self.common };
        let mut cost = self.cost(&state, free);
        let mut taken = 0;
        for _ in 0..steps {
            let mut lowered = false;
            for _ in 0..6 {
                let Some(next) = self.stepped(&state, free, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let lower = self.cost(&next, free);
                if lower < cost {
                    let gain = (cost - lower) / cost.max(f64::MIN_POSITIVE);
                    (state, cost, damping) = (next, lower, (damping * 0.2).max(1e-9));
                    taken += 1;
                    lowered = gain > least_gain;
                    break;
                }
                damping *= 10.0;
            }
            if !lowered {
                break;
            }
        }
        (self.poses, self.points, self.common) = (state.poses, state.points, state.common);
        let (mut sum, mut count) = (0.0, 0_usize);
        for distance in (0..self.points.len()).flat_map(|point| self.distances(point)).filter(|d| d.is_finite()) {
            sum += distance * distance;
            count += 1;
        }
        Adjusted { rms_px: libm::sqrt(sum / count.max(1) as f64), observations: count, steps: taken }
    }

    /// The state after one damped step; `None` if the system cannot be solved.
    fn stepped(&self, state: &State, free: Free, damping: f64) -> Option<State> {
        let eyes = self.eyes(&state.poses, state.common);
        let mut system = Reduced::new(eyes.len(), free);
        let mut links = Vec::with_capacity(2 * self.points.len());
        let eliminated: Vec<Option<Eliminated>> = state
            .points
            .iter()
            .zip(&self.observations)
            .map(|(point, observations)| {
                let counted = observations.iter().filter(|seen| free.counts(seen.camera));
                let seen = counted.filter_map(|seen| Some((seen.camera, eyes[seen.camera].linear(point, seen.at)?)));
                system.add_point(seen, damping, &mut links)
            })
            .collect();
        let step = system.solve(damping)?;
        let mut next = state.clone();
        for (camera, pose) in next.poses.iter_mut().enumerate() {
            let part = step.fixed_rows::<6>(6 * camera);
            if part.norm_squared() > 0.0 {
                let turn = Rotation3::from_scaled_axis(Vector3::new(part[0], part[1], part[2]));
                pose.view_from_model = turn.matrix() * pose.view_from_model;
                pose.position += Vector3::new(part[3], part[4], part[5]);
            }
        }
        let lens = step.fixed_rows::<2>(6 * eyes.len());
        next.common.log_focal += lens[0];
        next.common.k1 += lens[1];
        for (point, eliminated) in next.points.iter_mut().zip(&eliminated) {
            let Some(eliminated) = eliminated else { continue };
            let mut side = eliminated.side;
            for link in links.get(eliminated.links.clone()).unwrap_or_default() {
                side -= link.block.transpose() * step.fixed_rows::<6>(6 * link.camera);
            }
            side -= eliminated.lens.transpose() * lens;
            *point += eliminated.inverse * side;
        }
        next.poses.iter().all(|pose| pose.position.iter().all(|c| c.is_finite())).then_some(next)
    }

    /// Distance of each observation of a point from its image, pixels; infinite behind a camera.
    pub fn distances(&self, point: usize) -> impl Iterator<Item = f64> + '_ {
        let factor = libm::exp(self.common.log_focal);
        let position = &self.points[point];
        self.observations[point].iter().map(move |seen| {
            let (pose, focal) = (&self.poses[seen.camera], self.focal[seen.camera] * factor);
            let eye = Eye { pose, focal, k1: self.common.k1 };
            eye.residual(position, seen.at).map_or(f64::INFINITY, |residual| residual.norm())
        })
    }
}

/// What eliminating a point leaves behind, to find its step afterwards.
struct Eliminated {
    inverse: Matrix3<f64>,
    side: Vector3<f64>,
    /// Its cameras that move.
    links: Range<usize>,
    lens: Matrix2x3<f64>,
}

/// How the steps of a camera and of a point go together.
struct Link {
    camera: usize,
    block: Matrix6x3<f64>,
}

/// The system of the cameras and the lens, after the points are eliminated: its upper triangle in blocks.
struct Reduced {
    free: Free,
    cameras: usize,
    /// Pairs of cameras, row by row from the diagonal on.
    pairs: Vec<Matrix6<f64>>,
    /// Cameras and lens.
    with_lens: Vec<SMatrix<f64, 6, 2>>,
    lens: Matrix2<f64>,
    right: Vec<Vector6<f64>>,
    lens_right: Vector2<f64>,
}

impl Reduced {
    fn new(cameras: usize, free: Free) -> Self {
        Self {
            free,
            cameras,
            pairs: vec![Matrix6::zeros(); cameras * (cameras + 1) / 2],
            with_lens: vec![SMatrix::zeros(); cameras],
            lens: Matrix2::zeros(),
            right: vec![Vector6::zeros(); cameras],
            lens_right: Vector2::zeros(),
        }
    }

    /// Where the block of two cameras is, `one <= other`.
    fn pair(&self, one: usize, other: usize) -> usize {
        one * self.cameras - one * (one + 1) / 2 + other
    }

    /// Whether a camera stands still.
    fn fixed(&self, camera: usize) -> bool {
        match self.free {
            Free::Motion | Free::MotionAndLens => camera == 0,
            Free::Camera(only) => camera != only,
        }
    }

    /// Adds a point as cameras see it, and eliminates it unless it stands still.
    fn add_point(
        &mut self,
        seen: impl Iterator<Item = (usize, Linear)>,
        damping: f64,
        links: &mut Vec<Link>,
    ) -> Option<Eliminated> {
        let with_lens = self.free == Free::MotionAndLens;
        let mut v = Matrix3::<f64>::zeros();
        let mut side = Vector3::<f64>::zeros();
        let mut by_lens = Matrix2x3::<f64>::zeros();
        let first = links.len();
        for (camera, linear) in seen {
            let length = linear.residual.norm();
            let weight = if length <= HUBER_PX { 1.0 } else { HUBER_PX / length };
            if !self.fixed(camera) {
                let by_camera = linear.camera();
                let weighted = by_camera.transpose() * weight;
                let diagonal = self.pair(camera, camera);
                self.pairs[diagonal] += weighted * by_camera;
                self.right[camera] += weighted * linear.residual;
                if with_lens {
                    self.with_lens[camera] += weighted * linear.lens;
                }
                links.push(Link { camera, block: weighted * linear.point });
            }
            if with_lens {
                let weighted = linear.lens.transpose() * weight;
                self.lens += weighted * linear.lens;
                self.lens_right += weighted * linear.residual;
                by_lens += weighted * linear.point;
            }
            v += linear.point.transpose() * linear.point * weight;
            side += linear.point.transpose() * linear.residual * weight;
        }
        if matches!(self.free, Free::Camera(_)) {
            links.truncate(first);
            return None;
        }
        for axis in 0..3 {
            v[(axis, axis)] += damping * v[(axis, axis)] + 1e-12;
        }
        let Some(inverse) = v.try_inverse() else {
            links.truncate(first);
            return None;
        };
        let own = links.get(first..).unwrap_or_default();
        for (number, one) in own.iter().enumerate() {
            let folded = one.block * inverse;
            self.right[one.camera] -= folded * side;
            // Cameras of a point ascend.
            for other in own.iter().skip(number) {
                let pair = self.pair(one.camera, other.camera);
                self.pairs[pair] -= folded * other.block.transpose();
            }
            if with_lens {
                self.with_lens[one.camera] -= folded * by_lens.transpose();
            }
        }
        if with_lens {
            let folded = by_lens * inverse;
            self.lens -= folded * by_lens.transpose();
            self.lens_right -= folded * side;
        }
        Some(Eliminated { inverse, side, links: first..links.len(), lens: by_lens })
    }

    /// The step; zero for what stands still.
    fn solve(self, damping: f64) -> Option<DVector<f64>> {
        let lens = 6 * self.cameras;
        let mut matrix = DMatrix::<f64>::zeros(lens + 2, lens + 2);
        let mut right = DVector::<f64>::zeros(lens + 2);
        for one in 0..self.cameras {
            for other in one..self.cameras {
                let block = &self.pairs[self.pair(one, other)];
                matrix.fixed_view_mut::<6, 6>(6 * one, 6 * other).copy_from(block);
            }
            matrix.fixed_view_mut::<6, 2>(6 * one, lens).copy_from(&self.with_lens[one]);
            right.fixed_rows_mut::<6>(6 * one).copy_from(&self.right[one]);
        }
        matrix.fixed_view_mut::<2, 2>(lens, lens).copy_from(&self.lens);
        right.fixed_rows_mut::<2>(lens).copy_from(&self.lens_right);
        matrix.fill_lower_triangle_with_upper_triangle();
        for unknown in 0..lens + 2 {
            let fixed = if unknown < lens { self.fixed(unknown / 6) } else { self.free != Free::MotionAndLens };
            if fixed {
                matrix.row_mut(unknown).fill(0.0);
                matrix.column_mut(unknown).fill(0.0);
                matrix[(unknown, unknown)] = 1.0;
                right[unknown] = 0.0;
            } else {
                matrix[(unknown, unknown)] += damping * matrix[(unknown, unknown)].abs() + 1e-12;
            }
        }
        Some(matrix.cholesky()?.solve(&right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_fixtures::random::SplitMix64;

    /// Six cameras in an arc before a box of points, exact observations with this focal factor and k1.
    fn arc(common: Common) -> Bundle {
        let mut random = SplitMix64::new(11);
        let mut number = |low: f64, high: f64| random.metres(low, high);
        let points: Vec<_> =
            (0..80).map(|_| Vector3::new(number(-4.0, 4.0), number(-3.0, 3.0), number(-2.0, 2.0))).collect();
        let poses: Vec<_> = (0..6)
            .map(|i| {
                let turn = *Rotation3::from_euler_angles(0.02 * f64::from(i), 0.12 * f64::from(i) - 0.3, 0.01).matrix();
                Pose::from_translation(turn, Vector3::new(0.1, 0.0, 14.0 + 0.2 * f64::from(i)))
            })
            .collect();
        let mut bundle = Bundle { poses, points, observations: Vec::new(), focal: vec![800.0; 6], common };
        bundle.observations = bundle
            .points
            .iter()
            .map(|point| {
                (0..6)
                    .map(|camera| {
                        let seen = bundle.eyes(&bundle.poses, common)[camera].residual(point, [0.0; 2]).unwrap();
                        Observation { camera, at: [-seen.x, -seen.y] }
                    })
                    .collect()
            })
            .collect();
        bundle
    }

    fn shaken(mut bundle: Bundle) -> Bundle {
        let mut random = SplitMix64::new(12);
        for point in &mut bundle.points {
            *point += Vector3::new(random.metres(-0.2, 0.2), random.metres(-0.2, 0.2), random.metres(-0.2, 0.2));
        }
        for pose in bundle.poses.iter_mut().skip(1) {
            pose.position += Vector3::new(random.metres(-0.2, 0.2), 0.1, -0.1);
            pose.view_from_model = Rotation3::from_euler_angles(0.01, -0.01, 0.005).matrix() * pose.view_from_model;
        }
        bundle
    }

    #[test]
    fn exact_observations_are_met_again() {
        let mut bundle = shaken(arc(Common { log_focal: 0.0, k1: 0.0 }));
        let adjusted = bundle.adjust(Free::Motion, 30, 1e-7);
        assert!(adjusted.rms_px < 1e-3, "{adjusted:?}");
        assert_eq!(adjusted.observations, 480);
    }

    #[test]
    fn the_lens_is_found_too() {
        let truth = Common { log_focal: 0.04, k1: -0.05 };
        let mut bundle = shaken(arc(truth));
        bundle.common = Common { log_focal: 0.0, k1: 0.0 };
        let adjusted = bundle.adjust(Free::MotionAndLens, 60, 1e-7);
        assert!(adjusted.rms_px < 1e-2, "{adjusted:?}");
        assert!((bundle.common.log_focal - 0.04).abs() < 0.002 && (bundle.common.k1 + 0.05).abs() < 0.002);
    }

    #[test]
    fn one_camera_finds_its_place_among_wrong_observations() {
        let truth = arc(Common { log_focal: 0.0, k1: 0.0 });
        let mut bundle = truth.clone();
        bundle.poses[3].position += Vector3::new(0.3, -0.2, 0.4);
        for observations in bundle.observations.iter_mut().step_by(7) {
            observations[3].at[0] += 60.0;
        }
        bundle.adjust(Free::Camera(3), 50, 1e-7);
        assert!((bundle.poses[3].position - truth.poses[3].position).norm() < 0.02, "{:?}", bundle.poses[3].position);
        assert_eq!(bundle.poses[2], truth.poses[2]);
    }
}
