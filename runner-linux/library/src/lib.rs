//! Everything around daymark's core that has an operating system: files, threads, vector instructions, reports and the
//! command line.
//!
//! ```text
//!  picture ─── enroll ─────── table_file        pictures become views of a table
//!  picture ─── engine ─────── report            frames become answers, and answers text, JSON and drawings
//!  engine ──── observer ───── report            an answer and a lens become a position
//!  picture ─── correspond                       which corner of one picture is which of another
//!  dataset ─── command::evaluate                how often that is right
//!  frame ───── watch ──────── output            a camera becomes answers that stand until they are withdrawn
//!  picture ─── calibrate ──── camera_file       boards in pictures become a lens; lens_source: where a frame's comes from
//!  camera_file ─ synthesize ─ model_file        pictures and cameras become textured models, and models files
//!                    └─────── classify          which of several models a model is
//! ```

pub mod picture;
mod cut_jpeg;
pub use daymark_engine::{engine, simd};
use daymark_numerics::{order, parallel};
pub mod camera_file;
pub mod lens_source;
pub mod calibrate;
pub mod synthesize;
pub mod classify;
pub mod model_file;
pub mod enroll;
pub mod table_file;
pub mod observer;
pub mod near;
pub mod dataset;
mod calendar;
mod log;
pub mod frame;
pub mod report;
pub mod output;
pub mod watch;
pub mod correspond;
pub mod command;
