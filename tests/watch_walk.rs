//! The way past four known and two unknown buildings: who is named when, and that each run says the same.

mod support;

use daymark_fixtures::walk_files::RATE;
use daymark_fixtures::{Lens, Walk, walk_files};
use serde_json::Value;

use support::Town;

/// Frames that an answer may take, to come and to go.
const FRAMES: usize = 5;

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}

#[test]
fn known_buildings_are_named_while_they_are_seen_and_unknown_ones_never() {
    let town = Town::new();
    let walk = Walk::new(2.0, Lens::VGA);
    let frames = walk_files::write(&town.path("."), &walk, Lens::VGA).expect("the walk") as usize;
    town.run(&["enroll", "--table", "town.daymark", "--no-lint", "--manifest", "enroll.toml"]).succeeded();
    let rate = RATE.to_string();
    let watch = ["watch", "--table", "town.daymark", "--frames", "frames", "--rate", &rate, "--json"];
    let first = town.run(&watch).succeeded();
    assert_eq!(town.run(&watch).succeeded().stdout, first.stdout, "each run says the same, byte for byte");

    let truth: Value = serde_json::from_slice(&town.read("truth.json")).expect("the truth");
    let share = |frame: usize, name: &str| {
        let buildings = truth["frames"][frame]["buildings"].as_array().expect("buildings");
        let building = buildings.iter().find(|building| building["name"] == name).expect("it is in the street");
        building["pixel_share"].as_f64().expect("a share")
    };
    let said = lines(&first.stdout);
    let of_type = |kind: &'static str| said.iter().filter(move |line| line["type"] == kind);
    assert_eq!(of_type("frame").count(), frames, "every frame was looked at");
    let at = |line: &Value| line["frame"].as_u64().expect("a number") as usize;
    let answers = || of_type("answer").filter(|line| line["repeated"] == false);

    let street = truth["frames"][0]["buildings"].as_array().expect("buildings");
    let (known, unknown): (Vec<&Value>, Vec<&Value>) = street.iter().partition(|building| building["known"] == true);
    assert_eq!((known.len(), unknown.len()), (4, 2));
    for building in known {
        let name = building["name"].as_str().expect("a name");
        let fills = (0..frames).find(|frame| share(*frame, name) >= 1.0 / 3.0).expect("it fills a third of some frame");
        let gone = (fills..frames).find(|frame| share(*frame, name) == 0.0).unwrap_or(frames);
        let named: Vec<usize> = answers().filter(|line| line["landmark"] == name).map(at).collect();
        assert_eq!(named.len(), 1, "{name} is named once: {named:?}");
        assert!(named[0] <= fills + FRAMES, "{name} fills a third of frame {fills} and is named at {}", named[0]);
        let end = of_type("withdrawn").find(|line| line["landmark"] == name).expect("withdrawn");
        assert!(at(end) < gone + FRAMES, "{name} is gone at frame {gone} and withdrawn at {}", at(end));
        println!("{name}: fills a third at {fills}, named at {}, gone at {gone}, withdrawn at {}", named[0], at(end));
    }
    assert_eq!(answers().count(), 4, "and nobody else is named");
    // Not only is an unknown building never named: nothing is said while it is alone.
    for frame in 0..frames {
        let alone = unknown.iter().any(|building| share(frame, building["name"].as_str().expect("a name")) > 1.0 / 3.0);
        let line = of_type("frame").nth(frame).expect("a frame");
        assert!(!alone || line["answer"].is_null(), "frame {frame}: {line}");
    }
}
