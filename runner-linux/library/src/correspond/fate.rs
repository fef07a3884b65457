//! What became of every proposal, and of every quad of the first picture's layers: matched, or why not.

use daymark_core::geometry::correspond::Explanation;
use daymark_core::geometry::proposal::{Origin, Pairing, Proposal};
use daymark_core::geometry::quad::{Quad, Tolerance};
use daymark_core::geometry::shift::MOST_UNCERTAIN;
use daymark_core::point::ImagePoint;

use super::matching::{Answer, Matching, Proposed, Rule};

/// What became of a proposal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProposalFate {
    /// All its pairs are among the correspondences.
    Accepted,
    /// A corner of it is matched with another one.
    Contradicts,
    /// The map, or the epipolar constraint, expects a corner of it so many pixels away.
    Off {
        /// Of the worst corner, px of the working frame.
        by_px: f32,
    },
    /// A corner of it lies where the map expects it, but another is about as near, or nothing vouches for it.
    Undecided,
    /// There is no answer to hold it against.
    Unverified,
}

/// What became of four vertices in a row of a layer of the first picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum QuadFate {
    /// Matched.
    Matched,
    /// Like one of the other picture, which contradicts what was matched.
    Contradicts,
    /// Like one of the other picture, which the map, or the epipolar constraint, expects elsewhere.
    Off,
    /// Like one of the other picture, but nothing could verify it.
    Unverified,
    /// No quad of the other picture's layers has its area ratios.
    Unlike,
    /// A triangle so thin that the noise of the corners leaves its area ratios open.
    Thin,
}

impl QuadFate {
    /// All, in the order in which they are told.
    pub const ALL: [Self; 6] =
        [Self::Matched, Self::Contradicts, Self::Off, Self::Unverified, Self::Unlike, Self::Thin];

    /// What a person reads.
    pub const fn says(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::Contradicts => "refused: contradicts the corners that are matched",
            Self::Off => "refused: its partner lies elsewhere than the map expects",
            Self::Unverified => "not verified",
            Self::Unlike => "refused: no quad of the other picture has its area ratios",
            Self::Thin => "refused: so thin that noise leaves its area ratios open",
        }
    }

    /// The name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::Contradicts => "contradicts",
            Self::Off => "off",
            Self::Unverified => "unverified",
            Self::Unlike => "unlike",
            Self::Thin => "thin",
        }
    }
}

/// Four vertices in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerQuadFate {
    /// The layer.
    pub layer: usize,
    /// The vertices in the first picture.
    pub vertices: [u16; 4],
    /// The vertices in the second picture that they are most like, where there are such.
    pub partners: Option<[u16; 4]>,
    /// What became of it.
    pub fate: QuadFate,
}

/// How many proposals of a source had which fate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Proposed in all.
    pub seen: usize,
    /// Less surprising than those that were kept.
    pub crowded_out: usize,
    /// See [`ProposalFate::Accepted`].
    pub accepted: usize,
    /// See [`ProposalFate::Contradicts`].
    pub contradicts: usize,
    /// See [`ProposalFate::Off`].
    pub off: usize,
    /// See [`ProposalFate::Undecided`].
    pub undecided: usize,
    /// See [`ProposalFate::Unverified`].
    pub unverified: usize,
}

/// The judge of one matching: looks things up.
#[derive(Debug)]
pub struct Judge<'a> {
    matching: &'a Matching,
    first: &'a [ImagePoint],
    second: &'a [ImagePoint],
    of_first: Vec<Option<u16>>,
    of_second: Vec<Option<u16>>,
}

impl<'a> Judge<'a> {
    /// For a matching of these places.
    pub fn new(matching: &'a Matching, first: &'a [ImagePoint], second: &'a [ImagePoint]) -> Self {
        let (mut of_first, mut of_second) = (vec![None; first.len()], vec![None; second.len()]);
        for matched in &matching.pairs {
            of_first[usize::from(matched.pair.first)] = Some(matched.pair.second);
            of_second[usize::from(matched.pair.second)] = Some(matched.pair.first);
        }
        Self { matching, first, second, of_first, of_second }
    }

    /// What became of a proposal.
    pub fn proposal(&self, proposal: &Proposal) -> ProposalFate {
        let Answer::Explained(explanation) = self.matching.answer else { return ProposalFate::Unverified };
        let partner = |pair: &Pairing| self.of_first.get(usize::from(pair.first)).copied().flatten();
        if proposal.pairs.iter().all(|pair| partner(pair) == Some(pair.second)) {
            return ProposalFate::Accepted;
        }
        let contradicts = |pair: &Pairing| {
            let back = self.of_second.get(usize::from(pair.second)).copied().flatten();
            partner(pair).is_some_and(|second| second != pair.second) || back.is_some_and(|first| first != pair.first)
        };
        if proposal.pairs.iter().any(contradicts) {
            return ProposalFate::Contradicts;
        }
        let worst = proposal.pairs.iter().map(|&pair| self.residual(explanation, pair)).fold(0.0, f32::max);
        // What is matched stays within so much.
        let most = self.matching.pairs.iter().filter_map(|matched| matched.residual_px).fold(0.0, f32::max);
        if worst > most { ProposalFate::Off { by_px: worst } } else { ProposalFate::Undecided }
    }

    fn residual(&self, explanation: Explanation, pair: Pairing) -> f32 {
        let place = |places: &[ImagePoint], number: u16| {
            places.get(usize::from(number)).copied().unwrap_or_default().to_pixels()
        };
        let (from, to) = (place(self.first, pair.first), place(self.second, pair.second));
        match explanation {
            Explanation::Map(best) => {
                let [x, y] = best.second_from_first.apply(from);
                daymark_core::math::sqrt((x - to[0]) * (x - to[0]) + (y - to[1]) * (y - to[1]))
            }
            Explanation::Relief { epipolar, .. } => {
                epipolar.distance(&[from[0], from[1], to[0], to[1]].map(f64::from)) as f32
            }
        }
    }

    /// How many of a source's proposals had which fate.
    pub fn counts(&self, proposed: &Proposed) -> Counts {
        let mut counts =
            Counts { seen: proposed.seen, crowded_out: proposed.seen - proposed.kept.len(), ..Counts::default() };
        for proposal in &proposed.kept {
            *match self.proposal(proposal) {
                ProposalFate::Accepted => &mut counts.accepted,
                ProposalFate::Contradicts => &mut counts.contradicts,
                ProposalFate::Off { .. } => &mut counts.off,
                ProposalFate::Undecided => &mut counts.undecided,
                ProposalFate::Unverified => &mut counts.unverified,
            } += 1;
        }
        counts
    }

    /// What became of each four vertices in a row of the first picture's layers: the thesis' quads.
    pub fn quads(&self) -> Vec<LayerQuadFate> {
        let mut quads = Vec::new();
        for (layer, vertices) in self.matching.nested[0].layers.iter().enumerate().filter(|(_, layer)| layer.len() > 3)
        {
            for start in 0..vertices.len() {
                let four = [0, 1, 2, 3].map(|step| vertices[(start + step) % vertices.len()]);
                quads.push(match self.matching.rule {
                    Rule::Tolerant { noise_px, .. } => self.tolerant(layer, four, noise_px),
                    Rule::Plain { epsilon } => self.plain(layer, start, four, epsilon),
                });
            }
        }
        quads
    }

    fn tolerant(&self, layer: usize, vertices: [u16; 4], noise_px: f32) -> LayerQuadFate {
        let quad = Quad::new(vertices.map(|vertex| self.first[usize::from(vertex)]));
        let of = |proposal: &&Proposal| {
            matches!(proposal.origin, Origin::Layers { .. })
                && proposal.pairs.iter().map(|pair| pair.first).eq(vertices)
        };
        // The most surprising one unless another was accepted.
        let mut best: Option<(QuadFate, [u16; 4])> = None;
        for proposal in self.matching.from_layers.kept.iter().filter(of) {
            let fate = match self.proposal(proposal) {
                ProposalFate::Accepted => QuadFate::Matched,
                ProposalFate::Contradicts => QuadFate::Contradicts,
                ProposalFate::Off { .. } => QuadFate::Off,
                ProposalFate::Undecided | ProposalFate::Unverified => QuadFate::Unverified,
            };
            if best.is_none() || fate == QuadFate::Matched && best.is_some_and(|(best, _)| best != fate) {
                let partner = |step: usize| proposal.pairs.get(step).map_or(0, |pair| pair.second);
                best = Some((fate, [0, 1, 2, 3].map(partner)));
            }
        }
        let (fate, partners) = match best {
            Some((fate, partners)) => (fate, Some(partners)),
            None if !(quad.ratio_uncertainty(noise_px) <= MOST_UNCERTAIN) => (QuadFate::Thin, None),
            None => (QuadFate::Unlike, None),
        };
        LayerQuadFate { layer, vertices, partners, fate }
    }

    fn plain(&self, layer: usize, start: usize, vertices: [u16; 4], epsilon: Tolerance) -> LayerQuadFate {
        let others = self.matching.nested[1].layers.get(layer).map_or(&[][..], |layer| layer.as_slice());
        let shift = self.matching.pairs.iter().find(|matched| matched.layers[0] == Some(layer as u16));
        let shift = shift.and_then(|matched| matched.shift).map(usize::from);
        let Some(shift) = shift.filter(|_| others.len() > 3) else {
            return LayerQuadFate { layer, vertices, partners: None, fate: QuadFate::Unlike };
        };
        let partners = [0, 1, 2, 3].map(|step| others[(start + shift + step) % others.len()]);
        let one = Quad::new(vertices.map(|vertex| self.first[usize::from(vertex)])).ratio();
        let two = Quad::new(partners.map(|vertex| self.second[usize::from(vertex)])).ratio();
        if one.agrees(two, epsilon) {
            LayerQuadFate { layer, vertices, partners: Some(partners), fate: QuadFate::Matched }
        } else {
            LayerQuadFate { layer, vertices, partners: None, fate: QuadFate::Unlike }
        }
    }
}
