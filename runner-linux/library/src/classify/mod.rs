//! Which of several base models a test model is, by its shape and, where shapes tie, by its appearance.
//!
//! ```text
//!  cloud ─ nearest ── align ── error ── decide
//! ```

pub mod cloud;
pub mod align;
pub mod error;
pub mod decide;
pub mod histogram;
pub mod experiment;
pub mod towers;
