//! What the vertices of a mesh carry and subdivision hands on: positions, points of space, intensities.

use core::fmt::Debug;

use super::counts::SubdivisionLevel;
use crate::point::{ImagePoint, SUBPIXEL};

/// A value at each vertex that is linear on every triangle.
///
/// At weights `(n - i - j, i, j)` of corners a, b, c, with `n = 2^level`, it is `a + i (b - a) / n + j (c - a) / n`, in
/// this order. One definition for both forms of subdivision, so that they agree to the last bit.
pub trait VertexValue: Copy {
    /// The value at a point of a level.
    type Fine: Copy + Debug;
    /// The difference between two neighbouring points.
    type Step: Copy + Debug;

    /// Whether no point of any level leaves the range of [`Self::Fine`].
    fn is_in_range(&self) -> bool;

    /// The value at the vertex itself.
    fn at_vertex(self, level: SubdivisionLevel) -> Self::Fine;

    /// One step of `2^level` to another vertex.
    fn step_to(self, end: Self, level: SubdivisionLevel) -> Self::Step;

    /// `count` steps further, at most `2^level`.
    fn advanced(start: Self::Fine, step: Self::Step, count: u32) -> Self::Fine;
}

/// A point of a level in `1 / 2^level` of 1/16 px, exact: frame of reference as in [`crate::point`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct FinePoint {
    /// Right of the centre of the first column, in `1 / 2^level` of 1/16 px.
    pub x: i32,
    /// Below the centre of the first row, in `1 / 2^level` of 1/16 px.
    pub y: i32,
}

impl FinePoint {
    /// The coordinates in pixels, exact while they have 24 significant bits (frames to 8,192 px at level 7).
    pub const fn to_pixels(self, level: SubdivisionLevel) -> [f32; 2] {
        let unit = (SUBPIXEL << level.number()) as f32;
        [self.x as f32 / unit, self.y as f32 / unit]
    }

    /// The nearest point in 1/16 px, half a step rounded right and down.
    pub const fn to_image_point(self, level: SubdivisionLevel) -> ImagePoint {
        let half = level.steps() as i32 / 2;
        ImagePoint::new((self.x + half) >> level.number(), (self.y + half) >> level.number())
    }
}

/// The largest coordinate of a vertex, in 1/16 px: 524,287.9 px. Times 2^7 it and its differences fit an `i32`.
const LARGEST_COORDINATE: u32 = (1 << 23) - 1;

/// Exact: the values are `2^level` times as large, and so are integers.
impl VertexValue for ImagePoint {
    type Fine = FinePoint;
    type Step = FinePoint;

    fn is_in_range(&self) -> bool {
        self.x.unsigned_abs() <= LARGEST_COORDINATE && self.y.unsigned_abs() <= LARGEST_COORDINATE
    }

    #[inline]
    fn at_vertex(self, level: SubdivisionLevel) -> FinePoint {
        FinePoint { x: self.x << level.number(), y: self.y << level.number() }
    }

    #[inline]
    fn step_to(self, end: Self, _: SubdivisionLevel) -> FinePoint {
        FinePoint { x: end.x - self.x, y: end.y - self.y }
    }

    #[inline]
    fn advanced(start: FinePoint, step: FinePoint, count: u32) -> FinePoint {
        FinePoint { x: start.x + step.x * count as i32, y: start.y + step.y * count as i32 }
    }
}

/// The largest number that may stand at a vertex, 2^100: differences and products stay finite.
const LARGEST_NUMBER: f32 = (1_u128 << 100) as f32;

/// Points of space, colours, intensities (`[f32; 1]`). Exact at the vertices and where all corners are equal; elsewhere
/// within `2^-20` of the largest magnitude of the corners.
impl<const COMPONENTS: usize> VertexValue for [f32; COMPONENTS] {
    type Fine = Self;
    type Step = Self;

    fn is_in_range(&self) -> bool {
        self.iter().all(|number| number.abs() <= LARGEST_NUMBER)
    }

    #[inline]
    fn at_vertex(self, _: SubdivisionLevel) -> Self {
        self
    }

    #[inline]
    fn step_to(self, end: Self, level: SubdivisionLevel) -> Self {
        let share = 1.0 / level.steps() as f32;
        let mut step = self;
        for (from, to) in step.iter_mut().zip(end) {
            *from = (to - *from) * share;
        }
        step
    }

    #[inline]
    fn advanced(start: Self, step: Self, count: u32) -> Self {
        let mut value = start;
        for (number, step) in value.iter_mut().zip(step) {
            *number += step * count as f32;
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_coordinates_fit() {
        let far = LARGEST_COORDINATE as i32;
        let (a, b) = (ImagePoint::new(far, -far), ImagePoint::new(-far, far));
        assert!(a.is_in_range() && b.is_in_range());
        assert!(!ImagePoint::new(far + 1, 0).is_in_range() && !ImagePoint::new(0, i32::MIN).is_in_range());
        let level = SubdivisionLevel::SEVEN;
        let end = ImagePoint::advanced(a.at_vertex(level), a.step_to(b, level), 128);
        assert_eq!(end, b.at_vertex(level));
    }

    #[test]
    fn no_nan_and_no_infinity_enters() {
        assert!([0.0, -LARGEST_NUMBER].is_in_range());
        for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0 * LARGEST_NUMBER] {
            assert!(![0.0, number].is_in_range());
        }
        let level = SubdivisionLevel::ONE;
        let step = [LARGEST_NUMBER].step_to([-LARGEST_NUMBER], level);
        assert_eq!(<[f32; 1]>::advanced([LARGEST_NUMBER], step, 1), [0.0]);
    }

    #[test]
    fn units_of_a_fine_point() {
        let point = FinePoint { x: 16 * 4 * 3 + 2, y: -7 };
        assert_eq!(point.to_pixels(SubdivisionLevel::TWO), [3.031_25, -0.109_375]);
        assert_eq!(point.to_image_point(SubdivisionLevel::TWO), ImagePoint::new(49, -2));
        assert_eq!(point.to_image_point(SubdivisionLevel::ZERO), ImagePoint::new(194, -7));
    }
}
