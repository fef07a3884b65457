//! What a camera is, apart from its place: size, focal length, principal point, distortion; and its place.

use daymark_core::camera::triangulate::Pinhole;
pub use daymark_numerics::pose::Pose;
use nalgebra::Matrix3;

use super::distortion::Distortion;

/// A lens before a sensor. Pixels have their origin at the centre of the top-left pixel, x right, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length in widths and in heights of a pixel.
    pub focal: [f64; 2],
    /// Principal point, in pixels.
    pub centre: [f64; 2],
    /// How far x moves with y in normalized coordinates, in pixels; 0 for nearly every camera.
    pub skew: f64,
    /// What the lens does to straight lines.
    pub distortion: Distortion,
}

impl Lens {
    /// Square pixels, the principal point in the middle, no distortion.
    pub fn of_focal(width: u32, height: u32, focal: f64) -> Self {
        let middle = |length: u32| (f64::from(length) - 1.0) / 2.0;
        Self {
            width,
            height,
            focal: [focal; 2],
            centre: [middle(width), middle(height)],
            skew: 0.0,
            distortion: Distortion::None,
        }
    }

    /// The calibration matrix `K`.
    pub fn matrix(&self) -> Matrix3<f64> {
        let ([fx, fy], [cx, cy]) = (self.focal, self.centre);
        Matrix3::new(fx, self.skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    }

    /// The same lens for the same picture scaled to another size; pixel areas align.
    #[must_use]
    pub fn scaled_to(&self, width: u32, height: u32) -> Self {
        let scale = [f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height)];
        let centre = |axis: usize| (self.centre[axis] + 0.5) * scale[axis] - 0.5;
        Self {
            width,
            height,
            focal: [self.focal[0] * scale[0], self.focal[1] * scale[1]],
            centre: [centre(0), centre(1)],
            skew: self.skew * scale[0],
            distortion: self.distortion,
        }
    }

    /// Normalized coordinates `(X / Z, Y / Z)` of a pixel without distortion.
    pub fn normalized_from_ideal(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let v = (y - self.centre[1]) / self.focal[1];
        [(x - self.centre[0] - self.skew * v) / self.focal[0], v]
    }

    /// The pixel without distortion of normalized coordinates.
    pub fn ideal_from_normalized(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.focal[0] * x + self.skew * y + self.centre[0], self.focal[1] * y + self.centre[1]]
    }

    /// Where a pixel of the picture would be if the lens had no distortion. `None` where the model of the distortion
    /// folds over: no ray comes from there.
    pub fn ideal_from_picture(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        if self.distortion == Distortion::None {
            return Some(pixel);
        }
        Some(self.ideal_from_normalized(self.distortion.undo(self.normalized_from_ideal(pixel))?))
    }

    /// Where the picture shows what would be at this pixel without distortion.
    pub fn picture_from_ideal(&self, pixel: [f64; 2]) -> [f64; 2] {
        if self.distortion == Distortion::None {
            return pixel;
        }
        self.ideal_from_normalized(self.distortion.apply(self.normalized_from_ideal(pixel)))
    }

    /// The camera without distortion in a place; `None` for a lens without focal length.
    pub fn pinhole_at(&self, pose: &Pose) -> Option<Pinhole> {
        let matrix = self.matrix() * pose.view_from_model;
        let rows = [0, 1, 2].map(|row| [matrix[(row, 0)], matrix[(row, 1)], matrix[(row, 2)]]);
        Pinhole::new(rows, pose.position.into())
    }

    /// Whether a point of the picture lies on it.
    pub fn holds(&self, [x, y]: [f64; 2]) -> bool {
        x >= -0.5 && y >= -0.5 && x < f64::from(self.width) - 0.5 && y < f64::from(self.height) - 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scaled_lens_sees_the_same_directions() {
        let lens = Lens { centre: [330.0, 236.0], ..Lens::of_focal(640, 480, 560.0) };
        let half = lens.scaled_to(320, 240);
        // The centre of the picture's top-left corner (not of its pixel) is (-0.5, -0.5) in both.
        let (a, b) = (lens.normalized_from_ideal([-0.5, -0.5]), half.normalized_from_ideal([-0.5, -0.5]));
        assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-12, "{a:?} {b:?}");
    }

    #[test]
    fn distortion_is_undone() {
        let lens = Lens { distortion: Distortion::radial(-0.2, 0.05), skew: 0.7, ..Lens::of_focal(640, 480, 560.0) };
        for pixel in [[0.0, 0.0], [639.0, 3.0], [320.0, 240.0], [100.0, 420.0]] {
            let back = lens.picture_from_ideal(lens.ideal_from_picture(pixel).unwrap());
            assert!((back[0] - pixel[0]).abs() < 1e-9 && (back[1] - pixel[1]).abs() < 1e-9, "{pixel:?} {back:?}");
        }
    }
}
