//! Frames and pictures become features: core's front end with memory for all that a PC asks of it.

use daymark_core::corner::CornerDetector;
use daymark_core::extract::{Extractor, FeatureSet, Features, FrontEnd};
use daymark_core::image::FrameError;
use daymark_core::pyramid::level_bytes;
use daymark_core::tone::TonedFrame;

use crate::gray::GrayImage;
use crate::simd::Processor;

/// Features of a picture, at most.
pub const MOST_FEATURES: usize = 4_000;
/// Peaks of all cells: for the largest share of a cell that anybody asks for.
const SLOTS: usize = FrontEnd { features: MOST_FEATURES as u16, cell_share_tenths: 20 }.slots();
/// Width of a strip of responses: a frame of 640 px takes two, and their rows stay in the first cache.
const STRIP: usize = 336;

pub(crate) type WideDetector = CornerDetector<STRIP, SLOTS>;
pub(crate) type WideExtractor = Extractor<STRIP, SLOTS>;

/// Everything that reading frames needs, allocated once.
#[derive(Debug)]
pub struct FrameReader {
    processor: Processor,
    extractor: Box<WideExtractor>,
    features: Box<FeatureSet<MOST_FEATURES>>,
    toned: Vec<u8>,
    levels: Vec<u8>,
}

impl FrameReader {
    /// A reader with these kernels; the features are the same with all of them.
    pub fn new(processor: Processor) -> Self {
        Self { processor, extractor: Box::default(), features: Box::default(), toned: Vec::new(), levels: Vec::new() }
    }

    /// The kernels in use.
    pub const fn processor(&self) -> Processor {
        self.processor
    }

    /// The features of a frame. More than [`MOST_FEATURES`], or more of a cell than a share of 20 tenths of as many gives, is
    /// not found.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn read(&mut self, frame: &GrayImage, front_end: FrontEnd) -> Result<Features<'_>, FrameError> {
        self.levels.resize(level_bytes(frame.width, frame.height), 0);
        self.toned.resize(frame.width * frame.height, 0);
        let kernels = self.processor.kernels();
        let toned = TonedFrame::write(kernels, frame.view()?, &mut self.toned)?;
        self.extractor.extract(kernels, toned, front_end, &mut self.levels, &mut self.features)?;
        Ok(self.features.view())
    }

    /// The features of the latest frame.
    pub fn features(&self) -> Features<'_> {
        self.features.view()
    }
}
