//! From frames to answers that stand until they are withdrawn, for months.
//!
//! ```text
//!  frame ── look ── quality (dark, blurred, ...)      table ── exchanged while running
//!             │     scene (a cut?)                    signals, notify ── the system's words
//!             ▼                                       counters ── what happened, and how long it took
//!          session ── core's evidence over frames ── records ── output
//!             └────── follow (where the observer is)
//! ```

pub mod quality;
pub mod scene;
pub mod look;
pub mod table;
pub mod follow;
pub mod counters;
pub mod session;
pub mod signals;
pub mod notify;
pub mod run;
