//! Everything around daymark's core that has an operating system.

pub mod command;
pub mod engine;
pub mod enroll;
pub mod picture;
pub mod simd;
pub mod table_file;
