//! Corners from which no pose follows, or two do: each an honest answer or a refusal with its reason.

use daymark_core::camera::Intrinsics;
use daymark_core::camera::facade::{Facade, NoFacade};
use daymark_core::camera::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use daymark_core::family::{Correspondence, Family, Perspective};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::{Camera, Lens, Vec3};

const SETTINGS: PoseSettings = PoseSettings::of_frame(640, 480);

fn lens() -> Intrinsics {
    Intrinsics::centred(560.0, 640, 480).expect("a lens")
}

fn solve(points: &[PointInView], settings: &PoseSettings) -> Result<Pose, NoPose> {
    PoseSolver::<64>::new().solve(points, &lens(), settings)
}

fn camera(from: [f64; 3], to: [f64; 3]) -> Camera {
    let vector = |[x, y, z]: [f64; 3]| Vec3::new(x, y, z);
    Camera::look_at(vector(from), vector(to), Lens::VGA)
}

fn see(camera: &Camera, model: &[[f64; 3]]) -> Vec<PointInView> {
    let see = |&[x, y, z]: &[f64; 3]| {
        let seen = camera.project(Vec3::new(x, y, z)).expect("in front");
        PointInView { model: [x, y, z], image: [seen.x, seen.y] }
    };
    model.iter().map(see).collect()
}

/// A facade 16 m wide and 12 m high with 5 x 4 corners, in the plane y = 0.
fn facade() -> Vec<[f64; 3]> {
    (0..20).map(|n| [f64::from(n % 5) * 4.0 - 8.0, 0.0, f64::from(n / 5) * 4.0]).collect()
}

fn off(pose: &Pose, camera: &Camera) -> f64 {
    let [x, y, z] = pose.camera_from_model.centre();
    (Vec3::new(x, y, z) - camera.position).length()
}

fn noisy(mut points: Vec<PointInView>, seed: u64) -> Vec<PointInView> {
    let mut random = Distortion::new(seed);
    for point in &mut points {
        point.image = point.image.map(|x| x + 0.5 * random.normal());
    }
    points
}

#[test]
fn points_on_a_line_are_refused() {
    let camera = camera([3.0, -30.0, 1.7], [0.0, 0.0, 6.0]);
    let line: Vec<_> = (0..12).map(|n| [f64::from(n), 0.5 * f64::from(n), f64::from(n) * 0.2]).collect();
    assert_eq!(solve(&see(&camera, &line), &SETTINGS), Err(NoPose::Collinear));
    assert_eq!(solve(&see(&camera, &[[1.0, 2.0, 3.0]; 9]), &SETTINGS), Err(NoPose::Collinear));
}

/// Four points have a pose; whether chance would do as well is said, and asked for by default.
#[test]
fn four_points_are_a_pose_without_a_check() {
    let camera = camera([3.0, -30.0, 1.7], [0.0, 0.0, 6.0]);
    let points = see(&camera, &[[-5.0, 0.0, 0.0], [5.0, 0.0, 1.0], [4.0, 6.0, 9.0], [-4.0, 2.0, 8.0]]);
    let Err(NoPose::ByChance { inliers: 4, log2_chance }) = solve(&points, &SETTINGS) else {
        panic!("{:?}", solve(&points, &SETTINGS))
    };
    assert!((-14.0..-8.0).contains(&log2_chance), "{log2_chance}");
    let picked_by_hand = PoseSettings { log2_chance: -8.0, ..SETTINGS };
    let pose = solve(&points, &picked_by_hand).expect("picked by hand");
    assert!(off(&pose, &camera) < 1e-6);
    assert!(pose.deviation() > 0.05, "four corners with half a pixel: {} m", pose.deviation());
    assert_eq!(solve(&points[..3], &picked_by_hand), Err(NoPose::TooFew { found: 3 }));
}

#[test]
fn a_mirrored_facade_is_named() {
    let camera = camera([6.0, -30.0, 1.7], [0.0, 0.0, 6.0]);
    let points = see(&camera, &facade());
    let mirrored: Vec<_> =
        points.iter().map(|point| PointInView { image: [639.0 - point.image[0], point.image[1]], ..*point }).collect();
    let outside = PoseSettings { front: Some([0.0, -1.0, 0.0]), ..SETTINGS };
    assert!(off(&solve(&points, &outside).expect("not mirrored"), &camera) < 1e-6);
    assert_eq!(solve(&mirrored, &outside), Err(NoPose::Mirrored));
    // Without a front it is a facade seen from behind, and nothing is wrong with that.
    assert!(solve(&mirrored, &SETTINGS).expect("from behind").camera_from_model.centre()[1] > 0.0);
}

/// Of a solid building in a mirror one wall fits, as seen from inside, and the other does not.
#[test]
fn a_mirrored_building_is_refused() {
    let camera = camera([14.0, -30.0, 1.7], [0.0, 0.0, 6.0]);
    let mut points: Vec<_> = facade();
    points.extend(facade().iter().map(|[x, _, z]| [8.0, x + 8.0, *z]));
    let mirrored: Vec<_> = see(&camera, &points)
        .iter()
        .map(|point| PointInView { image: [639.0 - point.image[0], point.image[1]], ..*point })
        .collect();
    let no = solve(&mirrored, &SETTINGS);
    assert_eq!(no, Err(NoPose::OnePlane { inliers: 24, off_plane: 16 }));
    assert!(solve(&see(&camera, &points), &SETTINGS).is_ok());
}

/// Seen straight on from far away, all points lie at one depth and small turns either way look alike: the covariance holds the
/// truth, or the other side is named.
#[test]
fn points_at_one_depth() {
    let (mut honest, cases) = (0, 60);
    for seed in 0..cases {
        let camera = camera([0.0, -90.0, 6.0], [0.0, 0.0, 6.0]);
        let pose = solve(&noisy(see(&camera, &facade()), seed), &SETTINGS).expect("a pose");
        let close = off(&pose, &camera) < 3.0 * pose.deviation();
        let other = pose.rival.is_some_and(|rival| {
            let [x, y, z] = rival.centre();
            (Vec3::new(x, y, z) - camera.position).length() < 3.0 * pose.deviation()
        });
        honest += usize::from(close || other);
        assert!(pose.deviation() > 0.3, "the sideways position is known badly: {}", pose.deviation());
    }
    assert!(honest as u64 >= cases * 95 / 100, "{honest} of {cases}");
}

#[test]
fn no_focal_length_is_no_camera() {
    for focal in [0.0, -3.0, f64::NAN, f64::INFINITY] {
        let no = Intrinsics::centred(focal, 640, 480).expect_err("no camera");
        assert!(no.to_string().contains("focal lengths are positive"), "{no}");
    }
    assert!(Intrinsics::new([500.0, 500.0], [f64::NAN, 0.0]).is_err());
}

#[test]
fn edge_on_is_refused() {
    // The camera stands in the facade's plane, 40 m beside it.
    let points = noisy(see(&camera([-50.0, -0.02, 6.0], [0.0, 0.0, 6.0]), &facade()), 3);
    let no = solve(&points, &SETTINGS);
    assert!(matches!(no, Err(NoPose::EdgeOn { .. } | NoPose::Undetermined { .. })), "{no:?}");
    assert!(no.expect_err("refused").to_string().contains("building"));
}

#[test]
fn numbers_that_are_none_are_refused() {
    let camera = camera([3.0, -30.0, 1.7], [0.0, 0.0, 6.0]);
    let good = see(&camera, &facade());
    for broken in [f64::NAN, f64::INFINITY] {
        let mut points = good.clone();
        points[4].image[1] = broken;
        assert_eq!(solve(&points, &SETTINGS), Err(NoPose::NotFinite));
        let mut points = good.clone();
        points[4].model[2] = broken;
        assert_eq!(solve(&points, &SETTINGS), Err(NoPose::NotFinite));
        assert_eq!(solve(&good, &PoseSettings { deviation_px: broken, ..SETTINGS }), Err(NoPose::NotFinite));
    }
    assert_eq!(solve(&good, &PoseSettings { deviation_px: 0.0, ..SETTINGS }), Err(NoPose::NotFinite));
    let many = [good.clone(), good.clone(), good.clone(), good].concat();
    assert_eq!(solve(&many, &SETTINGS), Err(NoPose::TooMany { found: 80, capacity: 64 }));
}

/// Random correspondences, of any number, never make a pose.
#[test]
fn chance_makes_no_pose() {
    let mut random = Distortion::new(77);
    for case in 0..300 {
        let count = 4 + case % 60;
        let mut at = |scale: f64| scale * (random.unit() - 0.5);
        let points: Vec<_> = (0..count)
            .map(|_| PointInView {
                model: [at(20.0), at(20.0), at(30.0)],
                image: [320.0 + at(300.0), 240.0 + at(400.0)],
            })
            .collect();
        assert!(solve(&points, &SETTINGS).is_err(), "case {case}");
    }
}

#[test]
fn weak_perspective_says_when_it_is_out_of_its_range() {
    let tower: Vec<_> =
        (0..24).map(|n| [f64::from(n % 3) * 5.0, f64::from(n / 3 % 2) * 10.0, f64::from(n / 6) * 8.0]).collect();
    let near = solve(&see(&camera([5.0, -25.0, 1.7], [5.0, 0.0, 12.0]), &tower), &SETTINGS).expect("near");
    let too_deep = near.weak_perspective.expect_err("a deep tower from near");
    assert!(too_deep.error_px > 20.0, "{too_deep}");
    let far = solve(&see(&camera([5.0, -400.0, 1.7], [5.0, 0.0, 12.0]), &tower), &SETTINGS).expect("far");
    assert!(far.weak_perspective.expect("from far it does").error_px < 0.5);
}

#[test]
fn a_facade_of_known_width() {
    let camera = camera([9.0, -26.0, 1.7], [0.0, 0.0, 6.0]);
    let corners = [[-8.0, 0.0, 12.0], [8.0, 0.0, 12.0], [8.0, 0.0, 0.0], [-8.0, 0.0, 0.0]];
    let seen: Vec<_> = see(&camera, &corners).iter().map(|point| point.image).collect();
    let seen: [[f64; 2]; 4] = seen.try_into().expect("four");
    let facade = Facade::from_width(seen, 16.0, &lens()).expect("a facade");
    assert!((facade.size[1] - 12.0).abs() < 1e-9 && facade.skew < 1e-9, "{facade:?}");
    // The facade's origin is its lower left corner.
    let [x, y, z] = facade.camera_from_facade.centre();
    assert!((Vec3::new(x - 8.0, y, z) - camera.position).length() < 1e-9);
    // Its corners, with a covariance.
    let by_hand = PoseSettings { log2_chance: -8.0, front: Some([0.0, -1.0, 0.0]), ..SETTINGS };
    let pose = solve(&facade.points(seen), &by_hand).expect("a pose");
    assert!((pose.camera_from_model.centre()[1] - y).abs() < 1e-6);

    let [a, b, c, d] = seen;
    assert_eq!(Facade::from_width([b, a, d, c], 16.0, &lens()), Err(NoFacade::Mirrored));
    assert_eq!(Facade::from_width([a, a, c, d], 16.0, &lens()), Err(NoFacade::Degenerate));
    assert_eq!(Facade::from_width(seen, 0.0, &lens()), Err(NoFacade::Degenerate));
    let bent = Facade::from_width([a, [b[0] + 120.0, b[1]], c, [d[0] - 90.0, d[1]]], 16.0, &lens());
    assert!(matches!(bent, Err(NoFacade::NotARectangle { .. } | NoFacade::Degenerate)), "{bent:?}");

    let pairs: Vec<_> =
        see(&camera, &corners).iter().map(|p| Correspondence { from: [p.model[0], p.model[2]], to: p.image }).collect();
    let image_from_facade = Perspective::fit(&pairs).expect("a map");
    let (pose, _) = daymark_core::camera::facade::pose_from_homography(&image_from_facade, &lens()).expect("a pose");
    let [x, y, z] = pose.centre();
    assert!((Vec3::new(x, y, z) - camera.position).length() < 1e-9);
}

/// Without a lens the truth lies within the interval, and the direction is right.
#[test]
fn without_a_lens_there_is_a_direction_and_an_interval() {
    let mut inside = 0;
    for seed in 0..40 {
        let mut random = Distortion::new(seed);
        let from = [30.0 * random.unit() - 15.0, -60.0 + 20.0 * random.unit(), 1.7];
        let camera = camera(from, [0.0, 0.0, 6.0]);
        let mut model = facade();
        model.extend(facade().iter().map(|[x, _, z]| [8.0, x + 8.0, *z]));
        let points = noisy(see(&camera, &model), seed);
        let settings = PoseSettings { front: None, ..SETTINGS };
        let found = PoseSolver::<64>::new().direction(&points, [320.0, 1920.0], &settings).expect("a direction");
        let middle = Vec3::new(found.centroid[0], found.centroid[1], found.centroid[2]);
        let range = (camera.position - middle).length();
        let towards = (camera.position - middle).unit();
        let [x, y, z] = found.towards_observer;
        inside += usize::from((found.range_m[0]..found.range_m[1]).contains(&range));
        assert!(towards.dot(Vec3::new(x, y, z)) > found.cosine_of_error - 1e-3, "seed {seed}");
        assert!(found.range_m[1] / found.range_m[0] < 7.0);
    }
    assert!(inside >= 38, "{inside} of 40 ranges within their interval");
}
