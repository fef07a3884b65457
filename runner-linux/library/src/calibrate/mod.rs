//! The lens of a camera from pictures of a board.
//!
//! ```text
//!  picture ── saddle ── grid ── find ──────── subpixel        corners of the board, each with its number
//!              where black   lattices  where on the board, by
//!              and white     of them   colours or towers
//!              cross                        │
//!  corners of all pictures ── zhang ── refine ── solve ── quality        a lens, its errors, what to do better
//!                            a start  least squares
//! ```
//!
//! No crate does it: those of 2026 are either young and of one author, or bring a solver larger than this program. Everything
//! is `+ - * /` and `libm` on one thread a picture, so a set of pictures gives one lens on every machine.

pub mod board;
mod find;
mod grid;
pub mod pattern;
mod plane;
pub mod quality;
pub mod refine;
mod saddle;
pub mod solve;
mod subpixel;
pub mod towers;
pub mod zhang;

pub use find::{FoundBoard, NoBoard, find};

/// A corner of the board and where a picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Its column and row on the board, from 0.
    pub corner: [u8; 2],
    /// Pixels.
    pub at: [f64; 2],
}
