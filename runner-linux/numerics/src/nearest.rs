//! The nearest point of a cloud: a balanced k-d tree with its points in the leaves.

use crate::parallel;

/// Points of a leaf, at most.
const LEAF: usize = 16;
/// Children of a node.
const FOUR: usize = 4;
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

/// Lowest and highest coordinates of the points of a node's four children, side by side: one vector instruction computes
/// with all of them.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: [[f32; FOUR]; 3],
    high: [[f32; FOUR]; 3],
}

/// A cloud that answers which of its points is nearest.
///
/// Every node has the bounds of its points: points of buildings lie on walls, and the bounds of a piece of wall say how
/// far it is, where the planes between nodes would only say how far its neighbours are.
#[derive(Debug, Clone)]
pub struct NearestPoints {
    /// Node `i` has the children `4 i + 1` to `4 i + 4`; those beyond the last node are the leaves.
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

type Entry = ([f32; 3], u32);

impl NearestPoints {
    /// Builds the tree, `O(n log n)`. Points that are not finite are left out; without any there is no answer.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut entries: Vec<Entry> = (0..)
            .zip(points)
            .filter(|(_, point)| point.iter().all(|c| c.is_finite()))
            .map(|(number, &point)| (point, number))
            .collect();
        if entries.is_empty() {
            return Self { nodes: Vec::new(), leaves: Vec::new() };
        }
        let mut count = 1;
        while count * LEAF < entries.len() {
            count *= FOUR;
        }
        let blank = Leaf { coordinates: [[f32::INFINITY; LEAF]; 3], numbers: [u32::MAX; LEAF] };
        let nowhere = Node { low: [[f32::INFINITY; FOUR]; 3], high: [[f32::INFINITY; FOUR]; 3] };
        let mut tree = Self { nodes: vec![nowhere; (count - 1) / 3], leaves: vec![blank; count] };
        let bounds = bounds(&entries);
        tree.build(0, &mut entries, bounds);
        tree
    }

    fn build(&mut self, node: usize, entries: &mut [Entry], bounds: Bounds) {
        if let Some(leaf) = node.checked_sub(self.nodes.len()) {
            let leaf = &mut self.leaves[leaf];
            for (slot, (point, number)) in entries.iter().enumerate() {
                for (line, &c) in leaf.coordinates.iter_mut().zip(point) {
                    line[slot] = c;
                }
                leaf.numbers[slot] = *number;
            }
            return;
        }
        let (left, right) = halves(entries, bounds);
        let (left_bounds, right_bounds) = (self::bounds(left), self::bounds(right));
        let (a, b) = halves(left, left_bounds);
        let (c, d) = halves(right, right_bounds);
        for (child, part) in [a, b, c, d].into_iter().enumerate() {
            let bounds = self::bounds(part);
            let inner = &mut self.nodes[node];
            for ((low, high), (l, h)) in
                inner.low.iter_mut().zip(&mut inner.high).zip(bounds.low.iter().zip(&bounds.high))
            {
                (low[child], high[child]) = (*l, *h);
            }
            if !part.is_empty() {
                self.build(FOUR * node + 1 + child, part, bounds);
            }
        }
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

    /// The recursion is as deep as the tree: at most 16.
    fn visit(&self, node: usize, query: [f32; 3], best: &mut Nearest) {
        let Some(inner) = self.nodes.get(node) else {
            self.leaves[node - self.nodes.len()].search(query, best);
            return;
        };
        let distances = inner.squared(query);
        // The nearest child first; what it leaves of the others is seldom worth sorting.
        let mut first = 0;
        for (child, distance) in distances.iter().enumerate().skip(1) {
            first = if *distance < distances[first] { child } else { first };
        }
        if distances[first] <= best.squared {
            self.visit(FOUR * node + 1 + first, query, best);
            for (child, distance) in distances.into_iter().enumerate() {
                if child != first && distance <= best.squared {
                    self.visit(FOUR * node + 1 + child, query, best);
                }
            }
        }
    }

    /// The nearest points of many, in their order; the same for any number of threads.
    ///
    /// They are searched along a Morton curve, each from the answer before: neighbours on the curve are neighbours in
    /// space, and their part of the tree is in the cache.
    pub fn nearest_of_each(&self, queries: &[[f32; 3]], points: &[[f32; 3]]) -> Vec<Option<Nearest>> {
        let order = along_curve(queries);
        let search = |chunk: &[(u32, u32)], answer: &mut dyn FnMut(u32, Option<Nearest>)| {
            let mut before = Nearest { number: u32::MAX, squared: f32::INFINITY };
            for &(_, number) in chunk {
                let query = queries[number as usize];
                let start = match points.get(before.number as usize) {
                    Some(point) => Nearest { squared: squared(query, *point), ..before },
                    None => Nearest { number: u32::MAX, squared: f32::INFINITY },
                };
                let found = self.nearest_from(query, start);
                before = found.unwrap_or(before);
                answer(number, found);
            }
        };
        let mut found = vec![None; queries.len()];
        // Handing work to the only other thread would cost more than it is worth.
        if rayon::current_num_threads() == 1 {
            for chunk in order.chunks(CHUNK) {
                search(chunk, &mut |number, nearest| found[number as usize] = nearest);
            }
            return found;
        }
        let chunks: Vec<&[(u32, u32)]> = order.chunks(CHUNK).collect();
        let chunks = parallel::map(&chunks, |chunk| {
            let mut answers: Vec<(u32, Option<Nearest>)> = Vec::with_capacity(chunk.len());
            search(chunk, &mut |number, nearest| answers.push((number, nearest)));
            answers
        });
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

/// Lowest and highest coordinates.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

/// Those of points; of none they are at infinity.
fn bounds(entries: &[Entry]) -> Bounds {
    let Some(((first, _), rest)) = entries.split_first() else {
        return Bounds { low: [f32::INFINITY; 3], high: [f32::INFINITY; 3] };
    };
    let mut bounds = Bounds { low: *first, high: *first };
    for (point, _) in rest {
        for ((low, high), &c) in bounds.low.iter_mut().zip(&mut bounds.high).zip(point) {
            *low = if c < *low { c } else { *low };
            *high = if c > *high { c } else { *high };
        }
    }
    bounds
}

/// The halves of points along their longest extent.
fn halves(entries: &mut [Entry], bounds: Bounds) -> (&mut [Entry], &mut [Entry]) {
    let extent = |axis: usize| bounds.high[axis] - bounds.low[axis];
    let mut axis = 0;
    for other in 1..3 {
        if extent(other) > extent(axis) {
            axis = other;
        }
    }
    let middle = entries.len() / 2;
    if entries.len() > 1 {
        match axis {
            0 => entries.select_nth_unstable_by(middle, |a, b| a.0[0].total_cmp(&b.0[0])),
            1 => entries.select_nth_unstable_by(middle, |a, b| a.0[1].total_cmp(&b.0[1])),
            _ => entries.select_nth_unstable_by(middle, |a, b| a.0[2].total_cmp(&b.0[2])),
        };
    }
    entries.split_at_mut(middle)
}

impl Node {
    /// Squared distances of a point from the four: never above that of any point inside, because both are rounded alike.
    #[inline(always)]
    fn squared(&self, query: [f32; 3]) -> [f32; FOUR] {
        let mut sums = [0.0; FOUR];
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(query) {
            for ((sum, low), high) in sums.iter_mut().zip(low).zip(high) {
                let (below, above) = (low - at, at - high);
                let off = if below > above { below } else { above };
                let off = if off > 0.0 { off } else { 0.0 };
                *sum += off * off;
            }
        }
        sums
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
        // Four lanes at a time, then across.
        let mut lanes = [f32::INFINITY; FOUR];
        for four in squares.as_chunks::<FOUR>().0 {
            for (lane, &square) in lanes.iter_mut().zip(four) {
                *lane = if square < *lane { square } else { *lane };
            }
        }
        let [a, b, c, d] = lanes;
        let (a, b) = (if a < b { a } else { b }, if c < d { c } else { d });
        let least = if a < b { a } else { b };
        if least > best.squared {
            return;
        }
        // Of equally near ones the least number.
        let number = squares.iter().zip(&self.numbers).fold(u32::MAX, |first, (&square, &number)| {
            let number = if square == least { number } else { u32::MAX };
            if number < first { number } else { first }
        });
        if least < best.squared || number < best.number {
            *best = Nearest { number, squared: least };
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
        for count in [1, 2, 15, 16, 17, 63, 64, 65, 1_000] {
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
