//! Where the observer is, as far as that is known.

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
    /// From where corners of the landmark, whose places are known, appear in the frame.
    Pose,
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
    /// Somewhere around a landmark that can be recognized from `reach_m` metres at most.
    ///
    /// The observer may be anywhere in a disc around the landmark, whose radius `R` is the reach and the error of the
    /// landmark's own position. Along each axis the standard deviation of a uniform disc is `R / 2`.
    pub fn near(landmark: &Position, reach_m: f64) -> Self {
        Self {
            method: FixMethod::NearLandmark,
            latitude_deg: landmark.latitude_deg,
            longitude_deg: landmark.longitude_deg,
            altitude_m: None,
            error: ErrorEllipse::circle(f64::midpoint(landmark.error_m, reach_m)),
            bearing_deg: None,
            range_m: None,
            heading_deg: None,
        }
    }
}
