//! From triangles to numbered edges: two counting sorts, then one walk that numbers and checks.
//!
//! A *half-edge* `3 t + s` is side `s` of triangle `t`, from its corner `s` to the next one. Sorted by higher and then
//! stably by lower vertex, the half-edges of an edge lie together, the first triangle first. `O(V + T)` whatever the mesh.

use super::error::MeshError;

/// The directed edge and the vertex opposite to it.
#[derive(Clone, Copy)]
struct HalfEdge {
    from: u16,
    to: u16,
    opposite: u16,
}

impl HalfEdge {
    /// `None` if there is no such triangle.
    #[inline]
    fn of(triangles: &[[u16; 3]], number: u32) -> Option<Self> {
        let &[a, b, c] = triangles.get(number as usize / 3)?;
        let (from, to, opposite) = match number % 3 {
            0 => (a, b, c),
            1 => (b, c, a),
            _ => (c, a, b),
        };
        Some(Self { from, to, opposite })
    }

    #[inline]
    fn low(self) -> u16 {
        self.from.min(self.to)
    }

    #[inline]
    fn high(self) -> u16 {
        self.from.max(self.to)
    }

    /// Both ends in one word, ordered like the ends: the lower vertex in the higher half.
    #[inline]
    fn ends(self) -> u32 {
        u32::from(self.low()) << 16 | u32::from(self.high())
    }
}

/// Lower and higher vertex.
pub(super) fn unpacked(ends: u32) -> [u16; 2] {
    [(ends >> 16) as u16, ends as u16]
}

/// What [`build`] fills in. Lengths: `3 T`, `3 T`, at least `3 T` and `V`, `V`.
pub(super) struct Tables<'a> {
    /// First half-edge of each edge.
    pub(super) first_half_edge: &'a mut [u32],
    /// Each edge: lower vertex in the higher half.
    pub(super) edges: &'a mut [u32],
    /// The edge of each half-edge.
    pub(super) edge_of: &'a mut [u32],
    /// The first corner `3 t + c` that each vertex is, or [`NO_CORNER`].
    pub(super) first_corner: &'a mut [u32],
}

/// Marks a vertex that no triangle has.
pub(super) const NO_CORNER: u32 = u32::MAX;

/// Numbers the edges and checks them; the number of edges.
pub(super) fn build(triangles: &[[u16; 3]], vertices: u32, tables: &mut Tables<'_>) -> Result<usize, MeshError> {
    let Tables { first_half_edge: sorted, edges, edge_of, first_corner } = tables;
    check_corners(triangles, vertices)?;
    // Until the walk: `edges` holds the half-edges by higher vertex, `edge_of` and `first_corner` where those of a higher
    // and of a lower vertex go.
    let (by_high, by_low) = (edge_of.get_mut(..vertices as usize).unwrap_or_default(), &mut **first_corner);
    count(triangles, by_high, by_low);
    let halves = triangles.iter().flat_map(|&[a, b, c]| [a.max(b), b.max(c), c.max(a)]);
    for (number, high) in (0..).zip(halves) {
        place(number, by_high, high, edges);
    }
    for &mut number in &mut **edges {
        if let Some(half) = HalfEdge::of(triangles, number) {
            place(number, by_low, half.low(), sorted);
        }
    }
    name_first_corners(triangles, first_corner);

    let mut edge = 0;
    let mut at = 0;
    let half_at = |sorted: &[u32], at: usize| {
        let &number = sorted.get(at)?;
        Some((number, HalfEdge::of(triangles, number)?))
    };
    let mut next = half_at(sorted, 0);
    while let Some((first, half)) = next {
        let shared = |other: &(u32, HalfEdge)| other.1.ends() == half.ends();
        at += 1;
        next = half_at(sorted, at);
        if let Some(second) = next.filter(shared) {
            at += 1;
            next = half_at(sorted, at);
            check_neighbours((first, half), second, next.filter(shared))?;
            if next.is_some_and(|third| shared(&third)) {
                let further = (at..).map_while(|at| half_at(sorted, at)).take_while(shared).count();
                let triangles = 2 + further as u32;
                return Err(MeshError::NonManifoldEdge { ends: unpacked(half.ends()), triangles });
            }
            write(edge_of, second.0 as usize, edge);
        }
        write(edge_of, first as usize, edge);
        // At most `at` edges are known: what is overwritten has been read.
        write(sorted, edge as usize, first);
        write(edges, edge as usize, half.ends());
        edge += 1;
    }
    Ok(edge as usize)
}

#[inline]
fn write(words: &mut [u32], at: usize, word: u32) {
    if let Some(slot) = words.get_mut(at) {
        *slot = word;
    }
}

/// Where the half-edges of each higher and each lower vertex begin, once they are sorted.
fn count(triangles: &[[u16; 3]], by_high: &mut [u32], by_low: &mut [u32]) {
    by_high.fill(0);
    by_low.fill(0);
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if let (Some(high), Some(low)) =
                (by_high.get_mut(usize::from(from.max(to))), by_low.get_mut(usize::from(from.min(to))))
            {
                *high += 1;
                *low += 1;
            }
        }
    }
    let (mut high_sum, mut low_sum) = (0, 0);
    for (high, low) in by_high.iter_mut().zip(by_low) {
        (*high, high_sum) = (high_sum, high_sum + *high);
        (*low, low_sum) = (low_sum, low_sum + *low);
    }
}

/// Writes a half-edge behind those of the same vertex.
#[inline]
fn place(number: u32, begins: &mut [u32], vertex: u16, sorted: &mut [u32]) {
    if let Some(at) = begins.get_mut(usize::from(vertex)) {
        write(sorted, *at as usize, number);
        *at += 1;
    }
}

fn name_first_corners(triangles: &[[u16; 3]], first_corner: &mut [u32]) {
    first_corner.fill(NO_CORNER);
    for (corner, &vertex) in triangles.as_flattened().iter().enumerate().rev() {
        write(first_corner, usize::from(vertex), corner as u32);
    }
}

fn check_corners(triangles: &[[u16; 3]], vertices: u32) -> Result<(), MeshError> {
    for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
        let triangle = triangle as u32;
        if let Some(vertex) = [a, b, c].into_iter().find(|&vertex| u32::from(vertex) >= vertices) {
            return Err(MeshError::NoSuchVertex { triangle, vertex, vertices });
        }
        if a == b || a == c || b == c {
            return Err(MeshError::RepeatedVertex { triangle, vertex: if b == c { b } else { a } });
        }
    }
    Ok(())
}

/// Refuses doubled triangles and, of two neighbours, a directed edge that both have.
#[inline]
fn check_neighbours(
    first: (u32, HalfEdge),
    second: (u32, HalfEdge),
    third: Option<(u32, HalfEdge)>,
) -> Result<(), MeshError> {
    for (one, other) in [(first, Some(second)), (first, third), (second, third)] {
        if let Some(other) = other.filter(|other| other.1.opposite == one.1.opposite) {
            return Err(MeshError::DoubledTriangle { triangles: [one.0 / 3, other.0 / 3] });
        }
    }
    let (one, other) = (first.1, second.1);
    if third.is_none() && one.from == other.from {
        let triangles = [first.0 / 3, second.0 / 3];
        return Err(MeshError::InconsistentOrientation { directed: [one.from, one.to], triangles });
    }
    Ok(())
}
