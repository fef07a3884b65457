//! Verification: the one map that explains most corners, and the correspondences that follow from it.
//!
//! Every proposal is a map; each is fitted, corners are assigned, and both again. What a map explains is weighed against
//! chance *a contrario*: the bits by which its count of matched corners exceeds what random corners would give, so that a
//! wide gate costs what it gains (Moisan and Stival, "A probabilistic criterion to detect rigid point matches between two
//! images", IJCV 2004).

use heapless::Vec;

use super::heap_sort::sort_by;
use super::proposal::{Invariance, Pairing, Proposal, Terms};
use crate::math::{log2, sqrt};
use crate::point::ImagePoint;
use crate::transform::{Affine, Homography, Normalization, WeightedPair, fit_affine, fit_homography};

/// No corner.
const NONE: u16 = u16::MAX;
/// Squared distance, in variances, that 99 % of the true corners keep (two degrees of freedom).
const GATE: f32 = 9.21;
/// Widest gate, px²: an uncertain map must not catch corners from afar.
const WIDEST_GATE: f32 = 144.0;
/// Assignments and fits for each proposal.
const ROUNDS: usize = 4;
/// The same for a homography, which grows out of the part that is nearly affine.
const ROUNDS_OF_PERSPECTIVE: usize = 8;
/// Noise levels, as multiples of the expected one, at which the best map is tried.
const NOISE_LEVELS: [f32; 3] = [1.0, 2.0, 3.0];
/// Bits by which the best map must exceed the number of maps that could have been tried.
pub const LEAST_BITS: f32 = 20.0;
/// Times the noise within which a growing homography looks for its next corners.
const GROWING: f32 = 3.0;
/// Ridge on the perspective terms, in normalized coordinates.
const PERSPECTIVE_RIDGE: f64 = 1e-5;
/// A different map with more than this share of the best one's bits leaves the answer open.
const RIVAL: f32 = 0.6;

/// An affine map with what its fit knows about its own certainty.
#[derive(Debug, Clone, Copy)]
struct Fit {
    map: Affine,
    mean: [f32; 2],
    /// Inverse of the second moments of the source points around the mean.
    inverse: [[f32; 2]; 2],
    count: f32,
    /// 1 + |L|²/2: noise of both pictures, as it shows in the second.
    noise: f32,
}

impl Fit {
    /// By least squares; `None` for degenerate pairs, mirror images, and maps that scale areas beyond 1/50..50 or stretch
    /// one direction 6 times as much as the other.
    fn of(pairs: &[WeightedPair]) -> Option<Self> {
        let map = fit_affine(pairs, 1.0, 0.0)?;
        let count = pairs.len() as f32;
        let mean = pairs.iter().fold([0.0; 2], |[x, y], pair| [x + pair.from[0] / count, y + pair.from[1] / count]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for pair in pairs {
            let (x, y) = (pair.from[0] - mean[0], pair.from[1] - mean[1]);
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
        }
        let determinant = xx * yy - xy * xy;
        let [[a, b], [c, d]] = map.linear;
        let area = a * d - b * c;
        let norm = a * a + b * b + c * c + d * d;
        // The ratio r of the singular values: norm / area = r + 1 / r.
        if !(determinant > 0.0 && area > 0.02 && area < 50.0 && norm < (6.0 + 1.0 / 6.0) * area) {
            return None;
        }
        let inverse = [[yy / determinant, -xy / determinant], [-xy / determinant, xx / determinant]];
        Some(Self { map, mean, inverse, count, noise: 1.0 + norm / 2.0 })
    }

    /// Variance of a found corner against the predicted one, px², for corners of variance 1: noise of both pictures, and
    /// of the fit, which grows with the distance from the corners it was made of.
    fn variance(&self, point: [f32; 2]) -> f32 {
        let (x, y) = (point[0] - self.mean[0], point[1] - self.mean[1]);
        let [[a, b], [_, d]] = self.inverse;
        self.noise * (1.0 + 1.0 / self.count + a * x * x + 2.0 * b * x * y + d * y * y)
    }
}

/// A map under consideration: the affine fit of what it explains, the map itself, and its bits.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    fit: Fit,
    map: Homography,
    bits: f32,
}

/// A correspondence that one map explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// Which corners.
    pub pair: Pairing,
    /// Distance in the second picture of the corner from where the map expects it, px.
    pub residual: f32,
}

/// The map that explains most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BestMap {
    /// The map.
    pub second_from_first: Homography,
    /// Bits beyond chance, the choice among all possible maps already taken off.
    pub bits: f32,
    /// Bits of the best different map, likewise; 0 if none was better than nothing.
    pub rival_bits: f32,
    /// Noise at which it explains most, px.
    pub sigma: f32,
}

/// Why there is no map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoAgreement {
    /// No proposal led to a map.
    NothingProposed,
    /// The best map explains no more than chance would.
    Chance {
        /// Its bits; positive ones are more than chance, but too few.
        bits: f32,
    },
    /// Two different maps explain about as much: a repeating facade, for one.
    Ambiguous {
        /// Bits of the best.
        bits: f32,
        /// Bits of the other.
        rival_bits: f32,
    },
}

/// The corner that a first one is paired with, and the squared residual; [`NONE`] and 0 without.
type Match = (u16, f32);

/// A corner's place, px, and its number.
type Numbered = ([f32; 2], u16);

/// The workspace of a verification of at most `POINTS` corners a picture.
#[derive(Debug, Clone)]
pub struct Agreement<const POINTS: usize> {
    first: Vec<[f32; 2], POINTS>,
    second: Vec<[f32; 2], POINTS>,
    /// The second corners from left to right.
    rightwards: Vec<Numbered, POINTS>,
    matched: Vec<Match, POINTS>,
    /// The second corners of `matched` that the last fit was made of.
    fitted: Vec<u16, POINTS>,
    /// Of each second corner the first one that is nearest.
    taken: Vec<Match, POINTS>,
    pairs: Vec<WeightedPair, POINTS>,
    best: Vec<Match, POINTS>,
    area: f32,
}

impl<const POINTS: usize> Agreement<POINTS> {
    /// An empty workspace.
    pub const fn new() -> Self {
        Self {
            first: Vec::new(),
            second: Vec::new(),
            rightwards: Vec::new(),
            fitted: Vec::new(),
            matched: Vec::new(),
            taken: Vec::new(),
            pairs: Vec::new(),
            best: Vec::new(),
            area: 1.0,
        }
    }

    /// Finds the map that explains most corners, starting from the proposals: affine, and then perspective if the terms ask
    /// for it and it explains more. Corners beyond `POINTS` are not looked at. [`Self::explained`] then lists the correspondences.
    ///
    /// # Errors
    /// [`NoAgreement`]: not a fault, but the reason why there is no answer.
    pub fn find<'a>(
        &mut self,
        first: &[ImagePoint],
        second: &[ImagePoint],
        proposals: impl Iterator<Item = &'a Proposal>,
        terms: Terms,
    ) -> Result<BestMap, NoAgreement> {
        self.enter(first, second);
        let trials = tested_maps(self.first.len(), self.second.len());
        let mut best: Option<Candidate> = None;
        let mut rival = 0.0;
        for proposal in proposals {
            let known = |pair: &Pairing| self.best.get(usize::from(pair.first)).is_some_and(|m| m.0 == pair.second);
            if proposal.pairs.iter().all(known) {
                continue;
            }
            let Some(candidate) = self.follow(proposal, terms) else { continue };
            let bits = candidate.bits;
            let matched = self.matched.iter().filter(|m| m.0 != NONE).count();
            let shared = self.best.iter().zip(&self.matched).filter(|(a, b)| a.0 == b.0 && a.0 != NONE).count();
            let different = shared * 2 < matched;
            let leader = best.map_or(0.0, |best| best.bits);
            if bits > leader {
                if different {
                    rival = leader;
                }
                best = Some(candidate);
                self.best.clone_from(&self.matched);
            } else if different && bits > rival {
                rival = bits;
            }
        }
        let Some(best) = best else { return Err(NoAgreement::NothingProposed) };
        let (bits, rival_bits) = (best.bits - trials, if rival > trials { rival - trials } else { 0.0 });
        if bits < LEAST_BITS {
            return Err(NoAgreement::Chance { bits });
        }
        if rival_bits > RIVAL * bits {
            return Err(NoAgreement::Ambiguous { bits, rival_bits });
        }
        let (best, sigma) = self.settle(best, terms);
        Ok(BestMap { second_from_first: best.map, bits: best.bits - trials, rival_bits, sigma })
    }

    /// The correspondences of the map found last, in the order of the first corners.
    pub fn explained(&self) -> impl Iterator<Item = Explained> {
        (0_u16..)
            .zip(&self.best)
            .filter(|(_, m)| m.0 != NONE)
            .map(|(first, &(second, squared))| Explained { pair: Pairing { first, second }, residual: sqrt(squared) })
    }

    fn enter(&mut self, first: &[ImagePoint], second: &[ImagePoint]) {
        for (list, points) in [(&mut self.first, first), (&mut self.second, second)] {
            list.clear();
            for point in points {
                // Beyond the capacity nothing is looked at, as the function says.
                let _ = list.push(point.to_pixels());
            }
        }
        self.area = bounding_area(&self.second);
        self.rightwards.clear();
        for (number, &place) in (0_u16..).zip(&self.second) {
            let _ = self.rightwards.push((place, number));
        }
        sort_by(&mut self.rightwards, |a, b| a.0[0].total_cmp(&b.0[0]).then(a.1.cmp(&b.1)).is_lt());
        self.best.clear();
    }

    /// The map that grows out of a proposal, and what it explains.
    fn follow(&mut self, proposal: &Proposal, terms: Terms) -> Option<Candidate> {
        self.pairs.clear();
        for pair in &proposal.pairs {
            if let (Some(&from), Some(&to)) =
                (self.first.get(usize::from(pair.first)), self.second.get(usize::from(pair.second)))
            {
                let _ = self.pairs.push(WeightedPair { from, to, weight: 1.0 });
            }
        }
        let fit = Fit::of(&self.pairs)?;
        Some(self.grow(Candidate { fit, map: fit.map.into(), bits: 0.0 }, terms))
    }

    /// Tries the best map at several levels of noise and keeps the one at which it explains most.
    fn settle(&mut self, start: Candidate, terms: Terms) -> (Candidate, f32) {
        let mut best: Option<(Candidate, f32)> = None;
        for level in NOISE_LEVELS {
            let sigma = terms.sigma * level;
            let candidate = self.grow(start, Terms { sigma, ..terms });
            if best.is_none_or(|(best, _)| candidate.bits > best.bits) {
                best = Some((candidate, sigma));
                self.best.clone_from(&self.matched);
            }
        }
        best.unwrap_or((start, terms.sigma))
    }

    /// Assigns corners and fits again, in turn: an affine map, and a homography of what that explains if the terms ask
    /// for it and it explains more. A homography has a fourth pair free, which costs as many bits as there are pairs.
    /// The matches are those of the map that is returned.
    fn grow(&mut self, start: Candidate, terms: Terms) -> Candidate {
        let mut best = start;
        let [.., [g, h, _]] = start.map.0;
        let affine = g == 0.0 && h == 0.0;
        let mut found = self.assign(&best, terms.sigma);
        for round in 0..if affine { ROUNDS } else { 0 } {
            // The same pairs give the same fit, from now on.
            if round > 0 && self.is_settled() {
                break;
            }
            let Some(fit) = self.refit() else { break };
            (best.fit, best.map) = (fit, fit.map.into());
            found = self.assign(&best, terms.sigma);
        }
        best.bits = self.bits(found);
        if terms.invariance == Invariance::Affine {
            return best;
        }
        let free = log2((self.first.len() * self.second.len()).max(1) as f64) as f32;
        let [source, target] = [&self.first, &self.second].map(|places| {
            let side = places.iter().flatten().fold(1.0_f32, |most, &x| if x > most { x } else { most });
            Normalization::of_frame(side as u16, side as u16)
        });
        let mut tilted = best;
        for round in 0..ROUNDS_OF_PERSPECTIVE {
            let Some(fit) = self.refit() else { break };
            let Some(map) = fit_homography(&self.pairs, source, target, PERSPECTIVE_RIDGE) else { break };
            // The affine fit tells how certain the map is where its pairs lie, but not beyond: wide gates find the next
            // corners, and narrow ones judge them.
            (tilted.fit, tilted.map) = (fit, map);
            let wide = if round + 2 < ROUNDS_OF_PERSPECTIVE { GROWING } else { 1.0 };
            let found = self.assign(&tilted, wide * terms.sigma);
            tilted.bits = self.bits(found) - free;
        }
        if tilted.bits <= best.bits {
            let found = self.assign(&best, terms.sigma);
            best.bits = self.bits(found);
            return best;
        }
        tilted
    }

    fn refit(&mut self) -> Option<Fit> {
        self.pairs.clear();
        self.fitted.clear();
        for (&from, &(second, _)) in self.first.iter().zip(&self.matched) {
            let _ = self.fitted.push(second);
            if let Some(&to) = self.second.get(usize::from(second)) {
                let _ = self.pairs.push(WeightedPair { from, to, weight: 1.0 });
            }
        }
        if self.pairs.len() < 4 { None } else { Fit::of(&self.pairs) }
    }

    /// Whether the matches are those that the last fit was made of.
    fn is_settled(&self) -> bool {
        self.matched.iter().map(|m| m.0).eq(self.fitted.iter().copied())
    }

    /// Pairs every first corner with the nearest second one within the gate, one to one. A corner with two about equally
    /// near ones is left out: they decide nothing.
    fn assign(&mut self, candidate: &Candidate, sigma: f32) -> Assigned {
        self.matched.clear();
        self.taken.clear();
        for _ in &self.second {
            let _ = self.taken.push((NONE, 0.0));
        }
        let mut gates = 0.0;
        for (number, &point) in (0_u16..).zip(&self.first) {
            let gate = GATE * sigma * sigma * candidate.fit.variance(point);
            let gate = if gate < WIDEST_GATE { gate } else { WIDEST_GATE };
            gates += gate;
            let (nearest, second) = nearest_two(&self.rightwards, candidate.map.apply(point), gate);
            let clear = nearest.1 <= gate && (second > gate || second > 4.0 * nearest.1);
            let _ = self.matched.push(if clear { nearest } else { (NONE, 0.0) });
            if clear
                && let Some(taken) = self.taken.get_mut(usize::from(nearest.0))
                && (taken.0 == NONE || nearest.1 < taken.1)
            {
                *taken = (number, nearest.1);
            }
        }
        let mut count = 0;
        for (number, matched) in (0_u16..).zip(&mut self.matched) {
            if self.taken.get(usize::from(matched.0)).is_some_and(|taken| taken.0 != number) {
                *matched = (NONE, 0.0);
            }
            count += u32::from(matched.0 != NONE);
        }
        Assigned { count, gates }
    }

    fn bits(&self, Assigned { count, gates }: Assigned) -> f32 {
        let trials = self.first.len().max(1) as u32;
        let chance = core::f32::consts::PI * gates / trials as f32 * self.second.len() as f32 / self.area;
        tail(count, trials, chance)
    }
}

/// How many corners were matched, and the sum of the gates, px².
#[derive(Clone, Copy)]
struct Assigned {
    count: u32,
    gates: f32,
}

/// The nearest place and its squared distance, and the squared distance of the second nearest, of those whose distance along
/// x alone is within the gate: the places are in the order of x. What is beyond is as good as nothing; of equally near ones
/// any is the nearest, since neither is clear.
fn nearest_two(places: &[Numbered], [x, y]: [f32; 2], gate: f32) -> (Match, f32) {
    let (mut nearest, mut second) = ((NONE, f32::MAX), f32::MAX);
    let from = places.partition_point(|(place, _)| {
        let dx = place[0] - x;
        dx < 0.0 && dx * dx > gate
    });
    for &(place, number) in places.iter().skip(from) {
        let (dx, dy) = (place[0] - x, place[1] - y);
        if dx > 0.0 && dx * dx > gate {
            break;
        }
        let distance = dx * dx + dy * dy;
        if distance < nearest.1 {
            second = nearest.1;
            nearest = (number, distance);
        } else if distance < second {
            second = distance;
        }
    }
    (nearest, second)
}

/// Bits of surprise that `count` of `trials` corners find a partner which chance offers each with probability `chance`:
/// `trials KL(count / trials || chance)`, Chernoff's bound of the binomial tail. 0 up to the expected count.
fn tail(count: u32, trials: u32, chance: f32) -> f32 {
    let (n, m) = (f64::from(count), f64::from(trials));
    let p = if chance < 0.9 { f64::from(chance) } else { 0.9 };
    if n <= m * p {
        return 0.0;
    }
    let missed = if count < trials { (m - n) * log2((1.0 - n / m) / (1.0 - p)) } else { 0.0 };
    (n * log2(n / (m * p)) + missed) as f32
}

/// Bits of the number of affine maps that join three corners with three others: `C(m, 3) n (n - 1) (n - 2)`.
fn tested_maps(first: usize, second: usize) -> f32 {
    let falling = |n: usize| (n * n.saturating_sub(1) * n.saturating_sub(2)) as f64;
    let maps = falling(first) * falling(second) / 6.0;
    if maps > 1.0 { log2(maps) as f32 } else { 0.0 }
}

/// Area of the box around the places, px², at least 1.
fn bounding_area(places: &[[f32; 2]]) -> f32 {
    let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
    for &[x, y] in places {
        low = [if x < low[0] { x } else { low[0] }, if y < low[1] { y } else { low[1] }];
        high = [if x > high[0] { x } else { high[0] }, if y > high[1] { y } else { high[1] }];
    }
    let area = (high[0] - low[0]) * (high[1] - low[1]);
    if area > 1.0 { area } else { 1.0 }
}

impl<const POINTS: usize> Default for Agreement<POINTS> {
    fn default() -> Self {
        Self::new()
    }
}
