//! How a camera sees points of space.
//!
//! **Camera frame.** The origin is the centre of projection, x points right, y down as in the image, z along the optical axis
//! into the scene. Lengths in metres, image coordinates in pixels from the principal point.

mod adjust;
mod draw;
mod intrinsics;
mod placement;
mod posit;
mod solve;
pub(crate) mod space;
pub mod direction;
pub mod facade;
pub mod pose;
pub mod weak_perspective;

pub use intrinsics::{Intrinsics, NoCamera};
pub use placement::CameraFromModel;
