//! `daymark calibrate`: boards through known lenses give these lenses back, and what tells nothing is refused.

mod support;
#[path = "support/board.rs"]
mod board;

use board::{Shot, Studio, stand};
use daymark::calibrate::board::Board;
use daymark::camera_file::distortion::Distortion;
use daymark::camera_file::lens::Lens;
use daymark::picture::GrayImage;
use support::Town;

const BOARD: Board = Board { columns: 9, rows: 6, square_mm: 25.0 };

/// Barrel distortion as a webcam has it, and a principal point beside the middle.
fn lens() -> Lens {
    Lens {
        focal: [612.0, 609.0],
        centre: [327.5, 233.25],
        distortion: Distortion::Radial { radial: [-0.24, 0.09, 0.0, 0.0, 0.0, 0.0], tangential: [0.0012, -0.0009] },
        ..Lens::of_focal(640, 480, 600.0)
    }
}

/// Tilts about both axes, near and far, all over the frame; whole boards.
const WHOLE: [([f64; 3], [f64; 3]); 12] = [
    ([0.0, 0.0, 0.0], [0.0, 0.0, 330.0]),
    ([0.5, 0.0, 0.1], [0.0, 5.0, 330.0]),
    ([-0.5, 0.0, -0.1], [0.0, -5.0, 340.0]),
    ([0.0, 0.6, 0.0], [10.0, 0.0, 340.0]),
    ([0.0, -0.6, 0.0], [-10.0, 0.0, 340.0]),
    ([0.4, 0.4, 0.3], [40.0, 20.0, 400.0]),
    ([-0.4, 0.4, -0.3], [-60.0, 30.0, 430.0]),
    ([0.4, -0.4, 3.0], [60.0, -35.0, 430.0]),
    ([-0.3, -0.5, 1.5], [-70.0, -20.0, 480.0]),
    ([0.2, 0.1, -1.4], [80.0, 10.0, 480.0]),
    ([0.3, -0.2, 0.0], [-70.0, 60.0, 480.0]),
    ([-0.5, 0.3, 0.7], [75.0, 60.0, 520.0]),
];

fn save(town: &Town, name: &str, picture: &GrayImage) {
    let (width, height) = (picture.width as u32, picture.height as u32);
    town.draw(name, width, height, |x, y| picture.pixels[y as usize * picture.width + x as usize]);
}

fn shot(stands: ([f64; 3], [f64; 3]), towers: bool, number: usize) -> Shot {
    Shot { pose: stand(&BOARD, stands.0, stands.1), towers, noise: 3.0, blur: 1, seed: 40 + number as u64 }
}

/// Pictures 00.pgm, 01.pgm ... and their names.
fn shoot(town: &Town, studio: &Studio, shots: &[Shot]) -> Vec<String> {
    shots
        .iter()
        .enumerate()
        .map(|(number, shot)| {
            let name = format!("{number:02}.pgm");
            save(town, &name, &studio.picture(shot));
            name
        })
        .collect()
}

fn whole(town: &Town, count: usize) -> Vec<String> {
    let shots: Vec<Shot> = WHOLE.iter().take(count).enumerate().map(|(n, at)| shot(*at, false, n)).collect();
    shoot(town, &Studio::new(lens(), BOARD), &shots)
}

fn calibrate(town: &Town, pictures: &[String], more: &[&str]) -> support::Ran {
    let mut arguments = vec!["calibrate"];
    arguments.extend(pictures.iter().map(String::as_str));
    arguments.extend(more);
    town.run(&arguments)
}

/// Every parameter within 3.5 of its deviations, and the focal length within 0.3 %.
#[track_caller]
fn meets_truth(document: &serde_json::Value) {
    let Lens { focal, centre, distortion, .. } = lens();
    let Distortion::Radial { radial, tangential } = distortion else { panic!("radial") };
    let truth = [focal[0], focal[1], centre[0], centre[1], radial[0], radial[1], tangential[0], tangential[1]];
    let parameters = document["lens"]["parameters"].as_array().expect("parameters");
    for (parameter, truth) in parameters.iter().zip(truth) {
        let number = |key: &str| parameter[key].as_f64().expect("a number");
        let off = (number("value") - truth).abs();
        assert!(off < 3.5 * number("standard_deviation"), "{truth}: {parameter} in {document:#}");
    }
    for (parameter, truth) in parameters.iter().zip(focal) {
        let off = (parameter["value"].as_f64().expect("a number") - truth).abs() / truth;
        assert!(off < 0.003, "{off} of {document:#}");
    }
}

#[test]
fn a_plain_chessboard_gives_the_lens_and_files_that_others_read() {
    let town = Town::new();
    let pictures = whole(&town, 12);
    let ran =
        calibrate(&town, &pictures, &["-o", "camera.yaml", "--ros", "ros.yaml", "--report", "page.html", "--json"]);
    let document = ran.succeeded().json();
    meets_truth(&document);
    assert!(document["lens"]["rms_px"].as_f64().expect("a number") < 0.15, "{document:#}");
    let used =
        document["pictures"].as_array().expect("pictures").iter().filter(|picture| picture["used"] == true).count();
    assert_eq!(used, 12);

    let value = |place: usize| document["lens"]["parameters"][place]["value"].as_f64().expect("a number");
    for file in ["camera.yaml", "ros.yaml"] {
        let read = daymark::camera_file::cameras(&town.path(file)).expect("a lens");
        assert_eq!((read[0].focal, read[0].centre), ([value(0), value(1)], [value(2), value(3)]), "{file}");
        assert_eq!(read[0].size, Some([640, 480]));
        let radial = [value(4), value(5), value(8), 0.0, 0.0, 0.0];
        assert_eq!(read[0].distortion, Distortion::Radial { radial, tangential: [value(6), value(7)] });
        assert_eq!(read[0].focal_error, document["lens"]["focal_length_relative_error"].as_f64());
    }
    assert!(String::from_utf8(town.read("page.html")).expect("text").contains("<circle"));
    // For people.
    let ran = calibrate(&town, &pictures, &[]).succeeded();
    assert!(ran.stdout.contains("fx") && ran.stdout.contains("field of view"), "{ran:#?}");
}

#[test]
fn large_pictures_give_the_same_lens_in_their_pixels() {
    let town = Town::new();
    let studio = Studio::new(lens(), BOARD);
    let pictures: Vec<String> = (0..6)
        .map(|number| {
            let small = studio.picture(&shot(WHOLE[number], false, number));
            let name = format!("{number}.pgm");
            save(&town, &name, &small.scaled_to(2560));
            name
        })
        .collect();
    let document = calibrate(&town, &pictures, &["--json"]).succeeded().json();
    let found = document["lens"]["parameters"][0]["value"].as_f64().expect("a number");
    assert!((found / (4.0 * lens().focal[0]) - 1.0).abs() < 0.003, "{document:#}");
}

#[test]
fn the_threads_change_nothing() {
    let town = Town::new();
    let pictures = whole(&town, 5);
    let run = |threads: &str| {
        let mut command = town.command();
        command.arg("calibrate").args(&pictures).arg("--json").env("RAYON_NUM_THREADS", threads);
        support::Ran::of(command.output()).succeeded().stdout
    };
    assert_eq!(run("1"), run("2"));
}

#[test]
fn towers_let_a_part_of_the_board_be_enough() {
    let town = Town::new();
    // Near, so that the board goes beyond the frame on all sides.
    let near: Vec<Shot> = WHOLE
        .iter()
        .enumerate()
        .map(|(number, (turn, [x, y, far]))| {
            let mut shot = shot((*turn, [1.6 * x, 1.6 * y, 0.62 * far]), true, number);
            shot.blur = 2;
            shot
        })
        .collect();
    let pictures = shoot(&town, &Studio::new(lens(), BOARD), &near);
    let document = calibrate(&town, &pictures, &["--json"]).succeeded().json();
    meets_truth(&document);
    let rows = document["pictures"].as_array().expect("pictures");
    let cut = rows.iter().filter(|row| row["by_towers"] == true && row["corners"].as_u64() < Some(54)).count();
    assert!(cut >= 8, "{document:#}");
    assert!(document["lens"]["coverage"]["largest_radius_share"].as_f64() > Some(0.9), "{document:#}");
}

#[test]
fn a_picture_of_another_focus_is_set_aside() {
    let town = Town::new();
    let mut pictures = whole(&town, 8);
    let other = Lens { focal: [500.0, 498.0], ..lens() };
    save(&town, "zoomed.pgm", &Studio::new(other, BOARD).picture(&shot(WHOLE[5], false, 5)));
    pictures.push("zoomed.pgm".to_owned());
    let document = calibrate(&town, &pictures, &["--json"]).succeeded().json();
    meets_truth(&document);
    let zoomed = &document["pictures"][8];
    assert_eq!(zoomed["used"], false, "{zoomed}");
    assert!(zoomed["reason"].as_str().expect("a reason").contains("another focus"), "{zoomed}");
}

/// Exit 1, nothing written, and a reason that says each of these.
#[track_caller]
fn no_lens(town: &Town, pictures: &[String], more: &[&str], code: &str, expected: &[&str]) {
    let more = [more, &["-o", "camera.yaml", "--json"]].concat();
    let ran = calibrate(town, pictures, &more);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert_eq!(ran.json()["reason"]["code"], code, "{ran:#?}");
    for expected in expected {
        assert!(ran.stdout.contains(expected), "lacks {expected:?}: {ran:#?}");
    }
    assert!(!town.path("camera.yaml").exists());
}

#[test]
fn too_little_is_refused_with_its_number() {
    let town = Town::new();
    let pictures = whole(&town, 4);
    no_lens(&town, &pictures[..1], &[], "too_few_pictures", &["in 1 of 1 pictures"]);
    no_lens(&town, &pictures[..2], &[], "too_few_pictures", &["in 2 of 2 pictures"]);
    let wrong = ["the board in it has 9 x 6 inner corners", "in 0 of 4 pictures"];
    no_lens(&town, &pictures, &["--board", "8x6"], "too_few_pictures", &wrong);
    no_lens(&town, &pictures, &["--board", "8x5"], "too_few_pictures", &wrong);
    no_lens(&town, &pictures, &["--board", "10x7"], "too_few_pictures", &["only 54 corners of the board are seen"]);
    town.tower(1, "left", "tower.pgm");
    no_lens(&town, &["tower.pgm".to_owned()], &[], "too_few_pictures", &["there is no chessboard in it"]);
}

#[test]
fn parallel_boards_are_refused_with_their_tilt() {
    let town = Town::new();
    let flat = [[0.0, 0.0, 330.0], [30.0, 10.0, 380.0], [-40.0, -20.0, 450.0], [10.0, 20.0, 520.0]];
    let shots: Vec<Shot> = flat.iter().enumerate().map(|(n, at)| shot(([0.02, -0.01, 0.0], *at), false, n)).collect();
    let pictures = shoot(&town, &Studio::new(lens(), BOARD), &shots);
    no_lens(
        &town,
        &pictures,
        &[],
        "parallel",
        &["no board is tilted by more than", "tilt the board by 20 to 45 degrees"],
    );
}

#[test]
fn boards_tilted_one_way_only_are_advised_or_refused() {
    let town = Town::new();
    let shots: Vec<Shot> =
        (0..3).map(|n| shot(([0.17, 0.0, 0.0], [0.0, 0.0, 600.0 + 30.0 * n as f64]), false, n)).collect();
    let pictures = shoot(&town, &Studio::new(lens(), BOARD), &shots);
    no_lens(&town, &pictures, &[], "uncertain", &["the focal length is open", "the largest tilt is"]);
}

#[test]
fn a_mirrored_picture_is_told_by_its_towers() {
    let town = Town::new();
    let studio = Studio::new(lens(), BOARD);
    let pictures: Vec<String> = (0..3)
        .map(|number| {
            let mut picture = studio.picture(&shot(WHOLE[number], true, number));
            picture.pixels.chunks_exact_mut(picture.width).for_each(<[u8]>::reverse);
            let name = format!("{number}.pgm");
            save(&town, &name, &picture);
            name
        })
        .collect();
    no_lens(&town, &pictures, &[], "too_few_pictures", &["the picture is mirrored"]);
}

#[test]
fn what_cannot_be_used_is_an_error_and_nothing_is_written() {
    let town = Town::new();
    let mut pictures = whole(&town, 3);
    let ran = calibrate(&town, &pictures, &["-o", "no/such/camera.yaml"]);
    ran.refused(&["cannot write no/such/camera.yaml", "make the folder first"]);
    let ran = calibrate(&town, &pictures, &["-o", "same.yaml", "--ros", "same.yaml"]);
    ran.refused(&["-o and --ros name the same file"]);
    calibrate(&town, &pictures, &["--board", "2x9"]).refused_by_the_parser("write inner corners as in 9x6");
    calibrate(&town, &pictures, &["--square-mm", "0"]).refused_by_the_parser("in millimetres");
    calibrate(&town, &pictures, &["--camera-name", "a: b"]).refused_by_the_parser("letters, digits");
    town.draw("small.pgm", 320, 240, |x, _| x as u8);
    pictures.push("small.pgm".to_owned());
    calibrate(&town, &pictures, &[]).refused(&["small.pgm has 320 x 240 pixels", "00.pgm has 640 x 480"]);
    calibrate(&town, &["gone.pgm".to_owned()], &[]).refused(&["gone.pgm"]);
    town.run(&["calibrate"]).refused_by_the_parser("<PICTURES>");
}

#[test]
fn the_board_can_be_printed_and_is_found_again() {
    let town = Town::new();
    let ran =
        town.run(&["calibrate", "--print-pattern", "board.svg", "--board", "7x5", "--square-mm", "30"]).succeeded();
    assert!(ran.stdout.contains("7 x 5 inner corners"), "{ran:#?}");
    assert!(String::from_utf8(town.read("board.svg")).expect("text").contains("mm if printed at full size"));
    town.run(&["calibrate", "--print-pattern", "board.png"]).succeeded();
    let ran = town.run(&["calibrate", "board.png", "--json"]);
    assert_eq!((ran.code, ran.json()["pictures"][0]["corners"].as_u64()), (Some(1), Some(54)), "{ran:#?}");
    town.run(&["calibrate", "--print-pattern", "board.bmp"]).refused(&["as .svg (to print) or .png"]);
}
