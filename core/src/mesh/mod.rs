//! Triangle meshes on salient points, and their midpoint ("loop") subdivision.
//!
//! ```text
//!  triangles [u16; 3] ── TriangleMesh (checked; edges numbered) ── subdivided(level) ─┬─ write_points, write_triangles
//!                                                                                      └─ points, values (nothing stored)
//! ```
//!
//! Each level puts the midpoint of every edge in and divides every triangle in four; the thesis calls it loop subdivision,
//! but no vertex is smoothed. Midpoints are preserved by affine maps, so two views with the same triangles stay in
//! correspondence, point by point, at every level: the mesh is one, only the points differ.
//!
//! Growth is fourfold: level k has `4^k T` triangles and `V + (n - 1) E + (n - 1)(n - 2) / 2 T` points with `n = 2^k`
//! ([`MeshCounts::at`]), not the `3^k N` of the thesis (6.3): 47 points with 10 on their hull have 672,385 points and
//! 1,343,488 triangles at level 7.
//!
//! Points of all levels are written in the same order: the vertices, then the interior of each edge (edges sorted by lower and
//! higher vertex, points from the lower to the higher), then the interior of each triangle row by row.
//!
//! ```
//! use daymark_core::mesh::{SubdivisionLevel, TriangleMesh, storage_words};
//! use daymark_core::point::ImagePoint;
//!
//! # fn main() -> Result<(), daymark_core::mesh::MeshError> {
//! let triangles = [[0, 1, 2], [2, 1, 3]];
//! let mut storage = [0; storage_words(4, 2)];
//! let mesh = TriangleMesh::new(4, &triangles, &mut storage)?;
//!
//! // One mesh, two views: the same number is the same point of the building.
//! let view = [[0, 0], [160, 0], [0, 160], [160, 160]].map(|[x, y]| ImagePoint::new(x, y));
//! let frame = view.map(|p| ImagePoint::new(2 * p.x - p.y + 7, p.x + p.y));
//! mesh.check_areas(&view)?;
//! let fine = mesh.subdivided(SubdivisionLevel::TWO);
//! assert_eq!(fine.counts().vertices, 25);
//! let scaled_offset = 7 << 2;
//! for (a, b) in fine.values(&view)?.zip(fine.values(&frame)?) {
//!     assert_eq!([b.x, b.y], [2 * a.x - a.y + scaled_offset, a.x + a.y]);
//! }
//! # Ok(())
//! # }
//! ```

mod build;
mod counts;
mod error;
mod stream;
mod subdivision;
mod triangle_mesh;
mod value;

pub use counts::{MeshCounts, SubdivisionLevel};
pub use error::MeshError;
pub use stream::{Points, SubdivisionPoint, Values};
pub use subdivision::Subdivision;
pub use triangle_mesh::{MAX_TRIANGLES, MAX_VERTICES, TriangleMesh, storage_words};
pub use value::{FinePoint, VertexValue};
