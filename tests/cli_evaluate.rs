//! `daymark evaluate` from the outside: a small dataset of drawn towers, the real binary.

#![expect(clippy::struct_field_names, reason = "the names are those of the JSON")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use daymark_fixtures::{Camera, Clutter, Lens, Light, Scene, Site, Stand, Tower, Trial, View};
use serde::Deserialize;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Three towers with their gallery pictures and queries, another building and a gray picture; made once.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(make_folder).path()
}

fn make_folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: String, bytes: Vec<u8>| {
        let path = folder.path().join(&name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, bytes).expect("a picture");
        name
    };
    let mut recognition = Vec::new();
    for tower in Tower::eight().into_iter().filter(|tower| [1, 4, 7].contains(&tower.number)) {
        let place = if tower.number == 7 { "hill" } else { "town" };
        let picture = |view: View| write(format!("{place}/{}.pgm", view.name), view.render().pgm());
        // Two pictures each of the first, one each of the others.
        let count = if tower.number == 1 { 2 } else { 1 };
        let gallery: Vec<String> = View::enrollment(&tower, Lens::VGA).into_iter().take(count).map(picture).collect();
        let trials = [Trial::Between, Trial::Overcast].into_iter().take(count);
        let queries: Vec<String> = trials.map(|trial| picture(View::trial(&tower, trial, Lens::VGA))).collect();
        recognition.push(json!({"building": tower.name, "gallery": gallery, "queries": queries, "comment": "drawn"}));
    }
    let other = write("elsewhere/other.pgm".to_owned(), other().render().pgm());
    let gray = write("elsewhere/gray.pgm".to_owned(), [b"P5\n320 240\n255\n".as_slice(), &vec![9; 320 * 240]].concat());
    let manifest = json!({
        "recognition": recognition,
        "negatives": [{"file": other, "taken": "from near"}, gray],
        "licences": {"everything": "drawn"},
    });
    fs::write(folder.path().join("manifest.json"), manifest.to_string()).expect("a manifest");
    folder
}

/// A building that is not in the gallery, without the paving and the trees that all drawn scenes share.
fn other() -> View {
    let view = View::unknown(1, Lens::VGA);
    let stand = Stand { angle: -30.0, distance: 18.0, eye: 9.0, aim: 13.0 };
    let scene = Scene { clutter: Clutter::none(1), light: Light::overcast(), ..view.scene };
    View { camera: Camera::before(Site::ORIGIN, stand, Lens::VGA), scene, ..view }
}

fn evaluate(dataset: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
    command.args(["evaluate", "--dataset"]).arg(dataset).args(arguments).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Evaluation {
    schema_version: u32,
    profile: String,
    settings: Value,
    bytes_per_view: usize,
    table: Table,
    queries: usize,
    negatives: usize,
    recall_at_1: f64,
    recall_at_zero_false_accepts: f64,
    most_false_evidence_bits: Option<f64>,
    at_stated_probability: Vec<Stated>,
    reliability: Vec<Bin>,
    sources: Vec<Source>,
    frames: Vec<Frame>,
    times: Option<serde_json::Map<String, Value>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    table_id: String,
    landmarks: u32,
    views: u32,
    bytes: usize,
    not_enrolled: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    stated: f64,
    false_accepts_on_negatives: usize,
    false_accept_rate: f64,
    ambiguous_on_negatives: usize,
    right: usize,
    wrong: usize,
    ambiguous: usize,
    unknown: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Bin {
    stated_from: f64,
    stated_to: f64,
    mean_stated: f64,
    right: usize,
    wrong: usize,
    negatives: usize,
    observed_false: f64,
    negatives_up_to_here: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Source {
    source: String,
    queries: usize,
    right_at_1: usize,
    right_at_zero_false_accepts: usize,
    right: usize,
    wrong: usize,
    negatives: usize,
    false_accepts: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Frame {
    file: String,
    shows: Option<String>,
    source: String,
    best: Option<Guess>,
    runner_up: Option<Guess>,
    right_at_1: bool,
    outcome: String,
    corners: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Guess {
    building: String,
    gallery_file: String,
    evidence_bits: f64,
    probability_false_answer: f64,
}

#[test]
fn figures_of_a_small_dataset() {
    let output = evaluate(folder(), &["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "no progress where there is no terminal: {}", text(&output.stderr));
    let evaluation: Evaluation = serde_json::from_slice(&output.stdout).expect("JSON of the form that is promised");
    assert_eq!((evaluation.schema_version, evaluation.profile.as_str()), (1, "handheld"));
    assert_eq!((evaluation.queries, evaluation.negatives, evaluation.frames.len()), (4, 2, 6));
    let Table { table_id, landmarks, views, bytes, not_enrolled } = &evaluation.table;
    assert_eq!((*landmarks, *views, table_id.len(), not_enrolled.len()), (3, 4, 16, 0));
    assert_eq!(evaluation.bytes_per_view, bytes.div_ceil(4));
    // At most 2,048 for a view; header and names come on top, and few views share them.
    assert!((2_000..2_100).contains(&evaluation.bytes_per_view), "{}", evaluation.bytes_per_view);
    assert_eq!(evaluation.settings, json!({"max_false_answer": 0.01, "longer_side_px": 640}));

    assert_eq!((evaluation.recall_at_1, evaluation.recall_at_zero_false_accepts), (1.0, 1.0));
    let stated: Vec<f64> = evaluation.at_stated_probability.iter().map(|row| row.stated).collect();
    assert_eq!(stated, [0.1, 0.01, 0.001]);
    for row in &evaluation.at_stated_probability {
        assert_eq!(row.right + row.wrong + row.ambiguous + row.unknown, 4, "{row:?}");
        assert_eq!((row.right, row.wrong), (4, 0), "{row:?}");
        assert!(row.false_accepts_on_negatives + row.ambiguous_on_negatives <= 2);
        assert_eq!(row.false_accept_rate, row.false_accepts_on_negatives as f64 / 2.0);
    }
    assert_eq!(evaluation.at_stated_probability[2].false_accepts_on_negatives, 0);

    let members: usize = evaluation.reliability.iter().map(|bin| bin.right + bin.wrong + bin.negatives).sum();
    assert_eq!((members, evaluation.reliability.len()), (6, 6));
    for bin in &evaluation.reliability {
        assert!(bin.stated_from < bin.stated_to && (0.0..=1.0).contains(&bin.observed_false), "{bin:?}");
        let occupied = bin.right + bin.wrong + bin.negatives > 0;
        assert!(!occupied || (bin.stated_from..=bin.stated_to).contains(&bin.mean_stated), "{bin:?}");
    }
    assert_eq!(evaluation.reliability[5].negatives_up_to_here, 1.0);

    let sources: Vec<_> = evaluation.sources.iter().map(|source| source.source.as_str()).collect();
    assert_eq!(sources, ["elsewhere", "hill", "town"]);
    let counts = |source: &Source| (source.queries, source.right_at_1, source.right, source.wrong, source.negatives);
    assert_eq!(counts(&evaluation.sources[0]), (0, 0, 0, 0, 2));
    assert_eq!(counts(&evaluation.sources[1]), (1, 1, 1, 0, 0));
    assert_eq!(counts(&evaluation.sources[2]), (3, 3, 3, 0, 0));
    assert_eq!(evaluation.sources[2].right_at_zero_false_accepts, 3);
    assert_eq!(evaluation.sources[0].false_accepts, evaluation.at_stated_probability[1].false_accepts_on_negatives);

    let bell = &evaluation.frames[0];
    assert_eq!((bell.file.as_str(), bell.source.as_str()), ("town/tower-1-between.pgm", "town"));
    assert_eq!((bell.shows.as_deref(), bell.outcome.as_str(), bell.right_at_1), (Some("Bell Tower"), "right", true));
    let best = bell.best.as_ref().expect("a best");
    assert!(best.building == "Bell Tower" && best.gallery_file.starts_with("town/tower-1-"), "{best:?}");
    assert!(best.probability_false_answer <= 0.001);
    let false_evidence = evaluation.most_false_evidence_bits.unwrap_or(f64::MIN);
    assert!(best.evidence_bits > false_evidence);
    assert!(bell.runner_up.as_ref().is_none_or(|other| other.building != "Bell Tower"));
    let gray = evaluation.frames.last().expect("a frame");
    assert_eq!((gray.file.as_str(), gray.outcome.as_str()), ("elsewhere/gray.pgm", "unknown"));
    assert!(gray.best.is_none() && gray.corners < 16 && gray.shows.is_none());

    let times = evaluation.times.expect("times");
    assert_eq!(times.len(), 8);
    assert!(times.iter().all(|(name, value)| name.ends_with("_ms") && value.as_f64().is_some_and(|ms| ms > 0.0)));
}

#[test]
fn equal_inputs_give_equal_bytes() {
    let one = evaluate(folder(), &["--json", "--reproducible", "--jobs", "1"]).stdout;
    let two = evaluate(folder(), &["--json", "--reproducible", "--jobs", "2"]).stdout;
    assert!(!one.is_empty() && one == two, "{} against {} bytes", one.len(), two.len());
    let mut timed: Value =
        serde_json::from_slice(&evaluate(folder(), &["--json", "--jobs", "2"]).stdout).expect("JSON");
    assert!(timed.as_object_mut().expect("an object").remove("times").is_some());
    let reproducible: Value = serde_json::from_slice(&one).expect("JSON");
    assert_eq!(timed, reproducible, "only the times differ");
}

#[test]
fn text_and_page() {
    let page = folder().join("report.html");
    let output = evaluate(folder(), &["--html", page.to_str().expect("UTF-8"), "--profile", "board"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.starts_with("profile board: 3 buildings in 4 stored views, "), "{said}");
    for part in ["recall@1                      1.000", "0.1 %", "reliability", "elsewhere", "one stored view"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let html = fs::read_to_string(&page).expect("a page");
    assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
    assert_eq!(html.matches("<svg").count(), html.matches("</svg>").count());
    assert!(html.matches("<svg").count() >= 2, "two plots");
    assert!(html.contains("recall@1") && html.contains("Misses: 0"));
    assert!(!html.replace("http://www.w3.org/2000/svg", "").contains("http"), "nothing is fetched");
}

/// A folder with its own manifest over the same pictures.
fn other_manifest(change: impl FnOnce(&mut Value)) -> TempDir {
    let copy = tempfile::tempdir().expect("a folder");
    for part in ["town", "hill", "elsewhere"] {
        fs::create_dir(copy.path().join(part)).expect("a folder");
        for entry in fs::read_dir(folder().join(part)).expect("a folder") {
            let from = entry.expect("an entry").path();
            fs::copy(&from, copy.path().join(part).join(from.file_name().expect("a name"))).expect("a copy");
        }
    }
    let text = fs::read(folder().join("manifest.json")).expect("a manifest");
    let mut manifest: Value = serde_json::from_slice(&text).expect("JSON");
    change(&mut manifest);
    fs::write(copy.path().join("manifest.json"), manifest.to_string()).expect("a manifest");
    copy
}

#[test]
fn a_miss_is_counted_and_shown() {
    // The Guild House is said to be the Bell Tower: a wrong answer that is beyond doubt.
    let folder = other_manifest(|manifest| {
        let swapped = manifest["recognition"][1]["queries"].take();
        manifest["recognition"][1]["queries"] = json!([]);
        manifest["recognition"][0]["queries"] = swapped;
    });
    let page = folder.path().join("report.html");
    let output = evaluate(folder.path(), &["--json", "--html", page.to_str().expect("UTF-8")]);
    let evaluation: Evaluation = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((evaluation.queries, evaluation.recall_at_1), (2, 0.5));
    let row = &evaluation.at_stated_probability[1];
    assert_eq!((row.right, row.wrong), (1, 1));
    let wrong = evaluation.frames.iter().find(|frame| frame.outcome == "wrong").expect("a wrong answer");
    let evidence = wrong.best.as_ref().map(|best| best.evidence_bits);
    assert!(evaluation.most_false_evidence_bits >= evidence, "a wrong answer sets the limit of zero false accepts");
    let html = fs::read_to_string(&page).expect("a page");
    assert!(html.contains("False answers: 1"), "it is shown");
    // The frame with its outline, the view that it was taken for, and a view of what it should have been.
    assert_eq!(html.matches("data:image/jpeg;base64,").count(), 3);
    assert_eq!(html.matches("<polygon").count(), 2);
}

#[test]
fn equivalent_buildings_are_one() {
    let split = |equivalent: Value| {
        other_manifest(|manifest| {
            let second = manifest["recognition"][0]["gallery"].as_array_mut().expect("a gallery").pop();
            let other = json!({"building": "Campanile", "gallery": [second]});
            manifest["recognition"].as_array_mut().expect("buildings").push(other);
            manifest["equivalent_buildings"] = equivalent;
        })
    };
    let right = |folder: &TempDir| {
        let output = evaluate(folder.path(), &["--json"]);
        let evaluation: Evaluation = serde_json::from_slice(&output.stdout).expect("JSON");
        (evaluation.recall_at_1, evaluation.at_stated_probability[1].right)
    };
    assert_eq!(right(&split(json!([["Campanile", "Bell Tower"]]))), (1.0, 4));
    assert!(right(&split(json!([]))).1 < 4, "as two buildings they are ambiguous or wrong");
}

#[test]
fn what_is_wrong_with_a_dataset_is_named() {
    let refused = |folder: &Path, parts: &[&str]| {
        let output = evaluate(folder, &["--json"]);
        assert_eq!(output.status.code(), Some(2));
        assert!(output.stdout.is_empty());
        let error = text(&output.stderr);
        for part in parts {
            assert!(error.contains(part), "{part} in {error}");
        }
    };
    let empty = tempfile::tempdir().expect("a folder");
    refused(empty.path(), &["cannot read", "manifest.json", r#""gallery""#]);
    refused(&empty.path().join("absent"), &["is no folder"]);
    fs::write(empty.path().join("manifest.json"), "{\"recognition\": [").expect("a manifest");
    refused(empty.path(), &["is not as it should be", "line 1"]);
    fs::write(empty.path().join("manifest.json"), r#"{"recognition": [{"building": "a", "gallery": ["1.jpg"]}]}"#)
        .expect("a manifest");
    refused(empty.path(), &["1 picture", "1.jpg", "take"]);
    fs::write(empty.path().join("1.jpg"), "Dear Sir or Madam").expect("a file");
    refused(empty.path(), &["1.jpg is not a picture"]);
    for (flag, value) in [("--profile", "cray"), ("--jobs", "0"), ("--max-false-answer", "0")] {
        assert_eq!(evaluate(folder(), &[flag, value]).status.code(), Some(2), "{flag} {value}");
    }
}
