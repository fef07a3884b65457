//! Hulls and nested hulls against definitions that need no hull algorithm: by hand-made, nasty and random sets.
//!
//! A point is a strict vertex if all others lie within an open half-plane through it; on a grid of integers it is
//! enough to try the lines through pairs of points, which costs O(n^3) a layer and cannot share a mistake with chains.

use daymark_core::geometry::{
    COORDINATE_LIMIT, ConvexHull, Hull, HullLayers, Orientation, Remainder, orientation, twice_area,
};
use daymark_core::point::ImagePoint;
use proptest::prelude::*;
use proptest::sample::{Index, select};

const POINTS: usize = 1_200;

type Layers = HullLayers<POINTS, { POINTS / 3 }>;

fn at(x: i32, y: i32) -> ImagePoint {
    ImagePoint::new(x, y)
}

/// The numbers of the points with no other of a lower number at their place.
fn distinct(points: &[ImagePoint]) -> Vec<u16> {
    let first = |&number: &u16| !points[..usize::from(number)].contains(&points[usize::from(number)]);
    (0..points.len() as u16).filter(first).collect()
}

/// The strict vertices among `numbers`, distinct points: in the order in which the edges lead from one to the next.
///
/// `a -> b` is an edge if every other point lies to its right, or on the line strictly between them. Empty if all
/// points are on one line.
fn oracle_hull(points: &[ImagePoint], numbers: &[u16]) -> Vec<u16> {
    let point = |number: u16| points[usize::from(number)];
    let between = |a: ImagePoint, b: ImagePoint, p: ImagePoint| {
        (p.x - a.x).signum() * (b.x - p.x).signum() >= 0 && (p.y - a.y).signum() * (b.y - p.y).signum() >= 0
    };
    let edge = |from: u16, to: u16| {
        let (a, b) = (point(from), point(to));
        numbers.iter().filter(|&&other| other != from && other != to).all(|&other| {
            match orientation(a, b, point(other)) {
                Orientation::Clockwise => true,
                Orientation::Collinear => between(a, b, point(other)),
                Orientation::CounterClockwise => false,
            }
        })
    };
    let flat = numbers.len() < 3 || {
        let [a, b] = [numbers[0], numbers[1]].map(point);
        numbers.iter().all(|&other| orientation(a, b, point(other)) == Orientation::Collinear)
    };
    if flat {
        return Vec::new();
    }
    let start = *numbers.iter().min_by_key(|&&number| point(number)).expect("three points");
    let mut hull = vec![start];
    loop {
        let from = *hull.last().expect("the start");
        let to = *numbers.iter().find(|&&to| to != from && edge(from, to)).expect("a polygon has no end");
        if to == start {
            return hull;
        }
        hull.push(to);
    }
}

/// All layers, and what is left, in the order of (x, y).
fn oracle_layers(points: &[ImagePoint]) -> (Vec<Vec<u16>>, Vec<u16>) {
    let (mut left, mut layers) = (distinct(points), Vec::new());
    loop {
        let hull = oracle_hull(points, &left);
        if hull.is_empty() {
            left.sort_by_key(|&number| points[usize::from(number)]);
            return (layers, left);
        }
        left.retain(|number| !hull.contains(number));
        layers.push(hull);
    }
}

fn peeled(points: &[ImagePoint]) -> Box<Layers> {
    let mut layers = Box::new(Layers::new());
    layers.peel(points).expect("room for all");
    layers
}

fn remainder(layers: &Layers) -> Vec<u16> {
    match layers.remainder() {
        Remainder::None => Vec::new(),
        Remainder::Point(point) => vec![point],
        Remainder::Line(line) => line.to_vec(),
    }
}

/// Everything that is said of a set agrees with the definitions.
fn check(points: &[ImagePoint]) {
    let (expected, left) = oracle_layers(points);
    let layers = peeled(points);
    assert_eq!(layers.layers().collect::<Vec<_>>(), expected, "{points:?}");
    assert_eq!(remainder(&layers), left, "{points:?}");
    assert_eq!((layers.len(), layers.points()), (expected.len(), points.len()));
    for (number, &point) in (0..).zip(points) {
        let same = points.iter().position(|&other| other == point).expect("itself") as u16;
        let layer = expected.iter().position(|layer| layer.contains(&same)).map(|layer| layer as u16);
        assert_eq!((layers.same_as(number), layers.layer_of(number)), (Some(same), layer), "{number} of {points:?}");
    }
    let first = distinct(points);
    let merged: Vec<u16> = (0..points.len() as u16).filter(|number| !first.contains(number)).collect();
    assert_eq!(layers.duplicates(), merged);

    let mut hull = Box::new(ConvexHull::<POINTS>::new());
    let ends = |line: &[u16]| [line[0], line[line.len() - 1]];
    let outer = match (expected.first(), left.as_slice()) {
        (Some(outer), _) => Hull::Polygon(outer),
        (None, []) => Hull::Empty,
        (None, &[point]) => Hull::Point(point),
        (None, line) => Hull::Segment(ends(line)),
    };
    assert_eq!(hull.enclose(points), Ok(outer), "{points:?}");
}

/// A generator whose numbers are written here, so that the sets are the same everywhere (`SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    fn below(&mut self, end: i32) -> i32 {
        (self.next() % end as u64) as i32
    }

    fn points(&mut self, count: usize, width: i32, height: i32) -> Vec<ImagePoint> {
        (0..count).map(|_| at(self.below(width), self.below(height))).collect()
    }

    fn shuffle(&mut self, points: &mut [ImagePoint]) {
        for end in (1..points.len()).rev() {
            points.swap(end, self.below(end as i32 + 1) as usize);
        }
    }
}

/// Integer points at exactly this squared distance from the origin: all in convex position.
fn circle(squared: i32) -> Vec<ImagePoint> {
    let reach = squared.isqrt();
    let square = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y)));
    square.filter(|(x, y)| x * x + y * y == squared).map(|(x, y)| at(x, y)).collect()
}

#[test]
fn small_sets_of_a_tiny_grid_without_exception() {
    // Every set of up to five points of a 3 x 3 grid, with repetition, in every order.
    let grid: Vec<ImagePoint> = (0..9).map(|i| at(i % 3, i / 3)).collect();
    for count in 0..=5 {
        for code in 0..9_usize.pow(count) {
            let set: Vec<_> = (0..count).map(|digit| grid[code / 9_usize.pow(digit) % 9]).collect();
            check(&set);
        }
    }
}

#[test]
fn rows_of_windows() {
    // Four corners of each window of a facade: many on one line, in both directions.
    let mut windows: Vec<ImagePoint> = (0..6)
        .flat_map(|column| (0..4).map(move |row| (column * 640, row * 480)))
        .flat_map(|(x, y)| [at(x, y), at(x + 160, y), at(x + 160, y + 240), at(x, y + 240)])
        .collect();
    check(&windows);
    Random(1).shuffle(&mut windows);
    check(&windows);
    // The same facade seen from the side, exactly: rows still meet collinear points.
    check(&windows.iter().map(|p| at(2 * p.x + p.y, 3 * p.y - p.x)).collect::<Vec<_>>());
}

#[test]
fn grids_with_duplicates() {
    for (columns, rows) in [(1, 20), (20, 1), (2, 10), (7, 7), (12, 5)] {
        let mut grid: Vec<_> = (0..columns * rows).map(|i| at(i % columns * 16, i / columns * 16)).collect();
        grid.extend_from_within(..grid.len() / 2);
        grid.extend_from_within(..10);
        Random(2).shuffle(&mut grid);
        check(&grid);
    }
}

#[test]
fn circles_of_integer_points() {
    let circles = [25, 325, 1_105, 5_525].map(circle);
    assert_eq!(circles.each_ref().map(Vec::len), [12, 24, 32, 48]);
    for circle in &circles {
        let layers = peeled(circle);
        assert_eq!((layers.len(), layers.layer(0).len()), (1, circle.len()));
        check(circle);
    }
    let mut nested = circles.concat();
    Random(3).shuffle(&mut nested);
    check(&nested);
}

#[test]
fn the_ends_of_the_range() {
    const L: i32 = COORDINATE_LIMIT;
    let near = [-L, -L + 1, -1, 0, 1, L - 1, L];
    let mut all: Vec<_> = near.iter().flat_map(|&x| near.map(|y| at(x, y))).collect();
    Random(4).shuffle(&mut all);
    check(&all);
    // Nearly equal areas: slopes that differ by one step over the whole range.
    let slopes: Vec<_> = (0..30).map(|i| at(-L + i * (L / 15), -L + i * (L / 15) + i % 3)).collect();
    check(&slopes);
}

#[test]
fn a_parabola_and_its_chord() {
    // All of the parabola are vertices, with the least turn there is; the chord's points are not.
    let mut points: Vec<_> = (-40..=40).map(|x| at(x, x * x)).collect();
    points.extend((-39..40).map(|x| at(x, 1_600)));
    check(&points);
    assert_eq!(peeled(&points).layer(0).len(), 81);
}

#[test]
fn random_sets_of_every_density() {
    let mut random = Random(5);
    for count in [3, 4, 5, 8, 13, 21, 47, 63, 64, 65, 90, 130] {
        for (width, height) in [(2, 40), (5, 5), (12, 12), (100, 3), (640 * 16, 480 * 16), (1 << 23, 1 << 23)] {
            for _ in 0..if count < 50 { 20 } else { 3 } {
                check(&random.points(count, width, height));
            }
        }
    }
}

/// Invariants that hold for sets too large for the oracle: each layer turns clockwise and contains all that is within.
#[test]
fn large_sets_are_nested() {
    let mut random = Random(6);
    for (width, height) in [(640 * 16, 480 * 16), (30, 30), (4, 2_000), (1_000, 1_000)] {
        let points = random.points(POINTS, width, height);
        let layers = peeled(&points);
        let point = |&number: &u16| points[usize::from(number)];
        let mut within = remainder(&layers);
        let mut seen = within.len() + layers.duplicates().len();
        for layer in layers.layers().rev() {
            assert_eq!(layer.iter().map(point).min(), layer.first().map(point));
            let closed: Vec<_> = layer.iter().chain(layer).map(point).collect();
            for corner in closed[..layer.len() + 2].windows(3) {
                assert!(twice_area(corner[0], corner[1], corner[2]) > 0);
            }
            for edge in closed[..=layer.len()].windows(2) {
                assert!(within.iter().all(|inner| twice_area(edge[0], edge[1], point(inner)) >= 0));
            }
            seen += layer.len();
            // What is within a layer is within the hull of the next: its vertices are enough.
            within = layer.to_vec();
        }
        assert_eq!(seen, points.len());
    }
}

fn coordinate() -> impl Strategy<Value = i32> {
    prop_oneof![-3..=3_i32, -40..=40_i32, select(vec![-COORDINATE_LIMIT, COORDINATE_LIMIT - 1, COORDINATE_LIMIT])]
}

fn point() -> impl Strategy<Value = ImagePoint> {
    (coordinate(), coordinate()).prop_map(|(x, y)| at(x, y))
}

/// Points of which many are exact combinations of others: on their lines, or at their places.
fn tied_points() -> impl Strategy<Value = Vec<ImagePoint>> {
    let steps = prop::collection::vec((any::<Index>(), any::<Index>(), 0..4_i32), 0..20);
    (prop::collection::vec((-30..30_i32, -30..30_i32), 2..12), steps).prop_map(|(free, steps)| {
        let mut points: Vec<_> = free.into_iter().map(|(x, y)| at(x, y)).collect();
        for (a, b, times) in steps {
            let (a, b) = (*a.get(&points), *b.get(&points));
            let next = at(a.x + times * (b.x - a.x), a.y + times * (b.y - a.y));
            if next.x.abs() < 10_000 && next.y.abs() < 10_000 {
                points.push(next);
            }
        }
        points
    })
}

/// The layers as sets of point numbers, and what is left.
fn sets(points: &[ImagePoint]) -> (Vec<Vec<u16>>, Vec<u16>) {
    let layers = peeled(points);
    let sorted = |numbers: &[u16]| {
        let mut numbers = numbers.to_vec();
        numbers.sort_unstable();
        numbers
    };
    (layers.layers().map(sorted).collect(), sorted(&remainder(&layers)))
}

proptest! {
    #[test]
    fn any_points(points in prop::collection::vec(point(), 0..40)) {
        check(&points);
    }

    #[test]
    fn points_on_lines_of_others(points in tied_points()) {
        check(&points);
    }

    #[test]
    fn an_affine_map_keeps_the_layers(
        points in tied_points(),
        [a, b, c, d] in [-9..=9_i32, -9..=9, -9..=9, -9..=9],
        (x, y) in (-4_000_000..4_000_000_i32, -4_000_000..4_000_000_i32),
    ) {
        let determinant = a * d - b * c;
        prop_assume!(determinant != 0);
        let mapped: Vec<_> = points.iter().map(|p| at(a * p.x + b * p.y + x, c * p.x + d * p.y + y)).collect();
        prop_assert_eq!(sets(&points), sets(&mapped));
        // The way round: the same, or the opposite of a mirror image, from another start.
        let (before, after) = (peeled(&points), peeled(&mapped));
        for (one, other) in before.layers().zip(after.layers()) {
            let mut turned = other.to_vec();
            if determinant < 0 {
                turned.reverse();
            }
            let start = turned.iter().position(|number| *number == one[0]).expect("the same set");
            turned.rotate_left(start);
            prop_assert_eq!(one, turned);
        }
    }

    #[test]
    fn the_order_of_the_input_does_not_matter(points in tied_points(), seed in any::<u64>()) {
        let mut shuffled = points.clone();
        Random(seed).shuffle(&mut shuffled);
        let places = |points: &[ImagePoint]| {
            let layers = peeled(points);
            let place = |number: &u16| points[usize::from(*number)];
            let peeled: Vec<Vec<_>> = layers.layers().map(|layer| layer.iter().map(place).collect()).collect();
            (peeled, remainder(&layers).iter().map(place).collect::<Vec<_>>())
        };
        prop_assert_eq!(places(&points), places(&shuffled));
    }
}
