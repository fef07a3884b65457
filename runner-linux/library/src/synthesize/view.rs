//! A picture with its lens and, once it is known, its place; and points that several views see.

use std::path::Path;

use daymark_core::camera::triangulate::Pinhole;
use daymark_numerics::sample;
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

    /// The mean gray level around a point of the picture, 0 to 255 ([`sample::mean_gray_at`]).
    pub fn mean_gray_at(&self, at: [f64; 2]) -> f32 {
        sample::mean_gray_at(&self.gray, at)
    }

    /// Red, green and blue at a point of the picture, 0 to 255 ([`sample::colour_at`]).
    pub fn colour_at(&self, at: [f64; 2]) -> [f32; 3] {
        sample::colour_at(&self.gray, &self.rgb, at)
    }
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
        Some(Self { pose, pinhole: lens.pinhole_at(&pose)? })
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
