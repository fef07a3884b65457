//! A checked triangle mesh over the caller's triangles, with its edges numbered in the caller's storage.

use super::build::{self, Tables};
use super::counts::{MeshCounts, SubdivisionLevel};
use super::error::MeshError;
use super::subdivision::Subdivision;
use crate::point::ImagePoint;

/// Vertices that a `u16` can number.
pub const MAX_VERTICES: usize = 1 << 16;
/// As many triangles as [`MAX_VERTICES`] can carry on a sphere; points and triangles of the finest level stay below 2^32.
pub const MAX_TRIANGLES: usize = 2 * MAX_VERTICES;

/// Words of storage that a mesh takes: `6 T + max(3 T, V) + V`. 784 (3 KB) for 47 vertices and 82 triangles.
pub const fn storage_words(vertices: usize, triangles: usize) -> usize {
    let shared = if 3 * triangles > vertices { 3 * triangles } else { vertices };
    6 * triangles + shared + vertices
}

/// A triangle mesh without geometry: which vertices form triangles, which triangles share edges.
///
/// Every edge has one or two triangles, and two neighbours run along their edge in opposite directions. Not checked:
/// that a vertex has one fan of triangles (two may touch in a point), and that the mesh is connected. Vertices that
/// no triangle has are allowed and stay as they are.
#[derive(Debug, Clone, Copy)]
pub struct TriangleMesh<'a> {
    vertices: u32,
    triangles: &'a [[u16; 3]],
    edges: &'a [u32],
    first_half_edge: &'a [u32],
    edges_of_triangles: &'a [[u32; 3]],
    first_corner: &'a [u32],
}

impl<'a> TriangleMesh<'a> {
    /// Checks the triangles over `vertices` vertices and numbers their edges in `storage` of at least [`storage_words`].
    /// `O(V + T)`.
    ///
    /// # Errors
    /// What [`MeshError`] lists up to [`MeshError::InconsistentOrientation`]. Corners are checked first, by triangle; then
    /// the edges, by lower and higher vertex. A doubled triangle beside more than one further triangle at an edge may be
    /// told as [`MeshError::NonManifoldEdge`].
    pub fn new(vertices: usize, triangles: &'a [[u16; 3]], storage: &'a mut [u32]) -> Result<Self, MeshError> {
        if vertices > MAX_VERTICES {
            return Err(MeshError::TooManyVertices { found: vertices, limit: MAX_VERTICES });
        }
        if triangles.len() > MAX_TRIANGLES {
            return Err(MeshError::TooManyTriangles { found: triangles.len(), limit: MAX_TRIANGLES });
        }
        let found = storage.len();
        let half_edges = 3 * triangles.len();
        let too_small = MeshError::StorageTooSmall { found, needed: storage_words(vertices, triangles.len()) };
        let (first_half_edge, storage) = storage.split_at_mut_checked(half_edges).ok_or(too_small)?;
        let (edges, storage) = storage.split_at_mut_checked(half_edges).ok_or(too_small)?;
        let (edge_of, storage) = storage.split_at_mut_checked(half_edges.max(vertices)).ok_or(too_small)?;
        let first_corner = storage.get_mut(..vertices).ok_or(too_small)?;
        let mut tables = Tables { first_half_edge, edges, edge_of, first_corner };
        let edge_count = build::build(triangles, vertices as u32, &mut tables)?;
        let Tables { first_half_edge, edges, edge_of, first_corner } = tables;
        Ok(Self {
            vertices: vertices as u32,
            triangles,
            edges: edges.get(..edge_count).unwrap_or_default(),
            first_half_edge: first_half_edge.get(..edge_count).unwrap_or_default(),
            edges_of_triangles: edge_of.as_chunks().0.get(..triangles.len()).unwrap_or_default(),
            first_corner,
        })
    }

    /// Refuses triangles whose corners lie on one line in these positions. Exact for all coordinates.
    ///
    /// # Errors
    /// [`MeshError::ValueCount`], [`MeshError::CollinearTriangle`].
    pub fn check_areas(&self, points: &[ImagePoint]) -> Result<(), MeshError> {
        self.check_count(points.len())?;
        for (number, &vertices) in self.triangles.iter().enumerate() {
            let [a, b, c] = vertices.map(|vertex| points.get(usize::from(vertex)).copied().unwrap_or_default());
            let from_a = |p: ImagePoint| [i128::from(p.x) - i128::from(a.x), i128::from(p.y) - i128::from(a.y)];
            let ([bx, by], [cx, cy]) = (from_a(b), from_a(c));
            if bx * cy == by * cx {
                return Err(MeshError::CollinearTriangle { triangle: number as u32, vertices });
            }
        }
        Ok(())
    }

    pub(super) fn check_count(&self, found: usize) -> Result<(), MeshError> {
        let expected = self.vertices as usize;
        if found == expected { Ok(()) } else { Err(MeshError::ValueCount { found, expected }) }
    }

    /// The level of this mesh.
    pub fn subdivided(&self, level: SubdivisionLevel) -> Subdivision<'a> {
        Subdivision::new(*self, level)
    }

    /// Numbers of vertices, edges and triangles.
    pub fn counts(&self) -> MeshCounts {
        MeshCounts {
            vertices: u64::from(self.vertices),
            edges: self.edges.len() as u64,
            triangles: self.triangles.len() as u64,
        }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> u32 {
        self.vertices
    }

    /// The triangles as they were given.
    pub fn triangles(&self) -> &'a [[u16; 3]] {
        self.triangles
    }

    /// The edges by number: lower and higher vertex, in ascending order.
    pub fn edges(&self) -> impl ExactSizeIterator<Item = [u16; 2]> + Clone + use<'a> {
        self.edges.iter().map(|&ends| build::unpacked(ends))
    }

    /// Lower and higher vertex of an edge.
    pub fn edge(&self, edge: u32) -> Option<[u16; 2]> {
        self.edges.get(edge as usize).map(|&ends| build::unpacked(ends))
    }

    /// The edges of a triangle: from its first corner to the second, the second to the third, the third to the first.
    pub fn edges_of(&self, triangle: u32) -> Option<[u32; 3]> {
        self.edges_of_triangles.get(triangle as usize).copied()
    }

    /// Triangle and side of the first triangle that has the edge. Side `s` leads from corner `s` to the next.
    pub(super) fn first_side(&self, edge: u32) -> Option<(u32, u32)> {
        self.first_half_edge.get(edge as usize).map(|half_edge| (half_edge / 3, half_edge % 3))
    }

    /// Triangle and corner of the first triangle that has the vertex; `None` if none has.
    pub(super) fn first_corner(&self, vertex: u32) -> Option<(u32, u32)> {
        self.first_corner
            .get(vertex as usize)
            .filter(|&&corner| corner != build::NO_CORNER)
            .map(|corner| (corner / 3, corner % 3))
    }
}
