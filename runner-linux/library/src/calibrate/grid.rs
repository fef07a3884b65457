//! Crossings in rows and columns.
//!
//! A lattice begins with four crossings that make a parallelogram and grows by one neighbour at a time, which must be where
//! its row or column leads, and be of the right kind: along an edge black and white change sides at every crossing. That is
//! local, so neither perspective nor a bent lens stops it.

use std::collections::BTreeMap;

use super::saddle::{Saddle, between};

/// Crossings by column and row; (0, 0) is where the lattice began. Columns go to the right of rows as seen (x right, y
/// down), so a lattice is never mirrored, and the square between (i, j) and (i + 1, j + 1) is bright if i + j is even.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lattice {
    pub(super) places: BTreeMap<(i32, i32), [f64; 2]>,
}

/// Lattices of fewer crossings are none.
const FEWEST: usize = 6;
/// Lattices at most; pictures have one board.
const MOST: usize = 8;
/// Lattices do not grow farther from where they began.
const REACH: i32 = 60;
/// A neighbour is this near to where it should be, as a share of the step.
const NEAR: f64 = 0.32;
/// The direction of an edge may differ this much from the way to the neighbour.
const ASKEW: f64 = 0.4;

const STEPS: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Lattices, those of the strongest crossings first.
pub(super) fn lattices(saddles: &[Saddle]) -> Vec<Lattice> {
    let mut free = vec![true; saddles.len()];
    let mut found = Vec::new();
    for seed in 0..saddles.len() {
        if found.len() == MOST {
            break;
        }
        let Some(lattice) = free[seed].then(|| Growth::begin(saddles, &free, seed)).flatten() else { continue };
        let places = lattice.grown();
        if places.len() < FEWEST {
            continue;
        }
        for &number in places.values() {
            free[number] = false;
        }
        found.push(Lattice { places: places.into_iter().map(|(place, number)| (place, saddles[number].at)).collect() });
    }
    found
}

struct Growth<'s> {
    saddles: &'s [Saddle],
    free: Vec<bool>,
    places: BTreeMap<(i32, i32), usize>,
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn plus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn length(a: [f64; 2]) -> f64 {
    libm::hypot(a[0], a[1])
}

/// Whether the edge along a step from the crossing at `place` gets brighter with the angle (0) or darker (1).
fn kind((i, j): (i32, i32), (di, _): (i32, i32)) -> usize {
    ((i + j).rem_euclid(2) as usize) ^ usize::from(di == 0)
}

impl<'s> Growth<'s> {
    /// Four crossings around a square.
    fn begin(saddles: &'s [Saddle], free: &[bool], seed: usize) -> Option<Self> {
        let origin = saddles.get(seed)?;
        let along = origin.edges[0];
        // The second edge on the side of growing angles.
        let down = origin.edges[1] + if origin.edges[1] < along { core::f64::consts::PI } else { 0.0 };
        let mut growth = Self { saddles, free: free.to_vec(), places: BTreeMap::new() };
        growth.enter((0, 0), seed);
        let right = growth.nearest_along(origin, along, 1)?;
        growth.enter((1, 0), right);
        let below = growth.nearest_along(origin, down, 0)?;
        growth.enter((0, 1), below);
        let steps = [right, below].map(|number| minus(saddles[number].at, origin.at));
        let (shorter, longer) = {
            let [a, b] = steps.map(length);
            (a.min(b), a.max(b))
        };
        if longer > 6.0 * shorter {
            return None;
        }
        let expected = plus(origin.at, plus(steps[0], steps[1]));
        let last = growth.nearest_to(expected, NEAR * shorter, (1, 1), [((1, 0), steps[0]), ((0, 1), steps[1])])?;
        growth.enter((1, 1), last);
        Some(growth)
    }

    fn enter(&mut self, place: (i32, i32), number: usize) {
        self.free[number] = false;
        self.places.insert(place, number);
    }

    /// The nearest crossing in a direction whose edge of this kind points back.
    fn nearest_along(&self, from: &Saddle, direction: f64, kind: usize) -> Option<usize> {
        let (sine, cosine) = (libm::sin(direction), libm::cos(direction));
        let candidates = self.saddles.iter().enumerate().filter(|(number, _)| self.free[*number]);
        let near = candidates.filter_map(|(number, saddle)| {
            let [x, y] = minus(saddle.at, from.at);
            let (ahead, aside) = (x * cosine + y * sine, (y * cosine - x * sine).abs());
            let way = libm::atan2(y, x);
            (ahead > 4.0 && aside < 0.25 * ahead && between(saddle.edges[kind], way) < ASKEW).then_some((ahead, number))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, number)| number)
    }

    /// The crossing nearest to a point whose edges lie along these steps.
    fn nearest_to(
        &self,
        expected: [f64; 2],
        reach: f64,
        place: (i32, i32),
        ways: [((i32, i32), [f64; 2]); 2],
    ) -> Option<usize> {
        let candidates = self.saddles.iter().enumerate().filter(|(number, _)| self.free[*number]);
        let near = candidates.filter_map(|(number, saddle)| {
            let off = length(minus(saddle.at, expected));
            let fits = |(step, [x, y]): ((i32, i32), [f64; 2])| {
                (x == 0.0 && y == 0.0) || between(saddle.edges[kind(place, step)], libm::atan2(y, x)) < ASKEW
            };
            (off < reach && ways.into_iter().all(fits)).then_some((off, number))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, number)| number)
    }

    fn at(&self, place: (i32, i32)) -> Option<[f64; 2]> {
        self.places.get(&place).map(|&number| self.saddles[number].at)
    }

    /// All that can be reached.
    fn grown(mut self) -> BTreeMap<(i32, i32), usize> {
        loop {
            let mut proposals: BTreeMap<(i32, i32), Vec<(i32, i32)>> = BTreeMap::new();
            for &(i, j) in self.places.keys() {
                for (di, dj) in STEPS {
                    let next = (i + di, j + dj);
                    if next.0.abs() <= REACH && next.1.abs() <= REACH && !self.places.contains_key(&next) {
                        proposals.entry(next).or_default().push((di, dj));
                    }
                }
            }
            let before = self.places.len();
            for (place, steps) in proposals {
                let found = steps.into_iter().find_map(|step| self.next(place, step));
                if let Some(number) = found {
                    self.enter(place, number);
                }
            }
            if self.places.len() == before {
                return self.places;
            }
        }
    }

    /// The crossing one step further, where the lattice around leads.
    fn next(&self, place: (i32, i32), (di, dj): (i32, i32)) -> Option<usize> {
        let (i, j) = (place.0 - di, place.1 - dj);
        let from = self.at((i, j))?;
        let mut sum = [0.0; 2];
        let mut count = 0.0;
        if let Some(before) = self.at((i - di, j - dj)) {
            let mut step = minus(from, before);
            // Perspective: steps change evenly.
            if let Some(earlier) = self.at((i - 2 * di, j - 2 * dj)) {
                let change = minus(step, minus(before, earlier));
                step = plus(step, change.map(|c| 0.5 * c));
            }
            sum = plus(sum, step);
            count += 1.0;
        }
        for side in [1, -1] {
            let (si, sj) = (side * dj, side * di);
            if let (Some(beside), Some(ahead)) = (self.at((i + si, j + sj)), self.at((place.0 + si, place.1 + sj))) {
                sum = plus(sum, minus(ahead, beside));
                count += 1.0;
            }
        }
        if count == 0.0 {
            return None;
        }
        let step = sum.map(|s| s / count);
        self.nearest_to(plus(from, step), NEAR * length(step), place, [((di, dj), step), ((di, dj), step)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Crossings of a board under this map, as a picture would show them.
    fn board(columns: i32, rows: i32, map: impl Fn(f64, f64) -> [f64; 2]) -> Vec<Saddle> {
        let mut saddles = Vec::new();
        for i in 0..columns {
            for j in 0..rows {
                let (x, y) = (f64::from(i), f64::from(j));
                let at = map(x, y);
                let direction = |dx: f64, dy: f64| {
                    let [u, v] = minus(map(x + dx, y + dy), at);
                    (libm::atan2(v, u) + core::f64::consts::TAU) % core::f64::consts::PI
                };
                let mut edges = [direction(0.01, 0.0), direction(0.0, 0.01)];
                if (i + j) % 2 == 1 {
                    edges.swap(0, 1);
                }
                saddles.push(Saddle { at, edges, response: 1.0 });
            }
        }
        saddles
    }

    #[test]
    fn a_tilted_board_is_walked_over() {
        let map = |x: f64, y: f64| {
            let w = 1.0 + 0.05 * x - 0.02 * y;
            [100.0 + (30.0 * x + 6.0 * y) / w, 80.0 + (28.0 * y - 5.0 * x) / w]
        };
        let mut saddles = board(9, 6, map);
        saddles.extend([[20.0, 20.0], [333.0, 40.0]].map(|at| Saddle { at, edges: [0.3, 1.4], response: 0.5 }));
        let found = lattices(&saddles);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].places.len(), 54);
        // Columns to the right of rows, as seen.
        let at = |place| found[0].places.get(&place).copied();
        let (o, r, d) = (at((0, 0)), at((1, 0)), at((0, 1)));
        let (o, r, d) = (o.expect("origin"), r.expect("right"), d.expect("below"));
        let ([ax, ay], [bx, by]) = (minus(r, o), minus(d, o));
        assert!(ax * by - ay * bx > 0.0);
    }

    #[test]
    fn a_gap_is_walked_around_and_another_board_is_another_lattice() {
        let mut saddles = board(7, 5, |x, y| [50.0 + 20.0 * x, 50.0 + 20.0 * y]);
        saddles.remove(17);
        saddles.extend(board(4, 4, |x, y| [400.0 + 25.0 * x + 3.0 * y, 60.0 + 25.0 * y]));
        let sizes: Vec<usize> = lattices(&saddles).iter().map(|lattice| lattice.places.len()).collect();
        assert_eq!(sizes, [34, 16]);
    }

    #[test]
    fn crossings_of_the_wrong_kind_make_no_lattice() {
        let mut saddles = board(6, 5, |x, y| [50.0 + 20.0 * x, 50.0 + 20.0 * y]);
        for saddle in &mut saddles {
            saddle.edges = [0.0, core::f64::consts::FRAC_PI_2];
        }
        assert_eq!(lattices(&saddles), []);
    }
}
