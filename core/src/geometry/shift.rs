//! Correspondence of hull layers by circular shift (thesis 5.2 to 5.4): as the thesis has it, and with noise and lost
//! vertices taken into account.
//!
//! A layer is a cycle of vertices, clockwise as seen; an affine map that does not mirror keeps the cycle and changes only
//! where it begins. Four vertices in cyclic order are a [`Quad`] with two affine invariants.

use heapless::Vec;

use super::cross_ratio::FivePoints;
use super::proposal::{Invariance, Origin, Pairing, Proposal, Terms};
use super::quad::{AreaRatio, Expected, Quad, Tolerance};
use crate::math::log2;
use crate::point::ImagePoint;

/// A quad whose invariants are less certain than this (standard deviation of the logarithm) says little.
pub const MOST_UNCERTAIN: f64 = 0.35;

/// Which of the vertices `k, k+1, ...` make a quad: four in a row, or five with one left out, so that a vertex that the
/// other view lost does not break it.
const CHOICES: [[usize; 4]; 4] = [[0, 1, 2, 3], [0, 2, 3, 4], [0, 1, 3, 4], [0, 1, 2, 4]];
/// The same for the five vertices that a cross-ratio needs.
const CHOICES_OF_FIVE: [[usize; 5]; 5] =
    [[0, 1, 2, 3, 4], [0, 2, 3, 4, 5], [0, 1, 3, 4, 5], [0, 1, 2, 4, 5], [0, 1, 2, 3, 5]];

/// The best circular shift of two layers by the thesis' rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shift<const POINTS: usize> {
    /// Vertex `k` of the first layer is vertex `k + shift` of the second, modulo its length, up to where a gap is.
    pub shift: u16,
    /// Quads that agree at this shift.
    pub quads: u16,
    /// Vertices of those quads, in the order of the first layer.
    pub pairs: Vec<Pairing, POINTS>,
}

/// The vertices of a layer from `start` on that a choice names, and their places; `None` if the layer has too few.
fn vertices<const COUNT: usize>(
    points: &[ImagePoint],
    layer: &[u16],
    start: usize,
    choice: [usize; COUNT],
) -> Option<([u16; COUNT], [ImagePoint; COUNT])> {
    let mut numbers = [0; COUNT];
    let mut places = [ImagePoint::default(); COUNT];
    for ((number, place), step) in numbers.iter_mut().zip(&mut places).zip(choice) {
        if step >= layer.len() {
            return None;
        }
        let at = start + step;
        *number = *layer.get(if at < layer.len() { at } else { at - layer.len() })?;
        *place = *points.get(usize::from(*number))?;
    }
    Some((numbers, places))
}

/// The thesis' I(k) of four vertices in a row from each start of a layer, the first `POINTS` of them remembered.
struct PlainRatios<'a, const POINTS: usize> {
    points: &'a [ImagePoint],
    layer: &'a [u16],
    known: Vec<AreaRatio, POINTS>,
}

impl<'a, const POINTS: usize> PlainRatios<'a, POINTS> {
    fn new((points, layer): (&'a [ImagePoint], &'a [u16])) -> Self {
        let mut ratios = Self { points, layer, known: Vec::new() };
        for start in 0..layer.len().min(POINTS) {
            let _ = ratios.known.push(ratios.compute(start));
        }
        ratios
    }

    fn at(&self, start: usize) -> AreaRatio {
        self.known.get(start).copied().unwrap_or_else(|| self.compute(start))
    }

    /// Without area, which agrees with nothing, for a vertex that is no point.
    fn compute(&self, start: usize) -> AreaRatio {
        let quad = vertices(self.points, self.layer, start, CHOICES[0]);
        quad.map_or(AreaRatio { upper: 0, lower: 0 }, |(_, places)| Quad::new(places).ratio())
    }
}

/// `at` in a cycle of `length`, for `at < 2 length`.
const fn around(at: usize, length: usize) -> usize {
    if at < length { at } else { at - length }
}

/// The thesis' circular shift (5.3): the vertices that follow one another from a start in each layer such that most of
/// their quads satisfy `|I1(k) - I2(l)| / I1(k) < eps`; of equally good starts those at the lowest
/// numbers.
///
/// A vertex that one layer lacks breaks the quads that hold it and shifts those behind it. So the cycles are cut at the
/// starts, where the gap may be: of six vertices with one occluded the other five are found (Fig 17). `None` if no quad
/// agrees, or a layer has fewer than four vertices. Layers are lists of numbers of points, clockwise. Cost: `O(m n)`
/// comparisons in integers, and as many as the shorter layer has vertices for each that agrees.
pub fn plain_shift<const POINTS: usize>(
    first: (&[ImagePoint], &[u16]),
    second: (&[ImagePoint], &[u16]),
    eps: Tolerance,
) -> Option<Shift<POINTS>> {
    let (length, modulus) = (first.1.len(), second.1.len());
    let shorter = length.min(modulus);
    if shorter < 4 {
        return None;
    }
    let (one, two) = (PlainRatios::<POINTS>::new(first), PlainRatios::<POINTS>::new(second));
    let agrees = |k: usize, l: usize| one.at(around(k, length)).agrees(two.at(around(l, modulus)), eps);
    let numbers = |(k, l): (usize, usize)| (first.1.get(k), second.1.get(l));
    let (mut best, mut quads) = ((0, 0), 0);
    for k in 0..length {
        for l in (0..modulus).filter(|&l| agrees(k, l)) {
            let found = 1 + (1..shorter).filter(|step| agrees(k + step, l + step)).count();
            // By numbers, not by places in the lists: where a list begins must not matter.
            if found > quads || found == quads && numbers((k, l)) < numbers(best) {
                (best, quads) = ((k, l), found);
            }
        }
    }
    if quads == 0 {
        return None;
    }
    let mut pairs: Vec<Pairing, POINTS> = Vec::new();
    for step in (0..shorter).filter(|step| agrees(best.0 + step, best.1 + step)) {
        for vertex in step..step + 4 {
            let partners = (first.1.get((best.0 + vertex) % length), second.1.get((best.1 + vertex) % modulus));
            if let (Some(&first), Some(&second)) = partners
                && pairs.iter().all(|pair| pair.first != first && pair.second != second)
            {
                // A layer of more than POINTS vertices keeps the first ones.
                let _ = pairs.push(Pairing { first, second });
            }
        }
    }
    let shift = (best.1 + modulus - best.0 % modulus) % modulus;
    Some(Shift { shift: shift as u16, quads: quads as u16, pairs })
}

/// Four or five vertices of a layer with their invariants.
#[derive(Debug, Clone, Copy, Default)]
pub struct LayerQuad {
    /// The fifth is unused where four are enough.
    vertices: [u16; 5],
    /// Logarithms of the invariants, in bits: `I` and `J` of four, `C1` of five.
    invariants: [f32; 2],
    /// Three standard deviations of the first.
    spread: f32,
    start: u16,
}

/// Quads that a layer of this many vertices has, at most.
pub const fn quads_of(vertices: usize) -> usize {
    vertices * CHOICES_OF_FIVE.len()
}

/// A layer: its points, the numbers of its vertices (clockwise), and its own number.
pub type NumberedLayer<'a> = (&'a [ImagePoint], &'a [u16], u8);

/// Describes a layer: its quads go to the front of `quads`, the last are left out where there is no room. Returns how many
/// there are. Layers described once are compared by [`propose_described`].
pub fn describe((points, layer, _): NumberedLayer<'_>, terms: Terms, quads: &mut [LayerQuad]) -> usize {
    let spread = |uncertainty: f64| {
        (uncertainty <= MOST_UNCERTAIN).then_some((3.0 * core::f64::consts::LOG2_E * uncertainty) as f32)
    };
    let mut count = 0;
    let mut enter = |quad: LayerQuad| {
        if let Some(place) = quads.get_mut(count) {
            *place = quad;
            count += 1;
        }
    };
    for start in 0..layer.len() {
        if terms.invariance == Invariance::Perspective {
            for choice in CHOICES_OF_FIVE {
                let Some((vertices, places)) = vertices(points, layer, start, choice) else { continue };
                if let Some(five) = FivePoints::new(places)
                    && let Some(spread) = spread(five.key_uncertainty(terms.sigma))
                {
                    let key = (five.key() * core::f64::consts::LOG2_E) as f32;
                    enter(LayerQuad { vertices, invariants: [key, 0.0], spread, start: start as u16 });
                }
            }
            continue;
        }
        for choice in CHOICES {
            let Some(([a, b, c, d], places)) = vertices(points, layer, start, choice) else { continue };
            let quad = Quad::new(places);
            if let Some(spread) = spread(quad.ratio_uncertainty(terms.sigma)) {
                let log = |ratio: AreaRatio| log2((ratio.upper as f64 / ratio.lower as f64).abs()) as f32;
                let invariants = [log(quad.ratio()), log(quad.second_ratio())];
                enter(LayerQuad { vertices: [a, b, c, d, d], invariants, spread, start: start as u16 });
            }
        }
    }
    count
}

/// Finds quads of two layers that a map could have taken to one another: four vertices by affine invariants, or five by
/// cross-ratios.
///
/// `scratch` takes the quads of both layers ([`quads_of`] all their vertices; with less, the last of the second are left
/// out). Quads may leave out one vertex on either side, so one lost and one extra vertex within five are bridged; what lies
/// beyond is found by the map. Mirror images are refused.
///
/// Cost: `16 m n` (perspective: 25) comparisons of two numbers, a few multiplications for each that is near.
pub fn propose(
    first: NumberedLayer<'_>,
    second: NumberedLayer<'_>,
    terms: Terms,
    scratch: &mut [LayerQuad],
    found: impl FnMut(Proposal),
) {
    let count = describe(first, terms, scratch);
    let (one, rest) = scratch.split_at_mut_checked(count).unwrap_or_default();
    let count = describe(second, terms, rest);
    propose_described((first, one), (second, rest.get(..count).unwrap_or_default()), terms, found);
}

/// [`propose`] for layers with the quads by which [`describe`] describes them.
pub fn propose_described(
    (first, first_quads): (NumberedLayer<'_>, &[LayerQuad]),
    (second, second_quads): (NumberedLayer<'_>, &[LayerQuad]),
    terms: Terms,
    mut found: impl FnMut(Proposal),
) {
    let modulus = second.1.len().max(1);
    let place = |points: &[ImagePoint], number: u16| points.get(usize::from(number)).copied().unwrap_or_default();
    for one in first_quads {
        let mut wanted = None;
        for two in second_quads {
            let reach = one.spread + two.spread;
            let near = ((one.invariants[0] - two.invariants[0]).abs() <= reach)
                & ((one.invariants[1] - two.invariants[1]).abs() <= 2.0 * reach);
            if !near {
                continue;
            }
            let wanted =
                wanted.get_or_insert_with(|| Wanted::new(one.vertices.map(|number| place(first.0, number)), terms));
            let images = two.vertices.map(|number| place(second.0, number));
            let Some((surprise, count)) = wanted.compare(images, terms) else { continue };
            let mut pairs = Vec::new();
            for (&first, &second) in one.vertices.iter().zip(&two.vertices).take(count) {
                let _ = pairs.push(Pairing { first, second });
            }
            let shift = (usize::from(two.start) + modulus - usize::from(one.start) % modulus) % modulus;
            let origin = Origin::Layers { first: first.2, second: second.2, shift: shift as u16 };
            found(Proposal { pairs, surprise, origin });
        }
    }
}

/// What is compared of a quad of the first layer, worked out once.
enum Wanted {
    Affine(Expected),
    Perspective(Option<FivePoints>),
}

impl Wanted {
    fn new(places: [ImagePoint; 5], terms: Terms) -> Self {
        let [a, b, c, d, _] = places;
        match terms.invariance {
            Invariance::Affine => Self::Affine(Expected::new(&Quad::new([a, b, c, d]), terms.sigma)),
            Invariance::Perspective => Self::Perspective(FivePoints::new(places)),
        }
    }

    /// The surprise in 1/256 bit, and how many vertices were compared; `None` if they do not agree.
    fn compare(&self, images: [ImagePoint; 5], terms: Terms) -> Option<(i32, usize)> {
        let [a, b, c, d, _] = images;
        let (bits, count) = match self {
            Self::Affine(expected) => (terms.affine_bits(expected, [a, b, c, d])?, 4),
            Self::Perspective(five) => (terms.perspective_bits(five.as_ref()?, images)?, 5),
        };
        Some(((bits * 256.0) as i32, count))
    }
}
