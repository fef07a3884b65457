//! Tracks become points with covariances; those that cannot be trusted are refused and counted.

use daymark_core::camera::triangulate::{NoPoint, Sighting, triangulate};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::view::{Station, Track, Vertex};
use crate::parallel;

/// When a point is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Deviation of a corner's coordinates, in pixels.
    pub corner_deviation_px: f64,
    /// Points with less parallax are refused, in degrees.
    pub min_parallax_degree: f64,
    /// Points with a larger root mean square reprojection error are refused, in pixels.
    pub max_reprojection_px: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Self { corner_deviation_px: 0.5, min_parallax_degree: 1.5, max_reprojection_px: 3.0 }
    }
}

/// Why tracks gave no point.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Refusals {
    /// Seen by fewer than two views.
    pub single_view: usize,
    /// Too small a parallax.
    pub small_parallax: usize,
    /// Behind a camera.
    pub behind_camera: usize,
    /// Too large a reprojection error.
    pub large_error: usize,
}

impl Refusals {
    /// All together.
    pub const fn total(self) -> usize {
        self.single_view + self.small_parallax + self.behind_camera + self.large_error
    }
}

/// The points of all tracks that `stations` (one a view; `None` for views without a place) see well enough.
pub fn points(tracks: &[Track], stations: &[Option<Station>], rules: &Rules) -> (Vec<Vertex>, Refusals) {
    let results = parallel::map(tracks, |track| point(track, stations, rules));
    let mut refused = Refusals::default();
    let mut vertices = Vec::with_capacity(results.len());
    for result in results {
        match result {
            Ok(vertex) => vertices.push(vertex),
            Err(why) => {
                refused.single_view += why.single_view;
                refused.small_parallax += why.small_parallax;
                refused.behind_camera += why.behind_camera;
                refused.large_error += why.large_error;
            }
        }
    }
    (vertices, refused)
}

fn point(track: &Track, stations: &[Option<Station>], rules: &Rules) -> Result<Vertex, Refusals> {
    let none = Refusals::default();
    let sightings: Vec<Sighting<'_>> = track
        .sightings
        .iter()
        .filter_map(|&(view, at)| Some(Sighting { camera: &stations.get(view)?.as_ref()?.pinhole, at }))
        .collect();
    let found = triangulate(&sightings, rules.corner_deviation_px).map_err(|why| match why {
        NoPoint::TooFewViews => Refusals { single_view: 1, ..none },
        NoPoint::Behind => Refusals { behind_camera: 1, ..none },
        _ => Refusals { small_parallax: 1, ..none },
    })?;
    let parallax_degree = libm::asin(found.parallax_sine.min(1.0)).to_degrees();
    if parallax_degree < rules.min_parallax_degree {
        return Err(Refusals { small_parallax: 1, ..none });
    }
    if !(found.reprojection_px <= rules.max_reprojection_px) {
        return Err(Refusals { large_error: 1, ..none });
    }
    let c = found.covariance;
    Ok(Vertex {
        position: Vector3::from(found.position),
        covariance: Matrix3::from_fn(|row, column| c[row][column]),
        track: track.clone(),
        reprojection_px: found.reprojection_px,
        parallax_degree,
    })
}
