//! A picture with its lens and, once it is known, its place; and points that several views see.

use std::path::Path;

use daymark_core::camera::triangulate::Pinhole;
use nalgebra::{Matrix3, Vector3};

use crate::camera_file::lens::{Lens, Pose};
use crate::picture::GrayImage;

/// A picture from which a model is made.
#[derive(Debug, Clone)]
pub struct View {
    /// Its name in reports: the file's name.
    pub name: String,
    /// Its gray levels.
    pub gray: GrayImage,
    /// Red, green, blue of each pixel, rows packed; empty for a gray picture.
    pub rgb: Vec<u8>,
    /// Its lens, for the size of `gray`.
    pub lens: Lens,
}

impl View {
    /// The name of a file without its folder.
    pub fn name_of(path: &Path) -> String {
        path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
    }

    /// The gray level at a point of the picture, between pixels linearly; beyond the border the border's.
    pub fn gray_at(&self, at: [f64; 2]) -> f64 {
        interpolated(&self.gray.pixels, 1, 0, self.gray.width, self.gray.height, at)
    }

    /// Red, green and blue at a point of the picture, 0 to 255.
    pub fn colour_at(&self, at: [f64; 2]) -> [f64; 3] {
        if self.rgb.is_empty() {
            return [self.gray_at(at); 3];
        }
        [0, 1, 2].map(|channel| interpolated(&self.rgb, 3, channel, self.gray.width, self.gray.height, at))
    }
}

fn interpolated(pixels: &[u8], channels: usize, channel: usize, width: usize, height: usize, [x, y]: [f64; 2]) -> f64 {
    if width == 0 || height == 0 || !x.is_finite() || !y.is_finite() {
        return 0.0;
    }
    let place = |at: f64, length: usize| {
        let at = at.clamp(0.0, (length - 1) as f64);
        let first = (at as usize).min(length.saturating_sub(2));
        (first, (first + 1).min(length - 1), at - first as f64)
    };
    let ((left, right, fx), (upper, lower, fy)) = (place(x, width), place(y, height));
    let pixel = |column: usize, row: usize| f64::from(pixels[(row * width + column) * channels + channel]);
    let along = |row: usize| pixel(left, row) * (1.0 - fx) + pixel(right, row) * fx;
    along(upper) * (1.0 - fy) + along(lower) * fy
}

/// A camera whose place is known.
#[derive(Debug, Clone, Copy)]
pub struct Station {
    /// The place.
    pub pose: Pose,
    /// The camera without distortion.
    pub pinhole: Pinhole,
}

impl Station {
    /// A lens in a place; `None` for a lens without focal length.
    pub fn new(lens: &Lens, pose: Pose) -> Option<Self> {
        Some(Self { pose, pinhole: pose.pinhole(lens)? })
    }
}

/// One point of the building, as views see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Its number: a corner's number if corners are numbered, else counted.
    pub number: u32,
    /// The views that see it, ascending, and where: pixels without distortion.
    pub sightings: Vec<(usize, [f64; 2])>,
}

impl Track {
    /// Where a view sees it.
    pub fn seen_by(&self, view: usize) -> Option<[f64; 2]> {
        self.sightings.iter().find(|sighting| sighting.0 == view).map(|sighting| sighting.1)
    }
}

/// A point of the model that was triangulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Vertex {
    /// Where it is, in the model frame.
    pub position: Vector3<f64>,
    /// Covariance of the position, in squared units of the model.
    pub covariance: Matrix3<f64>,
    /// What views see of it.
    pub track: Track,
    /// Root mean square distance of its images from its sightings, in pixels.
    pub reprojection_px: f64,
    /// Largest angle between two of its rays, in degrees.
    pub parallax_degree: f64,
}

/// Triangles between points, counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// The points.
    pub vertices: Vec<Vertex>,
    /// Triangles, as numbers of vertices.
    pub triangles: Vec<[u32; 3]>,
}
