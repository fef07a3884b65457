//! From pictures of a building to the views that a table stores.

pub mod select;
pub mod simulate;
