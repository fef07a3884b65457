//! What a whole dataset gave: every frame with its truth, and the figures counted from them.
//!
//! Serialized, an [`Evaluation`] is the JSON of `daymark evaluate`. Everything in it is the same for the same pictures,
//! whatever the run, the number of threads and the build, but [`Times`], of which every field ends in `_ms`.

pub mod html;
pub mod score;
pub mod text;

use serde::Serialize;

use score::Scores;

/// Version of the form of the JSON.
pub const SCHEMA_VERSION: u32 = 1;

/// Probabilities of a false answer at which the answers are counted.
pub const STATED: [f64; 3] = [0.1, 0.01, 0.001];

/// A landmark that a frame was taken for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Guess {
    /// Its name.
    pub building: String,
    /// The picture that its best view was made of.
    pub gallery_file: String,
    /// Evidence for that view.
    pub evidence_bits: f64,
    /// The stated probability that an answer on this evidence is false.
    pub probability_false_answer: f64,
    /// The map of that view to the frame, row by row, pixels to pixels.
    #[serde(skip)]
    pub frame_from_view: [[f32; 3]; 3],
}

/// What came of a frame at a stated probability.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The building that it shows was named.
    Right,
    /// A building that it does not show was named.
    Wrong,
    /// Two buildings fit about equally well, and none was named.
    Ambiguous,
    /// No building was named.
    Unknown,
}

/// A frame of the dataset and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// The picture, from the dataset's folder.
    pub file: String,
    /// The building that it shows; none for a negative.
    pub shows: Option<String>,
    /// The folder of the building's first gallery picture, or of the negative: where the pictures come from.
    pub source: String,
    /// The building with the most evidence.
    pub best: Option<Guess>,
    /// The building after it.
    pub runner_up: Option<Guess>,
    /// Whether the building with the most evidence is the one that it shows.
    pub right_at_1: bool,
    /// What came of it at the probability that was asked for.
    pub outcome: Outcome,
    /// Corners of the frame.
    pub corners: usize,
    /// What came of it at each of the stated probabilities.
    #[serde(skip)]
    pub at_stated: Vec<Outcome>,
}

/// A stored view and where it comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GalleryView {
    /// Its building.
    pub building: String,
    /// The picture that it was made of.
    pub file: String,
}

/// The table that was made of the gallery.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableFacts {
    /// A number made from its content.
    pub table_id: String,
    /// Buildings.
    pub landmarks: u32,
    /// Stored views.
    pub views: u32,
    /// Bytes of the whole table.
    pub bytes: usize,
    /// The picture of each view, by the view's number.
    #[serde(skip)]
    pub gallery: Vec<GalleryView>,
    /// Gallery pictures with too few corners for a view; a building without any other is not in the table.
    pub not_enrolled: Vec<String>,
}

/// What was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Settings {
    /// A frame is answered if the answer is false with at most this probability.
    pub max_false_answer: f64,
    /// Pictures are shrunk to this.
    pub longer_side_px: usize,
}

/// Median and 99th percentile of what was measured, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "stage, percentile and unit are the name")]
pub struct Times {
    pub features_p50_ms: f64,
    pub features_p99_ms: f64,
    pub one_view_p50_ms: f64,
    pub one_view_p99_ms: f64,
    pub whole_frame_p50_ms: f64,
    pub whole_frame_p99_ms: f64,
    pub enroll_view_p50_ms: f64,
    pub enroll_view_p99_ms: f64,
}

/// What a dataset gave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The class of device.
    pub profile: &'static str,
    /// What was asked for.
    pub settings: Settings,
    /// Bytes of the table over its views, rounded up.
    pub bytes_per_view: usize,
    /// The table.
    pub table: TableFacts,
    /// The figures.
    #[serde(flatten)]
    pub scores: Scores,
    /// Every frame: the queries, then the negatives, in the order of the manifest.
    pub frames: Vec<Judged>,
    /// Where the time went, unless it was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub times: Option<Times>,
}

/// The value that this share of the sorted values does not exceed (nearest rank); 0 of none.
pub fn percentile(sorted: &[f64], percent: usize) -> f64 {
    let rank = (sorted.len() * percent).div_ceil(100).max(1);
    sorted.get(rank - 1).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!((percentile(&values, 50), percentile(&values, 99)), (100.0, 198.0));
        assert_eq!((percentile(&[7.0], 1), percentile(&[7.0], 99), percentile(&[], 50)), (7.0, 7.0, 0.0));
    }
}
