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
//!  texture ── the view that shows each triangle best (render: depth buffers)
//!    │
//!    ▼
//!  dense ── midpoint subdivision to a level: points, deviations, colours
//! ```

pub mod view;
pub mod triangulate;
pub mod mesh;
pub mod render;
pub mod texture;
pub mod dense;
pub mod model;
