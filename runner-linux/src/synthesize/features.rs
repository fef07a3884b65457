//! Corners and signatures of a view, many more than recognition takes, and which of two views' look alike.

use daymark_core::extract::FrontEnd;
use daymark_core::feature::Signature;
use daymark_core::image::FrameError;
use daymark_core::kernel::places;
use daymark_engine::reader::{FrameReader, MOST_FEATURES};

use super::view::View;
use crate::order;
use crate::simd::Processor;

/// Features of a view, at most.
pub const FEATURES: usize = MOST_FEATURES;
const FRONT_END: FrontEnd = FrontEnd { features: FEATURES as u16, cell_share_tenths: 20 };
/// Bits by which matching signatures may differ, of 128.
const MAX_BITS: u32 = 40;
/// The best match must have at most this share of the next one's bits, in hundredths.
const RATIO_PERCENT: u32 = 85;
/// Along a line there are fewer to be mistaken for.
const GUIDED_RATIO_PERCENT: u32 = 80;
/// A line holds dozens of features, and one of them is always on it: signatures must be nearer than elsewhere.
const MAX_GUIDED_BITS: u32 = 28;
/// Bits at which a rival is looked at.
const MAX_RIVAL_BITS: u8 = 48;
/// What lies this near is the same place, no competitor; pixels.
const SAME_PLACE: f64 = 6.0;

/// The features of a view as columns.
#[derive(Debug, Clone, Default)]
pub struct ViewFeatures {
    /// Where they are in the picture, pixels.
    pub points: Vec<[f64; 2]>,
    /// The same without distortion; NaN where no ray comes from.
    pub ideal: Vec<[f64; 2]>,
    /// Their signatures.
    pub signatures: Vec<Signature>,
}

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

/// Pairs of features whose signatures are nearest to one another in both directions, clearly nearer than the next ones
/// elsewhere. Ties have no match. `O(n m)`.
pub fn mutual_matches(first: &ViewFeatures, second: &ViewFeatures) -> Vec<[u32; 2]> {
    let mut row = vec![0; first.points.len().max(second.points.len())];
    (0..first.points.len())
        .filter_map(|number| {
            let best = nearest(first.signatures[number], second, &mut row)?;
            // The way back is looked for only where there is one.
            let back = nearest(second.signatures[best], first, &mut row)?;
            (back == number).then_some([number as u32, best as u32])
        })
        .collect()
}

/// The feature nearest to a signature, if it is near and no other one elsewhere comes close.
fn nearest(signature: Signature, to: &ViewFeatures, row: &mut [u8]) -> Option<usize> {
    let row = row.get_mut(..to.signatures.len())?;
    let processor = Processor::detect();
    let kernels = processor.kernels();
    kernels.distances(signature, &to.signatures, row);
    let least = row.iter().copied().min()?;
    if u32::from(least) > MAX_BITS {
        return None;
    }
    let best = row.iter().position(|&distance| distance == least)?;
    let limit = (u32::from(least) * 100 / RATIO_PERCENT) as u8;
    let mut marks = vec![0; row.len().div_ceil(64)];
    kernels.marks_at_most(row, limit, &mut marks);
    let rival = places(&marks).any(|other| elsewhere(to.points[other], to.points[best]));
    (!rival).then_some(best)
}

fn elsewhere(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() > SAME_PLACE || (a[1] - b[1]).abs() > SAME_PLACE
}

/// For features without a match: the nearest signature among those that `near` allows, if no other comes close.
pub fn guided_matches(
    first: &ViewFeatures,
    second: &ViewFeatures,
    known: &[[u32; 2]],
    near: impl Fn([f64; 2], [f64; 2]) -> bool,
) -> Vec<[u32; 2]> {
    let (mut left, mut right) = (vec![false; first.points.len()], vec![false; second.points.len()]);
    for &[a, b] in known {
        (left[a as usize], right[b as usize]) = (true, true);
    }
    let processor = Processor::detect();
    let kernels = processor.kernels();
    let mut found: Vec<(u8, [u32; 2])> = Vec::new();
    let mut row = vec![0; second.points.len()];
    let mut marks = vec![0; row.len().div_ceil(64)];
    for (a, signature) in first.signatures.iter().enumerate().filter(|(a, _)| !left[*a]) {
        let mut candidates: Vec<(u8, usize)> = Vec::new();
        kernels.distances(*signature, &second.signatures, &mut row);
        kernels.marks_at_most(&row, MAX_RIVAL_BITS, &mut marks);
        let allowed = places(&marks).filter(|&b| !right[b] && near(first.ideal[a], second.ideal[b]));
        candidates.extend(allowed.map(|b| (row[b], b)));
        candidates.sort_unstable();
        let Some(&(least, best)) = candidates.first().filter(|(least, _)| u32::from(*least) <= MAX_GUIDED_BITS) else {
            continue;
        };
        let next = candidates.iter().find(|(_, other)| elsewhere(second.points[*other], second.points[best]));
        if next.is_none_or(|(next, _)| u32::from(least) * 100 <= u32::from(*next) * GUIDED_RATIO_PERCENT) {
            found.push((least, [a as u32, best as u32]));
        }
    }
    // One to one, the best first.
    order::sort(&mut found);
    found
        .into_iter()
        .filter_map(|(_, pair)| {
            let taken = std::mem::replace(&mut right[pair[1] as usize], true);
            (!taken).then_some(pair)
        })
        .collect()
}
