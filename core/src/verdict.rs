//! The answer: which building, how likely that is false, or why there is none.
//!
//! The evidence of a *wrong* view has an exponential tail, `P(evidence > t) = exp(-(t - a) / b)`, with `a` and `b`
//! measured for each profile ([`Calibration`]). The best of `n` wrong views exceeds `t` with at most `n` times that
//! probability (union bound), which is the probability of a false answer. It is linear in the evidence, so it is kept
//! as an integer logarithm.

use crate::evidence::EVIDENCE_UNIT;
use crate::matcher::ViewMatch;
use crate::math::{exp2, log2_q8};
use crate::profile::Profile;

/// Frames with fewer corners are not compared with anything.
pub const LEAST_CORNERS: usize = 16;
/// A runner-up that passes too and is within this much evidence makes the answer ambiguous: 10 bits.
const AMBIGUOUS_WITHIN: i32 = 10 * EVIDENCE_UNIT;

/// The tail of the evidence of wrong views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Calibration {
    /// `a` in 1/160 bit: the evidence beyond which the tail is exponential.
    pub location: i32,
    /// `b` in 1/160 bit: the evidence that makes a wrong view e times rarer.
    pub scale: i32,
}

impl Calibration {
    /// The calibration of a profile's views, as `cargo run --release --example calibrate` fits it to pairs of pictures
    /// of different buildings.
    pub const fn of(profile: Profile) -> Self {
        match profile {
            Profile::Handheld => Self { location: 2_258, scale: 536 },
            Profile::Board => Self { location: 5_959, scale: 2_096 },
        }
    }

    /// The probability that the best of `views` wrong views reaches this evidence, at most 1.
    pub fn false_answer(self, evidence: i32, views: u32) -> FalseAnswer {
        /// log2(e) in Q16.
        const LOG2_E: i64 = 94_548;
        let beyond = i64::from(evidence) - i64::from(self.location);
        let exponent = beyond * LOG2_E / (i64::from(self.scale.max(1)) << 8);
        let log2 = i64::from(log2_q8(views)) - exponent;
        FalseAnswer { log2_q8: log2.clamp(-(1 << 20), 0) as i32 }
    }
}

/// A probability of a false answer, kept as `log2 p` in 1/256.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FalseAnswer {
    log2_q8: i32,
}

impl FalseAnswer {
    /// Certainly false.
    pub const CERTAIN: Self = Self { log2_q8: 0 };
    /// One in a hundred, the default limit.
    pub const ONE_PERCENT: Self = Self { log2_q8: -1_701 };

    /// The largest representable probability that is not above `probability`; 1 for 1 and more, and for NaN.
    pub fn at_most(probability: f64) -> Self {
        if !(probability < 1.0) {
            return Self::CERTAIN;
        }
        let log2 = crate::math::floor(crate::math::log2(probability) * 256.0);
        Self { log2_q8: log2.clamp(-f64::from(1 << 20), 0.0) as i32 }
    }

    /// `-log2 p` in 1/160 bit, as evidence is counted; 0 for a certainly false answer.
    pub const fn surprise(self) -> i32 {
        // 160 / 256; at most 2^20 * 5 fits.
        -self.log2_q8 * 5 / 8
    }

    /// The probability `2^-surprise`, with the surprise in 1/160 bit; 1 for a surprise of 0 and less.
    pub const fn of_surprise(surprise: i32) -> Self {
        let log2 = -(surprise as i64) * 8 / 5;
        if log2 > 0 {
            Self::CERTAIN
        } else if log2 < -(1 << 20) {
            Self { log2_q8: -(1 << 20) }
        } else {
            Self { log2_q8: log2 as i32 }
        }
    }

    /// The probability, 0..=1.
    pub fn probability(self) -> f64 {
        exp2(f64::from(self.log2_q8) / 256.0)
    }
}

/// The best view of one landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Number of the landmark in the table.
    pub landmark: u32,
    /// Number of the view in the table.
    pub view: u32,
    /// How the view fits the frame.
    pub matched: ViewMatch,
    /// The probability that an answer on this evidence is false.
    pub false_answer: FalseAnswer,
}

/// What the frame shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// This landmark, with the stated probability of being false.
    Known(Answer),
    /// A building of the table, but two of them fit about equally well.
    Ambiguous(Answer, Answer),
    /// No answer, and why.
    Unknown(NoAnswer),
}

/// Why there is no answer. Not an error: this is what a camera sees most of the time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NoAnswer {
    /// The table has no views.
    EmptyTable,
    /// The frame is too dark, too blurred or too empty.
    TooFewCorners {
        /// Corners in the frame.
        found: usize,
        /// Corners that a comparison needs.
        needed: usize,
    },
    /// No stored view fits in any place.
    NothingFits,
    /// The best view may well fit by chance.
    NotSure(Answer),
}

/// The verdict on one frame with the two best landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recognition {
    /// The answer.
    pub verdict: Verdict,
    /// The landmark with the most evidence, answer or not.
    pub best: Option<Answer>,
    /// The landmark after it.
    pub runner_up: Option<Answer>,
    /// Views that the frame was compared with.
    pub views: u32,
    /// Corners of the frame.
    pub corners: usize,
}

impl Recognition {
    /// The same with other numbers of views: `view` takes a number to the table's, for a search among
    /// [selected ones](crate::table::SelectedViews).
    #[must_use]
    pub fn renumbered(self, view: impl Fn(u32) -> u32) -> Self {
        let new = |answer: Answer| Answer { view: view(answer.view), ..answer };
        let verdict = match self.verdict {
            Verdict::Known(answer) => Verdict::Known(new(answer)),
            Verdict::Ambiguous(one, other) => Verdict::Ambiguous(new(one), new(other)),
            Verdict::Unknown(NoAnswer::NotSure(answer)) => Verdict::Unknown(NoAnswer::NotSure(new(answer))),
            Verdict::Unknown(why) => Verdict::Unknown(why),
        };
        Self { verdict, best: self.best.map(new), runner_up: self.runner_up.map(new), ..self }
    }
}

/// The best two landmarks so far; of equal evidence the first stays.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ranking {
    best: Option<Entry>,
    runner_up: Option<Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    landmark: u32,
    view: u32,
    matched: ViewMatch,
}

impl Ranking {
    /// Enters the match of a view. A landmark counts by its best view.
    pub fn enter(&mut self, landmark: u32, view: u32, matched: ViewMatch) {
        let new = Entry { landmark, view, matched };
        let beats = |other: &Option<Entry>| other.is_none_or(|other| matched.evidence > other.matched.evidence);
        if beats(&self.best) {
            if self.best.is_some_and(|best| best.landmark != landmark) {
                self.runner_up = self.best;
            }
            self.best = Some(new);
        } else if self.best.is_some_and(|best| best.landmark != landmark) && beats(&self.runner_up) {
            self.runner_up = Some(new);
        }
    }

    /// The verdict after `views` views, for a frame of `corners` corners; known if false with at most `limit`.
    pub fn judge(&self, calibration: Calibration, views: u32, corners: usize, limit: FalseAnswer) -> Recognition {
        let answer = |entry: Entry| Answer {
            landmark: entry.landmark,
            view: entry.view,
            matched: entry.matched,
            false_answer: calibration.false_answer(entry.matched.evidence, views),
        };
        let (best, runner_up) = (self.best.map(answer), self.runner_up.map(answer));
        let passes = |answer: &Answer| answer.false_answer <= limit;
        let verdict = match best {
            _ if corners < LEAST_CORNERS => {
                Verdict::Unknown(NoAnswer::TooFewCorners { found: corners, needed: LEAST_CORNERS })
            }
            _ if views == 0 => Verdict::Unknown(NoAnswer::EmptyTable),
            None => Verdict::Unknown(NoAnswer::NothingFits),
            Some(best) if !passes(&best) => Verdict::Unknown(NoAnswer::NotSure(best)),
            Some(best) => {
                let close =
                    |other: &Answer| best.matched.evidence.saturating_sub(other.matched.evidence) < AMBIGUOUS_WITHIN;
                match runner_up.filter(|other| passes(other) && close(other)) {
                    Some(other) => Verdict::Ambiguous(best, other),
                    None => Verdict::Known(best),
                }
            }
        };
        Recognition { verdict, best, runner_up, views, corners }
    }
}
