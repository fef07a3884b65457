//! A model: points, surface, and the views that show it.

use daymark_core::mesh::SubdivisionLevel;

use super::dense::{DenseCloud, DenseError, dense};
use super::explain::Reason;
use super::mesh::{Dropped, surface};
use super::texture::best_views;
use super::triangulate::{Refusals, Rules, points};
use super::view::{Station, Surface, Track, View};

/// A textured surface.
#[derive(Debug, Clone)]
pub struct Model {
    /// Points and triangles.
    pub surface: Surface,
    /// The view that shows each triangle best.
    pub shown: Vec<Option<u32>>,
    /// Tracks that gave no point.
    pub refused: Refusals,
    /// The same one by one: places in the list of tracks.
    pub refused_tracks: Vec<(usize, Reason)>,
    /// Triangles that were dropped.
    pub dropped: Dropped,
}

impl Model {
    /// Triangulates the tracks, spans the surface between them pair by pair, and chooses the views for its texture.
    ///
    /// Points that lie closer than `spacing_px` to a better one in a view do not carry that view's surface.
    pub fn new(
        views: &[View],
        stations: &[Option<Station>],
        tracks: &[Track],
        pairs: &[[usize; 2]],
        rules: &Rules,
        spacing_px: f64,
    ) -> Self {
        let (vertices, refused_tracks) = points(tracks, stations, rules);
        let (surface, dropped) = surface(vertices, stations, pairs, spacing_px);
        let shown = best_views(&surface, views, stations);
        Self { surface, shown, refused: Refusals::count(&refused_tracks), refused_tracks, dropped }
    }

    /// Its dense cloud at a level.
    ///
    /// # Errors
    /// [`DenseError`].
    pub fn dense(
        &self,
        level: SubdivisionLevel,
        views: &[View],
        stations: &[Option<Station>],
    ) -> Result<DenseCloud, DenseError> {
        dense(&self.surface, level, views, stations, &self.shown)
    }
}
