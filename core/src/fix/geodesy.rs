//! WGS84 and the east-north-up frame of a place, through Earth-centred coordinates.
//!
//! Exact up to rounding (below a micrometre within 10 km) at every latitude: no flat-Earth approximation. `sin`, `cos` and `atan2` are
//! `libm`'s.

use super::plane::DEGREE;
use crate::camera::space::{Matrix, Vector, apply, apply_transposed, minus, plus};
use crate::math::{atan2, sin_cos, sqrt_f64};

/// Semi-major axis of WGS84, metres.
pub const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of WGS84.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// Squared eccentricity.
const SQUARED_ECCENTRICITY: f64 = FLATTENING * (2.0 - FLATTENING);
/// Rounds of Bowring's formula: the first is good to a nanometre near the ground.
const ROUNDS: usize = 3;

/// A position on or above the WGS84 ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wgs84 {
    /// Degrees north.
    pub latitude_deg: f64,
    /// Degrees east.
    pub longitude_deg: f64,
    /// Metres above the ellipsoid (not above the sea).
    pub altitude_m: f64,
}

impl Wgs84 {
    /// `None` unless the latitude is within 90 degrees, the longitude within 180, and all is finite.
    pub fn new(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Option<Self> {
        let sound = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 && altitude_m.is_finite();
        sound.then_some(Self { latitude_deg, longitude_deg, altitude_m })
    }

    /// Earth-centred, Earth-fixed coordinates, metres.
    pub fn earth_centred(&self) -> [f64; 3] {
        let (sin, cos) = sin_cos(self.latitude_deg * DEGREE);
        let (sin_l, cos_l) = sin_cos(self.longitude_deg * DEGREE);
        let normal = SEMI_MAJOR_M / sqrt_f64(1.0 - SQUARED_ECCENTRICITY * sin * sin);
        let across = (normal + self.altitude_m) * cos;
        [across * cos_l, across * sin_l, (normal * (1.0 - SQUARED_ECCENTRICITY) + self.altitude_m) * sin]
    }

    /// From Earth-centred coordinates (B. Bowring, *Transformation from spatial to geographical coordinates*, Survey Review
    /// 23, 1976). Not for places near Earth's centre.
    pub fn from_earth_centred([x, y, z]: [f64; 3]) -> Self {
        let across = sqrt_f64(x * x + y * y);
        let semi_minor = SEMI_MAJOR_M * (1.0 - FLATTENING);
        let second = SQUARED_ECCENTRICITY / (1.0 - SQUARED_ECCENTRICITY);
        let mut reduced = atan2(z, across * (1.0 - FLATTENING));
        let mut latitude = 0.0;
        for _ in 0..ROUNDS {
            let (sin, cos) = sin_cos(reduced);
            latitude = atan2(
                z + second * semi_minor * sin * sin * sin,
                across - SQUARED_ECCENTRICITY * SEMI_MAJOR_M * cos * cos * cos,
            );
            let (sin, cos) = sin_cos(latitude);
            reduced = atan2((1.0 - FLATTENING) * sin, cos);
        }
        let (sin, cos) = sin_cos(latitude);
        let altitude_m = across * cos + z * sin - SEMI_MAJOR_M * sqrt_f64(1.0 - SQUARED_ECCENTRICITY * sin * sin);
        Self { latitude_deg: latitude / DEGREE, longitude_deg: atan2(y, x) / DEGREE, altitude_m }
    }
}

/// The east-north-up frame of a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    origin: Wgs84,
    earth_centred: Vector,
    local_from_earth: Matrix,
}

impl LocalFrame {
    /// At this place.
    pub fn new(origin: Wgs84) -> Self {
        let (sin, cos) = sin_cos(origin.latitude_deg * DEGREE);
        let (sin_l, cos_l) = sin_cos(origin.longitude_deg * DEGREE);
        let local_from_earth =
            [[-sin_l, cos_l, 0.0], [-sin * cos_l, -sin * sin_l, cos], [cos * cos_l, cos * sin_l, sin]];
        Self { origin, earth_centred: origin.earth_centred(), local_from_earth }
    }

    /// Its origin.
    pub const fn origin(&self) -> Wgs84 {
        self.origin
    }

    /// East, north and up of a place, metres.
    pub fn local_from_wgs84(&self, place: Wgs84) -> [f64; 3] {
        apply(&self.local_from_earth, minus(place.earth_centred(), self.earth_centred))
    }

    /// The place east, north and up of the origin.
    pub fn wgs84_from_local(&self, local: [f64; 3]) -> Wgs84 {
        Wgs84::from_earth_centred(plus(apply_transposed(&self.local_from_earth, local), self.earth_centred))
    }
}
