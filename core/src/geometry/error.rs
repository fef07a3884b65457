//! What hulls refuse: the caller's points, or more of them than there is room for.

use core::fmt;

use super::predicate::COORDINATE_LIMIT;

/// Why a set of points has no hull, or no layers. Nothing is held afterwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GeometryError {
    /// A point lies beyond [`COORDINATE_LIMIT`]. Leave out points that are so far from the image.
    CoordinateOutOfRange {
        /// The first such point.
        point: usize,
        /// Its coordinate, x if both are too large, in 1/16 px.
        found: i32,
        /// The largest magnitude allowed, in 1/16 px.
        limit: i32,
    },
    /// More points than the storage was made for. Choose a larger `POINTS`, or give fewer.
    TooManyPoints {
        /// How many there are.
        found: usize,
        /// How many there is room for.
        capacity: usize,
    },
    /// The points have more layers than the storage was made for. Choose a larger `LAYERS`; a third of `POINTS` is
    /// always enough.
    TooManyLayers {
        /// How many there is room for.
        capacity: usize,
        /// Points within the innermost layer that had room, not counting those at the same place as another.
        points_left: usize,
    },
}

impl fmt::Display for GeometryError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::CoordinateOutOfRange { point, found, limit } => write!(
                out,
                "point {point} has a coordinate of {found} sixteenths of a pixel, the limit is {limit}: leave it out"
            ),
            Self::TooManyPoints { found, capacity } => {
                write!(out, "{found} points were given, there is room for {capacity}: give fewer, or make more room")
            }
            Self::TooManyLayers { capacity, points_left } => write!(
                out,
                "the points have more than {capacity} hull layers, {points_left} points are left within: make room for more"
            ),
        }
    }
}

impl core::error::Error for GeometryError {}

impl GeometryError {
    pub(super) const fn out_of_range(point: usize, found: i32) -> Self {
        Self::CoordinateOutOfRange { point, found, limit: COORDINATE_LIMIT }
    }
}
