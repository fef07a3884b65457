//! Cameras: lenses, distortion, places; and the files that hold them.

pub mod distortion;
pub mod lens;
