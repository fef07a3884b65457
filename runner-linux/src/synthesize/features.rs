//! Corners and signatures of a view, many more than recognition takes, and which of two views' look alike.

use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::feature::Signature;
use daymark_core::image::FrameError;
use daymark_core::pyramid::level_bytes;
use daymark_core::tone::TonedFrame;

use super::view::View;
use crate::simd::Processor;
use crate::with_kernels;

/// Features of a view, at most.
pub const FEATURES: usize = 4_000;
const FRONT_END: FrontEnd = FrontEnd { features: FEATURES as u16, cell_share_tenths: 20 };
const STRIP: usize = 256;
/// Bits by which matching signatures may differ, of 128.
const MAX_BITS: u32 = 40;
/// The best match must have at most this share of the next one's bits, in hundredths.
const RATIO_PERCENT: u32 = 85;
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
    let mut extractor: Box<Extractor<STRIP, { FRONT_END.slots() }>> = Box::default();
    let mut set: Box<FeatureSet<FEATURES>> = Box::default();
    let mut levels = vec![0; level_bytes(view.gray.width, view.gray.height)];
    let mut toned = vec![0; view.gray.width * view.gray.height];
    let frame = view.gray.view()?;
    with_kernels!(Processor::detect(), kernels => {
        let toned = TonedFrame::write(kernels, frame, &mut toned)?;
        extractor.extract(kernels, toned, FRONT_END, &mut levels, &mut set)
    })?;
    let mut found = ViewFeatures::default();
    for feature in set.view().iter() {
        let at = feature.position.to_pixels().map(f64::from);
        found.points.push(at);
        found.ideal.push(view.lens.ideal_from_picture(at).unwrap_or([f64::NAN; 2]));
        found.signatures.push(feature.signature);
    }
    Ok(found)
}

#[inline(always)]
fn bits(a: &Signature, b: &Signature) -> u32 {
    (a.0[0] ^ b.0[0]).count_ones() + (a.0[1] ^ b.0[1]).count_ones()
}

/// Pairs of features whose signatures are nearest to one another in both directions, clearly nearer than the next ones
/// elsewhere. Ties have no match. `O(n m)`.
pub fn mutual_matches(first: &ViewFeatures, second: &ViewFeatures) -> Vec<[u32; 2]> {
    let forward = nearest(first, second);
    let back = nearest(second, first);
    (0_u32..)
        .zip(&forward)
        .filter_map(|(number, best)| {
            let best = (*best)?;
            (back.get(best as usize).copied().flatten() == Some(number)).then_some([number, best])
        })
        .collect()
}

fn nearest(from: &ViewFeatures, to: &ViewFeatures) -> Vec<Option<u32>> {
    let mut distances = vec![0; to.signatures.len()];
    from.signatures
        .iter()
        .map(|signature| {
            for (distance, other) in distances.iter_mut().zip(&to.signatures) {
                *distance = bits(signature, other);
            }
            let (best, &least) = distances.iter().enumerate().min_by_key(|(number, distance)| (**distance, *number))?;
            if least > MAX_BITS {
                return None;
            }
            let limit = least * 100 / RATIO_PERCENT;
            let [x, y] = to.points[best];
            let rival = distances.iter().zip(&to.points).any(|(&distance, at)| {
                distance <= limit && ((at[0] - x).abs() > SAME_PLACE || (at[1] - y).abs() > SAME_PLACE)
            });
            (!rival).then_some(best as u32)
        })
        .collect()
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
    let mut found: Vec<(u32, [u32; 2])> = Vec::new();
    for (a, signature) in first.signatures.iter().enumerate().filter(|(a, _)| !left[*a]) {
        let (mut best, mut next) = ((u32::MAX, 0), u32::MAX);
        for (b, other) in second.signatures.iter().enumerate().filter(|(b, _)| !right[*b]) {
            let distance = bits(signature, other);
            if distance > MAX_BITS + 8 || distance >= next || !near(first.ideal[a], second.ideal[b]) {
                continue;
            }
            if distance < best.0 {
                let [x, y] = second.points[best.1];
                let at = second.points[b];
                let elsewhere = (at[0] - x).abs() > SAME_PLACE || (at[1] - y).abs() > SAME_PLACE;
                if best.0 < u32::MAX && elsewhere {
                    next = best.0;
                }
                best = (distance, b);
            } else {
                let [x, y] = second.points[best.1];
                let at = second.points[b];
                if (at[0] - x).abs() > SAME_PLACE || (at[1] - y).abs() > SAME_PLACE {
                    next = distance;
                }
            }
        }
        if best.0 <= MAX_BITS && best.0 * 100 <= next.saturating_mul(90) {
            found.push((best.0, [a as u32, best.1 as u32]));
        }
    }
    // One to one, the best first.
    found.sort_unstable();
    found
        .into_iter()
        .filter_map(|(_, pair)| {
            let taken = std::mem::replace(&mut right[pair[1] as usize], true);
            (!taken).then_some(pair)
        })
        .collect()
}
