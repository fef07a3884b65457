//! Nested convex hulls ("onion layers") of a set of points.
//!
//! The strict vertices of the hull of all points are layer 0. They leave; the strict vertices of the hull of the others
//! are layer 1, and so on, until what is left has no area. A point on an edge of a layer between two vertices stays for
//! a later layer. Points at the same place are one point: the lowest number is in the layer or the remainder, the
//! others are [`HullLayers::duplicates`] and share its layer.
//!
//! So the layers of a set do not depend on the order of its points, and an affine map that is exact in integers
//! changes only where a layer begins and, if it mirrors, which way it goes.

use super::chain::{Outline, strict_hull};
use super::error::GeometryError;
use super::fence::{Fence, Parking};
use super::key::{self, Key};
use crate::point::ImagePoint;

/// No layer; there are fewer layers than this.
const NONE: u16 = u16::MAX;

/// Fewer points are all looked at for each layer.
const MANY: usize = 400;

/// What is left within the innermost layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Remainder<'a> {
    /// Nothing: every point is in a layer.
    None,
    /// One point.
    Point(u16),
    /// Two points, or more on one line: all of them from end to end, in the order of (x, y).
    Line(&'a [u16]),
}

/// The nested hulls of at most `POINTS` points in at most `LAYERS` layers; `POINTS / 3` layers are always enough.
///
/// 22 bytes a point and 2 a layer: see [`Self::BYTES`].
///
/// ```
/// use daymark_core::geometry::{HullLayers, Remainder};
/// use daymark_core::point::ImagePoint;
///
/// let points = [(0, 0), (3, 3), (9, 0), (9, 9), (5, 3), (0, 9), (4, 6), (4, 4)];
/// let mut layers = HullLayers::<8, 2>::new();
/// layers.peel(&points.map(|(x, y)| ImagePoint::new(x, y)))?;
/// assert_eq!(layers.layer(0), [0, 2, 3, 5]);
/// assert_eq!(layers.layer(1), [1, 4, 6]);
/// assert_eq!(layers.remainder(), Remainder::Point(7));
/// # Ok::<(), daymark_core::geometry::GeometryError>(())
/// ```
#[derive(Debug, Clone)]
pub struct HullLayers<const POINTS: usize, const LAYERS: usize> {
    /// The points without a layer yet, sorted.
    left: [Key; POINTS],
    stack: [Key; POINTS],
    /// The numbers of the points: layer after layer, then the remainder, then the duplicates.
    order: [u16; POINTS],
    /// Where each layer ends in `order`.
    ends: [u16; LAYERS],
    /// The layer of each point; [`NONE`] in the remainder.
    layer_of: [u16; POINTS],
    /// The point that stands for each.
    same_as: [u16; POINTS],
    layers: usize,
    distinct: usize,
    points: usize,
}

impl<const POINTS: usize, const LAYERS: usize> HullLayers<POINTS, LAYERS> {
    /// The bytes of this type.
    pub const BYTES: usize = size_of::<Self>();

    /// The layers of no points.
    pub const fn new() -> Self {
        const { assert!(POINTS <= u16::MAX as usize, "a point has 16 bits for its number") };
        Self {
            left: [Key::NONE; POINTS],
            stack: [Key::NONE; POINTS],
            order: [0; POINTS],
            ends: [0; LAYERS],
            layer_of: [NONE; POINTS],
            same_as: [0; POINTS],
            layers: 0,
            distinct: 0,
            points: 0,
        }
    }

    /// Finds the layers of these points.
    ///
    /// # Errors
    ///
    /// More than `POINTS` points, more than `LAYERS` layers, or a point beyond
    /// [`COORDINATE_LIMIT`](super::COORDINATE_LIMIT). There are no layers then, and no points.
    pub fn peel(&mut self, points: &[ImagePoint]) -> Result<(), GeometryError> {
        (self.layers, self.distinct, self.points) = (0, 0, 0);
        for (number, (same_as, layer)) in (0..).zip(self.same_as.iter_mut().zip(&mut self.layer_of)).take(points.len())
        {
            (*same_as, *layer) = (number, NONE);
        }
        let distinct = key::arrange(points, &mut self.left, &mut self.stack, |number, first| {
            if let Some(same_as) = self.same_as.get_mut(usize::from(number)) {
                *same_as = first;
            }
        })?;
        if distinct < points.len() {
            let merged = (0..).zip(&self.same_as).take(points.len()).filter(|(number, first)| number != *first);
            for (slot, (number, _)) in self.order.iter_mut().skip(distinct).zip(merged) {
                *slot = number;
            }
        }
        let layers = self.peel_distinct(distinct, MANY)?;
        (self.layers, self.distinct, self.points) = (layers, distinct, points.len());
        Ok(())
    }

    /// Takes the sorted points `left` apart and returns the number of layers. At least `many` points are parked behind a
    /// fence; the result does not depend on it.
    fn peel_distinct(&mut self, distinct: usize, many: usize) -> Result<usize, GeometryError> {
        let mut left = self.left.get_mut(..distinct).unwrap_or_default();
        let mut parking = Parking { active: distinct, parked: distinct };
        let (mut fence, mut refused) = (None, 0);
        let (mut layers, mut end) = (0, 0);
        loop {
            let parked = left.len() - parking.parked;
            let active = left.get_mut(..parking.active).unwrap_or_default();
            let outline = strict_hull(active, &mut self.stack);
            // A fence may lie on a line, too; what is parked there would be lost.
            let has_area = outline.vertices >= 3;
            let is_fenced = |fence: Fence| has_area && fence.is_within(&self.stack, outline);
            if parked > 0 && !fence.is_some_and(is_fenced) {
                // What is parked may reach beyond the hull: park less, or nothing if that did not help before.
                let again = has_area && parked >= many && refused < 2;
                fence = if again { fence_within(&self.stack, outline, parked) } else { None };
                parking.release(left, &mut self.stack, fence.as_ref());
                refused += 1;
                continue;
            }
            refused = 0;
            if !has_area {
                for (slot, key) in self.order.iter_mut().skip(end).zip(active) {
                    *slot = key.number();
                }
                return Ok(layers);
            }
            let Some(layer_end) = self.ends.get_mut(layers) else {
                return Err(GeometryError::TooManyLayers { capacity: LAYERS, points_left: parking.active + parked });
            };
            for (slot, key) in self.order.iter_mut().skip(end).zip(self.stack.iter().take(outline.vertices)) {
                *slot = key.number();
                if let Some(layer) = self.layer_of.get_mut(usize::from(key.number())) {
                    *layer = layers as u16;
                }
            }
            end += outline.vertices;
            *layer_end = end as u16;
            layers += 1;
            let mut kept = 0;
            for at in 0..parking.active {
                let Some(&key) = active.get(at) else { break };
                let stays = self.layer_of.get(usize::from(key.number())) == Some(&NONE);
                if let Some(slot) = active.get_mut(kept) {
                    *slot = key;
                }
                kept += usize::from(stays);
            }
            parking.active = kept;
            if parked == 0 && kept >= many {
                fence = fence_within(&self.stack, outline, kept);
                if fence.is_some() {
                    left = core::mem::take(&mut left).get_mut(..kept).unwrap_or_default();
                    parking = Parking { active: 0, parked: 0 };
                    parking.release(left, &mut self.stack, fence.as_ref());
                }
            }
        }
    }

    /// The number of layers.
    pub const fn len(&self) -> usize {
        self.layers
    }

    /// Whether there is no layer: no points, or all on one line.
    pub const fn is_empty(&self) -> bool {
        self.layers == 0
    }

    /// The number of points that were given.
    pub const fn points(&self) -> usize {
        self.points
    }

    /// The vertices of layer `number`, 0 the outermost: clockwise as seen, from the least in the order of (x, y). Empty
    /// if there is no such layer.
    pub fn layer(&self, number: usize) -> &[u16] {
        if number >= self.layers {
            return &[];
        }
        let end = |layer: usize| self.ends.get(layer).copied().map_or(0, usize::from);
        let start = number.checked_sub(1).map_or(0, end);
        self.order.get(start..end(number)).unwrap_or(&[])
    }

    /// The layers from the outermost to the innermost.
    pub fn layers(&self) -> impl ExactSizeIterator<Item = &[u16]> + DoubleEndedIterator + Clone {
        (0..self.layers).map(|number| self.layer(number))
    }

    /// The layer of a point; `None` in the remainder, or if there is no such point.
    pub fn layer_of(&self, point: u16) -> Option<u16> {
        let layer = *self.layer_of.get(usize::from(self.same_as(point)?))?;
        (layer != NONE).then_some(layer)
    }

    /// What is left within the innermost layer.
    pub fn remainder(&self) -> Remainder<'_> {
        let end = self.layers.checked_sub(1).and_then(|last| self.ends.get(last)).copied().map_or(0, usize::from);
        match self.order.get(end..self.distinct).unwrap_or(&[]) {
            [] => Remainder::None,
            &[point] => Remainder::Point(point),
            line => Remainder::Line(line),
        }
    }

    /// The point with the lowest number at the same place, which is the point itself unless it is one of
    /// [`Self::duplicates`]; `None` if there is no such point.
    pub fn same_as(&self, point: u16) -> Option<u16> {
        self.same_as.get(..self.points)?.get(usize::from(point)).copied()
    }

    /// The points at the place of one with a lower number: neither in [`Self::layer`] nor in [`Self::remainder`].
    /// In ascending order.
    pub fn duplicates(&self) -> &[u16] {
        self.order.get(self.distinct..self.points).unwrap_or(&[])
    }
}

/// A fence so deep within a hull that it costs least to look at all `parked` points whenever a layer reaches it.
///
/// With points spread evenly a layer has about as many as the latest, h of m. If hull and fence are t layers apart, t h / 2
/// points are at work on the average, and m are looked at every t layers. The sum is least for t ~ sqrt(m / h): a share of
/// sqrt(h / m) of the area, and half of that of the way to the middle. As the layers reach a fence unevenly, half as
/// deep again is better.
fn fence_within(hull: &[Key], outline: Outline, parked: usize) -> Option<Fence> {
    let share = (((outline.vertices as u64) << 32) / (parked as u64).max(1)).isqrt() * 3 / 4;
    Fence::within(hull, outline, share.min(1 << 15))
}

impl<const POINTS: usize, const LAYERS: usize> Default for HullLayers<POINTS, LAYERS> {
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
    fn points_on_an_edge_stay_for_the_next_layer() {
        // 3 x 3: the corners, then the middles of the sides, then the centre.
        let grid: [(i32, i32); 9] = core::array::from_fn(|i| ((i % 3) as i32, (i / 3) as i32));
        let mut layers = HullLayers::<9, 3>::new();
        layers.peel(&points(grid)).unwrap();
        assert!(layers.layers().eq([[0, 2, 8, 6], [3, 1, 5, 7]]));
        assert_eq!(layers.remainder(), Remainder::Point(4));
        assert_eq!((layers.len(), layers.points()), (2, 9));
        assert_eq!((layers.layer_of(8), layers.layer_of(7), layers.layer_of(4)), (Some(0), Some(1), None));
        assert_eq!((layers.layer_of(9), layers.same_as(9)), (None, None));
        assert_eq!(layers.layer(2), [0_u16; 0]);
    }

    #[test]
    fn duplicates_share_the_layer_of_the_lowest_number() {
        let mut layers = HullLayers::<8, 2>::new();
        layers.peel(&points([(0, 0), (9, 0), (0, 9), (2, 2), (9, 0), (2, 2), (9, 0), (0, 0)])).unwrap();
        assert!(layers.layers().eq([[0, 1, 2]]));
        assert_eq!(layers.remainder(), Remainder::Point(3));
        assert_eq!(layers.duplicates(), [4, 5, 6, 7]);
        let merged = [0, 1, 2, 3, 4, 5, 6, 7].map(|point| (layers.same_as(point), layers.layer_of(point)));
        let (out, within) = (|same| (Some(same), Some(0)), (Some(3), None));
        assert_eq!(merged, [out(0), out(1), out(2), within, out(1), within, out(1), out(0)]);
    }

    #[test]
    fn what_has_no_area_is_the_remainder() {
        let mut layers = HullLayers::<8, 2>::new();
        assert_eq!((layers.remainder(), layers.is_empty()), (Remainder::None, true));
        layers.peel(&points([(5, 1), (3, 1), (4, 1), (3, 1)])).unwrap();
        assert_eq!(layers.remainder(), Remainder::Line(&[1, 2, 0]));
        assert_eq!((layers.is_empty(), layers.duplicates()), (true, &[3_u16][..]));
        layers.peel(&points([(0, 0), (9, 0), (9, 9), (0, 9), (4, 5), (4, 4), (4, 3)])).unwrap();
        assert_eq!((layers.len(), layers.remainder()), (1, Remainder::Line(&[6, 5, 4])));
        layers.peel(&points([(0, 0), (9, 0), (9, 9)])).unwrap();
        assert_eq!((layers.len(), layers.remainder()), (1, Remainder::None));
        layers.peel(&[]).unwrap();
        assert_eq!((layers.len(), layers.remainder(), layers.points()), (0, Remainder::None, 0));
    }

    #[test]
    fn too_much_is_refused_with_numbers() {
        let mut layers = HullLayers::<7, 1>::new();
        assert_eq!(
            layers.peel(&[ImagePoint::default(); 8]),
            Err(GeometryError::TooManyPoints { found: 8, capacity: 7 })
        );
        let two = points([(0, 0), (9, 0), (0, 9), (2, 2), (3, 2), (2, 3), (9, 0)]);
        assert_eq!(layers.peel(&two), Err(GeometryError::TooManyLayers { capacity: 1, points_left: 3 }));
        assert_eq!((layers.len(), layers.points(), layers.remainder()), (0, 0, Remainder::None));
        assert_eq!((layers.layer_of(0), layers.duplicates()), (None, &[][..]));
        let far = points([(0, 0), (0, 1 << 23)]);
        let limit = super::super::COORDINATE_LIMIT;
        assert_eq!(layers.peel(&far), Err(GeometryError::CoordinateOutOfRange { point: 1, found: 1 << 23, limit }));
    }

    #[test]
    fn parking_changes_nothing() {
        const POINTS: usize = 160;
        let mut state = 3_u64;
        let mut random = |end: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % end) as i32
        };
        let mut storage = HullLayers::<POINTS, 53>::new();
        let mut peel = |points: &[ImagePoint], many: usize| {
            let distinct = key::arrange(points, &mut storage.left, &mut storage.stack, |_, _| {}).unwrap();
            storage.layer_of = [NONE; POINTS];
            let layers = storage.peel_distinct(distinct, many).unwrap();
            (layers, storage.order, storage.ends, storage.layer_of)
        };
        for (width, height) in [(5, 5), (40, 3), (3, 40), (30, 30), (10_000, 10_000), (1 << 23, 1 << 23)] {
            for count in (1..POINTS).chain([POINTS; 40]) {
                // Some in a heap, so that fences and layers meet unevenly.
                let spread: [u64; 2] = if count % 3 == 0 { [width / 5 + 1, height] } else { [width, height] };
                let mut points = [ImagePoint::default(); POINTS];
                points.fill_with(|| {
                    let [width, height] = if random(2) == 0 { spread } else { [width, height] };
                    ImagePoint::new(random(width), random(height))
                });
                let points = points.get(..count).unwrap();
                let without = peel(points, usize::MAX);
                for many in [1, 4, 20] {
                    let (layers, order, ends, layer_of) = peel(points, many);
                    assert_eq!(layers, without.0, "{points:?}");
                    assert_eq!(ends.get(..layers), without.2.get(..layers), "{points:?}");
                    assert_eq!((order, layer_of), (without.1, without.3), "{points:?}");
                }
            }
        }
    }

    #[test]
    fn bytes_are_as_documented() {
        const HEAD: usize = 3 * size_of::<usize>();
        assert_eq!(HullLayers::<48, 16>::BYTES, 22 * 48 + 2 * 16 + HEAD);
        assert_eq!(HullLayers::<1_000, 332>::BYTES, 22 * 1_000 + 2 * 332 + HEAD);
    }
}
