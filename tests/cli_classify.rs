//! `daymark classify` and `daymark study towers`.

#[path = "support/mod.rs"]
mod support;

use daymark::classify::towers::{BASE_ANGLES, Conditions, TEST_ANGLES, TowerViews};
use daymark::model_file::sheet::sheets;
use daymark::model_file::{gltf, obj, ply};
use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::{Light, Tower};
use support::Town;

/// The model of a tower as a PLY file.
fn model(number: usize, angles: &[f64], light: Light, around: bool) -> Vec<u8> {
    let tower = &Tower::eight()[number - 1];
    let conditions = Conditions { light, seed: 70 + number as u64 + u64::from(around), farther: 1.0 };
    let views = TowerViews::new(tower, angles, &conditions, around);
    let model = views.model(0.5, number as u64);
    let dense = model.dense(SubdivisionLevel::THREE, views.views(), views.stations()).expect("a surface");
    ply::file(&dense, &[])
}

#[test]
fn towers_of_one_shape_are_told_apart_and_an_absent_one_is_refused() {
    let town = Town::new();
    std::fs::create_dir(town.path("bases")).expect("a folder");
    for (number, name) in [(2, "exchange"), (3, "water"), (5, "hotel")] {
        town.write(&format!("bases/{name}.ply"), model(number, &BASE_ANGLES, Light::morning(), true));
    }
    town.write("five.ply", model(5, &TEST_ANGLES, Light::overcast(), false));
    town.write("three.ply", model(3, &TEST_ANGLES, Light::overcast(), false));
    town.write("four.ply", model(4, &TEST_ANGLES, Light::overcast(), false));

    let ran = town.run(&["classify", "five.ply", "three.ply", "--bases", "bases"]).succeeded();
    assert!(ran.stdout.contains("five.ply: hotel by appearance"), "{}", ran.stdout);
    assert!(ran.stdout.contains("three.ply: water by shape"), "{}", ran.stdout);

    let ran = town.run(&["classify", "four.ply", "--bases", "bases", "--json"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    let document = ran.json();
    assert_eq!(document["tests"][0]["decision"]["answer"]["unknown"], "shape", "{document:#}");

    // Without the hotel its twin in shape is the nearest, and its face is another's.
    std::fs::remove_file(town.path("bases/hotel.ply")).expect("removed");
    let ran = town.run(&["classify", "five.ply", "--bases", "bases"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert!(
        ran.stdout.contains("unknown; nearest is exchange, but the shape fits, the intensities do not"),
        "{ran:#?}"
    );
}

#[test]
fn every_kind_of_file_that_synthesize_writes_is_read() {
    let town = Town::new();
    std::fs::create_dir(town.path("bases")).expect("a folder");
    // Two kinds of bases, and every kind of test.
    let write = |name: &str, number: usize, angles: &[f64], light, around| {
        let tower = &Tower::eight()[number - 1];
        let conditions = Conditions { light, seed: 70 + number as u64 + u64::from(around), farther: 1.0 };
        let views = TowerViews::new(tower, angles, &conditions, around);
        let model = views.model(0.5, number as u64);
        let dense = model.dense(SubdivisionLevel::THREE, views.views(), views.stations()).expect("a surface");
        let sheets = sheets(&dense, &model.shown, views.views(), views.stations());
        let stem = std::path::Path::new(name).file_stem().unwrap().to_string_lossy().into_owned();
        match name.rsplit('.').next() {
            Some("glb") if name.contains("mean") => town.write(name, gltf::patches(&dense, &serde_json::Value::Null)),
            Some("glb") => town.write(name, gltf::textured(&dense, &sheets, &serde_json::Value::Null)),
            Some("obj") => {
                for (file, bytes) in obj::files(&dense, &sheets, &stem, &[]) {
                    town.write(&std::path::Path::new(name).with_file_name(file).to_string_lossy(), bytes);
                }
            }
            _ => town.write(name, ply::file(&dense, &[])),
        }
    };
    write("bases/exchange.glb", 2, &BASE_ANGLES, Light::morning(), true);
    write("bases/hotel.obj", 5, &BASE_ANGLES, Light::morning(), true);
    let tests = ["five.glb", "five mean.glb", "five.obj", "five.ply"];
    for name in tests {
        write(name, 5, &TEST_ANGLES, Light::overcast(), false);
    }
    let document = town.run(&[&["classify"], &tests[..], &["--bases", "bases", "--json"]].concat()).succeeded().json();
    let rows = document["tests"].as_array().unwrap();
    assert_eq!(document["bases"], serde_json::json!(["exchange", "hotel"]));
    for row in rows {
        let known = &row["decision"]["answer"]["known"];
        assert_eq!((&known["base"], &known["by_appearance"]), (&1.into(), &true.into()), "{row:#}");
        // The same shape whatever the file; JPEG and the mean of triangles change the intensities a little.
        for (a, b) in [("one_sided_rms", 0.02), ("intensity_free", 0.15)] {
            let (this, last) = (row[a][1].as_f64().unwrap(), rows[3][a][1].as_f64().unwrap());
            assert!((this / last - 1.0).abs() < b, "{a} {this} {last}");
        }
    }
}

#[test]
fn models_that_are_none_are_refused() {
    let town = Town::new();
    std::fs::create_dir(town.path("bases")).expect("a folder");
    town.write("bases/a.ply", "solid");
    town.write("test.ply", model(1, &TEST_ANGLES, Light::morning(), false));
    town.run(&["classify", "test.ply", "--bases", "bases"]).refused(&["bases/a.ply", "no PLY file"]);
    town.run(&["classify", "test.ply", "--bases", "nowhere"]).refused(&["nowhere"]);
    std::fs::remove_file(town.path("bases/a.ply")).expect("removed");
    town.run(&["classify", "test.ply", "--bases", "bases"]).refused(&["has no models (.ply, .glb, .obj)"]);
}

#[test]
fn the_study_of_the_towers_has_every_row_right() {
    let town = Town::new();
    let document = town.run(&["study", "towers", "--seeds", "1", "--json"]).succeeded().json();
    assert_eq!(document["rows"].as_array().map(Vec::len), Some(8));
    assert_eq!((&document["right"], &document["refused_when_absent"]), (&8.into(), &8.into()), "{document:#}");
    assert!(document["smallest_margin"].as_f64().unwrap() >= 1.5, "{document:#}");
    for row in document["rows"].as_array().unwrap() {
        // Half a pixel of noise at 640 x 480 is a decimetre on a tower.
        let median = row["true_surface_median_millimetre"].as_f64().unwrap();
        assert!(median > 1.0 && median < 400.0, "{row:#}");
        assert!(row["true_surface_p95_millimetre"].as_f64().unwrap() > median);
    }
    for tower in [2, 5] {
        assert_eq!(document["rows"][tower - 1]["by_appearance"], true);
    }
}
