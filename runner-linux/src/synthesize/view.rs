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
        let Some(spot) = Spot::of(self, at) else { return 0.0 };
        let pixel =
            |column: usize, row: usize| self.gray.pixels.get(row * spot.width + column).map_or(0.0, |&p| f64::from(p));
        let along = |row: usize| pixel(spot.left, row) * (1.0 - spot.fx) + pixel(spot.right, row) * spot.fx;
        along(spot.upper) * (1.0 - spot.fy) + along(spot.lower) * spot.fy
    }

    /// The mean of the gray levels half a pixel to the left and right, above and below.
    pub fn mean_gray_at(&self, at: [f64; 2]) -> f64 {
        let Some(Spot { left, upper, fx, fy, .. }) = Spot::of(self, [at[0] - 0.5, at[1] - 0.5]) else { return 0.0 };
        let (width, height) = (self.gray.width, self.gray.height);
        let row = |row: usize| self.gray.pixels.get((upper + row) * width + left..)?.first_chunk::<3>();
        if at[0] >= 0.5
            && at[1] >= 0.5
            && left + 2 < width
            && upper + 2 < height
            && let (Some(a), Some(b), Some(c)) = (row(0), row(1), row(2))
        {
            // The four squares between pixels overlap: nine pixels with the products of three weights.
            let along = |&[p, q, r]: &[u8; 3]| (1.0 - fx) * f64::from(p) + f64::from(q) + fx * f64::from(r);
            return 0.25 * ((1.0 - fy) * along(a) + along(b) + fy * along(c));
        }
        let offsets = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
        0.25 * offsets.iter().map(|[dx, dy]| self.gray_at([at[0] + dx, at[1] + dy])).sum::<f64>()
    }

    /// Red, green and blue at a point of the picture, 0 to 255.
    pub fn colour_at(&self, at: [f64; 2]) -> [f64; 3] {
        if self.rgb.is_empty() {
            return [self.gray_at(at); 3];
        }
        let Some(spot) = Spot::of(self, at) else { return [0.0; 3] };
        let pixel = |column: usize, row: usize| {
            let channels = self.rgb.get(3 * (row * spot.width + column)..).and_then(|rest| rest.first_chunk::<3>());
            channels.map_or([0.0; 3], |channels| channels.map(f64::from))
        };
        let along = |row: usize| {
            let (a, b) = (pixel(spot.left, row), pixel(spot.right, row));
            [0, 1, 2].map(|channel: usize| a[channel] * (1.0 - spot.fx) + b[channel] * spot.fx)
        };
        let (upper, lower) = (along(spot.upper), along(spot.lower));
        [0, 1, 2].map(|channel: usize| upper[channel] * (1.0 - spot.fy) + lower[channel] * spot.fy)
    }
}

/// The four pixels around a point of a picture, and where between them it lies.
struct Spot {
    width: usize,
    left: usize,
    right: usize,
    upper: usize,
    lower: usize,
    fx: f64,
    fy: f64,
}

impl Spot {
    /// `None` in an empty picture, or for a point that is none.
    fn of(view: &View, [x, y]: [f64; 2]) -> Option<Self> {
        let (width, height) = (view.gray.width, view.gray.height);
        if width == 0 || height == 0 || !x.is_finite() || !y.is_finite() {
            return None;
        }
        let place = |at: f64, length: usize| {
            let at = at.clamp(0.0, (length - 1) as f64);
            let first = (at as usize).min(length.saturating_sub(2));
            (first, (first + 1).min(length - 1), at - first as f64)
        };
        let ((left, right, fx), (upper, lower, fy)) = (place(x, width), place(y, height));
        Some(Self { width, left, right, upper, lower, fx, fy })
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
