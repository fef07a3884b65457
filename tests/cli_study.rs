//! `daymark study correspondence` from the outside: the form of its JSON, the figures that it must reach, any threads.

use std::process::Command;

use serde::Deserialize;

/// Few random cases, and fixed ones: the figures are the same on every machine.
const SEEDS: u64 = 12;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Report {
    schema_version: u32,
    tower: u32,
    corners: usize,
    seeds: u64,
    first_seed: u64,
    affine: Vec<Line>,
    views: Vec<Line>,
    no_answer_from_degree: Option<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    view_angle_degree: Option<u32>,
    noise_px: f64,
    missing_corners: usize,
    common_corners_mean: f64,
    no_answer: u64,
    scores: Vec<Score>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Score {
    method: String,
    matched_share: f64,
    wrong_share: f64,
    wrong_matches: usize,
    answers: u64,
}

impl Line {
    fn score(&self, method: &str) -> &Score {
        self.scores.iter().find(|score| score.method == method).expect("the method")
    }
}

fn study(threads: &str) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
    command.args(["study", "correspondence", "--json", "--seeds", &SEEDS.to_string()]);
    let output = command.env("RAYON_NUM_THREADS", threads).output().expect("the program runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Both in one test, since the study is all the work.
#[test]
fn the_study_reaches_its_figures_and_has_the_same_bytes_for_any_threads() {
    let bytes = study("1");
    assert_eq!(bytes, study("3"), "another number of threads, other bytes");
    let report: Report = serde_json::from_slice(&bytes).expect("the form of the report");
    assert_eq!((report.schema_version, report.tower, report.corners), (1, 1, 47));
    assert_eq!((report.seeds, report.first_seed), (SEEDS, 0));
    check_form(&report);

    let affine = |noise: f64, missing: usize, method: &str| {
        let at = |line: &&Line| line.noise_px == noise && line.missing_corners == missing;
        report.affine.iter().find(at).expect("the line").score(method)
    };
    let exact = affine(0.0, 0, "verified");
    assert_eq!((exact.matched_share, exact.wrong_matches), (1.0, 0));
    for (noise, missing, least) in [(0.25, 0, 0.95), (0.5, 0, 0.85), (0.5, 5, 0.70)] {
        let score = affine(noise, missing, "verified");
        assert!(score.matched_share >= least, "{noise} px, {missing} missing: {score:?}");
        assert!(score.wrong_share < 0.005, "{noise} px, {missing} missing: {score:?}");
    }
    // What the verified matcher is for.
    assert!(affine(0.5, 0, "verified").matched_share > affine(0.5, 0, "plain").matched_share);
}

fn check_form(report: &Report) {
    assert_eq!(report.affine.len(), 20);
    assert!(report.affine.iter().all(|line| line.view_angle_degree.is_none()));
    let angles: Vec<u32> = report.views.iter().filter_map(|line| line.view_angle_degree).collect();
    assert_eq!(angles, [5, 10, 15, 20, 30, 40, 50, 60]);
    let silent = |line: &&Line| line.no_answer * 2 > SEEDS;
    assert_eq!(report.no_answer_from_degree, report.views.iter().find(silent).and_then(|line| line.view_angle_degree));
    for line in report.affine.iter().chain(&report.views) {
        let methods: Vec<&str> = line.scores.iter().map(|score| score.method.as_str()).collect();
        assert_eq!(methods, ["plain", "tolerant_hulls", "local_arrangements", "verified"]);
        assert_eq!(line.no_answer, SEEDS - line.score("verified").answers);
        assert!(line.common_corners_mean > 0.0 && line.common_corners_mean <= 64.0);
        for score in &line.scores {
            assert!((0.0..=1.0).contains(&score.matched_share) && (0.0..=1.0).contains(&score.wrong_share));
            assert_eq!(score.wrong_matches == 0, score.wrong_share == 0.0);
        }
    }
}
