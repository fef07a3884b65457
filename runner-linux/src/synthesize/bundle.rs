//! Bundle adjustment: places of all cameras, all points and, if asked, what the lenses have in common, for the least robust
//! sum of reprojection errors.
//!
//! Levenberg-Marquardt with the Schur complement: points are eliminated, 3 x 3 each, and a dense system of six unknowns a
//! camera (and two of the lenses) is solved by Cholesky (Triggs et al., "Bundle adjustment, a modern synthesis", 2000). The
//! first camera stands still; the scale is held by the damping. Sums run in the order of the points, on one thread.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Matrix6x3, Rotation3, SMatrix, Vector2, Vector3};

use crate::camera_file::lens::Pose;

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
#[derive(Debug, Clone, Copy, PartialEq)]
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

type Six = SMatrix<f64, 2, 6>;

struct Linear {
    residual: Vector2<f64>,
    camera: Six,
    lens: nalgebra::Matrix2<f64>,
    point: Matrix2x3<f64>,
}

impl Bundle {
    fn residual(&self, point: &Vector3<f64>, observation: &Observation) -> Option<Vector2<f64>> {
        let view = self.poses[observation.camera].to_view(point);
        if !(view.z > 1e-9) {
            return None;
        }
        let (x, y) = (view.x / view.z, view.y / view.z);
        let r2 = x * x + y * y;
        let scale = self.focal[observation.camera] * libm::exp(self.common.log_focal) * (1.0 + self.common.k1 * r2);
        Some(Vector2::new(observation.at[0] - scale * x, observation.at[1] - scale * y))
    }

    fn linear(&self, point: &Vector3<f64>, observation: &Observation) -> Option<Linear> {
        let pose = &self.poses[observation.camera];
        let offset = pose.view_from_model * (point - pose.position);
        if !(offset.z > 1e-9) {
            return None;
        }
        let (x, y, depth) = (offset.x / offset.z, offset.y / offset.z, offset.z);
        let (r2, k1) = (x * x + y * y, self.common.k1);
        let focal = self.focal[observation.camera] * libm::exp(self.common.log_focal);
        let bend = 1.0 + k1 * r2;
        let image = Vector2::new(x, y) * (focal * bend);
        let by_image = nalgebra::Matrix2::new(
            bend + 2.0 * k1 * x * x,
            2.0 * k1 * x * y,
            2.0 * k1 * x * y,
            bend + 2.0 * k1 * y * y,
        ) * focal;
        let by_view = by_image * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / depth;
        // A turn w about the pinhole moves the view's point by w x offset; the pinhole moves it by -R.
        let turn = -(by_view * offset.cross_matrix());
        let point = by_view * pose.view_from_model;
        let mut camera = Six::zeros();
        camera.fixed_columns_mut::<3>(0).copy_from(&turn);
        camera.fixed_columns_mut::<3>(3).copy_from(&(-point));
        let bent = Vector2::new(x, y) * (focal * r2);
        let residual = Vector2::from(observation.at) - image;
        Some(Linear { residual, camera, lens: nalgebra::Matrix2::from_columns(&[image, bent]), point })
    }

    /// The robust cost; infinite if a point lies behind one of its cameras.
    fn cost(&self, free: Free) -> f64 {
        let mut cost = 0.0;
        for (point, observations) in self.points.iter().zip(&self.observations) {
            for observation in observations {
                if matches!(free, Free::Camera(camera) if camera != observation.camera) {
                    continue;
                }
                let Some(residual) = self.residual(point, observation) else { return f64::INFINITY };
                let length = residual.norm();
                cost += if length <= HUBER_PX { length * length } else { HUBER_PX * (2.0 * length - HUBER_PX) };
            }
        }
        cost
    }

    /// Lowers the error in at most `steps` steps.
    pub fn adjust(&mut self, free: Free, steps: usize) -> Adjusted {
        let mut damping = 1e-4;
        let mut cost = self.cost(free);
        let mut taken = 0;
        for _ in 0..steps {
            let mut lowered = false;
            for _ in 0..6 {
                let Some(next) = self.stepped(free, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let lower = next.cost(free);
                if lower < cost {
                    let gain = (cost - lower) / cost.max(f64::MIN_POSITIVE);
                    (*self, cost, damping) = (next, lower, (damping * 0.2).max(1e-9));
                    taken += 1;
                    lowered = gain > 1e-7;
                    break;
                }
                damping *= 10.0;
            }
            if !lowered {
                break;
            }
        }
        let (mut sum, mut count) = (0.0, 0);
        for (point, observations) in self.points.iter().zip(&self.observations) {
            for residual in observations.iter().filter_map(|observation| self.residual(point, observation)) {
                sum += residual.norm_squared();
                count += 1;
            }
        }
        let rms_px = libm::sqrt(sum / f64::from(count.max(1)));
        Adjusted { rms_px, observations: count as usize, steps: taken }
    }

    /// The bundle after one damped step; `None` if the system cannot be solved.
    fn stepped(&self, free: Free, damping: f64) -> Option<Self> {
        let mut system = Reduced::new(self.poses.len());
        let eliminated: Vec<Option<Eliminated>> = self
            .points
            .iter()
            .zip(&self.observations)
            .map(|(point, observations)| system.add_point(self, point, observations, free, damping))
            .collect();
        let step = system.solve(free, damping)?;
        let mut next = self.clone();
        for (camera, pose) in next.poses.iter_mut().enumerate() {
            let part = step.fixed_rows::<6>(6 * camera);
            if part.norm_squared() > 0.0 {
                let turn = Rotation3::from_scaled_axis(Vector3::new(part[0], part[1], part[2]));
                pose.view_from_model = turn.matrix() * pose.view_from_model;
                pose.position += Vector3::new(part[3], part[4], part[5]);
            }
        }
        let lens = step.fixed_rows::<2>(6 * self.poses.len());
        next.common.log_focal += lens[0];
        next.common.k1 += lens[1];
        for (point, eliminated) in next.points.iter_mut().zip(&eliminated) {
            let Some(eliminated) = eliminated else { continue };
            let mut side = eliminated.side;
            for (camera, w) in &eliminated.cameras {
                side -= w.transpose() * step.fixed_rows::<6>(6 * camera);
            }
            side -= eliminated.lens.transpose() * lens;
            *point += eliminated.inverse * side;
        }
        next.poses.iter().all(|pose| pose.position.iter().all(|c| c.is_finite())).then_some(next)
    }

    /// Distance of each observation of a point from its image, pixels; infinite behind a camera.
    pub fn distances(&self, point: usize) -> impl Iterator<Item = f64> + '_ {
        let position = &self.points[point];
        self.observations[point].iter().map(|o| self.residual(position, o).map_or(f64::INFINITY, |r| r.norm()))
    }
}

/// What eliminating a point leaves behind, to find its step afterwards.
struct Eliminated {
    inverse: Matrix3<f64>,
    side: Vector3<f64>,
    cameras: Vec<(usize, Matrix6x3<f64>)>,
    lens: SMatrix<f64, 2, 3>,
}

/// The system of the cameras and the lens, after the points are eliminated: the upper triangle.
struct Reduced {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    lens: usize,
}

impl Reduced {
    fn new(cameras: usize) -> Self {
        let lens = 6 * cameras;
        Self { matrix: DMatrix::zeros(lens + 2, lens + 2), right: DVector::zeros(lens + 2), lens }
    }

    /// Adds a point's observations, and eliminates the point unless it stands still.
    fn add_point(
        &mut self,
        bundle: &Bundle,
        point: &Vector3<f64>,
        observations: &[Observation],
        free: Free,
        damping: f64,
    ) -> Option<Eliminated> {
        let lens = self.lens;
        let mut v = Matrix3::<f64>::zeros();
        let mut side = Vector3::<f64>::zeros();
        let mut cameras: Vec<(usize, Matrix6x3<f64>)> = Vec::with_capacity(observations.len());
        let mut by_lens = SMatrix::<f64, 2, 3>::zeros();
        for observation in observations {
            if matches!(free, Free::Camera(camera) if camera != observation.camera) {
                continue;
            }
            let Some(linear) = bundle.linear(point, observation) else { continue };
            let length = linear.residual.norm();
            let weight = if length <= HUBER_PX { 1.0 } else { HUBER_PX / length };
            let at = 6 * observation.camera;
            let weighted = linear.camera.transpose() * weight;
            let mut block = self.matrix.fixed_view_mut::<6, 6>(at, at);
            block += weighted * linear.camera;
            let mut rows = self.right.fixed_rows_mut::<6>(at);
            rows += weighted * linear.residual;
            if free == Free::MotionAndLens {
                let mut block = self.matrix.fixed_view_mut::<6, 2>(at, lens);
                block += weighted * linear.lens;
                let weighted = linear.lens.transpose() * weight;
                let mut block = self.matrix.fixed_view_mut::<2, 2>(lens, lens);
                block += weighted * linear.lens;
                let mut rows = self.right.fixed_rows_mut::<2>(lens);
                rows += weighted * linear.residual;
                by_lens += weighted * linear.point;
            }
            v += linear.point.transpose() * linear.point * weight;
            side += linear.point.transpose() * linear.residual * weight;
            cameras.push((observation.camera, weighted * linear.point));
        }
        if matches!(free, Free::Camera(_)) {
            return None;
        }
        for axis in 0..3 {
            v[(axis, axis)] += damping * v[(axis, axis)] + 1e-12;
        }
        let inverse = v.try_inverse()?;
        for (number, (one, w)) in cameras.iter().enumerate() {
            let folded = w * inverse;
            let mut rows = self.right.fixed_rows_mut::<6>(6 * one);
            rows -= folded * side;
            // Cameras of a point ascend.
            for (other, u) in cameras.iter().skip(number) {
                let mut block = self.matrix.fixed_view_mut::<6, 6>(6 * one, 6 * other);
                block -= folded * u.transpose();
            }
            let mut block = self.matrix.fixed_view_mut::<6, 2>(6 * one, lens);
            block -= folded * by_lens.transpose();
        }
        let folded = by_lens * inverse;
        let mut block = self.matrix.fixed_view_mut::<2, 2>(lens, lens);
        block -= folded * by_lens.transpose();
        let mut rows = self.right.fixed_rows_mut::<2>(lens);
        rows -= folded * side;
        Some(Eliminated { inverse, side, cameras, lens: by_lens })
    }

    /// The step; zero for what stands still.
    fn solve(mut self, free: Free, damping: f64) -> Option<DVector<f64>> {
        let lens = self.lens;
        let fixed = |unknown: usize| match free {
            Free::Motion => unknown < 6 || unknown >= lens,
            Free::MotionAndLens => unknown < 6,
            Free::Camera(camera) => unknown / 6 != camera || unknown >= lens,
        };
        for row in 0..lens + 2 {
            for column in row + 1..lens + 2 {
                self.matrix[(column, row)] = self.matrix[(row, column)];
            }
        }
        for unknown in 0..lens + 2 {
            if fixed(unknown) {
                self.matrix.row_mut(unknown).fill(0.0);
                self.matrix.column_mut(unknown).fill(0.0);
                self.matrix[(unknown, unknown)] = 1.0;
                self.right[unknown] = 0.0;
            } else {
                self.matrix[(unknown, unknown)] += damping * self.matrix[(unknown, unknown)].abs() + 1e-12;
            }
        }
        Some(self.matrix.cholesky()?.solve(&self.right))
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
                        let seen = bundle.residual(point, &Observation { camera, at: [0.0; 2] }).unwrap();
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
        let adjusted = bundle.adjust(Free::Motion, 30);
        assert!(adjusted.rms_px < 1e-3, "{adjusted:?}");
        assert_eq!(adjusted.observations, 480);
    }

    #[test]
    fn the_lens_is_found_too() {
        let truth = Common { log_focal: 0.04, k1: -0.05 };
        let mut bundle = shaken(arc(truth));
        bundle.common = Common { log_focal: 0.0, k1: 0.0 };
        let adjusted = bundle.adjust(Free::MotionAndLens, 60);
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
        bundle.adjust(Free::Camera(3), 50);
        assert!((bundle.poses[3].position - truth.poses[3].position).norm() < 0.02, "{:?}", bundle.poses[3].position);
        assert_eq!(bundle.poses[2], truth.poses[2]);
    }
}
