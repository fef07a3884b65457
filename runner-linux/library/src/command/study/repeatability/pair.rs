//! Two pictures with their corners and the truth about them, and what each way of matching makes of them.

use daymark_core::geometry::GeometryError;
use daymark_core::geometry::correspond::Sources;
use daymark_core::geometry::proposal::Pairing;
use daymark_core::geometry::quad::Tolerance;
use daymark_core::point::ImagePoint;
use serde::Serialize;

use crate::correspond::matching::{Matcher, Proposed, Rule};

/// A corner is found again, and a match right, within so many pixels of a picture 640 px long.
pub(super) const TOLERANCE_PX: f64 = 2.0;

/// Where a corner of the first picture lies in the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Whereabouts {
    /// Here, px.
    At([f64; 2]),
    /// Not in it: hidden, outside, or sky.
    Hidden,
    /// The truth does not say: matches of it are not counted.
    Unknown,
}

/// What is known about a pair of pictures.
#[derive(Debug, Clone)]
pub(super) enum Truth {
    /// Of each corner of the first picture where it lies in the second.
    Places(Vec<Whereabouts>),
    /// The fundamental matrix `x2^T F x1 = 0`: a necessary condition only.
    Epipolar([[f64; 3]; 3]),
}

/// Two pictures.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    /// The corners as they are matched.
    pub corners: [Vec<ImagePoint>; 2],
    /// Where the second picture's corners were found, before noise was added.
    pub undisturbed: Vec<ImagePoint>,
    /// Area of the second picture, px².
    pub area: f64,
    /// The truth, for the first picture's corners in their order.
    pub truth: Truth,
    /// Where the first picture's corners were found.
    pub first_undisturbed: Vec<ImagePoint>,
    /// Noise that the matcher is told, px.
    pub noise_px: f32,
}

/// Ways of matching, in the order of the columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// The thesis' rule.
    PlainHulls,
    /// Quads of hulls that the noise allows, verified.
    TolerantHulls,
    /// Local arrangements, verified.
    Arrangements,
    /// Both, verified.
    Both,
}

impl Method {
    pub(super) const ALL: [Self; 4] = [Self::PlainHulls, Self::TolerantHulls, Self::Arrangements, Self::Both];

    fn rule(self, noise_px: f32) -> Rule {
        let sources = match self {
            Self::PlainHulls => return Rule::Plain { epsilon: Tolerance::FIVE_PERCENT },
            Self::TolerantHulls => Sources::Layers,
            Self::Arrangements => Sources::Arrangements,
            Self::Both => Sources::Both,
        };
        Rule::Tolerant { sources, noise_px }
    }
}

/// Sums of one method over pairs of pictures.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MethodTally {
    /// Pairs of pictures with an answer.
    pub answered: usize,
    /// Matches whose truth is known.
    pub matches: usize,
    /// Right ones.
    pub right: usize,
    /// Pairs of pictures of which a proposal was right in all its corners.
    pub proposed: usize,
}

/// Sums over pairs of pictures.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    /// Pairs of pictures.
    pub pairs: usize,
    /// Corners of the first pictures.
    pub corners: usize,
    /// Those whose place in the second picture is known.
    pub common: usize,
    /// Those that have a corner there.
    pub repeated: usize,
    /// Pairs of corners, and how many of them would count as right: what chance gives.
    pub chance: [usize; 2],
    /// Each method.
    pub methods: [MethodTally; 4],
}

impl Tally {
    pub(super) fn add(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.corners += other.corners;
        self.common += other.common;
        self.repeated += other.repeated;
        self.chance = [0, 1].map(|i: usize| self.chance[i] + other.chance[i]);
        for (sum, one) in self.methods.iter_mut().zip(&other.methods) {
            sum.answered += one.answered;
            sum.matches += one.matches;
            sum.right += one.right;
            sum.proposed += one.proposed;
        }
    }
}

pub(super) fn pixels(point: ImagePoint) -> [f64; 2] {
    point.to_pixels().map(f64::from)
}

fn near(a: [f64; 2], b: [f64; 2]) -> bool {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    x * x + y * y <= TOLERANCE_PX * TOLERANCE_PX
}

impl Pair {
    /// Whether a match is right; `None` if the truth does not say.
    fn is_right(&self, pair: Pairing) -> Option<bool> {
        let second = pixels(*self.undisturbed.get(usize::from(pair.second))?);
        match &self.truth {
            Truth::Places(places) => match places.get(usize::from(pair.first))? {
                Whereabouts::At(place) => Some(near(*place, second)),
                Whereabouts::Hidden => Some(false),
                Whereabouts::Unknown => None,
            },
            Truth::Epipolar(matrix) => {
                let first = pixels(*self.first_undisturbed.get(usize::from(pair.first))?);
                Some(epipolar_distance(matrix, first, second) <= TOLERANCE_PX)
            }
        }
    }

    /// What each method makes of the pair.
    ///
    /// # Errors
    /// More corners than can be matched.
    pub(super) fn tally(&self, matcher: &mut Matcher) -> Result<Tally, GeometryError> {
        let mut tally = Tally { pairs: 1, corners: self.corners[0].len(), ..Tally::default() };
        if let Truth::Places(places) = &self.truth {
            for place in places {
                let Whereabouts::At(place) = place else { continue };
                tally.common += 1;
                tally.repeated += usize::from(self.corners[1].iter().any(|&corner| near(*place, pixels(corner))));
            }
        }
        for first in 0..self.corners[0].len() {
            for second in 0..self.corners[1].len() {
                if let Some(right) = self.is_right(Pairing { first: first as u16, second: second as u16 }) {
                    tally.chance[0] += 1;
                    tally.chance[1] += usize::from(right);
                }
            }
        }
        for (method, sum) in Method::ALL.into_iter().zip(&mut tally.methods) {
            let [first, second] = &self.corners;
            let matching = matcher.places(first, second, self.area, method.rule(self.noise_px))?;
            sum.answered = usize::from(!matching.pairs.is_empty());
            for right in matching.pairs.iter().filter_map(|matched| self.is_right(matched.pair)) {
                sum.matches += 1;
                sum.right += usize::from(right);
            }
            let proposals = |proposed: &Proposed| {
                proposed
                    .kept
                    .iter()
                    .any(|proposal| proposal.pairs.iter().all(|&pair| self.is_right(pair) == Some(true)))
            };
            sum.proposed = usize::from(proposals(&matching.from_layers) || proposals(&matching.from_arrangements));
        }
        Ok(tally)
    }
}

/// The larger of the distances of each point from the line of the other, px.
fn epipolar_distance(matrix: &[[f64; 3]; 3], first: [f64; 2], second: [f64; 2]) -> f64 {
    let (p, q) = ([first[0], first[1], 1.0], [second[0], second[1], 1.0]);
    let line = matrix.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
    let back = [0, 1, 2].map(|i: usize| (0..3).map(|row| matrix[row][i] * q[row]).sum::<f64>());
    let product = (line[0] * q[0] + line[1] * q[1] + line[2]).abs();
    let away = |line: [f64; 3]| product / libm::sqrt(line[0] * line[0] + line[1] * line[1]);
    away(line).max(away(back))
}
