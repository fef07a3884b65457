//! Which corner of one picture is which corner of another, from their places alone.
//!
//! ```text
//!  points ── predicate   which way three points turn, and their area
//!     │      key         each point as one number, sorted once
//!     ├───── hull        the convex hull of a set
//!     └───── layers      hulls within hulls until the points are exhausted
//!               │
//!  quad: areas of four points, their affine invariants       sorted_areas: the thesis' first order, a baseline
//!  cross_ratio: the perspective invariants of five
//!               │
//!     ┌─ shift          quads of hull vertices in cyclic order
//!     └─ arrangement    corners with their neighbours in angular order
//!               │
//!           proposal    a few pairs that chance hardly explains
//!               │
//!     ┌─ agreement      one map for all, or
//!     └─ consensus ── epipolar   neighbours that vouch for one another, where relief forbids one map
//!               │
//!          correspond   the answer, or why there is none
//! ```
//!
//! Predicates, hulls, layers and the thesis' rule are integer arithmetic on [`ImagePoint`](crate::point::ImagePoint)s: no
//! rounding, no tolerance. What knows about noise is IEEE arithmetic in the written order. Points are named by their
//! number in the caller's slice. A hull has strict vertices only, begins at the least point in the order of (x, y) and
//! goes clockwise as seen on the screen; of points at the same place the lowest number stands for all. Sets without area
//! (nothing, one place, a line) are answers with a name of their own.

pub mod predicate;
pub mod error;
mod sort;
mod key;
mod chain;
mod fence;
pub mod hull;
pub mod layers;
mod heap_sort;
pub mod quad;
pub mod cross_ratio;
pub mod proposal;
pub mod shift;
mod sieve;
pub mod arrangement;
pub mod sorted_areas;
pub mod consensus;
pub mod epipolar;
pub mod agreement;
pub mod correspond;

pub use error::GeometryError;
pub use hull::{ConvexHull, Hull};
pub use layers::{HullLayers, Remainder};
pub use predicate::{COORDINATE_LIMIT, Orientation, orientation, twice_area};
