//! What a new view is worth, told before it disappoints in the field.
//!
//! Everything is measured by the matcher that will be used: the picture is changed as a walk around the building would
//! change it, mirrored, and compared with all other buildings of the table.

use std::ops::Range;

use daymark_core::evidence::EVIDENCE_UNIT;
use daymark_core::image::FrameError;
use daymark_core::table::{LandmarkTable, StoredView, TableError, ViewSource};
use daymark_core::verdict::{Calibration, FalseAnswer};

use super::simulate::CHANGES;
use crate::engine::Engine;
use crate::order;
use crate::picture::GrayImage;

/// The simulated views' noise begins here, so that it is not the noise with which corners were chosen.
const FIRST_SEED: u64 = 1_000;
/// Views of the table for which good evidence is reckoned, so that it does not depend on who else is enrolled.
const USUAL_VIEWS: u32 = 100;
/// Look-alikes that are told, at most.
const LOOKALIKES_TOLD: usize = 3;
/// A corner's double has at most this many of 128 signature bits different.
const DOUBLE_BITS: u32 = 26;
/// A double is at least this far away, in pixels...
const LEAST_SHIFT: i32 = 16;
/// ...and doubles that are shifted alike, within this in pixels, make a repetition.
const SHIFT_CELL: i32 = 8;

/// What a view of the table is worth.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewLint {
    /// Evidence that an answer needs in a table of this size, to be false with a probability of 1 % at most.
    pub needed_bits: f64,
    /// Evidence that an answer needs in a table of 100 views.
    pub usually_needed_bits: f64,
    /// Median evidence over simulated views of the picture.
    pub median_bits: f64,
    /// Evidence in the simulated view that fits worst.
    pub worst_bits: f64,
    /// Other buildings that the picture fits so well that they would be the answer, best first.
    pub lookalikes: Vec<LookAlike>,
    /// Evidence of the mirrored picture.
    pub mirror_bits: f64,
    /// The shift under which the view fits its own picture best.
    pub repetition: Repetition,
    /// Evidence that the building's earlier views give the picture; `None` if there is no earlier view.
    pub earlier_views_bits: Option<f64>,
}

/// A building that a picture of another one fits.
#[derive(Debug, Clone, PartialEq)]
pub struct LookAlike {
    /// Its name.
    pub name: String,
    /// Evidence of its best view.
    pub bits: f64,
    /// The probability that so much evidence is chance.
    pub false_answer: f64,
}

/// Corners that look the same a step further, as those of windows in rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Repetition {
    /// Corners of the view that have a double there.
    pub corners: usize,
    /// Corners of the view.
    pub of_corners: usize,
    /// The step, in pixels right and down.
    pub shift_pixel: [i32; 2],
}

/// Measures view `number` of a verified table against `picture`, the picture it was made of.
///
/// # Errors
/// A frame beyond core's limits, or a damaged table: neither comes from enrollment.
pub fn lint(
    engine: &mut Engine,
    table: LandmarkTable<'_>,
    number: u32,
    picture: &GrayImage,
) -> Result<ViewLint, LintError> {
    let view = table.view(number)?;
    let calibration = Calibration::of(table.profile());
    let views = table.view_count();

    let mut simulated = Vec::with_capacity(CHANGES.len());
    for (seed, change) in (FIRST_SEED..).zip(&CHANGES) {
        engine.extract(&change.render(picture, seed))?;
        simulated.push(evidence(engine, &view));
    }
    order::sort(&mut simulated);
    engine.extract(&mirrored(picture))?;
    let mirror = evidence(engine, &view);

    engine.extract(picture)?;
    let repetition = repetition(engine, &view);
    let own = table.landmark(view.landmark())?.views;
    let earlier = best_of(engine, table, own.start..number)?;
    let mut lookalikes = Vec::new();
    for other in (0..table.landmark_count()).filter(|&other| other != view.landmark()) {
        let landmark = table.landmark(other)?;
        let Some(found) = best_of(engine, table, landmark.views)? else { continue };
        let false_answer = calibration.false_answer(found, views);
        if false_answer <= FalseAnswer::ONE_PERCENT {
            let false_answer = false_answer.probability();
            lookalikes.push((found, LookAlike { name: landmark.name.to_owned(), bits: bits(found), false_answer }));
        }
    }
    order::sort_by_key(&mut lookalikes, |(found, _)| std::cmp::Reverse(*found));
    lookalikes.truncate(LOOKALIKES_TOLD);

    Ok(ViewLint {
        needed_bits: bits(needed(calibration, views)),
        usually_needed_bits: bits(needed(calibration, USUAL_VIEWS)),
        median_bits: bits(i32::midpoint(simulated[(CHANGES.len() - 1) / 2], simulated[CHANGES.len() / 2])),
        worst_bits: bits(simulated[0]),
        lookalikes: lookalikes.into_iter().map(|(_, lookalike)| lookalike).collect(),
        mirror_bits: bits(mirror),
        repetition,
        earlier_views_bits: earlier.map(bits),
    })
}

/// Evidence of one view for the frame that the engine has read; none is 0.
fn evidence(engine: &mut Engine, view: &StoredView<'_>) -> i32 {
    engine.explain(view).map_or(0, |(matched, _)| matched.evidence.max(0))
}

fn best_of(engine: &mut Engine, mut table: LandmarkTable<'_>, views: Range<u32>) -> Result<Option<i32>, TableError> {
    let mut best = None;
    for number in views {
        let view = ViewSource::view(&mut table, number, &mut [])?;
        best = best.max(Some(evidence(engine, &view)));
    }
    Ok(best)
}

/// The least evidence with which an answer is false with a probability of 1 % at most.
fn needed(calibration: Calibration, views: u32) -> i32 {
    let (mut least, mut enough) = (0, 1 << 20);
    while least < enough {
        let middle = i32::midpoint(least, enough);
        if calibration.false_answer(middle, views) <= FalseAnswer::ONE_PERCENT {
            enough = middle;
        } else {
            least = middle + 1;
        }
    }
    enough
}

fn mirrored(picture: &GrayImage) -> GrayImage {
    let mut mirrored = picture.clone();
    mirrored.pixels.chunks_exact_mut(picture.width.max(1)).for_each(<[u8]>::reverse);
    mirrored
}

/// The most frequent shift from a stored corner to one that looks the same on the same level, elsewhere in the picture.
fn repetition(engine: &Engine, view: &StoredView<'_>) -> Repetition {
    let frame: Vec<_> = engine.features().iter().collect();
    let mut shifts: Vec<([i32; 2], usize)> = Vec::new();
    for (number, corner) in view.features().enumerate() {
        for other in frame.iter().filter(|other| other.level == corner.level) {
            let pixels = |from: i32, to: i32| (to - from) / 16;
            let dx = pixels(corner.position.x, other.position.x);
            let dy = pixels(corner.position.y, other.position.y);
            if dx.abs().max(dy.abs()) < LEAST_SHIFT || corner.signature.distance(other.signature) > DOUBLE_BITS {
                continue;
            }
            // Half-overlapping cells, so that no shift falls between two.
            let cell = |d: i32| d.div_euclid(SHIFT_CELL);
            let [cx, cy] = [cell(dx), cell(dy)];
            for neighbour in [[cx, cy], [cx + 1, cy], [cx, cy + 1], [cx + 1, cy + 1]] {
                shifts.push((neighbour, number));
            }
        }
    }
    order::sort(&mut shifts);
    shifts.dedup();
    let most = shifts.chunk_by(|a, b| a.0 == b.0).max_by_key(|same| (same.len(), std::cmp::Reverse(same[0].0)));
    Repetition {
        corners: most.map_or(0, <[_]>::len),
        of_corners: view.len(),
        shift_pixel: most.map_or([0; 2], |same| same[0].0.map(|cell| cell * SHIFT_CELL)),
    }
}

fn bits(evidence: i32) -> f64 {
    f64::from(evidence) / f64::from(EVIDENCE_UNIT)
}

/// What cannot happen to a view that was enrolled just now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LintError {
    /// The picture is beyond core's limits.
    Frame(FrameError),
    /// The table is damaged.
    Table(TableError),
}

impl From<FrameError> for LintError {
    fn from(error: FrameError) -> Self {
        Self::Frame(error)
    }
}

impl From<TableError> for LintError {
    fn from(error: TableError) -> Self {
        Self::Table(error)
    }
}

impl std::fmt::Display for LintError {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Frame(error) => write!(out, "the picture cannot be measured: {error}"),
            Self::Table(error) => write!(out, "the new table cannot be read: {error}"),
        }
    }
}

impl std::error::Error for LintError {}
