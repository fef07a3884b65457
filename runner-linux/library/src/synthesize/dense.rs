//! The dense cloud: every point of a level of midpoint subdivision, with its deviation and its colour.

use std::fmt;

use daymark_core::mesh::{MeshCounts, MeshError, SubdivisionLevel, TriangleMesh, storage_words};
use daymark_numerics::dense::{Shown, Subdivided, subdivided};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::view::{Station, Surface, View};
use crate::camera_file::distortion::Distortion;

/// Points of a dense cloud, at most: with triangles 1.2 GB ([`BYTES_PER_POINT`]).
pub const MAX_POINTS: u64 = 24_000_000;
/// Bytes that a dense cloud takes for each of its points: position, deviation, colour, gray, and about two triangles.
pub const BYTES_PER_POINT: u64 = 12 + 4 + 3 + 4 + 2 * 12;
/// Points that are coloured by one task.
const CHUNK: usize = 1 << 14;

/// The points of a level of subdivision.
///
/// Points are the vertices of the surface, then those inside its edges, then those inside its triangles; triangles follow
/// the surface's, `4^level` for each.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseCloud {
    /// The level.
    pub level: SubdivisionLevel,
    /// Positions in the model frame.
    pub positions: Vec<[f32; 3]>,
    /// Root of the trace of each position's covariance.
    pub deviations: Vec<f32>,
    /// Gray level of each point in the view that shows its triangle best, 0 black to 1 white; NaN where no view does.
    pub gray: Vec<f32>,
    /// Red, green, blue of each point.
    pub rgb: Vec<[u8; 3]>,
    /// Triangles as numbers of points.
    pub triangles: Vec<[u32; 3]>,
}

/// Why there is no dense cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DenseError {
    /// The surface is none.
    Mesh(MeshError),
    /// More points than [`MAX_POINTS`].
    TooMany {
        /// The level.
        level: u8,
        /// Its points.
        points: u64,
    },
}

impl fmt::Display for DenseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(error) => write!(f, "the triangles are no surface: {error}"),
            Self::TooMany { level, points } => write!(
                f,
                "level {level} of this mesh has {points} points, {} MB; the limit is {MAX_POINTS}: give a smaller --levels",
                points * BYTES_PER_POINT / 1_000_000
            ),
        }
    }
}

impl std::error::Error for DenseError {}

/// The counts of a level, before anything is made.
///
/// # Errors
/// [`DenseError::Mesh`].
pub fn counts(surface: &Surface, level: SubdivisionLevel) -> Result<MeshCounts, DenseError> {
    let (triangles, mut storage) = prepared(surface)?;
    let mesh = TriangleMesh::new(surface.vertices.len(), &triangles, &mut storage).map_err(DenseError::Mesh)?;
    Ok(mesh.counts().at(level))
}

fn prepared(surface: &Surface) -> Result<(Vec<[u16; 3]>, Vec<u32>), DenseError> {
    let found = surface.vertices.len();
    let limit = daymark_core::mesh::MAX_VERTICES;
    if found > limit {
        return Err(DenseError::Mesh(MeshError::TooManyVertices { found, limit }));
    }
    let triangles = surface.triangles.iter().map(|triangle| triangle.map(|vertex| vertex as u16)).collect::<Vec<_>>();
    let storage = vec![0; storage_words(found, triangles.len())];
    Ok((triangles, storage))
}

/// The dense cloud of a surface, coloured by the views (`shown[t]` shows triangle `t`).
///
/// A point between corners `a, b, c` with weights `w` is `sum w p`: its covariance is `sum w² C`, because corners are
/// triangulated independently. The result does not depend on the number of threads.
///
/// # Errors
/// [`DenseError`].
pub fn dense(
    surface: &Surface,
    level: SubdivisionLevel,
    views: &[View],
    stations: &[Option<Station>],
    shown: &[Option<u32>],
) -> Result<DenseCloud, DenseError> {
    let (base, mut storage) = prepared(surface)?;
    let mesh = TriangleMesh::new(surface.vertices.len(), &base, &mut storage).map_err(DenseError::Mesh)?;
    let fine = mesh.subdivided(level);
    let counts = fine.counts();
    if counts.vertices > MAX_POINTS {
        return Err(DenseError::TooMany { level: level.number(), points: counts.vertices });
    }
    let corners: Vec<[f32; 3]> =
        surface.vertices.iter().map(|vertex| <[f64; 3]>::from(vertex.position).map(|c| c as f32)).collect();
    let variances: Vec<f64> = surface.vertices.iter().map(|vertex| vertex.covariance.trace()).collect();
    let values: Vec<u32> = shown.iter().map(|view| view.unwrap_or(u32::MAX)).collect();
    let Subdivided { positions, deviations, values: views_of_points, triangles } =
        subdivided(&fine, &corners, &variances, &values).map_err(DenseError::Mesh)?;
    let maps: Vec<_> = views.iter().map(|view| |at: [f64; 2]| view.lens.picture_from_ideal(at)).collect();
    let pictures: Vec<Option<Shown<'_>>> = views
        .iter()
        .zip(stations)
        .zip(&maps)
        .map(|((view, station), map)| {
            let straight = view.lens.distortion == Distortion::None;
            Some(Shown {
                gray: &view.gray,
                rgb: &view.rgb,
                pinhole: &station.as_ref()?.pinhole,
                picture_from_ideal: (!straight).then_some(map as _),
            })
        })
        .collect();
    let mut gray = vec![f32::NAN; positions.len()];
    let mut rgb = vec![[128; 3]; positions.len()];
    let of_points = positions.par_chunks(CHUNK).zip(views_of_points.par_chunks(CHUNK));
    of_points.zip(gray.par_chunks_mut(CHUNK).zip(rgb.par_chunks_mut(CHUNK))).for_each(
        |((points, numbers), colours)| {
            let (mut points, mut gray, mut rgb) = (points, colours.0, colours.1);
            // Points of a triangle follow each other.
            for run in numbers.chunk_by(|one, next| one == next) {
                let (run_points, run_gray, run_rgb);
                (run_points, points) = points.split_at(run.len());
                (run_gray, gray) = gray.split_at_mut(run.len());
                (run_rgb, rgb) = rgb.split_at_mut(run.len());
                if let Some(Some(picture)) = pictures.get(run[0] as usize) {
                    picture.colour(run_points, run_gray, run_rgb);
                }
            }
        },
    );
    Ok(DenseCloud { level, positions, deviations, gray, rgb, triangles })
}

impl DenseCloud {
    /// The colour of each triangle by the rule of the thesis (6.2): the mean of its three points'.
    pub fn patch_colours(&self) -> impl ExactSizeIterator<Item = [u8; 3]> + '_ {
        self.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|point| self.rgb[point as usize].map(u32::from));
            [0, 1, 2].map(|channel: usize| ((a[channel] + b[channel] + c[channel] + 1) / 3) as u8)
        })
    }

    /// The middle of all points.
    pub fn centroid(&self) -> Vector3<f64> {
        let sum = self
            .positions
            .iter()
            .fold(Vector3::zeros(), |sum, &[x, y, z]| sum + Vector3::new(f64::from(x), f64::from(y), f64::from(z)));
        sum / self.positions.len().max(1) as f64
    }
}
