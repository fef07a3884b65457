//! Evidence over the frames of a camera: when an answer may be given, and when it must be withdrawn.
//!
//! **One frame.** A frame says of a landmark how often chance alone fits a view this well: `p`, the probability of a
//! false answer ([`FalseAnswer`]). `p` becomes odds by the calibrator `k p^(k-1)` with `k = 1/8` (V. Vovk, R. Wang,
//! "E-values: calibration, combination, and applications", Annals of Statistics 49, 2021): for wrong landmarks these odds
//! are 1 on average at most, whatever the frame, so that they may be added up frame after frame without the limit being
//! passed more often for looking more often. In bits, with `s = -log2 p`,
//!
//! ```text
//!   bits of a frame = 7/8 min(s, 24) - 3          3 bits against, if nothing speaks for the landmark
//! ```
//!
//! 24 bits are the cap, because nothing that far out was ever measured.
//!
//! **Several frames.** Frames of a video show the same bricks: what fits by chance in one fits in the next. The sum is
//! therefore divided by the design effect of samples with correlation `r` (L. Kish, "Survey Sampling", 1965):
//!
//! ```text
//!   evidence = sum of bits / (1 + (n - 1) r)      r = 1/2, over the latest n <= 8 frames
//! ```
//!
//! One frame counts in full, eight as 16/9 of one. If the frames are copies of each other, a limit of 1 in 100 is passed
//! only by a landmark with `p < 1/207` in each of them, so that the promise holds even then; it does down to a limit of
//! 1 in 770. Below, it rests on frames that differ.
//!
//! **Withdrawal.** The change from "it is there" to "it is gone" is found by Page's cumulative sum (E. S. Page,
//! "Continuous inspection schemes", Biometrika 41, 1954): the bits against the answer since its best moment. At
//! [`WITHDRAWN_AT`], three frames without any support, the answer is withdrawn.
//!
//! All of it is integers in 1/160 bit. Memory: 44 bytes a landmark that is followed.

use crate::evidence::EVIDENCE_UNIT;
use crate::verdict::{Answer, FalseAnswer, Recognition, Verdict};

/// Frames that evidence is taken from, at most.
pub const WINDOW: usize = 8;
/// Evidence against a standing answer at which it is withdrawn: 9 bits, three frames without support.
pub const WITHDRAWN_AT: i32 = 9 * EVIDENCE_UNIT;
/// Frames in a row that show nothing usable, after which an answer is withdrawn.
pub const UNUSABLE_LIMIT: u8 = 5;
/// What a frame says at most, before the calibrator.
const CAP: i32 = 24 * EVIDENCE_UNIT;
/// `-log2 k` of the calibrator.
const PRICE: i32 = 3 * EVIDENCE_UNIT;
/// Two landmarks with evidence as close as this are not told apart, as long as the latest frame speaks for both.
const AMBIGUOUS_WITHIN: i32 = 10 * EVIDENCE_UNIT;

/// What the frames so far say of one landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Belief {
    /// Number of the landmark in the table.
    pub landmark: u32,
    /// Evidence over the frames, in 1/160 bit.
    pub evidence: i32,
    /// Frames that the evidence is from.
    pub frames: u8,
}

impl Belief {
    /// The probability that an answer on this evidence is false.
    pub const fn false_answer(&self) -> FalseAnswer {
        FalseAnswer::of_surprise(self.evidence)
    }
}

/// Why an answer is withdrawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Withdrawal {
    /// The frames do not show it any more.
    Gone,
    /// Another landmark is seen instead.
    Replaced,
    /// Another landmark fits about as well.
    Ambiguous,
    /// The frames show nothing that can be used.
    Unusable,
    /// The caller ended it: the camera was lost, or the landmark is not in the table any more.
    Ended,
}

/// What a frame changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Change {
    /// The landmark whose answer is withdrawn, and why.
    pub withdrawn: Option<(u32, Withdrawal)>,
    /// The answer that is given.
    pub given: Option<Belief>,
}

/// Follows up to `TRACKS` landmarks at once; of more, those with the most evidence.
#[derive(Debug, Clone)]
pub struct EvidenceOverFrames<const TRACKS: usize> {
    limit: FalseAnswer,
    tracks: [Option<Track>; TRACKS],
    standing: Option<Standing>,
}

#[derive(Debug, Clone, Copy)]
struct Standing {
    landmark: u32,
    against: i32,
    unusable: u8,
}

#[derive(Debug, Clone, Copy)]
struct Track {
    landmark: u32,
    bits: [i32; WINDOW],
    next: u8,
    frames: u8,
    /// The latest frame speaks for it.
    supported: bool,
}

impl Track {
    const fn new(landmark: u32) -> Self {
        Self { landmark, bits: [0; WINDOW], next: 0, frames: 0, supported: false }
    }

    fn enter(&mut self, bits: i32) {
        self.supported = bits > 0;
        if let Some(slot) = self.bits.get_mut(usize::from(self.next)) {
            *slot = bits;
        }
        self.next = (self.next + 1) % WINDOW as u8;
        self.frames = (self.frames + 1).min(WINDOW as u8);
    }

    fn evidence(&self) -> i32 {
        // The slots that are not used yet hold 0. With r = 1/2: sum / ((n + 1) / 2).
        2 * self.bits.iter().sum::<i32>() / (i32::from(self.frames) + 1)
    }

    fn belief(&self) -> Belief {
        Belief { landmark: self.landmark, evidence: self.evidence(), frames: self.frames }
    }
}

/// The bits that a frame says for a landmark with this surprise; 0 surprise is no support.
fn bits_of(surprise: i32) -> i32 {
    surprise.clamp(0, CAP) * 7 / 8 - PRICE
}

impl<const TRACKS: usize> EvidenceOverFrames<TRACKS> {
    /// Nothing seen yet. An answer is given when it is false with a probability of at most `limit`.
    ///
    /// No evidence passes 32 bits, so a limit below 2.4e-10 is never met.
    pub const fn new(limit: FalseAnswer) -> Self {
        Self { limit, tracks: [None; TRACKS], standing: None }
    }

    /// The landmark of the standing answer.
    pub fn standing(&self) -> Option<u32> {
        self.standing.map(|standing| standing.landmark)
    }

    /// What the frames say of a landmark that is followed.
    pub fn belief(&self, landmark: u32) -> Option<Belief> {
        self.tracks.iter().flatten().find(|track| track.landmark == landmark).map(Track::belief)
    }

    /// The landmarks that are followed.
    pub fn followed(&self) -> impl Iterator<Item = u32> {
        self.tracks.iter().flatten().map(|track| track.landmark).chain(self.standing())
    }

    /// The landmark with the most evidence; of equals, the smaller number.
    pub fn best(&self) -> Option<Belief> {
        let better = |a: Belief, b: Belief| (b.evidence, a.landmark) > (a.evidence, b.landmark);
        self.tracks.iter().flatten().map(Track::belief).reduce(|a, b| if better(a, b) { b } else { a })
    }

    /// Enters a frame that could be compared with the table.
    pub fn frame(&mut self, recognition: &Recognition) -> Change {
        let supported = supported(recognition);
        for answer in supported.into_iter().flatten() {
            self.follow(answer);
        }
        let surprise = |landmark| {
            let of_landmark = supported.iter().flatten().find(|answer| answer.landmark == landmark);
            of_landmark.map_or(0, |answer| answer.false_answer.surprise())
        };
        for slot in &mut self.tracks {
            if let Some(track) = slot {
                track.enter(bits_of(surprise(track.landmark)));
                if track.evidence() <= 0 {
                    *slot = None;
                }
            }
        }
        if let Some(standing) = &mut self.standing {
            standing.unusable = 0;
            standing.against = (standing.against - bits_of(surprise(standing.landmark))).max(0);
        }
        self.decide()
    }

    /// Enters a frame that shows nothing usable: too dark, blurred or blown out. It says nothing for or against.
    pub fn unusable(&mut self) -> Change {
        let Some(standing) = &mut self.standing else { return Change::default() };
        standing.unusable = standing.unusable.saturating_add(1);
        if standing.unusable < UNUSABLE_LIMIT {
            return Change::default();
        }
        self.end(Withdrawal::Unusable)
    }

    /// The next frame is of another scene: what the earlier ones said does not count any more. A standing answer
    /// stays if that frame supports it.
    pub fn new_scene(&mut self) {
        self.tracks = [None; TRACKS];
        if let Some(standing) = &mut self.standing {
            standing.against = WITHDRAWN_AT - 1;
        }
    }

    /// Forgets everything, as when the camera is lost.
    pub fn end(&mut self, why: Withdrawal) -> Change {
        self.tracks = [None; TRACKS];
        Change { withdrawn: self.standing.take().map(|standing| (standing.landmark, why)), given: None }
    }

    /// The table was exchanged: `new_number` gives a landmark's number in the new one, if it is still there.
    pub fn renumber(&mut self, new_number: impl Fn(u32) -> Option<u32>) -> Change {
        for slot in &mut self.tracks {
            *slot = slot.and_then(|track| Some(Track { landmark: new_number(track.landmark)?, ..track }));
        }
        let Some(standing) = self.standing.take() else { return Change::default() };
        match new_number(standing.landmark) {
            Some(landmark) => {
                self.standing = Some(Standing { landmark, ..standing });
                Change::default()
            }
            None => Change { withdrawn: Some((standing.landmark, Withdrawal::Ended)), given: None },
        }
    }

    /// Starts to follow a landmark that a frame supports. If all places are taken, the one with the least evidence
    /// goes, unless it is the standing answer's; of equals, the first.
    fn follow(&mut self, answer: &Answer) {
        if bits_of(answer.false_answer.surprise()) <= 0 || self.belief(answer.landmark).is_some() {
            return;
        }
        let standing = self.standing();
        let free = |slot: &&mut Option<Track>| !slot.is_some_and(|track| Some(track.landmark) == standing);
        let rank = |slot: &Option<Track>| slot.map_or(i32::MIN, |track| track.evidence());
        if let Some(slot) = self.tracks.iter_mut().filter(free).min_by_key(|slot| rank(slot)) {
            *slot = Some(Track::new(answer.landmark));
        }
    }

    fn decide(&mut self) -> Change {
        let passes = |belief: &Belief| belief.evidence > 0 && belief.false_answer() <= self.limit;
        let best = self.best().filter(passes);
        let rival = best.is_some_and(|best| {
            let others =
                self.tracks.iter().flatten().filter(|other| other.supported && other.landmark != best.landmark);
            others.map(Track::belief).filter(passes).any(|other| best.evidence - other.evidence < AMBIGUOUS_WITHIN)
        });
        let end = |withdrawn, given: Option<Belief>| Change { withdrawn, given };
        match (self.standing, best) {
            (Some(standing), Some(best)) if standing.landmark == best.landmark && rival => {
                self.standing = None;
                end(Some((standing.landmark, Withdrawal::Ambiguous)), None)
            }
            (Some(standing), Some(best)) if standing.landmark != best.landmark && standing.against > 0 && !rival => {
                self.standing = Some(Standing { landmark: best.landmark, against: 0, unusable: 0 });
                end(Some((standing.landmark, Withdrawal::Replaced)), Some(best))
            }
            (Some(standing), _) if standing.against >= WITHDRAWN_AT => {
                self.standing = None;
                self.drop_track(standing.landmark);
                end(Some((standing.landmark, Withdrawal::Gone)), None)
            }
            (None, Some(best)) if !rival => {
                self.standing = Some(Standing { landmark: best.landmark, against: 0, unusable: 0 });
                end(None, Some(best))
            }
            _ => Change::default(),
        }
    }

    fn drop_track(&mut self, landmark: u32) {
        for slot in &mut self.tracks {
            if slot.is_some_and(|track| track.landmark == landmark) {
                *slot = None;
            }
        }
    }
}

/// The landmarks that a frame supports: the best, and the runner-up only where the frame does not tell them apart. A
/// frame that fits one of two by 10 bits more speaks against the other.
fn supported(recognition: &Recognition) -> [Option<&Answer>; 2] {
    let best = recognition.best.as_ref();
    let runner_up = match (&recognition.verdict, best, recognition.runner_up.as_ref()) {
        (Verdict::Ambiguous(..), _, runner_up) => runner_up,
        (_, Some(best), Some(other)) => {
            Some(other).filter(|other| best.matched.evidence.saturating_sub(other.matched.evidence) < AMBIGUOUS_WITHIN)
        }
        _ => None,
    };
    [best, runner_up]
}
