//! `daymark enroll` and `daymark table` as people and programs meet them.

mod support;

use std::io::Cursor;

use exif::experimental::Writer;
use exif::{Field, In, Rational, Tag, Value as ExifValue};
use image::ImageFormat;
use serde_json::{Value, json};
use support::{Town, fixture, speckle};

const ENROLL: [&str; 3] = ["enroll", "--table", "town.daymark"];

/// The keys of an object, sorted: programs rely on them.
#[track_caller]
fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn listed(town: &Town, table: &str) -> Vec<(String, u64)> {
    let document = town.run(&["table", "list", table, "--json"]).succeeded().json();
    let landmarks = document["landmarks"].as_array().expect("landmarks");
    let listed = |landmark: &Value| {
        (landmark["landmark"].as_str().expect("a name").to_owned(), landmark["views"].as_u64().expect("views"))
    };
    landmarks.iter().map(listed).collect()
}

/// The weaknesses that enrolling these pictures as one building tells.
fn weaknesses(town: &Town, name: &str, pictures: &[&str]) -> Vec<(String, String)> {
    let arguments = [ENROLL.as_slice(), &["--name", name, "--json"], pictures].concat();
    let document = town.run(&arguments).succeeded().json();
    let text = |warning: &Value, key: &str| warning[key].as_str().expect("text").to_owned();
    let warnings = document["warnings"].as_array().expect("warnings").iter();
    warnings.map(|warning| (text(warning, "image"), text(warning, "weakness"))).collect()
}

fn has(weaknesses: &[(String, String)], image: &str, weakness: &str) -> bool {
    weaknesses.iter().any(|(i, w)| (i.as_str(), w.as_str()) == (image, weakness))
}

#[test]
fn a_building_is_added_extended_left_alone_and_replaced() {
    let town = Town::with_table();
    for (picture, part) in [("left.pgm", "left"), ("right.pgm", "right")] {
        town.tower(3, part, picture);
    }
    let enroll = |extra: &[&str]| town.run(&[ENROLL.as_slice(), &["--name", "Hall", "--no-lint"], extra].concat());

    let ran = enroll(&["left.pgm", "--kind", "tower", "--at", "-33.8568,151.2153"]).succeeded();
    assert!(ran.stdout.starts_with("Hall: added with 1 view\n  at -33.856800, 151.215300, within 20 m\n"), "{ran:#?}");
    assert!(ran.stdout.contains("town.daymark: 3 landmarks, 3 views, "), "{ran:#?}");
    assert_eq!(ran.stderr, "", "no progress where nobody looks, and no warning");

    let ran = enroll(&["right.pgm"]).succeeded();
    assert!(ran.stdout.starts_with("Hall: 1 view added to the 1 that it had\n"), "{ran:#?}");
    let both = town.read("town.daymark");
    let shown = town.run(&["table", "show", "town.daymark", "Hall"]).succeeded();
    assert!(shown.stdout.starts_with("Hall: tower, 2 views, "), "the kind stays: {shown:#?}");
    assert!(shown.stdout.contains("stands at -33.856800, 151.215300"), "the position stays: {shown:#?}");

    let ran = enroll(&["left.pgm", "right.pgm"]).succeeded();
    assert!(ran.stdout.starts_with("Hall: nothing new, the table has these views already\n"), "{ran:#?}");
    assert_eq!(town.read("town.daymark"), both);

    let ran = enroll(&["left.pgm", "--replace"]).succeeded();
    assert!(ran.stdout.starts_with("Hall: 2 views replaced by 1 view\n"), "{ran:#?}");
    assert_eq!(listed(&town, "town.daymark"), [("Gate".into(), 1), ("Hall".into(), 1), ("Mill".into(), 1)]);

    let ran = town.run(&["recognize", "--table", "town.daymark", "right.pgm"]).succeeded();
    assert!(ran.stdout.contains("Hall"), "the other view is known by this one: {ran:#?}");
}

#[test]
fn a_manifest_gives_the_same_bytes_for_any_threads_and_any_order() {
    let town = Town::new();
    std::fs::create_dir(town.path("pictures")).expect("a folder");
    let mut entries = Vec::new();
    for number in 1..=4 {
        for part in ["left", "right"] {
            town.tower(number, part, &format!("pictures/{number}-{part}.pgm"));
        }
        entries.push(format!(
            "[[building]]\nname = \"Tower {number}\"\nkind = \"tower\"\nat = [52, {number}.5]\nimages = [\"{number}-left.pgm\", \"{number}-right.pgm\"]\n"
        ));
    }
    town.write("pictures/m.toml", entries.concat());
    entries.reverse();
    town.write("pictures/reversed.toml", entries.concat());
    let enroll = |table: &str, manifest: &str, jobs: &str| {
        let manifest = format!("pictures/{manifest}");
        town.run(&["enroll", "--table", table, "--manifest", &manifest, "--jobs", jobs, "--json"]).succeeded()
    };
    let one = enroll("one.daymark", "m.toml", "1");
    let four = enroll("four.daymark", "m.toml", "4");
    enroll("reversed.daymark", "reversed.toml", "3");
    assert_eq!(town.read("one.daymark"), town.read("four.daymark"));
    assert_eq!(town.read("one.daymark"), town.read("reversed.daymark"));
    assert_eq!(one.stdout, four.stdout.replace("four.daymark", "one.daymark"), "what is measured, too");
    assert_eq!(one.stderr, four.stderr);

    let document = one.json();
    assert_eq!(keys(&document), ["enrolled", "schema_version", "table", "warnings"]);
    assert_eq!(
        keys(&document["table"]),
        ["bytes", "file", "format_version", "landmarks", "profile", "table_id", "views"]
    );
    let first = &document["enrolled"][0];
    assert_eq!(
        keys(first),
        [
            "images",
            "landmark",
            "missing_for_a_position",
            "model",
            "outcome",
            "position",
            "position_from",
            "views_before",
            "without_model"
        ]
    );
    assert_eq!((&first["landmark"], &first["outcome"]), (&json!("Tower 1"), &json!("added")));
    assert_eq!(first["position"], json!({"latitude_deg": 52.0, "longitude_deg": 1.5, "error_m": 20.0}));
    let measures = &first["images"][0]["measures"];
    assert_eq!(
        keys(measures),
        [
            "earlier_views_bits",
            "lookalikes",
            "median_bits",
            "mirror_bits",
            "needed_bits",
            "repeated_corners",
            "repetition_shift_px",
            "worst_bits"
        ]
    );
    let bits = |key: &str| measures[key].as_f64().expect("a number");
    assert!(bits("worst_bits") > 2.0 * bits("needed_bits"), "a good picture: {measures:#}");
    assert!(bits("median_bits") >= bits("worst_bits"), "{measures:#}");
    assert_eq!(measures["earlier_views_bits"], Value::Null);

    // Again, into a table that has it all.
    let again = enroll("one.daymark", "m.toml", "2").json();
    assert!(again["enrolled"].as_array().is_some_and(|all| all.iter().all(|one| one["outcome"] == "unchanged")));
    assert_eq!(town.read("one.daymark"), town.read("four.daymark"));
}

#[test]
fn a_table_holds_one_profile() {
    let town = Town::with_table();
    let before = town.read("town.daymark");
    let ran = town.run(&[ENROLL.as_slice(), &["--name", "Hall", "--profile", "board", "gate.pgm"]].concat());
    ran.refused(&["town.daymark is of profile handheld", "leave out --profile board"]);
    assert_eq!(town.read("town.daymark"), before);
    let board = ["enroll", "--table", "board.daymark", "--name", "Hall", "--profile", "board", "--no-lint", "gate.pgm"];
    assert!(town.run(&board).succeeded().stdout.contains("profile board"));
    // The table says which, and nobody has to repeat it.
    town.run(&["enroll", "--table", "board.daymark", "--name", "Mill", "--no-lint", "mill.pgm"]).succeeded();
    let ran = town.run(&["table", "merge", "all.daymark", "town.daymark", "board.daymark"]);
    ran.refused(&["town.daymark is of profile handheld and board.daymark of profile board"]);
    assert!(!town.path("all.daymark").exists());
}

/// A JPEG of a tower with GPS data: 48°30'36" N, 2°18' W.
fn with_gps() -> Vec<u8> {
    let rationals = |values: [u32; 3]| ExifValue::Rational(values.map(|num| Rational { num, denom: 1 }).to_vec());
    let letter = |letter: &str| ExifValue::Ascii(vec![letter.into()]);
    let field = |tag, value| Field { tag, ifd_num: In::PRIMARY, value };
    let fields = [
        field(Tag::GPSLatitude, rationals([48, 30, 36])),
        field(Tag::GPSLatitudeRef, letter("N")),
        field(Tag::GPSLongitude, rationals([2, 18, 0])),
        field(Tag::GPSLongitudeRef, letter("W")),
    ];
    let mut writer = Writer::new();
    for field in &fields {
        writer.push_field(field);
    }
    let mut tiff = Cursor::new(Vec::new());
    writer.write(&mut tiff, false).expect("written");
    let segment = [b"Exif\0\0".as_slice(), &tiff.into_inner()].concat();
    let length = u16::try_from(segment.len() + 2).expect("short").to_be_bytes();

    let mut jpeg = Cursor::new(Vec::new());
    let tower = image::open(fixture("tower-3-left.pgm")).expect("a picture");
    tower.write_to(&mut jpeg, ImageFormat::Jpeg).expect("encoded");
    let jpeg = jpeg.into_inner();
    [&jpeg[..2], &[0xFF, 0xE1], &length, &segment, &jpeg[2..]].concat()
}

#[test]
fn the_position_comes_from_gps_data_unless_it_is_given() {
    let town = Town::new();
    town.write("gps.jpg", with_gps());
    let enroll = |extra: &[&str]| {
        town.run(&[ENROLL.as_slice(), &["--name", "Hall", "--no-lint", "gps.jpg"], extra].concat()).succeeded()
    };
    let ran = enroll(&[]);
    let told = "  at 48.510000, -2.300000, within 100 m: where the camera of gps.jpg stood, by its GPS data\n";
    assert!(ran.stdout.contains(told), "{ran:#?}");
    let shown = town.run(&["table", "show", "town.daymark", "Hall", "--json"]).succeeded().json();
    assert_eq!(shown["position"], json!({"latitude_deg": 48.51, "longitude_deg": -2.3, "error_m": 100.0}));

    let ran = enroll(&["--at", "48.5,-2.3", "--position-error", "5"]);
    assert!(ran.stdout.contains("  at 48.500000, -2.300000, within 5 m\n"), "{ran:#?}");
    let document = enroll(&["--json"]).json();
    assert_eq!(document["enrolled"][0]["position_from"], "table", "what was said stands");
    assert_eq!(document["enrolled"][0]["position"]["error_m"], 5.0);
}

/// A wall of stones: no two places alike, and every seed another wall.
fn stones(x: u32, y: u32, seed: u32) -> u8 {
    let stone = |size: u32| u32::from(speckle(x / size, y / size, seed ^ size));
    ((stone(7) * 2 + stone(17)) / 3) as u8
}

#[test]
fn a_look_alike_and_a_picture_that_adds_nothing_are_told() {
    let town = Town::new();
    town.draw("gate.png", 320, 240, |x, y| stones(x, y, 1));
    // The same in other light, a step aside, and another one.
    town.draw("again.png", 320, 240, |x, y| stones(x + 5, y + 2, 1) / 16 * 14 + 20);
    town.draw("hall.png", 320, 240, |x, y| stones(x, y, 2));
    assert_eq!(weaknesses(&town, "Gate", &["gate.png"]), []);

    let ran = town.run(&[ENROLL.as_slice(), &["--name", "Door", "again.png"]].concat()).succeeded();
    assert!(ran.stderr.starts_with("warning: Door, again.png: the picture looks like \"Gate\" too, by "), "{ran:#?}");
    assert!(ran.stderr.contains("if both are one building, enroll it under one name"), "{ran:#?}");
    assert_eq!(ran.stderr.lines().count(), 1, "{ran:#?}");
    town.run(&["table", "remove", "town.daymark", "Door"]).succeeded();

    let told = |weakness: &str| vec![("again.png".to_owned(), weakness.to_owned())];
    assert_eq!(weaknesses(&town, "Gate", &["again.png"]), told("adds_nothing"));
    assert_eq!(weaknesses(&town, "Hall", &["hall.png"]), []);
    // Nothing is measured of what was there already, and nothing where nobody wants it.
    let again = [ENROLL.as_slice(), &["--name", "Door", "--json", "again.png"]].concat();
    town.run(&[again.as_slice(), &["--no-lint"]].concat()).succeeded();
    for document in [town.run(&again).succeeded().json(), town.run(&[again.as_slice(), &["--no-lint"]].concat()).json()]
    {
        assert_eq!(document["enrolled"][0]["images"][0]["measures"], Value::Null);
        assert_eq!(document["enrolled"][0]["images"][0]["known"], true);
    }
}

#[test]
fn symmetry_and_repetition_and_emptiness_are_told() {
    let town = Town::new();
    town.draw("mirror.png", 320, 240, |x, y| stones(x.min(319 - x), y, 3));
    // One window, again and again.
    town.draw("windows.png", 320, 240, |x, y| stones(x % 40, y % 48, 4));
    // Four boxes in the fog.
    let boxes = |x: u32, y: u32| if x % 160 < 24 && y % 120 < 30 { 200 - (x / 20) as u8 } else { 100 };
    town.draw("boxes.png", 320, 240, boxes);
    town.draw("night.png", 320, 240, |x, y| stones(x, y, 5) / 32);

    let found = weaknesses(&town, "Mirror", &["mirror.png"]);
    assert!(has(&found, "mirror.png", "mirror_symmetric"), "{found:?}");
    let found = weaknesses(&town, "Windows", &["windows.png"]);
    assert!(has(&found, "windows.png", "repetitive"), "{found:?}");
    let found = weaknesses(&town, "Boxes", &["boxes.png"]);
    assert!(has(&found, "boxes.png", "few_corners"), "{found:?}");
    assert!(has(&found, "boxes.png", "little_evidence"), "{found:?}");
    let found = weaknesses(&town, "Night", &["night.png"]);
    assert!(has(&found, "night.png", "little_evidence"), "{found:?}");
}

#[test]
fn a_table_is_listed_shown_and_verified() {
    let town = Town::with_table();
    let ran = town.run(&["table", "list", "town.daymark"]).succeeded();
    let lines: Vec<&str> = ran.stdout.lines().collect();
    assert!(lines[0].starts_with("town.daymark: 2 landmarks, 2 views, "), "{ran:#?}");
    assert!(lines[1].starts_with("  Gate  building       1 view") && lines[2].starts_with("  Mill  "), "{ran:#?}");

    let document = town.run(&["table", "list", "town.daymark", "--json"]).succeeded().json();
    assert_eq!(keys(&document), ["landmarks", "schema_version", "table"]);
    assert_eq!(keys(&document["landmarks"][0]), ["bytes", "kind", "landmark", "model_points", "position", "views"]);
    let bytes: u64 =
        document["landmarks"].as_array().expect("all").iter().filter_map(|one| one["bytes"].as_u64()).sum();
    assert_eq!(bytes + 40, town.read("town.daymark").len() as u64, "a header, and nothing that is nobody's");
    assert_eq!(document["table"]["bytes"], bytes + 40);

    let document = town.run(&["table", "show", "town.daymark", "Mill", "--json"]).succeeded().json();
    assert_eq!(
        keys(&document),
        ["bytes", "kind", "landmark", "model_points", "position", "schema_version", "table", "view_list", "views"]
    );
    let view = &document["view_list"][0];
    assert_eq!(keys(view), ["bytes", "corners", "corners_per_level", "height_px", "view", "width_px"]);
    assert_eq!((&view["view"], &view["width_px"], &view["height_px"]), (&json!(1), &json!(640), &json!(480)));
    let levels: u64 = view["corners_per_level"].as_array().expect("levels").iter().filter_map(Value::as_u64).sum();
    assert_eq!(view["corners"], levels);
    let ran = town.run(&["table", "show", "town.daymark", "mil"]);
    ran.refused(&["town.daymark has no landmark \"mil\": did you mean \"Mill\"?"]);

    let ran = town.run(&["table", "verify", "town.daymark"]).succeeded();
    assert!(ran.stdout.ends_with("sound: every checksum and every record is right\n"), "{ran:#?}");
    let document = town.run(&["table", "verify", "town.daymark", "--json"]).succeeded().json();
    assert_eq!(keys(&document), ["faults", "file", "schema_version", "sound", "table"]);
    assert_eq!((&document["sound"], &document["faults"]), (&json!(true), &json!([])));
}

#[test]
fn tables_are_merged_and_landmarks_removed() {
    let town = Town::with_table();
    town.tower(1, "right", "gate-2.pgm");
    let enroll = |name: &str, picture: &str| {
        let table = ["enroll", "--table", "other.daymark", "--no-lint", "--name", name, picture];
        town.run(&table).succeeded();
    };
    enroll("Gate", "gate.pgm");
    enroll("Gate", "gate-2.pgm");
    enroll("Hall", "gate-2.pgm");
    let (first, second) = (town.read("town.daymark"), town.read("other.daymark"));

    let merge = |arguments: &[&str]| town.run(&[["table", "merge"].as_slice(), arguments].concat());
    merge(&["all.daymark", "town.daymark", "other.daymark"]).refused(&["\"Gate\"", "--on-duplicate join"]);
    assert!(!town.path("all.daymark").exists());
    let ran = merge(&["all.daymark", "town.daymark", "other.daymark", "--on-duplicate", "keep-first"]).succeeded();
    assert!(ran.stdout.contains("Gate: in several tables, the first kept"), "{ran:#?}");
    assert_eq!(listed(&town, "all.daymark"), [("Gate".into(), 1), ("Hall".into(), 1), ("Mill".into(), 1)]);

    let join = ["all.daymark", "town.daymark", "other.daymark", "--on-duplicate", "join", "--json"];
    merge(&join).refused(&["all.daymark is there already", "--force"]);
    assert_eq!(listed(&town, "all.daymark").len(), 3);
    let document = merge(&[join.as_slice(), &["--force"]].concat()).succeeded().json();
    assert_eq!(keys(&document), ["duplicates", "schema_version", "table"]);
    assert_eq!(document["duplicates"], json!(["Gate"]));
    // One of the two views of the other table is the first table's: it is not stored twice.
    assert_eq!(listed(&town, "all.daymark"), [("Gate".into(), 2), ("Hall".into(), 1), ("Mill".into(), 1)]);
    let both = ["enroll", "--table", "all.daymark", "--name", "Gate", "gate.pgm", "gate-2.pgm"];
    assert!(town.run(&both).succeeded().stdout.starts_with("Gate: nothing new"), "it has each of them");
    assert_eq!((town.read("town.daymark"), town.read("other.daymark")), (first, second), "the sources stay");

    let all = town.read("all.daymark");
    let ran = town.run(&["table", "remove", "all.daymark", "Mill", "Gait"]);
    ran.refused(&["no landmark \"Gait\": did you mean \"Gate\"?", "daymark table list all.daymark"]);
    assert_eq!(town.read("all.daymark"), all, "all or nothing");
    let document = town.run(&["table", "remove", "all.daymark", "Mill", "Gate", "--json"]).succeeded().json();
    assert_eq!(keys(&document), ["removed", "schema_version", "table"]);
    assert_eq!(document["removed"][1], json!({"landmark": "Gate", "views": 2}));
    assert_eq!(listed(&town, "all.daymark"), [("Hall".into(), 1)]);
    town.run(&["table", "remove", "all.daymark", "Hall"]).succeeded();
    town.run(&["table", "verify", "all.daymark"]).succeeded();
    // Into one of its sources.
    merge(&["town.daymark", "town.daymark", "other.daymark", "--on-duplicate", "join"]).succeeded();
    assert_eq!(listed(&town, "town.daymark").len(), 3);
    let tables = town.names().into_iter().filter(|name| name.contains("daymark")).collect::<Vec<_>>();
    assert_eq!(tables, ["all.daymark", "other.daymark", "town.daymark"], "nothing temporary is left behind");
}
