//! From pictures to a textured model.
//!
//! ```text
//!  view ── pictures, lenses, corners
//!    │
//!    ▼
//!  triangulate ── tracks become points with covariances
//!    │
//!    ▼
//!  mesh ── Delaunay for each pair of views, what cannot be seen dropped, pairs merged
//!    │
//!    ▼
//!  texture ── the view that shows each triangle best (by depth buffers)
//!    │
//!    ▼
//!  dense ── midpoint subdivision to a level: points, deviations, colours
//! ```

pub mod view;
pub mod features;
pub mod factorize;
pub mod correspond;
pub mod motion;
pub mod corner_file;
pub mod reconstruct;
pub mod frame;
pub mod explain;
pub mod report;
pub mod triangulate;
pub mod mesh;
pub mod texture;
pub mod dense;
pub mod model;
