//! Where the observer is, as far as that is known.

use daymark_core::fix::ellipse::DEVIATIONS_95;
use daymark_core::fix::{self, Evidence};
use serde::Serialize;

use crate::report::finding::Position;

/// Where the observer is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fix {
    /// How it was found.
    pub method: FixMethod,
    /// Degrees north, WGS84.
    pub latitude_deg: f64,
    /// Degrees east, WGS84.
    pub longitude_deg: f64,
    /// Metres above the ellipsoid.
    pub altitude_m: Option<f64>,
    /// How sure the position is.
    pub error: ErrorEllipse,
    /// The circle that holds the truth with 95 %.
    pub radius_95_m: f64,
    /// From the observer to the landmark, degrees from north, positive towards east.
    pub bearing_deg: Option<f64>,
    /// From the observer to the landmark, along the ground.
    pub range_m: Option<f64>,
    /// Where the camera's axis points, degrees from north, positive towards east.
    pub heading_deg: Option<f64>,
}

/// How a fix was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FixMethod {
    /// The landmark is seen, so the observer is near it; nothing more is known.
    NearLandmark,
    /// The side from which the landmark is seen, and an interval of distances: the lens is not known.
    Direction,
    /// From where corners of the landmark, whose places are known, appear in the frame.
    Pose,
}

impl FixMethod {
    /// The method in words.
    pub const fn phrase(self) -> &'static str {
        match self {
            Self::NearLandmark => "it is seen, so it is near",
            Self::Direction => "by the side that is seen; the distance is coarse, because the lens is not known",
            Self::Pose => "by where its corners are seen",
        }
    }
}

/// The ellipse of one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEllipse {
    /// Its longer half axis.
    pub semi_major_m: f64,
    /// Its shorter half axis.
    pub semi_minor_m: f64,
    /// Direction of the longer one, degrees from north, positive towards east.
    pub orientation_deg: f64,
}

impl ErrorEllipse {
    /// A circle.
    pub const fn circle(standard_deviation_m: f64) -> Self {
        Self { semi_major_m: standard_deviation_m, semi_minor_m: standard_deviation_m, orientation_deg: 0.0 }
    }
}

impl Fix {
    /// A fix of core, for the world. Heights count from the landmark's foot, whose altitude no table knows, so there is none.
    pub fn of(fix: &fix::Fix) -> Self {
        let ellipse = fix.ellipse();
        Self {
            method: match fix.evidence {
                Evidence::Corners { .. } => FixMethod::Pose,
                Evidence::CornersWithoutLens { .. } => FixMethod::Direction,
                _ => FixMethod::NearLandmark,
            },
            latitude_deg: fix.position.latitude_deg,
            longitude_deg: fix.position.longitude_deg,
            altitude_m: None,
            error: ErrorEllipse {
                semi_major_m: ellipse.semi_major_m / DEVIATIONS_95,
                semi_minor_m: ellipse.semi_minor_m / DEVIATIONS_95,
                orientation_deg: ellipse.orientation_deg,
            },
            radius_95_m: ellipse.radius(),
            bearing_deg: fix.bearing_deg.map(|bearing| bearing.value),
            range_m: fix.range_m.map(|range| range.value),
            heading_deg: fix.heading_deg.map(|heading| heading.value),
        }
    }

    /// Somewhere around a landmark that can be recognized from `reach_m` metres at most.
    ///
    /// The observer may be anywhere in a disc around the landmark, whose radius `R` is the reach and the error of the
    /// landmark's own position. Along each axis the standard deviation of a uniform disc is `R / 2`.
    pub fn near(landmark: &Position, reach_m: f64) -> Self {
        let deviation = f64::midpoint(landmark.error_m, reach_m);
        Self {
            method: FixMethod::NearLandmark,
            latitude_deg: landmark.latitude_deg,
            longitude_deg: landmark.longitude_deg,
            altitude_m: None,
            error: ErrorEllipse::circle(deviation),
            radius_95_m: deviation * DEVIATIONS_95,
            bearing_deg: None,
            range_m: None,
            heading_deg: None,
        }
    }
}
