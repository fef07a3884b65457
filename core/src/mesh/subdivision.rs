//! A level of a mesh: counts in advance, indexed into the caller's buffers, or streamed.

use super::counts::{MeshCounts, SubdivisionLevel, interior_points};
use super::error::MeshError;
use super::stream::{Lines, Points, Progression, Values};
use super::triangle_mesh::TriangleMesh;
use super::value::VertexValue;

/// A level of a mesh. Nothing is computed until it is written or streamed, and writing may use the same buffers again.
#[derive(Debug, Clone, Copy)]
pub struct Subdivision<'a> {
    mesh: TriangleMesh<'a>,
    level: SubdivisionLevel,
}

impl<'a> Subdivision<'a> {
    pub(super) fn new(mesh: TriangleMesh<'a>, level: SubdivisionLevel) -> Self {
        Self { mesh, level }
    }

    /// The level.
    pub fn level(&self) -> SubdivisionLevel {
        self.level
    }

    /// Numbers of points, edges and triangles of the level: the lengths that the buffers need.
    pub fn counts(&self) -> MeshCounts {
        self.mesh.counts().at(self.level)
    }

    /// The points of the level by triangle and weights, each once, in the written order of [`super`]. Stores nothing.
    pub fn points(&self) -> Points<'a> {
        Points::new(self.mesh, self.level)
    }

    /// The values of the level, each once, in the written order of [`super`]. Stores nothing.
    ///
    /// `&[ImagePoint]` gives exact [`super::FinePoint`]s, `&[[f32; 3]]` points of space, `&[[f32; 1]]` intensities.
    ///
    /// # Errors
    /// [`MeshError::ValueCount`], [`MeshError::ValueOutOfRange`].
    pub fn values<'s, A: VertexValue>(&self, values: &'s [A]) -> Result<Values<'s, A>, MeshError>
    where
        'a: 's,
    {
        self.check_values(values)?;
        Ok(Values::new(self.mesh, self.level, values))
    }

    /// Writes the values of the level, number by number as [`Self::values`] yields them; returns the part of the buffer
    /// that was written.
    ///
    /// # Errors
    /// [`MeshError::ValueCount`], [`MeshError::ValueOutOfRange`], [`MeshError::BufferTooSmall`]; the buffer is as before.
    pub fn write_values<'b, A: VertexValue>(
        &self,
        values: &[A],
        buffer: &'b mut [A::Fine],
    ) -> Result<&'b mut [A::Fine], MeshError> {
        self.check_values(values)?;
        let written = sized(buffer, self.counts().vertices)?;
        let mut rest = &mut *written;
        for line in Lines::new(self.mesh, self.level) {
            let Some((slots, behind)) = rest.split_at_mut_checked(line.count()) else { break };
            let Some(progression) = Progression::on(line, self.level, values) else { break };
            for (slot, value) in slots.iter_mut().zip(progression) {
                *slot = value;
            }
            rest = behind;
        }
        Ok(written)
    }

    /// Writes the triangles of the level as numbers of its points; returns the part of the buffer that was written.
    ///
    /// Those of a base triangle follow each other, `4^level` for each, strip by strip from its first corner to its second
    /// and in each strip towards the third. They turn as the base triangle does.
    ///
    /// # Errors
    /// [`MeshError::BufferTooSmall`]; the buffer is as before.
    pub fn write_triangles<'b>(&self, buffer: &'b mut [[u32; 3]]) -> Result<&'b mut [[u32; 3]], MeshError> {
        let written = sized(buffer, self.counts().triangles)?;
        let each = 1 << (2 * self.level.number());
        for (number, children) in written.chunks_exact_mut(each).enumerate() {
            let Some(patch) = Patch::of(&self.mesh, self.level, number as u32) else { break };
            patch.write(children);
        }
        Ok(written)
    }

    fn check_values<A: VertexValue>(&self, values: &[A]) -> Result<(), MeshError> {
        self.mesh.check_count(values.len())?;
        match values.iter().position(|value| !value.is_in_range()) {
            Some(vertex) => Err(MeshError::ValueOutOfRange { vertex: vertex as u32 }),
            None => Ok(()),
        }
    }
}

fn sized<T>(buffer: &mut [T], needed: u64) -> Result<&mut [T], MeshError> {
    let (found, needed) = (buffer.len(), usize::try_from(needed).unwrap_or(usize::MAX));
    buffer.get_mut(..needed).ok_or(MeshError::BufferTooSmall { found, needed })
}

/// Points of one side of a base triangle, by steps from the corner where the side starts: `first` is the number of the
/// point after one step, and each step adds `stride` (1, or -1 as wrapped).
#[derive(Clone, Copy)]
struct Side {
    first: u32,
    stride: u32,
}

impl Side {
    #[inline]
    fn at(self, step: u32) -> u32 {
        self.first.wrapping_add(self.stride.wrapping_mul(step.wrapping_sub(1)))
    }
}

/// A base triangle a, b, c with the numbers of the points on it. Its rows run from side ab to side bc, parallel to ac:
/// row 0 is ac itself, row n is b.
struct Patch {
    steps: u32,
    corners: [u32; 3],
    ab: Side,
    bc: Side,
    ac: Side,
    interior: u32,
}

/// The points of one row: two ends, and a progression between them.
#[derive(Clone, Copy)]
struct Row {
    start: u32,
    inner: Side,
    end: u32,
    length: u32,
}

impl Row {
    #[inline]
    fn at(self, j: u32) -> u32 {
        if j == 0 {
            self.start
        } else if j == self.length {
            self.end
        } else {
            self.inner.at(j)
        }
    }
}

impl Patch {
    fn of(mesh: &TriangleMesh<'_>, level: SubdivisionLevel, triangle: u32) -> Option<Self> {
        let steps = level.steps();
        let inner = steps - 1;
        let &[a, b, c] = mesh.triangles().get(triangle as usize)?;
        let [edge_ab, edge_bc, edge_ca] = mesh.edges_of(triangle)?;
        // Points of an edge are numbered from its lower vertex to its higher one.
        let side = |edge: u32, from: u16, to: u16| {
            let first = mesh.vertices() + edge * inner;
            if from < to {
                Side { first, stride: 1 }
            } else {
                Side { first: (first + inner).wrapping_sub(1), stride: u32::MAX }
            }
        };
        let before = mesh.vertices() + mesh.counts().edges as u32 * inner;
        Some(Self {
            steps,
            corners: [a, b, c].map(u32::from),
            ab: side(edge_ab, a, b),
            bc: side(edge_bc, b, c),
            ac: side(edge_ca, a, c),
            interior: before + triangle * interior_points(level) as u32,
        })
    }

    /// The rows in order, from ac to b.
    fn rows(&self) -> impl Iterator<Item = Row> {
        let [a, b, c] = self.corners;
        let steps = self.steps;
        let mut interior = self.interior;
        (0..=steps).map(move |row| {
            let length = steps - row;
            if row == 0 {
                return Row { start: a, inner: self.ac, end: c, length };
            }
            if length == 0 {
                return Row { start: b, inner: self.ac, end: b, length };
            }
            let inner = Side { first: interior, stride: 1 };
            interior += length - 1;
            // On bc the steps count from b.
            Row { start: self.ab.at(row), inner, end: self.bc.at(length), length }
        })
    }

    fn write(&self, mut children: &mut [[u32; 3]]) {
        for (row, next) in self.rows().zip(self.rows().skip(1)) {
            let Some((strip, rest)) = children.split_at_mut_checked(2 * row.length as usize - 1) else { return };
            children = rest;
            let (mut here, mut beside) = (row.start, next.start);
            let (pairs, last) = strip.as_chunks_mut::<2>();
            for (j, [same_way, opposite]) in pairs.iter_mut().enumerate() {
                let (here_on, beside_on) = (row.at(j as u32 + 1), next.at(j as u32 + 1));
                *same_way = [here, beside, here_on];
                *opposite = [beside, beside_on, here_on];
                (here, beside) = (here_on, beside_on);
            }
            if let [last] = last {
                *last = [here, beside, row.end];
            }
        }
    }
}
