//! Which corner of one picture is which corner of another, from their places alone: the pictures' appearance is not asked.
//!
//! ```text
//!  picture ────── automatic ──┐
//!                             ├── matching ── fate ──┬── text, finding (JSON)
//!  CSV, JSON ─── corner_file ─┘                      └── drawing (SVG)
//! ```

pub mod automatic;
pub mod corner_file;
pub mod drawing;
pub mod fate;
pub mod finding;
pub mod matching;
pub mod text;

use daymark_core::point::ImagePoint;

use crate::picture::GrayImage;

/// Corners of a picture that can be matched, at most.
pub const MOST_CORNERS: usize = 512;

/// The corners of one picture.
#[derive(Debug, Clone)]
pub struct Corners {
    /// The file they come from.
    pub name: String,
    /// What each is called: as the file has it, or counted from 0.
    pub numbers: Vec<u32>,
    /// Where they are in the working frame.
    pub places: Vec<ImagePoint>,
    /// Width and height of the working frame.
    pub size_px: [u32; 2],
    /// Pixels of the file for each pixel of the working frame: automatic corners are looked for in a picture of a given
    /// size.
    pub file_from_working: f64,
    /// The picture at the size of the working frame, where there is one.
    pub picture: Option<GrayImage>,
}

impl Corners {
    /// A corner in pixels of the file.
    pub fn in_file_px(&self, corner: u16) -> [f64; 2] {
        let place = self.places.get(usize::from(corner)).copied().unwrap_or_default();
        // Pixel areas align: the centre of the first pixel is half a pixel from the border in both.
        place.to_pixels().map(|value| (f64::from(value) + 0.5) * self.file_from_working - 0.5)
    }

    /// What a corner is called.
    pub fn number(&self, corner: u16) -> u32 {
        self.numbers.get(usize::from(corner)).copied().unwrap_or(u32::from(corner))
    }
}
