//! What is known before the frame: where the observer was last, and what a compass says.

use super::ellipse::DEVIATIONS_95;
use super::geodesy::{LocalFrame, Wgs84};
use super::plane::{difference_deg, mahalanobis};
use super::{Fix, Measured};

/// 99.9 % of chi-square with two degrees of freedom.
const GATE_OF_TWO: f64 = 13.815_510_557_964_274;
/// 99.9 % with one.
const GATE_OF_ONE: f64 = 10.827_566_170_662_733;

/// What is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prior {
    /// Near here.
    pub near: Option<Near>,
    /// The camera's axis points there, by a compass: degrees and their deviation.
    pub heading_deg: Option<Measured>,
}

/// Within a circle, with 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// Its centre.
    pub position: Wgs84,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// A fix contradicts what was known.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Contradiction {
    /// It is too far from where the observer is known to be.
    Position {
        /// Metres between them.
        apart_m: f64,
    },
    /// The camera would point elsewhere.
    Heading {
        /// Degrees between them.
        apart_deg: f64,
    },
}

impl Prior {
    /// Whether a fix agrees, at 99.9 %; with the squared deviations by which it is off.
    ///
    /// # Errors
    /// [`Contradiction`].
    pub fn check(&self, fix: &Fix) -> Result<f64, Contradiction> {
        let mut sum = 0.0;
        if let Some(near) = self.near {
            let [east, north, _] = LocalFrame::new(near.position).local_from_wgs84(fix.position);
            let variance = (near.radius_m / DEVIATIONS_95) * (near.radius_m / DEVIATIONS_95);
            let [[ee, en, _], [_, nn, _], _] = fix.covariance;
            let square = mahalanobis([[ee + variance, en], [en, nn + variance]], [east, north]);
            if !(square <= GATE_OF_TWO) {
                return Err(Contradiction::Position { apart_m: super::plane::length([east, north]) });
            }
            sum += square;
        }
        if let (Some(compass), Some(heading)) = (self.heading_deg, fix.heading_deg) {
            let apart = difference_deg(heading.value, compass.value);
            let variance = compass.deviation * compass.deviation + heading.deviation * heading.deviation;
            let square = apart * apart / variance;
            if !(square <= GATE_OF_ONE) {
                return Err(Contradiction::Heading { apart_deg: apart.abs() });
            }
            sum += square;
        }
        Ok(sum)
    }

    /// Of a fix and its rival the one that agrees with what was known; `None` if both do or neither.
    pub fn choose(&self, fix: Fix, rival: Fix) -> Option<Fix> {
        match (self.check(&fix), self.check(&rival)) {
            (Ok(_), Err(_)) => Some(fix),
            (Err(_), Ok(_)) => Some(rival),
            _ => None,
        }
    }
}
