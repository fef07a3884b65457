//! What is said of tables, landmarks and views, to people and to programs.

use std::path::Path;

use daymark_core::feature::Feature;
use daymark_core::table::{
    CORNER_BYTES, GeoPosition, Header, LANDMARK_BYTES, LANDMARK_ENTRY_BYTES, LEVELS, Landmark, LandmarkTable,
    StoredModel, StoredView, TableError, VIEW_ENTRY_BYTES, VIEW_HEADER_BYTES, encode_landmark, encode_view,
};
use serde::Serialize;

use crate::report::finding::Position;
use crate::report::phrase::{count, grouped, printable};

/// Version of the form of `--json`.
pub(in crate::command) const SCHEMA_VERSION: u32 = 1;

/// A table as a whole.
#[derive(Debug, Serialize)]
pub(in crate::command) struct TableFacts {
    pub(in crate::command) file: String,
    pub(in crate::command) format_version: u16,
    pub(in crate::command) table_id: String,
    pub(in crate::command) profile: &'static str,
    pub(in crate::command) landmarks: u32,
    pub(in crate::command) views: u32,
    pub(in crate::command) bytes: u32,
}

impl TableFacts {
    pub(in crate::command) fn new(path: &Path, header: &Header) -> Self {
        Self {
            file: path.to_string_lossy().into_owned(),
            format_version: header.version(),
            table_id: format!("{:016x}", header.table_id()),
            profile: header.profile().name(),
            landmarks: header.landmark_count(),
            views: header.view_count(),
            bytes: header.file_length(),
        }
    }

    /// One line.
    pub(in crate::command) fn line(&self) -> String {
        format!(
            "{}: {}, {}, {} bytes, profile {}, table id {}",
            printable(&self.file),
            count(self.landmarks as usize, "landmark"),
            count(self.views as usize, "view"),
            grouped(u64::from(self.bytes)),
            self.profile,
            self.table_id,
        )
    }
}

/// A landmark of a table.
#[derive(Debug, Serialize)]
pub(super) struct LandmarkFacts {
    pub(super) landmark: String,
    pub(super) kind: &'static str,
    pub(super) position: Option<Position>,
    pub(super) views: usize,
    /// Corners of its model that have a place; 0 without a model.
    pub(super) model_points: usize,
    /// Of its own record, its views' and its model's, with their entries in the index.
    pub(super) bytes: usize,
}

impl LandmarkFacts {
    pub(super) fn new(landmark: &Landmark<'_>, views: &[ViewFacts], model: Option<&StoredModel<'_>>) -> Self {
        let mut buffer = [0; LANDMARK_BYTES];
        let record = encode_landmark(landmark.name, landmark.kind, landmark.position, &mut buffer);
        let own = record.map_or(0, <[u8]>::len) + LANDMARK_ENTRY_BYTES;
        Self {
            landmark: landmark.name.to_owned(),
            kind: landmark.kind.name(),
            position: landmark.position.map(position),
            views: views.len(),
            model_points: model.map_or(0, StoredModel::len),
            bytes: own + model.map_or(0, StoredModel::bytes) + views.iter().map(|view| view.bytes).sum::<usize>(),
        }
    }
}

/// A view of a landmark.
#[derive(Debug, Serialize)]
pub(super) struct ViewFacts {
    /// Its number in the table.
    pub(super) view: u32,
    pub(super) width_px: u16,
    pub(super) height_px: u16,
    pub(super) corners: usize,
    /// On each level, the finest first.
    pub(super) corners_per_level: [usize; LEVELS as usize],
    /// Of its record, with its entry in the index.
    pub(super) bytes: usize,
}

impl ViewFacts {
    fn new(number: u32, view: &StoredView<'_>) -> Self {
        let features: Vec<Feature> = view.features().collect();
        // A record is encoded as it was stored: that is a property of the format.
        let mut buffer = vec![0; VIEW_HEADER_BYTES + features.len() * CORNER_BYTES];
        let record = encode_view(u16::MAX, view.width(), view.height(), &features, &mut buffer);
        let record_bytes = record.map_or(0, <[u8]>::len);
        let mut corners_per_level = [0; LEVELS as usize];
        for Feature { level, .. } in features {
            corners_per_level[usize::from(level)] += 1;
        }
        Self {
            view: number,
            width_px: view.width(),
            height_px: view.height(),
            corners: view.len(),
            corners_per_level,
            bytes: record_bytes + VIEW_ENTRY_BYTES,
        }
    }

    /// The views of a landmark.
    pub(super) fn all(table: &LandmarkTable<'_>, landmark: &Landmark<'_>) -> Result<Vec<Self>, TableError> {
        landmark.views.clone().map(|number| Ok(Self::new(number, &table.view(number)?))).collect()
    }
}

pub(in crate::command) fn position(at: GeoPosition) -> Position {
    at.into()
}
