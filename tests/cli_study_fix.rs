//! `daymark study fix` as a user runs it: its JSON keeps what the documentation promises, its drawings are drawings.

use std::fs;
use std::process::Command;

use serde_json::Value;

fn study(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_daymark")).args(["study", "fix"]).args(arguments).output().expect("it starts")
}

#[test]
fn the_walk_keeps_its_promises() {
    let folder = tempfile::tempdir().expect("a folder");
    let (plot, map) = (folder.path().join("plot.svg"), folder.path().join("map.svg"));
    let paths = [plot.to_str().expect("UTF-8"), map.to_str().expect("UTF-8")];
    // Another seed than the documentation's.
    let output = study(&["--json", "--seed", "7", "--plot", paths[0], "--map", paths[1]]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let number = |group: &str, name: &str| report[group][name].as_f64().unwrap_or_else(|| panic!("{group}.{name}"));
    assert_eq!((report["schema_version"].as_u64(), report["poses"].as_u64()), (Some(1), Some(200)));
    assert!(number("large", "poses") > 30.0);
    for group in ["large", "all", "together"] {
        assert!(number(group, "fix_share") >= 0.95, "{group}");
        assert!(number(group, "error_median_share_of_range") < 0.02, "{group}");
        assert!(number(group, "bearing_error_median_deg") < 0.5, "{group}");
        let inside = number(group, "truth_in_ellipse_share");
        assert!((0.90..=0.98).contains(&inside), "{group}: {inside}");
    }
    // With more noise the errors grow, and the ellipses with them.
    let lines = report["by_noise"].as_array().expect("lines");
    let errors: Vec<_> = lines.iter().filter_map(|line| line["error_median_m"].as_f64()).collect();
    assert!(errors.len() == 4 && errors.is_sorted() && errors[3] > 3.0 * errors[0], "{errors:?}");
    let wrong = report["wrong_buildings"].as_array().expect("lines");
    assert_eq!(wrong.len(), 3);
    for line in wrong {
        assert!(line["attempts"].as_u64() > Some(20) && line["fixes"].as_u64() == Some(0), "{line}");
    }
    for path in [plot, map] {
        let svg = fs::read_to_string(path).expect("a drawing");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>"), "{svg}");
    }
}

#[test]
fn bad_arguments_are_named() {
    for (arguments, named) in [
        (["--noise-px", "0"], "pixels above 0"),
        (["--wrong", "1.5"], "a share from 0 to 0.9"),
        (["--poses", "2"], "8..=100000"),
        (["--map", "/nowhere/at/all.svg"], "/nowhere/at/all.svg"),
    ] {
        let quick = [arguments.as_slice(), &["--corners", "8"]].concat();
        let output = study(&quick);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(named), "{arguments:?}: {said}");
        assert!(output.stdout.is_empty());
    }
}
