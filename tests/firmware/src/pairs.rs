//! Some of the frame's corners, and the same in another view: which is which, from their places alone.

use core::hint::black_box;

use daymark_core::capacity::{HANDHELD_CORNERS, HANDHELD_QUADS, HandheldCorrespond, HandheldHullLayers};
use daymark_core::extract::Features;
use daymark_core::geometry::arrangement::Arrangement;
use daymark_core::geometry::correspond::{Settings, Sources};
use daymark_core::geometry::proposal::Invariance;
use daymark_core::geometry::quad::Tolerance;
use daymark_core::geometry::shift::{LayerQuad, plain_shift};
use daymark_core::point::ImagePoint;

use crate::outcome::Failure;

/// Arrangements of a corner or two: the way there, not the result.
const ARRANGEMENTS: usize = 64;
/// Corners that are matched.
const CORNERS: usize = 32;

/// Whether the corners are found again by the thesis' rule and by nested hulls, and no wrong one.
#[inline(never)]
pub fn check(corners: Features<'_>) -> Result<bool, Failure> {
    let mut first = [ImagePoint::default(); CORNERS];
    let mut second = first;
    for ((one, two), &corner) in first.iter_mut().zip(&mut second).zip(corners.positions.iter().step_by(5)) {
        *one = corner;
        // A shear, exact in integers.
        *two = ImagePoint::new(corner.x.wrapping_mul(2).wrapping_add(corner.y), corner.y.wrapping_add(640));
    }
    Ok(plainly(&first, &second)? && tolerantly(&first, &second)?)
}

#[inline(never)]
fn plainly(first: &[ImagePoint], second: &[ImagePoint]) -> Result<bool, Failure> {
    let mut layers = [const { HandheldHullLayers::new() }; 2];
    let [one, two] = &mut layers;
    one.peel(first)?;
    two.peel(second)?;
    let mut right = true;
    let mut count = 0;
    for (one, two) in one.layers().zip(two.layers()) {
        let shift = plain_shift::<HANDHELD_CORNERS>((first, one), (second, two), black_box(Tolerance::FIVE_PERCENT));
        for pair in shift.iter().flat_map(|shift| &shift.pairs) {
            right &= pair.first == pair.second;
            count += 1;
        }
    }
    Ok(right && count > CORNERS / 2)
}

#[inline(never)]
fn tolerantly(first: &[ImagePoint], second: &[ImagePoint]) -> Result<bool, Failure> {
    let mut workspace = const { HandheldCorrespond::new() };
    let mut quads = [LayerQuad::default(); HANDHELD_QUADS];
    let mut arrangements = [Arrangement::default(); ARRANGEMENTS];
    let hulls = Settings { sources: Sources::Layers, ..Settings::of_picture(black_box(640), 320) };
    let mut all = Settings { sources: Sources::Both, ..hulls };
    black_box(workspace.correspond(first, second, all, &mut arrangements, &mut quads)?.is_ok());
    all.terms.invariance = black_box(Invariance::Perspective);
    black_box(workspace.correspond(first, second, all, &mut arrangements, &mut quads)?.is_ok());
    let voted = workspace.vote(first, second, hulls, &mut [], &mut quads)?;
    let votes_right = !voted.is_empty() && voted.iter().all(|supported| supported.pair.first == supported.pair.second);
    let answer = workspace.correspond(first, second, hulls, &mut [], &mut quads)?;
    let found = workspace.found();
    let right = found.iter().all(|found| found.pair.first == found.pair.second);
    Ok(votes_right && answer.is_ok() && right && found.len() > CORNERS / 2)
}
