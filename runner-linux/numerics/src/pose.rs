//! Where a camera stands.

use nalgebra::{Matrix3, Vector3};

/// Where a camera stands and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The rotation: the view frame has x right, y down, z forward.
    pub view_from_model: Matrix3<f64>,
    /// The pinhole in the model frame.
    pub position: Vector3<f64>,
}

impl Pose {
    /// At the origin, the axes of the view are those of the model.
    pub fn identity() -> Self {
        Self { view_from_model: Matrix3::identity(), position: Vector3::zeros() }
    }

    /// From `x_view = R x_model + t`.
    pub fn from_translation(view_from_model: Matrix3<f64>, translation: Vector3<f64>) -> Self {
        Self { view_from_model, position: -(view_from_model.transpose() * translation) }
    }

    /// `t` of `x_view = R x_model + t`.
    pub fn translation(&self) -> Vector3<f64> {
        -(self.view_from_model * self.position)
    }

    /// A point of the model in the view frame.
    pub fn to_view(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.view_from_model * (point - self.position)
    }
}
