//! From a frame to its features: pyramid, corners, signatures.

use crate::corner::{CELLS, CornerDetector, slots};
use crate::feature::{Feature, Signature};
use crate::image::FrameError;
use crate::kernel::Kernels;
use crate::point::ImagePoint;
use crate::pyramid::{LEVELS, base_from_level, level_bytes, visit_levels};
use crate::signature::{SignatureScratch, describe};
use crate::tone::TonedFrame;

/// How many features, and how evenly they are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrontEnd {
    /// Features of a frame, at most.
    pub features: u16,
    /// What a cell may contribute before every cell had its turn, in tenths of an even share.
    pub cell_share_tenths: u16,
}

/// Each level's share of the features, in 1/10,000: proportional to 0.55^level, and 10,000 in all.
const LEVEL_SHARE: [usize; LEVELS] = [4_739, 2_606, 1_433, 788, 434];

impl FrontEnd {
    /// Corners of a level, at most.
    pub const fn level_count(self, level: usize) -> usize {
        if level < LEVELS { (self.features as usize * LEVEL_SHARE[level] + 5_000) / 10_000 } else { 0 }
    }

    /// Corners that one cell of a level contributes before every cell had its turn.
    pub const fn cell_share(self, level: usize) -> usize {
        (self.level_count(level) * self.cell_share_tenths as usize).div_ceil(10 * CELLS)
    }

    /// The `SLOTS` that an [`Extractor`] needs for these settings.
    pub const fn slots(self) -> usize {
        slots(self.cell_share(0))
    }
}

/// At most `FEATURES` features of one frame, in the order of their levels and cells.
#[derive(Debug, Clone)]
pub struct FeatureSet<const FEATURES: usize> {
    positions: heapless::Vec<ImagePoint, FEATURES>,
    levels: heapless::Vec<u8, FEATURES>,
    commonness: heapless::Vec<i8, FEATURES>,
    signatures: heapless::Vec<Signature, FEATURES>,
    width: u16,
    height: u16,
}

impl<const FEATURES: usize> FeatureSet<FEATURES> {
    /// No features.
    pub const fn new() -> Self {
        Self {
            positions: heapless::Vec::new(),
            levels: heapless::Vec::new(),
            commonness: heapless::Vec::new(),
            signatures: heapless::Vec::new(),
            width: 0,
            height: 0,
        }
    }

    /// Removes all features; those to come belong to a frame of this size.
    pub fn reset(&mut self, width: u16, height: u16) {
        self.positions.clear();
        self.levels.clear();
        self.commonness.clear();
        self.signatures.clear();
        (self.width, self.height) = (width, height);
    }

    /// Adds a feature, or gives it back if the set is full.
    ///
    /// # Errors
    /// The feature, if `FEATURES` are there already.
    pub fn push(&mut self, feature: Feature) -> Result<(), Feature> {
        if self.positions.push(feature.position).is_err() {
            return Err(feature);
        }
        // The columns have the same length and capacity.
        let _ = self.levels.push(feature.level);
        let _ = self.commonness.push(feature.commonness);
        let _ = self.signatures.push(feature.signature);
        Ok(())
    }

    /// The features as columns.
    pub fn view(&self) -> Features<'_> {
        Features {
            positions: &self.positions,
            levels: &self.levels,
            commonness: &self.commonness,
            signatures: &self.signatures,
            width: self.width,
            height: self.height,
        }
    }
}

impl<const FEATURES: usize> Default for FeatureSet<FEATURES> {
    fn default() -> Self {
        Self::new()
    }
}

/// The features of one frame as columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct Features<'a> {
    /// Positions in the base frame.
    pub positions: &'a [ImagePoint],
    /// Pyramid levels.
    pub levels: &'a [u8],
    /// Commonness of each signature, in bits; 0 for a frame's.
    pub commonness: &'a [i8],
    /// Signatures.
    pub signatures: &'a [Signature],
    /// Width of the frame in pixels.
    pub width: u16,
    /// Height of the frame in pixels.
    pub height: u16,
}

impl Features<'_> {
    /// How many features.
    pub const fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The feature with this number.
    pub fn get(&self, number: usize) -> Option<Feature> {
        Some(Feature {
            position: *self.positions.get(number)?,
            level: *self.levels.get(number)?,
            commonness: *self.commonness.get(number)?,
            signature: *self.signatures.get(number)?,
        })
    }

    /// The features one by one.
    pub fn iter(&self) -> impl Iterator<Item = Feature> + '_ {
        (0..self.len()).filter_map(|number| self.get(number))
    }
}

/// Working memory of the front end: a strip of responses and the kept peaks.
#[derive(Debug, Clone)]
pub struct Extractor<const STRIP: usize, const SLOTS: usize> {
    detector: CornerDetector<STRIP, SLOTS>,
    scratch: SignatureScratch,
}

impl<const STRIP: usize, const SLOTS: usize> Extractor<STRIP, SLOTS> {
    /// Working memory; nothing depends on what was extracted before.
    pub const fn new() -> Self {
        Self { detector: CornerDetector::new(), scratch: SignatureScratch::new() }
    }

    /// Bytes of memory for frames of `width` x `height` px and `FEATURES` features, without the frame itself.
    pub const fn bytes<const FEATURES: usize>(width: usize, height: usize) -> usize {
        size_of::<Self>() + size_of::<FeatureSet<FEATURES>>() + level_bytes(width, height)
    }

    /// Fills `features` with those of the frame.
    ///
    /// `levels` is scratch memory of [`level_bytes`]. The result depends on the pixels and the settings only: neither
    /// on `STRIP` nor on the kernels.
    ///
    /// # Errors
    /// [`FrameError::ScratchTooSmall`]; `features` is empty then.
    pub fn extract<K: Kernels + ?Sized, const FEATURES: usize>(
        &mut self,
        kernels: &K,
        frame: TonedFrame<'_>,
        front_end: FrontEnd,
        levels: &mut [u8],
        features: &mut FeatureSet<FEATURES>,
    ) -> Result<(), FrameError> {
        let frame = frame.view();
        features.reset(frame.width() as u16, frame.height() as u16);
        let Self { detector, scratch } = self;
        visit_levels(kernels, frame, levels, |number, level| {
            let (count, share) =
                (front_end.level_count(usize::from(number)), front_end.cell_share(usize::from(number)));
            detector.detect(kernels, level, count, share, |corner| {
                let (x, y) = corner.subpixel();
                let signature = describe(kernels, level, corner.column, corner.row, scratch);
                // Settings that ask for more than `FEATURES` lose the coarsest levels' last cells.
                let _ = features.push(Feature {
                    position: base_from_level(number, x, y),
                    level: number,
                    commonness: 0,
                    signature,
                });
            });
        })
    }

    /// The corners alone, without signatures: how many there are on each level that is wanted.
    ///
    /// # Errors
    /// [`FrameError::ScratchTooSmall`].
    pub fn count_corners<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        frame: TonedFrame<'_>,
        front_end: FrontEnd,
        levels: &mut [u8],
    ) -> Result<[usize; LEVELS], FrameError> {
        let mut counts = [0; LEVELS];
        visit_levels(kernels, frame.view(), levels, |number, level| {
            let number = usize::from(number);
            self.detector.detect(kernels, level, front_end.level_count(number), front_end.cell_share(number), |_| {
                if let Some(count) = counts.get_mut(number) {
                    *count += 1;
                }
            });
        })?;
        Ok(counts)
    }
}

impl<const STRIP: usize, const SLOTS: usize> Default for Extractor<STRIP, SLOTS> {
    fn default() -> Self {
        Self::new()
    }
}
