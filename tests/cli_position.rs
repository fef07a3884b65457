//! From pictures to a position: `enroll` makes models, `recognize` and `watch` tell where the observer stands.

#[path = "support/shoot.rs"]
mod shoot;
mod support;

use daymark_core::fix::{LocalFrame, Wgs84};
use serde_json::Value;
use shoot::{before, files, shoot};
use support::{Ran, Town};

const AT: Wgs84 = Wgs84 { latitude_deg: 52.0, longitude_deg: 13.0, altitude_m: 0.0 };
/// Of the fixtures' camera.
const FOCAL: &str = "560";

/// Enrolls the Bell Tower, which looks south, from these angles with its known cameras and these options.
fn enroll(town: &Town, angles: &[f64], options: &[&str]) -> Ran {
    let names = shoot(town, 1, angles);
    let (pictures, cameras) = (files(&names, "pgm"), files(&names, "camera"));
    let mut all = vec!["enroll", "--table", "t.daymark", "--name", "Bell Tower", "--no-lint", "--json"];
    all.extend(options);
    all.extend(pictures.iter().map(String::as_str));
    all.push("--cameras");
    all.extend(cameras.iter().map(String::as_str));
    town.run(&all)
}

/// A frame of the tower from elsewhere, in another's light and noise: its name.
fn frame(town: &Town, angle: f64) -> String {
    let tower = daymark_fixtures::Tower::eight()[0].clone();
    let scene = daymark_fixtures::Scene::alone(tower, 41).lit(daymark_fixtures::Light::overcast());
    let names = shoot::shoot_with(town, &format!("frame{angle}"), &scene, &[before(1, angle)]);
    format!("{}.pgm", names[0])
}

fn recognize(town: &Town, frame: &str, options: &[&str]) -> Value {
    let mut all = vec!["recognize", "--table", "t.daymark", "--json"];
    all.extend(options);
    all.push(frame);
    let document = town.run(&all).succeeded().json();
    document["frames"][0].clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn three(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|axis| number(&value[axis]))
}

/// Where a camera of the fixtures is in the frame of the model that was enrolled.
fn in_model(enrolled: &Value, position: daymark_fixtures::Vec3) -> [f64; 3] {
    let map = &enrolled["enrolled"][0]["model"]["model_from_cameras"];
    let (rotation, shift) = (&map["rotation"], three(&map["translation_m"]));
    [0, 1, 2].map(|row| {
        let [a, b, c] = three(&rotation[row]);
        number(&map["scale"]) * (a * position.x + b * position.y + c * position.z) + shift[row]
    })
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// East and north of where the building stands.
fn ground(fix: &Value) -> [f64; 2] {
    let place = Wgs84 {
        latitude_deg: number(&fix["latitude_deg"]),
        longitude_deg: number(&fix["longitude_deg"]),
        altitude_m: 0.0,
    };
    let [east, north, _] = LocalFrame::new(AT).local_from_wgs84(place);
    [east, north]
}

const PLACE: [&str; 6] = ["--at", "52,13", "--position-error", "1", "--facing", "180"];

#[test]
fn a_frame_tells_where_its_camera_stood() {
    let town = Town::new();
    let enrolled = enroll(&town, &[-24.0, -4.0, 18.0], &PLACE).succeeded().json();
    let model = &enrolled["enrolled"][0]["model"];
    assert_eq!(enrolled["enrolled"][0]["missing_for_a_position"], serde_json::json!([]), "{enrolled:#}");
    assert_eq!(enrolled["table"]["format_version"], 2);
    assert!(number(&model["points"]) >= 100.0, "{model:#}");
    // Cameras look up at a tower, and up is up all the same; its front looks along -y, as the tower's does.
    let rotation = &model["model_from_cameras"]["rotation"];
    assert!(number(&rotation[2][2]) > 0.9995, "tilted: {rotation:#}");
    assert!(number(&rotation[0][0]) > 0.998, "turned: {rotation:#}");

    for angle in [-15.0, 8.0] {
        let seen = recognize(&town, &frame(&town, angle), &["--focal-px", FOCAL, "--map", "map.svg"]);
        let (pose, fix) = (&seen["observer"]["pose"], &seen["observer"]["fix"]);
        let truth = in_model(&enrolled, before(1, angle).position);
        let (found, range) = (three(&pose["position_in_model_m"]), number(&pose["range_m"]));
        let off = apart(found, truth);
        assert!(off < 0.01 * range, "{off} m of {range}: {found:?} {truth:?}");
        assert_eq!(fix["method"], "pose", "{seen:#}");
        // The model's +y axis points north, so its frame is east and north of the building's place.
        let [east, north] = ground(fix);
        assert!(apart([east, north, 0.0], [found[0], found[1], 0.0]) < 0.01, "{east} {north} {found:?}");
        let bearing = (-east).atan2(-north).to_degrees().rem_euclid(360.0);
        assert!((number(&fix["bearing_deg"]) - bearing).abs() < 1e-6);
        // Lens 1 %, place half a metre, azimuth 5 degrees: the last dominates, and the circle knows.
        let radius = number(&fix["radius_95_m"]);
        assert!(radius > off && radius > 0.05 * range && radius < 0.3 * range, "{radius} of {range}");
        let map = String::from_utf8(town.read("map.svg")).expect("UTF-8");
        assert!(map.starts_with("<svg") && map.contains("Bell Tower"), "{map}");
    }
}

#[test]
fn what_was_known_narrows_the_search_and_refuses_a_position_elsewhere() {
    let town = Town::new();
    enroll(&town, &[-20.0, 5.0], &PLACE).succeeded();
    // Another building, 3 km to the north.
    town.tower(2, "left", "mill.pgm");
    let mill = ["enroll", "--table", "t.daymark", "--name", "Mill", "--no-lint", "--at", "52.027,13", "mill.pgm"];
    town.run(&mill).succeeded();
    let frame = frame(&town, -10.0);
    let options = |near: &'static str| ["--focal-px", FOCAL, "--near", near];
    assert_eq!(recognize(&town, &frame, &["--focal-px", FOCAL])["views_compared"], 3);
    let here = recognize(&town, &frame, &options("52,13,300"));
    assert_eq!((&here["views_compared"], &here["observer"]["fix"]["method"]), (&2.into(), &"pose".into()));
    assert!(here["best"]["view"].as_u64().is_some_and(|view| view < 2), "the table's own number");
    // From there it cannot be seen.
    let elsewhere = town.run(&["recognize", "--table", "t.daymark", "--json", "--near", "52.027,13,300", &frame]);
    assert_eq!(elsewhere.code, Some(1));
    assert_eq!(elsewhere.json()["frames"][0]["views_compared"], 1);
    // Known to be 150 m off: the building could be seen from there, but not like that.
    let off = recognize(&town, &frame, &["--focal-px", FOCAL, "--near", "52.00135,13,20", "--reach", "200"]);
    assert_eq!(off["observer"]["fix"], Value::Null, "{off:#}");
    assert!(off["observer"]["lacking"][0].as_str().is_some_and(|says| says.contains("--near")), "{off:#}");
    // The camera looks north.
    let turned = recognize(&town, &frame, &["--focal-px", FOCAL, "--heading", "90"]);
    assert!(turned["observer"]["lacking"][0].as_str().is_some_and(|says| says.contains("--heading")), "{turned:#}");
    let right = recognize(&town, &frame, &["--focal-px", FOCAL, "--heading", "5"]);
    assert_eq!(right["observer"]["fix"]["method"], "pose");
}

#[test]
fn what_is_missing_is_said_and_the_answer_is_as_coarse_as_it_must_be() {
    let town = Town::new();
    enroll(&town, &[-20.0, 5.0], &PLACE).succeeded();
    let frame = frame(&town, -10.0);
    // Without a lens: the side, and an interval of distances that holds the truth.
    let seen = recognize(&town, &frame, &[]);
    let observer = &seen["observer"];
    assert_eq!(observer["lens"]["source"], "assumed");
    assert_eq!(observer["fix"]["method"], "direction", "{observer:#}");
    let exact = recognize(&town, &frame, &["--focal-px", FOCAL]);
    let range = number(&exact["observer"]["pose"]["range_m"]);
    let interval = &observer["range_interval_m"];
    assert!(number(&interval[0]) < range && range < number(&interval[1]), "{range} {interval}");

    // Without a direction: a pose in the model, and a circle on Earth that reaches as far.
    let unturned = Town::new();
    let said = enroll(&unturned, &[-20.0, 5.0], &["--at", "52,13"]).succeeded().json();
    assert_eq!(said["enrolled"][0]["missing_for_a_position"], serde_json::json!(["facing"]));
    unturned.write("frame.pgm", town.read(&frame));
    let seen = recognize(&unturned, "frame.pgm", &["--focal-px", FOCAL]);
    assert_eq!(seen["observer"]["fix"]["method"], "near_landmark");
    assert!(number(&seen["observer"]["fix"]["radius_95_m"]) >= range, "{seen:#}");
    assert!(seen["observer"]["lacking"][0].as_str().is_some_and(|says| says.contains("--facing")), "{seen:#}");

    // Without a focal length of the pictures: no model, said with what to give.
    let blind = Town::new();
    let names = shoot(&blind, 1, &[-20.0, 5.0]);
    let pictures = files(&names, "pgm");
    let mut words =
        vec!["enroll", "--table", "t.daymark", "--name", "Bell Tower", "--no-lint", "--json", "--at", "52,13"];
    words.extend(pictures.iter().map(String::as_str));
    let said = blind.run(&words).succeeded().json();
    assert_eq!(said["enrolled"][0]["model"], Value::Null);
    assert!(said["enrolled"][0]["without_model"].as_str().is_some_and(|says| says.contains("--focal-px")), "{said:#}");
    assert_eq!(said["table"]["format_version"], 1, "a table without models is what it always was");
    blind.write("frame.pgm", town.read(&frame));
    let seen = recognize(&blind, "frame.pgm", &["--focal-px", FOCAL]);
    assert_eq!(
        (&seen["observer"]["pose"], &seen["observer"]["fix"]["method"]),
        (&Value::Null, &"near_landmark".into())
    );
}

#[test]
fn a_focal_length_alone_gives_the_same_shape_and_a_height_its_scale() {
    let town = Town::new();
    let names = shoot(&town, 1, &[-24.0, -4.0, 18.0]);
    let pictures = files(&names, "pgm");
    let mut words = vec!["enroll", "--table", "t.daymark", "--name", "Bell Tower", "--no-lint", "--json"];
    words.extend(PLACE);
    words.extend(["--focal-px", FOCAL, "--height-m", "36"]);
    words.extend(pictures.iter().map(String::as_str));
    let said = town.run(&words).succeeded().json();
    let model = &said["enrolled"][0]["model"];
    assert!((number(&model["scale_error"]) - 0.02).abs() < 1e-9, "{said:#}");
    let seen = recognize(&town, &frame(&town, 8.0), &["--focal-px", FOCAL]);
    let (range, camera) = (number(&seen["observer"]["pose"]["range_m"]), before(1, 8.0).position);
    // From the camera to the middle of the tower, which is not the middle of its corners: to a tenth.
    let truth = apart([camera.x, camera.y, camera.z], [0.0, 0.0, 18.0]);
    assert!((range / truth - 1.0).abs() < 0.1, "{range} {truth}");
}

#[test]
fn watching_tells_the_position_too() {
    let town = Town::new();
    let enrolled = enroll(&town, &[-24.0, -4.0, 18.0], &PLACE).succeeded().json();
    let name = frame(&town, 8.0);
    std::fs::create_dir(town.path("frames")).expect("a folder");
    for copy in 0..15 {
        town.write(&format!("frames/{copy:02}.pgm"), town.read(&name));
    }
    let watch = ["watch", "--table", "t.daymark", "--frames", "frames", "--json", "--focal-px", FOCAL, "--speed", "0"];
    let said = town.run(&watch).succeeded();
    let answers: Vec<Value> = said
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).expect("a line of JSON"))
        .filter(|line: &Value| line["type"] == "answer")
        .collect();
    assert!(answers.len() >= 2, "{}", said.stdout);
    let truth = in_model(&enrolled, before(1, 8.0).position);
    for answer in &answers {
        let [east, north] = ground(&answer["fix"]);
        let off = apart([east, north, 0.0], [truth[0], truth[1], 0.0]);
        assert_eq!(answer["fix"]["method"], "pose");
        assert!(off < 0.01 * apart(truth, [0.0; 3]), "{off} m");
    }
    // Many frames average the noise, never what lens and map are wrong by.
    let radius = |answer: &Value| number(&answer["fix"]["radius_95_m"]);
    assert!(radius(&answers[1]) > 0.9 * radius(&answers[0]), "{answers:#?}");
}

#[test]
fn the_table_is_the_same_for_any_number_of_threads_and_keeps_its_models() {
    let town = Town::new();
    enroll(&town, &[-20.0, 5.0], &["--jobs", "1", "--at", "52,13", "--facing", "180"]).succeeded();
    let other = Town::new();
    enroll(&other, &[-20.0, 5.0], &["--jobs", "3", "--at", "52,13", "--facing", "180"]).succeeded();
    assert!(town.read("t.daymark") == other.read("t.daymark"), "another number of threads, another table");

    town.run(&["table", "merge", "m.daymark", "t.daymark"]).succeeded();
    assert!(town.read("t.daymark") == town.read("m.daymark"), "copied as it was");
    town.run(&["table", "verify", "t.daymark"]).succeeded();
    // The dense cloud is made again from what the table stores.
    let model = ["table", "model", "t.daymark", "Bell Tower", "-o", "tower.ply", "--levels", "2", "--json"];
    let said = town.run(&model).succeeded().json();
    let (stored, points) = (number(&said["points_stored"]), number(&said["points"]));
    assert!(points > 5.0 * stored && number(&said["triangles"]) > 16.0 * 0.5 * stored, "{said:#}");
    assert!(town.read("tower.ply").starts_with(b"ply\n"));
    // Pictures of one place in the place of the others: no model any more.
    town.run(&["enroll", "--table", "t.daymark", "--name", "Bell Tower", "--no-lint", "--replace", "t1-1.pgm"])
        .succeeded();
    let listed = town.run(&["table", "list", "--json", "t.daymark"]).succeeded().json();
    assert_eq!(listed["table"]["format_version"], 1);
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    let town = Town::new();
    for (options, says) in [
        (&["--facing", "400"][..], "azimuth of 400"),
        (&["--height-m=-3"][..], "-3 m is no height"),
        (&["--facing", "10", "--facing-error", "200"][..], "uncertain by 200"),
        (&["--height-m", "3", "--distance-m", "4"][..], "cannot be used with"),
    ] {
        let refused = enroll(&town, &[-20.0, 5.0], options);
        assert_eq!(refused.code, Some(2), "{refused:#?}");
        assert!(refused.stderr.contains(says), "{refused:#?}");
        assert!(!town.names().contains(&"t.daymark".to_owned()));
    }
}
