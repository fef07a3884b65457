//! The frame's corners in nested hulls.

use daymark_core::capacity::HANDHELD_FEATURES;
use daymark_core::extract::Features;
use daymark_core::geometry::{ConvexHull, Hull, HullLayers, Orientation, orientation};

use crate::outcome::Failure;

/// Whether the outermost layer is the convex hull, and goes clockwise.
#[inline(never)]
pub fn nest(corners: Features<'_>) -> Result<bool, Failure> {
    let mut layers = const { HullLayers::<HANDHELD_FEATURES, { HANDHELD_FEATURES / 3 }>::new() };
    layers.peel(corners.positions)?;
    let same = match const { ConvexHull::<HANDHELD_FEATURES>::new() }.enclose(corners.positions)? {
        Hull::Polygon(hull) => hull == layers.layer(0),
        _ => layers.is_empty(),
    };
    let clockwise = match layers.layer(0) {
        &[a, b, c, ..] => {
            let place = |number: u16| corners.positions.get(usize::from(number)).copied().unwrap_or_default();
            orientation(place(a), place(b), place(c)) == Orientation::Clockwise
        }
        _ => false,
    };
    let told = layers.layers().flatten().all(|&number| layers.layer_of(number).is_some());
    Ok(same && clockwise && told)
}
