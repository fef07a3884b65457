//! Everything around daymark's core that has an operating system.

pub mod command;
mod cut_jpeg;
pub mod dataset;
pub mod engine;
pub mod enroll;
pub mod picture;
pub mod report;
pub mod simd;
pub mod table_file;
