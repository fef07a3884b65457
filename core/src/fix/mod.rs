//! From a pose to a position on Earth: where the observer stands, and how far that can be trusted.
//!
//! **East-north-up.** At a point of the WGS84 ellipsoid: x east, y north, z up along the ellipsoid's normal, metres; a plane, exact
//! in itself ([`geodesy`] goes through Earth-centred coordinates, nothing is linearized). Azimuths, bearings and headings are degrees from
//! north, positive towards east, 0..360.
//!
//! ```text
//!  camera::pose ──────┐ model frame          resection  bearings to buildings without models
//!  camera::direction ─┼─> site ──> Fix ──┬─> agreement  which fixes contradict the others
//!  a name alone ──────┘ (WGS84)          └─> track      an observer who stands or walks
//! ```

pub mod agreement;
pub mod ellipse;
pub mod geodesy;
pub mod prior;
pub mod resection;
pub mod site;
pub mod track;
mod plane;

pub use ellipse::Ellipse;
pub use geodesy::{LocalFrame, Wgs84};
pub use prior::Prior;
pub use site::Site;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Degrees or metres, as the field's name says.
    pub value: f64,
    /// Standard deviation, in the same unit.
    pub deviation: f64,
}

/// What a fix rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Evidence {
    /// Corners with known places and a known lens.
    Corners {
        /// Correspondences that agree.
        inliers: usize,
        /// All of them.
        points: usize,
        /// Root mean square residual of those that agree, pixels.
        residual_px: f64,
        /// See [`crate::camera::pose::Pose::log2_chance`].
        log2_chance: f64,
    },
    /// Corners with known places, and a lens that is only known to be one.
    CornersWithoutLens {
        /// Nearest and farthest distance, metres.
        range_m: [f64; 2],
    },
    /// Directions to landmarks.
    Bearings {
        /// How many.
        landmarks: usize,
    },
    /// A landmark is seen; nothing more is known.
    NearLandmark {
        /// From how far at most, metres.
        reach_m: f64,
    },
    /// Several fixes together.
    Fixes {
        /// How many.
        count: usize,
    },
}

/// Where the observer stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// The observer: the camera's centre of projection.
    pub position: Wgs84,
    /// Covariance of the position, east-north-up, m².
    pub covariance: [[f64; 3]; 3],
    /// From the observer to the landmark, degrees.
    pub bearing_deg: Option<Measured>,
    /// From the observer to the landmark along the ground, metres.
    pub range_m: Option<Measured>,
    /// Where the camera's axis points, degrees. None when it looks straight up or down.
    pub heading_deg: Option<Measured>,
    /// What it rests on.
    pub evidence: Evidence,
}

impl Fix {
    /// The ellipse on the ground that holds the truth with 95 %.
    pub fn ellipse(&self) -> Ellipse {
        let [[ee, en, _], [_, nn, _], _] = self.covariance;
        Ellipse::of_covariance([[ee, en], [en, nn]])
    }

    /// Standard deviation of the altitude, metres.
    pub fn altitude_deviation(&self) -> f64 {
        crate::math::sqrt_f64(self.covariance[2][2])
    }
}
