//! A table that is exchanged while running, and the signals.

mod support;

use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use support::{Town, fixture};

/// A run over 3,000 frames of tower 1, and its lines. It waits for whoever reads them.
struct Running {
    child: Child,
    lines: std::io::Lines<BufReader<ChildStdout>>,
}

impl Running {
    fn start(town: &Town) -> Self {
        let arguments = ["watch", "--table", "town.daymark", "--frames", "frames", "--json"];
        let mut command = town.command();
        command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("the binary runs");
        let lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        Self { child, lines }
    }

    /// The next line of this type, and how many frames were looked at before it.
    fn until(&mut self, kind: &str) -> (Value, Vec<u64>) {
        let mut frames = Vec::new();
        loop {
            let line = self.lines.next().expect("the run goes on").expect("a line");
            let line: Value = serde_json::from_str(&line).expect("JSON");
            if line["type"] == kind {
                return (line, frames);
            }
            frames.extend(line["frame"].as_u64().filter(|_| line["type"] == "frame"));
        }
    }

    fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw).expect("a process");
        kill_process(pid, signal).expect("a signal");
    }

    fn stop(mut self) {
        self.signal(Signal::TERM);
        let (end, _) = self.until("end");
        assert_eq!((end["reason"].as_str(), self.child.wait().expect("it ends").code()), (Some("stopped"), Some(0)));
    }
}

fn town() -> Town {
    let town = Town::with_table();
    std::fs::create_dir(town.path("frames")).expect("a folder");
    for number in 0..3_000 {
        std::os::unix::fs::symlink(fixture("tower-1-left.pgm"), town.path(&format!("frames/{number:04}.pgm")))
            .expect("a frame");
    }
    town
}

#[test]
fn a_new_table_is_used_without_losing_a_frame_and_a_broken_one_is_not() {
    let town = town();
    let mut run = Running::start(&town);
    assert_eq!(run.until("answer").0["landmark"], "Gate");
    let (first, _) = run.until("frame");
    // Another building before it in the table, so that the Gate gets another number.
    town.tower(3, "left", "arch.pgm");
    town.run(&["enroll", "--table", "town.daymark", "--name", "Arch", "--no-lint", "arch.pgm"]).succeeded();
    let (table, mut seen) = run.until("table");
    assert_eq!((table["accepted"].as_bool(), table["table"]["landmarks"].as_u64()), (Some(true), Some(3)), "{table}");
    let (next, _) = run.until("frame");
    assert_eq!(next["answer"], "Gate", "the answer stands");
    seen.insert(0, first["frame"].as_u64().expect("a number"));
    seen.extend(next["frame"].as_u64());
    assert!(seen.windows(2).all(|pair| pair[1] == pair[0] + 1), "no frame is lost: {seen:?}");

    // Broken, by a program that does not replace it as a whole.
    let mut bytes = town.read("town.daymark");
    let good = bytes.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0xFF;
    town.write("town.daymark", &bytes);
    let (table, _) = run.until("table");
    assert_eq!((table["accepted"].as_bool(), table["table"]["landmarks"].as_u64()), (Some(false), Some(3)));
    assert!(table["error"].as_str().is_some_and(|error| error.contains("town.daymark")), "{table}");
    assert_eq!(run.until("frame").0["answer"], "Gate", "the old one stays in use");
    town.write("town.daymark", &good);
    assert_eq!(run.until("table").0["accepted"], true);

    // Without the Gate.
    town.run(&["table", "remove", "town.daymark", "Gate"]).succeeded();
    let (withdrawn, _) = run.until("withdrawn");
    assert_eq!((withdrawn["landmark"].as_str(), withdrawn["reason"].as_str()), (Some("Gate"), Some("not_in_table")));
    run.stop();
}

#[test]
fn signals_are_heeded() {
    let town = town();
    let mut run = Running::start(&town);
    run.until("frame");
    run.signal(Signal::USR1);
    let (counters, _) = run.until("counters");
    assert!(counters["resident_bytes"].as_u64().is_some_and(|bytes| bytes > 1_000_000), "{counters}");
    assert!(counters["stages"].as_array().is_some_and(|stages| stages.len() == 8), "{counters}");
    run.signal(Signal::HUP);
    assert_eq!(run.until("table").0["accepted"], true);
    std::thread::sleep(Duration::from_millis(50));
    run.stop();
}
