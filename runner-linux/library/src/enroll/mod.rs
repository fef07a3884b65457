//! From pictures of a building to the views that a table stores.
//!
//! ```text
//! manifest ─┐
//!           ├─> plan ──> select, simulate ──> view ──> update ──> model ──> lint ──> advice
//! position ─┘    read pictures, in parallel            table     (upright)  new views
//! ```

pub mod advice;
pub mod lint;
pub mod manifest;
pub mod model;
pub mod plan;
pub mod position;
pub mod update;
pub mod upright;
mod view;

pub use daymark_engine::{select, simulate};
pub use view::{TooFewCorners, view};
