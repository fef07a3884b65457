//! Writes a table of one landmark with one view, as a device would that learns a place.

use daymark_core::extract::Features;
use daymark_core::feature::Feature;
use daymark_core::profile::Profile;
use daymark_core::table::{
    HEADER_BYTES, Kind, LANDMARK_BYTES, TableEncoder, corner_key, corners_limit, encode_landmark, encode_view, on_grid,
};

use crate::MEMORY;
use crate::device::Flash;
use crate::outcome::Failure;

const CORNERS: usize = corners_limit(Profile::Handheld) as usize;

/// The table goes to the beginning of the flash pages.
#[inline(never)]
pub fn enroll(features: Features<'_>, flash: Flash) -> Result<(), Failure> {
    let mut corners = [Feature::default(); CORNERS];
    let sorted = chosen(features, &mut corners);

    let limit = corners_limit(Profile::Handheld);
    let mut encoder = TableEncoder::new(Profile::Handheld, limit, 1, 1)?;
    let mut name = [0; LANDMARK_BYTES];
    let landmark = encode_landmark("Lantern", Kind::Lighthouse, None, &mut name)?;
    let mut record = [0; MEMORY.record];
    let view = encode_view(limit, features.width, features.height, sorted, &mut record)?;

    let at = flash.write(HEADER_BYTES, &encoder.push_landmark(landmark)?)?;
    let at = flash.write(at, &encoder.push_view(0, view)?)?;
    let at = flash.write(at, landmark)?;
    flash.write(at, view)?;
    flash.write(0, &encoder.finish()?)?;
    Ok(())
}

/// Every third feature, sorted as a view wants it, each place once.
fn chosen<'c>(features: Features<'_>, corners: &'c mut [Feature; CORNERS]) -> &'c [Feature] {
    let mut count = 0;
    for feature in features.iter().step_by(3) {
        let corner = Feature { position: on_grid(feature.position, features.width, features.height), ..feature };
        let Ok(key) = corner_key(&corner) else { continue };
        let taken = corners.get(..count).unwrap_or(&[]).iter().any(|other| corner_key(other) == Ok(key));
        let Some(slot) = corners.get_mut(count).filter(|_| !taken) else { continue };
        *slot = corner;
        count += 1;
        let mut at = count - 1;
        while at > 0
            && let Some([before, after]) = corners.get_mut(at - 1..=at)
            && corner_key(before).ok() > corner_key(after).ok()
        {
            core::mem::swap(before, after);
            at -= 1;
        }
    }
    corners.get(..count).unwrap_or(&[])
}
