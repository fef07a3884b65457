//! Core's recognizer with the memory of a PC and the kernels of this processor.

use daymark_core::evidence::CornerEvidence;
use daymark_core::extract::{Features, FrontEnd};
use daymark_core::image::FrameError;
use daymark_core::matcher::ViewMatch;
use daymark_core::profile::Profile;
use daymark_core::recognizer::Recognizer;
use daymark_core::table::{LandmarkTable, SelectedViews, StoredView, TableError, ViewSource};
use daymark_core::verdict::{FalseAnswer, Recognition};

use crate::gray::GrayImage;
use crate::reader::FrameReader;
use crate::select::Selection;
use crate::simd::Processor;

/// Stack of a thread that makes engines and extractors: they pass through it on their way to the heap. Only what is
/// touched costs memory.
pub const STACK_BYTES: usize = 32 << 20;

/// Longer side to which pictures and frames are scaled, in pixels: the calibration of false answers holds for this size
/// with the profile's number of corners.
pub const FRAME_SIDE: usize = 640;

/// How a profile reads frames and pictures.
pub const fn selection(profile: Profile) -> Selection {
    let keep = profile.corners_per_view();
    let (candidates, query) = match profile {
        Profile::Board => (1_600, 1_600),
        _ => (800, 800),
    };
    Selection {
        candidates: FrontEnd { features: candidates, cell_share_tenths: 25 },
        query: FrontEnd { features: query, cell_share_tenths: 12 },
        keep,
    }
}

/// Features of a frame, at most.
pub const QUERY_FEATURES: usize = 1_600;
type HandheldRecognizer = Recognizer<100, 200, 512, 800>;
type BoardRecognizer = Recognizer<800, 800, 2_048, QUERY_FEATURES>;

#[derive(Debug)]
enum AnyRecognizer {
    Handheld(Box<HandheldRecognizer>),
    Board(Box<BoardRecognizer>),
}

// A boxed value is made on the stack first: each in a frame of its own, so that the small one never pays for the large.
#[inline(never)]
fn handheld() -> AnyRecognizer {
    AnyRecognizer::Handheld(Box::default())
}

#[inline(never)]
fn board() -> AnyRecognizer {
    AnyRecognizer::Board(Box::default())
}

/// Everything that recognizing frames needs, allocated once.
#[derive(Debug)]
pub struct Engine {
    profile: Profile,
    reader: FrameReader,
    recognizer: AnyRecognizer,
    distances: Vec<u8>,
    record: Vec<u8>,
}

impl Engine {
    /// An engine for tables of this profile, with the fastest kernels of this processor.
    pub fn new(profile: Profile) -> Self {
        Self::with_processor(profile, Processor::detect())
    }

    /// An engine with chosen kernels; the results are the same.
    pub fn with_processor(profile: Profile, processor: Processor) -> Self {
        let (recognizer, distances) = match profile {
            Profile::Board => (board(), BoardRecognizer::DISTANCE_BYTES),
            _ => (handheld(), HandheldRecognizer::DISTANCE_BYTES),
        };
        Self {
            profile,
            reader: FrameReader::new(processor),
            recognizer,
            distances: vec![0; distances],
            record: Vec::new(),
        }
    }

    /// The kernels in use.
    pub const fn processor(&self) -> Processor {
        self.reader.processor()
    }

    /// Reads the features of a frame, which later calls refer to.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn extract(&mut self, frame: &GrayImage) -> Result<(), FrameError> {
        self.reader.read(frame, selection(self.profile).query).map(|_| ())
    }

    /// The features of the latest frame.
    pub fn features(&self) -> Features<'_> {
        self.reader.features()
    }

    /// Compares the latest frame with every view of a table.
    ///
    /// # Errors
    /// What the table's source says.
    pub fn recognize<S: ViewSource>(&mut self, table: &mut S, limit: FalseAnswer) -> Result<Recognition, S::Error> {
        self.record.resize(table.buffer_bytes(), 0);
        let Self { reader, recognizer, distances, record, .. } = self;
        let (processor, frame) = (reader.processor(), reader.features());
        let kernels = processor.kernels();
        match recognizer {
            AnyRecognizer::Handheld(recognizer) => {
                recognizer.recognize(kernels, frame, table, distances, record, limit)
            }
            AnyRecognizer::Board(recognizer) => recognizer.recognize(kernels, frame, table, distances, record, limit),
        }
    }

    /// The same among the views with these numbers alone, ascending; all if `None`.
    ///
    /// # Errors
    /// What the table says.
    pub fn recognize_among(
        &mut self,
        table: &mut LandmarkTable<'_>,
        views: Option<&[u32]>,
        limit: FalseAnswer,
    ) -> Result<Recognition, TableError> {
        let Some(views) = views else { return self.recognize(table, limit) };
        let recognition = self.recognize(&mut SelectedViews::new(*table, views), limit)?;
        Ok(recognition.renumbered(|view| views.get(view as usize).copied().unwrap_or(view)))
    }

    /// Matches one view with the latest frame and tells what each stored corner said.
    pub fn explain(&mut self, view: &StoredView<'_>) -> Option<(ViewMatch, &[CornerEvidence])> {
        let Self { reader, recognizer, distances, .. } = self;
        let (processor, frame) = (reader.processor(), reader.features());
        let kernels = processor.kernels();
        match recognizer {
            AnyRecognizer::Handheld(recognizer) => recognizer.explain(kernels, frame, view, distances),
            AnyRecognizer::Board(recognizer) => recognizer.explain(kernels, frame, view, distances),
        }
    }
}
