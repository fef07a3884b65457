//! Resection: the observer's place from the directions in which landmarks are seen, whose places are known and whose models are not.
//!
//! Unknown are east, north and the heading of the camera's axis. A direction gives one equation, a known range another, a compass and a last
//! position more; three equations are needed. The equations are solved by Gauss-Newton steps from starts all around the landmarks, because
//! one start may lead to a point from which no step is better. Landmarks with models are better solved from their corners
//! ([`super::Site::point_in`] and [`crate::camera::pose`]).

use super::geodesy::{LocalFrame, Wgs84};
use super::plane::{DEGREE, azimuth_deg, difference_deg, full_turn, length};
use super::prior::Prior;
use super::{Evidence, Fix, Measured};
use crate::linear::NormalEquations;
use crate::math::sqrt_f64;

/// Landmarks, at most.
pub const MOST_LANDMARKS: usize = 16;
/// Starts on each circle around the landmarks' middle.
const AROUND: u32 = 12;
/// Radii of the circles, in deviations of the landmarks' places.
const CIRCLES: [f64; 3] = [0.4, 1.2, 3.0];
const STEPS: usize = 12;
/// 99.9 % of chi-square with 1, 2, 3, ... degrees of freedom.
const CHI_SQUARE: [f64; 6] = [10.828, 13.816, 16.266, 18.467, 20.515, 22.458];
/// Another place that fits nearly as well: likelihoods 1000 to 1.
const RIVAL_WITHIN: f64 = 13.816;
/// Altitude is not observed: its deviation, metres.
const ALTITUDE_DEVIATION_M: f64 = 50.0;
/// Determinacy below which the equations say nothing.
const UNDETERMINED: f64 = 1e-9;

/// A landmark in the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Where the landmark stands.
    pub position: Wgs84,
    /// How well that is known: deviation in each direction, metres.
    pub deviation_m: f64,
    /// Its direction, clockwise from the camera's axis, degrees.
    pub from_axis_deg: Measured,
    /// Its distance along the ground, if its size says.
    pub range_m: Option<Measured>,
}

/// Why there is no place.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NoResection {
    /// Fewer equations than three.
    TooFew {
        /// Equations.
        equations: usize,
    },
    /// More than [`MOST_LANDMARKS`].
    TooMany {
        /// Landmarks.
        found: usize,
    },
    /// The landmarks and the observer lie so that the place is open (on a line, or on one circle).
    Undetermined,
    /// Another place fits as well.
    Ambiguous {
        /// Metres between them.
        apart_m: f64,
    },
    /// The directions contradict each other, and leaving out one does not help or cannot be decided.
    Contradiction {
        /// Squared deviations.
        chi_square: f64,
    },
    /// A number is not finite or a deviation not positive.
    NotFinite,
}

impl core::fmt::Display for NoResection {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFew { equations } => write!(f, "{equations} directions and ranges are known, a place needs three"),
            Self::TooMany { found } => write!(f, "{found} landmarks, there is room for {MOST_LANDMARKS}"),
            Self::Undetermined => {
                f.write_str("the landmarks stand so that the place is open: on a line, or on a circle")
            }
            Self::Ambiguous { apart_m } => write!(f, "a second place fits as well, {apart_m:.0} m away"),
            Self::Contradiction { chi_square } => write!(f, "the directions contradict each other ({chi_square:.1})"),
            Self::NotFinite => f.write_str("a number is not finite, or a deviation not positive"),
        }
    }
}

impl core::error::Error for NoResection {}

/// The place, and the landmark that contradicts the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resection {
    /// Where the observer stands; the altitude is that of the first landmark.
    pub fix: Fix,
    /// The landmark that was left out.
    pub left_out: Option<usize>,
    /// Squared deviations.
    pub chi_square: f64,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    at: [f64; 2],
    heading: f64,
    cost: f64,
}

struct Problem<'a> {
    sightings: &'a [Sighting],
    local: [[f64; 2]; MOST_LANDMARKS],
    prior: [Option<([f64; 2], f64)>; 1],
    compass: Option<Measured>,
    skipped: Option<usize>,
}

/// The place from which the landmarks are seen like this.
///
/// # Errors
/// [`NoResection`].
pub fn resect(sightings: &[Sighting], prior: &Prior) -> Result<Resection, NoResection> {
    let Some(first) = sightings.first() else { return Err(NoResection::TooFew { equations: 0 }) };
    if sightings.len() > MOST_LANDMARKS {
        return Err(NoResection::TooMany { found: sightings.len() });
    }
    let positive =
        |measured: Measured| measured.value.is_finite() && measured.deviation > 0.0 && measured.deviation.is_finite();
    let sound = sightings.iter().all(|one| {
        positive(one.from_axis_deg)
            && one.range_m.is_none_or(positive)
            && one.deviation_m >= 0.0
            && one.deviation_m.is_finite()
    });
    if !sound {
        return Err(NoResection::NotFinite);
    }
    let frame = LocalFrame::new(first.position);
    let mut local = [[0.0; 2]; MOST_LANDMARKS];
    for (place, sighting) in local.iter_mut().zip(sightings) {
        let [east, north, _] = frame.local_from_wgs84(sighting.position);
        *place = [east, north];
    }
    let near = prior.near.map(|near| {
        let [east, north, _] = frame.local_from_wgs84(near.position);
        ([east, north], near.radius_m / super::ellipse::DEVIATIONS_95)
    });
    let mut problem = Problem { sightings, local, prior: [near], compass: prior.heading_deg, skipped: None };
    let equations = problem.equations();
    if equations < 3 {
        return Err(NoResection::TooFew { equations });
    }
    let limit = |free: usize| free.checked_sub(1).map_or(f64::INFINITY, |free| *CHI_SQUARE.get(free).unwrap_or(&27.9));
    let (mut place, mut left_out) = (problem.solve()?, None);
    if place.cost > limit(equations - 3) {
        // Leave out the landmark without which the rest agrees; two that would do leave it open.
        let mut agreeing = None;
        for number in 0..sightings.len() {
            problem.skipped = Some(number);
            let free = problem.equations().saturating_sub(3);
            if free > 0
                && let Ok(other) = problem.solve()
                && other.cost <= limit(free)
            {
                if agreeing.is_some() {
                    return Err(NoResection::Contradiction { chi_square: place.cost });
                }
                agreeing = Some((number, other));
            }
        }
        let Some((number, other)) = agreeing else { return Err(NoResection::Contradiction { chi_square: place.cost }) };
        problem.skipped = Some(number);
        (place, left_out) = (other, Some(number));
    }
    let fix = problem.fix(&place, &frame)?;
    Ok(Resection { fix, left_out, chi_square: place.cost })
}

impl Problem<'_> {
    fn seen(&self) -> impl Iterator<Item = (&Sighting, [f64; 2])> {
        let all = self.sightings.iter().zip(self.local).enumerate();
        all.filter(|(number, _)| Some(*number) != self.skipped).map(|(_, seen)| seen)
    }

    fn equations(&self) -> usize {
        let sightings: usize = self.seen().map(|(one, _)| 1 + usize::from(one.range_m.is_some())).sum();
        sightings + 2 * usize::from(self.prior[0].is_some()) + usize::from(self.compass.is_some())
    }

    /// The best place of all starts, unless another is nearly as good.
    fn solve(&self) -> Result<Place, NoResection> {
        let count = self.seen().count().max(1) as f64;
        let middle = self.seen().fold([0.0; 2], |[x, y], (_, [e, n])| [x + e / count, y + n / count]);
        let spread = self.seen().fold(0.0, |sum, (_, [e, n])| sum + length([e - middle[0], n - middle[1]]) / count);
        let mut best: Option<Place> = None;
        let mut rival: Option<Place> = None;
        let mut enter = |place: Place| match best {
            Some(known) if known.cost <= place.cost => {
                if rival.is_none_or(|rival| place.cost < rival.cost) && apart(&known, &place) > 1e-3 * (1.0 + spread) {
                    rival = Some(place);
                }
            }
            Some(known) => {
                if apart(&known, &place) > 1e-3 * (1.0 + spread) {
                    rival = Some(known);
                }
                best = Some(place);
            }
            None => best = Some(place),
        };
        if let Some((near, _)) = self.prior[0]
            && let Some(place) = self.descend(near)
        {
            enter(place);
        }
        for circle in CIRCLES {
            for step in 0..AROUND {
                let (sin, cos) = crate::math::sin_cos(f64::from(step) * (360.0 / f64::from(AROUND)) * DEGREE);
                let radius = circle * spread.max(20.0);
                if let Some(place) = self.descend([middle[0] + radius * sin, middle[1] + radius * cos]) {
                    enter(place);
                }
            }
        }
        let best = best.ok_or(NoResection::Undetermined)?;
        match rival {
            Some(other) if other.cost - best.cost < RIVAL_WITHIN => {
                Err(NoResection::Ambiguous { apart_m: apart(&best, &other) })
            }
            _ => Ok(best),
        }
    }

    fn descend(&self, start: [f64; 2]) -> Option<Place> {
        let mut place = Place { at: start, heading: self.heading_at(start), cost: 0.0 };
        for _ in 0..STEPS {
            let mut equations = self.normal(&place);
            let &[east, north, turn] = equations.solve()?;
            if !(equations.determinacy() > UNDETERMINED) {
                return None;
            }
            place.at = [place.at[0] + east, place.at[1] + north];
            place.heading += turn;
        }
        place.cost = self.cost(&place);
        (place.cost.is_finite() && place.heading.abs() < 1e6).then_some(place)
    }

    /// The heading that fits a place: the mean of those that the landmarks say, about the first of them.
    fn heading_at(&self, at: [f64; 2]) -> f64 {
        let said = self.seen().map(|(one, [e, n])| azimuth_deg(e - at[0], n - at[1]) - one.from_axis_deg.value);
        let mut first = self.compass.map(|compass| compass.value);
        let (mut sum, mut count) = (0.0, 0.0);
        for heading in said {
            let reference = *first.get_or_insert(heading);
            sum += difference_deg(heading, reference);
            count += 1.0;
        }
        first.unwrap_or(0.0) + if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Every equation: coefficients of (east, north, heading), what is left over, and its variance.
    fn each(&self, place: &Place, mut take: impl FnMut([f64; 3], f64, f64)) {
        for (one, [east, north]) in self.seen() {
            let (e, n) = (east - place.at[0], north - place.at[1]);
            let range = length([e, n]).max(1e-3);
            let of_place = one.deviation_m / range / DEGREE;
            let left = difference_deg(one.from_axis_deg.value, azimuth_deg(e, n) - place.heading);
            let own = one.from_axis_deg.deviation;
            let slope = 1.0 / (range * range * DEGREE);
            take([-n * slope, e * slope, -1.0], left, own * own + of_place * of_place);
            if let Some(measured) = one.range_m {
                let variance = measured.deviation * measured.deviation + one.deviation_m * one.deviation_m;
                take([-e / range, -n / range, 0.0], measured.value - range, variance);
            }
        }
        if let [Some(([east, north], deviation))] = self.prior {
            take([1.0, 0.0, 0.0], east - place.at[0], deviation * deviation);
            take([0.0, 1.0, 0.0], north - place.at[1], deviation * deviation);
        }
        if let Some(compass) = self.compass {
            let left = difference_deg(compass.value, place.heading);
            take([0.0, 0.0, 1.0], left, compass.deviation * compass.deviation);
        }
    }

    fn normal(&self, place: &Place) -> NormalEquations<3> {
        let mut equations = NormalEquations::new();
        self.each(place, |row, left, variance| equations.add(&row, left, 1.0 / variance));
        equations
    }

    fn cost(&self, place: &Place) -> f64 {
        let mut sum = 0.0;
        self.each(place, |_, left, variance| sum += left * left / variance);
        sum
    }

    fn fix(&self, place: &Place, frame: &LocalFrame) -> Result<Fix, NoResection> {
        let mut covariance = [[0.0; 3]; 3];
        for (number, row) in covariance.iter_mut().enumerate() {
            let mut equations = self.normal(place);
            let mut one = [0.0; 3];
            if let Some(entry) = one.get_mut(number) {
                *entry = 1.0;
            }
            equations.set_right(one);
            *row = *equations.solve().ok_or(NoResection::Undetermined)?;
            if !(equations.determinacy() > UNDETERMINED) {
                return Err(NoResection::Undetermined);
            }
        }
        let [[ee, en, _], [_, nn, _], [_, _, turn]] = covariance;
        let up = ALTITUDE_DEVIATION_M * ALTITUDE_DEVIATION_M;
        let ground = frame.wgs84_from_local([place.at[0], place.at[1], 0.0]);
        let altitude_m = frame.origin().altitude_m;
        Ok(Fix {
            position: Wgs84 { altitude_m, ..ground },
            covariance: [[ee, en, 0.0], [en, nn, 0.0], [0.0, 0.0, up]],
            bearing_deg: None,
            range_m: None,
            heading_deg: Some(Measured {
                value: full_turn(difference_deg(place.heading, 0.0)),
                deviation: sqrt_f64(turn),
            }),
            evidence: Evidence::Bearings { landmarks: self.seen().count() },
        })
    }
}

fn apart(one: &Place, two: &Place) -> f64 {
    length([one.at[0] - two.at[0], one.at[1] - two.at[1]])
}
