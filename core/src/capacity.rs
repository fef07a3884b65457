//! The recognizer sized for a handheld device or a microcontroller, and the bytes that it takes there.
//!
//! A device works in two steps that need no memory at the same time, except for the frame's features:
//!
//! | step | its own memory |
//! |---|---|
//! | features | the level scratch and a [`HandheldExtractor`] |
//! | answer | the distances, the buffer of one record and a [`HandheldRecognizer`] |
//!
//! Give each step its memory as locals of a function of its own (`#[inline(never)]`), on a stack that takes
//! [`HandheldMemory::peak`] and about 4 KB of calls. [`HandheldMemory`] tells the bytes for a size of frame and the
//! processor at hand. The frame itself is the camera's and not counted.

use crate::extract::{Extractor, FeatureSet, FrontEnd};
use crate::geometry::HullLayers;
use crate::geometry::correspond::Correspond;
use crate::geometry::proposal::MOST_PAIRS;
use crate::geometry::shift::{LayerQuad, quads_of};
use crate::profile::Profile;
use crate::pyramid::level_bytes;
use crate::recognizer::Recognizer;
use crate::table::{CORNER_BYTES, LANDMARK_BYTES, VIEW_HEADER_BYTES, corners_limit};

/// Features of a device's frame, at most.
pub const HANDHELD_FEATURES: usize = 300;

/// How a device reads its frames.
pub const HANDHELD_FRONT_END: FrontEnd = FrontEnd { features: HANDHELD_FEATURES as u16, cell_share_tenths: 12 };

/// Width of the strip of responses: 52 columns of corners at a time, with 12 that neighbours compute again.
///
/// 104 bytes a column. With 32 the front end of a 320 x 240 frame computes 60 % more, with 128 10 % less.
const STRIP: usize = 48;

/// Corners of a stored view, at most.
const STORED: usize = corners_limit(Profile::Handheld) as usize;

/// Extracts [`HandheldFeatures`] by [`HANDHELD_FRONT_END`].
pub type HandheldExtractor = Extractor<STRIP, { HANDHELD_FRONT_END.slots() }>;

/// The features of a device's frame.
pub type HandheldFeatures = FeatureSet<HANDHELD_FEATURES>;

/// Recognizes [`HandheldFeatures`] by a table of [`Profile::Handheld`].
pub type HandheldRecognizer = Recognizer<STORED, { 2 * STORED }, 0, HANDHELD_FEATURES>;

/// Corners of a view that a device matches by their places alone, at most: those of the thesis' figure 5, and one more.
pub const HANDHELD_CORNERS: usize = 48;

/// The nested hulls of [`HANDHELD_CORNERS`]; always enough layers.
pub type HandheldHullLayers = HullLayers<HANDHELD_CORNERS, { HANDHELD_CORNERS / 3 }>;

/// Proposals that [`HandheldCorrespond`] keeps of each source.
const PROPOSALS: usize = 96;

/// Matches [`HANDHELD_CORNERS`] of two views by nested hulls, in steps of its own: see [`HANDHELD_CORRESPOND_BYTES`]. Local
/// arrangements want 60 entries of scratch memory for each corner, which is more than all the rest.
pub type HandheldCorrespond =
    Correspond<HANDHELD_CORNERS, { HANDHELD_CORNERS / 3 }, PROPOSALS, { PROPOSALS * MOST_PAIRS }>;

/// Quads of all layers of two views: the scratch memory of [`HandheldCorrespond`].
pub const HANDHELD_QUADS: usize = quads_of(2 * HANDHELD_CORNERS);

/// Bytes that matching by nested hulls takes: [`HandheldCorrespond`] and its scratch memory.
pub const HANDHELD_CORRESPOND_BYTES: usize = size_of::<HandheldCorrespond>() + HANDHELD_QUADS * size_of::<LayerQuad>();

/// Bytes of memory on the processor that this is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandheldMemory {
    /// Level scratch of the front end: [`level_bytes`].
    pub levels: usize,
    /// [`HandheldExtractor`].
    pub extractor: usize,
    /// [`HandheldFeatures`]: from the first step to the last.
    pub features: usize,
    /// Distances of one view to the frame.
    pub distances: usize,
    /// The longest record of a streamed table; a table in place needs none.
    pub record: usize,
    /// [`HandheldRecognizer`].
    pub recognizer: usize,
}

impl HandheldMemory {
    /// For frames of `width` x `height` px.
    pub const fn of_frame(width: usize, height: usize) -> Self {
        let view = VIEW_HEADER_BYTES + STORED * CORNER_BYTES;
        Self {
            levels: level_bytes(width, height),
            extractor: size_of::<HandheldExtractor>(),
            features: size_of::<HandheldFeatures>(),
            distances: HandheldRecognizer::DISTANCE_BYTES,
            record: if view > LANDMARK_BYTES { view } else { LANDMARK_BYTES },
            recognizer: size_of::<HandheldRecognizer>(),
        }
    }

    /// What the first step needs: levels, extractor, features.
    pub const fn extracting(&self) -> usize {
        self.levels + self.extractor + self.features
    }

    /// What the second step needs: distances, record, recognizer, features.
    pub const fn recognizing(&self) -> usize {
        self.distances + self.record + self.recognizer + self.features
    }

    /// The larger of the two.
    pub const fn peak(&self) -> usize {
        let (first, second) = (self.extracting(), self.recognizing());
        if first > second { first } else { second }
    }
}

// The whole of it fits 64 KB beside the frame, on this very processor.
const _: () = assert!(HandheldMemory::of_frame(320, 240).peak() <= 64 * 1_024);

// So does matching, beside the features.
const _: () = assert!(HANDHELD_CORRESPOND_BYTES + size_of::<HandheldFeatures>() <= 64 * 1_024);
