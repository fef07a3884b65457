//! How a camera sees points of space, and what two or more cameras say about a point.
//!
//! **Camera frame.** The origin is the centre of projection, x points right, y down as in the image, z along the optical axis
//! into the scene. Lengths in metres, image coordinates in pixels from the principal point.
//!
//! Triangulation takes whole cameras instead: image coordinates as in [`crate::point`], points in the model frame.

mod adjust;
mod draw;
mod intrinsics;
mod placement;
mod posit;
mod solve;
pub(crate) mod space;
pub mod direction;
pub mod facade;
pub mod locate;
pub mod pose;
pub mod weak_perspective;
pub mod triangulate;

pub use intrinsics::{Intrinsics, NoCamera};
pub use placement::CameraFromModel;
