//! Exact geometry of image points: orientation, convex hulls, nested hulls.
//!
//! ```text
//!  points ── predicate   which way three points turn, and their area
//!     │      key         each point as one number, sorted once
//!     ├───── hull        the convex hull of a set
//!     └───── layers      hulls within hulls until the points are exhausted
//! ```
//!
//! Everything here is integer arithmetic on [`ImagePoint`](crate::point::ImagePoint)s: no rounding, no tolerance. Points
//! are named by their number in the caller's slice. A hull has strict vertices only, begins at the least point in the
//! order of (x, y) and goes clockwise as seen on the screen; of points at the same place the lowest number stands for
//! all. Sets without area (nothing, one place, a line) are answers with a name of their own.

pub mod predicate;
pub mod error;
mod sort;
mod key;
mod chain;
mod fence;
pub mod hull;
pub mod layers;

pub use error::GeometryError;
pub use hull::{ConvexHull, Hull};
pub use layers::{HullLayers, Remainder};
pub use predicate::{COORDINATE_LIMIT, Orientation, orientation, twice_area};
