//! The thesis' first ordering (5.2): triangle areas in rising order, and ratios of consecutive ones. A baseline.

use super::predicate::twice_area;
use super::quad::{AreaRatio, Tolerance};
use crate::point::ImagePoint;

/// A triangle of three of the points, numbers rising, with twice its area in (1/16 px)².
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Triangle {
    /// Twice the area, without sign.
    pub area: i64,
    /// Numbers of its corners, rising.
    pub corners: [u16; 3],
}

/// Triangles of so many points: `n (n - 1) (n - 2) / 6`.
pub const fn triangles_of(points: usize) -> usize {
    if points < 3 { 0 } else { points * (points - 1) * (points - 2) / 6 }
}

/// All triangles with an area, in rising order of area; equal areas by corners. `scratch` needs [`triangles_of`] entries;
/// with fewer the last triangles are left out. Cost: `O(n³ log n)`: the thesis' "time-consuming".
pub fn ordered<'a>(points: &[ImagePoint], scratch: &'a mut [Triangle]) -> &'a [Triangle] {
    let mut count = 0;
    for (i, &a) in (0_u16..).zip(points) {
        for (j, &b) in (0_u16..).zip(points).skip(usize::from(i) + 1) {
            for (k, &c) in (0_u16..).zip(points).skip(usize::from(j) + 1) {
                let area = twice_area(a, b, c).saturating_abs();
                if area > 0
                    && let Some(place) = scratch.get_mut(count)
                {
                    *place = Triangle { area, corners: [i, j, k] };
                    count += 1;
                }
            }
        }
    }
    let triangles = scratch.get_mut(..count).unwrap_or_default();
    super::heap_sort::sort_by(triangles, |a, b| (a.area, a.corners) < (b.area, b.corners));
    triangles
}

/// Pairs of triangles whose ratio to the next larger triangle agrees: entry `k` of the first order with entry `l` of the
/// second. A lost corner removes `(n - 1) (n - 2) / 2` triangles and breaks most ratios, which is why hulls are better.
pub fn matching<'a>(
    first: &'a [Triangle],
    second: &'a [Triangle],
    eps: Tolerance,
) -> impl Iterator<Item = (Triangle, Triangle)> + 'a {
    let next = |list: &'a [Triangle]| list.iter().copied().zip(list.iter().copied().skip(1));
    let ratio = |(small, large): (Triangle, Triangle)| AreaRatio { upper: large.area, lower: small.area };
    next(first).flat_map(move |one| {
        let agreeing = next(second).filter(move |&two| ratio(one).agrees(ratio(two), eps));
        agreeing.map(move |two| (one.0, two.0))
    })
}
