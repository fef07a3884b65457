//! What there is to tell, one thing at a time. `docs/watch.schema.json` specifies the JSON.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use super::fix::Fix;
use crate::report::finding::Position;
use crate::watch::quality::Quality;

/// One thing to tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Record {
    /// A run begins.
    Start(Start),
    /// A frame was looked at.
    Frame(LookedAt),
    /// An answer is given. It stands until it is withdrawn.
    Answer(Answer),
    /// An answer does not hold any more.
    Withdrawn(Withdrawn),
    /// Something about the source of frames.
    Camera(Camera),
    /// The table was changed while running.
    Table(TableChange),
    /// What was counted so far.
    Counters(Counters),
    /// The run ends.
    End(End),
}

/// A run begins.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Start {
    /// Version of the program.
    pub program_version: &'static str,
    /// Where frames come from, as the user named it.
    pub source: String,
    /// An answer is given if it is false with at most this probability.
    pub max_false_answer: f64,
    /// A landmark is recognized from this far at most.
    pub reach_m: f64,
    /// The table.
    pub table: TableFacts,
}

/// Which table is in use.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TableFacts {
    /// Its file.
    pub file: String,
    /// Its identity, hexadecimal.
    pub table_id: String,
    /// The class of device whose views it holds.
    pub profile: &'static str,
    /// Landmarks in it.
    pub landmarks: u32,
    /// Views in it.
    pub views: u32,
}

/// When a frame was taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// The frame's number in its source's count.
    pub frame: u64,
    /// Seconds since the first frame of the run, by a clock that never jumps.
    pub time_s: f64,
    /// Seconds since 1970 UTC; null if the frames are a recording.
    pub utc_s: Option<f64>,
}

impl Moment {
    /// A moment, to the microsecond.
    pub fn new(frame: u64, time: Duration, utc: Option<Duration>) -> Self {
        let seconds = |time: Duration| time.as_micros() as f64 / 1e6;
        Self { frame, time_s: seconds(time), utc_s: utc.map(seconds) }
    }
}

/// A frame was looked at.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LookedAt {
    /// When.
    #[serde(flatten)]
    pub at: Moment,
    /// The frame's file, if it is one.
    pub file: Option<String>,
    /// Whether the picture is good for anything.
    pub quality: Quality,
    /// Corners that were found.
    pub corners: usize,
    /// Another scene than that of the frame before.
    pub new_scene: bool,
    /// The landmark that this frame alone fits best.
    pub best: Option<Candidate>,
    /// The landmark of the standing answer.
    pub answer: Option<String>,
    /// The probability that it is false, by the frames so far.
    pub probability_false_answer: Option<f64>,
}

/// A landmark that a frame fits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Its name.
    pub landmark: String,
    /// Evidence of this frame for it.
    pub evidence_bits: f64,
    /// The probability that an answer on this frame alone is false.
    pub probability_false_answer: f64,
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// When.
    #[serde(flatten)]
    pub at: Moment,
    /// The landmark's name.
    pub landmark: String,
    /// What sort of thing it is.
    pub kind: &'static str,
    /// The probability that it is false.
    pub probability_false_answer: f64,
    /// Evidence over the frames.
    pub evidence_bits: f64,
    /// Frames that it is from.
    pub frames: u8,
    /// Where the landmark stands.
    pub position: Option<Position>,
    /// Where the observer is.
    pub fix: Option<Fix>,
    /// False for the first time; true if it stood already and is only repeated.
    pub repeated: bool,
}

/// An answer does not hold any more.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Withdrawn {
    /// When.
    #[serde(flatten)]
    pub at: Moment,
    /// The landmark's name.
    pub landmark: String,
    /// Where it stands.
    pub position: Option<Position>,
    /// Why.
    pub reason: Reason,
}

/// Why an answer does not hold any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The frames do not show it any more.
    Gone,
    /// Another one is seen instead.
    Replaced,
    /// Another one fits about as well.
    LookAlikes,
    /// The frames show nothing usable.
    UnusableFrames,
    /// No frame comes.
    NoFrames,
    /// The camera is lost.
    CameraLost,
    /// It is not in the new table.
    NotInTable,
    /// The run ends.
    End,
}

/// Something about the source of frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Camera {
    /// What happened.
    pub state: CameraState,
    /// A name of the fault, for programs.
    pub fault: Option<&'static str>,
    /// What it is, in words.
    pub message: String,
    /// Frames left out in a row, or failures since the last good frame.
    pub count: u32,
    /// Pause before the next attempt.
    pub again_in_s: Option<f64>,
}

/// What happened to the source of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraState {
    /// It was opened.
    Opened,
    /// A frame was left out.
    LeftOut,
    /// It failed and will be opened again.
    Lost,
    /// Its clock jumped.
    ClockJumped,
}

/// The table was changed while running.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TableChange {
    /// The table in use from now on.
    pub table: TableFacts,
    /// Whether it is the new one.
    pub accepted: bool,
    /// Why the new one is not used.
    pub error: Option<String>,
}

/// What was counted so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Counters {
    /// Frames that came whole.
    pub frames: u64,
    /// Frames that were looked at.
    pub looked_at: u64,
    /// Frames that nobody looked at, because a newer one came.
    pub stale: u64,
    /// Frames that the source's own numbers show to be missing.
    pub missing: u64,
    /// How often the source was opened.
    pub opened: u64,
    /// Jumps of its clock.
    pub clock_jumps: u64,
    /// Faults by name.
    pub faults: BTreeMap<&'static str, u64>,
    /// Frames by quality.
    pub qualities: BTreeMap<&'static str, u64>,
    /// Answers given.
    pub answers: u64,
    /// Records that an output was too slow for.
    pub lost_records: u64,
    /// Where the time went, by stage; null unless it was asked for, because it differs from run to run.
    pub stages: Option<Vec<StageTimes>>,
    /// Resident memory; null unless it was asked for.
    pub resident_bytes: Option<u64>,
}

/// How long a stage takes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTimes {
    /// The stage.
    pub stage: &'static str,
    /// How often it was timed.
    pub count: u64,
    /// Half of the times are at most this.
    pub p50_ms: f64,
    /// 99 of 100 times are at most this.
    pub p99_ms: f64,
    /// The longest.
    pub max_ms: f64,
}

/// The run ends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct End {
    /// Why.
    pub reason: EndReason,
    /// What went wrong, if anything did.
    pub error: Option<String>,
}

/// Why a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// No more frames.
    NoMoreFrames,
    /// It was asked to stop.
    Stopped,
    /// It cannot go on.
    Failed,
}
