//! Families of plane maps: what random maps keep and break, inverse and composition, and fits.

use daymark_core::family::{Affine, Correspondence, Family, Invariance, Invariant, Perspective, Rigid, Similarity};
use daymark_core::transform;
use proptest::prelude::*;

type Point = [f64; 2];

fn turn() -> impl Strategy<Value = f64> {
    0.0..core::f64::consts::TAU
}

fn place() -> impl Strategy<Value = Point> {
    [-500.0..500.0, -500.0..500.0]
}

fn rigid() -> impl Strategy<Value = Rigid> {
    (turn(), place()).prop_map(|(angle, t)| Rigid::new([angle.cos(), angle.sin()], t).expect("a direction"))
}

fn similarity() -> impl Strategy<Value = Similarity> {
    (turn(), 0.1..10.0, place())
        .prop_map(|(angle, a, t)| Similarity::new([a * angle.cos(), a * angle.sin()], t).expect("a scale"))
}

/// Turned, stretched by up to 5 along one direction, and one in two mirrored.
fn affine() -> impl Strategy<Value = Affine> {
    (turn(), turn(), 0.3..3.0, 0.2..5.0, any::<bool>(), place()).prop_map(|(before, after, a, stretch, mirror, t)| {
        let turned = |angle: f64| Rigid::new([angle.cos(), angle.sin()], [0.0; 2]).expect("a direction");
        let b = a * stretch * if mirror { -1.0 } else { 1.0 };
        let scaled = Affine::new([[a, 0.0], [0.0, b]], t).expect("not singular");
        Affine::from(turned(before)).then(&scaled).then(&turned(after).into())
    })
}

/// Points of `-1..1` stay well in front of the camera.
fn perspective() -> impl Strategy<Value = Perspective> {
    (affine(), [-0.4..0.4, -0.4..0.4]).prop_map(|(map, [g, h])| {
        let inner = Perspective::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [g, h, 1.0]]).expect("not singular");
        inner.then(&map.into())
    })
}

/// Points of `-1..1`, no three close to a line.
fn five_points() -> impl Strategy<Value = [Point; 5]> {
    prop::array::uniform5([-1.0..1.0, -1.0..1.0]).prop_filter("three close to a line", |points| {
        (0..5).all(|a| (0..a).all(|b| (0..b).all(|c| area(points[a], points[b], points[c]).abs() > 0.03)))
    })
}

fn area(a: Point, b: Point, c: Point) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
}

fn distance(a: Point, b: Point) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt()
}

fn pairs<F: Family>(map: &F, points: &[Point]) -> Vec<Correspondence> {
    points.iter().map(|&from| Correspondence { from, to: map.image(from).expect("in front") }).collect()
}

/// Largest relative deviation of an invariant's numbers from those expected.
fn deviation(found: [f64; 2], expected: [f64; 2]) -> f64 {
    let size = expected[0].abs().max(expected[1].abs()).max(1.0);
    (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs()) / size
}

/// Of every invariant: what the family says of it is what this map does with these points. Returns the invariants
/// that the map visibly breaks.
fn check_invariants<F: Family>(map: &F, points: [Point; 5]) -> Result<Vec<Invariant>, TestCaseError> {
    let images = points.map(|point| map.image(point).expect("in front"));
    let mut broken = Vec::new();
    for invariant in Invariant::ALL {
        let before = invariant.measure(points).expect("defined");
        let after = invariant.measure(images).expect("defined");
        match (F::invariance(invariant), map.factor(invariant)) {
            (Invariance::Broken, None) => {
                if deviation(after, before) > 1e-3 {
                    broken.push(invariant);
                }
            }
            (Invariance::Absolute, Some(factor)) => {
                prop_assert_eq!(factor, 1.0);
                prop_assert!(deviation(after, before) < 1e-8, "{:?}: {:?}, {:?}", invariant, before, after);
            }
            (Invariance::Relative { half_powers }, Some(factor)) => {
                let determinant = map.determinant().expect("one determinant");
                let size = determinant.abs().powf(f64::from(half_powers) / 2.0);
                prop_assert!((factor.abs() / size - 1.0).abs() < 1e-12);
                let expected = before.map(|value| value * factor);
                prop_assert!(deviation(after, expected) < 1e-8, "{:?}: {:?}, {:?}", invariant, expected, after);
            }
            other => prop_assert!(false, "{:?}: {:?}", invariant, other),
        }
    }
    Ok(broken)
}

/// Inverse and composition on points; chains in both spellings.
fn check_group<F: Family + core::fmt::Debug>(
    b_from_a: &F,
    c_from_b: &F,
    points: [Point; 5],
) -> Result<(), TestCaseError> {
    let a_from_b = b_from_a.inverse().expect("invertible");
    let c_from_a = b_from_a.then(c_from_b);
    for point in points {
        let there = b_from_a.image(point).expect("in front");
        let back = a_from_b.image(there).expect("in front");
        prop_assert!(distance(back, point) < 1e-8, "{:?} came back as {:?}", point, back);
        prop_assert_eq!(F::IDENTITY.image(point), Some(point));
        if let Some(far) = c_from_b.image(there) {
            let at_once = c_from_a.image(point).expect("in front");
            prop_assert!(distance(at_once, far) < 1e-8 * (1.0 + distance(far, [0.0; 2])));
            let spelled = c_from_b.after(b_from_a).image(point);
            prop_assert_eq!(spelled, Some(at_once));
        } else {
            prop_assert_eq!(c_from_a.image(point), None);
        }
    }
    Ok(())
}

/// Fits to exact pairs give the map back, from the fewest pairs on.
fn check_fit<F: Family>(map: &F, points: [Point; 5]) -> Result<(), TestCaseError> {
    let exact = pairs(map, &points);
    for used in F::MINIMAL..=5 {
        let fitted = F::fit(&exact[..used]).expect("a map");
        for pair in &exact {
            let found = fitted.image(pair.from).expect("in front");
            let tolerance = 3e-11 * (1.0 + distance(pair.to, [0.0; 2]));
            prop_assert!(distance(found, pair.to) < tolerance, "{} pairs: {:?} against {:?}", used, found, pair.to);
        }
    }
    prop_assert!(F::fit(&exact[..F::MINIMAL - 1]).is_none(), "fewer pairs than determine a map");
    for bad in [f64::NAN, f64::INFINITY] {
        let mut pairs = exact.clone();
        pairs[1].to[0] = bad;
        prop_assert!(F::fit(&pairs).is_none());
        pairs[1] = Correspondence { from: [0.0, bad], ..exact[1] };
        prop_assert!(F::fit(&pairs).is_none());
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rigid_maps(map in rigid(), next in rigid(), points in five_points()) {
        prop_assert_eq!(check_invariants(&map, points)?, []);
        check_group(&map, &next, points)?;
        check_fit(&map, points)?;
    }

    #[test]
    fn similarities(map in similarity(), next in similarity(), points in five_points()) {
        check_invariants(&map, points)?;
        check_group(&map, &next, points)?;
        check_fit(&map, points)?;
        prop_assert!((map.then(&next).scale() / (map.scale() * next.scale()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn affine_maps(map in affine(), next in affine(), points in five_points()) {
        check_invariants(&map, points)?;
        check_group(&map, &next, points)?;
        check_fit(&map, points)?;
        let midpoint = |a: Point, b: Point| [f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1])];
        let [a, b, ..] = points;
        let moved = map.apply(midpoint(a, b));
        prop_assert!(distance(moved, midpoint(map.apply(a), map.apply(b))) < 1e-9);
    }

    #[test]
    fn perspective_maps(map in perspective(), next in perspective(), points in five_points()) {
        check_invariants(&map, points)?;
        check_group(&map, &next, points)?;
        check_fit(&map, points)?;
    }

    /// Each family is part of the next one.
    #[test]
    fn families_are_nested(map in rigid(), points in five_points()) {
        for point in points {
            let image = map.apply(point);
            prop_assert_eq!(Similarity::from(map).apply(point), image);
            prop_assert_eq!(Affine::from(map).apply(point), image);
            prop_assert_eq!(Perspective::from(map).apply(point), Some(image));
        }
    }

    /// Least squares over many noisy pairs predicts other points better than the fewest pairs do, nearly always.
    #[test]
    fn more_pairs_are_better(map in perspective(), seed in any::<u64>()) {
        let mut number = numbers(seed);
        let _: [f64; 3] = [(); 3].map(|()| number());
        prop_assert!(improves(&Rigid::new([0.8, 0.6], [3.0, 4.0]).expect("a direction"), &mut number));
        prop_assert!(improves(&Similarity::new([0.8, 1.6], [3.0, 4.0]).expect("a scale"), &mut number));
        prop_assert!(improves(&Affine::new([[1.0, 0.3], [-0.5, 1.4]], [3.0, 4.0]).expect("not singular"), &mut number));
        prop_assert!(improves(&map, &mut number));
    }

    /// No map of the family near the fitted one has a smaller error.
    #[test]
    fn least_squares_are_least(seed in any::<u64>(), by in [-1e-3..1e-3, -1e-3..1e-3, -1e-3..1e-3, -1e-3..1e-3]) {
        let mut number = numbers(seed);
        let noisy: Vec<_> = (0..12).map(|_| Correspondence {
            from: [number(), number()], to: [number(), number()],
        }).collect();
        let error = |map: &dyn Fn(Point) -> Point| noisy.iter().map(|p| distance(map(p.from), p.to).powi(2)).sum::<f64>();
        let [d0, d1, d2, d3] = by;
        if let Some(best) = Rigid::fit(&noisy) {
            let ([c, s], [u, v]) = (best.direction(), best.translation());
            let other = Rigid::new([c + d0, s + d1], [u + d2, v + d3]).expect("a direction");
            prop_assert!(error(&|p| best.apply(p)) <= error(&|p| other.apply(p)));
        }
        if let Some(best) = Similarity::fit(&noisy) {
            let ([a, b], [u, v]) = (best.turned(), best.translation());
            let other = Similarity::new([a + d0, b + d1], [u + d2, v + d3]).expect("a scale");
            prop_assert!(error(&|p| best.apply(p)) <= error(&|p| other.apply(p)));
        }
        let best = Affine::fit(&noisy).expect("a map");
        let ([[a, b], [c, d]], [u, v]) = (best.linear(), best.translation());
        let other = Affine::new([[a + d0, b + d1], [c + d2, d + d3]], [u + d1, v + d2]).expect("not singular");
        prop_assert!(error(&|p| best.apply(p)) <= error(&|p| other.apply(p)));
    }

    /// Points in one place or on one line determine nothing, wherever they lie and however they are turned.
    #[test]
    fn degenerate_points_have_no_map(map in affine(), at in place(), along in turn(), steps in prop::array::uniform6(-9.0..9.0)) {
        let general: Vec<Point> = vec![[0.0, 0.0], [3.0, 1.0], [1.0, 4.0], [-2.0, 2.0], [5.0, -3.0], [0.5, 0.7]];
        let one_place = vec![at; 6];
        let line: Vec<Point> = steps.iter().map(|t| [at[0] + t * along.cos(), at[1] + t * along.sin()]).collect();
        // All but one on a line: enough for an affine map, not for a perspective one.
        let mut all_but_one = line.clone();
        all_but_one[2] = [at[0] - 7.0 * along.sin(), at[1] + 7.0 * along.cos()];
        let both = |from: &[Point], to: &[Point]| -> Vec<_> {
            from.iter().zip(to).map(|(&from, &to)| Correspondence { from, to }).collect()
        };
        for (from, to) in [(&one_place, &general), (&general, &one_place)] {
            let pairs = both(from, to);
            prop_assert_eq!(Rigid::fit(&pairs), None);
            prop_assert_eq!(Similarity::fit(&pairs), None);
            prop_assert_eq!(Affine::fit(&pairs), None);
            prop_assert_eq!(Perspective::fit(&pairs), None);
        }
        // Nearly one place: as far apart as coordinates are rounded.
        let rounded: Vec<_> = (0..6_u64).map(|n| [f64::from_bits(at[0].to_bits() + n % 2), f64::from_bits(at[1].to_bits() + n / 3)]).collect();
        let images: Vec<_> = rounded.iter().map(|&[x, y]| [2.0 * x, 2.0 * y]).collect();
        prop_assert_eq!(Rigid::fit(&both(&rounded, &images)), None);
        prop_assert_eq!(Similarity::fit(&both(&rounded, &images)), None);
        for (from, to) in [(&line, &general), (&general, &line)] {
            prop_assert_eq!(Affine::fit(&both(from, to)), None);
            prop_assert_eq!(Perspective::fit(&both(from, to)), None);
        }
        let spread = (0..6).all(|a| (0..a).all(|b| (steps[a] - steps[b]).abs() > 0.1));
        if spread {
            let images: Vec<_> = all_but_one.iter().map(|&point| map.apply(point)).collect();
            prop_assert_eq!(Perspective::fit(&both(&all_but_one, &images)), None);
            prop_assert!(Affine::fit(&both(&all_but_one, &images)).is_some());
            for (from, to) in [(&all_but_one, &general), (&general, &all_but_one)] {
                prop_assert_eq!(Perspective::fit(&both(&from[..4], &to[..4])), None);
            }
        }
    }

    #[test]
    fn the_recognizers_maps_and_back(numbers in prop::array::uniform6(-3.0_f32..3.0), [g, h] in [-1e-3_f32..1e-3, -1e-3..1e-3]) {
        let [a, b, c, d, x, y] = numbers;
        prop_assume!((a * d - b * c).abs() > 1e-3);
        let map = transform::Affine { linear: [[a, b], [c, d]], translation: [x, y] };
        prop_assert_eq!(Affine::widened(map).expect("not singular").narrowed(), map);
        let map = transform::Homography([[a, b, x], [c, d, y], [g, h, 1.0]]);
        let wide = Perspective::widened(map);
        prop_assume!(wide.is_some());
        let back = wide.and_then(|wide| wide.narrowed()).expect("in front");
        for (found, expected) in back.0.as_flattened().iter().zip(map.0.as_flattened()) {
            prop_assert!((found - expected).abs() <= 2e-7 * expected.abs());
        }
    }
}

/// Numbers in -1..1 by a linear congruence.
fn numbers(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 30) as f64 - 1.0
    }
}

/// Over forty trials with noise of 0.001: the median error at other points, from the fewest pairs and from 60.
fn improves<F: Family>(map: &F, number: &mut impl FnMut() -> f64) -> bool {
    let mut errors = [Vec::new(), Vec::new()];
    for _ in 0..40 {
        let noisy: Vec<_> = (0..60)
            .map(|_| {
                let from = [number(), number()];
                let [u, v] = map.image(from).expect("in front");
                Correspondence { from, to: [u + 0.001 * number(), v + 0.001 * number()] }
            })
            .collect();
        for (errors, used) in errors.iter_mut().zip([F::MINIMAL, 60]) {
            let error = F::fit(&noisy[..used]).map_or(f64::INFINITY, |fitted| {
                [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]
                    .map(|p| match (fitted.image(p), map.image(p)) {
                        (Some(found), Some(exact)) => distance(found, exact),
                        _ => f64::INFINITY,
                    })
                    .into_iter()
                    .fold(0.0, f64::max)
            });
            errors.push(error);
        }
    }
    let [fewest, all] = errors.map(|mut errors| {
        errors.sort_by(f64::total_cmp);
        errors[20]
    });
    all < fewest / 1.5
}

/// A family that claimed less than it keeps would pass the property tests: of the broken invariants, each is broken.
#[test]
fn what_is_called_broken_is_broken() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let mut often = |check: &mut dyn FnMut(&mut TestRunner) -> Vec<Invariant>| {
        let mut counts = Invariant::ALL.map(|invariant| (invariant, 0));
        for _ in 0..200 {
            let broken = check(&mut runner);
            for (invariant, count) in &mut counts {
                *count += usize::from(broken.contains(invariant));
            }
        }
        counts
    };
    let affine = often(&mut |runner| {
        let map = affine().new_tree(runner).expect("a map").current();
        check_invariants(&map, five_points().new_tree(runner).expect("points").current()).expect("as it says")
    });
    let perspective = often(&mut |runner| {
        let map = perspective().new_tree(runner).expect("a map").current();
        check_invariants(&map, five_points().new_tree(runner).expect("points").current()).expect("as it says")
    });
    for (counts, broken) in [(affine, 3), (perspective, 5)] {
        for (number, (invariant, count)) in counts.into_iter().enumerate() {
            // `ALL` goes from the weakest to the strongest; areas are relative under affine maps.
            let expected = if number < broken { 150..=200 } else { 0..=0 };
            assert!(expected.contains(&count), "{invariant:?} was broken {count} times of 200");
        }
    }
    // Similarities break none, but lengths and areas only stay up to a factor.
    let doubled = Similarity::new([0.0, 2.0], [1.0, 1.0]).expect("a scale");
    assert_eq!((doubled.factor(Invariant::Length), doubled.factor(Invariant::Area)), (Some(2.0), Some(4.0)));
    let mirrored = Affine::new([[-1.0, 0.0], [0.0, 3.0]], [0.0, 0.0]).expect("not singular");
    assert_eq!((mirrored.factor(Invariant::Area), mirrored.factor(Invariant::Length)), (Some(-3.0), None));
}

#[test]
fn maps_that_are_none() {
    assert_eq!(Rigid::new([0.0, 0.0], [1.0, 2.0]), None);
    assert_eq!(Rigid::new([f64::NAN, 1.0], [1.0, 2.0]), None);
    assert_eq!(Similarity::new([0.0, 0.0], [1.0, 2.0]), None);
    assert_eq!(Similarity::new([1.0, 0.0], [f64::INFINITY, 2.0]), None);
    assert_eq!(Affine::new([[1.0, 2.0], [2.0, 4.0]], [0.0, 0.0]), None);
    assert_eq!(Affine::widened(transform::Affine { linear: [[0.0; 2]; 2], translation: [0.0; 2] }), None);
    assert_eq!(Perspective::new([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]), None);
    assert_eq!(Perspective::new([[0.0; 3]; 3]), None);
    // A mirror image is no rotation; of a square none is better than another.
    let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
    let mirrored: Vec<_> = square.iter().map(|&[x, y]| Correspondence { from: [x, y], to: [-x, y] }).collect();
    assert_eq!((Rigid::fit(&mirrored), Similarity::fit(&mirrored)), (None, None));
    assert!(Affine::fit(&mirrored).is_some_and(|map| map.determinant() == Some(-1.0)));
    assert!(Perspective::fit(&mirrored).is_some());
}

#[test]
fn nothing_behind_the_camera_has_an_image() {
    let map = Perspective::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]]).expect("not singular");
    assert_eq!(map.apply([1.0, 4.0]), Some([0.5, 2.0]));
    assert_eq!((map.apply([-1.0, 4.0]), map.apply([-3.0, 4.0])), (None, None));
    // The other half of the plane, by the sign of the matrix.
    let other = Perspective::new(map.matrix().map(|row| row.map(|entry| -entry))).expect("not singular");
    assert_eq!((other.apply([1.0, 4.0]), other.apply([-3.0, 4.0])), (None, Some([1.5, -2.0])));
    // Points on both sides of the vanishing line: no camera sees them at once.
    let pair = |from: [f64; 2]| {
        let w = from[0] + 1.0;
        Correspondence { from, to: [from[0] / w, from[1] / w] }
    };
    let split = [[1.0, 0.0], [2.0, 1.0], [1.0, 2.0], [-3.0, 1.0], [-4.0, -1.0]].map(pair);
    assert_eq!(Perspective::fit(&split), None);
    let front = [[1.0, 0.0], [2.0, 1.0], [1.0, 2.0], [3.0, 1.5], [0.0, -1.0]].map(pair);
    assert!(Perspective::fit(&front).is_some());
}

/// Pixels of a large frame, far from the origin: normalization keeps the digits.
#[test]
fn fits_far_from_the_origin() {
    let points = [[0.0, 0.0], [640.0, 10.0], [30.0, 480.0], [600.0, 470.0], [320.0, 200.0]];
    let far = points.map(|[x, y]| [x + 1e6, y - 3e6]);
    let exact = Perspective::new([[1.1, 0.1, 20.0], [-0.05, 0.9, 30.0], [1e-4, -2e-4, 1.0]]).expect("not singular");
    let pairs: Vec<_> = far
        .iter()
        .zip(points)
        .map(|(&from, point)| Correspondence { from, to: exact.apply(point).expect("in front") })
        .collect();
    for used in 4..=5 {
        let fitted = Perspective::fit(&pairs[..used]).expect("a map");
        for pair in &pairs {
            assert!(distance(fitted.apply(pair.from).expect("in front"), pair.to) < 1e-8);
        }
    }
}
