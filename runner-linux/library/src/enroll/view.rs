//! One picture becomes one view of a table.

use std::fmt;

use daymark_core::profile::Profile;
use daymark_core::verdict::LEAST_CORNERS;

use super::select::select_corners;
use crate::engine::selection;
use crate::picture::GrayImage;
use crate::simd::Processor;
use crate::table_file::ViewEntry;

/// The view that a table of this profile stores of a picture, which is shrunk already ([`crate::engine::FRAME_SIDE`]).
///
/// # Errors
/// [`TooFewCorners`] for a picture in which nothing could be found again.
pub fn view(image: &GrayImage, profile: Profile) -> Result<ViewEntry, TooFewCorners> {
    let features = select_corners(Processor::detect(), image, selection(profile));
    let size = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    if features.len() < LEAST_CORNERS {
        return Err(TooFewCorners { found: features.len(), needed: LEAST_CORNERS });
    }
    Ok(ViewEntry { width: size(image.width), height: size(image.height), features })
}

/// A picture with too few corners to be worth a place in a table: too dark, too blurred, or too empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFewCorners {
    /// Corners in the picture.
    pub found: usize,
    /// Corners that a view needs.
    pub needed: usize,
}

impl fmt::Display for TooFewCorners {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { found, needed } = self;
        write!(
            out,
            "it has only {found} corners, and a view needs {needed}: it is too dark, too blurred or too empty; \
             take a sharp picture in good light that the building fills"
        )
    }
}

impl std::error::Error for TooFewCorners {}
