//! From a rough hypothesis to a map: four guided rounds of matching and fitting, affine first, then a homography.

use heapless::Vec;

use crate::candidate::{CandidateView, GAIN_UNIT, gain};
use crate::extract::Features;
use crate::hypothesis::Hypothesis;
use crate::kernel::{Kernels, NUMBER_BITS, NUMBER_LIMIT, SLACK, SLACK_PER_PIXEL, Search, search_key};
use crate::pyramid::{LEVELS, scale};
use crate::query::QueryIndex;
use crate::shortlist::Shortlist;
use crate::transform::{Homography, Normalization, Shape, WeightedPair, fit_affine, fit_homography};

/// Search radius of each round, in pixels.
const RADII: [f32; 4] = [24.0, 58.0 / 3.0, 44.0 / 3.0, 10.0];
/// The first round that fits a homography.
const HOMOGRAPHY_FROM: usize = 2;
/// Pairs that a homography needs: it has eight unknowns, a pair has two equations, and half of them are a check.
const HOMOGRAPHY_PAIRS: usize = 8;
/// Pairs that any map needs.
const LEAST_PAIRS: usize = 3;
/// Ridge on the linear part of the first fit and of those of the rounds, in px².
const RIDGE: [f32; 2] = [4_000.0, 1_200.0];
/// Ridge on the two perspective terms, in normalized coordinates.
const PERSPECTIVE_RIDGE: f64 = 0.02;
/// A pair's scale may differ from the map's by this factor (e^0.55) either way.
pub(crate) const SCALE_TOLERANCE: f32 = 1.733_253;

/// A frame's features and where they lie, with the distances from one stored view's corners.
#[derive(Debug, Clone, Copy)]
pub struct Pairing<'a, const QUERY: usize> {
    /// The stored view's corners.
    pub stored: Features<'a>,
    /// The frame's corners.
    pub query: Features<'a>,
    /// The frame's corners by place.
    pub index: &'a QueryIndex<QUERY>,
    /// A row of distances to all query corners for each stored corner.
    pub distances: &'a [u8],
}

impl<'a, const QUERY: usize> Pairing<'a, QUERY> {
    /// The distances from one stored corner.
    #[inline]
    pub fn row(&self, stored: usize) -> &'a [u8] {
        let n = self.query.len();
        self.distances.get(stored * n..(stored + 1) * n).unwrap_or(&[])
    }
}

/// Which query levels fit a stored level under a map of this scale: bit `q` of entry `s`.
pub(crate) fn fitting_levels(map_scale: f32) -> [u8; LEVELS] {
    let mut fitting = [0; LEVELS];
    for (stored, fitting) in (0_u8..).zip(&mut fitting) {
        let expected = scale(stored) * map_scale;
        for query in 0..LEVELS as u8 {
            let found = scale(query);
            if found <= expected * SCALE_TOLERANCE && expected <= found * SCALE_TOLERANCE {
                *fitting |= 1 << query;
            }
        }
    }
    fitting
}

/// A refined map and where it is known best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    /// The map.
    pub frame_from_view: Homography,
    /// The mean of the stored corners that it was fitted to, in pixels of the view.
    pub centre: [f32; 2],
    /// Its shape there.
    pub shape: Shape,
}

/// Refines a hypothesis; `None` if it loses its pairs or becomes a map that no camera sees.
///
/// `pairs` is working memory. Cost: four rounds of one lookup for each stored corner.
pub fn refine<K: Kernels + ?Sized, const QUERY: usize, const STORED: usize, const BLOCKS: usize, const PAIRS: usize>(
    kernels: &K,
    pairing: &Pairing<'_, QUERY>,
    shortlist: &Shortlist<STORED, BLOCKS>,
    candidates: CandidateView<'_>,
    hypothesis: &Hypothesis,
    pairs: &mut Vec<WeightedPair, PAIRS>,
) -> Option<Refined> {
    supporters(candidates, hypothesis, pairs);
    let mut map = Homography::from(fit_affine(pairs, hypothesis.scale, RIDGE[0])?);
    let mut map_scale = hypothesis.scale;
    let mut refined = None;
    for (round, radius) in RADII.into_iter().enumerate() {
        guided_pairs(kernels, pairing, shortlist, &map, map_scale, radius, pairs);
        if pairs.len() < LEAST_PAIRS {
            return None;
        }
        let sum = pairs.iter().fold([0.0; 2], |[x, y], pair| [x + pair.from[0], y + pair.from[1]]);
        let centre = sum.map(|sum| sum / pairs.len() as f32);
        map = Homography::from(fit_affine(pairs, map_scale, RIDGE[1])?);
        if round >= HOMOGRAPHY_FROM && pairs.len() >= HOMOGRAPHY_PAIRS {
            let source = Normalization::of_frame(pairing.stored.width, pairing.stored.height);
            let target = Normalization::of_frame(pairing.query.width, pairing.query.height);
            let projective = fit_homography(pairs, source, target, PERSPECTIVE_RIDGE);
            map = projective.filter(|map| map.shape(centre).is_some()).unwrap_or(map);
        }
        let shape = map.shape(centre)?;
        map_scale = shape.scale;
        refined = Some(Refined { frame_from_view: map, centre, shape });
    }
    refined
}

/// The candidates that agree with a hypothesis, weighted by gain and closeness.
fn supporters<const PAIRS: usize>(
    candidates: CandidateView<'_>,
    hypothesis: &Hypothesis,
    pairs: &mut Vec<WeightedPair, PAIRS>,
) {
    pairs.clear();
    let votes = candidates.votes;
    let from = votes.from_x.iter().zip(votes.from_y).map(|(&x, &y)| [x, y]);
    let to = votes.to_x.iter().zip(votes.to_y).map(|(&x, &y)| [x, y]);
    let anchor = hypothesis.frame_from_view.apply(hypothesis.anchor);
    for (((from, to), &step), &gain) in from.zip(to).zip(votes.step).zip(votes.gain) {
        let turn = step - hypothesis.step;
        if !(-1.0..=1.0).contains(&turn) {
            continue;
        }
        let predicted = hypothesis.frame_from_view.apply(from);
        let (distance, error) = (squared_distance(predicted, anchor), squared_distance(predicted, to));
        // Most end here, without the root: (a + b)² <= 2 (a² + b²), and a thousandth more than covers what is rounded.
        if error > 2.002 * (SLACK * SLACK + SLACK_PER_PIXEL * SLACK_PER_PIXEL * distance) {
            continue;
        }
        let tolerance = SLACK + SLACK_PER_PIXEL * crate::math::sqrt(distance);
        let closeness = 1.0 - error / (tolerance * tolerance);
        if closeness > 0.0 {
            // Working memory is as large as the list of candidates.
            let _ = pairs.push(WeightedPair { from, to, weight: gain as f32 / GAIN_UNIT as f32 * closeness });
        }
    }
}

fn squared_distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    x * x + y * y
}

/// For every stored corner the query corner within the radius that gains most for its closeness.
fn guided_pairs<
    K: Kernels + ?Sized,
    const QUERY: usize,
    const STORED: usize,
    const BLOCKS: usize,
    const PAIRS: usize,
>(
    kernels: &K,
    pairing: &Pairing<'_, QUERY>,
    shortlist: &Shortlist<STORED, BLOCKS>,
    map: &Homography,
    map_scale: f32,
    radius: f32,
    pairs: &mut Vec<WeightedPair, PAIRS>,
) {
    pairs.clear();
    let fitting = fitting_levels(map_scale);
    let corners = pairing.stored.positions.iter().zip(pairing.stored.levels).zip(pairing.stored.commonness);
    for (number, ((position, &level), &commonness)) in corners.enumerate() {
        let from = position.to_pixels();
        let levels = i32::from(fitting.get(usize::from(level)).copied().unwrap_or(0));
        let search = Search { at: map.apply(from), radius_squared: radius * radius, levels };
        let best = match shortlist.of(number) {
            Some(blocks) => kernels.closest(blocks, search),
            None => closest_in_grid(pairing, number, commonness, search, radius),
        };
        let query = NUMBER_LIMIT - (best & NUMBER_LIMIT);
        if let (true, Some(to)) = (best > 0, pairing.query.positions.get(query as usize)) {
            let weight = (best >> NUMBER_BITS) as f32 / (1_024 * GAIN_UNIT) as f32;
            // Working memory holds at least as many pairs as a view has corners.
            let _ = pairs.push(WeightedPair { from, to: to.to_pixels(), weight });
        }
    }
}

/// What [`Kernels::closest`] finds in a shortlist, from the grid.
fn closest_in_grid<const QUERY: usize>(
    pairing: &Pairing<'_, QUERY>,
    stored: usize,
    commonness: i8,
    search: Search,
    radius: f32,
) -> i32 {
    let row = pairing.row(stored);
    let mut best = 0;
    pairing.index.within(search.at, radius, |query, level, squared| {
        let gain = row.get(usize::from(query)).map_or(0, |&distance| gain(distance, commonness));
        let key = search_key(search, squared, gain, 1 << level, i32::from(query));
        best = best.max(key);
    });
    best
}
