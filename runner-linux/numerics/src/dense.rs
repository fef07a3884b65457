//! The points of a level of subdivision, with deviations and colours.

use daymark_core::camera::triangulate::Pinhole;
use daymark_core::mesh::{MeshError, Subdivision};
use daymark_engine::gray::GrayImage;

use crate::sample::{colour_at, mean_gray_at};

/// The points of a level of a surface.
#[derive(Debug, Clone, Default)]
pub struct Subdivided {
    /// Their positions.
    pub positions: Vec<[f32; 3]>,
    /// Roots of the traces of their covariances.
    pub deviations: Vec<f32>,
    /// The value of the triangle that each belongs to; the first one's if there are more, `u32::MAX` without any.
    pub values: Vec<u32>,
    /// The triangles of the level.
    pub triangles: Vec<[u32; 3]>,
}

/// The points and triangles of a level. `corners` and `variances` (traces of covariances) have an entry for each vertex,
/// `values` one for each triangle.
///
/// A point between corners `a, b, c` with weights `w` is `sum w p`: its covariance is `sum w² C`, because corners are
/// triangulated independently.
///
/// # Errors
/// [`MeshError`] for lists of other lengths and positions that are none.
pub fn subdivided(
    fine: &Subdivision<'_>,
    corners: &[[f32; 3]],
    variances: &[f64],
    values: &[u32],
) -> Result<Subdivided, MeshError> {
    let counts = fine.counts();
    let mut positions = vec![[0.0; 3]; counts.vertices as usize];
    fine.write_values(corners, &mut positions)?;
    let mut triangles = vec![[0; 3]; counts.triangles as usize];
    fine.write_triangles(&mut triangles)?;
    let share = 1.0 / f64::from(fine.level().steps());
    let mut deviations = Vec::with_capacity(positions.len());
    let mut values_of_points = Vec::with_capacity(positions.len());
    fine.points().for_each(|point| {
        let [a, b, c] = point.corners.map(|corner| variances[usize::from(corner)]);
        let [u, v, w] = point.weights.map(|weight| f64::from(weight) * share);
        deviations.push(libm::sqrt(u * u * a + v * v * b + w * w * c) as f32);
        let value = point.triangle.and_then(|triangle| values.get(triangle as usize).copied());
        values_of_points.push(value.unwrap_or(u32::MAX));
    });
    Ok(Subdivided { positions, deviations, values: values_of_points, triangles })
}

/// A picture and the camera that took it.
pub struct Shown<'a> {
    /// Its gray levels.
    pub gray: &'a GrayImage,
    /// Its colours, rows packed; empty for a gray picture.
    pub rgb: &'a [u8],
    /// The camera without distortion.
    pub pinhole: &'a Pinhole,
    /// Where the picture has what would be at a pixel without distortion; `None` for a lens without.
    pub picture_from_ideal: Option<&'a (dyn Fn([f64; 2]) -> [f64; 2] + Sync)>,
}

impl Shown<'_> {
    /// Gray levels (0 to 1) and colours of points; those behind the camera stay as they are.
    pub fn colour(&self, positions: &[[f32; 3]], gray: &mut [f32], rgb: &mut [[u8; 3]]) {
        for ((position, gray), rgb) in positions.iter().zip(gray).zip(rgb) {
            let Some(at) = self.pinhole.project(position.map(f64::from)) else { continue };
            let at = self.picture_from_ideal.map_or(at, |map| map(at));
            // What a point stands for is more than a pixel's middle.
            *gray = mean_gray_at(self.gray, at) / 255.0;
            *rgb = colour_at(self.gray, self.rgb, at).map(|channel| (channel + 0.5) as u8);
        }
    }
}

impl std::fmt::Debug for Shown<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shown").field("pinhole", self.pinhole).finish_non_exhaustive()
    }
}
