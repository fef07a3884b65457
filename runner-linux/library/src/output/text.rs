//! Text for a person: what is seen, when that changes, and why nothing is.

use std::fmt::Write as _;

use super::Form;
use super::fix::FixMethod;
use super::record::{Answer, CameraState, Counters, EndReason, Moment, Reason, Record};
use crate::report::phrase::{count, grouped, printable, probability};
use crate::watch::quality::Quality;

/// Text for a person.
#[derive(Debug, Clone, Default)]
pub struct Text {
    told: Option<Quality>,
}

impl Form for Text {
    fn write(&mut self, record: &Record, out: &mut Vec<u8>) {
        let mut line = String::new();
        // Writing to a string cannot fail.
        let _ = match record {
            Record::Start(start) => writeln!(
                line,
                "looking for {} in {}; false answers: {} at most",
                count(start.table.landmarks as usize, "building"),
                printable(&start.source),
                probability(start.max_false_answer)
            ),
            Record::Frame(frame) if self.told.replace(frame.quality).unwrap_or(Quality::Good) != frame.quality => {
                match frame.quality {
                    Quality::Good => writeln!(line, "{}  the picture is good again", clock(frame.at)),
                    quality => writeln!(line, "{}  {}: {}", clock(frame.at), quality.phrase(), quality.advice()),
                }
            }
            Record::Answer(answer) if !answer.repeated => write_answer(&mut line, answer),
            Record::Withdrawn(end) => {
                writeln!(line, "{}  {}: {}", clock(end.at), printable(&end.landmark), why(end.reason))
            }
            Record::Camera(camera) if camera.state == CameraState::Opened => {
                writeln!(line, "camera: {}", printable(&camera.message))
            }
            Record::Counters(counters) => write_counters(&mut line, counters),
            Record::End(end) => match end.reason {
                EndReason::NoMoreFrames => writeln!(line, "no more frames"),
                EndReason::Stopped => writeln!(line, "stopped"),
                EndReason::Failed => Ok(()),
            },
            // Faults and tables go to the log.
            _ => Ok(()),
        };
        out.extend_from_slice(line.as_bytes());
    }
}

fn clock(at: Moment) -> String {
    let whole = at.time_s as u64;
    format!("{:02}:{:02}:{:05.2}", whole / 3_600, whole / 60 % 60, at.time_s - (whole / 60 * 60) as f64)
}

fn write_answer(line: &mut String, answer: &Answer) -> std::fmt::Result {
    write!(line, "{}  {} ({})", clock(answer.at), printable(&answer.landmark), answer.kind)?;
    let frames = count(usize::from(answer.frames), "frame");
    write!(line, ": false with a probability of {}, by {frames}", probability(answer.probability_false_answer))?;
    if let Some(at) = &answer.position {
        write!(line, "; it stands at {:.6}, {:.6}", at.latitude_deg, at.longitude_deg)?;
    }
    if let Some(fix) = answer.fix.filter(|fix| fix.method != FixMethod::NearLandmark) {
        let within = fix.radius_95_m;
        write!(line, "; you are at {:.6}, {:.6} within {within:.1} m", fix.latitude_deg, fix.longitude_deg)?;
    }
    writeln!(line)
}

const fn why(reason: Reason) -> &'static str {
    match reason {
        Reason::Gone => "not seen any more",
        Reason::Replaced => "something else is seen instead",
        Reason::LookAlikes => "withdrawn, another building fits about as well",
        Reason::UnusableFrames => "withdrawn, the frames show nothing usable",
        Reason::NoFrames => "withdrawn, no frames come",
        Reason::CameraLost => "withdrawn, the camera is lost",
        Reason::NotInTable => "withdrawn, the new table does not have it",
        Reason::End => "withdrawn, the run ends",
    }
}

fn write_counters(line: &mut String, counters: &Counters) -> std::fmt::Result {
    let Counters { frames, looked_at, stale, missing, opened, .. } = counters;
    writeln!(
        line,
        "{} frames came, {} looked at, {} dropped for a newer one, {} lost before; source opened {}",
        grouped(*frames),
        grouped(*looked_at),
        grouped(*stale),
        grouped(*missing),
        count(*opened as usize, "time")
    )?;
    let list = |names: &std::collections::BTreeMap<&'static str, u64>| {
        names.iter().map(|(name, count)| format!("{name} {}", grouped(*count))).collect::<Vec<_>>().join(", ")
    };
    if !counters.faults.is_empty() {
        writeln!(line, "faults: {}", list(&counters.faults))?;
    }
    writeln!(line, "pictures: {}; {}", list(&counters.qualities), count(counters.answers as usize, "answer"))?;
    if let Some(stages) = &counters.stages {
        writeln!(line, "{:<24}{:>10}{:>10}{:>10}{:>10}", "stage, ms", "count", "p50", "p99", "longest")?;
        for stage in stages {
            let (p50, p99, max) = (stage.p50_ms, stage.p99_ms, stage.max_ms);
            writeln!(line, "{:<24}{:>10}{p50:>10.3}{p99:>10.3}{max:>10.3}", stage.stage, stage.count)?;
        }
    }
    if let Some(bytes) = counters.resident_bytes {
        writeln!(line, "resident memory: {:.1} MB", bytes as f64 / 1e6)?;
    }
    Ok(())
}
