//! Angles and 2 x 2 matrices of the ground plane.

use crate::math::{atan2, sqrt_f64};

pub(super) const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// Degrees from north towards east of a direction (east, north), 0..360.
pub(super) fn azimuth_deg(east: f64, north: f64) -> f64 {
    full_turn(atan2(east, north) / DEGREE)
}

/// An angle from -360 to 360 degrees in 0..360.
pub(super) fn full_turn(degrees: f64) -> f64 {
    let turned = if degrees < 0.0 { degrees + 360.0 } else { degrees };
    if turned >= 360.0 { turned - 360.0 } else { turned }
}

/// The difference of two azimuths in -180..180 degrees.
pub(super) fn difference_deg(one: f64, two: f64) -> f64 {
    let turns = crate::math::floor((one - two + 180.0) / 360.0);
    one - two - 360.0 * turns
}

pub(super) type Matrix2 = [[f64; 2]; 2];

/// `None` if it is singular up to rounding.
pub(super) fn inverse([[a, b], [c, d]]: Matrix2) -> Option<Matrix2> {
    let determinant = a * d - b * c;
    let sound = determinant.abs() > 1e-14 * (a * d).abs() && determinant.is_finite();
    sound.then(|| [[d / determinant, -b / determinant], [-c / determinant, a / determinant]])
}

/// `v^T M^-1 v`; infinite if the matrix has no inverse.
pub(super) fn mahalanobis(matrix: Matrix2, [x, y]: [f64; 2]) -> f64 {
    inverse(matrix).map_or(f64::INFINITY, |[[a, b], [c, d]]| x * (a * x + b * y) + y * (c * x + d * y))
}

pub(super) fn length([x, y]: [f64; 2]) -> f64 {
    sqrt_f64(x * x + y * y)
}
