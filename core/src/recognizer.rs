//! A frame's features against a whole table.

use crate::evidence::CornerEvidence;
use crate::extract::{FeatureSet, Features};
use crate::kernel::Kernels;
use crate::matcher::{Matcher, ViewMatch};
use crate::query::QueryIndex;
use crate::table::{StoredView, ViewSource};
use crate::verdict::{Calibration, FalseAnswer, LEAST_CORNERS, Ranking, Recognition};

/// Working memory to recognize frames: views of at most `STORED` corners, frames of at most `QUERY`.
///
/// The distances of one view to the frame need `STORED * QUERY` bytes more, which the caller lends.
#[derive(Debug, Clone)]
pub struct Recognizer<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize, const QUERY: usize> {
    matcher: Matcher<STORED, CANDIDATES, BLOCKS>,
    index: QueryIndex<QUERY>,
    stored: FeatureSet<STORED>,
}

impl<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize, const QUERY: usize>
    Recognizer<STORED, CANDIDATES, BLOCKS, QUERY>
{
    /// Bytes of distances of the largest view to the largest frame.
    pub const DISTANCE_BYTES: usize = STORED * QUERY;

    /// Working memory; nothing depends on what was recognized before.
    pub const fn new() -> Self {
        Self { matcher: Matcher::new(), index: QueryIndex::new(), stored: FeatureSet::new() }
    }

    /// Compares the frame with every view of the table.
    ///
    /// `record` holds one record of a streamed table ([`ViewSource::buffer_bytes`]). Known means: false with a
    /// probability of at most `limit`.
    ///
    /// # Errors
    /// What the table's source says; a frame without an answer is not an error.
    pub fn recognize<K: Kernels + ?Sized, S: ViewSource>(
        &mut self,
        kernels: &K,
        frame: Features<'_>,
        table: &mut S,
        distances: &mut [u8],
        record: &mut [u8],
        limit: FalseAnswer,
    ) -> Result<Recognition, S::Error> {
        let calibration = Calibration::of(table.profile());
        let views = table.view_count();
        let mut ranking = Ranking::default();
        if frame.len() >= LEAST_CORNERS {
            self.index.arrange(frame);
            for number in 0..views {
                let view = table.view(number, record)?;
                if let Some(matched) = self.compare(kernels, frame, &view, distances) {
                    ranking.enter(view.landmark(), number, matched);
                }
            }
        }
        Ok(ranking.judge(calibration, views, frame.len(), limit))
    }

    /// Matches one view again, for an explanation: its match and what each stored corner said.
    pub fn explain<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        frame: Features<'_>,
        view: &StoredView<'_>,
        distances: &mut [u8],
    ) -> Option<(ViewMatch, &[CornerEvidence])> {
        self.index.arrange(frame);
        let matched = self.compare(kernels, frame, view, distances)?;
        Some((matched, self.matcher.latest_corners()))
    }

    fn compare<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        frame: Features<'_>,
        view: &StoredView<'_>,
        distances: &mut [u8],
    ) -> Option<ViewMatch> {
        self.stored.reset(view.width(), view.height());
        for feature in view.features() {
            // A table's views have at most as many corners as its profile allows.
            let _ = self.stored.push(feature);
        }
        self.matcher.match_view(kernels, self.stored.view(), frame, &self.index, distances)
    }
}

impl<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize, const QUERY: usize> Default
    for Recognizer<STORED, CANDIDATES, BLOCKS, QUERY>
{
    fn default() -> Self {
        Self::new()
    }
}
