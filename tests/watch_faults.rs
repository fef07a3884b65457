//! Every fault of a source: what is printed, what happens next, and that answers come again.

mod support;

use std::io::Write;
use std::process::Stdio;

use serde_json::Value;
use support::{Ran, Town, fixture};

const FRAMES: usize = 14;

/// A folder with frames of one tower, and the table that knows it.
fn town() -> Town {
    let town = Town::with_table();
    std::fs::create_dir(town.path("frames")).expect("a folder");
    for number in 0..FRAMES {
        std::fs::copy(fixture("tower-1-left.pgm"), town.path(&format!("frames/{number:03}.pgm"))).expect("a frame");
    }
    town
}

fn watch(town: &Town, more: &[&str]) -> (Ran, Vec<Value>) {
    let arguments = [&["watch", "--table", "town.daymark", "--json"], more].concat();
    let ran = town.run(&arguments);
    let lines = ran.stdout.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    (ran, lines)
}

/// What happened, in words: the story that a rehearsal tells.
fn story(lines: &[Value]) -> Vec<String> {
    let word = |line: &Value, key: &str| line[key].as_str().unwrap_or("-").to_owned();
    let tell = |line: &Value| match line["type"].as_str() {
        Some("camera") => Some(match word(line, "state").as_str() {
            "opened" => "opened".to_owned(),
            "clock_jumped" => "clock jumped".to_owned(),
            state => format!("{state} {} {}", word(line, "fault"), line["count"]),
        }),
        Some("answer") if line["repeated"] == false => Some(format!("answer {}", line["frame"])),
        Some("withdrawn") => Some(format!("withdrawn {}", word(line, "reason"))),
        _ => None,
    };
    lines.iter().filter_map(tell).collect()
}

fn rehearse(town: &Town, fault: &str, expected: &[&str], said: &str) {
    let (ran, lines) = watch(town, &["--frames", "frames", "--rehearse", fault]);
    let ran = ran.succeeded();
    assert_eq!(story(&lines), expected, "{fault}");
    assert!(ran.stderr.contains(said), "{fault} should be told as {said:?}: {}", ran.stderr);
    let looked = lines.iter().filter(|line| line["type"] == "frame").count();
    assert_eq!(looked, FRAMES, "{fault}: no good frame is lost");
    let times: Vec<f64> =
        lines.iter().filter(|line| line["type"] == "frame").filter_map(|line| line["time_s"].as_f64()).collect();
    assert!(times.windows(2).all(|pair| pair[1] > pair[0] && pair[1] < pair[0] + 1.0), "{fault}: {times:?}");
    // The same faults tell the same story, byte for byte.
    assert_eq!(watch(town, &["--frames", "frames", "--rehearse", fault]).0.stdout, ran.stdout, "{fault}");
}

#[test]
fn frames_that_are_missing_or_broken_are_left_out_and_told() {
    let town = town();
    rehearse(
        &town,
        "9:no-frame",
        &["opened", "answer 0", "left_out no_frame 1", "withdrawn no_frames", "answer 9", "withdrawn end"],
        "no frame for 0.0 s",
    );
    let cases = [
        ("9:short", "left_out short_frame 1", "a frame of 2048 bytes instead of 4096"),
        ("9:corrupt", "left_out corrupt_frame 1", "the end of the JPEG picture is missing"),
        ("9:wrong-size", "left_out wrong_size 1", "a frame of 96 x 96 px instead of 64 x 64"),
    ];
    for (fault, told, said) in cases {
        rehearse(&town, fault, &["opened", "answer 0", told, "withdrawn end"], said);
    }
}

#[test]
fn again_is_asked_again_without_a_word() {
    let (ran, lines) = watch(&town(), &["--frames", "frames", "--rehearse", "9:again", "--rehearse", "9:again"]);
    assert_eq!(story(&lines), ["opened", "answer 0", "withdrawn end"]);
    let counters = lines.iter().find(|line| line["type"] == "counters").expect("counters");
    assert_eq!(counters["faults"]["again"], 2, "but counted: {:?}", ran.code);
}

#[test]
fn a_broken_stream_is_opened_again_and_the_answer_comes_back() {
    let town = town();
    // Of four failures in a row the first, second and fourth are told.
    let unplugged = ["lost unplugged 1", "withdrawn camera_lost", "lost unplugged 2", "lost unplugged 4"];
    let cases: [(&str, &[&str], &str); 3] = [
        ("9:io", &["lost stream_error 1", "withdrawn camera_lost"], "Input/output error"),
        ("9:busy", &["lost stream_error 1", "withdrawn camera_lost", "lost busy 2"], "another program has the camera"),
        ("9:unplugged", &unplugged, "No such device"),
    ];
    for (fault, lost, said) in cases {
        let expected = [&["opened", "answer 0"], lost, &["opened", "answer 9", "withdrawn end"]].concat();
        rehearse(&town, fault, &expected, said);
    }
}

#[test]
fn a_clock_that_jumps_is_told_and_changes_nothing() {
    let town = town();
    let expected = ["opened", "answer 0", "clock jumped", "withdrawn end"];
    rehearse(&town, "9:clock-forward", &expected, "jumped by +3600.");
    rehearse(&town, "9:clock-back", &expected, "jumped by -3599.9");
}

#[test]
fn pauses_grow_and_are_told() {
    let (_, lines) = watch(&town(), &["--frames", "frames", "--rehearse", "9:unplugged"]);
    let pauses: Vec<f64> = lines.iter().filter_map(|line| line["again_in_s"].as_f64()).collect();
    assert_eq!(pauses, [0.001, 0.002, 0.004]);
}

#[test]
fn faults_in_a_row_reopen_the_source() {
    let planned = vec!["--rehearse=9:short"; 8];
    let (ran, lines) = watch(&town(), &[&["--frames", "frames"], planned.as_slice()].concat());
    ran.succeeded();
    let expected = ["opened", "answer 0", "left_out short_frame 1", "left_out short_frame 2", "left_out short_frame 4"];
    let rest = ["lost short_frame 1", "withdrawn camera_lost", "opened", "answer 9", "withdrawn end"];
    assert_eq!(story(&lines), [&expected[..], &rest[..]].concat());
}

#[test]
fn whoever_is_slow_gets_the_newest_frames_and_the_others_are_counted() {
    let town = town();
    let picture = std::fs::read(fixture("tower-1-left.pgm")).expect("a fixture");
    let gray = &picture[picture.len() - 320 * 240..];
    let raw = ["watch", "--table", "town.daymark", "--json", "--input", "-", "--format", "y8", "--width", "320"];
    let mut command = town.command();
    command.args(raw).args(["--height", "240"]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the binary runs");
    let mut input = child.stdin.take().expect("a pipe");
    for _ in 0..300 {
        input.write_all(gray).expect("it reads");
    }
    drop(input);
    let ran = Ran::of(child.wait_with_output()).succeeded();
    let lines: Vec<Value> = ran.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let counters = lines.iter().find(|line| line["type"] == "counters").expect("counters");
    let count = |key: &str| counters[key].as_u64().expect("a count");
    assert_eq!((count("frames"), count("looked_at") + count("stale")), (300, 300));
    assert!(count("stale") > 100, "frames come faster than they are looked at: {counters}");
    assert_eq!(lines.iter().rfind(|line| line["type"] == "frame").expect("a frame")["frame"], 299, "the newest");
    assert!(story(&lines).iter().any(|line| line.starts_with("answer")));
}

#[test]
fn a_picture_that_cannot_be_read_is_left_out() {
    let town = town();
    town.write("frames/005.pgm", b"not a picture");
    let (ran, lines) = watch(&town, &["--frames", "frames"]);
    assert!(ran.succeeded().stderr.contains("005.pgm is not a picture"));
    assert_eq!(lines.iter().filter(|line| line["type"] == "frame").count(), FRAMES - 1);
}

#[test]
fn many_pictures_that_cannot_be_read_do_not_take_the_others_with_them() {
    let town = town();
    (2..11).for_each(|number| town.write(&format!("frames/{number:03}.pgm"), b"not a picture"));
    let (ran, lines) = watch(&town, &["--frames", "frames"]);
    ran.succeeded();
    assert_eq!(lines.iter().filter(|line| line["type"] == "frame").count(), FRAMES - 9);
    assert!(story(&lines).contains(&"lost corrupt_frame 1".to_owned()), "{:?}", story(&lines));
}

#[test]
fn a_camera_that_is_not_there_is_waited_for_until_it_is_asked_to_stop() {
    let town = town();
    let mut command = town.command();
    command.args(["watch", "--table", "town.daymark", "--camera", "/dev/no-such-camera", "--json"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the binary runs");
    std::thread::sleep(std::time::Duration::from_millis(1_200));
    let pid = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw).expect("a process");
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("a signal");
    let ran = Ran::of(child.wait_with_output()).succeeded();
    assert!(ran.stderr.contains("/dev/no-such-camera: open: No such file"), "{}", ran.stderr);
    assert!(
        ran.stdout.contains("\"again_in_s\":0.5") && ran.stdout.contains("\"reason\":\"stopped\""),
        "{}",
        ran.stdout
    );
}

#[test]
fn what_is_no_camera_is_refused_at_once() {
    let town = town();
    let arguments = ["watch", "--table", "town.daymark", "--camera", "/dev/null", "--output", "text:told"];
    let ran = town.run(&arguments);
    assert_eq!((ran.code, ran.stdout.as_str()), (Some(2), ""), "{ran:?}");
    assert!(ran.stderr.contains("error: /dev/null is not a camera; daymark watch --list shows"), "{ran:?}");
}
