//! The nearest point of a cloud: a balanced k-d tree with its points in the leaves.

use crate::parallel;

/// Points of a leaf, at most.
const LEAF: usize = 8;
/// Queries of one task.
const CHUNK: usize = 1 << 12;

#[derive(Debug, Clone, Copy)]
struct Leaf {
    coordinates: [[f32; LEAF]; 3],
    numbers: [u32; LEAF],
}

/// A point of the cloud and how far it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Its number in the cloud; of equally near ones the least.
    pub number: u32,
    /// Squared distance.
    pub squared: f32,
}

/// Lowest and highest coordinates of a node's points.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

/// A cloud that answers which of its points is nearest.
///
/// Every node has the bounds of its points: points of buildings lie on walls, and the bounds of a piece of wall say how
/// far it is, where the planes between nodes would only say how far its neighbours are.
#[derive(Debug, Clone)]
pub struct NearestPoints {
    /// Node `i` has the children `2 i + 1` and `2 i + 2`; the last ones are the leaves.
    nodes: Vec<Bounds>,
    leaves: Vec<Leaf>,
}

impl NearestPoints {
    /// Builds the tree, `O(n log n)`. Points that are not finite are left out; without any there is no answer.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut entries: Vec<([f32; 3], u32)> = (0..)
            .zip(points)
            .filter(|(_, point)| point.iter().all(|c| c.is_finite()))
            .map(|(number, &point)| (point, number))
            .collect();
        if entries.is_empty() {
            return Self { nodes: Vec::new(), leaves: Vec::new() };
        }
        let count = entries.len().div_ceil(LEAF).next_power_of_two();
        let blank = Leaf { coordinates: [[f32::INFINITY; LEAF]; 3], numbers: [u32::MAX; LEAF] };
        let nowhere = Bounds { low: [f32::INFINITY; 3], high: [f32::INFINITY; 3] };
        let mut tree = Self { nodes: vec![nowhere; 2 * count - 1], leaves: vec![blank; count] };
        tree.build(0, count, &mut entries);
        tree
    }

    fn build(&mut self, node: usize, leaves: usize, entries: &mut [([f32; 3], u32)]) {
        let Some(((first, _), rest)) = entries.split_first() else { return };
        let mut bounds = Bounds { low: *first, high: *first };
        for (point, _) in rest {
            for ((low, high), &c) in bounds.low.iter_mut().zip(&mut bounds.high).zip(point) {
                *low = if c < *low { c } else { *low };
                *high = if c > *high { c } else { *high };
            }
        }
        self.nodes[node] = bounds;
        if leaves == 1 {
            let first = self.leaves.len() - 1;
            let leaf = &mut self.leaves[node - first];
            for (slot, (point, number)) in entries.iter().enumerate() {
                for (line, &c) in leaf.coordinates.iter_mut().zip(point) {
                    line[slot] = c;
                }
                leaf.numbers[slot] = *number;
            }
            return;
        }
        let extent = |axis: usize| bounds.high[axis] - bounds.low[axis];
        let mut axis = 0;
        for other in 1..3 {
            if extent(other) > extent(axis) {
                axis = other;
            }
        }
        let middle = entries.len() / 2;
        entries.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
        let (left, right) = entries.split_at_mut(middle);
        self.build(2 * node + 1, leaves / 2, left);
        self.build(2 * node + 2, leaves / 2, right);
    }

    /// The point nearest to `query`; `None` for an empty cloud or a query that is not finite.
    pub fn nearest(&self, query: [f32; 3]) -> Option<Nearest> {
        self.nearest_from(query, Nearest { number: u32::MAX, squared: f32::INFINITY })
    }

    /// The same, with a point to begin from.
    fn nearest_from(&self, query: [f32; 3], start: Nearest) -> Option<Nearest> {
        if self.leaves.is_empty() || !query.iter().all(|c| c.is_finite()) {
            return None;
        }
        let mut best = start;
        self.visit(0, query, &mut best);
        Some(best)
    }

    /// The recursion is as deep as the tree: at most 32.
    fn visit(&self, node: usize, query: [f32; 3], best: &mut Nearest) {
        let first_leaf = self.leaves.len() - 1;
        if node >= first_leaf {
            self.leaves[node - first_leaf].search(query, best);
            return;
        }
        let (left, right) = (2 * node + 1, 2 * node + 2);
        let (l, r) = (self.nodes[left].squared(query), self.nodes[right].squared(query));
        let ((near, d), (far, e)) = if l <= r { ((left, l), (right, r)) } else { ((right, r), (left, l)) };
        if d <= best.squared {
            self.visit(near, query, best);
        }
        if e <= best.squared {
            self.visit(far, query, best);
        }
    }

    /// The nearest points of many, in their order; the same for any number of threads.
    ///
    /// They are searched along a Morton curve, each from the answer before: neighbours on the curve are neighbours in
    /// space, and their part of the tree is in the cache.
    pub fn nearest_of_each(&self, queries: &[[f32; 3]], points: &[[f32; 3]]) -> Vec<Option<Nearest>> {
        let order = along_curve(queries);
        let search = |chunk: &[(u32, u32)]| -> Vec<(u32, Option<Nearest>)> {
            let mut before = Nearest { number: u32::MAX, squared: f32::INFINITY };
            let search = |&(_, number): &(u32, u32)| {
                let query = queries[number as usize];
                let start = match points.get(before.number as usize) {
                    Some(point) => Nearest { squared: squared(query, *point), ..before },
                    None => Nearest { number: u32::MAX, squared: f32::INFINITY },
                };
                let found = self.nearest_from(query, start);
                before = found.unwrap_or(before);
                (number, found)
            };
            chunk.iter().map(search).collect()
        };
        // Handing work to the only other thread would cost more than it is worth.
        let chunks: Vec<_> = if rayon::current_num_threads() == 1 {
            order.chunks(CHUNK).map(search).collect()
        } else {
            parallel::map(&order.chunks(CHUNK).collect::<Vec<_>>(), |chunk| search(chunk))
        };
        let mut found = vec![None; queries.len()];
        for (number, nearest) in chunks.into_iter().flatten() {
            found[number as usize] = nearest;
        }
        found
    }
}

/// Place on a Morton curve over the extent of the points, 10 bits an axis, and number, sorted.
fn along_curve(points: &[[f32; 3]]) -> Vec<(u32, u32)> {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for point in points.iter().filter(|point| point.iter().all(|c| c.is_finite())) {
        for ((low, high), &c) in low.iter_mut().zip(&mut high).zip(point) {
            *low = if c < *low { c } else { *low };
            *high = if c > *high { c } else { *high };
        }
    }
    let scale = [0, 1, 2].map(|axis: usize| 1_023.0 / (high[axis] - low[axis]).max(f32::MIN_POSITIVE));
    let spread = |value: f32| {
        // What is not finite saturates; ten bits, two free places between each.
        let mut bits = (value as u32).min(1_023);
        bits = (bits | bits << 16) & 0x0300_00FF;
        bits = (bits | bits << 8) & 0x0300_F00F;
        bits = (bits | bits << 4) & 0x030C_30C3;
        (bits | bits << 2) & 0x0924_9249
    };
    let place = |point: &[f32; 3]| {
        let axis = |axis: usize| spread((point[axis] - low[axis]) * scale[axis]);
        axis(0) | axis(1) << 1 | axis(2) << 2
    };
    let entries: Vec<(u32, u32)> = (0..).zip(points).map(|(number, point)| (place(point), number)).collect();
    sorted_by_place(entries)
}

/// Three passes of a counting sort over ten bits each; equal places keep their order.
fn sorted_by_place(mut entries: Vec<(u32, u32)>) -> Vec<(u32, u32)> {
    let mut other = vec![(0, 0); entries.len()];
    for shift in [0, 10, 20] {
        let mut starts = [0_usize; 1_024];
        for (place, _) in &entries {
            starts[(place >> shift & 1_023) as usize] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            (*start, sum) = (sum, sum + *start);
        }
        for &entry in &entries {
            let start = &mut starts[(entry.0 >> shift & 1_023) as usize];
            other[*start] = entry;
            *start += 1;
        }
        std::mem::swap(&mut entries, &mut other);
    }
    entries
}

#[inline(always)]
fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

impl Bounds {
    /// Squared distance of a point: never above that of any point inside, because both are rounded alike.
    #[inline(always)]
    fn squared(&self, query: [f32; 3]) -> f32 {
        let off = |axis: usize| {
            let (below, above) = (self.low[axis] - query[axis], query[axis] - self.high[axis]);
            let off = if below > above { below } else { above };
            if off > 0.0 { off } else { 0.0 }
        };
        let (x, y, z) = (off(0), off(1), off(2));
        x * x + y * y + z * z
    }
}

impl Leaf {
    #[inline(always)]
    fn search(&self, query: [f32; 3], best: &mut Nearest) {
        let mut squares = [0.0_f32; LEAF];
        let [xs, ys, zs] = &self.coordinates;
        for slot in 0..LEAF {
            let (x, y, z) = (query[0] - xs[slot], query[1] - ys[slot], query[2] - zs[slot]);
            squares[slot] = x * x + y * y + z * z;
        }
        let least = squares.iter().fold(f32::INFINITY, |least, &square| if square < least { square } else { least });
        if least > best.squared {
            return;
        }
        for (&squared, &number) in squares.iter().zip(&self.numbers) {
            if squared < best.squared || (squared == best.squared && number < best.number) {
                *best = Nearest { number, squared };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(count: usize, mut state: u64) -> Vec<[f32; 3]> {
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Few values, so that there are ties.
            ((state >> 33) % 64) as f32 / 4.0
        };
        (0..count).map(|_| [number(), number(), number()]).collect()
    }

    #[test]
    fn it_is_the_nearest_of_all_and_the_first_of_equals() {
        for count in [1, 2, 7, 8, 9, 100, 1_000] {
            let points = cloud(count, 5);
            let tree = NearestPoints::new(&points);
            let queries = cloud(500, 77);
            for (query, found) in queries.iter().zip(tree.nearest_of_each(&queries, &points)) {
                let mut best = Nearest { number: 0, squared: f32::INFINITY };
                for (number, point) in (0..).zip(&points) {
                    if squared(*query, *point) < best.squared {
                        best = Nearest { number, squared: squared(*query, *point) };
                    }
                }
                assert_eq!(found, Some(best), "{count} points, {query:?}");
                assert_eq!(tree.nearest(*query), Some(best));
            }
        }
    }

    #[test]
    fn nothing_is_near_in_an_empty_cloud() {
        assert_eq!(NearestPoints::new(&[]).nearest([0.0; 3]), None);
        assert_eq!(NearestPoints::new(&[[f32::NAN, 0.0, 0.0]]).nearest([0.0; 3]), None);
        assert_eq!(NearestPoints::new(&[[1.0, 0.0, 0.0]]).nearest([f32::NAN; 3]), None);
    }
}
