//! From many proposals to one consistent set of pairs, without any map: neighbours vouch for one another.
//!
//! A building seen from another side is not one affine image but many: a facade, the other facade, the cornice in front of
//! it. Each proposal is true on its own patch; a repeated window makes false ones, which contradict their neighbours.
//! Relaxation labelling (Rosenfeld, Hummel, Zucker, "Scene labeling by relaxation operations", 1976) in a greedy form:
//! pairs are chosen by the bits of the proposals that hold them, one to one; then each proposal counts by how many of its
//! *other* pairs are chosen less those that are contradicted, and so on for a few rounds.

use heapless::Vec;

use super::heap_sort::sort_by;
use super::proposal::{MOST_PAIRS, Pairing, Proposal};

/// Rounds of choosing; later ones change hardly anything.
const ROUNDS: usize = 6;
/// Bits of one proposal beyond this do not count: one exact coincidence must not outvote several good ones.
const MOST_BITS: f32 = 40.0;
/// Bits that a pair needs to vouch for others.
const LEAST_TO_VOUCH: f32 = 10.0;
/// Share of the best rival's bits that is taken off.
const RIVALRY: f32 = 0.5;

const NONE: u16 = u16::MAX;

/// A chosen pair and the bits that speak for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supported {
    /// The pair.
    pub pair: Pairing,
    /// Bits of the proposals that hold it, weighted by their other pairs, less half of its best rival's.
    pub bits: f32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Candidate {
    pair: Pairing,
    bits: f32,
    /// Bits less what the best rival has.
    margin: f32,
    chosen: bool,
    /// 1 for a chosen pair, -1 for one whose corner is chosen with another, 0 for an open one.
    standing: f32,
}

/// The best two bits at a corner, to know the best rival of any of its candidates.
#[derive(Debug, Clone, Copy, Default)]
struct Best {
    first: f32,
    second: f32,
}

impl Best {
    fn enter(&mut self, bits: f32) {
        if bits > self.first {
            self.second = self.first;
            self.first = bits;
        } else if bits > self.second {
            self.second = bits;
        }
    }

    /// The best of the others.
    fn rival(self, bits: f32) -> f32 {
        if bits < self.first { self.first } else { self.second }
    }
}

/// The workspace: at most `POINTS` corners a picture, `PROPOSALS` proposals and `CANDIDATES` different pairs.
#[derive(Debug, Clone)]
pub struct Consensus<const POINTS: usize, const PROPOSALS: usize, const CANDIDATES: usize> {
    candidates: Vec<Candidate, CANDIDATES>,
    /// Of each proposal the numbers of its pairs among the candidates, and its bits.
    proposals: Vec<([u16; MOST_PAIRS], f32), PROPOSALS>,
    order: Vec<u16, CANDIDATES>,
    /// Whom each corner is paired with: the candidate's number.
    of_first: [u16; POINTS],
    of_second: [u16; POINTS],
    best_of_first: [Best; POINTS],
    best_of_second: [Best; POINTS],
}

impl<const POINTS: usize, const PROPOSALS: usize, const CANDIDATES: usize> Consensus<POINTS, PROPOSALS, CANDIDATES> {
    /// An empty workspace.
    pub const fn new() -> Self {
        const BEST: Best = Best { first: 0.0, second: 0.0 };
        Self {
            candidates: Vec::new(),
            proposals: Vec::new(),
            order: Vec::new(),
            of_first: [NONE; POINTS],
            of_second: [NONE; POINTS],
            best_of_first: [BEST; POINTS],
            best_of_second: [BEST; POINTS],
        }
    }

    /// Chooses pairs from the proposals, most surprising first, and calls `chosen` with those of at least `least` bits in
    /// falling order of their margin.
    ///
    /// Proposals beyond the capacity, and those with a pair beyond `CANDIDATES` or a corner beyond `POINTS`, are left
    /// out. Cost: a few rounds over all proposals and one sort of the candidates each.
    pub fn choose<'a>(
        &mut self,
        proposals: impl Iterator<Item = &'a Proposal>,
        least: f32,
        mut chosen: impl FnMut(Supported),
    ) {
        self.enter(proposals);
        for round in 0..ROUNDS {
            // Who stands as in the round before gets the same bits again; the first round asks nobody.
            let changed = self.stand() || round <= 1;
            if changed {
                self.weigh(round == 0);
            }
            if round + 1 == ROUNDS {
                self.pick(least);
            } else if changed {
                self.pick(LEAST_TO_VOUCH);
            }
        }
        for &number in &self.order {
            if let Some(candidate) = self.candidates.get(usize::from(number)).filter(|candidate| candidate.chosen) {
                chosen(Supported { pair: candidate.pair, bits: candidate.margin });
            }
        }
    }

    /// Lists the different pairs, in the order in which they come, and each proposal's.
    fn enter<'a>(&mut self, proposals: impl Iterator<Item = &'a Proposal>) {
        self.candidates.clear();
        self.proposals.clear();
        // Until they are put in order, a table of the candidates' numbers, open to the next place.
        self.order.clear();
        let _ = self.order.resize(CANDIDATES, NONE);
        let points = u16::try_from(POINTS).unwrap_or(NONE);
        let fits = |proposal: &&Proposal| proposal.pairs.iter().all(|pair| pair.first < points && pair.second < points);
        for proposal in proposals.filter(fits).take(PROPOSALS) {
            let mut numbers = [NONE; MOST_PAIRS];
            for (number, &pair) in numbers.iter_mut().zip(&proposal.pairs) {
                *number = self.number_of(pair);
            }
            let bits = proposal.surprise as f32 / 256.0;
            let _ = self.proposals.push((numbers, if bits < MOST_BITS { bits } else { MOST_BITS }));
        }
    }

    /// The number of the candidate with this pair, which is entered if it is new; [`NONE`] if there is no room.
    fn number_of(&mut self, pair: Pairing) -> u16 {
        let mixed = (u32::from(pair.first) << 16 | u32::from(pair.second)).wrapping_mul(0x9e37_79b9);
        // The upper half of the product, scaled to the length of the table.
        let start = (u64::from(mixed) * CANDIDATES as u64) >> 32;
        let (before, behind) = self.order.split_at_mut_checked(start as usize).unwrap_or_default();
        for slot in behind.iter_mut().chain(before) {
            match self.candidates.get(usize::from(*slot)) {
                Some(candidate) if candidate.pair == pair => return *slot,
                Some(_) => {}
                None => {
                    let number = self.candidates.len() as u16;
                    let _ = self.candidates.push(Candidate { pair, ..Candidate::default() });
                    *slot = number;
                    return number;
                }
            }
        }
        NONE
    }

    /// Finds out how each candidate stands; whether that has changed.
    fn stand(&mut self) -> bool {
        let mut changed = false;
        for candidate in &mut self.candidates {
            let taken = |of: &[u16; POINTS], corner: u16| of.get(usize::from(corner)).is_some_and(|&by| by != NONE);
            let Pairing { first, second } = candidate.pair;
            let standing = if candidate.chosen {
                1.0
            } else if taken(&self.of_first, first) || taken(&self.of_second, second) {
                -1.0
            } else {
                0.0
            };
            changed |= candidate.standing != standing;
            candidate.standing = standing;
        }
        changed
    }

    /// Adds up the bits of each candidate.
    fn weigh(&mut self, first_round: bool) {
        for candidate in &mut self.candidates {
            candidate.bits = 0.0;
        }
        for (numbers, bits) in &self.proposals {
            let standing = numbers
                .map(|number| self.candidates.get(usize::from(number)).map_or(0.0, |candidate| candidate.standing));
            let sum = standing.iter().fold(0.0, |sum, one| sum + one);
            let others = numbers.iter().filter(|number| **number != NONE).count().max(2) as f32 - 1.0;
            for (number, own) in numbers.iter().zip(standing) {
                let share = (sum - own) / others;
                let weight = match (first_round, share > 0.0) {
                    (true, _) => 1.0,
                    (false, true) => share * share,
                    (false, false) => continue,
                };
                if let Some(candidate) = self.candidates.get_mut(usize::from(*number)) {
                    candidate.bits += bits * weight;
                }
            }
        }
    }

    /// Chooses pairs one to one, largest margin first.
    fn pick(&mut self, least: f32) {
        self.best_of_first.fill(Best::default());
        self.best_of_second.fill(Best::default());
        for candidate in &self.candidates {
            if let (Some(first), Some(second)) = (
                self.best_of_first.get_mut(usize::from(candidate.pair.first)),
                self.best_of_second.get_mut(usize::from(candidate.pair.second)),
            ) {
                first.enter(candidate.bits);
                second.enter(candidate.bits);
            }
        }
        self.order.clear();
        for (number, candidate) in (0_u16..).zip(&mut self.candidates) {
            let rival = |best: &[Best; POINTS], corner: u16| {
                best.get(usize::from(corner)).map_or(0.0, |best| best.rival(candidate.bits))
            };
            let (a, b) =
                (rival(&self.best_of_first, candidate.pair.first), rival(&self.best_of_second, candidate.pair.second));
            candidate.margin = candidate.bits - RIVALRY * if a > b { a } else { b };
            candidate.chosen = false;
            if candidate.bits > 0.0 && candidate.margin > least {
                let _ = self.order.push(number);
            }
        }
        let candidates = &mut self.candidates;
        sort_by(&mut self.order, |a, b| {
            let of = |number: u16| candidates.get(usize::from(number)).copied().unwrap_or_default();
            let (a, b) = (of(*a), of(*b));
            b.margin.total_cmp(&a.margin).then(a.pair.cmp(&b.pair)).is_lt()
        });
        self.of_first.fill(NONE);
        self.of_second.fill(NONE);
        for &number in &self.order {
            let Some(candidate) = candidates.get_mut(usize::from(number)) else { continue };
            if let (Some(first), Some(second)) = (
                self.of_first.get_mut(usize::from(candidate.pair.first)),
                self.of_second.get_mut(usize::from(candidate.pair.second)),
            ) && *first == NONE
                && *second == NONE
            {
                (*first, *second, candidate.chosen) = (number, number, true);
            }
        }
    }
}

impl<const POINTS: usize, const PROPOSALS: usize, const CANDIDATES: usize> Default
    for Consensus<POINTS, PROPOSALS, CANDIDATES>
{
    fn default() -> Self {
        Self::new()
    }
}
