//! What a lens does without distortion.

use core::fmt;

/// A pinhole camera's inside: `u = fx x/z + cx`, `v = fy y/z + cy`, in pixels with the origin at the centre of the top-left
/// pixel. Lens distortion is taken out of image points before they come here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    focal: [f64; 2],
    centre: [f64; 2],
}

/// Numbers that no camera has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoCamera {
    /// The focal lengths, in pixels.
    pub focal: [f64; 2],
    /// The principal point, in pixels.
    pub centre: [f64; 2],
}

impl fmt::Display for NoCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([fx, fy], [cx, cy]) = (self.focal, self.centre);
        write!(
            f,
            "no camera has fx = {fx} px, fy = {fy} px, cx = {cx} px, cy = {cy} px: focal lengths are positive and finite"
        )
    }
}

impl core::error::Error for NoCamera {}

impl Intrinsics {
    /// Focal lengths (fx, fy) and principal point (cx, cy), in pixels.
    ///
    /// # Errors
    /// [`NoCamera`] unless all are finite and both focal lengths positive.
    pub fn new(focal: [f64; 2], centre: [f64; 2]) -> Result<Self, NoCamera> {
        let sound = focal.iter().all(|f| f.is_finite() && *f > 1e-9) && centre.iter().all(|c| c.is_finite());
        if sound { Ok(Self { focal, centre }) } else { Err(NoCamera { focal, centre }) }
    }

    /// Square pixels, the principal point in the middle of the frame.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn centred(focal_length_px: f64, width: u32, height: u32) -> Result<Self, NoCamera> {
        let middle = |size: u32| (f64::from(size) - 1.0) / 2.0;
        Self::new([focal_length_px, focal_length_px], [middle(width), middle(height)])
    }

    /// (fx, fy), in pixels.
    pub const fn focal(&self) -> [f64; 2] {
        self.focal
    }

    /// (cx, cy), in pixels.
    pub const fn centre(&self) -> [f64; 2] {
        self.centre
    }

    /// The larger focal length, in pixels.
    pub fn longest(&self) -> f64 {
        self.focal[0].max(self.focal[1])
    }

    /// Where a point of the camera frame is seen; `None` if it is not in front.
    pub fn project(&self, [x, y, depth]: [f64; 3]) -> Option<[f64; 2]> {
        (depth > 0.0).then(|| [self.focal[0] * x / depth + self.centre[0], self.focal[1] * y / depth + self.centre[1]])
    }

    /// The direction of what is seen at an image point: (x/z, y/z).
    #[inline]
    pub fn ray(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [(u - self.centre[0]) / self.focal[0], (v - self.centre[1]) / self.focal[1]]
    }
}
