//! What is said about frames and datasets, to people and to programs.
//!
//! A [`finding`] is everything that is said about one frame; an [`explain`]ed one adds what each stored corner said.
//! Both are plain values: [`text`] and [`overlay`] show them, and serialized they are the JSON. [`evaluation`] shows
//! what a whole dataset gave.

pub mod data_uri;
pub mod evaluation;
pub mod explain;
pub mod finding;
pub mod map;
pub mod overlay;
pub mod page;
pub mod phrase;
pub mod plot;
pub mod position;
pub mod text;
