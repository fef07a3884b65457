//! Everything that is said about one frame.

use std::path::Path;

use daymark_core::evidence::EVIDENCE_UNIT;
use daymark_core::table::{GeoPosition, LandmarkTable, TableError};
use daymark_core::verdict::{Answer, NoAnswer, Recognition, Verdict};
use serde::Serialize;

use super::explain::Explained;
use super::phrase;
use super::position::ObserverFacts;
use crate::picture::{GrayImage, PictureError};

/// The verdict on a frame, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum VerdictName {
    /// One building, surely enough.
    Known,
    /// Two buildings that fit about equally well.
    Ambiguous,
    /// None.
    Unknown,
    /// The file could not be read.
    Unreadable,
}

impl VerdictName {
    /// The name in capitals, for a line of text.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Known => "KNOWN",
            Self::Ambiguous => "AMBIGUOUS",
            Self::Unknown => "UNKNOWN",
            Self::Unreadable => "UNREADABLE",
        }
    }
}

/// Why there is no single answer, and what to try.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reason {
    /// A name that programs may rely on.
    pub code: &'static str,
    /// What is the matter, in plain words.
    pub message: String,
    /// What to try.
    pub advice: String,
}

/// Where a landmark stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Position {
    /// Degrees north.
    pub latitude_deg: f64,
    /// Degrees east.
    pub longitude_deg: f64,
    /// The true place lies within this.
    pub error_m: f64,
}

impl From<GeoPosition> for Position {
    fn from(at: GeoPosition) -> Self {
        let place = at.wgs84();
        Self { latitude_deg: place.latitude_deg, longitude_deg: place.longitude_deg, error_m: at.error_m() }
    }
}

/// A landmark with its best view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Its name.
    pub landmark: String,
    /// What sort of thing it is.
    pub kind: &'static str,
    /// Where it stands, if the table says.
    pub position: Option<Position>,
    /// The number of its best view in the table.
    pub view: u32,
    /// Evidence for that view.
    pub evidence_bits: f64,
    /// The probability that an answer on this evidence is false.
    pub probability_false_answer: f64,
    /// Stored corners with evidence in favour.
    pub supporting_corners: u16,
    /// The map of the stored view to the frame, row by row, pixels to pixels.
    pub frame_from_view_px: [[f32; 3]; 3],
}

/// Where the time went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Times {
    /// Reading, decoding and shrinking the file.
    pub read_ms: f64,
    /// Finding corners and describing them.
    pub features_ms: f64,
    /// Comparing with every view of the table.
    pub matching_ms: f64,
    /// Finding out where the observer stands.
    pub position_ms: f64,
}

/// Everything that is said about one frame; serialized, it is its part of the JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The frame's file as it was named.
    pub file: String,
    /// The verdict.
    pub verdict: VerdictName,
    /// The building, if known.
    pub landmark: Option<String>,
    /// The probability that this is false, if known.
    pub probability_false_answer: Option<f64>,
    /// Why there is no single answer.
    pub reason: Option<Reason>,
    /// The landmark with the most evidence, answer or not.
    pub best: Option<Candidate>,
    /// The landmark after it.
    pub runner_up: Option<Candidate>,
    /// Columns of the frame as it was compared.
    pub width_px: usize,
    /// Rows of the frame as it was compared.
    pub height_px: usize,
    /// Corners of the frame.
    pub corners: usize,
    /// Views that the frame was compared with.
    pub views_compared: u32,
    /// Where the observer stands, if the landmark is known.
    pub observer: Option<ObserverFacts>,
    /// Where the time went.
    pub times: Option<Times>,
    /// What each stored corner said, if it was asked.
    pub explanation: Option<Explained>,
    /// The picture of the finding, if it was asked for.
    pub overlay_file: Option<String>,
    /// The plan of building and observer, if it was asked for and there is a position.
    pub map_file: Option<String>,
}

impl Candidate {
    fn of(table: &LandmarkTable<'_>, answer: &Answer) -> Result<Self, TableError> {
        let landmark = table.landmark(answer.landmark)?;
        Ok(Self {
            landmark: landmark.name.to_owned(),
            kind: landmark.kind.name(),
            position: landmark.position.map(Position::from),
            view: answer.view,
            evidence_bits: bits(answer.matched.evidence),
            probability_false_answer: answer.false_answer.probability(),
            supporting_corners: answer.matched.supporting_corners,
            frame_from_view_px: answer.matched.frame_from_view.0,
        })
    }
}

/// Evidence in bits.
pub fn bits(evidence: i32) -> f64 {
    f64::from(evidence) / f64::from(EVIDENCE_UNIT)
}

impl Finding {
    /// What a recognition says about the frame in `file`.
    ///
    /// # Errors
    /// A landmark's record that cannot be read; not after the table was opened.
    pub fn new(
        file: &Path,
        frame: &GrayImage,
        recognition: &Recognition,
        table: &LandmarkTable<'_>,
    ) -> Result<Self, TableError> {
        let candidate = |answer: Option<Answer>| answer.map(|answer| Candidate::of(table, &answer)).transpose();
        let (best, runner_up) = (candidate(recognition.best)?, candidate(recognition.runner_up)?);
        let (verdict, reason) = match &recognition.verdict {
            Verdict::Known(_) => (VerdictName::Known, None),
            Verdict::Ambiguous(..) => (VerdictName::Ambiguous, Some(look_alikes(best.as_ref(), runner_up.as_ref()))),
            Verdict::Unknown(why) => (VerdictName::Unknown, Some(no_answer(why, best.as_ref(), frame))),
        };
        let answer = best.as_ref().filter(|_| verdict == VerdictName::Known);
        Ok(Self {
            file: file.to_string_lossy().into_owned(),
            verdict,
            landmark: answer.map(|answer| answer.landmark.clone()),
            probability_false_answer: answer.map(|answer| answer.probability_false_answer),
            reason,
            best,
            runner_up,
            width_px: frame.width,
            height_px: frame.height,
            corners: recognition.corners,
            views_compared: recognition.views,
            observer: None,
            times: None,
            explanation: None,
            overlay_file: None,
            map_file: None,
        })
    }

    /// What is said about a file that cannot be read.
    pub fn unreadable(error: &PictureError) -> Self {
        Self {
            file: error.path.to_string_lossy().into_owned(),
            verdict: VerdictName::Unreadable,
            landmark: None,
            probability_false_answer: None,
            reason: Some(Reason {
                code: "unreadable",
                message: error.to_string(),
                advice: "correct or leave out this file; the others were compared".to_owned(),
            }),
            best: None,
            runner_up: None,
            width_px: 0,
            height_px: 0,
            corners: 0,
            views_compared: 0,
            observer: None,
            times: None,
            explanation: None,
            overlay_file: None,
            map_file: None,
        }
    }
}

fn look_alikes(best: Option<&Candidate>, other: Option<&Candidate>) -> Reason {
    let name = |candidate: Option<&Candidate>| candidate.map_or("?", |candidate| &candidate.landmark).to_owned();
    Reason {
        code: "look_alikes",
        message: format!("{} and {} fit about equally well", name(best), name(other)),
        advice: "show more of what only one of them has; if they are one building, enroll both under one name"
            .to_owned(),
    }
}

fn no_answer(why: &NoAnswer, best: Option<&Candidate>, frame: &GrayImage) -> Reason {
    let reason = |code, message: String, advice: &str| Reason { code, message, advice: advice.to_owned() };
    match why {
        NoAnswer::EmptyTable => reason(
            "empty_table",
            "the table has no buildings".to_owned(),
            "enroll some: daymark enroll --table TABLE --name NAME PICTURES...",
        ),
        NoAnswer::TooFewCorners { found, needed } => {
            let (cause, advice) = too_few(frame);
            let found = phrase::count(*found, "corner");
            reason("too_few_corners", format!("{found} found, and {needed} are needed: the frame is {cause}"), advice)
        }
        NoAnswer::NothingFits => reason(
            "nothing_fits",
            "no stored view fits the frame anywhere".to_owned(),
            "if the building is in the table, stand where the enrolled pictures were taken and let it fill the frame",
        ),
        NoAnswer::NotSure(_) => {
            let guess = best.map_or(String::new(), |best| {
                let p = phrase::probability(best.probability_false_answer);
                format!("{} fits best, but would be false with a probability of {p}", best.landmark)
            });
            reason(
                "not_sure",
                guess,
                "if it is that building, come nearer, take it more from the front, or enroll a picture from this side",
            )
        }
        _ => reason("other", "there is no answer".to_owned(), "try another frame"),
    }
}

/// Why a frame has few corners, from its gray levels, and what helps.
fn too_few(frame: &GrayImage) -> (&'static str, &'static str) {
    let count = frame.pixels.len().max(1) as u64;
    let mean = frame.pixels.iter().map(|&gray| u64::from(gray)).sum::<u64>() / count;
    let spread = frame.pixels.iter().map(|&gray| u64::from(gray).abs_diff(mean)).sum::<u64>() / count;
    match (mean, spread) {
        (..24, _) => ("too dark", "take it in more light or with a longer exposure"),
        (232.., _) => ("overexposed", "take it with a shorter exposure"),
        (_, ..4) => ("empty or covered", "see that nothing covers the lens, and point it at a building"),
        _ => ("too blurred or too plain", "hold still, focus, and let a building fill the frame"),
    }
}
