//! Core's correspondence with the memory of a PC, and the thesis' plain rule beside it.

use daymark_core::geometry::arrangement::{Arrangement, scratch_length};
use daymark_core::geometry::correspond::{Correspond, Explanation, NoCorrespondence, Settings, Sources};
use daymark_core::geometry::layers::Remainder;
use daymark_core::geometry::proposal::{Invariance, Origin, Pairing, Proposal, Proposals, Terms};
use daymark_core::geometry::quad::Tolerance;
use daymark_core::geometry::shift::{LayerQuad, plain_shift, quads_of};
use daymark_core::geometry::{GeometryError, HullLayers};
use daymark_core::point::ImagePoint;

use super::{Corners, MOST_CORNERS};
use crate::order;

/// Layers of [`MOST_CORNERS`] corners, at most.
pub const MOST_LAYERS: usize = MOST_CORNERS / 3 + 1;
/// Proposals of each source that are kept.
pub const MOST_PROPOSALS: usize = 1_024;
/// Different pairs among them that are weighed.
const MOST_CANDIDATES: usize = 4_096;

type Workspace = Correspond<MOST_CORNERS, MOST_LAYERS, MOST_PROPOSALS, MOST_CANDIDATES>;

/// By which rule corners are matched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// Proposals that allow for noise of the corners (standard deviation of a coordinate in the working frame, px), verified.
    Tolerant {
        /// Where proposals come from.
        sources: Sources,
        /// Noise, px.
        noise_px: f32,
    },
    /// The thesis' rule: layer by layer the circular shift at which most area ratios agree; nothing is verified.
    Plain {
        /// Relative difference of two ratios that still agree.
        epsilon: Tolerance,
    },
}

/// Which source a correspondence owes itself to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FoundBy {
    /// Accepted quads of hull layers.
    Layers,
    /// Accepted local arrangements.
    Arrangements,
    /// Both.
    Both,
    /// No accepted proposal holds it: the map that others gave expects it there.
    Map,
}

/// Two corners that are the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// Which.
    pub pair: Pairing,
    /// The hull layer of each, 0 the outermost; `None` in the remainder within the innermost.
    pub layers: [Option<u16>; 2],
    /// Vertices by which the layer of the second is shifted against that of the first, where layers gave the pair.
    pub shift: Option<u16>,
    /// Who proposed it.
    pub found_by: FoundBy,
    /// Distance from where the map expects the second corner, or from the epipolar constraint, px of the working frame;
    /// the plain rule has neither.
    pub residual_px: Option<f32>,
}

/// What explains the correspondences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// One affine map, or relief.
    Explained(Explanation),
    /// So many quads of all layers agree by the plain rule.
    Plain {
        /// Quads.
        quads: usize,
    },
    /// Nothing: why.
    Nothing(NoCorrespondence),
    /// No quad of any layer agrees by the plain rule.
    NothingPlain,
}

/// The nested hulls of one picture.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Nested {
    /// Vertices of each layer, the outermost first, clockwise.
    pub layers: Vec<Vec<u16>>,
    /// What is left within the innermost.
    pub remainder: Vec<u16>,
}

/// The proposals of one source.
#[derive(Debug, Clone, Default)]
pub struct Proposed {
    /// How many there were.
    pub seen: usize,
    /// The most surprising of them, in falling order.
    pub kept: Vec<Proposal>,
}

/// What matching two pictures gave.
#[derive(Debug, Clone)]
pub struct Matching {
    /// The rule.
    pub rule: Rule,
    /// Hulls of the first and the second picture.
    pub nested: [Nested; 2],
    /// What explains the pairs, or why there are none.
    pub answer: Answer,
    /// The correspondences, in the order of the first corners.
    pub pairs: Vec<Matched>,
    /// Proposals of nested hulls; none by the plain rule.
    pub from_layers: Proposed,
    /// Proposals of local arrangements.
    pub from_arrangements: Proposed,
}

/// Everything that matching needs, allocated once.
#[derive(Debug)]
pub struct Matcher {
    workspace: Box<Workspace>,
    arrangements: Vec<Arrangement>,
    quads: Vec<LayerQuad>,
}

impl Default for Matcher {
    fn default() -> Self {
        Self {
            workspace: Box::default(),
            arrangements: vec![Arrangement::default(); scratch_length(MOST_CORNERS)],
            quads: vec![LayerQuad::default(); quads_of(2 * MOST_CORNERS)],
        }
    }
}

impl Matcher {
    /// Matches the corners of two pictures.
    ///
    /// # Errors
    /// More corners than [`MOST_CORNERS`], or one far outside any picture.
    pub fn run(&mut self, first: &Corners, second: &Corners, rule: Rule) -> Result<Matching, GeometryError> {
        let area = second.size_px.map(f64::from);
        self.places(&first.places, &second.places, area[0] * area[1], rule)
    }

    /// Matches two sets of places; `area` is that of the second working frame, px².
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn places(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        area: f64,
        rule: Rule,
    ) -> Result<Matching, GeometryError> {
        match rule {
            Rule::Plain { epsilon } => plain(first, second, epsilon),
            Rule::Tolerant { sources, noise_px } => {
                let terms = Terms { sigma: noise_px, area, invariance: Invariance::Affine };
                let settings = Settings { terms, sources };
                self.tolerant(first, second, settings)
            }
        }
    }

    fn tolerant(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        settings: Settings,
    ) -> Result<Matching, GeometryError> {
        let answer = self.workspace.correspond(first, second, settings, &mut self.arrangements, &mut self.quads)?;
        let [one, two] = self.workspace.layers();
        let (from_layers, from_arrangements) =
            (proposed(self.workspace.from_layers()), proposed(self.workspace.from_arrangements()));
        let mut pairs: Vec<Matched> = self
            .workspace
            .found()
            .iter()
            .map(|found| Matched {
                pair: found.pair,
                layers: [one.layer_of(found.pair.first), two.layer_of(found.pair.second)],
                shift: None,
                found_by: FoundBy::Map,
                residual_px: Some(found.residual),
            })
            .collect();
        order::sort_by_key(&mut pairs, |matched| matched.pair);
        credit(&mut pairs, &from_layers, &from_arrangements);
        Ok(Matching {
            rule: Rule::Tolerant { sources: settings.sources, noise_px: settings.terms.sigma },
            nested: [nested(one), nested(two)],
            answer: answer.map_or_else(Answer::Nothing, Answer::Explained),
            pairs,
            from_layers,
            from_arrangements,
        })
    }
}

fn proposed(proposals: &Proposals<MOST_PROPOSALS>) -> Proposed {
    Proposed { seen: proposals.seen(), kept: proposals.iter().cloned().collect() }
}

/// Says of each pair which accepted proposals hold it; the shift is that of the most surprising one.
fn credit(pairs: &mut [Matched], from_layers: &Proposed, from_arrangements: &Proposed) {
    let find = |pairs: &[Matched], pair: &Pairing| pairs.binary_search_by_key(pair, |matched| matched.pair);
    for proposal in from_layers.kept.iter().chain(&from_arrangements.kept) {
        if !proposal.pairs.iter().all(|pair| find(pairs, pair).is_ok()) {
            continue;
        }
        for pair in &proposal.pairs {
            let Ok(at) = find(pairs, pair) else { continue };
            let matched = &mut pairs[at];
            match proposal.origin {
                Origin::Layers { shift, .. } => {
                    matched.shift = matched.shift.or(Some(shift));
                    matched.found_by = FoundBy::Layers;
                }
                Origin::Arrangement => {
                    matched.found_by = match matched.found_by {
                        FoundBy::Layers | FoundBy::Both => FoundBy::Both,
                        FoundBy::Arrangements | FoundBy::Map => FoundBy::Arrangements,
                    }
                }
            }
        }
    }
}

fn nested(layers: &HullLayers<MOST_CORNERS, MOST_LAYERS>) -> Nested {
    let remainder = match layers.remainder() {
        Remainder::None => Vec::new(),
        Remainder::Point(point) => vec![point],
        Remainder::Line(line) => line.to_vec(),
    };
    Nested { layers: layers.layers().map(<[u16]>::to_vec).collect(), remainder }
}

/// Layer `i` of the first picture with layer `i` of the second.
fn plain(first: &[ImagePoint], second: &[ImagePoint], epsilon: Tolerance) -> Result<Matching, GeometryError> {
    let mut layers: Box<[HullLayers<MOST_CORNERS, MOST_LAYERS>; 2]> = Box::new([const { HullLayers::new() }; 2]);
    layers[0].peel(first)?;
    layers[1].peel(second)?;
    let mut pairs = Vec::new();
    let mut quads = 0;
    for (number, (one, two)) in (0_u16..).zip(layers[0].layers().zip(layers[1].layers())) {
        let Some(shift) = plain_shift::<MOST_CORNERS>((first, one), (second, two), epsilon) else { continue };
        quads += usize::from(shift.quads);
        pairs.extend(shift.pairs.iter().map(|&pair| Matched {
            pair,
            layers: [Some(number); 2],
            shift: Some(shift.shift),
            found_by: FoundBy::Layers,
            residual_px: None,
        }));
    }
    order::sort_by_key(&mut pairs, |matched| matched.pair);
    Ok(Matching {
        rule: Rule::Plain { epsilon },
        nested: [nested(&layers[0]), nested(&layers[1])],
        answer: if pairs.is_empty() { Answer::NothingPlain } else { Answer::Plain { quads } },
        pairs,
        from_layers: Proposed::default(),
        from_arrangements: Proposed::default(),
    })
}
