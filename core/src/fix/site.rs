//! Where a landmark's model stands on Earth, and the fixes that follow from seeing it.

use super::geodesy::{LocalFrame, Wgs84};
use super::plane::{DEGREE, azimuth_deg};
use super::{Evidence, Fix, Measured};
use crate::camera::CameraFromModel;
use crate::camera::direction::Direction;
use crate::camera::pose::Pose;
use crate::camera::space::{Matrix, Vector, apply, cross, dot, minus, product, scaled, transposed};
use crate::math::{sin_cos, sqrt_f64};

/// Where a model stands: its origin and the azimuth of its +y axis, which points into the building from its front.
///
/// Model frame: right-handed, metres, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// The model's origin.
    pub position: Wgs84,
    /// Azimuth of the model's +y axis, degrees: an observer who faces the front looks this way.
    pub azimuth_deg: f64,
    /// How well the origin is known: standard deviation in each direction, metres.
    pub deviation_m: f64,
    /// How well the azimuth is known: standard deviation, degrees.
    pub azimuth_deviation_deg: f64,
}

impl Site {
    /// Known exactly.
    pub const fn exact(position: Wgs84, azimuth_deg: f64) -> Self {
        Self { position, azimuth_deg, deviation_m: 0.0, azimuth_deviation_deg: 0.0 }
    }

    /// The rotation from the model frame to east-north-up.
    fn local_from_model(&self) -> Matrix {
        let (sin, cos) = sin_cos(self.azimuth_deg * DEGREE);
        [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]
    }

    /// A point of the model in the east-north-up frame of `frame`: models of several landmarks in one frame of reference, so
    /// that their corners can be solved together.
    pub fn point_in(&self, frame: &LocalFrame, model: [f64; 3]) -> [f64; 3] {
        // Through Earth-centred coordinates, because "up" differs between two places.
        let here = LocalFrame::new(self.position);
        frame.local_from_wgs84(here.wgs84_from_local(apply(&self.local_from_model(), model)))
    }

    /// The fix of a pose of this model.
    pub fn fix(&self, pose: &Pose) -> Fix {
        self.fix_of(&pose.camera_from_model, pose)
    }

    /// The fix on the other side, if the frame leaves it open.
    pub fn rival(&self, pose: &Pose) -> Option<Fix> {
        pose.rival.map(|rival| self.fix_of(&rival, pose))
    }

    fn fix_of(&self, camera: &CameraFromModel, pose: &Pose) -> Fix {
        let turn = self.local_from_model();
        let local = apply(&turn, camera.centre());
        let covariance = self.with_own(turned(&turn, &pose.covariance), local);
        let axis = apply(&turn, camera.axis());
        let (bearing, range) = to_origin(local, &covariance);
        Fix {
            position: LocalFrame::new(self.position).wgs84_from_local(local),
            covariance,
            bearing_deg: bearing,
            range_m: range,
            heading_deg: self.heading(camera, axis, pose),
            evidence: Evidence::Corners {
                inliers: pose.inliers,
                points: pose.points,
                residual_px: pose.residual_px,
                log2_chance: pose.log2_chance,
            },
        }
    }

    /// Adds what is unknown of the site itself: its place, and a turn about its origin that moves the observer sideways.
    fn with_own(&self, covariance: Matrix, [east, north, _]: Vector) -> Matrix {
        let place = self.deviation_m * self.deviation_m;
        let turn = self.azimuth_deviation_deg * DEGREE;
        let side = [north * turn, -east * turn, 0.0];
        let mut sum = covariance;
        for (number, (row, x)) in sum.iter_mut().zip(side).enumerate() {
            for (entry, y) in row.iter_mut().zip(side) {
                *entry += x * y;
            }
            if let Some(diagonal) = row.get_mut(number) {
                *diagonal += place;
            }
        }
        sum
    }

    /// Where the axis points; a turn w of the camera moves the axis by `-R^T (w x z)`.
    fn heading(&self, camera: &CameraFromModel, [east, north, _]: Vector, pose: &Pose) -> Option<Measured> {
        let level = east * east + north * north;
        if !(level > 1e-6) {
            return None;
        }
        let turn = self.local_from_model();
        let local_from_camera = product(&turn, &transposed(camera.rotation()));
        // d azimuth = (north d east - east d north) / level.
        let across = [north / level, -east / level, 0.0];
        let in_camera = crate::camera::space::apply_transposed(&local_from_camera, across);
        // across . (-(w x z)) = w . (-(z x across)).
        let gradient = scaled(cross([0.0, 0.0, 1.0], in_camera), -1.0);
        let [.., a, b, c] = pose.covariance;
        let part: Matrix = [a, b, c].map(|[.., x, y, z]| [x, y, z]);
        let own = self.azimuth_deviation_deg * DEGREE;
        let variance = dot(gradient, apply(&part, gradient)) + own * own;
        Some(Measured { value: azimuth_deg(east, north), deviation: sqrt_f64(variance) / DEGREE })
    }

    /// The fix of a direction without a known lens: the middle of the interval of ranges, which is taken as two deviations either
    /// way.
    pub fn fix_without_lens(&self, direction: &Direction) -> Fix {
        let turn = self.local_from_model();
        let [near, far] = direction.range_m;
        let local = apply(&turn, direction.at(direction.middle()));
        let sight = apply(&turn, direction.towards_observer);
        let along = (far - near) / 4.0;
        let cosine = direction.cosine_of_error.clamp(-1.0, 1.0);
        let across = far * sqrt_f64(1.0 - cosine * cosine) / 2.0;
        let mut covariance = [[0.0; 3]; 3];
        for (number, (row, x)) in covariance.iter_mut().zip(sight).enumerate() {
            for (entry, y) in row.iter_mut().zip(sight) {
                *entry = (along * along - across * across) * x * y;
            }
            if let Some(diagonal) = row.get_mut(number) {
                *diagonal += across * across;
            }
        }
        let covariance = self.with_own(covariance, local);
        let (bearing_deg, range_m) = to_origin(local, &covariance);
        Fix {
            position: LocalFrame::new(self.position).wgs84_from_local(local),
            covariance,
            bearing_deg,
            range_m,
            heading_deg: None,
            evidence: Evidence::CornersWithoutLens { range_m: direction.range_m },
        }
    }

    /// The building is seen, and can be recognized from `reach_m` metres at most: the observer is anywhere in a disc around it. The
    /// variance of a uniform disc is a quarter of its squared radius in each direction.
    pub fn near(&self, reach_m: f64) -> Fix {
        let variance = reach_m * reach_m / 4.0 + self.deviation_m * self.deviation_m;
        let up = self.deviation_m * self.deviation_m + reach_m * reach_m / 400.0;
        Fix {
            position: self.position,
            covariance: [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, up]],
            bearing_deg: None,
            range_m: None,
            heading_deg: None,
            evidence: Evidence::NearLandmark { reach_m },
        }
    }
}

/// How far a building of this size (metres) is at most that takes so many pixels, through a lens of at most this focal length, in
/// metres. `None` unless all are positive.
pub fn reach_of_size(size_m: f64, size_px: f64, longest_focal_px: f64) -> Option<f64> {
    let sound = [size_m, size_px, longest_focal_px].iter().all(|x| *x > 0.0 && x.is_finite());
    sound.then(|| size_m * longest_focal_px / size_px + size_m / 2.0)
}

/// The position's part of a pose's covariance, in another frame.
fn turned(turn: &Matrix, covariance: &[[f64; 6]; 6]) -> Matrix {
    let [a, b, c, ..] = *covariance;
    let part: Matrix = [a, b, c].map(|[x, y, z, ..]| [x, y, z]);
    product(&product(turn, &part), &transposed(turn))
}

/// Bearing and range from a local position to the origin; none where the observer stands on it.
fn to_origin([east, north, up]: Vector, covariance: &Matrix) -> (Option<Measured>, Option<Measured>) {
    let range = sqrt_f64(east * east + north * north);
    if !(range > 1e-3) {
        return (None, None);
    }
    let (along, across) = ([east / range, north / range, 0.0], [north / range, -east / range, 0.0]);
    let deviation = |direction: Vector| sqrt_f64(dot(direction, apply(covariance, direction)));
    let [east, north, _] = minus([0.0; 3], [east, north, up]);
    let bearing = Measured { value: azimuth_deg(east, north), deviation: deviation(across) / range / DEGREE };
    (Some(bearing), Some(Measured { value: range, deviation: deviation(along) }))
}
