//! The convex hull of a set of points.

use super::chain::strict_hull;
use super::error::GeometryError;
use super::key::{self, Key};
use crate::point::ImagePoint;

/// The convex hull of a set, by the numbers of its strict vertices: no vertex lies on a line with its neighbours, none
/// at the place of another (the lowest number stands for a place).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hull<'a> {
    /// There are no points.
    Empty,
    /// All points are at the same place.
    Point(u16),
    /// All points are on one line: its two ends, first the lesser in the order of (x, y).
    Segment([u16; 2]),
    /// At least three vertices, clockwise as seen, from the least in the order of (x, y).
    Polygon(&'a [u16]),
}

/// Finds the convex hull of at most `POINTS` points, in 18 bytes a point.
#[derive(Debug, Clone)]
pub struct ConvexHull<const POINTS: usize> {
    keys: [Key; POINTS],
    stack: [Key; POINTS],
    vertices: [u16; POINTS],
    count: usize,
}

impl<const POINTS: usize> ConvexHull<POINTS> {
    /// The hull of no points.
    pub const fn new() -> Self {
        const { assert!(POINTS <= u16::MAX as usize, "a point has 16 bits for its number") };
        Self { keys: [Key::NONE; POINTS], stack: [Key::NONE; POINTS], vertices: [0; POINTS], count: 0 }
    }

    /// The hull of these points; it stays readable as [`Self::hull`].
    ///
    /// # Errors
    ///
    /// More than `POINTS` points, or one beyond [`COORDINATE_LIMIT`](super::COORDINATE_LIMIT). The hull is then empty.
    pub fn enclose(&mut self, points: &[ImagePoint]) -> Result<Hull<'_>, GeometryError> {
        self.count = 0;
        let distinct = key::arrange(points, &mut self.keys, &mut self.stack, |_, _| {})?;
        let keys = self.keys.get(..distinct).unwrap_or(&[]);
        self.count = strict_hull(keys, &mut self.stack).vertices;
        for (vertex, key) in self.vertices.iter_mut().zip(&self.stack).take(self.count) {
            *vertex = key.number();
        }
        Ok(self.hull())
    }

    /// The latest hull.
    pub fn hull(&self) -> Hull<'_> {
        match self.vertices.get(..self.count).unwrap_or(&[]) {
            [] => Hull::Empty,
            &[point] => Hull::Point(point),
            &[first, last] => Hull::Segment([first, last]),
            polygon => Hull::Polygon(polygon),
        }
    }
}

impl<const POINTS: usize> Default for ConvexHull<POINTS> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points<const N: usize>(coordinates: [(i32, i32); N]) -> [ImagePoint; N] {
        coordinates.map(|(x, y)| ImagePoint::new(x, y))
    }

    #[test]
    fn strict_vertices_clockwise_from_the_least() {
        // A square with a point within, one in the middle of each side, and each corner twice.
        let square = points([
            (0, 0),
            (4, 4),
            (4, 0),
            (0, 4),
            (2, 1),
            (2, 0),
            (4, 2),
            (2, 4),
            (0, 2),
            (4, 4),
            (0, 0),
            (0, 4),
            (4, 0),
        ]);
        let mut hull = ConvexHull::<13>::new();
        assert_eq!(hull.enclose(&square), Ok(Hull::Polygon(&[0, 2, 1, 3])));
        assert_eq!(hull.hull(), Hull::Polygon(&[0, 2, 1, 3]));
    }

    #[test]
    fn sets_without_area_are_told() {
        let mut hull = ConvexHull::<5>::new();
        assert_eq!(hull.enclose(&[]), Ok(Hull::Empty));
        assert_eq!(hull.enclose(&points([(3, 4)])), Ok(Hull::Point(0)));
        assert_eq!(hull.enclose(&points([(3, 4); 5])), Ok(Hull::Point(0)));
        assert_eq!(hull.enclose(&points([(3, 4), (3, 1), (3, 4)])), Ok(Hull::Segment([1, 0])));
        assert_eq!(hull.enclose(&points([(2, 1), (4, 2), (0, 0), (6, 3), (0, 0)])), Ok(Hull::Segment([2, 3])));
        assert_eq!(hull.enclose(&points([(2, 1), (4, 2), (0, 0), (6, 4), (0, 0)])), Ok(Hull::Polygon(&[2, 1, 3])));
        let mut none = ConvexHull::<0>::new();
        assert_eq!(none.enclose(&[]), Ok(Hull::Empty));
        assert_eq!(none.enclose(&points([(0, 0)])), Err(GeometryError::TooManyPoints { found: 1, capacity: 0 }));
    }

    #[test]
    fn a_refused_set_leaves_no_hull() {
        use super::super::COORDINATE_LIMIT as L;
        let mut hull = ConvexHull::<4>::new();
        let good = points([(-L, -L), (L, -L), (L, L), (-L, L)]);
        assert_eq!(hull.enclose(&good), Ok(Hull::Polygon(&[0, 1, 2, 3])));
        let bad = points([(0, 0), (1, -L - 1), (L + 1, 0)]);
        let found = Err(GeometryError::CoordinateOutOfRange { point: 1, found: -L - 1, limit: L });
        assert_eq!(hull.enclose(&bad), found);
        assert_eq!(hull.hull(), Hull::Empty);
        let lowest = points([(i32::MIN, 0)]);
        let found = Err(GeometryError::CoordinateOutOfRange { point: 0, found: i32::MIN, limit: L });
        assert_eq!(hull.enclose(&lowest), found);
        assert_eq!(
            hull.enclose(&[ImagePoint::default(); 5]),
            Err(GeometryError::TooManyPoints { found: 5, capacity: 4 })
        );
        assert_eq!(hull.hull(), Hull::Empty);
    }
}
