//! Every point of a level once, in the written order, without storing any.

use core::iter::FusedIterator;

use super::counts::{MeshCounts, SubdivisionLevel};
use super::triangle_mesh::TriangleMesh;
use super::value::VertexValue;

/// Points of one level on a line: weights `(n - row - j, row, j)` of `corners`, for `j` from `first` to before `end`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    on: Part,
    corners: [u16; 3],
    row: u32,
    first: u32,
    end: u32,
}

/// The smallest part of the base mesh that a line lies on.
#[derive(Debug, Clone, Copy)]
enum Part {
    Vertex(u32),
    Edge(u32),
    Triangle(u32),
}

impl Line {
    pub(super) fn count(&self) -> usize {
        (self.end - self.first) as usize
    }
}

/// The lines of a level in the written order: vertices, interiors of edges, rows of triangles.
#[derive(Debug, Clone)]
pub(super) struct Lines<'a> {
    mesh: TriangleMesh<'a>,
    steps: u32,
    vertex: u32,
    edge: u32,
    triangle: u32,
    row: u32,
}

impl<'a> Lines<'a> {
    pub(super) fn new(mesh: TriangleMesh<'a>, level: SubdivisionLevel) -> Self {
        Self { mesh, steps: level.steps(), vertex: 0, edge: 0, triangle: 0, row: 1 }
    }
}

impl Iterator for Lines<'_> {
    type Item = Line;

    #[inline]
    fn next(&mut self) -> Option<Line> {
        if self.vertex < self.mesh.vertices() {
            let vertex = self.vertex;
            self.vertex += 1;
            return Some(Line { on: Part::Vertex(vertex), corners: [vertex as u16; 3], row: 0, first: 0, end: 1 });
        }
        if self.steps > 1
            && let Some([low, high]) = self.mesh.edge(self.edge)
        {
            let on = Part::Edge(self.edge);
            self.edge += 1;
            return Some(Line { on, corners: [low, low, high], row: 0, first: 1, end: self.steps });
        }
        if self.steps < 3 {
            return None;
        }
        let &corners = self.mesh.triangles().get(self.triangle as usize)?;
        let (on, row) = (Part::Triangle(self.triangle), self.row);
        // The last row with a point inside is `n - 2`.
        if row + 2 == self.steps {
            self.triangle += 1;
            self.row = 1;
        } else {
            self.row += 1;
        }
        Some(Line { on, corners, row, first: 1, end: self.steps - row })
    }
}

/// The values on a line: `start + j * step`.
#[derive(Debug, Clone)]
pub(super) struct Progression<A: VertexValue> {
    start: A::Fine,
    step: A::Step,
    next: u32,
    end: u32,
}

impl<A: VertexValue> Progression<A> {
    /// `None` if a vertex has no value.
    #[inline]
    pub(super) fn on(line: Line, level: SubdivisionLevel, values: &[A]) -> Option<Self> {
        let [a, b, c] = line.corners;
        let value = |vertex: u16| values.get(usize::from(vertex)).copied();
        let (a, b, c) = (value(a)?, value(b)?, value(c)?);
        let start = A::advanced(a.at_vertex(level), a.step_to(b, level), line.row);
        Some(Self { start, step: a.step_to(c, level), next: line.first, end: line.end })
    }
}

impl<A: VertexValue> Iterator for Progression<A> {
    type Item = A::Fine;

    #[inline]
    fn next(&mut self) -> Option<A::Fine> {
        if self.next >= self.end {
            return None;
        }
        let value = A::advanced(self.start, self.step, self.next);
        self.next += 1;
        Some(value)
    }

    #[inline]
    fn fold<B, F: FnMut(B, A::Fine) -> B>(self, initial: B, mut f: F) -> B {
        let mut result = initial;
        for j in self.next..self.end {
            result = f(result, A::advanced(self.start, self.step, j));
        }
        result
    }
}

/// The values of a level in the written order; see [`super::Subdivision::values`].
///
/// `fold`, and so `for_each`, `sum` and `extend`, run without a test for the next line at each point.
#[derive(Debug, Clone)]
pub struct Values<'a, A: VertexValue> {
    lines: Lines<'a>,
    level: SubdivisionLevel,
    at_vertices: &'a [A],
    current: Option<Progression<A>>,
    left: usize,
}

impl<'a, A: VertexValue> Values<'a, A> {
    /// `values` has one value for each vertex.
    pub(super) fn new(mesh: TriangleMesh<'a>, level: SubdivisionLevel, values: &'a [A]) -> Self {
        let left = mesh.counts().at(level).vertices as usize;
        Self { lines: Lines::new(mesh, level), level, at_vertices: values, current: None, left }
    }
}

impl<A: VertexValue> Iterator for Values<'_, A> {
    type Item = A::Fine;

    #[inline]
    fn next(&mut self) -> Option<A::Fine> {
        loop {
            if let Some(value) = self.current.as_mut().and_then(Iterator::next) {
                self.left = self.left.saturating_sub(1);
                return Some(value);
            }
            self.current = Some(Progression::on(self.lines.next()?, self.level, self.at_vertices)?);
        }
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }

    #[inline]
    fn fold<B, F: FnMut(B, A::Fine) -> B>(self, initial: B, mut f: F) -> B {
        let (level, values) = (self.level, self.at_vertices);
        let rest = self.lines.filter_map(|line| Progression::on(line, level, values));
        let mut result = initial;
        for progression in self.current.into_iter().chain(rest) {
            result = progression.fold(result, &mut f);
        }
        result
    }
}

impl<A: VertexValue> ExactSizeIterator for Values<'_, A> {}
impl<A: VertexValue> FusedIterator for Values<'_, A> {}

/// A point of a level by its place on the base mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SubdivisionPoint {
    /// The first triangle of the base mesh that has the point; `None` for a vertex that no triangle has.
    pub triangle: Option<u32>,
    /// The vertices of that triangle as they were given, or three times the vertex.
    pub corners: [u16; 3],
    /// Barycentric weights of the corners in `1 / 2^level`: they add up to `2^level`.
    pub weights: [u16; 3],
}

/// The points of a level by their weights, in the written order; see [`super::Subdivision::points`].
#[derive(Debug, Clone)]
pub struct Points<'a> {
    lines: Lines<'a>,
    mesh: TriangleMesh<'a>,
    current: WeightLine,
    left: usize,
}

/// Weights on a line: `start + j * step`.
#[derive(Debug, Clone, Copy)]
struct WeightLine {
    triangle: Option<u32>,
    corners: [u16; 3],
    start: [i32; 3],
    step: [i32; 3],
    next: u32,
    end: u32,
}

impl WeightLine {
    const EMPTY: Self = Self { triangle: None, corners: [0; 3], start: [0; 3], step: [0; 3], next: 0, end: 0 };

    fn on(line: Line, mesh: &TriangleMesh<'_>, steps: u32) -> Self {
        let (n, row) = (steps as i32, line.row as i32);
        let unit = |corner: u32| [0, 1, 2].map(|number| i32::from(number == corner));
        let (triangle, start, step) = match line.on {
            Part::Vertex(vertex) => match mesh.first_corner(vertex) {
                Some((triangle, corner)) => (Some(triangle), unit(corner).map(|one| n * one), [0; 3]),
                None => (None, [n, 0, 0], [0; 3]),
            },
            Part::Edge(edge) => {
                let (triangle, side) = mesh.first_side(edge).unwrap_or_default();
                let (from, to) = (side, (side + 1) % 3);
                let starts = |[a, b, c]: [u16; 3]| {
                    if side == 0 {
                        a
                    } else if side == 1 {
                        b
                    } else {
                        c
                    }
                };
                let [low, ..] = line.corners;
                let upwards = mesh.triangles().get(triangle as usize).is_some_and(|&corners| starts(corners) == low);
                let (low, high) = if upwards { (from, to) } else { (to, from) };
                let (low, high) = (unit(low), unit(high));
                let ([l0, l1, l2], [h0, h1, h2]) = (low, high);
                (Some(triangle), low.map(|one| n * one), [h0 - l0, h1 - l1, h2 - l2])
            }
            Part::Triangle(triangle) => (Some(triangle), [n - row, row, 0], [-1, 0, 1]),
        };
        let corners = triangle.and_then(|triangle| mesh.triangles().get(triangle as usize).copied());
        let corners = corners.unwrap_or(line.corners);
        Self { triangle, corners, start, step, next: line.first, end: line.end }
    }

    #[inline]
    fn at(&self, j: u32) -> SubdivisionPoint {
        let ([a, b, c], [da, db, dc]) = (self.start, self.step);
        let j = j as i32;
        let weights = [a + j * da, b + j * db, c + j * dc].map(|weight| weight as u16);
        SubdivisionPoint { triangle: self.triangle, corners: self.corners, weights }
    }
}

impl<'a> Points<'a> {
    pub(super) fn new(mesh: TriangleMesh<'a>, level: SubdivisionLevel) -> Self {
        let MeshCounts { vertices, .. } = mesh.counts().at(level);
        Self { lines: Lines::new(mesh, level), mesh, current: WeightLine::EMPTY, left: vertices as usize }
    }
}

impl Iterator for Points<'_> {
    type Item = SubdivisionPoint;

    #[inline]
    fn next(&mut self) -> Option<SubdivisionPoint> {
        if self.current.next >= self.current.end {
            self.current = WeightLine::on(self.lines.next()?, &self.mesh, self.lines.steps);
        }
        let point = self.current.at(self.current.next);
        self.current.next += 1;
        self.left = self.left.saturating_sub(1);
        Some(point)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }

    #[inline]
    fn fold<B, F: FnMut(B, SubdivisionPoint) -> B>(self, initial: B, mut f: F) -> B {
        let (mesh, steps) = (self.mesh, self.lines.steps);
        let rest = self.lines.map(|line| WeightLine::on(line, &mesh, steps));
        let mut result = initial;
        for line in core::iter::once(self.current).chain(rest) {
            for j in line.next..line.end {
                result = f(result, line.at(j));
            }
        }
        result
    }
}

impl ExactSizeIterator for Points<'_> {}
impl FusedIterator for Points<'_> {}
