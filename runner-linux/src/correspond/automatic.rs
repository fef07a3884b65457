//! Corners of a picture, found as `daymark recognize` finds them.

use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::image::FrameError;
use daymark_core::point::ImagePoint;
use daymark_core::pyramid::level_bytes;
use daymark_core::tone::TonedFrame;

use super::MOST_CORNERS;
use crate::picture::GrayImage;
use crate::simd::Processor;
use crate::with_kernels;

/// Corners of a picture if nothing else is asked for.
pub const CORNERS_PER_IMAGE: usize = 200;
/// A corner nearer than this to a stronger one, px, is taken for the same on another level.
const LEAST_DISTANCE_PX: f32 = 5.0;

/// The strongest corners of a picture, at most `count`, in the order of places (x, then y).
///
/// # Errors
/// [`FrameError`] for a picture beyond core's limits.
pub fn corners(image: &GrayImage, count: usize) -> Result<Vec<ImagePoint>, FrameError> {
    let (levels, tenths) = options();
    let count = count.min(MOST_CORNERS);
    let processor = Processor::detect();
    let mut extractor: Box<Extractor<256, { 48 * 3 * 64 }>> = Box::default();
    let mut features: Box<FeatureSet<4_000>> = Box::default();
    let mut scratch = vec![0; level_bytes(image.width, image.height)];
    let mut toned = vec![0; image.width * image.height];
    let view = image.view()?;
    let share = [0.4739, 0.4739 + 0.2606, 0.4739 + 0.2606 + 0.1433, 1.0, 1.0][levels - 1];
    let front_end = FrontEnd { features: (count as f64 / share) as u16, cell_share_tenths: tenths };
    with_kernels!(processor, kernels => {
        let toned = TonedFrame::write(kernels, view, &mut toned)?;
        extractor.extract(kernels, toned, front_end, &mut scratch, &mut features)
    })?;
    let mut kept: Vec<ImagePoint> = Vec::new();
    for feature in features.view().iter().filter(|feature| usize::from(feature.level) < levels) {
        let [x, y] = feature.position.to_pixels();
        let near = |other: &ImagePoint| {
            let [dx, dy] = other.to_pixels();
            (dx - x) * (dx - x) + (dy - y) * (dy - y) < LEAST_DISTANCE_PX * LEAST_DISTANCE_PX
        };
        if kept.len() < count && !kept.iter().any(near) {
            kept.push(feature.position);
        }
    }
    kept.sort_unstable();
    Ok(kept)
}

fn options() -> (usize, u16) {
    let get = |name: &str, or: usize| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(or);
    (get("LEVELS", 1), get("TENTHS", 12) as u16)
}
