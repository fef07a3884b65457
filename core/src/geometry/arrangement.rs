//! Local arrangements: a corner and the angular order of its neighbours, described by ratios of areas.
//!
//! After LLAH (Nakai, Kise, Iwamura, "Use of affine invariants in locally likely arrangement hashing", DAS 2006): of the
//! `n` nearest neighbours of a corner every choice of four, in angular order, is an arrangement of five points with four
//! affine invariants. A lost corner costs only the arrangements that hold it. Instead of hashing rounded invariants, which
//! loses those near a rounding edge, arrangements of one picture are sorted by one invariant, looked up by an interval, and
//! compared by the noise that the corners have.

use heapless::Vec;

use super::cross_ratio::FivePoints;
use super::proposal::{Invariance, Origin, Pairing, Proposal, Terms};
use super::quad::{Expected, Quad};
use super::sieve::{Shape, Sieve};
use crate::math::log2;
use crate::point::ImagePoint;

/// Neighbours among which the four are chosen.
pub const NEIGHBOURS: usize = 6;
/// Arrangements of one corner: 15 choices of 4 out of 6.
pub const ARRANGEMENTS_OF_A_CORNER: usize = 15;
/// Each arrangement of the second picture is entered from each of its four neighbours.
pub const STARTS: usize = 4;
/// An arrangement whose first invariant is less certain than this (standard deviation of its logarithm) says little.
const MOST_UNCERTAIN: f64 = 0.2;
/// Standard deviations that two invariants may differ by.
const GATE_SIGMAS: f64 = 3.0;

/// A corner and four of its neighbours, clockwise as seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Arrangement {
    /// ln of the area ratio of the first two triangles around the corner.
    key: f32,
    /// Its uncertainty.
    spread: f32,
    shape: Shape,
    /// The corner, then the neighbours.
    corners: [u16; 5],
}

/// Entries of scratch memory that arrangements of so many corners need; see [`propose`].
pub const fn scratch_length(corners: usize) -> usize {
    corners * ARRANGEMENTS_OF_A_CORNER * STARTS
}

/// The nearest neighbours of a corner in angular order, clockwise as seen, from the direction +x.
///
/// Equally near ones: the lower number first. Points at the corner's own place are no neighbours; of two in the same
/// direction the nearer comes first. Cost: one pass over the points.
pub fn neighbours(points: &[ImagePoint], corner: u16) -> Vec<u16, NEIGHBOURS> {
    let mut nearest: Vec<(i64, u16), NEIGHBOURS> = Vec::new();
    let Some(&centre) = points.get(usize::from(corner)) else { return Vec::new() };
    let away = |point: &ImagePoint| {
        let (x, y) = (i64::from(point.x) - i64::from(centre.x), i64::from(point.y) - i64::from(centre.y));
        (x, y)
    };
    for (number, point) in (0_u16..).zip(points) {
        let (x, y) = away(point);
        let distance = x.saturating_mul(x).saturating_add(y.saturating_mul(y));
        if distance == 0 {
            continue;
        }
        if nearest.is_full() {
            if nearest.last().is_none_or(|(farthest, _)| *farthest <= distance) {
                continue;
            }
            nearest.pop();
        }
        let _ = nearest.push((distance, number));
        sift(&mut nearest, |a, b| a.0 > b.0);
    }
    let mut ordered: Vec<u16, NEIGHBOURS> = Vec::new();
    for &(_, number) in &nearest {
        let _ = ordered.push(number);
        sift(&mut ordered, |&a, &b| {
            let place = |number: u16| points.get(usize::from(number)).map_or((0, 0), away);
            clockwise_before(place(b), place(a))
        });
    }
    ordered
}

/// Moves the last entry forward while the one before it should come `after`: one step of an insertion sort.
fn sift<T, const N: usize>(list: &mut Vec<T, N>, after: impl Fn(&T, &T) -> bool) {
    let mut at = list.len();
    while at > 1
        && let Some([before, last]) = list.get_mut(at - 2..at)
        && after(before, last)
    {
        core::mem::swap(before, last);
        at -= 1;
    }
}

/// Whether direction `a` comes strictly before `b`, clockwise from +x; the same direction is not before.
fn clockwise_before(a: (i64, i64), b: (i64, i64)) -> bool {
    let half = |(x, y): (i64, i64)| y < 0 || (y == 0 && x < 0);
    match (half(a), half(b)) {
        (false, true) => true,
        (true, false) => false,
        _ => i128::from(a.0) * i128::from(b.1) > i128::from(a.1) * i128::from(b.0),
    }
}

/// Calls `visit` with every arrangement of every corner, from one starting neighbour.
fn each(points: &[ImagePoint], mut visit: impl FnMut([u16; 5])) {
    for corner in 0..points.len().min(usize::from(u16::MAX)) {
        let around = neighbours(points, corner as u16);
        for choice in 0_u32..1 << around.len() {
            if choice.count_ones() != 4 {
                continue;
            }
            let mut corners = [corner as u16; 5];
            let chosen = around.iter().zip(0..).filter(|(_, bit)| choice & (1 << bit) != 0);
            for (place, (neighbour, _)) in corners.iter_mut().skip(1).zip(chosen) {
                *place = *neighbour;
            }
            visit(corners);
        }
    }
}

fn places(points: &[ImagePoint], corners: [u16; 5]) -> [ImagePoint; 5] {
    corners.map(|corner| points.get(usize::from(corner)).copied().unwrap_or_default())
}

/// The arrangement with its key, unless its first triangles are too thin to say anything.
fn describe(points: &[ImagePoint], corners: [u16; 5], terms: Terms) -> Option<Arrangement> {
    let places @ [centre, a, b, c, d] = places(points, corners);
    let (key, spread, shape) = match terms.invariance {
        Invariance::Affine => {
            // Triangles (a, b, centre) and (b, centre, c): two of those around the corner.
            let quad = Quad::new([a, b, centre, c]);
            let spread = quad.ratio_uncertainty(terms.sigma);
            if !(spread <= MOST_UNCERTAIN) {
                return None;
            }
            let ratio = quad.ratio();
            (log2((ratio.upper as f64 / ratio.lower as f64).abs()), spread, Shape::affine(places))
        }
        Invariance::Perspective => {
            let five = FivePoints::new([centre, a, b, c, d])?;
            let key = five.key() * core::f64::consts::LOG2_E;
            (key, five.key_uncertainty(terms.sigma), Shape::perspective(&five, terms.sigma))
        }
    };
    // The key is in bits, and so is its spread.
    let entry = Arrangement { key: key as f32, spread: (spread * core::f64::consts::LOG2_E) as f32, shape, corners };
    (spread <= MOST_UNCERTAIN).then_some(entry)
}

/// Finds arrangements of the first points that a map could have taken to arrangements of the second.
///
/// `scratch` holds the arrangements of the second points: give it [`scratch_length`]; with less, the last corners have
/// none. Each proposal has five pairs, its corner first. Mirror images are refused.
///
/// Cost: `O(n²)` for the neighbours, then a sort of `60 n` entries and `15 n` lookups.
pub fn propose(
    first: &[ImagePoint],
    second: &[ImagePoint],
    terms: Terms,
    scratch: &mut [Arrangement],
    mut found: impl FnMut(Proposal),
) {
    let mut count = 0;
    each(second, |[centre, a, b, c, d]| {
        for corners in [[centre, a, b, c, d], [centre, b, c, d, a], [centre, c, d, a, b], [centre, d, a, b, c]] {
            if let Some(arrangement) = describe(second, corners, terms)
                && let Some(place) = scratch.get_mut(count)
            {
                *place = arrangement;
                count += 1;
            }
        }
    });
    let entries = scratch.get_mut(..count).unwrap_or_default();
    super::heap_sort::sort_by(entries, |a, b| a.key.total_cmp(&b.key).then_with(|| a.corners.cmp(&b.corners)).is_lt());
    let widest = entries.iter().fold(0.0_f32, |most, entry| if entry.spread > most { entry.spread } else { most });
    each(first, |corners| {
        let Some(entry) = describe(first, corners, terms) else { return };
        let wanted = Wanted::new(entry, places(first, corners), terms);
        let (least, most) = (entry.key - entry.reach(widest), entry.key + entry.reach(widest));
        let from = entries.partition_point(|other| other.key < least);
        let to = entries.partition_point(|other| other.key <= most);
        wanted.sieve.each_passing(
            entries.get(from..to).unwrap_or_default(),
            |other| &other.shape,
            |other| {
                if (other.key - entry.key).abs() <= entry.reach(other.spread)
                    && let Some(surprise) = wanted.compare(places(second, other.corners), terms)
                {
                    let mut pairs = Vec::new();
                    for (&first, &second) in corners.iter().zip(&other.corners) {
                        let _ = pairs.push(Pairing { first, second });
                    }
                    found(Proposal { pairs, surprise, origin: Origin::Arrangement });
                }
            },
        );
    });
}

impl Arrangement {
    /// How far another key may be whose uncertainty is `spread`.
    fn reach(&self, spread: f32) -> f32 {
        GATE_SIGMAS as f32 * crate::math::sqrt(self.spread * self.spread + spread * spread)
    }
}

/// What is compared of an arrangement of the first picture, worked out once.
struct Wanted {
    sieve: Sieve,
    compared: Compared,
}

enum Compared {
    /// The corner with the first three neighbours, and without the first.
    Affine([Expected; 2]),
    Perspective(Option<FivePoints>),
}

impl Wanted {
    fn new(entry: Arrangement, places: [ImagePoint; 5], terms: Terms) -> Self {
        let [centre, a, b, c, d] = places;
        match terms.invariance {
            Invariance::Affine => {
                let expected = [[centre, a, b, c], [centre, b, c, d]];
                let expected = expected.map(|points| Expected::new(&Quad::new(points), terms.sigma));
                let sieve = Sieve::affine(entry.shape, places, &expected);
                Self { sieve, compared: Compared::Affine(expected) }
            }
            Invariance::Perspective => {
                let compared = Compared::Perspective(FivePoints::new(places));
                Self { sieve: Sieve::Perspective(entry.shape), compared }
            }
        }
    }

    /// How surprising it is that five points agree up to a map, in 1/256 bit; `None` if they do not.
    fn compare(&self, images: [ImagePoint; 5], terms: Terms) -> Option<i32> {
        let [centre, a, b, c, d] = images;
        let bits = match &self.compared {
            Compared::Affine([one, two]) => {
                terms.affine_bits(one, [centre, a, b, c])? + terms.affine_bits(two, [centre, b, c, d])?
            }
            Compared::Perspective(five) => terms.perspective_bits(five.as_ref()?, images)?,
        };
        Some((bits * 256.0) as i32)
    }
}
