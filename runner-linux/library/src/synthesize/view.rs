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

    /// The mean of the gray levels half a pixel to the left and right, above and below, 0 to 255; between pixels linearly,
    /// beyond the border the border's. 0 in an empty picture and for a point that is none.
    pub fn mean_gray_at(&self, at: [f64; 2]) -> f32 {
        let width = self.gray.width;
        if at[0] >= 0.5
            && at[1] >= 0.5
            && let Some(Spot { left, upper, fx, fy, .. }) = Spot::of(self, [at[0] - 0.5, at[1] - 0.5])
            && left + 2 < width
            && let Some(rest) = self.gray.pixels.get(upper + left..)
            && let (Some(a), Some(b), Some(c)) =
                (row_of(rest), row_of(skip(rest, width)), row_of(skip(rest, 2 * width)))
        {
            // The four squares between pixels overlap: nine pixels with the products of three weights.
            let along = |[p, q, r]: [u8; 3]| (1.0 - fx) * f32::from(p) + f32::from(q) + fx * f32::from(r);
            return 0.25 * ((1.0 - fy) * along(a) + along(b) + fy * along(c));
        }
        let offsets = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
        0.25 * offsets.iter().map(|[dx, dy]| self.gray_at([at[0] + dx, at[1] + dy])).sum::<f32>()
    }

    fn gray_at(&self, at: [f64; 2]) -> f32 {
        let pixel = |number: usize| [self.gray.pixels.get(number).map_or(0.0, |&pixel| f32::from(pixel))];
        Spot::of(self, at).map_or(0.0, |spot| spot.between(pixel)[0])
    }

    /// Red, green and blue at a point of the picture, 0 to 255, in the same way.
    pub fn colour_at(&self, at: [f64; 2]) -> [f32; 3] {
        if self.rgb.is_empty() {
            return [self.gray_at(at); 3];
        }
        let Some(spot) = Spot::of(self, at) else { return [0.0; 3] };
        // Four lanes are one vector; the fourth is the next pixel's.
        let pixel = |number: usize| {
            let rest = skip(&self.rgb, 3 * number);
            match rest.first_chunk::<4>() {
                Some(four) => four.map(f32::from),
                None => row_of(rest).map_or([0.0; 4], |[r, g, b]| [r, g, b, 0].map(f32::from)),
            }
        };
        let [r, g, b, _] = spot.between(pixel);
        [r, g, b]
    }
}

fn skip(values: &[u8], count: usize) -> &[u8] {
    values.get(count..).unwrap_or_default()
}

fn row_of(values: &[u8]) -> Option<[u8; 3]> {
    values.first_chunk::<3>().copied()
}

/// The four pixels around a point of a picture, and where between them it lies.
struct Spot {
    left: usize,
    right: usize,
    /// Numbers of the first pixels of the rows.
    upper: usize,
    lower: usize,
    fx: f32,
    fy: f32,
}

impl Spot {
    /// The value between those of the four pixels.
    #[inline]
    fn between<const N: usize>(&self, pixel: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        let mix = |a: [f32; N], b: [f32; N], share: f32| {
            let mut mixed = a;
            for (mixed, b) in mixed.iter_mut().zip(b) {
                *mixed += (b - *mixed) * share;
            }
            mixed
        };
        let upper = mix(pixel(self.upper + self.left), pixel(self.upper + self.right), self.fx);
        let lower = mix(pixel(self.lower + self.left), pixel(self.lower + self.right), self.fx);
        mix(upper, lower, self.fy)
    }

    /// `None` in an empty picture, or for a point that is none.
    #[inline]
    fn of(view: &View, [x, y]: [f64; 2]) -> Option<Self> {
        let (width, height) = (view.gray.width, view.gray.height);
        if width == 0 || height == 0 || !x.is_finite() || !y.is_finite() {
            return None;
        }
        // Pictures are shorter than 2^31 pixels; 32 bits are converted faster.
        let place = |at: f64, length: usize| {
            let last = length as i32 - 1;
            let most = f64::from(last);
            let at = if at > 0.0 { if at < most { at } else { most } } else { 0.0 };
            let first = (at as i32).min((last - 1).max(0));
            (first as usize, (first + 1).min(last) as usize, (at - f64::from(first)) as f32)
        };
        let ((left, right, fx), (upper, lower, fy)) = (place(x, width), place(y, height));
        Some(Self { left, right, upper: upper * width, lower: lower * width, fx, fy })
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
