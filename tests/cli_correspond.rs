//! `daymark correspond` from the outside: committed corners, made corners, broken files.

mod support;

use std::fmt::Write as _;
use std::fs;

use serde_json::Value;
use support::{Ran, Town, fixture, speckle};

const FIRST: &str = "tower-1-corners-30.csv";
const SECOND: &str = "tower-1-corners-40.csv";

/// The thesis' rule is integers and areas only: its answer is the same everywhere, for good.
const PLAIN: &str = "\
one.csv: 47 corners in 5 layers (10, 10, 12, 10, 5)
two.csv: 51 corners in 6 layers (10, 12, 8, 10, 6, 5)
22 correspondences by the plain rule: 6 quads of the layers agree; nothing is verified
of 47 numbers in both files 6 are matched rightly; 16 matches are wrong

   first  second      layers  shift  found by        residual
      15    1010       0 → 0     +3  layers                 -
      27    1054       0 → 0     +3  layers                 -
      37    1058       0 → 0     +3  layers                 -
      42    1214       1 → 1     +9  layers                 -
      43      43       3 → 3     +9  layers                 -
    1009    1206       1 → 1     +9  layers                 -
    1011    1045       4 → 4     +2  layers                 -
    1012    1012       3 → 3     +9  layers                 -
    1037    1060       2 → 2     +5  layers                 -
    1038    1049       2 → 2     +5  layers                 -
    1045    1243       2 → 2     +5  layers                 -
    1046    1037       2 → 2     +5  layers                 -
    1051    1051       3 → 3     +9  layers                 -
    1052    1029       4 → 4     +2  layers                 -
    1058      39       0 → 0     +3  layers                 -
    1061    1077       4 → 4     +2  layers                 -
    1065    1011       4 → 4     +2  layers                 -
    1066    1066       3 → 3     +9  layers                 -
    1082    1082       2 → 2     +5  layers                 -
    1093    1093       2 → 2     +5  layers                 -
    1193    1094       1 → 1     +9  layers                 -
    1197    1059       1 → 1     +9  layers                 -

quads of the first picture's layers: 47
     6 matched
    41 refused: no quad of the other picture has its area ratios
";

/// A folder with the two committed views, ten degrees apart.
fn town() -> Town {
    let town = Town::new();
    for (file, name) in [(FIRST, "one.csv"), (SECOND, "two.csv")] {
        fs::copy(fixture(file), town.path(name)).expect("a fixture");
    }
    town
}

fn correspond(town: &Town, arguments: &[&str]) -> Ran {
    town.run(&[&["correspond"], arguments].concat())
}

/// The rows of a committed file: number, x, y.
fn rows(file: &str) -> Vec<(u32, f64, f64)> {
    let text = fs::read_to_string(fixture(file)).expect("a fixture");
    let row = |line: &str| {
        let mut fields = line.split(',');
        let mut next = || fields.next().expect("a field");
        (next().parse().expect("a number"), next().parse().expect("x"), next().parse().expect("y"))
    };
    text.lines().filter(|line| !line.starts_with(['#', 'n'])).map(row).collect()
}

fn csv(rows: impl IntoIterator<Item = (u32, f64, f64)>) -> String {
    let mut text = "number,x_px,y_px\n".to_owned();
    for (number, x, y) in rows {
        writeln!(text, "{number},{x},{y}").expect("text");
    }
    text
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("{key}: {value}"))
}

#[test]
fn the_plain_rule_gives_these_matches() {
    let found = correspond(&town(), &["--corners", "one.csv", "two.csv", "--plain", "--check-numbers"]).succeeded();
    assert_eq!(found.stdout.lines().count(), PLAIN.lines().count());
    for (found, expected) in found.stdout.lines().zip(PLAIN.lines()) {
        assert_eq!(found, expected);
    }
}

#[test]
fn two_views_of_a_tower_are_matched_without_a_false_match() {
    let ran = correspond(&town(), &["--corners", "one.csv", "two.csv", "--check-numbers", "--json"]).succeeded();
    let found = ran.json();
    let correspondences = list(&found, "correspondences");
    assert!(correspondences.len() >= 38, "{} of 47", correspondences.len());
    assert_eq!(found["schema_version"], 1);
    assert_eq!(found["checked"]["common"], 47);
    assert_eq!((&found["checked"]["right"], &found["checked"]["wrong"]), (&correspondences.len().into(), &0.into()));
    for one in correspondences {
        assert_eq!(one["first"], one["second"], "{one}");
        assert!(one["residual_px"].as_f64().is_some_and(|px| px < 6.0), "{one}");
        for side in 0..2 {
            let number = &one[["first", "second"][side]];
            let layers = list(&found["pictures"][side], "layers");
            let layer = layers.iter().position(|layer| layer.as_array().is_some_and(|layer| layer.contains(number)));
            assert_eq!(one["layers"][side], Value::from(layer), "{one}");
        }
        let by_layers = one["found_by"] == "layers" || one["found_by"] == "both";
        assert_eq!(one["shift"].is_u64(), by_layers, "{one}");
    }
    let quads = found["layer_quads"].as_object().expect("counts");
    assert_eq!(quads.values().filter_map(Value::as_u64).sum::<u64>(), 47);
}

#[test]
fn an_affine_image_is_matched_whole_and_its_map_is_told() {
    let town = town();
    let [[a, b, c], [d, e, f]] = [[0.9, 0.25, 40.0], [-0.2, 1.1, 90.0]];
    let moved = rows(FIRST).into_iter().map(|(number, x, y)| (number, a * x + b * y + c, d * x + e * y + f));
    town.write("moved.csv", csv(moved));
    let arguments = ["--corners", "one.csv", "moved.csv", "--check-numbers", "--json", "--noise-px", "0.1"];
    let found = correspond(&town, &arguments).succeeded().json();
    assert_eq!(
        (&found["answer"], &found["checked"]["right"], &found["checked"]["wrong"]),
        (&"map".into(), &47.into(), &0.into())
    );
    let rows = list(&found["map"], "second_from_first_px");
    for (row, expected) in rows.iter().zip([[a, b, c], [d, e, f]]) {
        for ((value, expected), most) in row.as_array().expect("a row").iter().zip(expected).zip([1e-3, 1e-3, 0.2]) {
            assert!((value.as_f64().expect("a number") - expected).abs() < most, "{rows:?}");
        }
    }
}

/// Corners without any symmetry. The mirror image of a building that is its own mirror image is no contradiction.
fn scattered() -> Vec<(u32, f64, f64)> {
    let place = |number: u32, axis| {
        f64::from(u16::from(speckle(number, axis, 1)) * 2 + u16::from(speckle(number, axis, 2) & 1))
    };
    (0..47).map(|number| (number, place(number, 0), place(number, 1))).collect()
}

#[test]
fn a_mirror_image_is_no_answer() {
    let town = Town::new();
    town.write("one.csv", csv(scattered()));
    town.write("turned.csv", csv(scattered().into_iter().map(|(number, x, y)| (number, 640.0 - x, 640.0 - y))));
    town.write("mirror.csv", csv(scattered().into_iter().map(|(number, x, y)| (number, 640.0 - x, y))));
    let arguments = |file| ["--corners", "one.csv", file, "--check-numbers", "--json"];
    let turned = correspond(&town, &arguments("turned.csv")).succeeded().json();
    assert_eq!(turned["checked"], serde_json::json!({ "common": 47, "right": 47, "wrong": 0 }));
    let ran = correspond(&town, &arguments("mirror.csv"));
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    let found = ran.json();
    assert_eq!((&found["answer"], list(&found, "correspondences").len()), (&"none".into(), 0));
    let ran = correspond(&town, &["--corners", "one.csv", "mirror.csv"]);
    assert_eq!(ran.code, Some(1));
    let message = found["reason"]["message"].as_str().expect("a reason");
    assert!(ran.stdout.contains(&format!("no correspondence: {message}")), "{ran:#?}");
}

#[test]
fn too_few_corners_are_no_answer_with_a_reason() {
    let town = town();
    town.write("few.csv", csv(rows(FIRST).into_iter().take(4)));
    for rule in [&[][..], &["--plain"]] {
        let ran = correspond(&town, &[&["--corners", "few.csv", "few.csv"], rule].concat());
        assert!(ran.code.is_some_and(|code| code < 2), "{ran:#?}");
    }
    let ran = correspond(&town, &["--corners", "few.csv", "two.csv"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert!(ran.stdout.contains("4 corners are too few"), "{ran:#?}");
}

#[test]
fn json_and_csv_are_the_same_to_it() {
    let town = town();
    let corners: Vec<Value> = rows(SECOND)
        .into_iter()
        .map(|(number, x, y)| serde_json::json!({ "number": number, "x_px": x, "y_px": y }))
        .collect();
    town.write("two.json", serde_json::json!({ "corners": corners }).to_string());
    let csv = correspond(&town, &["--corners", "one.csv", "two.csv"]).succeeded();
    let json = correspond(&town, &["--corners", "one.csv", "two.json"]).succeeded();
    assert_eq!(csv.stdout, json.stdout.replace("two.json", "two.csv"));
}

#[test]
fn what_is_wrong_with_a_file_is_told_with_its_line() {
    let town = town();
    let many = csv((0..513).map(|number| (number, f64::from(number), 1.0)));
    let cases: [(&str, &[&str]); 6] = [
        ("number,x_px\n1,2\n", &["line 1", "the column y_px is missing", "number, x_px, y_px"]),
        ("number,x_px,y_px\n1,2,3\n2,NaN,4\n", &["line 3", "x_px is \"NaN\""]),
        ("number,x_px,y_px\n1,2,3\n1,5,4\n", &["line 3", "number 1 is taken already, by line 2"]),
        ("number,x_px,y_px\n1,2\n", &["line 2", "2 columns"]),
        ("", &["is empty"]),
        (&many, &["513 corners", "at most 512"]),
    ];
    for (text, expected) in cases {
        town.write("bad.csv", text);
        let ran = correspond(&town, &["--corners", "one.csv", "bad.csv"]);
        ran.refused(&[&["bad.csv: "], expected].concat());
    }
    correspond(&town, &["--corners", "one.csv", "none.csv"]).refused(&["none.csv: ", "give a file of corners"]);
    correspond(&town, &["one.pgm"]).refused(&["<B>"]);
    correspond(&town, &["--corners", "one.csv", "two.csv", "--svg", "no/out.svg"]).refused(&["no/out.svg", "folder"]);
}

#[test]
fn automatic_corners_are_told_in_pixels_of_the_file() {
    let town = town();
    town.tower(1, "left", "one.pgm");
    town.tower(3, "right", "three.pgm");
    let found = correspond(&town, &["one.pgm", "one.pgm", "--corners-per-image", "80", "--json"]).succeeded().json();
    let correspondences = list(&found, "correspondences");
    assert!(correspondences.len() >= 70, "{}", correspondences.len());
    for one in correspondences {
        assert_eq!((&one["first"], &one["first_px"]), (&one["second"], &one["second_px"]), "{one}");
        assert!(one["first_px"][0].as_f64().is_some_and(|x| x < 320.0), "{one}");
        assert!(one["first_px"][1].as_f64().is_some_and(|y| y < 240.0), "{one}");
    }
    assert_eq!(found["pictures"][0]["file_px_per_px"], 0.5);
    let ran = correspond(&town, &["one.pgm", "three.pgm", "--corners-per-image", "80"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
}

#[test]
fn the_drawing_holds_what_is_told() {
    let town = town();
    town.tower(1, "left", "one.pgm");
    let arguments = ["--corners", "one.csv", "two.csv", "--svg", "out.svg", "--json"];
    let found = correspond(&town, &arguments).succeeded().json();
    let drawing = String::from_utf8(town.read("out.svg")).expect("UTF-8");
    let count = |what: &str| drawing.matches(what).count();
    assert_eq!(count("class=\"match\""), list(&found, "correspondences").len());
    assert_eq!(count("class=\"layer\""), 5 + 6);
    let quads = found["layer_quads"].as_object().expect("counts");
    assert!(count("class=\"quad\"") >= 47);
    for (_, number) in quads {
        assert!(drawing.contains(&format!("{number} ")), "{number}");
    }
    let with_pictures = [&["one.pgm", "one.pgm"], &arguments[..]].concat();
    correspond(&town, &with_pictures).succeeded();
    assert!(String::from_utf8(town.read("out.svg")).expect("UTF-8").contains("data:image/jpeg;base64,"));
}
