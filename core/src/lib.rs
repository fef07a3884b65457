//! Recognizes enrolled buildings in a gray frame.
#![no_std]
#![forbid(unsafe_code)]

pub mod math;
pub mod point;
pub mod profile;

pub mod corner;
pub mod extract;
pub mod feature;
pub mod image;
pub mod kernel;
mod model;
pub mod pyramid;
pub mod response;
pub mod signature;
pub mod tone;

pub mod candidate;
pub mod evidence;
pub mod hypothesis;
pub mod matcher;
pub mod query;
pub mod refine;
pub mod shortlist;
pub mod linear;
pub mod transform;

pub mod table;

pub mod capacity;
pub mod recognizer;
pub mod verdict;
