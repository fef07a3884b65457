//! Where a stored view may lie in the frame: hypotheses, whatever they come from.

use heapless::Vec;

use crate::candidate::{CandidateView, GAIN_UNIT};
use crate::kernel::{Kernels, Seed};
use crate::transform::Affine;

/// Hypotheses that are verified for a stored view, at most.
pub const MOST_HYPOTHESES: usize = 8;
/// A hypothesis with less support than this, in bits, is not worth verifying.
const LEAST_SUPPORT_BITS: i32 = 16;
/// Hypotheses that take the view's centre to places closer than this (L1, px) at the same scale are one.
const SAME_PLACE: f32 = 24.0;

/// A guess at the map from a stored view to the frame, certain near one point only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis {
    /// How much speaks for it, in 1/64 bit.
    pub support: i32,
    /// The map.
    pub frame_from_view: Affine,
    /// The point of the view where it is certain, px; its error may grow with the distance from there.
    pub anchor: [f32; 2],
    /// Scale of the map.
    pub scale: f32,
    /// Level in the frame minus level in the view that corners should have.
    pub step: f32,
}

/// A source of hypotheses. Signatures vote below; other sources (nested hulls, local arrangements) join with it.
pub trait HypothesisSource {
    /// Adds hypotheses for one stored view of `view_size` px to the list.
    fn propose<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        candidates: CandidateView<'_>,
        view_size: [f32; 2],
        hypotheses: &mut Hypotheses,
    );
}

/// The best distinct hypotheses so far, most support first; of equal ones the first stays first.
#[derive(Debug, Clone, Default)]
pub struct Hypotheses {
    list: Vec<(Hypothesis, [f32; 2]), MOST_HYPOTHESES>,
}

impl Hypotheses {
    /// None yet.
    pub const fn new() -> Self {
        Self { list: Vec::new() }
    }

    /// A hypothesis of this support or less cannot enter.
    pub fn bound(&self) -> i32 {
        let weakest = if self.list.is_full() { self.list.last().map_or(0, |(last, _)| last.support) } else { 0 };
        weakest.max(LEAST_SUPPORT_BITS * GAIN_UNIT - 1)
    }

    /// Enters a hypothesis that takes the view's centre to `centre`. One that is there already is replaced if the new
    /// one has more support; otherwise the weakest goes.
    pub fn add(&mut self, hypothesis: Hypothesis, centre: [f32; 2]) {
        if hypothesis.support < LEAST_SUPPORT_BITS * GAIN_UNIT {
            return;
        }
        let same = |(other, place): &&mut (Hypothesis, [f32; 2])| {
            let apart = (place[0] - centre[0]).abs() + (place[1] - centre[1]).abs();
            apart < SAME_PLACE && other.step == hypothesis.step
        };
        if let Some(known) = self.list.iter_mut().find(same) {
            if hypothesis.support > known.0.support {
                *known = (hypothesis, known.1);
            }
        } else {
            if self.list.is_full() && self.list.last().is_some_and(|(last, _)| last.support < hypothesis.support) {
                self.list.pop();
            }
            // Full of stronger ones: the new one is dropped.
            let _ = self.list.push((hypothesis, centre));
        }
        // One element is out of place: a single pass of insertion puts it right.
        for end in 1..self.list.len() {
            let mut at = end;
            while at > 0
                && let Some([before, after]) = self.list.get_mut(at - 1..=at)
                && before.0.support < after.0.support
            {
                core::mem::swap(before, after);
                at -= 1;
            }
        }
    }

    /// The hypotheses, most support first.
    pub fn iter(&self) -> impl Iterator<Item = &Hypothesis> {
        self.list.iter().map(|(hypothesis, _)| hypothesis)
    }
}

/// Every candidate alone is a map (a translation, with the scale of its levels, upright), and all others vote on it:
/// exhaustive, without random numbers. At most `CANDIDATES` squared checks.
#[derive(Debug, Clone)]
pub struct SignatureVotes<const CANDIDATES: usize> {
    agrees: [u8; CANDIDATES],
    /// A set of stored corners that have voted, a bit each.
    voted: [u64; STORED_WORDS],
}

const STORED_WORDS: usize = 1_024 / 64;

impl<const CANDIDATES: usize> SignatureVotes<CANDIDATES> {
    /// A source without votes.
    pub const fn new() -> Self {
        Self { agrees: [0; CANDIDATES], voted: [0; STORED_WORDS] }
    }

    /// The sum over stored corners of the best gain among their candidates that agree.
    fn support(&mut self, candidates: CandidateView<'_>) -> i32 {
        self.voted = [0; STORED_WORDS];
        let mut sum = 0;
        let columns = candidates.votes.gain.iter().zip(candidates.stored);
        for (&agrees, (&gain, &stored)) in self.agrees.iter().zip(columns) {
            if agrees == 0 {
                continue;
            }
            // The strongest candidate of a stored corner comes first.
            if let Some(word) = self.voted.get_mut(usize::from(stored / 64)) {
                let bit = 1 << (stored % 64);
                if *word & bit == 0 {
                    *word |= bit;
                    sum += gain;
                }
            }
        }
        sum
    }
}

impl<const CANDIDATES: usize> Default for SignatureVotes<CANDIDATES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CANDIDATES: usize> HypothesisSource for SignatureVotes<CANDIDATES> {
    fn propose<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        candidates: CandidateView<'_>,
        view_size: [f32; 2],
        hypotheses: &mut Hypotheses,
    ) {
        let votes = candidates.votes;
        let places = votes.from_x.iter().zip(votes.from_y).zip(votes.to_x.iter().zip(votes.to_y));
        for (((from, to), &step), &scale) in places.zip(votes.step).zip(candidates.scale) {
            let (from, to) = ([*from.0, *from.1], [*to.0, *to.1]);
            // Without the rule of one vote a stored corner the sum can only be larger: most seeds end here.
            if kernels.votes(Seed { from, to, scale, step }, votes, &mut self.agrees) <= hypotheses.bound() {
                continue;
            }
            let support = self.support(candidates);
            if support > hypotheses.bound() {
                let frame_from_view = Affine::upright(scale, from, to);
                let centre = frame_from_view.apply([view_size[0] / 2.0, view_size[1] / 2.0]);
                hypotheses.add(Hypothesis { support, frame_from_view, anchor: from, scale, step }, centre);
            }
        }
    }
}
