//! Where a camera stands and how it is turned, as a map of points.

use super::space::{Matrix, Vector, apply, apply_transposed, cross, dot, minus, plus, product, scaled, unit};

/// `x_camera = R x_model + t`: a rotation without mirroring, and a translation in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFromModel {
    rotation: Matrix,
    translation: Vector,
}

/// How far `R R^T` may be from the identity, by entry.
const ORTHONORMAL: f64 = 1e-6;

impl CameraFromModel {
    /// From the rows of a rotation and a translation in metres. `None` unless the rows are orthonormal to 1e-6 and
    /// right-handed, and all is finite.
    pub fn new(rotation: [[f64; 3]; 3], translation: [f64; 3]) -> Option<Self> {
        let [a, b, c] = rotation;
        let near = |found: f64, expected: f64| (found - expected).abs() <= ORTHONORMAL;
        let square = near(dot(a, b), 0.0) && near(dot(b, c), 0.0) && near(dot(a, c), 0.0);
        let sound = square && near(dot(a, a), 1.0) && near(dot(b, b), 1.0) && near(dot(cross(a, b), c), 1.0);
        (sound && translation.iter().all(|t| t.is_finite())).then_some(Self { rotation, translation })
    }

    /// From numbers that are known to be right.
    pub(super) const fn of_parts(rotation: Matrix, translation: Vector) -> Self {
        Self { rotation, translation }
    }

    /// The camera's axes (right, down, forward) in the model frame, as rows.
    pub const fn rotation(&self) -> &[[f64; 3]; 3] {
        &self.rotation
    }

    /// The model's origin in the camera frame, metres.
    pub const fn translation(&self) -> [f64; 3] {
        self.translation
    }

    /// A point of the model in the camera frame.
    #[inline]
    pub fn apply(&self, model: [f64; 3]) -> [f64; 3] {
        plus(apply(&self.rotation, model), self.translation)
    }

    /// The centre of projection in the model frame: `-R^T t`.
    pub fn centre(&self) -> [f64; 3] {
        scaled(apply_transposed(&self.rotation, self.translation), -1.0)
    }

    /// The direction of the optical axis in the model frame, of length one.
    pub const fn axis(&self) -> [f64; 3] {
        self.rotation[2]
    }

    /// Cosine of the angle by which two cameras are turned against each other: `(trace(A B^T) - 1) / 2`.
    pub fn cosine_to(&self, other: &Self) -> f64 {
        let [a, b, c] = self.rotation;
        let [d, e, f] = other.rotation;
        (dot(a, d) + dot(b, e) + dot(c, f) - 1.0) / 2.0
    }

    /// The same camera when the model's points are given from another origin: `origin` is the new one in the old frame.
    pub(super) fn about(&self, origin: Vector) -> Self {
        Self { rotation: self.rotation, translation: self.apply(origin) }
    }

    /// A small turn `w` (radians, in the camera frame, about the model's origin) and step `t` (metres).
    ///
    /// The turn is Cayley's, `((1 - a.a) I + 2 a a^T + 2 [a]x) / (1 + a.a)` with `a = w / 2`: a rotation for every `w`, equal to
    /// the exponential up to the third order, without sine or cosine.
    pub(super) fn moved(&self, w: Vector, t: Vector) -> Option<Self> {
        let a = scaled(w, 0.5);
        let square = dot(a, a);
        let norm = 1.0 / (1.0 + square);
        let [x, y, z] = a;
        let diagonal = 1.0 - square;
        let turn = [
            [diagonal + 2.0 * x * x, 2.0 * (x * y - z), 2.0 * (x * z + y)],
            [2.0 * (x * y + z), diagonal + 2.0 * y * y, 2.0 * (y * z - x)],
            [2.0 * (x * z - y), 2.0 * (y * z + x), diagonal + 2.0 * z * z],
        ]
        .map(|row| scaled(row, norm));
        let [right, down, _] = product(&turn, &self.rotation);
        // Rounding of many steps must not add up.
        let right = unit(right)?;
        let down = unit(minus(down, scaled(right, dot(right, down))))?;
        let rotation = [right, down, cross(right, down)];
        Some(Self { rotation, translation: plus(self.translation, t) })
    }

    /// Necker's reversal: the pose that shows a plane through the model's origin with the unit `normal` almost alike, its depths
    /// mirrored along the line of sight to the origin.
    pub(super) fn reversed(&self, normal: Vector) -> Option<Self> {
        let sight = unit(self.translation)?;
        // Two reflections: of the model at the plane, of the camera frame at the plane across the line of sight.
        let mirror = |axis: Vector, point: Vector| minus(point, scaled(axis, 2.0 * dot(axis, point)));
        let columns = super::space::transposed(&self.rotation);
        let reflected = columns.map(|column| mirror(sight, column));
        let rotation = super::space::transposed(&reflected).map(|row| mirror(normal, row));
        Some(Self { rotation, translation: self.translation })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::space::{IDENTITY, length};

    #[test]
    fn moves_stay_rotations() {
        let mut pose = CameraFromModel::of_parts(IDENTITY, [0.0, 0.0, 9.0]);
        for step in 0..200 {
            let w = [0.3 - f64::from(step) * 0.01, 0.1, f64::from(step % 7) * 0.2];
            pose = pose.moved(w, [0.1, 0.0, 0.0]).expect("finite");
        }
        assert!(CameraFromModel::new(pose.rotation, pose.translation).is_some());
        assert!((pose.translation[0] - 20.0).abs() < 1e-9);
    }

    #[test]
    fn a_small_turn_is_right_handed() {
        let pose = CameraFromModel::of_parts(IDENTITY, [0.0; 3]).moved([0.0, 0.0, 1e-4], [0.0; 3]).expect("finite");
        let [x, y, _] = pose.apply([1.0, 0.0, 0.0]);
        assert!((x - 1.0).abs() < 1e-7 && (y - 1e-4).abs() < 1e-10, "{x} {y}");
    }

    #[test]
    fn reversal_keeps_the_image_of_the_plane_and_mirrors_depth() {
        let turned = CameraFromModel::of_parts(IDENTITY, [0.0, 0.0, 1e6]).moved([0.4, -0.3, 0.2], [0.0; 3]);
        let pose = turned.expect("finite");
        let other = pose.reversed([0.0, 0.0, 1.0]).expect("finite");
        assert!(CameraFromModel::new(other.rotation, other.translation).is_some(), "{other:?}");
        for point in [[3.0, 1.0, 0.0], [-2.0, 5.0, 0.0]] {
            let (one, two) = (pose.apply(point), other.apply(point));
            let expected = [one[0], one[1], 2e6 - one[2]];
            assert!(length(minus(two, expected)) < 1e-6, "{one:?} {two:?}");
        }
    }

    #[test]
    fn no_mirror_is_a_camera() {
        let mirrored = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(CameraFromModel::new(mirrored, [0.0; 3]), None);
        assert_eq!(CameraFromModel::new(IDENTITY, [f64::NAN, 0.0, 0.0]), None);
    }
}
