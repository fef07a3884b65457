//! Many frames with many faults: memory stays flat, no thread stays, and no building is missed.
//!
//! The plumbing is soaked with a stub that recognizes a number written into the frame. The real recognizer is soaked by
//! `cargo test --release -p daymark --test watch_soak -- --ignored`, which takes some minutes; `SOAK_FRAMES` changes its length.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use daymark::frame::capture::{Capture, Patience};
use daymark::frame::mock::{Mishap, Mock, Planned};
use daymark::frame::{Delivery, Fault, Frame, FrameSource, Opener};
use daymark::lens_source::LensChoice;
use daymark::near::PriorArgs;
use daymark::output::record::{Record, TableFacts};
use daymark::output::target::{Sink, Target};
use daymark::output::{Form, FormName};
use daymark::picture::{GrayImage, read_gray};
use daymark::watch::counters::resident_bytes;
use daymark::watch::look::{Look, LookTimes, Recognizing, Seen};
use daymark::watch::quality::Quality;
use daymark::watch::run::{Output, Run};
use daymark::watch::session::Session;
use daymark::watch::signals::Signals;
use daymark::watch::table::{Landmark, LiveTable};
use daymark_core::matcher::ViewMatch;
use daymark_core::transform::{Homography, Shape};
use daymark_core::verdict::{Answer, FalseAnswer, NoAnswer, Recognition, Verdict};

/// Frames of each building, and of the way to the next.
const STAY: u64 = 20;

/// What frame `number` shows: building 1, nothing, building 2, nothing, ...
fn shown(number: u64) -> u8 {
    let place = number / STAY;
    if place.is_multiple_of(2) { (place / 2 % 200) as u8 + 1 } else { 0 }
}

/// Frames whose pixels are all the number of the building.
struct Numbers {
    frames: u64,
}

impl Opener for Numbers {
    fn name(&self) -> String {
        "numbers".to_owned()
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        Ok(Box::new(OpenNumbers { next: 0, frames: self.frames }))
    }

    fn delivery(&self) -> Delivery {
        Delivery::Every
    }
}

struct OpenNumbers {
    next: u64,
    frames: u64,
}

impl FrameSource for OpenNumbers {
    fn describe(&self) -> String {
        "numbers".to_owned()
    }

    fn next(&mut self, frame: &mut Frame, _: Duration) -> Result<(), Fault> {
        if self.next == self.frames {
            return Err(Fault::End);
        }
        frame.gray = GrayImage { pixels: vec![shown(self.next); 64 * 48], width: 64, height: 48 };
        frame.number = self.next;
        frame.time = Duration::from_millis(self.next * 33);
        self.next += 1;
        Ok(())
    }
}

struct Reads;

impl Look for Reads {
    fn look(&mut self, frame: GrayImage) -> Result<Seen, String> {
        let number = u32::from(frame.pixels[0]);
        let frame_from_view = Homography([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let shape = Shape { scale: 1.0, ratio: 1.0, shear: [0.0; 2] };
        let matched = ViewMatch {
            evidence: 20_000,
            corner_evidence: 20_000,
            support: 0,
            shape,
            frame_from_view,
            supporting_corners: 30,
        };
        let answer = Answer { landmark: number, view: number, matched, false_answer: FalseAnswer::at_most(1e-6) };
        let best = (number > 0).then_some(answer);
        let verdict = best.map_or(Verdict::Unknown(NoAnswer::NothingFits), Verdict::Known);
        let recognition = Recognition { verdict, best, runner_up: None, views: 200, corners: 400 };
        Ok(Seen { recognition, quality: Quality::Good, new_scene: false, observer: None, times: LookTimes::default() })
    }

    fn landmark(&self, number: u32) -> Option<Landmark> {
        Some(Landmark { name: format!("building {number}"), kind: "building", position: None })
    }

    fn number(&self, name: &str) -> Option<u32> {
        name.strip_prefix("building ")?.parse().ok()
    }

    fn facts(&self) -> TableFacts {
        let (file, table_id) = ("numbers".to_owned(), "0000000000000000".to_owned());
        TableFacts { file, table_id, profile: "handheld", landmarks: 200, views: 200 }
    }

    fn exchange(&mut self, _: LiveTable) {}

    fn forget_scene(&mut self) {}
}

/// What was told, counted; nothing piles up.
#[derive(Debug, Default)]
struct Told {
    given: BTreeMap<u64, String>,
    withdrawn: u64,
    memory: Vec<u64>,
    frames: u64,
}

struct Counting(Arc<Mutex<Told>>);

impl Form for Counting {
    fn write(&mut self, record: &Record, out: &mut Vec<u8>) {
        let mut told = self.0.lock().expect("one thread");
        match record {
            Record::Frame(frame) => {
                told.frames += 1;
                if frame.at.frame % 250 == 125 {
                    told.memory.extend(resident_bytes());
                }
            }
            Record::Answer(answer) if !answer.repeated => {
                told.given.insert(answer.at.frame, answer.landmark.clone());
            }
            Record::Withdrawn(_) => told.withdrawn += 1,
            _ => {}
        }
        // The real form works as well.
        FormName::Jsonl.make().write(record, out);
    }
}

/// Faults at one frame in `every`, all kinds in a made-up order.
fn faults(frames: u64, every: u64) -> Vec<Planned> {
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let planned = (0..frames).filter_map(|at| {
        let mishap = Mishap::ALL[(random() % Mishap::ALL.len() as u64) as usize];
        random().is_multiple_of(every).then_some(Planned { at, mishap })
    });
    planned.collect()
}

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").expect("Linux").count()
}

/// Threads and memory are the process's, so one run at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Runs to the end; what was told.
fn soak<L: Look>(opener: Box<dyn Opener>, look: L, planned: &[Planned]) -> Told {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let before = threads();
    let told = Arc::new(Mutex::new(Told::default()));
    let sink = Sink::start(Target::Path(PathBuf::from("/dev/null"), 0), true).expect("a sink");
    let run = Run {
        capture: Capture::start(Box::new(Mock::new(opener, planned)), Patience::REHEARSAL).expect("a thread"),
        session: Session::new(look, 0.01, 100.0, 2.0),
        outputs: vec![Output { form: Box::new(Counting(Arc::clone(&told))), sink }],
        signals: Signals::default(),
        reloader: None,
        stats: true,
        stats_every: None,
    };
    assert_eq!(run.run("soak".to_owned()), Ok(true));
    let until = Instant::now() + Duration::from_secs(5);
    while threads() > before && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(threads() <= before, "no thread is left: {} instead of {before}", threads());
    Arc::into_inner(told).expect("the run is over").into_inner().expect("one thread")
}

fn assert_flat(memory: &[u64]) {
    // After a tenth of the run everything that is allocated once is there.
    let (first, last) = (memory[memory.len() / 10], memory[memory.len() - 1]);
    println!("resident memory: {first} bytes early, {last} at the end");
    assert!(last <= first + (2 << 20), "{first} bytes early, {last} at the end");
}

#[test]
fn a_hundred_thousand_frames_with_faults_lose_no_answer() {
    let frames = 100_000;
    let planned = faults(frames, 40);
    assert!(planned.len() > 2_000);
    let told = soak(Box::new(Numbers { frames }), Reads, &planned);
    assert_eq!(told.frames, frames);
    // Each building is named, at its first frame; after a fault that ends an answer it is named again.
    for first in (0..frames).step_by(2 * STAY as usize) {
        let name = format!("building {}", shown(first));
        assert_eq!(told.given.get(&first), Some(&name), "at frame {first}");
    }
    assert!(told.given.iter().all(|(at, name)| *name == format!("building {}", shown(*at))));
    assert_eq!(told.withdrawn, told.given.len() as u64, "every answer is withdrawn in the end");
    assert_flat(&told.memory);
}

/// A picture, over and over.
struct Again(GrayImage, u64);

impl Opener for Again {
    fn name(&self) -> String {
        "a tower".to_owned()
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        Ok(Box::new(OpenAgain(self.0.clone(), 0, self.1)))
    }

    fn delivery(&self) -> Delivery {
        Delivery::Every
    }
}

struct OpenAgain(GrayImage, u64, u64);

impl FrameSource for OpenAgain {
    fn describe(&self) -> String {
        "a tower".to_owned()
    }

    fn next(&mut self, frame: &mut Frame, _: Duration) -> Result<(), Fault> {
        if self.1 == self.2 {
            return Err(Fault::End);
        }
        (frame.gray, frame.number, frame.time) = (self.0.clone(), self.1, Duration::from_millis(self.1 * 33));
        self.1 += 1;
        Ok(())
    }
}

#[test]
#[ignore = "some minutes: cargo test --release -p daymark --test watch_soak -- --ignored"]
fn twenty_thousand_frames_through_the_real_recognizer() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fixtures/files/tower-1-left.pgm");
    let table = folder.path().join("t.daymark");
    let mut enroll = std::process::Command::new(env!("CARGO_BIN_EXE_daymark"));
    enroll.args(["enroll", "--name", "Gate", "--no-lint", "--table"]).arg(&table).arg(&picture);
    assert!(enroll.status().expect("it runs").success());
    let table = LiveTable::load(&table).expect("a table");
    let look = Recognizing::new(table, FalseAnswer::ONE_PERCENT, LensChoice::by_picture(), PriorArgs::default(), 100.0);
    let frames = std::env::var("SOAK_FRAMES").ok().and_then(|frames| frames.parse().ok()).unwrap_or(20_000);
    let told = soak(Box::new(Again(read_gray(&picture).expect("a picture"), frames)), look, &faults(frames, 40));
    assert_eq!(told.frames, frames);
    assert!(told.given.len() as u64 > frames / 400 && told.withdrawn == told.given.len() as u64);
    assert_flat(&told.memory);
}
