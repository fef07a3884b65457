//! The features of a frame, arranged for lookup by place.

use crate::extract::Features;
use crate::kernel::NUMBER_LIMIT;

/// Cells across and down; a cell of a 640 x 480 frame is 40 px wide.
const GRID: [usize; 2] = [16, 12];
const CELLS: usize = GRID[0] * GRID[1];
/// Radius of the discs of [`QueryIndex::crowd`], in pixels.
pub const CROWD_RADIUS: f32 = 10.0;

/// A query feature where it stands in the grid's order.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Placed {
    position: [f32; 2],
    number: u16,
    level: u8,
}

/// At most `FEATURES` features in the order of a grid over the frame, so that a disc is a few runs of memory.
#[derive(Debug, Clone)]
pub struct QueryIndex<const FEATURES: usize> {
    placed: [Placed; FEATURES],
    starts: [u16; CELLS + 1],
    per_pixel: [f32; 2],
    crowd: u32,
}

impl<const FEATURES: usize> QueryIndex<FEATURES> {
    /// An index of nothing.
    pub const fn new() -> Self {
        const { assert!(FEATURES <= NUMBER_LIMIT as usize + 1, "a candidate has 11 bits for a corner of the frame") };
        Self {
            placed: [Placed { position: [0.0; 2], number: 0, level: 0 }; FEATURES],
            starts: [0; CELLS + 1],
            per_pixel: [0.0; 2],
            crowd: 0,
        }
    }

    /// Arranges these features; those beyond `FEATURES` are left out. Within a cell they keep their order.
    pub fn arrange(&mut self, features: Features<'_>) {
        self.per_pixel =
            [GRID[0] as f32 / f32::from(features.width.max(1)), GRID[1] as f32 / f32::from(features.height.max(1))];
        self.starts = [0; CELLS + 1];
        let positions = || features.positions.iter().take(FEATURES).map(|position| position.to_pixels());
        // Counting sort: first the sizes, one cell ahead; then their sums; then each feature at its cell's next place.
        for position in positions() {
            let cell = self.cell(position);
            if let Some(count) = self.starts.get_mut(cell + 1) {
                *count += 1;
            }
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        let mut next = self.starts;
        for ((number, position), &level) in positions().enumerate().zip(features.levels) {
            let cell = self.cell(position);
            if let Some(place) = next.get_mut(cell) {
                if let Some(placed) = self.placed.get_mut(usize::from(*place)) {
                    *placed = Placed { position, number: number as u16, level };
                }
                *place += 1;
            }
        }
        self.crowd = self.most_within(CROWD_RADIUS);
    }

    /// At least as many features as lie in any disc of [`CROWD_RADIUS`].
    pub const fn crowd(&self) -> u32 {
        self.crowd
    }

    /// The features of the cells that a disc can touch, at most.
    fn most_within(&self, radius: f32) -> u32 {
        // The thousandth covers what the cells of its two ends were rounded by.
        let [across, down] = self.per_pixel.map(|per_pixel| (2.0 * radius * per_pixel + 1e-3) as usize + 2);
        let run = |row: usize, left: usize| {
            let bound = |column: usize| self.starts.get(row * GRID[0] + column).map_or(0, |&start| u32::from(start));
            bound((left + across).min(GRID[0])) - bound(left)
        };
        let mut most = 0;
        for top in 0..GRID[1] {
            for left in 0..GRID[0] {
                let sum = (top..(top + down).min(GRID[1])).map(|row| run(row, left)).sum();
                most = if sum > most { sum } else { most };
            }
        }
        most
    }

    fn cell_along(&self, axis: usize, coordinate: f32) -> usize {
        let (cells, per_pixel) = if axis == 0 { (GRID[0], self.per_pixel[0]) } else { (GRID[1], self.per_pixel[1]) };
        // The cast saturates: left of the frame is cell 0.
        ((coordinate * per_pixel) as usize).min(cells - 1)
    }

    fn cell(&self, [x, y]: [f32; 2]) -> usize {
        self.cell_along(1, y) * GRID[0] + self.cell_along(0, x)
    }

    /// Calls `visit(number, level, squared distance)` for every feature within `radius` px of a point, in the order of
    /// the grid.
    #[inline]
    pub fn within(&self, [x, y]: [f32; 2], radius: f32, mut visit: impl FnMut(u16, u8, f32)) {
        let limit = radius * radius;
        let (left, right) = (self.cell_along(0, x - radius), self.cell_along(0, x + radius));
        for row in self.cell_along(1, y - radius)..=self.cell_along(1, y + radius) {
            let bound = |column: usize| self.starts.get(row * GRID[0] + column).map_or(0, |&start| usize::from(start));
            let run = self.placed.get(bound(left)..bound(right + 1)).unwrap_or(&[]);
            for placed in run {
                let [dx, dy] = [placed.position[0] - x, placed.position[1] - y];
                let squared = dx * dx + dy * dy;
                if squared <= limit {
                    visit(placed.number, placed.level, squared);
                }
            }
        }
    }
}

impl<const FEATURES: usize> Default for QueryIndex<FEATURES> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::Signature;
    use crate::point::ImagePoint;

    #[test]
    fn no_disc_holds_more_than_the_crowd() {
        let mut state = 7_u64;
        let mut below = |limit: i32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as i32) % limit
        };
        let (mut index, mut tightest) = (QueryIndex::<400>::new(), u32::MAX);
        for (width, height) in [(640, 480), (320, 240), (97, 64), (24, 2_000)] {
            // Half of them in one heap.
            let positions: [ImagePoint; 400] = core::array::from_fn(|number| {
                let (width, height) = if number % 2 == 0 { (width, height) } else { (width.min(60), height.min(50)) };
                ImagePoint { x: below(width * 16), y: below(height * 16) }
            });
            let (width, height) = (width as u16, height as u16);
            let rest = (&[0; 400], &[0; 400], &[Signature([0; 2]); 400]);
            index.arrange(Features {
                positions: &positions,
                levels: rest.0,
                commonness: rest.1,
                signatures: rest.2,
                width,
                height,
            });
            for position in positions {
                let mut found = 0;
                index.within(position.to_pixels(), CROWD_RADIUS, |_, _, _| found += 1);
                assert!(found <= index.crowd(), "{found} of {}", index.crowd());
                tightest = tightest.min(index.crowd() - found);
            }
        }
        assert!(tightest < 100, "the bound says something: {tightest}");
    }
}
