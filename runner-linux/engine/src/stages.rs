//! The stages of the front end one by one, to time them.

use daymark_core::corner::CELLS;
use daymark_core::extract::FrontEnd;
use daymark_core::image::FrameError;
use daymark_core::pyramid::level_bytes;
use daymark_core::tone::TonedFrame;

use crate::gray::GrayImage;
use crate::reader::{FrameReader, WideDetector, WideExtractor};
use crate::simd::Processor;

/// One frame, and the memory of each stage, allocated once.
#[derive(Debug)]
pub struct Stages<'a> {
    frame: &'a GrayImage,
    toned: TonedFrame<'a>,
    front_end: FrontEnd,
    reader: FrameReader,
    detector: Box<WideDetector>,
    extractor: Box<WideExtractor>,
    levels: Vec<u8>,
}

impl<'a> Stages<'a> {
    /// The stages on this frame, with these kernels. `toned` receives the frame under the tone curve.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn new(
        processor: Processor,
        frame: &'a GrayImage,
        front_end: FrontEnd,
        toned: &'a mut Vec<u8>,
    ) -> Result<Self, FrameError> {
        toned.resize(frame.pixels.len(), 0);
        Ok(Self {
            frame,
            toned: TonedFrame::write(processor.kernels(), frame.view()?, toned)?,
            front_end,
            reader: FrameReader::new(processor),
            detector: Box::default(),
            extractor: Box::default(),
            levels: vec![0; level_bytes(frame.width, frame.height)],
        })
    }

    /// Corners of the first level, as many as of all of them; from the toned frame on.
    pub fn corners_of_first_level(&mut self) -> usize {
        let FrontEnd { features, cell_share_tenths } = self.front_end;
        let share = (usize::from(features) * usize::from(cell_share_tenths)).div_ceil(10 * CELLS);
        let mut found = 0;
        let kernels = self.reader.processor();
        self.detector.detect(kernels.kernels(), self.toned.view(), features.into(), share, |_| found += 1);
        found
    }

    /// Corners of all levels, without signatures; from the toned frame on.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn corners(&mut self) -> Result<usize, FrameError> {
        let kernels = self.reader.processor();
        let counts = self.extractor.count_corners(kernels.kernels(), self.toned, self.front_end, &mut self.levels)?;
        Ok(counts.iter().sum())
    }

    /// Features of the frame; from its gray levels on.
    ///
    /// # Errors
    /// [`FrameError`] for a frame beyond core's limits.
    pub fn features(&mut self) -> Result<usize, FrameError> {
        Ok(self.reader.read(self.frame, self.front_end)?.len())
    }
}
