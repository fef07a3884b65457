//! Recognizes a frame's features from the same table twice: in place and streamed.

use daymark_core::capacity::HandheldRecognizer;
use daymark_core::extract::Features;
use daymark_core::kernel::Portable;
use daymark_core::over_frames::{EvidenceOverFrames, Withdrawal};
use daymark_core::table::{HEADER_BYTES, Header, LandmarkTable, TableStream, ViewSource};
use daymark_core::verdict::{FalseAnswer, Recognition, Verdict};

use crate::MEMORY;
use crate::device::{Device, Flash};
use crate::outcome::{Failure, Outcome};

/// Shows both answers and compares them.
#[inline(never)]
pub fn recognize(features: Features<'_>, device: &mut Device) -> Result<Outcome, Failure> {
    let flash = device.table();
    // SAFETY: nothing is written to the table in this function.
    let header = Header::decode(unsafe { flash.in_place(HEADER_BYTES) })?;
    let length = header.file_length() as usize;
    let explained = from_place(features, flash, length, device.answer(0))?;
    let name_bytes = from_stream(features, flash, length, device.answer(1))?;
    let known = device.answer(0).is_some_and(|answer| matches!(answer.verdict, Verdict::Known(_)));
    let same = device.answers_agree();
    let known = known && device.answer(0).is_some_and(|answer| stands(&answer));
    Ok(Outcome { known, same, corners: features.len(), explained, name_bytes })
}

/// Whether the answer stands when a camera shows the frame twice, another scene, and nothing usable in between.
#[inline(never)]
fn stands(recognition: &Recognition) -> bool {
    let mut evidence = const { EvidenceOverFrames::<4>::new(FalseAnswer::ONE_PERCENT) };
    let given = evidence.frame(recognition).given;
    evidence.unusable();
    evidence.new_scene();
    evidence.frame(recognition);
    evidence.renumber(|number| number.checked_add(1));
    let moved = evidence.standing();
    evidence.end(Withdrawal::Ended);
    given.is_some_and(|belief| belief.landmark.checked_add(1) == moved) && evidence.best().is_none()
}

/// The distances and the recognizer live during this call only.
#[inline(never)]
fn from_place(
    features: Features<'_>,
    flash: Flash,
    length: usize,
    answer: &mut Option<Recognition>,
) -> Result<usize, Failure> {
    let mut distances = [0; MEMORY.distances];
    let mut recognizer = const { HandheldRecognizer::new() };
    // SAFETY: nothing is written to the table in this function.
    let mut table = LandmarkTable::open(unsafe { flash.in_place(length) })?.verified()?;
    let limit = FalseAnswer::ONE_PERCENT;
    let recognition =
        answer.insert(recognizer.recognize(&Portable, features, &mut table, &mut distances, &mut [], limit)?);
    let Some(best) = recognition.best else { return Ok(0) };
    let view = table.view(best.view)?;
    let explained =
        recognizer.explain(&Portable, features, &view, &mut distances).map_or(0, |(_, corners)| corners.len());
    Ok(explained)
}

/// With the buffer of one record in addition.
#[inline(never)]
fn from_stream(
    features: Features<'_>,
    flash: Flash,
    length: usize,
    answer: &mut Option<Recognition>,
) -> Result<usize, Failure> {
    let mut distances = [0; MEMORY.distances];
    let mut record = [0; MEMORY.record];
    let mut recognizer = const { HandheldRecognizer::new() };
    let mut table = TableStream::open(flash.stream(length))?;
    table.verify(&mut record)?;
    let limit = FalseAnswer::ONE_PERCENT;
    let recognition =
        answer.insert(recognizer.recognize(&Portable, features, &mut table, &mut distances, &mut record, limit)?);
    let Some(best) = recognition.best else { return Ok(0) };
    let landmark = ViewSource::landmark(&mut table, best.landmark, &mut record)?;
    Ok(landmark.name.len())
}
