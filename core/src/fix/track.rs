//! An observer who stands or walks: fixes over time, filtered.
//!
//! A Kalman filter for a position that moves at random: between fixes its covariance grows by `speed^2 t^2` on the ground (a walker may go
//! anywhere with up to that speed) and by a tenth of that deviation upwards. A fix that contradicts the position (chi-square, 99.9 %) is left
//! out and said to be; but if three more fixes that were left out agree with each other than fixes in between agreed with the track, the track was
//! wrong and goes over to them.

use super::agreement::inverse;
use super::geodesy::{LocalFrame, Wgs84};
use super::{Evidence, Fix};
use crate::camera::space::{Matrix, Vector, apply, dot, minus, plus, product};

/// 99.9 % of chi-square with three degrees of freedom.
const GATE: f64 = 16.266_236_196_238_13;
/// So many contradicting fixes that agree with each other, less those in between that agree with the track, outweigh it.
const OUTVOTED: u32 = 3;
/// Upward motion, as a share of that on the ground.
const UPWARD: f64 = 0.1;

#[derive(Debug, Clone, Copy, PartialEq)]
struct State {
    at: Vector,
    covariance: Matrix,
    time_s: f64,
    fixes: u32,
}

/// What became of a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Update {
    /// It is part of the position now.
    Taken {
        /// Squared deviations from what was expected.
        chi_square: f64,
    },
    /// It contradicts the position and was left out.
    LeftOut {
        /// Squared deviations from what was expected.
        chi_square: f64,
        /// Metres between them.
        apart_m: f64,
    },
    /// It contradicts the position as others before it did, with which it agrees: the track has gone over to them.
    Outvoted {
        /// Fixes that the track rests on now.
        fixes: u32,
    },
    /// Its covariance or time cannot be used: not finite, or earlier than the fix before.
    Unusable,
}

/// The filtered position of one observer.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    frame: Option<LocalFrame>,
    speed_m_s: f64,
    state: Option<State>,
    challenger: Option<State>,
}

impl Track {
    /// An observer who moves with up to about this speed (one deviation), metres a second; 0 for one who stands.
    pub const fn new(speed_m_s: f64) -> Self {
        Self { frame: None, speed_m_s, state: None, challenger: None }
    }

    /// Takes in a fix at a time in seconds.
    pub fn update(&mut self, fix: &Fix, time_s: f64) -> Update {
        let frame = *self.frame.get_or_insert_with(|| LocalFrame::new(fix.position));
        let new = State { at: frame.local_from_wgs84(fix.position), covariance: fix.covariance, time_s, fixes: 1 };
        let late = self.state.is_some_and(|state| !(time_s >= state.time_s));
        if late || !time_s.is_finite() || inverse(&fix.covariance).is_none() || !dot(new.at, new.at).is_finite() {
            return Update::Unusable;
        }
        let Some(state) = self.state.map(|state| self.later(state, time_s)) else {
            self.state = Some(new);
            return Update::Taken { chi_square: 0.0 };
        };
        let Some((merged, chi_square)) = merged(&state, &new) else { return Update::Unusable };
        if chi_square <= GATE {
            self.state = Some(merged);
            // Every fix that agrees with the track speaks against the challenger.
            self.challenger =
                self.challenger.filter(|one| one.fixes > 1).map(|one| State { fixes: one.fixes - 1, ..one });
            return Update::Taken { chi_square };
        }
        let challenger = self.challenger.map(|challenger| self.later(challenger, time_s));
        let together = challenger.and_then(|challenger| merged_within(&challenger, &new)).unwrap_or(new);
        if together.fixes >= OUTVOTED {
            self.state = Some(together);
            self.challenger = None;
            return Update::Outvoted { fixes: together.fixes };
        }
        self.challenger = Some(together);
        let off = minus(new.at, state.at);
        Update::LeftOut { chi_square, apart_m: crate::camera::space::length(off) }
    }

    /// A state some time later.
    fn later(&self, state: State, time_s: f64) -> State {
        let way = self.speed_m_s * (time_s - state.time_s).max(0.0);
        let mut covariance = state.covariance;
        covariance[0][0] += way * way;
        covariance[1][1] += way * way;
        covariance[2][2] += UPWARD * UPWARD * way * way;
        State { covariance, time_s, ..state }
    }

    /// The position at a time, as a fix; `None` before the first.
    pub fn fix(&self, time_s: f64) -> Option<Fix> {
        let (frame, state) = (self.frame?, self.later(self.state?, time_s));
        Some(Fix {
            position: frame.wgs84_from_local(state.at),
            covariance: state.covariance,
            bearing_deg: None,
            range_m: None,
            heading_deg: None,
            evidence: Evidence::Fixes { count: state.fixes as usize },
        })
    }

    /// Where the observer was at the last fix.
    pub fn position(&self) -> Option<Wgs84> {
        Some(self.frame?.wgs84_from_local(self.state?.at))
    }
}

fn merged_within(one: &State, two: &State) -> Option<State> {
    merged(one, two).filter(|(_, chi_square)| *chi_square <= GATE).map(|(state, _)| state)
}

/// The Kalman update, with the squared deviations of the fix from the state. Joseph's form, which stays symmetric and positive.
fn merged(state: &State, fix: &State) -> Option<(State, f64)> {
    let sum = add(&state.covariance, &fix.covariance);
    let inverse = inverse(&sum)?;
    let off = minus(fix.at, state.at);
    let chi_square = dot(off, apply(&inverse, off));
    let gain = product(&state.covariance, &inverse);
    let mut rest = gain.map(|row| row.map(|entry| -entry));
    for (number, row) in rest.iter_mut().enumerate() {
        *row.get_mut(number)? += 1.0;
    }
    let transposed = crate::camera::space::transposed;
    let old = product(&product(&rest, &state.covariance), &transposed(&rest));
    let new = product(&product(&gain, &fix.covariance), &transposed(&gain));
    let merged = State {
        at: plus(state.at, apply(&gain, off)),
        covariance: add(&old, &new),
        time_s: fix.time_s,
        fixes: state.fixes.saturating_add(fix.fixes),
    };
    (chi_square >= 0.0).then_some((merged, chi_square))
}

fn add(a: &Matrix, b: &Matrix) -> Matrix {
    [plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])]
}
