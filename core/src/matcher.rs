//! One stored view against one frame.

use heapless::Vec;

use crate::candidate::{Candidates, STORED_LAST};
use crate::evidence::{CornerEvidence, total, weigh};
use crate::extract::Features;
use crate::hypothesis::{Hypotheses, HypothesisSource, SignatureVotes};
use crate::kernel::Kernels;
use crate::query::QueryIndex;
use crate::refine::{Pairing, Refined, refine};
use crate::shortlist::Shortlist;
use crate::transform::{Homography, Shape, WeightedPair};

/// Fewer candidates than this propose nothing.
const LEAST_CANDIDATES: usize = 3;

/// A map with fewer corners in its favour is none: four points fix a homography, and what speaks for a building must be
/// more than the map was made from.
const LEAST_SUPPORTING: u16 = 6;

/// How well a stored view fits a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewMatch {
    /// Evidence for the view, all told, in 1/160 bit: [`total`].
    pub evidence: i32,
    /// What its corners say, in 1/160 bit.
    pub corner_evidence: i32,
    /// Support of the hypothesis that led to the map, in 1/64 bit.
    pub support: i32,
    /// Shape of the map where it is known best.
    pub shape: Shape,
    /// Where the view lies in the frame.
    pub frame_from_view: Homography,
    /// Stored corners with evidence in favour.
    pub supporting_corners: u16,
}

/// Working memory for views of at most `STORED` corners; `BLOCKS` of look-alikes make it faster and change
/// nothing else.
#[derive(Debug, Clone)]
pub struct Matcher<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize> {
    shortlist: Shortlist<STORED, BLOCKS>,
    candidates: Candidates<CANDIDATES>,
    votes: SignatureVotes<CANDIDATES>,
    pairs: Vec<WeightedPair, CANDIDATES>,
    corners: Vec<CornerEvidence, STORED>,
    latest_corners: Vec<CornerEvidence, STORED>,
}

impl<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize> Matcher<STORED, CANDIDATES, BLOCKS> {
    /// Working memory; nothing depends on what was matched before.
    pub const fn new() -> Self {
        const { assert!(CANDIDATES >= STORED, "every stored corner may become a pair") };
        const { assert!(STORED <= STORED_LAST as usize + 1, "a candidate has 10 bits for a stored corner") };
        Self {
            shortlist: Shortlist::new(),
            candidates: Candidates::new(),
            votes: SignatureVotes::new(),
            pairs: Vec::new(),
            corners: Vec::new(),
            latest_corners: Vec::new(),
        }
    }

    /// The best map of the stored view to the frame and its evidence; `None` if no hypothesis stands.
    ///
    /// `distances` is scratch memory of at least `stored.len() * query.len()` bytes; with less, the last stored corners
    /// are left out.
    pub fn match_view<K: Kernels + ?Sized, const QUERY: usize>(
        &mut self,
        kernels: &K,
        stored: Features<'_>,
        query: Features<'_>,
        index: &QueryIndex<QUERY>,
        distances: &mut [u8],
    ) -> Option<ViewMatch> {
        self.latest_corners.clear();
        for (row, &signature) in distances.chunks_exact_mut(query.len().max(1)).zip(stored.signatures) {
            kernels.distances(signature, query.signatures, row);
        }
        self.candidates.collect(kernels, stored, query, distances);
        if self.candidates.len() < LEAST_CANDIDATES {
            return None;
        }
        let mut hypotheses = Hypotheses::new();
        let view_size = [f32::from(stored.width), f32::from(stored.height)];
        self.votes.propose(kernels, self.candidates.view(), view_size, &mut hypotheses);
        let pairing = Pairing { stored, query, index, distances };
        self.shortlist.fill(kernels, &pairing);
        let mut best: Option<ViewMatch> = None;
        for hypothesis in hypotheses.iter() {
            let candidates = self.candidates.view();
            let refined = refine(kernels, &pairing, &self.shortlist, candidates, hypothesis, &mut self.pairs);
            let Some(refined) = refined else { continue };
            // The hypothesis before had more support; with the same map, this one has less evidence.
            if best.is_some_and(|best| (best.frame_from_view, best.shape) == (refined.frame_from_view, refined.shape)) {
                continue;
            }
            let corner_evidence = weigh(kernels, &pairing, &refined, &mut self.corners);
            let supporting_corners = self.corners.iter().filter(|corner| corner.evidence > 0).count() as u16;
            if supporting_corners < LEAST_SUPPORTING {
                continue;
            }
            let Refined { frame_from_view, shape, .. } = refined;
            let evidence = total(corner_evidence, supporting_corners, hypothesis.support, shape);
            if best.is_none_or(|best| evidence > best.evidence) {
                let support = hypothesis.support;
                best =
                    Some(ViewMatch { evidence, corner_evidence, support, shape, frame_from_view, supporting_corners });
                core::mem::swap(&mut self.corners, &mut self.latest_corners);
            }
        }
        best
    }

    /// The corners behind the latest match, for an explanation.
    pub fn latest_corners(&self) -> &[CornerEvidence] {
        &self.latest_corners
    }
}

impl<const STORED: usize, const CANDIDATES: usize, const BLOCKS: usize> Default
    for Matcher<STORED, CANDIDATES, BLOCKS>
{
    fn default() -> Self {
        Self::new()
    }
}
