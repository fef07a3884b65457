//! What is said about a model: numbers for people and programs.

use serde::Serialize;

use super::correspond::RemovedMatches;
use super::dense::DenseCloud;
use super::explain::Explained;
use super::mesh::Dropped;
use super::reconstruct::{PairFacts, Reconstruction, Shape};
use super::triangulate::Refusals;
use crate::order;

/// Version of the form of `--json`.
pub const SCHEMA_VERSION: u32 = 1;

/// Everything that is said about a model.
#[derive(Debug, Clone, Serialize)]
pub struct Facts {
    /// Version of this form.
    pub schema_version: u32,
    /// Version of the program.
    pub program_version: &'static str,
    /// What lengths and angles mean at all.
    pub shape: Shape,
    /// What a length of one means: `metre`, `camera_file_unit`, `first_baseline`, `model_height`, or `affine` for nothing.
    pub length_unit: &'static str,
    /// The views, in the order given.
    pub views: Vec<ViewFacts>,
    /// Pairs of views.
    pub pairs: Vec<PairFacts>,
    /// Tracks of corners that two views or more see.
    pub tracks: usize,
    /// Points of the model.
    pub points: usize,
    /// Triangles between them.
    pub triangles: usize,
    /// Level of subdivision, and what it has.
    pub level: u8,
    /// Points of the dense cloud.
    pub dense_points: usize,
    /// Triangles of the dense cloud.
    pub dense_triangles: usize,
    /// Bytes that the dense cloud takes in memory.
    pub dense_bytes: u64,
    /// Root mean square reprojection error over all sightings of the points, pixels of the size used.
    pub reprojection_rms_px: f64,
    /// Median of the largest angle between a point's rays, degrees.
    pub median_parallax_degree: f64,
    /// Median standard deviation of a point, in the length unit.
    pub median_deviation: f64,
    /// Lengths of the model's extent along x, y and z (98 % of the points), in the length unit.
    pub extent: [f64; 3],
    /// Matches that were removed.
    pub removed_matches: RemovedMatches,
    /// Points that were refused.
    pub refused_points: Refusals,
    /// Triangles that were dropped.
    pub dropped_triangles: Dropped,
    /// Triangles that no view shows.
    pub unseen_triangles: usize,
    /// Matches and tracks that were left out, one by one, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explained: Option<Explained>,
}

/// What one view gave.
#[derive(Debug, Clone, Serialize)]
pub struct ViewFacts {
    /// Name of the file.
    pub file: String,
    /// Width and height at which it was used.
    pub size_px: [usize; 2],
    /// Focal length that was used, pixels.
    pub focal_px: f64,
    /// Where it was taken, in the model frame; null if it could not be joined.
    pub position: Option<[f64; 3]>,
    /// The rotation `view_from_model`, row by row; null if it could not be joined.
    pub view_from_model: Option<[[f64; 3]; 3]>,
    /// Points that it sees.
    pub points: usize,
    /// Points that would be lost without it.
    pub points_lost_without: usize,
    /// Its own reprojection error, pixels.
    pub reprojection_rms_px: f64,
    /// Share of its picture that the model covers.
    pub coverage: f64,
    /// Triangles whose texture comes from it.
    pub textures: usize,
}

fn median(mut values: Vec<f64>) -> f64 {
    order::ascending(&mut values);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Collects what is said.
pub fn facts(made: &Reconstruction, dense: &DenseCloud, length_unit: &'static str) -> Facts {
    let vertices = &made.model.surface.vertices;
    let mut sums = vec![(0.0, 0_usize, 0_usize); made.views.len()];
    for vertex in vertices {
        for &(view, at) in &vertex.track.sightings {
            let Some(station) = made.stations.get(view).and_then(Option::as_ref) else { continue };
            let Some([x, y]) = station.pinhole.project(vertex.position.into()) else { continue };
            let sum = &mut sums[view];
            sum.0 += (x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1]);
            sum.1 += 1;
            sum.2 += usize::from(vertex.track.sightings.len() == 2);
        }
    }
    let rms = |sum: f64, count: usize| libm::sqrt(sum / count.max(1) as f64);
    let total = sums.iter().fold((0.0, 0), |total, sum| (total.0 + sum.0, total.1 + sum.1));
    let covered = coverage(made);
    let views = made
        .views
        .iter()
        .enumerate()
        .map(|(number, view)| ViewFacts {
            file: view.name.clone(),
            size_px: [view.gray.width, view.gray.height],
            focal_px: view.lens.focal[0],
            position: made.stations[number].map(|station| station.pose.position.into()),
            view_from_model: made.stations[number].map(|station| {
                [0, 1, 2].map(|row| [0, 1, 2].map(|column| station.pose.view_from_model[(row, column)]))
            }),
            points: sums[number].1,
            points_lost_without: sums[number].2,
            reprojection_rms_px: rms(sums[number].0, sums[number].1),
            coverage: covered[number],
            textures: made.model.shown.iter().filter(|shown| **shown == Some(number as u32)).count(),
        })
        .collect();
    let extent = [0, 1, 2].map(|axis: usize| {
        let mut values: Vec<f64> = vertices.iter().map(|vertex| vertex.position[axis]).collect();
        order::ascending(&mut values);
        let at = |share: f64| values.get((values.len() as f64 * share) as usize).copied().unwrap_or(0.0);
        at(0.99) - at(0.01)
    });
    Facts {
        schema_version: SCHEMA_VERSION,
        program_version: env!("CARGO_PKG_VERSION"),
        shape: made.shape,
        length_unit,
        views,
        pairs: made.pairs.clone(),
        tracks: made.tracks,
        points: vertices.len(),
        triangles: made.model.surface.triangles.len(),
        level: dense.level.number(),
        dense_points: dense.positions.len(),
        dense_triangles: dense.triangles.len(),
        dense_bytes: (dense.positions.len() * 23 + dense.triangles.len() * 12) as u64,
        reprojection_rms_px: rms(total.0, total.1),
        median_parallax_degree: median(vertices.iter().map(|vertex| vertex.parallax_degree).collect()),
        median_deviation: median(vertices.iter().map(|vertex| libm::sqrt(vertex.covariance.trace())).collect()),
        extent,
        removed_matches: made.removed,
        refused_points: made.model.refused,
        dropped_triangles: made.model.dropped,
        unseen_triangles: made.model.shown.iter().filter(|shown| shown.is_none()).count(),
        explained: None,
    }
}

/// The share of each picture that the surface covers, counted on a grid of 8 px.
fn coverage(made: &Reconstruction) -> Vec<f64> {
    let positions: Vec<[f64; 3]> = made.model.surface.vertices.iter().map(|vertex| vertex.position.into()).collect();
    let share = |(view, station): (&super::view::View, &Option<super::view::Station>)| {
        let Some(station) = station else { return 0.0 };
        let size = [view.gray.width.div_ceil(8), view.gray.height.div_ceil(8)];
        let triangles = &made.model.surface.triangles;
        let buffer = daymark_numerics::depth::DepthBuffer::new(&station.pinhole, size, 0.125, &positions, triangles);
        buffer.triangles.iter().filter(|triangle| **triangle != u32::MAX).count() as f64
            / buffer.triangles.len().max(1) as f64
    };
    made.views.iter().zip(&made.stations).map(share).collect()
}
