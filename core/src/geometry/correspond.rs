//! Which corner is which: proposals of nested hulls and local arrangements, verified by one map or, where relief forbids
//! one map, by their neighbours and the epipolar constraint.

use heapless::Vec;

use super::agreement::{Agreement, BestMap, NoAgreement};
use super::arrangement::{self, Arrangement};
use super::consensus::{Consensus, Supported};
use super::epipolar::{AffineEpipolar, JointPoint};
use super::error::GeometryError;
use super::heap_sort::sort_by;
use super::layers::HullLayers;
use super::proposal::{Invariance, Pairing, Proposal, Proposals, Terms};
use super::shift::{self, LayerQuad};
use crate::point::ImagePoint;

/// Bits that a pair needs from its neighbours.
const LEAST_SUPPORT: f32 = 12.0;
/// Correspondences of a scene with relief, at least: the epipolar constraint has four unknowns.
const LEAST_RELIEF: usize = 12;
/// Share of the smaller picture's corners that an answer about relief must explain.
const LEAST_SHARE: f64 = 0.4;
/// Share of the chosen pairs that must satisfy the epipolar constraint.
const LEAST_CONSISTENT: f64 = 0.8;
/// A pair is off if its distance from the constraint exceeds so many medians.
const MOST_MEDIANS: f64 = 4.0;
/// Medians below this, px, are noise of the corners.
const LEAST_MEDIAN: f64 = 0.7;
/// A median beyond this, px, is no weak perspective of one rigid scene.
const MOST_MEDIAN: f64 = 4.0;
/// One map that explains this share of the smaller picture's corners is the answer.
const WHOLE: f64 = 0.7;
/// Otherwise relief is, if it explains at least this much of what the map does: a map of a part errs at its edges.
const LEAST_RELIEF_GAIN: f64 = 0.8;

/// Proposals that must hold a pair of a scene with relief, all of whose other pairs stand as well.
const WITNESSES: f64 = 2.0;
/// The same for an answer that explains [`WHOLE`] of the corners.
const FEW_WITNESSES: f64 = 1.0;
/// Corners closer than this to an unmatched one, in 1/16 px, are not matched across relief, which may move them as far.
const CROWDED: i64 = 5 * 16;
/// Fits of the epipolar constraint, each without what the one before found off.
const ROUNDS: usize = 4;

/// Where proposals come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sources {
    /// Nested hulls alone.
    Layers,
    /// Local arrangements alone.
    Arrangements,
    /// Both.
    #[default]
    Both,
}

/// What is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Noise of the corners, the second picture's area, and what two views keep.
    pub terms: Terms,
    /// Where proposals come from.
    pub sources: Sources,
}

impl Settings {
    /// Corners of half a pixel of noise in a picture of this size, affine invariants from both sources.
    pub fn of_picture(width: u32, height: u32) -> Self {
        let area = f64::from(width) * f64::from(height);
        Self { terms: Terms { sigma: 0.5, area, invariance: Invariance::Affine }, sources: Sources::Both }
    }
}

/// A correspondence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Which corners.
    pub pair: Pairing,
    /// px: the distance from where the map expects the corner, or from the epipolar constraint.
    pub residual: f32,
}

/// What explains the correspondences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Explanation {
    /// One affine map explains them.
    Map(BestMap),
    /// No single map does; neighbours agree with one another, and all with the epipolar constraint.
    Relief {
        /// The constraint.
        epipolar: AffineEpipolar,
        /// Median distance from it, px.
        median: f64,
    },
}

/// Why there are no correspondences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoCorrespondence {
    /// What one map failed at; relief failed, too.
    Map(NoAgreement),
}

/// The workspace: at most `POINTS` corners a picture in `LAYERS` hulls, the strongest `PROPOSALS` of each source with
/// `CANDIDATES` different pairs.
#[derive(Debug, Clone)]
pub struct Correspond<const POINTS: usize, const LAYERS: usize, const PROPOSALS: usize, const CANDIDATES: usize> {
    layers: [HullLayers<POINTS, LAYERS>; 2],
    from_layers: Proposals<PROPOSALS>,
    from_arrangements: Proposals<PROPOSALS>,
    agreement: Agreement<POINTS>,
    consensus: Consensus<POINTS, PROPOSALS, CANDIDATES>,
    supported: Vec<Supported, POINTS>,
    joint: Vec<JointPoint, POINTS>,
    distances: Vec<f64, POINTS>,
    found: Vec<Correspondence, POINTS>,
}

impl<const POINTS: usize, const LAYERS: usize, const PROPOSALS: usize, const CANDIDATES: usize>
    Correspond<POINTS, LAYERS, PROPOSALS, CANDIDATES>
{
    /// An empty workspace.
    pub const fn new() -> Self {
        Self {
            layers: [const { HullLayers::new() }; 2],
            from_layers: Proposals::new(),
            from_arrangements: Proposals::new(),
            agreement: Agreement::new(),
            consensus: Consensus::new(),
            supported: Vec::new(),
            joint: Vec::new(),
            distances: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Finds the correspondences of two sets of corners; [`Self::found`] lists them.
    ///
    /// `scratch` takes the arrangements of the second set ([`arrangement::scratch_length`]), `quads` the quads of its
    /// layers and of the first set's largest ([`shift::quads_of`] the points of both sets is always enough).
    ///
    /// # Errors
    /// Too many points or layers for this workspace, or coordinates out of range. That there is no answer is not an
    /// error but the inner value.
    pub fn correspond(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        settings: Settings,
        scratch: &mut [Arrangement],
        quads: &mut [LayerQuad],
    ) -> Result<Result<Explanation, NoCorrespondence>, GeometryError> {
        self.found.clear();
        self.propose(first, second, settings, scratch, quads)?;
        let map = self.one_map(first, second, settings);
        let explained = self.found.len();
        // What one map explains is kept while relief is tried.
        let one_map = self.found.clone();
        let smaller = first.len().min(second.len());
        if (explained as f64) < WHOLE * smaller as f64
            && let Some(relief) = self.relief(first, second)
            && self.found.len() as f64 > LEAST_RELIEF_GAIN * explained as f64
        {
            return Ok(Ok(relief));
        }
        self.found = one_map;
        Ok(map.map(Explanation::Map).map_err(NoCorrespondence::Map))
    }

    /// The pairs that proposals of the chosen sources support, one to one, before any verification; most supported first.
    ///
    /// # Errors
    /// As [`Self::correspond`].
    pub fn vote(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        settings: Settings,
        scratch: &mut [Arrangement],
        quads: &mut [LayerQuad],
    ) -> Result<&[Supported], GeometryError> {
        self.propose(first, second, settings, scratch, quads)?;
        self.support();
        Ok(&self.supported)
    }

    fn support(&mut self) {
        let proposals = self.from_arrangements.iter().chain(self.from_layers.iter());
        self.supported.clear();
        let supported = &mut self.supported;
        self.consensus.choose(proposals, LEAST_SUPPORT, |pair| {
            // One to one: never more than POINTS.
            let _ = supported.push(pair);
        });
    }

    /// Enters the proposals of the chosen sources.
    fn propose(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        settings: Settings,
        scratch: &mut [Arrangement],
        quads: &mut [LayerQuad],
    ) -> Result<(), GeometryError> {
        let Self { layers: [first_layers, second_layers], from_layers, from_arrangements, .. } = self;
        from_layers.clear();
        from_arrangements.clear();
        first_layers.peel(first)?;
        second_layers.peel(second)?;
        let Settings { terms, sources } = settings;
        if sources != Sources::Arrangements {
            propose_layers((first, first_layers), (second, second_layers), terms, quads, |p| from_layers.add(p));
        }
        if sources != Sources::Layers {
            arrangement::propose(first, second, terms, scratch, |p| from_arrangements.add(p));
        }
        Ok(())
    }

    fn one_map(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        settings: Settings,
    ) -> Result<BestMap, NoAgreement> {
        let proposals = self.from_arrangements.iter().chain(self.from_layers.iter());
        let map = self.agreement.find(first, second, proposals, settings.terms)?;
        for explained in self.agreement.explained() {
            let _ = self.found.push(Correspondence { pair: explained.pair, residual: explained.residual });
        }
        Ok(map)
    }

    /// The pairs that neighbours support and the epipolar constraint allows; `None` if they are too few or contradict.
    fn relief(&mut self, first: &[ImagePoint], second: &[ImagePoint]) -> Option<Explanation> {
        self.support();
        self.drop_crowded(first, second);
        let chosen = self.supported.len();
        let place = |points: &[ImagePoint], number: u16| {
            points.get(usize::from(number)).copied().unwrap_or_default().to_pixels().map(f64::from)
        };
        let joint = |pair: Pairing| {
            let ([a, b], [c, d]) = (place(first, pair.first), place(second, pair.second));
            [a, b, c, d]
        };
        let mut fitted = None;
        for _ in 0..ROUNDS {
            self.joint.clear();
            self.distances.clear();
            for supported in &self.supported {
                let _ = self.joint.push(joint(supported.pair));
            }
            let epipolar = AffineEpipolar::fit(&self.joint)?;
            for pair in &self.joint {
                let _ = self.distances.push(epipolar.distance(pair));
            }
            sort_by(&mut self.distances, |a, b| a.total_cmp(b).is_lt());
            let median = self.distances.get(self.distances.len() / 2).copied()?;
            let gate = MOST_MEDIANS * if median > LEAST_MEDIAN { median } else { LEAST_MEDIAN };
            self.supported.retain(|supported| epipolar.distance(&joint(supported.pair)) <= gate);
            fitted = Some((epipolar, median));
        }
        let (epipolar, median) = fitted?;
        // What explains nearly all needs less to be believed.
        let most = first.len().min(second.len()) as f64 * WHOLE;
        self.keep_witnessed(if self.supported.len() as f64 >= most { FEW_WITNESSES } else { WITNESSES });
        let (kept, smaller) = (self.supported.len(), first.len().min(second.len()));
        let enough = kept >= LEAST_RELIEF && kept as f64 >= LEAST_SHARE * smaller as f64;
        if !(enough && kept as f64 >= LEAST_CONSISTENT * chosen as f64 && median <= MOST_MEDIAN) {
            return None;
        }
        self.found.clear();
        for supported in &self.supported {
            let residual = epipolar.distance(&joint(supported.pair)) as f32;
            let _ = self.found.push(Correspondence { pair: supported.pair, residual });
        }
        Some(Explanation::Relief { epipolar, median })
    }

    /// Drops pairs with a corner that has another one nearby which is not matched: it may be the other's partner.
    fn drop_crowded(&mut self, first: &[ImagePoint], second: &[ImagePoint]) {
        let near = |points: &[ImagePoint], number: u16, matched: &dyn Fn(u16) -> bool| {
            let here = points.get(usize::from(number)).copied().unwrap_or_default();
            (0_u16..).zip(points).any(|(other, point)| {
                let (x, y) = (i64::from(point.x) - i64::from(here.x), i64::from(point.y) - i64::from(here.y));
                other != number && x * x + y * y < CROWDED * CROWDED && !matched(other)
            })
        };
        self.distances.clear();
        for Supported { pair, .. } in &self.supported {
            let of_first = |other: u16| self.supported.iter().any(|supported| supported.pair.first == other);
            let of_second = |other: u16| self.supported.iter().any(|supported| supported.pair.second == other);
            let crowded = near(first, pair.first, &of_first) || near(second, pair.second, &of_second);
            let _ = self.distances.push(f64::from(u8::from(crowded)));
        }
        let mut crowded = self.distances.iter();
        self.supported.retain(|_| crowded.next().is_some_and(|crowded| *crowded == 0.0));
    }

    /// Drops pairs with fewer than `least` proposals all of whose pairs still stand.
    fn keep_witnessed(&mut self, least: f64) {
        // In the order of the joint points: how many witnesses each pair has.
        self.distances.clear();
        for _ in &self.supported {
            let _ = self.distances.push(0.0);
        }
        for proposal in self.from_arrangements.iter().chain(self.from_layers.iter()) {
            let stands = |pair: &Pairing| self.supported.iter().any(|supported| supported.pair == *pair);
            if proposal.pairs.iter().all(stands) {
                for (count, supported) in self.distances.iter_mut().zip(&self.supported) {
                    *count += f64::from(u8::from(proposal.pairs.contains(&supported.pair)));
                }
            }
        }
        let mut counts = self.distances.iter();
        self.supported.retain(|_| counts.next().is_some_and(|count| *count >= least));
    }

    /// The correspondences found last.
    pub fn found(&self) -> &[Correspondence] {
        &self.found
    }

    /// The layers of the first and the second set.
    pub const fn layers(&self) -> &[HullLayers<POINTS, LAYERS>; 2] {
        &self.layers
    }

    /// The proposals of nested hulls, most surprising first.
    pub const fn from_layers(&self) -> &Proposals<PROPOSALS> {
        &self.from_layers
    }

    /// The proposals of local arrangements, most surprising first.
    pub const fn from_arrangements(&self) -> &Proposals<PROPOSALS> {
        &self.from_arrangements
    }
}

/// Enters the proposals of each layer with those of the second set that are at most one farther in or out. Every layer is
/// described once: those of the second set stay at the front of `quads`, each of the first set's comes behind them.
fn propose_layers<const POINTS: usize, const LAYERS: usize>(
    (first, first_layers): (&[ImagePoint], &HullLayers<POINTS, LAYERS>),
    (second, second_layers): (&[ImagePoint], &HullLayers<POINTS, LAYERS>),
    terms: Terms,
    quads: &mut [LayerQuad],
    mut found: impl FnMut(Proposal),
) {
    let mut ends: Vec<usize, LAYERS> = Vec::new();
    let mut end = 0;
    for (j, two) in (0_u8..).zip(second_layers.layers()) {
        end += shift::describe((second, two, j), terms, quads.get_mut(end..).unwrap_or_default());
        // There are as many ends as layers.
        let _ = ends.push(end);
    }
    let (second_quads, rest) = quads.split_at_mut_checked(end).unwrap_or_default();
    for (i, one) in (0_u8..).zip(first_layers.layers()) {
        let layer = (first, one, i);
        let count = shift::describe(layer, terms, rest);
        let first_quads = rest.get(..count).unwrap_or_default();
        let mut from = 0;
        for ((j, two), &end) in (0_u8..).zip(second_layers.layers()).zip(&ends) {
            if j.abs_diff(i) <= 1 {
                let layer_quads = second_quads.get(from..end).unwrap_or_default();
                let two = ((second, two, j), layer_quads);
                shift::propose_described((layer, first_quads), two, terms, &mut found);
            }
            from = end;
        }
    }
}

impl<const POINTS: usize, const LAYERS: usize, const PROPOSALS: usize, const CANDIDATES: usize> Default
    for Correspond<POINTS, LAYERS, PROPOSALS, CANDIDATES>
{
    fn default() -> Self {
        Self::new()
    }
}
