//! Correspondence of hull layers by circular shift (thesis 5.2 to 5.4): as the thesis has it, and with noise and lost
//! vertices taken into account.
//!
//! A layer is a cycle of vertices, clockwise as seen; an affine map that does not mirror keeps the cycle and changes only
//! where it begins. Four vertices in cyclic order are a [`Quad`] with two affine invariants.

use heapless::Vec;

use super::proposal::{Origin, Pairing, Proposal};
use super::quad::{AreaRatio, Quad, Tolerance};
use crate::math::log2;
use crate::point::ImagePoint;

/// Squared Mahalanobis distance of two degrees of freedom that 99 % of the true quads keep.
const GATE: f64 = 9.21;
/// A quad whose invariants are less certain than this (standard deviation of the logarithm) says little.
pub const MOST_UNCERTAIN: f64 = 0.35;

/// Which of the vertices `k, k+1, ...` make a quad: four in a row, or five with one left out, so that a vertex that the
/// other view lost does not break it.
const CHOICES: [[usize; 4]; 4] = [[0, 1, 2, 3], [0, 2, 3, 4], [0, 1, 3, 4], [0, 1, 2, 4]];

/// The best circular shift of two layers by the thesis' rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shift<const POINTS: usize> {
    /// Vertex `k` of the first layer is vertex `k + shift` of the second, modulo its length.
    pub shift: u16,
    /// Quads that agree at this shift.
    pub quads: u16,
    /// Vertices of those quads, in the order of the first layer.
    pub pairs: Vec<Pairing, POINTS>,
}

/// The four vertices of a layer from `start` on that a choice names; `None` if the layer has too few.
fn quad(points: &[ImagePoint], layer: &[u16], start: usize, choice: [usize; 4]) -> Option<([u16; 4], Quad)> {
    if layer.len() <= choice[3] {
        return None;
    }
    let vertex = |step: usize| {
        let at = start + step;
        layer.get(if at < layer.len() { at } else { at - layer.len() }).copied()
    };
    let [a, b, c, d] = choice.map(vertex);
    let numbers = [a?, b?, c?, d?];
    let place = |number: u16| points.get(usize::from(number)).copied();
    let [a, b, c, d] = numbers.map(place);
    Some((numbers, Quad::new([a?, b?, c?, d?])))
}

/// The thesis' I(k) of four vertices in a row.
fn plain_ratio(points: &[ImagePoint], layer: &[u16], start: usize) -> Option<AreaRatio> {
    quad(points, layer, start, CHOICES[0]).map(|(_, quad)| quad.ratio())
}

/// The thesis' circular shift (5.3): the shift at which most quads of consecutive vertices satisfy
/// `|I1(k) - I2(k + shift)| / I1(k) < eps`, and the vertices of those quads; of equally good shifts the smallest.
///
/// A vertex that one layer lacks breaks the quads that hold it and shifts those behind it: the longer side of the gap
/// decides (Fig 17). `None` if no quad agrees, or a layer has fewer than four vertices. Layers are lists of numbers of
/// points, clockwise. Cost: `O(m n)` comparisons in integers.
pub fn plain_shift<const POINTS: usize>(
    first: (&[ImagePoint], &[u16]),
    second: (&[ImagePoint], &[u16]),
    eps: Tolerance,
) -> Option<Shift<POINTS>> {
    let modulus = second.1.len();
    if modulus < 4 {
        return None;
    }
    let agrees = |k: usize, shift: usize| {
        let (Some(one), Some(two)) =
            (plain_ratio(first.0, first.1, k), plain_ratio(second.0, second.1, (k + shift) % modulus))
        else {
            return false;
        };
        one.agrees(two, eps)
    };
    let count = |shift: usize| (0..first.1.len()).filter(|&k| agrees(k, shift)).count();
    let (mut best, mut quads) = (0, 0);
    for shift in 0..modulus {
        let found = count(shift);
        if found > quads {
            (best, quads) = (shift, found);
        }
    }
    if quads == 0 {
        return None;
    }
    let mut pairs: Vec<Pairing, POINTS> = Vec::new();
    let length = first.1.len();
    for k in (0..length).filter(|&k| agrees(k, best)) {
        for step in 0..4 {
            let partners = (first.1.get((k + step) % length), second.1.get((k + best + step) % modulus));
            if let (Some(&first), Some(&second)) = partners
                && pairs.iter().all(|pair| pair.first != first && pair.second != second)
            {
                // A layer of more than POINTS vertices keeps the first ones.
                let _ = pairs.push(Pairing { first, second });
            }
        }
    }
    Some(Shift { shift: best as u16, quads: quads as u16, pairs })
}

/// A quad of a layer with the ranges of its invariants.
#[derive(Debug, Clone, Copy, Default)]
pub struct LayerQuad {
    vertices: [u16; 4],
    /// Logarithms of `I` and `J`, and their spread (three standard deviations), in bits.
    invariants: [f32; 2],
    spread: f32,
    start: u16,
}

/// Quads that a layer of this many vertices has, at most.
pub const fn quads_of(vertices: usize) -> usize {
    vertices * CHOICES.len()
}

fn describe(points: &[ImagePoint], layer: &[u16], sigma: f32, mut entry: impl FnMut(LayerQuad)) {
    for start in 0..layer.len() {
        for choice in CHOICES {
            let Some((vertices, quad)) = quad(points, layer, start, choice) else { continue };
            let spread = quad.ratio_uncertainty(sigma);
            if !(spread <= MOST_UNCERTAIN) {
                continue;
            }
            let log = |ratio: AreaRatio| log2((ratio.upper as f64 / ratio.lower as f64).abs()) as f32;
            let invariants = [log(quad.ratio()), log(quad.second_ratio())];
            let spread = (3.0 * core::f64::consts::LOG2_E * spread) as f32;
            entry(LayerQuad { vertices, invariants, spread, start: start as u16 });
        }
    }
}

/// Finds quads of two layers that an affine map could have taken to one another.
///
/// A layer is its points, the numbers of its vertices (clockwise), and its own number. `sigma` is the noise of each
/// coordinate, px; `area` the area in px² of the second picture in which corners may lie; `scratch` takes the quads of the
/// second layer ([`quads_of`]; with less, the last are left out). Quads may leave out one vertex on either side, so one
/// lost and one extra vertex within five are bridged; what lies beyond is found by the map. Mirror images are refused.
///
/// Cost: `16 m n` comparisons of two numbers, a few multiplications for each that is near.
pub fn propose(
    first: (&[ImagePoint], &[u16], u8),
    second: (&[ImagePoint], &[u16], u8),
    sigma: f32,
    area: f64,
    scratch: &mut [LayerQuad],
    mut found: impl FnMut(Proposal),
) {
    let mut count = 0;
    describe(second.0, second.1, sigma, |quad| {
        if let Some(place) = scratch.get_mut(count) {
            *place = quad;
            count += 1;
        }
    });
    let quads = scratch.get(..count).unwrap_or_default();
    let modulus = second.1.len().max(1);
    describe(first.0, first.1, sigma, |one| {
        for two in quads {
            let reach = one.spread + two.spread;
            let near = (one.invariants[0] - two.invariants[0]).abs() <= reach
                && (one.invariants[1] - two.invariants[1]).abs() <= 2.0 * reach;
            if !near {
                continue;
            }
            let place =
                |points: &[ImagePoint], number: u16| points.get(usize::from(number)).copied().unwrap_or_default();
            let a = Quad::new(one.vertices.map(|number| place(first.0, number)));
            let b = Quad::new(two.vertices.map(|number| place(second.0, number)));
            let Some(deviation) = a.deviation(&b, sigma) else { continue };
            if deviation.squared > GATE {
                continue;
            }
            let mut pairs = Vec::new();
            for (&first, &second) in one.vertices.iter().zip(&two.vertices) {
                let _ = pairs.push(Pairing { first, second });
            }
            let shift = (usize::from(two.start) + modulus - usize::from(one.start) % modulus) % modulus;
            let origin = Origin::Layers { first: first.2, second: second.2, shift: shift as u16 };
            let surprise = (log2(area / (GATE * deviation.ellipse)) * 256.0) as i32;
            found(Proposal { pairs, surprise, origin });
        }
    });
}
