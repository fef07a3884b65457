//! The story of a run: frames and tidings go in, records come out. No clock, no files, no threads; the same input gives
//! the same records.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Instant;

use daymark_core::fix::Wgs84;
use daymark_core::over_frames::{Belief, Change, EvidenceOverFrames, Withdrawal};
use daymark_core::verdict::{FalseAnswer, Verdict};

use super::counters::{Stages, resident_bytes};
use super::follow::Following;
use super::look::{Look, Seen};
use super::quality::Quality;
use super::table::{Landmark, LiveTable};
use crate::frame::Fault;
use crate::frame::Frame;
use crate::frame::queue::{SourceCounts, Tidings};
use crate::output::fix::Fix;
use crate::output::record::{
    Answer, Camera, CameraState, Candidate, Counters, LookedAt, Moment, Reason, Record, Start, TableChange, Withdrawn,
};
use crate::report::finding::bits;

/// Landmarks that are followed at once.
const TRACKS: usize = 8;
/// A standing answer is told again after this many seconds of frames' time.
const REPEAT_S: f64 = 1.0;

/// A run.
pub struct Session<L> {
    look: L,
    evidence: EvidenceOverFrames<TRACKS>,
    max_false_answer: f64,
    reach_m: f64,
    /// The standing answer's landmark, and when it was told.
    standing: Option<(Landmark, f64)>,
    following: Following,
    latest: Moment,
    looked_at: u64,
    answers: u64,
    qualities: BTreeMap<&'static str, u64>,
    stages: Stages,
}

impl<L> fmt::Debug for Session<L> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Session").finish_non_exhaustive()
    }
}

impl<L: Look> Session<L> {
    /// Before the first frame. An answer is given if it is false with a probability of at most `max_false_answer`; a
    /// landmark is recognized from `reach_m` metres at most; the observer moves with up to about `speed_m_s`.
    pub fn new(look: L, max_false_answer: f64, reach_m: f64, speed_m_s: f64) -> Self {
        Self {
            look,
            evidence: EvidenceOverFrames::new(FalseAnswer::at_most(max_false_answer)),
            max_false_answer,
            reach_m,
            standing: None,
            following: Following::new(speed_m_s),
            latest: Moment { frame: 0, time_s: 0.0, utc_s: None },
            looked_at: 0,
            answers: 0,
            qualities: BTreeMap::new(),
            stages: Stages::default(),
        }
    }

    /// The run begins.
    pub fn start(&self, source: String) -> Record {
        Record::Start(Start {
            program_version: env!("CARGO_PKG_VERSION"),
            source,
            max_false_answer: self.max_false_answer,
            reach_m: self.reach_m,
            table: self.look.facts(),
        })
    }

    /// A frame, and when it came.
    ///
    /// # Errors
    /// What makes going on useless.
    pub fn frame(&mut self, frame: Frame, arrived: Instant) -> Result<Vec<Record>, String> {
        let taken = Instant::now();
        let Frame { gray, number, time, utc, file, decode } = frame;
        let seen = self.look.look(gray)?;
        let looked = Instant::now();
        self.looked_at += 1;
        *self.qualities.entry(seen.quality.name()).or_default() += 1;
        self.latest = Moment::new(number, time, utc);

        if seen.new_scene {
            self.evidence.new_scene();
            self.following.forget();
        }
        if let (Some(sighted), Verdict::Known(answer)) = (&seen.observer, &seen.recognition.verdict) {
            self.following.seen(answer.landmark, sighted, self.latest.time_s);
        }
        let usable = seen.quality == Quality::Good || matches!(seen.recognition.verdict, Verdict::Known(_));
        let change = if usable { self.evidence.frame(&seen.recognition) } else { self.evidence.unusable() };
        let mut records = self.told(change, None);
        records.insert(0, self.looked_at(&seen, file));
        records.extend(self.repeated(&seen));

        self.stages.decode.enter(decode);
        self.stages.wait.enter(taken.saturating_duration_since(arrived));
        self.stages.prepare.enter(seen.times.prepare);
        self.stages.features.enter(seen.times.features);
        self.stages.matching.enter(seen.times.matching);
        self.stages.position.enter(seen.times.position);
        self.stages.tell.enter(looked.elapsed());
        self.stages.all.enter(arrived.elapsed() + decode);
        Ok(records)
    }

    fn looked_at(&self, seen: &Seen, file: Option<String>) -> Record {
        let best = seen.recognition.best.and_then(|best| {
            Some(Candidate {
                landmark: self.look.landmark(best.landmark)?.name,
                evidence_bits: bits(best.matched.evidence),
                probability_false_answer: best.false_answer.probability(),
            })
        });
        let belief = self.evidence.standing().and_then(|landmark| self.evidence.belief(landmark));
        Record::Frame(LookedAt {
            at: self.latest,
            file,
            quality: seen.quality,
            corners: seen.recognition.corners,
            new_scene: seen.new_scene,
            best,
            answer: self.standing.as_ref().map(|(landmark, _)| landmark.name.clone()),
            probability_false_answer: belief.map(|belief| belief.false_answer().probability()),
        })
    }

    /// The records of a change of the evidence; another reason than its own, if there is one.
    fn told(&mut self, change: Change, reason: Option<Reason>) -> Vec<Record> {
        let mut records = Vec::new();
        if let Some((_, why)) = change.withdrawn
            && let Some((landmark, _)) = self.standing.take()
        {
            let own = match why {
                Withdrawal::Replaced => Reason::Replaced,
                Withdrawal::Ambiguous => Reason::LookAlikes,
                Withdrawal::Unusable => Reason::UnusableFrames,
                _ => Reason::Gone,
            };
            let Landmark { name, position, .. } = landmark;
            let reason = reason.unwrap_or(own);
            records.push(Record::Withdrawn(Withdrawn { at: self.latest, landmark: name, position, reason }));
        }
        if let Some(belief) = change.given
            && let Some(landmark) = self.look.landmark(belief.landmark)
        {
            self.answers += 1;
            records.push(self.answer(&landmark, belief, false));
            self.standing = Some((landmark, self.latest.time_s));
        }
        records
    }

    fn repeated(&mut self, seen: &Seen) -> Option<Record> {
        let number = self.evidence.standing()?;
        let supported = seen.recognition.best.is_some_and(|best| best.landmark == number);
        let belief = self.evidence.belief(number).filter(|_| supported)?;
        let (landmark, told_s) = self.standing.as_mut()?;
        if self.latest.time_s < *told_s + REPEAT_S {
            return None;
        }
        *told_s = self.latest.time_s;
        let landmark = landmark.clone();
        Some(self.answer(&landmark, belief, true))
    }

    fn answer(&self, landmark: &Landmark, belief: Belief, repeated: bool) -> Record {
        Record::Answer(Answer {
            at: self.latest,
            landmark: landmark.name.clone(),
            kind: landmark.kind,
            probability_false_answer: belief.false_answer().probability(),
            evidence_bits: bits(belief.evidence),
            frames: belief.frames,
            position: landmark.position,
            fix: landmark.position.map(|position| {
                let place = Wgs84 {
                    latitude_deg: position.latitude_deg,
                    longitude_deg: position.longitude_deg,
                    altitude_m: 0.0,
                };
                let followed = self.following.fix(belief.landmark, place, self.latest.time_s);
                followed.map_or_else(|| Fix::near(&position, self.reach_m), |fix| Fix::of(&fix))
            }),
            repeated,
        })
    }

    /// Something about the source.
    pub fn tidings(&mut self, tidings: Tidings) -> Vec<Record> {
        let camera = |state, fault: Option<&Fault>, message, count, again_in_s| {
            Record::Camera(Camera { state, fault: fault.map(Fault::code), message, count, again_in_s })
        };
        let (record, reason) = match tidings {
            Tidings::Opened(what) => {
                self.look.forget_scene();
                self.following.forget();
                (camera(CameraState::Opened, None, what, 0, None), None)
            }
            Tidings::LeftOut { fault, in_a_row } => {
                let reason = matches!(fault, Fault::NoFrame { .. }).then_some(Reason::NoFrames);
                (camera(CameraState::LeftOut, Some(&fault), fault.to_string(), in_a_row, None), reason)
            }
            Tidings::Lost { fault, attempt, again_in } => {
                let again = Some(again_in.as_secs_f64());
                let record = camera(CameraState::Lost, Some(&fault), fault.to_string(), attempt, again);
                (record, Some(Reason::CameraLost))
            }
            Tidings::ClockJumped(seconds) => {
                let message = format!("the camera's clock jumped by {seconds:+.3} s; times go on without it");
                (camera(CameraState::ClockJumped, None, message, 1, None), None)
            }
        };
        let mut records = vec![record];
        if let Some(reason) = reason {
            let change = self.evidence.end(Withdrawal::Ended);
            records.extend(self.told(change, Some(reason)));
        }
        records
    }

    /// A new table, or why there is none.
    pub fn table(&mut self, table: Result<LiveTable, String>) -> Vec<Record> {
        let error = match table {
            Ok(table) => {
                let followed = self.followed();
                self.look.exchange(table);
                let look = &self.look;
                let change = self.evidence.renumber(|old| look.number(followed.get(&old)?));
                self.following.renumber(|old| look.number(followed.get(&old)?));
                let change = self.told(change, Some(Reason::NotInTable));
                let accepted = TableChange { table: self.look.facts(), accepted: true, error: None };
                return std::iter::once(Record::Table(accepted)).chain(change).collect();
            }
            Err(error) => error,
        };
        vec![Record::Table(TableChange { table: self.look.facts(), accepted: false, error: Some(error) })]
    }

    /// Names of the landmarks that are followed.
    fn followed(&self) -> BTreeMap<u32, String> {
        let numbers = self.evidence.followed();
        numbers.filter_map(|number| Some((number, self.look.landmark(number)?.name))).collect()
    }

    /// The run ends: a standing answer ends with it.
    pub fn end(&mut self) -> Vec<Record> {
        let change = self.evidence.end(Withdrawal::Ended);
        self.told(change, Some(Reason::End))
    }

    /// What was counted; times and memory only `in_full`, because they differ from run to run.
    pub fn counters(&self, source: SourceCounts, lost_records: u64, in_full: bool) -> Record {
        Record::Counters(Counters {
            frames: source.frames,
            looked_at: self.looked_at,
            stale: source.stale,
            missing: source.missing,
            opened: source.opened,
            clock_jumps: source.clock_jumps,
            faults: source.faults,
            qualities: self.qualities.clone(),
            answers: self.answers,
            lost_records,
            stages: in_full.then(|| self.stages.times()),
            resident_bytes: in_full.then(resident_bytes).flatten(),
        })
    }

    /// Answers given so far.
    pub const fn answers(&self) -> u64 {
        self.answers
    }

    /// What stands now, in a line.
    pub fn status(&self) -> String {
        match &self.standing {
            Some((landmark, _)) => format!("sees {}; {} frames", landmark.name, self.looked_at),
            None => format!("sees no building; {} frames", self.looked_at),
        }
    }
}
