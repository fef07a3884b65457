//! Corners and signatures of a view, many more than recognition takes.

use daymark_core::extract::FrontEnd;
use daymark_core::image::FrameError;
use daymark_engine::reader::{FrameReader, MOST_FEATURES};
use daymark_numerics::look_alike::ViewFeatures;

use super::view::View;
use crate::simd::Processor;

/// Features of a view, at most.
pub const FEATURES: usize = MOST_FEATURES;
const FRONT_END: FrontEnd = FrontEnd { features: FEATURES as u16, cell_share_tenths: 20 };

/// Finds a view's features.
///
/// # Errors
/// [`FrameError`] for a picture beyond core's limits.
pub fn features(view: &View) -> Result<ViewFeatures, FrameError> {
    let mut reader = FrameReader::new(Processor::detect());
    let features = reader.read(&view.gray, FRONT_END)?;
    let mut found = ViewFeatures::default();
    for feature in features.iter() {
        let at = feature.position.to_pixels().map(f64::from);
        found.points.push(at);
        found.ideal.push(view.lens.ideal_from_picture(at).unwrap_or([f64::NAN; 2]));
        found.signatures.push(feature.signature);
    }
    Ok(found)
}
