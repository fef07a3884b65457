//! Tracks become points with covariances; those that cannot be trusted are refused and counted.

use daymark_core::camera::triangulate::{NoPoint, Sighting, triangulate};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::explain::Reason;
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
    /// Counts reasons.
    pub fn count(reasons: &[(usize, Reason)]) -> Self {
        let mut refused = Self::default();
        for (_, reason) in reasons {
            match reason {
                Reason::SmallParallax { .. } => refused.small_parallax += 1,
                Reason::BehindCamera => refused.behind_camera += 1,
                Reason::LargeError { .. } => refused.large_error += 1,
                _ => refused.single_view += 1,
            }
        }
        refused
    }

    /// All together.
    pub const fn total(self) -> usize {
        self.single_view + self.small_parallax + self.behind_camera + self.large_error
    }
}

/// The points of all tracks that `stations` (one a view; `None` for views without a place) see well enough, and the places
/// of the other tracks in the list with the reasons.
pub fn points(tracks: &[Track], stations: &[Option<Station>], rules: &Rules) -> (Vec<Vertex>, Vec<(usize, Reason)>) {
    let results: Vec<Result<Vertex, Reason>> = parallel::map(tracks, |track| point(track, stations, rules));
    let mut refused = Vec::new();
    let mut vertices = Vec::with_capacity(results.len());
    for (number, result) in results.into_iter().enumerate() {
        match result {
            Ok(vertex) => vertices.push(vertex),
            Err(why) => refused.push((number, why)),
        }
    }
    (vertices, refused)
}

fn point(track: &Track, stations: &[Option<Station>], rules: &Rules) -> Result<Vertex, Reason> {
    let sightings: Vec<Sighting<'_>> = track
        .sightings
        .iter()
        .filter_map(|&(view, at)| Some(Sighting { camera: &stations.get(view)?.as_ref()?.pinhole, at }))
        .collect();
    let found = triangulate(&sightings, rules.corner_deviation_px).map_err(|why| match why {
        NoPoint::TooFewViews => Reason::SingleView,
        NoPoint::Behind => Reason::BehindCamera,
        _ => Reason::SmallParallax { degree: None },
    })?;
    let parallax_degree = libm::asin(found.parallax_sine.min(1.0)).to_degrees();
    if parallax_degree < rules.min_parallax_degree {
        return Err(Reason::SmallParallax { degree: Some(parallax_degree) });
    }
    if !(found.reprojection_px <= rules.max_reprojection_px) {
        return Err(Reason::LargeError { reprojection_px: found.reprojection_px });
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
