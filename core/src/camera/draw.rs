//! Poses from drawn triples of correspondences: the one that most of the others agree with.

use super::adjust::Problem;
use super::placement::CameraFromModel;
use super::posit::{Sight, of_three};
use crate::math::sqrt_f64;

/// Triples, at most: with half of the correspondences right, an eighth of the triples are, and 69 miss them all once in
/// 10,000 times.
const DRAWS: u32 = 96;
/// Stop when all triples so far were spoilt with at most this probability.
const MISSED: f64 = 1e-4;
/// Attempts to draw a triple that is spread out enough, at most.
const ATTEMPTS: u32 = 12;
/// A triple whose triangle in the image has less than this share of the deviations of all points along their two axes,
/// multiplied, is passed over: its pose would say little about the rest.
const LEAST_AREA: f64 = 0.7;
/// Fixed: the same correspondences give the same pose.
const SEED: u64 = 0x6461_796D_6172_6B31;

/// `SplitMix64` (Steele, Lea and Flood 2014).
struct Draw {
    state: u64,
}

impl Draw {
    /// A number below `limit`.
    fn below(&mut self, limit: usize) -> usize {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.state;
        value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        value ^= value >> 31;
        (((value >> 32) * limit as u64) >> 32) as usize
    }
}

/// Twice the area of a triangle of rays.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
}

/// The product of the deviations of the rays along their two axes.
fn spread(sights: &[Sight]) -> f64 {
    let share = 1.0 / sights.len() as f64;
    let mean = sights.iter().fold([0.0; 2], |[x, y], sight| [x + sight.ray[0] * share, y + sight.ray[1] * share]);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for sight in sights {
        let (x, y) = (sight.ray[0] - mean[0], sight.ray[1] - mean[1]);
        xx += x * x * share;
        xy += x * y * share;
        yy += y * y * share;
    }
    sqrt_f64(xx * yy - xy * xy)
}

/// The pose of a triple with the least truncated cost that `allowed` lets pass; `None` if none comes about.
///
/// Cost: at most 96 triples with two poses each, and every pose stops being compared when it cannot be the best any more.
pub(super) fn of_most(
    problem: &Problem<'_>,
    gate_squared: f64,
    allowed: impl Fn(&CameraFromModel) -> bool,
) -> Option<CameraFromModel> {
    let sights = problem.sights;
    let count = sights.len();
    let least = LEAST_AREA * spread(sights);
    let mut draw = Draw { state: SEED };
    let (mut best, mut best_cost) = (None, f64::INFINITY);
    let mut needed = DRAWS;
    let mut drawn = 0;
    while drawn < needed {
        drawn += 1;
        let Some(triple) = triple(&mut draw, sights, least) else { continue };
        for pose in of_three(triple).into_iter().flatten() {
            if allowed(&pose)
                && let Some(cost) = problem.cost_below(&pose, gate_squared, best_cost)
            {
                (best, best_cost) = (Some(pose), cost);
                let right = problem.agreement(&pose, gate_squared).inside as f64 / count as f64;
                needed = draws_for(right).min(DRAWS);
            }
        }
    }
    best
}

fn triple(draw: &mut Draw, sights: &[Sight], least: f64) -> Option<[Sight; 3]> {
    for _ in 0..ATTEMPTS {
        let [a, b, c] = [(); 3].map(|()| draw.below(sights.len()));
        let triple = [*sights.get(a)?, *sights.get(b)?, *sights.get(c)?];
        if area(triple[0].ray, triple[1].ray, triple[2].ray) > least {
            return Some(triple);
        }
    }
    None
}

/// How many triples make it likely enough that one of them is right.
fn draws_for(right: f64) -> u32 {
    let spoilt = 1.0 - right * right * right;
    let (mut missed, mut draws) = (1.0, 0);
    while missed > MISSED && draws < DRAWS {
        missed *= spoilt;
        draws += 1;
    }
    draws
}
