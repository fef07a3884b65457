//! Recognizes enrolled buildings in a gray frame.
#![no_std]
#![forbid(unsafe_code)]

pub mod math;
pub mod point;
pub mod profile;

pub mod feature;
pub mod image;
pub mod kernel;
mod model;
pub mod tone;
pub mod pyramid;
pub mod response;
pub mod corner;
pub mod signature;
pub mod extract;

pub mod query;
pub mod candidate;
pub mod hypothesis;
pub mod transform;
pub mod shortlist;
pub mod refine;
pub mod evidence;
pub mod matcher;

pub mod table;

pub mod verdict;
pub mod recognizer;
pub mod capacity;
