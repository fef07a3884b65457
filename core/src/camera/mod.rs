//! Cameras as maps, and what two or more of them say about a point of the model.

pub mod triangulate;
