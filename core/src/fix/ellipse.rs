//! The ellipse that holds the truth with 95 %.

use super::plane::{DEGREE, Matrix2, full_turn};
use crate::math::{atan2, sqrt_f64};

/// Half axes of the 95 % ellipse in standard deviations: the root of chi-square's 95 % point with two degrees, `sqrt(-2 ln 0.05)`.
pub const DEVIATIONS_95: f64 = 2.447_746_830_680_816;

/// An ellipse on the ground about the fix that holds the truth with 95 %, if errors are Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Longer half axis, metres.
    pub semi_major_m: f64,
    /// Shorter half axis, metres.
    pub semi_minor_m: f64,
    /// Direction of the longer one, degrees from north towards east, 0..180.
    pub orientation_deg: f64,
}

impl Ellipse {
    /// Of a covariance of (east, north), m².
    pub fn of_covariance([[ee, en], [_, nn]]: Matrix2) -> Self {
        let root = sqrt_f64((ee - nn) * (ee - nn) + 4.0 * en * en);
        let [major, minor] = [root, -root].map(|root| DEVIATIONS_95 * sqrt_f64((ee + nn + root) / 2.0));
        // tan 2a = 2 en / (nn - ee), from north.
        let orientation = full_turn(atan2(2.0 * en, nn - ee) / DEGREE / 2.0);
        let orientation_deg = if orientation >= 180.0 { orientation - 180.0 } else { orientation };
        Self { semi_major_m: major, semi_minor_m: minor, orientation_deg }
    }

    /// Radius of the circle about the fix that holds the truth with 95 %, metres.
    ///
    /// By Leenhouts' polynomial (*On the computation of bi-normal radial error*, Navigation 32, 1985), which the US standard for
    /// positional accuracy uses: within 0.1 %.
    pub fn radius(&self) -> f64 {
        let (major, minor) = (self.semi_major_m / DEVIATIONS_95, self.semi_minor_m / DEVIATIONS_95);
        if !(major > 0.0) {
            return 0.0;
        }
        let c = minor / major;
        major * (1.960_790 + c * (0.004_071 + c * (0.114_276 + c * 0.371_625)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_direction() {
        let along_east = Ellipse::of_covariance([[9.0, 0.0], [0.0, 1.0]]);
        assert!((along_east.semi_major_m - 3.0 * DEVIATIONS_95).abs() < 1e-12);
        assert!((along_east.orientation_deg - 90.0).abs() < 1e-12);
        let north_east = Ellipse::of_covariance([[5.0, 4.0], [4.0, 5.0]]);
        assert!((north_east.orientation_deg - 45.0).abs() < 1e-12);
        assert!((north_east.semi_major_m / north_east.semi_minor_m - 3.0).abs() < 1e-12);
        let north_west = Ellipse::of_covariance([[5.0, -4.0], [-4.0, 5.0]]);
        assert!((north_west.orientation_deg - 135.0).abs() < 1e-12);
    }

    /// Against the integral: points on a fine grid of the plane.
    #[test]
    fn the_circle_holds_95_percent() {
        for minor in [0.02, 0.3, 0.7, 1.0] {
            let radius = Ellipse::of_covariance([[1.0, 0.0], [0.0, minor * minor]]).radius();
            let step = 0.01;
            let (mut inside, mut all) = (0.0, 0.0);
            for i in -600..600 {
                for j in -600..600 {
                    let (u, v) = ((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                    let weight = libm::exp(-(u * u + v * v) / 2.0);
                    all += weight;
                    if u * u + v * v * minor * minor <= radius * radius {
                        inside += weight;
                    }
                }
            }
            assert!((inside / all - 0.95_f64).abs() < 0.001, "{minor}: {}", inside / all);
        }
    }
}
