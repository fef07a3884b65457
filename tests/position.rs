//! Positions on Earth: local frames against a geodesy crate, fixes from poses, several fixes and landmarks together.

use daymark_core::camera::Intrinsics;
use daymark_core::camera::pose::{PointInView, PoseSettings, PoseSolver};
use daymark_core::fix::agreement::{NoAgreement, combine};
use daymark_core::fix::prior::{Contradiction, Near};
use daymark_core::fix::resection::{NoResection, Sighting, resect};
use daymark_core::fix::site::reach_of_size;
use daymark_core::fix::track::{Track, Update};
use daymark_core::fix::{Evidence, Fix, LocalFrame, Measured, Prior, Site, Wgs84};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::{Camera, Lens, Stand, Tower, Vec3};
use map_3d::{Ellipsoid, enu2geodetic, geodetic2enu};

const PLACES: [[f64; 3]; 6] = [
    [52.0, 13.0, 50.0],
    [0.0, 0.0, 0.0],
    [-33.9, 151.2, 30.0],
    [78.2, 15.6, 400.0],
    [-89.9, 10.0, 2_800.0],
    [27.98, 86.92, 8_848.0],
];

fn place([latitude, longitude, altitude]: [f64; 3]) -> Wgs84 {
    Wgs84::new(latitude, longitude, altitude).expect("on Earth")
}

#[test]
fn the_local_frame_is_that_of_a_geodesy_crate() {
    let mut random = Distortion::new(3);
    for origin in PLACES {
        let frame = LocalFrame::new(place(origin));
        let [lat0, lon0] = [origin[0].to_radians(), origin[1].to_radians()];
        for _ in 0..200 {
            let local = [20e3 * random.unit() - 10e3, 20e3 * random.unit() - 10e3, 1e3 * random.unit()];
            let found = frame.wgs84_from_local(local);
            let (lat, lon, alt) = enu2geodetic(local[0], local[1], local[2], lat0, lon0, origin[2], Ellipsoid::WGS84);
            // A hundred millionth of a degree is a millimetre.
            assert!((found.latitude_deg - lat.to_degrees()).abs() < 1e-9, "{found:?} {}", lat.to_degrees());
            let turn = (found.longitude_deg - lon.to_degrees()).abs();
            let across = found.latitude_deg.to_radians().cos();
            assert!(turn.min(360.0 - turn) * across < 1e-9, "{found:?} {}", lon.to_degrees());
            assert!((found.altitude_m - alt).abs() < 1e-4, "{found:?} {alt}");

            let back = frame.local_from_wgs84(found);
            let (east, north, up) = geodetic2enu(
                found.latitude_deg.to_radians(),
                found.longitude_deg.to_radians(),
                found.altitude_m,
                lat0,
                lon0,
                origin[2],
                Ellipsoid::WGS84,
            );
            for ((back, expected), local) in back.iter().zip([east, north, up]).zip(local) {
                assert!((back - expected).abs() < 1e-6 && (back - local).abs() < 1e-6, "{back} {expected} {local}");
            }
        }
    }
    assert_eq!(Wgs84::new(90.5, 0.0, 0.0), None);
    assert_eq!(Wgs84::new(0.0, f64::NAN, 0.0), None);
}

/// A tower on Earth with another azimuth, and an observer: everything that the fix says is the truth.
#[test]
fn a_pose_becomes_a_fix() {
    let tower = Tower::eight()[0].clone();
    let lens = Intrinsics::centred(560.0, 640, 480).expect("a lens");
    for azimuth in [0.0, 57.0, 190.0, 300.0] {
        let site = daymark_fixtures::Site { azimuth, ..daymark_fixtures::Site::ORIGIN };
        let stand = Stand { angle: 25.0, distance: 55.0, eye: 1.7, aim: 15.0 };
        let camera = Camera::before(site, stand, Lens::VGA);
        let points: Vec<_> = tower
            .corners()
            .iter()
            .take(40)
            .filter_map(|corner| {
                let seen = camera.project(site.world_from_model(corner.model))?;
                let model = [corner.model.x, corner.model.y, corner.model.z];
                Some(PointInView { model, image: [seen.x, seen.y] })
            })
            .collect();
        let pose = PoseSolver::<64>::new().solve(&points, &lens, &PoseSettings::of_frame(640, 480)).expect("a pose");
        let on_earth = Site::exact(place(PLACES[0]), azimuth);
        let fix = on_earth.fix(&pose);
        let local = LocalFrame::new(on_earth.position).local_from_wgs84(fix.position);
        let Vec3 { x, y, z } = camera.position;
        assert!([x, y, z].iter().zip(local).all(|(a, b)| (a - b).abs() < 1e-5), "{local:?}");
        let expected = (-x).atan2(-y).to_degrees().rem_euclid(360.0);
        let forward = camera.view_from_world[2];
        let heading = forward.x.atan2(forward.y).to_degrees().rem_euclid(360.0);
        let near = |found: Option<Measured>, expected: f64| (found.expect("known").value - expected).abs() < 1e-4;
        assert!(near(fix.bearing_deg, expected) && near(fix.heading_deg, heading), "{fix:?}");
        assert!(near(fix.range_m, x.hypot(y)));

        // What is not known of the site is not known of the observer.
        let vague = Site { deviation_m: 3.0, azimuth_deviation_deg: 2.0, ..on_earth }.fix(&pose);
        let along = vague.range_m.expect("known").deviation;
        assert!((along - 3.0).abs() < 0.1, "{along}");
        let side = 55.0 * 2.0_f64.to_radians();
        let across = vague.bearing_deg.expect("known").deviation.to_radians() * 55.0;
        assert!((across - side.hypot(3.0)).abs() < 0.1, "{across}");
        assert!(vague.ellipse().radius() > fix.ellipse().radius() + 5.0);
    }
}

/// The deviation of the heading is what it turns out to be. A wide and low building tells yaw much better than pitch.
#[test]
fn the_heading_is_as_sure_as_it_says() {
    let lens = Intrinsics::centred(560.0, 640, 480).expect("a lens");
    let stand = Stand { angle: 5.0, distance: 45.0, eye: 1.7, aim: 1.0 };
    let camera = Camera::before(daymark_fixtures::Site::ORIGIN, stand, Lens::VGA);
    let truth = camera.view_from_world[2].x.atan2(camera.view_from_world[2].y).to_degrees().rem_euclid(360.0);
    let corner = |n: u32| [f64::from(n) - 20.0, f64::from(n % 3) * 3.0, f64::from(n % 2) * 2.0];
    let mut random = Distortion::new(8);
    let (mut squares, mut said) = (0.0, 0.0);
    for _ in 0..400 {
        let mut see = |model: [f64; 3]| {
            let seen = camera.project(Vec3::new(model[0], model[1], model[2])).expect("in front");
            PointInView { model, image: [seen.x + 0.5 * random.normal(), seen.y + 0.5 * random.normal()] }
        };
        let points: Vec<_> = (0..40).map(|n| see(corner(n))).collect();
        let pose = PoseSolver::<64>::new().solve(&points, &lens, &PoseSettings::of_frame(640, 480)).expect("a pose");
        let heading = Site::exact(place(PLACES[0]), 0.0).fix(&pose).heading_deg.expect("level");
        let off = (heading.value - truth + 180.0).rem_euclid(360.0) - 180.0;
        squares += off * off / 400.0;
        said += heading.deviation.powi(2) / 400.0;
    }
    let ratio = (squares / said).sqrt();
    assert!((0.85..1.15).contains(&ratio), "found {} said {}", squares.sqrt(), said.sqrt());
}

fn fix_at(east: f64, north: f64, deviation: f64) -> Fix {
    let variance = deviation * deviation;
    Fix {
        position: LocalFrame::new(place(PLACES[0])).wgs84_from_local([east, north, 0.0]),
        covariance: [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, variance]],
        bearing_deg: None,
        range_m: None,
        heading_deg: None,
        evidence: Evidence::Fixes { count: 1 },
    }
}

fn from_origin(fix: &Fix) -> [f64; 3] {
    LocalFrame::new(place(PLACES[0])).local_from_wgs84(fix.position)
}

#[test]
fn a_contradicting_fix_is_named_and_left_out() {
    let fixes = [fix_at(0.0, 0.0, 1.0), fix_at(1.0, 0.5, 1.0), fix_at(80.0, -40.0, 1.0), fix_at(0.5, -0.5, 1.0)];
    let combined = combine(&fixes).expect("three agree");
    assert_eq!(combined.left_out.as_slice(), [2]);
    let [east, north, _] = from_origin(&combined.fix);
    assert!((east - 0.5).abs() < 1e-6 && north.abs() < 1e-6);
    assert!((combined.fix.covariance[0][0] - 1.0 / 3.0).abs() < 1e-9);
    assert_eq!(combined.fix.evidence, Evidence::Fixes { count: 3 });

    assert_eq!(combine(&fixes[1..3]), Err(NoAgreement::Contradiction));
    assert_eq!(combine(&[]), Err(NoAgreement::Empty));
    assert_eq!(combine(&fixes[..1]).expect("one").fix, fixes[0]);
    assert_eq!(combine(&[fix_at(0.0, 0.0, 0.0)]), Err(NoAgreement::Degenerate));
}

#[test]
fn a_walker_is_followed_and_wrong_buildings_are_not() {
    let mut random = Distortion::new(21);
    let mut track = Track::new(2.0);
    let (mut squares, mut raw) = (0.0, 0.0);
    for second in 0..120 {
        let north = 1.0 * f64::from(second);
        let noise = [4.0 * random.normal(), 4.0 * random.normal()];
        let wrong = second % 20 == 13;
        let at = if wrong { [150.0, north - 90.0] } else { [noise[0], north + noise[1]] };
        let update = track.update(&fix_at(at[0], at[1], 4.0), f64::from(second));
        assert_eq!(matches!(update, Update::LeftOut { .. }), wrong, "second {second}: {update:?}");
        if second > 20 {
            let [east, now, _] = from_origin(&track.fix(f64::from(second)).expect("a fix"));
            squares += east * east + (now - north) * (now - north);
            raw += noise[0] * noise[0] + noise[1] * noise[1];
        }
    }
    assert!(squares < 0.7 * raw, "filtered {squares}, alone {raw}");
    assert_eq!(track.update(&fix_at(0.0, 0.0, 4.0), 3.0), Update::Unusable);

    // The first fix was wrong: three that agree outvote it.
    let mut track = Track::new(0.0);
    track.update(&fix_at(300.0, 0.0, 2.0), 0.0);
    assert!(matches!(track.update(&fix_at(1.0, 0.0, 2.0), 1.0), Update::LeftOut { .. }));
    assert!(matches!(track.update(&fix_at(0.0, 1.0, 2.0), 2.0), Update::LeftOut { .. }));
    assert_eq!(track.update(&fix_at(-1.0, 0.0, 2.0), 3.0), Update::Outvoted { fixes: 3 });
    assert!(from_origin(&track.fix(3.0).expect("a fix"))[0].abs() < 1.0);
}

/// Landmarks around an observer at a place, with their directions from an axis.
fn sightings(observer: [f64; 2], heading: f64, landmarks: &[[f64; 2]]) -> Vec<Sighting> {
    let frame = LocalFrame::new(place(PLACES[0]));
    let see = |&[east, north]: &[f64; 2]| {
        let azimuth = (east - observer[0]).atan2(north - observer[1]).to_degrees();
        Sighting {
            position: frame.wgs84_from_local([east, north, 0.0]),
            deviation_m: 0.5,
            from_axis_deg: Measured { value: azimuth - heading, deviation: 0.2 },
            range_m: None,
        }
    };
    landmarks.iter().map(see).collect()
}

const LANDMARKS: [[f64; 2]; 5] = [[0.0, 0.0], [90.0, 40.0], [-60.0, 110.0], [150.0, 190.0], [-140.0, 30.0]];

#[test]
fn directions_to_landmarks_give_the_place() {
    let seen = sightings([20.0, -70.0], 350.0, &LANDMARKS);
    let found = resect(&seen, &Prior::default()).expect("a place");
    let [east, north, _] = from_origin(&found.fix);
    assert!((east - 20.0).abs() < 1e-3 && (north + 70.0).abs() < 1e-3, "{east} {north}");
    assert!((found.fix.heading_deg.expect("known").value - 350.0).abs() < 1e-3);
    assert_eq!((found.left_out, found.fix.evidence), (None, Evidence::Bearings { landmarks: 5 }));

    // Two landmarks need a compass.
    assert_eq!(resect(&seen[..2], &Prior::default()), Err(NoResection::TooFew { equations: 2 }));
    let compass = Prior { heading_deg: Some(Measured { value: 350.0, deviation: 2.0 }), near: None };
    let found = resect(&seen[1..3], &compass).expect("a place");
    let [east, north, _] = from_origin(&found.fix);
    assert!((east - 20.0).abs() < 1e-2 && (north + 70.0).abs() < 1e-2, "{east} {north}");
}

#[test]
fn a_landmark_that_contradicts_is_named() {
    let mut seen = sightings([20.0, -70.0], 350.0, &LANDMARKS);
    seen[3].from_axis_deg.value += 25.0;
    let found = resect(&seen, &Prior::default()).expect("a place");
    assert_eq!(found.left_out, Some(3));
    let [east, north, _] = from_origin(&found.fix);
    assert!((east - 20.0).abs() < 1e-3 && (north + 70.0).abs() < 1e-3, "{east} {north}");

    let four = &seen[..4];
    assert!(matches!(resect(four, &Prior::default()), Err(NoResection::Contradiction { .. })));
    seen[0].from_axis_deg.deviation = 0.0;
    assert_eq!(resect(&seen, &Prior::default()), Err(NoResection::NotFinite));
}

/// On the circle through three landmarks every place sees them alike.
#[test]
fn the_dangerous_circle_is_refused() {
    let on_circle = |degrees: f64| [100.0 * degrees.to_radians().sin(), 100.0 * degrees.to_radians().cos()];
    let seen = sightings(on_circle(190.0), 20.0, &[on_circle(10.0), on_circle(60.0), on_circle(320.0)]);
    let no = resect(&seen, &Prior::default());
    assert!(matches!(no, Err(NoResection::Undetermined | NoResection::Ambiguous { .. })), "{no:?}");
}

/// The truth lies in the ellipse as often as it says.
#[test]
fn ellipses_of_resection_are_true() {
    let mut random = Distortion::new(14);
    let (mut inside, mut answers) = (0, 0);
    for _ in 0..300 {
        let observer = [160.0 * random.unit() - 80.0, -30.0 - 80.0 * random.unit()];
        let mut seen = sightings(observer, 10.0, &LANDMARKS);
        for one in &mut seen {
            one.deviation_m = 1e-3;
            one.from_axis_deg.value += 0.2 * random.normal();
        }
        let Ok(found) = resect(&seen, &Prior::default()) else { continue };
        answers += 1;
        let [east, north, _] = from_origin(&found.fix);
        let (e, n) = (east - observer[0], north - observer[1]);
        let [[ee, en, _], [_, nn, _], _] = found.fix.covariance;
        let square = (nn * e * e - 2.0 * en * e * n + ee * n * n) / (ee * nn - en * en);
        inside += u32::from(square < 5.991_5);
    }
    let share = f64::from(inside) / f64::from(answers);
    assert!(answers >= 290 && (0.91..0.985).contains(&share), "{share} of {answers}");
}

#[test]
fn what_was_known_before_chooses_and_refuses() {
    let (here, there) = (fix_at(0.0, 0.0, 2.0), fix_at(60.0, 0.0, 2.0));
    let near = Prior { near: Some(Near { position: here.position, radius_m: 30.0 }), heading_deg: None };
    assert!(near.check(&here).is_ok());
    assert!(matches!(near.check(&there), Err(Contradiction::Position { apart_m }) if (apart_m - 60.0).abs() < 0.01));
    assert_eq!(near.choose(there, here), Some(here));
    let wide = Prior { near: Some(Near { position: here.position, radius_m: 500.0 }), heading_deg: None };
    assert_eq!(wide.choose(there, here), None);

    let compass = Prior { near: None, heading_deg: Some(Measured { value: 358.0, deviation: 5.0 }) };
    let heading = |value| Fix { heading_deg: Some(Measured { value, deviation: 1.0 }), ..here };
    assert!(compass.check(&heading(4.0)).is_ok());
    assert!(
        matches!(compass.check(&heading(178.0)), Err(Contradiction::Heading { apart_deg }) if (apart_deg - 180.0).abs() < 1e-9)
    );
}

/// A building alone: the observer within its reach, and the radius says so.
#[test]
fn a_name_alone_is_a_circle() {
    let reach = reach_of_size(20.0, 100.0, 1_000.0).expect("positive");
    assert!((reach - 210.0).abs() < 1e-9);
    let fix = Site { deviation_m: 10.0, ..Site::exact(place(PLACES[0]), 0.0) }.near(reach);
    assert!((fix.ellipse().radius() - 1.2238 * 210.0).abs() < 3.0, "{}", fix.ellipse().radius());
    assert!(fix.bearing_deg.is_none() && fix.heading_deg.is_none());
    assert_eq!(reach_of_size(20.0, 0.0, 1_000.0), None);
}
