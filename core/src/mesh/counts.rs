//! How many points, edges and triangles a level has, and how many bytes they take, before anything is made.

/// A level of subdivision, 0 (the mesh itself) to 7: every edge is divided in `2^level` steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct SubdivisionLevel(u8);

impl SubdivisionLevel {
    /// The mesh itself.
    pub const ZERO: Self = Self(0);
    /// Each triangle in 4.
    pub const ONE: Self = Self(1);
    /// Each triangle in 16.
    pub const TWO: Self = Self(2);
    /// Each triangle in 64.
    pub const THREE: Self = Self(3);
    /// Each triangle in 256.
    pub const FOUR: Self = Self(4);
    /// Each triangle in 1,024.
    pub const FIVE: Self = Self(5);
    /// Each triangle in 4,096.
    pub const SIX: Self = Self(6);
    /// Each triangle in 16,384: the deepest that the thesis times (6.3).
    pub const SEVEN: Self = Self(7);
    /// Every level, coarse to fine.
    pub const ALL: [Self; 8] =
        [Self::ZERO, Self::ONE, Self::TWO, Self::THREE, Self::FOUR, Self::FIVE, Self::SIX, Self::SEVEN];

    /// The level of this number; `None` above 7.
    pub const fn new(level: u8) -> Option<Self> {
        if level <= Self::SEVEN.0 { Some(Self(level)) } else { None }
    }

    /// 0..=7.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Steps along each edge of the base mesh, `2^level`: the denominator of all weights and coordinates.
    pub const fn steps(self) -> u32 {
        1 << self.0
    }
}

/// Numbers of a mesh's parts; unreferenced vertices count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct MeshCounts {
    /// Vertices, or points of a level.
    pub vertices: u64,
    /// Edges.
    pub edges: u64,
    /// Triangles.
    pub triangles: u64,
}

impl MeshCounts {
    /// The counts of a Delaunay mesh, or any other triangulation of a convex hull: `2N - 2 - h` triangles and `3N - 3 - h`
    /// edges for `points` = N of which `on_hull` = h lie on the border of the hull. All zero where no such mesh exists
    /// (`3 <= h <= N` does not hold).
    pub const fn of_triangulation(points: u32, on_hull: u32) -> Self {
        if on_hull < 3 || on_hull > points {
            return Self { vertices: 0, edges: 0, triangles: 0 };
        }
        let (points, on_hull) = (points as u64, on_hull as u64);
        Self { vertices: points, edges: 3 * points - 3 - on_hull, triangles: 2 * points - 2 - on_hull }
    }

    /// The counts of a level. With `n = 2^level`:
    /// `V' = V + (n - 1) E + (n - 1)(n - 2) / 2 T`, `E' = n E + 3 n (n - 1) / 2 T`, `T' = n² T`.
    ///
    /// Exact for all counts that [`super::TriangleMesh`] admits (points and triangles stay below 2^32).
    #[must_use]
    pub const fn at(self, level: SubdivisionLevel) -> Self {
        let n = level.steps() as u64;
        Self {
            vertices: self.vertices + (n - 1) * self.edges + interior_points(level) * self.triangles,
            edges: n * self.edges + 3 * (n * (n - 1) / 2) * self.triangles,
            triangles: n * n * self.triangles,
        }
    }

    /// Bytes of the points, each of `point_bytes`: 8 for [`super::FinePoint`], 12 for `[f32; 3]`.
    pub const fn point_bytes(self, point_bytes: usize) -> u64 {
        self.vertices * point_bytes as u64
    }

    /// Bytes of the triangles, as three `u32` each.
    pub const fn triangle_bytes(self) -> u64 {
        self.triangles * size_of::<[u32; 3]>() as u64
    }
}

/// Points strictly inside a triangle of the base mesh: `(n - 1)(n - 2) / 2`.
pub(super) const fn interior_points(level: SubdivisionLevel) -> u64 {
    let n = level.steps() as u64;
    (n - 1) * (n.saturating_sub(2)) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_mesh() {
        // Constants, so that a device can size its buffers by them.
        const TOWER: MeshCounts = MeshCounts::of_triangulation(47, 10);
        const FINEST: MeshCounts = TOWER.at(SubdivisionLevel::SEVEN);
        assert_eq!(TOWER, MeshCounts { vertices: 47, edges: 128, triangles: 82 });
        assert_eq!((FINEST.vertices, FINEST.triangles), (672_385, 1_343_488));
        assert_eq!((FINEST.point_bytes(8), FINEST.triangle_bytes()), (5_379_080, 16_121_856));
        assert_eq!(TOWER.at(SubdivisionLevel::ZERO), TOWER);
    }

    #[test]
    fn each_level_follows_from_the_one_before() {
        for (points, hull) in [(3, 3), (4, 3), (4, 4), (5, 3), (47, 10), (1_000, 12)] {
            let base = MeshCounts::of_triangulation(points, hull);
            let mut step = base;
            for level in SubdivisionLevel::ALL {
                assert_eq!(base.at(level), step, "{points} points, {hull} on the hull, {level:?}");
                // Euler: a disc.
                assert_eq!(step.vertices + step.triangles, step.edges + 1);
                let MeshCounts { vertices, edges, triangles } = step;
                step = MeshCounts {
                    vertices: vertices + edges,
                    edges: 2 * edges + 3 * triangles,
                    triangles: 4 * triangles,
                };
            }
        }
    }

    #[test]
    fn impossible_hulls_and_levels() {
        assert_eq!(MeshCounts::of_triangulation(5, 2), MeshCounts::default());
        assert_eq!(MeshCounts::of_triangulation(5, 6), MeshCounts::default());
        assert_eq!(SubdivisionLevel::new(7), Some(SubdivisionLevel::SEVEN));
        assert_eq!(SubdivisionLevel::new(8), None);
    }
}
