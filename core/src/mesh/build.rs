//! From triangles to numbered edges: two counting sorts, then one walk that numbers and checks.
//!
//! A *half-edge* `3 t + s` is side `s` of triangle `t`, from its corner `s` to the next one. Sorted by higher and then
//! stably by lower vertex, the half-edges of an edge lie together, the first triangle first. `O(V + T)` whatever the mesh.

use super::error::MeshError;

/// The directed edge and the vertex opposite to it; `None` if there is no such half-edge.
#[derive(Clone, Copy)]
struct HalfEdge {
    from: u16,
    to: u16,
    opposite: u16,
}

impl HalfEdge {
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

    fn low(self) -> u16 {
        self.from.min(self.to)
    }

    fn high(self) -> u16 {
        self.from.max(self.to)
    }

    fn ends(self) -> [u16; 2] {
        [self.low(), self.high()]
    }
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

/// Both ends of an edge in one word, ordered like the ends.
pub(super) fn packed([low, high]: [u16; 2]) -> u32 {
    u32::from(low) << 16 | u32::from(high)
}

/// Numbers the edges and checks them; the number of edges.
pub(super) fn build(triangles: &[[u16; 3]], vertices: u32, tables: &mut Tables<'_>) -> Result<usize, MeshError> {
    check_corners(triangles, vertices)?;
    let half_edges = 3 * triangles.len() as u32;
    // Until the walk: `edges` holds the half-edges by higher vertex, `edge_of` the counts of a sort.
    let counts = tables.edge_of.get_mut(..vertices as usize).unwrap_or_default();
    let sorted = &mut *tables.first_half_edge;
    counting_sort(triangles, 0..half_edges, counts, tables.edges, HalfEdge::high);
    counting_sort(triangles, tables.edges.iter().copied(), counts, sorted, HalfEdge::low);

    tables.first_corner.fill(NO_CORNER);
    for (corner, &vertex) in triangles.as_flattened().iter().enumerate().rev() {
        if let Some(first) = tables.first_corner.get_mut(usize::from(vertex)) {
            *first = corner as u32;
        }
    }

    let (mut at, mut edge) = (0, 0);
    while let Some(&first) = sorted.get(at) {
        let Some(half) = HalfEdge::of(triangles, first) else { break };
        let shared = |number: &u32| HalfEdge::of(triangles, *number).is_some_and(|other| other.ends() == half.ends());
        let second = sorted.get(at + 1).copied().filter(shared);
        if let Some(second) = second {
            let third = sorted.get(at + 2).copied().filter(shared);
            check_neighbours(triangles, first, second, third)?;
            if third.is_some() {
                let users = sorted.iter().skip(at).take_while(|number| shared(number)).count();
                return Err(MeshError::NonManifoldEdge { ends: half.ends(), triangles: users as u32 });
            }
        }
        for number in [Some(first), second].into_iter().flatten() {
            if let Some(slot) = tables.edge_of.get_mut(number as usize) {
                *slot = edge as u32;
            }
        }
        // `edge <= at`: what is overwritten has been read.
        if let (Some(slot), Some(ends)) = (sorted.get_mut(edge), tables.edges.get_mut(edge)) {
            *slot = first;
            *ends = packed(half.ends());
        }
        at += 1 + usize::from(second.is_some());
        edge += 1;
    }
    Ok(edge)
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

/// Writes the half-edges to `sorted`, stably ordered by a vertex. `counts` has a word for each vertex.
fn counting_sort(
    triangles: &[[u16; 3]],
    half_edges: impl Iterator<Item = u32> + Clone,
    counts: &mut [u32],
    sorted: &mut [u32],
    key: fn(HalfEdge) -> u16,
) {
    counts.fill(0);
    let keyed = half_edges.filter_map(|number| Some((number, usize::from(key(HalfEdge::of(triangles, number)?)))));
    for (_, vertex) in keyed.clone() {
        if let Some(count) = counts.get_mut(vertex) {
            *count += 1;
        }
    }
    let mut sum = 0;
    for count in &mut *counts {
        (*count, sum) = (sum, sum + *count);
    }
    for (number, vertex) in keyed {
        if let Some(place) = counts.get_mut(vertex) {
            if let Some(slot) = sorted.get_mut(*place as usize) {
                *slot = number;
            }
            *place += 1;
        }
    }
}

/// Refuses doubled triangles and, of two neighbours, a directed edge that both have.
fn check_neighbours(triangles: &[[u16; 3]], first: u32, second: u32, third: Option<u32>) -> Result<(), MeshError> {
    let half = |number: u32| HalfEdge::of(triangles, number);
    for (one, other) in [(first, Some(second)), (first, third), (second, third)] {
        let Some(other) = other else { continue };
        if half(one).map(|half| half.opposite) == half(other).map(|half| half.opposite) {
            return Err(MeshError::DoubledTriangle { triangles: [one / 3, other / 3] });
        }
    }
    match (half(first), half(second)) {
        (Some(one), Some(other)) if third.is_none() && one.from == other.from => {
            let triangles = [first / 3, second / 3];
            Err(MeshError::InconsistentOrientation { directed: [one.from, one.to], triangles })
        }
        _ => Ok(()),
    }
}
