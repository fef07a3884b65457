//! Weak perspective against exact projection: the error formula of Appendix A, its bound, and the range it holds in.

use daymark_core::camera::weak_perspective::{Extent, WeakPerspective};
use daymark_core::family::{Affine, Correspondence, Family};
use proptest::prelude::*;

type Vector = [f64; 3];

fn model() -> impl Strategy<Value = WeakPerspective> {
    (50.0..4_000.0, 1.0..500.0).prop_map(|(f, z)| WeakPerspective::new(f, z).expect("positive"))
}

/// Points of an object that reaches from 1 % to 300 % of a depth.
fn objects() -> impl Strategy<Value = (WeakPerspective, Vec<Vector>)> {
    (model(), prop::collection::vec([-1.0..1.0, -1.0..1.0, 0.01..3.0], 1..40)).prop_map(|(model, points)| {
        let z = model.average_depth();
        (model, points.into_iter().map(|[x, y, depth]| [x * z, y * z, depth * z]).collect())
    })
}

fn norm([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

fn minus([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a - c, b - d]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_formula_is_the_difference((model, points) in objects()) {
        for point in points {
            let exact = model.project_exactly(point).expect("in front");
            let found = model.error(point).expect("in front");
            let expected = minus(exact, model.project(point));
            prop_assert!(norm(minus(found, expected)) <= 1e-12 * (1.0 + norm(exact) + norm(model.project(point))));
        }
    }

    #[test]
    fn no_point_is_off_by_more_than_the_bound_and_one_is((model, points) in objects()) {
        let object = Extent::of_points(points.iter().copied()).expect("in front");
        let bound = model.bound(object);
        for &point in &points {
            let off = norm(minus(model.project_exactly(point).expect("in front"), model.project(point)));
            prop_assert!(off <= bound.error_px * (1.0 + 1e-9) + 1e-9, "{} px, at most {} px", off, bound.error_px);
            prop_assert!((point[2] / model.average_depth() - 1.0).abs() <= bound.relative_depth * (1.0 + 1e-12));
        }
        let at_rim = |depth: f64| {
            let point = [object.radius() * 0.6, object.radius() * -0.8, depth];
            norm(minus(model.project_exactly(point).expect("in front"), model.project(point)))
        };
        let worst = at_rim(object.nearest()).max(at_rim(object.farthest()));
        prop_assert!((worst - bound.error_px).abs() <= 1e-9 * (1.0 + worst), "{} px, bound {} px", worst, bound.error_px);
    }

    /// Inside the range the tolerance is kept, outside it is not, at the rim.
    #[test]
    fn the_range_ends_where_the_tolerance_does(model in model(), tolerance in 0.01..50.0, radius in 0.01..300.0, t in 0.0..1.0) {
        let [nearest, farthest] = model.depths_within(tolerance, radius);
        prop_assert!(nearest > 0.0 && nearest < model.average_depth() && farthest > model.average_depth());
        let off = |depth: f64| norm(minus(model.project_exactly([radius, 0.0, depth]).expect("in front"), model.project([radius, 0.0, depth])));
        let last = if farthest.is_finite() { farthest } else { 1e6 * model.average_depth() };
        prop_assert!(off(nearest + t * (last - nearest)) <= tolerance * (1.0 + 1e-9));
        prop_assert!(off(0.99 * nearest) > tolerance);
        if farthest < 1e6 * model.average_depth() {
            prop_assert!(off(1.01 * farthest) > tolerance);
        }
        let z = model.average_depth();
        let inside = Extent::new(nearest + 0.001 * (z - nearest), z + 0.999 * (last - z), radius).expect("in front");
        prop_assert!(model.check(inside, tolerance).is_ok());
        let outside = Extent::new(nearest * 0.99, z, radius).expect("in front");
        let refused = model.check(outside, tolerance).expect_err("too deep");
        prop_assert!(refused.error_px > tolerance);
        prop_assert_eq!((refused.tolerance_px, refused.depths_within), (tolerance, [nearest, farthest]));
    }

    /// No other average depth has a smaller bound.
    #[test]
    fn the_balanced_depth_is_best(nearest in 1.0..200.0, depth in 0.0..100.0, radius in 0.1..50.0, other in 0.5..2.0) {
        let object = Extent::new(nearest, nearest + depth, radius).expect("in front");
        let best = WeakPerspective::balanced(800.0, object).expect("positive");
        let z = best.average_depth();
        prop_assert!(nearest * (1.0 - 1e-12) <= z && z <= (nearest + depth) * (1.0 + 1e-12));
        let other = WeakPerspective::new(800.0, z * other).expect("positive");
        prop_assert!(best.bound(object).error_px <= other.bound(object).error_px * (1.0 + 1e-9) + 1e-9);
    }

    /// The proposition of Appendix A, as it is used: two views of a plane are affine maps of one another, up to the two
    /// bounds. The affine map is the one of the two weak projections, so it needs no fit.
    #[test]
    fn views_are_affine_maps_of_one_another_up_to_the_bounds(
        points in prop::collection::vec([-8.0..8.0, -12.0..12.0], 5..30), yaws in [-0.8..0.8, -0.8..0.8], distance in 60.0..300.0,
    ) {
        let views = yaws.map(|yaw: f64| {
            let in_camera: Vec<_> = points.iter().map(|[x, y]| [x * yaw.cos(), *y, distance - x * yaw.sin()]).collect();
            let object = Extent::of_points(in_camera.iter().copied()).expect("in front");
            let model = WeakPerspective::balanced(700.0, object).expect("positive");
            (in_camera, model, model.bound(object).error_px)
        });
        let [(first, first_model, first_bound), (second, second_model, second_bound)] = &views;
        let pairs: Vec<_> = first.iter().zip(second)
            .map(|(&a, &b)| Correspondence { from: first_model.project(a), to: second_model.project(b) }).collect();
        let Some(second_from_first) = Affine::fit(&pairs) else { return Ok(()) };
        let [[a, b], [c, d]] = second_from_first.linear();
        let stretch = (a * a + b * b + c * c + d * d).sqrt();
        for (&p, &q) in first.iter().zip(second) {
            let seen = first_model.project_exactly(p).expect("in front");
            let expected = second_model.project_exactly(q).expect("in front");
            let off = norm(minus(second_from_first.apply(seen), expected));
            prop_assert!(off <= second_bound + stretch * first_bound + 1e-6, "{} px", off);
        }
    }
}

#[test]
fn numbers_by_hand() {
    // f = 1000 px, Z = 100 m: 10 px a metre. A point 8 m to the side and 25 m behind: -10 * (25 / 125) * 8.
    let model = WeakPerspective::new(1_000.0, 100.0).expect("positive");
    assert_eq!(model.project([8.0, -2.0, 125.0]), [80.0, -20.0]);
    assert_eq!(model.project_exactly([8.0, -2.0, 125.0]), Some([64.0, -16.0]));
    assert_eq!(model.error([8.0, -2.0, 125.0]), Some([-16.0, 4.0]));
    // In front of the average depth it is larger: 10 * (20 / 80) * 8.
    assert_eq!(model.error([8.0, 0.0, 80.0]), Some([20.0, 0.0]));
    assert_eq!(model.error([8.0, 0.0, 100.0]).map(|[x, _]| x.abs()), Some(0.0));
    let bound = model.bound(Extent::new(80.0, 125.0, 8.0).expect("in front"));
    assert_eq!((bound.error_px, bound.relative_depth), (20.0, 0.25));
    assert_eq!(model.depths_within(20.0, 8.0), [80.0, 100.0 / 0.75]);
    let balanced = WeakPerspective::balanced(1_000.0, Extent::new(75.0, 150.0, 1.0).expect("in front"));
    assert_eq!(balanced, WeakPerspective::new(1_000.0, 100.0));
}

#[test]
fn what_is_out_of_range_is_told() {
    let model = WeakPerspective::new(1_000.0, 100.0).expect("positive");
    assert_eq!(model.error([1.0, 1.0, 0.0]), None);
    assert_eq!(model.project_exactly([1.0, 1.0, -3.0]), None);
    assert_eq!(model.error([1.0, 1.0, f64::NAN]), None);
    let object = Extent::new(80.0, 125.0, 8.0).expect("in front");
    let refused = model.check(object, 5.0).expect_err("20 px");
    assert_eq!(
        refused.to_string(),
        "weak perspective is off by up to 20.00 px, 5.00 px are allowed: it would do for depths from 94.1 m to 106.7 m; use \
         full perspective"
    );
    assert!(model.check(object, f64::NAN).is_err() && model.check(object, -1.0).is_err());
    assert_eq!(model.depths_within(-1.0, 8.0), [100.0, 100.0]);
    // On the axis nothing is off, and 100 px of tolerance hold for 8 m to infinity.
    assert_eq!(model.depths_within(1.0, 0.0), [0.0, f64::INFINITY]);
    assert_eq!(model.depths_within(80.0, 8.0), [50.0, f64::INFINITY]);

    for (nearest, farthest, radius) in [
        (0.0, 1.0, 1.0),
        (-1.0, 1.0, 1.0),
        (2.0, 1.0, 1.0),
        (1.0, 2.0, -1.0),
        (f64::NAN, 2.0, 1.0),
        (1.0, f64::INFINITY, 1.0),
    ] {
        assert_eq!(Extent::new(nearest, farthest, radius), None);
    }
    assert_eq!(Extent::of_points([]), None);
    assert_eq!(Extent::of_points([[0.0, 0.0, 5.0], [0.0, 0.0, -5.0]]), None);
    assert_eq!(Extent::of_points([[f64::NAN, 0.0, 5.0]]), None);
    assert_eq!(WeakPerspective::new(0.0, 1.0), None);
    assert_eq!(WeakPerspective::new(700.0, f64::INFINITY), None);
}
