//! What synthesis and classification spend their time with, in a package of its own: the library around it is compiled for
//! size, and these loops, which are small, for speed. Nothing here knows of files, reports or the command line.

pub mod align;
pub mod bundle;
pub mod cells;
pub mod depth;
pub mod epipolar;
pub mod look_alike;
pub mod nearest;
pub mod order;
pub mod parallel;
pub mod pose;
pub mod sample;
pub mod sights;
pub mod dense;
