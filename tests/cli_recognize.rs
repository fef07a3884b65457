//! `daymark recognize` from the outside: a real table, real files, the real binary.

#![expect(clippy::struct_field_names, reason = "the names are those of the JSON")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use daymark::engine::FRAME_SIDE;
use daymark::enroll;
use daymark::picture::read_gray;
use daymark::table_file::{LandmarkEntry, OwnedTable};
use daymark_core::profile::Profile;
use daymark_core::table::{GeoPosition, Kind};
use daymark_fixtures::{Camera, Clutter, Frame, Lens, Light, Scene, Site, Stand, Tower, Trial, View};
use serde::Deserialize;
use tempfile::TempDir;

/// A folder with a table of three towers and some frames; made once.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(make_folder).path()
}

fn make_folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, frame: Frame| {
        let path = folder.path().join(name);
        fs::write(&path, frame.pgm()).expect("a frame");
        path
    };
    let view = |view: View| {
        let path = write("enrolled.pgm", view.render());
        let image = read_gray(&path).expect("a picture").scaled_to(FRAME_SIDE);
        enroll::view(&image, Profile::Handheld).expect("enough corners")
    };
    let towers = Tower::eight();
    let landmark = |tower: &Tower| LandmarkEntry {
        name: tower.name.clone(),
        kind: Kind::Tower,
        position: (tower.number == 1).then_some(GeoPosition {
            latitude_e7: 520_004_000,
            longitude_e7: 129_994_000,
            error_dm: 25,
        }),
        views: View::enrollment(tower, Lens::VGA).map(view).into(),
        model: None,
    };
    let landmarks = [0, 1, 3].map(|index| &towers[index]).into_iter().map(landmark).collect();
    let table = OwnedTable { profile: Profile::Handheld, landmarks };
    table.save(&folder.path().join("towers.daymark")).expect("a table");
    write("bell.pgm", View::trial(&towers[0], Trial::Between, Lens::VGA).render());
    write("guild.pgm", View::trial(&towers[3], Trial::Overcast, Lens::VGA).render());
    write("unknown.pgm", unknown().render());
    let gray = [b"P5\n320 240\n255\n".as_slice(), &vec![128; 320 * 240]].concat();
    fs::write(folder.path().join("gray.pgm"), gray).expect("a frame");
    fs::write(folder.path().join("letter.jpg"), "Dear Sir or Madam").expect("a file");
    folder
}

/// A building that is not in the table, without the paving and the trees that all drawn scenes share.
fn unknown() -> View {
    let view = View::unknown(1, Lens::VGA);
    let stand = Stand { angle: -30.0, distance: 18.0, eye: 9.0, aim: 13.0 };
    let scene = Scene { clutter: Clutter::none(1), light: Light::overcast(), ..view.scene };
    View { camera: Camera::before(Site::ORIGIN, stand, Lens::VGA), scene, ..view }
}

fn recognize(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
    command.current_dir(folder()).args(["recognize", "--table", "towers.daymark"]).args(arguments);
    command.output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    schema_version: u32,
    program_version: String,
    settings: Settings,
    table: Table,
    frames: Vec<Finding>,
    summary: Summary,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    max_false_answer: f64,
    longer_side_px: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    file: String,
    table_id: String,
    profile: String,
    landmarks: u32,
    views: u32,
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Summary {
    known: usize,
    ambiguous: usize,
    unknown: usize,
    unreadable: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Finding {
    file: String,
    verdict: String,
    landmark: Option<String>,
    probability_false_answer: Option<f64>,
    reason: Option<Reason>,
    best: Option<Candidate>,
    runner_up: Option<Candidate>,
    width_px: usize,
    height_px: usize,
    corners: usize,
    views_compared: u32,
    /// `tests/cli_position.rs` looks into it.
    observer: Option<serde_json::Value>,
    times: Option<Times>,
    explanation: Option<Explanation>,
    overlay_file: Option<String>,
    map_file: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Reason {
    code: String,
    message: String,
    advice: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Candidate {
    landmark: String,
    kind: String,
    position: Option<Position>,
    view: u32,
    evidence_bits: f64,
    probability_false_answer: f64,
    supporting_corners: u16,
    frame_from_view_px: [[f32; 3]; 3],
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Position {
    latitude_deg: f64,
    longitude_deg: f64,
    error_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Times {
    read_ms: f64,
    features_ms: f64,
    matching_ms: f64,
    position_ms: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Explanation {
    best: Option<ViewExplanation>,
    runner_up: Option<ViewExplanation>,
    why_the_runner_up_lost: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewExplanation {
    landmark: String,
    view: u32,
    view_width_px: u16,
    view_height_px: u16,
    evidence_bits: f64,
    corners_sum_bits: f64,
    map: Map,
    frame_from_view_px: [[f32; 3]; 3],
    groups: Vec<Group>,
    corners: Vec<Corner>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Map {
    scale: f32,
    lean_deg: f32,
    stretch: f32,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    said: String,
    corners: usize,
    evidence_bits: f64,
    median_residual_px: Option<f32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Corner {
    corner: u16,
    level: u8,
    said: String,
    evidence_bits: f64,
    in_view_px: [f32; 2],
    expected_px: [f32; 2],
    found_px: Option<[f32; 2]>,
    residual_px: Option<f32>,
    signature_distance_bits: Option<u32>,
}

fn document(output: &Output) -> Document {
    serde_json::from_slice(&output.stdout).expect("JSON of the form that is promised")
}

#[test]
fn a_known_building_is_named_with_its_place_and_how_sure_that_is() {
    let output = recognize(&["bell.pgm", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document = document(&output);
    assert_eq!((document.schema_version, document.frames.len()), (1, 1));
    assert_eq!(document.program_version, env!("CARGO_PKG_VERSION"));
    assert_eq!((document.settings.max_false_answer, document.settings.longer_side_px), (0.01, 640));
    let Table { file, table_id, profile, landmarks, views } = &document.table;
    assert_eq!((file.as_str(), profile.as_str(), *landmarks, *views), ("towers.daymark", "handheld", 3, 6));
    assert!(table_id.len() == 16 && table_id.bytes().all(|byte| byte.is_ascii_hexdigit()), "{table_id}");
    assert_eq!(document.summary, Summary { known: 1, ambiguous: 0, unknown: 0, unreadable: 0 });

    let finding = &document.frames[0];
    assert_eq!((finding.file.as_str(), finding.verdict.as_str()), ("bell.pgm", "known"));
    assert_eq!(finding.landmark.as_deref(), Some("Bell Tower"));
    assert!(finding.probability_false_answer.is_some_and(|p| p <= 0.01), "{finding:?}");
    assert_eq!((finding.width_px, finding.height_px, finding.views_compared), (640, 480, 6));
    assert!(finding.corners > 100 && finding.reason.is_none() && finding.overlay_file.is_none());
    assert!(finding.map_file.is_none() && finding.observer.as_ref().is_some_and(|observer| observer["pose"].is_null()));
    let times = finding.times.as_ref().expect("times");
    assert!(times.read_ms > 0.0 && times.features_ms > 0.0 && times.matching_ms > 0.0);
    assert!(times.position_ms > 0.0 && times.position_ms < 1_000.0);

    let best = finding.best.as_ref().expect("a best");
    assert_eq!((best.landmark.as_str(), best.kind.as_str()), ("Bell Tower", "tower"));
    let place = Position { latitude_deg: 52.000_4, longitude_deg: 12.999_4, error_m: 2.5 };
    assert_eq!(best.position, Some(place));
    assert_eq!(Some(best.probability_false_answer), finding.probability_false_answer);
    // The landmarks stand in the order of their names: Bell Tower's views are the first two.
    assert!(best.view < 2 && best.supporting_corners > 10 && best.frame_from_view_px[2][2] == 1.0);
    if let Some(other) = &finding.runner_up {
        assert!(other.landmark != "Bell Tower" && other.evidence_bits < best.evidence_bits);
    }
}

#[test]
fn text_says_the_same() {
    let output = recognize(&["bell.pgm"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0));
    assert!(said.starts_with("bell.pgm: KNOWN  Bell Tower (tower)\n"), "{said}");
    for part in
        ["false       with a probability of", "stands at   52.000400, 12.999400 degrees, within 2.5 m", "time  "]
    {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
}

#[test]
fn an_unknown_building_is_not_named() {
    let output = recognize(&["unknown.pgm", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let finding = &document(&output).frames[0];
    assert_eq!((finding.verdict.as_str(), &finding.landmark), ("unknown", &None));
    assert_eq!(finding.probability_false_answer, None);
    let reason = finding.reason.as_ref().expect("a reason");
    assert!(matches!(reason.code.as_str(), "not_sure" | "nothing_fits"), "{reason:?}");
    assert!(!reason.message.is_empty() && !reason.advice.is_empty());
}

#[test]
fn too_few_corners_is_an_answer() {
    let output = recognize(&["gray.pgm", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let finding = &document(&output).frames[0];
    let reason = finding.reason.as_ref().expect("a reason");
    assert_eq!((finding.verdict.as_str(), reason.code.as_str()), ("unknown", "too_few_corners"));
    assert!(finding.best.is_none() && finding.corners < 16);
    let said = text(&recognize(&["gray.pgm"]).stdout);
    assert!(said.contains("gray.pgm: UNKNOWN\n") && said.contains("empty or covered"), "{said}");
}

#[test]
fn a_file_that_is_no_picture_does_not_stop_the_others() {
    let output = recognize(&["letter.jpg", "bell.pgm", "absent.png", "guild.pgm", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let document = document(&output);
    assert_eq!(document.summary, Summary { known: 2, ambiguous: 0, unknown: 0, unreadable: 2 });
    let verdicts: Vec<_> = document.frames.iter().map(|finding| finding.verdict.as_str()).collect();
    assert_eq!(verdicts, ["unreadable", "known", "unreadable", "known"]);
    assert_eq!(document.frames[3].landmark.as_deref(), Some("Guild House"));
    let reason = document.frames[0].reason.as_ref().expect("a reason");
    assert!(reason.code == "unreadable" && reason.message.contains("letter.jpg"), "{reason:?}");
    let errors = text(&output.stderr);
    for part in ["letter.jpg", "absent.png", "2 of 4 frames could not be read"] {
        assert!(errors.contains(part), "{part} in {errors}");
    }
    let output = recognize(&["letter.jpg", "bell.pgm"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stdout).contains("KNOWN  Bell Tower"), "the others are answered");
}

#[test]
fn a_smaller_limit_is_more_careful() {
    let probability = |limit: &str| {
        let output = recognize(&["bell.pgm", "--json", "--max-false-answer", limit]);
        (output.status.code(), document(&output).settings.max_false_answer)
    };
    assert_eq!(probability("0.5"), (Some(0), 0.5));
    assert_eq!(probability("1e-300"), (Some(1), 1e-300), "nothing is as sure as that");
    for wrong in ["0", "2", "one"] {
        let output = recognize(&["bell.pgm", "--max-false-answer", wrong]);
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("above 0 and at most 1"), "{}", text(&output.stderr));
    }
}

#[test]
fn an_explanation_adds_up() {
    let output = recognize(&["bell.pgm", "--json", "--explain"]);
    let document = document(&output);
    let finding = &document.frames[0];
    let explanation = finding.explanation.as_ref().expect("an explanation");
    let best = explanation.best.as_ref().expect("of the best view");
    let answer = finding.best.as_ref().expect("a best");
    assert_eq!((best.landmark.as_str(), best.view), ("Bell Tower", answer.view));
    assert_eq!((best.view_width_px, best.view_height_px), (640, 480));
    assert_eq!(best.evidence_bits, answer.evidence_bits);
    assert_eq!(best.frame_from_view_px, answer.frame_from_view_px);
    assert!((0.5..2.0).contains(&best.map.scale) && best.map.lean_deg.abs() < 10.0, "{:?}", best.map);
    assert!((1.0..2.0).contains(&best.map.stretch), "{:?}", best.map);

    let sum: f64 = best.corners.iter().map(|corner| corner.evidence_bits).sum();
    assert!((sum - best.corners_sum_bits).abs() < 1e-6);
    assert_eq!(best.groups.iter().map(|group| group.corners).sum::<usize>(), best.corners.len());
    let grouped: f64 = best.groups.iter().map(|group| group.evidence_bits).sum();
    assert!((sum - grouped).abs() < 1e-6);
    assert!(best.groups.iter().any(|group| group.said == "strong" && group.median_residual_px.is_some()));
    assert!(best.corners.is_sorted_by(|a, b| a.evidence_bits >= b.evidence_bits), "the strongest first");
    let favour = best.corners.iter().filter(|corner| corner.evidence_bits > 0.0).collect::<Vec<_>>();
    assert_eq!(favour.len(), usize::from(answer.supporting_corners));
    for corner in favour {
        let found = corner.found_px.expect("a place");
        let [dx, dy] = [0, 1].map(|i| found[i] - corner.expected_px[i]);
        let residual = corner.residual_px.expect("a residual");
        assert!((dx * dx + dy * dy - residual * residual).abs() < 0.01 && residual < 20.0, "{corner:?}");
        assert!(corner.signature_distance_bits.is_some_and(|distance| distance < 64), "{corner:?}");
        assert!(corner.level < 5 && corner.corner < 100 && corner.said != "missing");
        assert!((0.0..640.0).contains(&corner.in_view_px[0]), "{corner:?}");
    }
    if let Some(other) = &finding.runner_up {
        let runner_up = explanation.runner_up.as_ref().expect("of the runner-up");
        assert_eq!((&runner_up.landmark, runner_up.view), (&other.landmark, other.view));
        let why = explanation.why_the_runner_up_lost.as_ref().expect("a sentence");
        assert!(why.contains(&other.landmark), "{why}");
    }

    let said = text(&recognize(&["bell.pgm", "--explain"]).stdout);
    for part in ["why Bell Tower", "strong", "residual", "map: ", "times the size of the stored view"] {
        assert!(said.contains(part), "{part} in {said}");
    }
}

#[test]
fn an_overlay_shows_the_outline_and_the_matches() {
    let file = folder().join("why.svg");
    let output = recognize(&["bell.pgm", "--overlay", "why.svg"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("overlay     why.svg"), "{}", text(&output.stdout));
    let svg = fs::read_to_string(&file).expect("an overlay");
    let outline = svg.split("class=\"outline\"").nth(1).expect("an outline");
    let points = outline.split("points=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("its points");
    assert_eq!(points.split(' ').count(), 4, "{points}");
    assert!(points.split([' ', ',']).all(|number| number.parse::<f32>().is_ok_and(f32::is_finite)), "{points}");
    assert!(svg.contains("KNOWN: Bell Tower") && svg.contains("data:image/png;base64,"));
    let matches = svg.split("class=\"matches\"").nth(1).expect("lines").split("</g>").next().expect("a group");
    assert!(matches.matches("<line").count() >= 10);
    assert!(!svg.replace("http://www.w3.org/2000/svg", "").contains("http"), "nothing is fetched");

    let output = recognize(&["bell.pgm", "gray.pgm", "--overlay", "each.svg", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let named: Vec<_> = document(&output).frames.into_iter().filter_map(|finding| finding.overlay_file).collect();
    assert_eq!(named, ["each-1.svg", "each-2.svg"]);
    let empty = fs::read_to_string(folder().join("each-2.svg")).expect("an overlay");
    assert!(empty.contains(">UNKNOWN<") || empty.contains("UNKNOWN"), "a frame without an answer is drawn as well");
    assert!(!empty.contains("class=\"outline\""));

    let output = recognize(&["bell.pgm", "--overlay", "absent/why.svg"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("cannot write the overlay"), "{}", text(&output.stderr));
}

#[test]
fn a_table_that_cannot_be_read_is_named() {
    let path = PathBuf::from(folder()).join("bell.pgm");
    for (table, part) in [("absent.daymark", "absent.daymark"), ("bell.pgm", "not a landmark table")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
        let output = command.current_dir(folder()).args(["recognize", "--table", table]).arg(&path).output();
        let output = output.expect("the program runs");
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(part), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
}
