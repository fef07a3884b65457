//! Core's recognizer with the memory of a PC and the kernels of this processor.

use daymark_core::evidence::CornerEvidence;
use daymark_core::extract::{Extractor, FeatureSet, Features, FrontEnd};
use daymark_core::image::FrameError;
use daymark_core::matcher::ViewMatch;
use daymark_core::profile::Profile;
use daymark_core::pyramid::level_bytes;
use daymark_core::recognizer::Recognizer;
use daymark_core::table::{LandmarkTable, SelectedViews, StoredView, TableError, ViewSource};
use daymark_core::tone::TonedFrame;
use daymark_core::verdict::{FalseAnswer, Recognition};

use crate::enroll::select::Selection;
use crate::picture::GrayImage;
use crate::simd::Processor;
use crate::with_kernels;

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
/// Width of a strip of responses: a frame of 640 px takes two, and their rows stay in the first cache.
pub const STRIP: usize = 336;
const SLOTS: usize = selection(Profile::Board).query.slots();

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
    processor: Processor,
    profile: Profile,
    extractor: Box<Extractor<STRIP, SLOTS>>,
    features: Box<FeatureSet<QUERY_FEATURES>>,
    toned: Vec<u8>,
    levels: Vec<u8>,
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
            processor,
            profile,
            extractor: Box::default(),
            features: Box::default(),
            toned: Vec::new(),
            levels: Vec::new(),
            recognizer,
            distances: vec![0; distances],
            record: Vec::new(),
        }
    }

    /// The kernels in use.
    pub const fn processor(&self) -> Processor {
        self.processor
    }

    /// Reads the features of a frame, which later calls refer to.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn extract(&mut self, frame: &GrayImage) -> Result<(), FrameError> {
        self.levels.resize(level_bytes(frame.width, frame.height), 0);
        self.toned.resize(frame.width * frame.height, 0);
        let front_end = selection(self.profile).query;
        let view = frame.view()?;
        with_kernels!(self.processor, kernels => {
            let toned = TonedFrame::write(kernels, view, &mut self.toned)?;
            self.extractor.extract(kernels, toned, front_end, &mut self.levels, &mut self.features)
        })
    }

    /// The features of the latest frame.
    pub fn features(&self) -> Features<'_> {
        self.features.view()
    }

    /// Compares the latest frame with every view of a table.
    ///
    /// # Errors
    /// What the table's source says.
    pub fn recognize<S: ViewSource>(&mut self, table: &mut S, limit: FalseAnswer) -> Result<Recognition, S::Error> {
        self.record.resize(table.buffer_bytes(), 0);
        let (frame, distances, record) = (self.features.view(), &mut self.distances, &mut self.record);
        with_kernels!(self.processor, kernels => match &mut self.recognizer {
            AnyRecognizer::Handheld(recognizer) => recognizer.recognize(kernels, frame, table, distances, record, limit),
            AnyRecognizer::Board(recognizer) => recognizer.recognize(kernels, frame, table, distances, record, limit),
        })
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
        let (frame, distances) = (self.features.view(), &mut self.distances);
        with_kernels!(self.processor, kernels => match &mut self.recognizer {
            AnyRecognizer::Handheld(recognizer) => recognizer.explain(kernels, frame, view, distances),
            AnyRecognizer::Board(recognizer) => recognizer.explain(kernels, frame, view, distances),
        })
    }
}
