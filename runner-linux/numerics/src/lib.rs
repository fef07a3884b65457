//! What synthesis and classification spend their time with, in a package of its own: the library around it is compiled for
//! size, and these loops, which are small, for speed. Nothing here knows of files, reports or the command line.
//!
//! ```text
//!  look_alike ── epipolar ── align ── bundle      signatures become matches, corners to a fraction of a pixel, cameras
//!  cells ─────── sights ───── depth               which triangles a view sees, and what hides them
//!  sample ────── dense                            pictures between their pixels; the points of a level and their colours
//!  nearest                                        the nearest point of a cloud
//! ```
//!
//! Foundations: [`pose`], [`order`] (sorting) and [`parallel`] (all threads, the same results for any number), each compiled
//! once for everybody.

pub mod pose;
pub mod order;
pub mod parallel;
pub mod look_alike;
pub mod epipolar;
pub mod align;
pub mod bundle;
pub mod cells;
pub mod sights;
pub mod depth;
pub mod sample;
pub mod dense;
pub mod nearest;
