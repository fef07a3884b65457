//! Frames of reference, written once; every other module links here.
//!
//! **Image frame.** The origin is the centre of the top-left pixel, x points right, y points down. Coordinates are
//! integers in 1/16 px ([`SUBPIXEL`]), so that equality, order and orientation are exact. "Clockwise" is as seen on a
//! screen, that is, from +x towards +y.
//!
//! Names say both ends of a map: `frame_from_view` takes a point of a stored view to the frame under recognition.

/// Sub-pixel steps in one pixel.
pub const SUBPIXEL: i32 = 16;

/// A point of an image in 1/16 px: origin at the centre of the top-left pixel, x right, y down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct ImagePoint {
    /// Right of the centre of the first column, in 1/16 px.
    pub x: i32,
    /// Below the centre of the first row, in 1/16 px.
    pub y: i32,
}

impl ImagePoint {
    /// The point `x`, `y` in 1/16 px.
    pub const fn new(x: i32, y: i32) -> Self {
        Self { x, y }
    }

    /// The centre of the pixel in `column`, `row`.
    pub const fn at_pixel(column: u16, row: u16) -> Self {
        Self { x: column as i32 * SUBPIXEL, y: row as i32 * SUBPIXEL }
    }

    /// The coordinates in pixels. Exact for |coordinate| < 2^24 sub-pixels.
    pub const fn to_pixels(self) -> [f32; 2] {
        [self.x as f32 / SUBPIXEL as f32, self.y as f32 / SUBPIXEL as f32]
    }
}
