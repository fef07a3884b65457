//! From pictures of a building to the views that a table stores.
//!
//! ```text
//! manifest ─┐
//!           ├─> plan ──> select, simulate ──> view ──> update ──> lint ──> advice
//! position ─┘    read pictures, in parallel            table      new views
//! ```

pub mod advice;
pub mod lint;
pub mod manifest;
pub mod plan;
pub mod position;
pub mod update;
mod view;

pub use daymark_engine::{select, simulate};
pub use view::{TooFewCorners, view};
