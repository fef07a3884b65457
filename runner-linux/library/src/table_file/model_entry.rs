//! A landmark's model in memory.

use daymark_core::table::{
    EncodeError, ModelFacts, ModelFault, ModelledView, POINT_BYTES, PackedPoint, RecordFault, StoredModel,
    TRIANGLE_BYTES, encode_model,
};

use super::ViewEntry;

/// Where corners of a landmark's views are in space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelEntry {
    /// What applies to all of it.
    pub facts: ModelFacts,
    /// Views, ascending by their number among the landmark's, with the places of their corners, ascending by corner. A corner
    /// has the number that it has in the table's order.
    pub views: Vec<(u16, Vec<PackedPoint>)>,
    /// The surface: numbers of points, counted through all views.
    pub triangles: Vec<[u16; 3]>,
}

impl ModelEntry {
    /// Copies a stored model.
    pub fn of(model: &StoredModel<'_>) -> Self {
        Self {
            facts: model.facts(),
            views: model
                .views()
                .map(|(view, range)| (view, range.filter_map(|at| model.packed(at)).collect()))
                .collect(),
            triangles: model.triangles().collect(),
        }
    }

    /// How many corners have a place.
    pub fn points(&self) -> usize {
        self.views.iter().map(|(_, points)| points.len()).sum()
    }

    /// The record for a landmark with these views.
    pub(super) fn encode(&self, corners_limit: u16, views: &[ViewEntry]) -> Result<Vec<u8>, EncodeError> {
        for (view, points) in &self.views {
            let corners = views.get(usize::from(*view)).map_or(0, |view| view.features.len());
            // The format cannot know how many corners a view has.
            if let Some(point) = points.iter().position(|point| usize::from(point.corner) >= corners) {
                let fault = ModelFault::Corner { point, corner: points[point].corner };
                return Err(EncodeError::Record(RecordFault::Model(fault)));
            }
        }
        let parts: Vec<ModelledView<'_>> =
            self.views.iter().map(|(view, points)| ModelledView { view: *view, points }).collect();
        let bytes = 64 + parts.len() * 4 + self.points() * POINT_BYTES + self.triangles.len() * TRIANGLE_BYTES;
        let mut record = vec![0; bytes];
        let landmark_views = u32::try_from(views.len()).unwrap_or(u32::MAX);
        let length =
            encode_model(corners_limit, landmark_views, &self.facts, &parts, &self.triangles, &mut record)?.len();
        record.truncate(length);
        Ok(record)
    }
}
