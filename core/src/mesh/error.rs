//! Why triangles are no mesh, or a buffer or its values are refused.

use core::fmt;

/// Triangles, points or buffers that are refused, with the numbers. All but [`MeshError::StorageTooSmall`] and
/// [`MeshError::BufferTooSmall`] mean that whatever made the mesh is at fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshError {
    /// More vertices than a `u16` can number.
    TooManyVertices {
        /// Vertices given.
        found: usize,
        /// The most that are possible.
        limit: usize,
    },
    /// More triangles than the numbers of the finest level leave room for.
    TooManyTriangles {
        /// Triangles given.
        found: usize,
        /// The most that are possible.
        limit: usize,
    },
    /// The caller's storage for the edges is too small: see [`super::storage_words`].
    StorageTooSmall {
        /// Words given.
        found: usize,
        /// Words needed.
        needed: usize,
    },
    /// The caller's buffer is too small: see [`super::Subdivision::counts`].
    BufferTooSmall {
        /// Elements given.
        found: usize,
        /// Elements needed.
        needed: usize,
    },
    /// A corner of a triangle is no vertex.
    NoSuchVertex {
        /// Number of the triangle.
        triangle: u32,
        /// The corner.
        vertex: u16,
        /// Number of vertices.
        vertices: u32,
    },
    /// A triangle has the same vertex twice.
    RepeatedVertex {
        /// Number of the triangle.
        triangle: u32,
        /// The vertex.
        vertex: u16,
    },
    /// Two triangles have the same three vertices.
    DoubledTriangle {
        /// Numbers of the triangles.
        triangles: [u32; 2],
    },
    /// More than two triangles share an edge.
    NonManifoldEdge {
        /// Lower and higher vertex of the edge.
        ends: [u16; 2],
        /// Number of triangles.
        triangles: u32,
    },
    /// Two neighbours turn in different directions: both run along their edge from the first to the second vertex.
    InconsistentOrientation {
        /// Vertices of the directed edge.
        directed: [u16; 2],
        /// Numbers of the triangles.
        triangles: [u32; 2],
    },
    /// The corners of a triangle lie on one line.
    CollinearTriangle {
        /// Number of the triangle.
        triangle: u32,
        /// Its corners.
        vertices: [u16; 3],
    },
    /// Not one value for each vertex.
    ValueCount {
        /// Values given.
        found: usize,
        /// Number of vertices.
        expected: usize,
    },
    /// The value of a vertex is too large to be subdivided, or not a number: see [`super::VertexValue::is_in_range`].
    ValueOutOfRange {
        /// The vertex.
        vertex: u32,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooManyVertices { found, limit } => write!(f, "the mesh has {found} vertices, {limit} are possible"),
            Self::TooManyTriangles { found, limit } => {
                write!(f, "the mesh has {found} triangles, {limit} are possible")
            }
            Self::StorageTooSmall { found, needed } => {
                write!(f, "the edges of the mesh need {needed} words of storage, {found} were given")
            }
            Self::BufferTooSmall { found, needed } => {
                write!(f, "the level has {needed} elements, the buffer holds {found}")
            }
            Self::NoSuchVertex { triangle, vertex, vertices } => {
                write!(f, "triangle {triangle} has vertex {vertex}, but there are {vertices} vertices, counted from 0")
            }
            Self::RepeatedVertex { triangle, vertex } => write!(f, "triangle {triangle} has vertex {vertex} twice"),
            Self::DoubledTriangle { triangles: [first, second] } => {
                write!(f, "triangles {first} and {second} have the same vertices")
            }
            Self::NonManifoldEdge { ends: [low, high], triangles } => {
                write!(f, "{triangles} triangles share the edge of vertices {low} and {high}, two are possible")
            }
            Self::InconsistentOrientation { directed: [from, to], triangles: [first, second] } => {
                write!(f, "triangles {first} and {second} both run from vertex {from} to {to}: one is turned over")
            }
            Self::CollinearTriangle { triangle, vertices: [a, b, c] } => {
                write!(f, "triangle {triangle} has no area: its vertices {a}, {b} and {c} lie on one line")
            }
            Self::ValueCount { found, expected } => {
                write!(f, "{found} values were given for {expected} vertices")
            }
            Self::ValueOutOfRange { vertex } => {
                write!(f, "the value of vertex {vertex} is too large to be subdivided, or not a number")
            }
        }
    }
}

impl core::error::Error for MeshError {}
