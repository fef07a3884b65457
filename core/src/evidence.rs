//! How much a map is worth: evidence in bits that the frame shows the stored view, corner by corner.

use heapless::Vec;

use crate::candidate::{GAIN_UNIT, surprise};
use crate::kernel::Kernels;
use crate::math::{self, log2_q8};
use crate::model::EVIDENCE;
use crate::pyramid::scale;
use crate::query::CROWD_RADIUS;
use crate::refine::{Pairing, Refined, fitting_levels};
use crate::transform::Shape;

/// Evidence is in 1/160 bit: 1/8 bit of the table times a level weight in twentieths.
pub const EVIDENCE_UNIT: i32 = 160;
/// Weight of a stored corner's level, in twentieths: coarse patches overlap and are not independent.
const LEVEL_WEIGHT: [i32; 5] = [20, 20, 14, 10, 7];
/// A corner that should be seen, and nothing is: -0.3 bit.
const MISSING: i32 = -48;
/// A corner is looked for within this, in pixels.
pub const RADIUS: f32 = CROWD_RADIUS;
/// Cells of the stored view along each side of a square over its longer side.
const CELLS: usize = 6;
/// Evidence of a cell beyond this counts three tenths: 12 bits.
const CELL_FULL: i32 = 12 * EVIDENCE_UNIT;

/// The evidence for a view, all told, in 1/160 bit: what its corners say, and how plausible the map is.
///
/// `(corners + 0.6 support + 4 n - 16 |ln s| - 3 ln r - 23 |p| - 23 |q|) / 2.2` with `corners` and `support` in bits, `n`
/// the corners in favour, and of the map's derivative `J` at the centre of the pairs: `s` its scale, `r` the ratio of
/// its singular values, `p = J01 / J11` and `q = J10 / J00` its shears. A logistic regression on pairs of photographs:
/// a wrong map with the same corner evidence has half the corners in favour, a third of the support, any scale, and
/// more shear.
pub fn total(corners: i32, in_favour: u16, support: i32, shape: Shape) -> i32 {
    let support = support * (EVIDENCE_UNIT / 32) / (GAIN_UNIT / 32);
    let unit = f64::from(EVIDENCE_UNIT);
    let stretch = 16.0 * natural_log(shape.scale).abs() + 3.0 * natural_log(shape.ratio).abs();
    let shear = 23.0 * (f64::from(shape.shear[0]).abs() + f64::from(shape.shear[1]).abs());
    let penalty = ((stretch + shear) * unit) as i32;
    (corners + support * 3 / 5 + 4 * EVIDENCE_UNIT * i32::from(in_favour) - penalty) * 5 / 11
}

fn natural_log(x: f32) -> f64 {
    math::log2(f64::from(x)) * core::f64::consts::LN_2
}

/// What one stored corner said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CornerEvidence {
    /// Number of the stored corner.
    pub stored: u16,
    /// Number of the query corner that matched; `None` where a corner was expected and nothing found.
    pub query: Option<u16>,
    /// Evidence in 1/160 bit; negative if the corner speaks against the view.
    pub evidence: i32,
}

/// Adds up the evidence for a map. `corners` receives every stored corner that had something to say.
///
/// For a stored corner that maps into the frame, of the `m` query corners within 10 px and one level the nearest
/// signature (distance `d`) counts: `a = surprise(d) - commonness - log2 m` and `b = log2(n / (1 + rank)) - log2 m`, where `rank`
/// of the frame's `n` corners elsewhere are nearer than `d`. The rank devalues windows that match everywhere. The
/// table of `model.rs` turns `a` and `b` into bits. A query corner supports one stored corner only. The sum over each
/// of 6 x 6 cells of the view saturates, so that one sign or tree cannot carry the answer.
pub fn weigh<K: Kernels + ?Sized, const QUERY: usize, const CORNERS: usize>(
    kernels: &K,
    pairing: &Pairing<'_, QUERY>,
    refined: &Refined,
    corners: &mut Vec<CornerEvidence, CORNERS>,
) -> i32 {
    corners.clear();
    let mut owned = [0; OWNED_WORDS];
    let fitting = fitting_levels(refined.shape.scale);
    let (width, height) = (f32::from(pairing.query.width), f32::from(pairing.query.height));
    let count_bits = log2_q8(pairing.query.len() as u32);
    let ordinary = ordinary_rank(pairing.query.len() as u32);
    let stored_corners = pairing.stored.positions.iter().zip(pairing.stored.levels).zip(pairing.stored.commonness);
    for (number, ((position, &level), &commonness)) in stored_corners.enumerate() {
        let [x, y] = refined.frame_from_view.apply(position.to_pixels());
        if !(x >= 0.0 && y >= 0.0 && x < width && y < height) {
            continue;
        }
        let stored = number as u16;
        let row = pairing.row(number);
        let levels = fitting.get(usize::from(level)).copied().unwrap_or(0);
        let (mut near, mut best) = (0_u32, (u8::MAX, u16::MAX));
        pairing.index.within([x, y], RADIUS, |query, level, _| {
            if levels >> level & 1 == 1 {
                near += 1;
                let distance = row.get(usize::from(query)).copied().unwrap_or(u8::MAX);
                best = best.min((distance, query));
            }
        });
        if near == 0 {
            if is_expected(scale(level) * refined.shape.scale) {
                let _ = corners.push(CornerEvidence { stored, query: None, evidence: MISSING });
            }
            continue;
        }
        let (distance, query) = best;
        let nearer = kernels.count_below(row, distance);
        // Most corners of a wrong map end here: whatever of the nearer ones is here, too many are elsewhere.
        if nearer >= ordinary.saturating_add(pairing.index.crowd()) {
            enter(corners, &mut owned, CornerEvidence { stored, query: Some(query), evidence: 0 });
            continue;
        }
        let near_bits = log2_q8(near);
        let rank_bits = log2_q8(1 + nearer.saturating_sub(nearer_here(pairing, row, distance, query)));
        let surprise = i32::from(surprise(distance)) * 32;
        let a = ((surprise - near_bits - i32::from(commonness) * 256) >> 8).clamp(0, 15) as usize;
        let b = ((count_bits - rank_bits - near_bits) >> 8).clamp(0, 9) as usize;
        let eighths = EVIDENCE.get(a).and_then(|row| row.get(b)).map_or(0, |&e| i32::from(e));
        let evidence = eighths * LEVEL_WEIGHT.get(usize::from(level)).copied().unwrap_or(0);
        enter(corners, &mut owned, CornerEvidence { stored, query: Some(query), evidence });
    }
    sum_by_cell(pairing, corners)
}

/// The least rank in a frame of `count` corners that says nothing, whatever the distance: the first four columns of the table
/// are zero.
fn ordinary_rank(count: u32) -> u32 {
    const _: () = {
        let mut row = 0;
        while row < EVIDENCE.len() {
            let [a, b, c, d, ..] = EVIDENCE[row];
            assert!(a == 0 && b == 0 && c == 0 && d == 0);
            row += 1;
        }
    };
    let mut rank = count / 16;
    while log2_q8(count) - log2_q8(1 + rank) >= 4 << 8 {
        rank += 1;
    }
    rank
}

/// Corners of the frame that are nearer in signature and lie within the radius of the match; the others are its rank.
fn nearer_here<const QUERY: usize>(pairing: &Pairing<'_, QUERY>, row: &[u8], distance: u8, query: u16) -> u32 {
    let Some(place) = pairing.query.positions.get(usize::from(query)) else { return 0 };
    let mut here = 0;
    pairing.index.within(place.to_pixels(), RADIUS, |other, _, _| {
        here += u32::from(row.get(usize::from(other)).is_some_and(|&other| other < distance));
    });
    here
}

/// Whether a corner whose patch appears at this scale would be detected on some level: within 0.6 of a level.
fn is_expected(apparent_scale: f32) -> bool {
    // 1.41^-0.6 and 1.41^4.6.
    (0.8137..=4.857).contains(&apparent_scale)
}

/// Words of a set of query corners, by the last bits of their numbers.
const OWNED_WORDS: usize = 4;

/// Adds a corner; if its query corner supports another already, the weaker of the two says nothing in favour. `owned` has
/// the bit of each query corner that supports one, and of others: only then it is looked for.
fn enter<const CORNERS: usize>(
    corners: &mut Vec<CornerEvidence, CORNERS>,
    owned: &mut [u64; OWNED_WORDS],
    mut new: CornerEvidence,
) {
    let place = new.query.map_or(0, usize::from);
    let (word, bit) = (&mut owned[place / 64 % OWNED_WORDS], 1 << (place % 64));
    if *word & bit == 0 {
        *word |= bit;
    } else if let Some(owner) = corners.iter_mut().find(|owner| owner.query == new.query) {
        if new.evidence <= owner.evidence {
            new.evidence = new.evidence.min(0);
            new.query = None;
        } else {
            owner.evidence = 0;
            owner.query = None;
        }
    }
    // As many as the view has corners.
    let _ = corners.push(new);
}

fn sum_by_cell<const QUERY: usize>(pairing: &Pairing<'_, QUERY>, corners: &[CornerEvidence]) -> i32 {
    let side = usize::from(pairing.stored.width.max(pairing.stored.height).max(1)) * 16;
    let mut cells = [[0_i32; CELLS]; CELLS];
    for corner in corners {
        let Some(position) = pairing.stored.positions.get(usize::from(corner.stored)) else { continue };
        let cell = |p: i32| ((p.max(0) as usize).saturating_mul(CELLS) / side).min(CELLS - 1);
        if let Some(sum) = cells.get_mut(cell(position.y)).and_then(|row| row.get_mut(cell(position.x))) {
            *sum += corner.evidence;
        }
    }
    let saturated = |&sum: &i32| if sum > CELL_FULL { CELL_FULL + (sum - CELL_FULL) * 3 / 10 } else { sum };
    cells.iter().flatten().map(saturated).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beyond_the_ordinary_rank_no_corner_says_anything() {
        for count in 1..=2_048 {
            let column = |rank: u32| (log2_q8(count) - log2_q8(1 + rank)) >> 8;
            let ordinary = ordinary_rank(count);
            assert!((ordinary..=count).all(|rank| column(rank) < 4), "{count} corners");
            assert!(ordinary == 0 || count < 16 || column(ordinary - 1) >= 4, "{count} corners");
        }
    }
}
