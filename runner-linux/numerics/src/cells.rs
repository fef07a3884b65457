//! Rectangles of a picture by the cells that they touch: what lies at a place without asking all of them.

use std::ops::Range;

/// Lowest and highest coordinates of a triangle.
pub fn bounds([a, b, c]: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
    [
        [0, 1].map(|axis: usize| a[axis].min(b[axis]).min(c[axis])),
        [0, 1].map(|axis: usize| a[axis].max(b[axis]).max(c[axis])),
    ]
}

/// Side of a cell, pixels.
const CELL_PX: f64 = 16.0;
/// Cells in a row and rows, at most; what lies beyond belongs to the last ones.
const MAX_CELLS: f64 = 256.0;

/// Numbered rectangles of a picture, by square cells that they touch.
#[derive(Debug)]
pub struct Cells {
    origin: [f64; 2],
    across: usize,
    down: usize,
    /// Where a cell's numbers begin.
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl Cells {
    /// From numbers and rectangles (lowest and highest coordinates).
    pub fn new(entries: &[(u32, [[f64; 2]; 2])]) -> Self {
        let least = |axis: usize| entries.iter().map(|(_, [low, _])| low[axis]).fold(f64::INFINITY, f64::min);
        let most = |axis: usize| entries.iter().map(|(_, [_, high])| high[axis]).fold(f64::NEG_INFINITY, f64::max);
        let origin = [least(0), least(1)];
        let count = |axis: usize| (((most(axis) - origin[axis]) / CELL_PX).clamp(0.0, MAX_CELLS - 1.0)) as usize + 1;
        let (across, down) = (count(0), count(1));
        let mut cells = Self { origin, across, down, starts: vec![0; across * down + 1], numbers: Vec::new() };
        for &(_, rectangle) in entries {
            for row in cells.touched(rectangle) {
                for count in &mut cells.starts[row.start + 1..=row.end] {
                    *count += 1;
                }
            }
        }
        for cell in 1..cells.starts.len() {
            cells.starts[cell] += cells.starts[cell - 1];
        }
        let mut next = cells.starts.clone();
        cells.numbers = vec![0; next[across * down] as usize];
        for &(number, rectangle) in entries {
            for row in cells.touched(rectangle) {
                for place in &mut next[row] {
                    cells.numbers[*place as usize] = number;
                    *place += 1;
                }
            }
        }
        cells
    }

    /// The cells that a rectangle touches, with a margin for rounding, row by row.
    fn touched(&self, [low, high]: [[f64; 2]; 2]) -> impl Iterator<Item = Range<usize>> + use<> {
        let place = |at: f64, axis: usize, count: usize| {
            (((at - self.origin[axis]) / CELL_PX).clamp(0.0, count as f64 - 1.0)) as usize
        };
        let margin = 1e-3;
        let (left, right) = (place(low[0] - margin, 0, self.across), place(high[0] + margin, 0, self.across));
        let (top, bottom) = (place(low[1] - margin, 1, self.down), place(high[1] + margin, 1, self.down));
        let across = self.across;
        (top..=bottom).map(move |row| row * across + left..row * across + right + 1)
    }

    /// The numbers in the cells that a rectangle touches, by rows of cells; one may come more than once.
    #[inline]
    pub fn within(&self, rectangle: [[f64; 2]; 2]) -> impl Iterator<Item = &[u32]> + '_ {
        // Cells of a row lie side by side, and so do their numbers.
        let numbers = |row: Range<usize>| &self.numbers[self.starts[row.start] as usize..self.starts[row.end] as usize];
        self.touched(rectangle).map(numbers)
    }

    /// Every number in every cell.
    pub fn all(&self) -> &[u32] {
        &self.numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_fixtures::random::SplitMix64;

    #[test]
    fn whatever_overlaps_is_found() {
        let mut random = SplitMix64::new(9);
        let mut rectangle = |side: f64| {
            let low = [random.metres(-50.0, 900.0), random.metres(-50.0, 700.0)];
            [low, [low[0] + random.metres(0.0, side), low[1] + random.metres(0.0, side)]]
        };
        let entries: Vec<(u32, [[f64; 2]; 2])> = (0..300).map(|number| (number, rectangle(60.0))).collect();
        let cells = Cells::new(&entries);
        let mut found = 0;
        for _ in 0..300 {
            let asked = rectangle(40.0);
            let near: Vec<u32> = cells.within(asked).flatten().copied().collect();
            for (number, [low, high]) in &entries {
                let apart = |axis: usize| low[axis] > asked[1][axis] || high[axis] < asked[0][axis];
                assert!(apart(0) || apart(1) || near.contains(number));
            }
            found += near.len();
        }
        // And not much more than that.
        assert!(found < 300 * 30, "{found}");
        assert_eq!(Cells::new(&[]).within([[0.0; 2]; 2]).flatten().count(), 0);
    }
}
