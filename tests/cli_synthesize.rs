//! `daymark synthesize` as a person runs it: models of the fixtures' towers, and input that cannot work.

#[path = "support/shoot.rs"]
mod shoot;
#[path = "support/mod.rs"]
mod support;

use daymark_fixtures::{Camera, Lens, Scene, Site, Tower, Vec3, View, view};
use shoot::{files, shoot, shoot_with};
use support::Town;

/// `daymark synthesize` with these pictures and options.
fn synthesize(town: &Town, pictures: &[String], options: &[&str]) -> support::Ran {
    let mut all = vec!["synthesize"];
    all.extend(pictures.iter().map(String::as_str));
    all.extend(options);
    town.run(&all)
}

#[test]
fn picked_corners_and_known_cameras_give_the_tower() {
    let town = Town::new();
    let names = shoot(&town, 1, &[-8.0, 22.0]);
    let (pictures, cameras, corners) = (files(&names, "pgm"), files(&names, "camera"), files(&names, "csv"));
    let mut options = vec!["-o", "tower.ply", "--levels", "2", "--json", "--cameras"];
    options.extend(cameras.iter().map(String::as_str));
    options.push("--corners");
    options.extend(corners.iter().map(String::as_str));
    let facts = synthesize(&town, &pictures, &options).succeeded().json();
    assert_eq!(facts["length_unit"], "camera_file_unit");
    assert!(facts["reprojection_rms_px"].as_f64().unwrap() < 1e-3, "{facts:#}");
    // The Bell Tower is 36 m high and 14 m wide.
    let height = facts["extent"][2].as_f64().unwrap();
    assert!((35.5..=36.01).contains(&height), "{facts:#}");
    assert!(facts["triangles"].as_u64().unwrap() > 60, "{facts:#}");
    // Every vertex is a corner of the tower, to a tenth of a millimetre.
    let ply = town.read("tower.ply");
    let start = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let truth: Vec<Vec3> = Tower::eight()[0].corners().iter().map(|corner| corner.model).collect();
    for vertex in ply[start..].chunks(19).take(facts["points"].as_u64().unwrap() as usize) {
        let c = |at: usize| f64::from(f32::from_le_bytes(vertex[at..at + 4].try_into().unwrap()));
        let point = Vec3::new(c(0), c(4), c(8));
        let off = truth.iter().map(|&corner| (corner - point).length()).fold(f64::INFINITY, f64::min);
        assert!(off < 1e-4, "{point:?} is {off} m from any corner");
    }
}

#[test]
fn found_corners_give_the_same_model_with_any_number_of_threads() {
    let town = Town::new();
    let names = shoot(&town, 2, &[-8.0, 10.0]);
    let (pictures, cameras) = (files(&names, "pgm"), files(&names, "camera"));
    let mut files = Vec::new();
    for threads in ["1", "3"] {
        let mut command = town.command();
        command.env("RAYON_NUM_THREADS", threads).arg("synthesize").args(&pictures).arg("--cameras").args(&cameras);
        let ran = support::Ran::of(command.args(["-o", "tower.glb", "--explain"]).output()).succeeded();
        assert!(ran.stdout.contains("off the epipolar line"), "{ran:#?}");
        // Each with its views, pixels and reason.
        let told = ran.stdout.lines().filter(|line| line.starts_with("    1 (") && line.contains("  2 (")).count();
        assert!(told > 10, "{ran:#?}");
        files.push(town.read("tower.glb"));
    }
    assert!(files[0] == files[1], "another number of threads, another model");
    let glb = &files[0];
    assert_eq!(&glb[..4], b"glTF");
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((word(4), word(8)), (2, glb.len()));
    let text = &glb[20..20 + word(12)];
    let document: serde_json::Value = serde_json::from_slice(text).expect("JSON");
    assert_eq!(document["images"].as_array().unwrap().len(), 2, "one texture for each view");
    assert_eq!(document["buffers"][0]["byteLength"], glb.len() - 28 - word(12));
}

#[test]
fn a_focal_length_is_enough_for_motion_and_shape() {
    let town = Town::new();
    let names = shoot(&town, 8, &[-20.0, -6.0, 8.0]);
    let pictures = files(&names, "pgm");
    let options = ["--focal-px", "560", "--fixed-lens", "-o", "tower.obj", "--json", "--distance-m"];
    // The first two stand 14 degrees apart on a circle.
    let radius = Tower::eight()[7].height() * 1.06 + 10.0;
    let apart = format!("{}", 2.0 * radius * libm::sin(7.0_f64.to_radians()));
    let facts = synthesize(&town, &pictures, &[&options[..], &[&apart]].concat()).succeeded().json();
    assert_eq!(facts["length_unit"], "metre");
    assert!(facts["reprojection_rms_px"].as_f64().unwrap() < 1.0, "{facts:#}");
    let at = |view: usize| -> Vec3 {
        let c = |axis: usize| facts["views"][view]["position"][axis].as_f64().expect("joined");
        Vec3::new(c(0), c(1), c(2))
    };
    let (first, last) = ((at(1) - at(0)).length(), (at(2) - at(1)).length());
    assert!((last / first - 1.0).abs() < 0.05, "the steps are equal: {first} {last}");
    assert!(town.names().iter().any(|name| name == "tower-view-1.jpg"), "{:?}", town.names());
    assert!(town.read("tower.mtl").starts_with(b"newmtl"));
}

#[test]
fn what_cannot_work_is_refused_with_its_figure_and_without_a_file() {
    let town = Town::new();
    let names = shoot(&town, 3, &[-8.0, 22.0]);
    let pictures = files(&names, "pgm");
    let before = town.names();
    synthesize(&town, &pictures[..1], &["-o", "m.glb"]).refused(&["one picture has no depth"]);
    synthesize(&town, &pictures, &["-o", "m.stl"]).refused(&["m.stl should end in .glb"]);
    synthesize(&town, &pictures, &["-o", "m.glb", "--cameras", "t3-1.camera"]).refused(&["2 pictures, 1 files"]);
    synthesize(&town, &pictures, &["-o", "m.glb", "--cameras", "missing.camera", "t3-2.camera"])
        .refused(&["missing.camera"]);
    assert_eq!(town.names(), before, "no file was written");
}

#[test]
fn cameras_of_other_pictures_do_not_fit() {
    let town = Town::new();
    let names = shoot(&town, 4, &[-20.0, 0.0]);
    let pictures = files(&names, "pgm");
    // The two cameras exchanged: no look-alikes agree.
    let ran = synthesize(&town, &pictures, &["-o", "m.glb", "--cameras", "t4-2.camera", "t4-1.camera"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert!(ran.stderr.contains("the cameras are not those of these pictures"), "{ran:#?}");
    // Of another size.
    let camera = String::from_utf8(town.read("t4-1.camera")).unwrap().replace("640 480", "640 640");
    town.write("t4-1.camera", camera);
    synthesize(&town, &pictures, &["-o", "m.glb", "--cameras", "t4-1.camera", "t4-2.camera"])
        .refused(&["640 x 640", "640 x 480"]);
    assert!(!town.names().iter().any(|name| name == "m.glb"));
}

#[test]
fn two_buildings_a_turn_and_a_plane_have_no_model() {
    let town = Town::new();
    let refused = |pictures: &[String], expected: &str| {
        let ran = synthesize(&town, pictures, &["-o", "m.glb", "--focal-px", "560", "--fixed-lens"]);
        assert_eq!(ran.code, Some(1), "{ran:#?}");
        assert!(ran.stderr.contains(expected), "lacks {expected:?}: {ran:#?}");
        assert!(!town.names().iter().any(|name| name == "m.glb"));
    };
    let (one, other) = (shoot(&town, 1, &[7.0]), shoot(&town, 6, &[7.0]));
    refused(&[files(&one, "pgm"), files(&other, "pgm")].concat(), "no two pictures share one geometry: of");

    let tower = Tower::eight()[1].clone();
    let stand = Camera::before(Site::ORIGIN, view::stand(&tower, 10.0), Lens::VGA);
    let scene = Scene::alone(tower.clone(), 3);
    let turned = Camera::look_at(stand.position, Vec3::new(5.0, 0.0, 14.0), Lens::VGA);
    let turn = shoot_with(&town, "turn", &scene, &[stand, turned]);
    refused(&files(&turn, "pgm"), "the camera only turned: a rotation alone explains");

    // Close to a wall there is nothing but the wall.
    let wall = |x: f64, z: f64| {
        Camera::look_at(Vec3::new(x, -19.0, z), Vec3::new(x * 0.3, -7.0, 9.5), Lens { focal: 900.0, ..Lens::VGA })
    };
    let scene = View::enrollment(&tower, Lens::VGA)[0].scene.clone();
    let plane = shoot_with(&town, "plane", &scene, &[wall(-3.0, 9.0), wall(3.0, 10.0)]);
    let ran = synthesize(&town, &files(&plane, "pgm"), &["-o", "m.glb", "--focal-px", "900", "--fixed-lens"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    // The motion that a plane leaves in doubt may have hardly any parallax: either figure refuses it.
    let said = ["lies in one plane", "taken from nearly one place"].iter().any(|reason| ran.stderr.contains(reason));
    assert!(said, "{ran:#?}");
}

#[test]
fn without_any_focal_length_the_model_says_what_it_is() {
    let town = Town::new();
    let names = shoot(&town, 7, &[-8.0, 8.0]);
    let corners = files(&names, "csv");
    let mut options = vec!["-o", "m.ply", "--json", "--corners"];
    options.extend(corners.iter().map(String::as_str));
    let facts = synthesize(&town, &files(&names, "pgm"), &options).succeeded().json();
    assert_eq!((&facts["shape"], &facts["length_unit"]), (&"affine".into(), &"affine".into()));
}
