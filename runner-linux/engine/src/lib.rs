//! Core's front end and recognizer with the memory and the vector instructions of a PC: all that a frame goes through, in
//! a package of its own so that it is compiled for speed, once, and what is around it for size.
//!
//! ```text
//!  gray ── reader ──── engine        a frame becomes features, and features an answer
//!   │        └──────── stages        the same steps one by one, to time them
//!   └─ simulate ────── select        a picture becomes the corners that are worth storing
//! ```

pub mod gray;
pub mod simd;
pub mod reader;
pub mod stages;
pub mod engine;
pub mod simulate;
pub mod select;
