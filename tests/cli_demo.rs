//! `daymark demo` from the outside: what a newcomer sees and finds.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn daymark(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
    command.current_dir(folder).args(arguments).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

fn count(folder: &Path, ending: &str) -> usize {
    let entries = fs::read_dir(folder).expect("a folder");
    entries
        .filter(|entry| entry.as_ref().is_ok_and(|entry| entry.path().extension().is_some_and(|e| e == ending)))
        .count()
}

#[test]
fn a_newcomer_is_told_a_story_and_finds_pictures() {
    let here = tempfile::tempdir().expect("a folder");
    let output = daymark(here.path(), &["demo"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for part in ["1. Enroll", "2. Recognize", "3. Tell apart", "4. Say no", "What to notice", "Now you:"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert_eq!(said.lines().filter(|line| line.starts_with("   shown: ")).count(), 11);
    for name in ["Exchange", "Hotel"] {
        let shown = said.lines().position(|line| line.starts_with(&format!("   shown: {name}"))).expect("a twin");
        let answer = said.lines().nth(shown + 1).expect("an answer");
        assert!(answer.contains(&format!("-> {name}; ")), "the twins are told apart: {answer}");
    }
    let next: Vec<&str> = said.lines().skip_while(|line| *line != "Now you:").skip(1).collect();
    assert!(next.len() == 3 && next.iter().all(|line| line.starts_with("   daymark ")), "{next:?}");

    let out = here.path().join("daymark-demo");
    let counts = [("enrolled", "png", 16), ("frames", "png", 11), ("overlays", "svg", 11)];
    for (folder, ending, expected) in counts {
        assert_eq!(count(&out.join(folder), ending), expected, "{folder}");
    }
    let page = fs::read_to_string(out.join("index.html")).expect("a page");
    let links: Vec<&str> = ["src=\"", "href=\""]
        .iter()
        .flat_map(|mark| page.split(mark).skip(1).filter_map(|rest| rest.split('"').next()))
        .collect();
    assert!(links.len() > 40, "{}", links.len());
    assert!(links.iter().all(|link| out.join(link).is_file()), "every link leads to a file: {links:?}");

    // The first thing to try works as it is printed.
    let line: Vec<&str> = next[0].split_whitespace().skip(1).collect();
    let output = daymark(here.path(), &line);
    assert_eq!(output.status.code(), Some(0), "{line:?}: {}", text(&output.stderr));
    assert!(text(&output.stdout).contains("KNOWN  Bell Tower (tower)"), "{}", text(&output.stdout));
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let here = tempfile::tempdir().expect("a folder");
    fs::write(here.path().join("taken"), "a file").expect("a file");
    let output = daymark(here.path(), &["demo", "--out", "taken"]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert!(error.contains("taken") && error.contains("give --out"), "{error}");
}
