//! What the measures of a view mean in plain words, and what to do.

use serde::Serialize;

use super::lint::ViewLint;

/// Below this share of the corners that the profile allows, a view has few.
const FEW: f64 = 0.75;
/// From this share of its corners on, a view that fits its own picture a step further repeats itself.
const REPEATS: f64 = 0.25;
/// A view holds little if the median of its simulated views is below this multiple of what an answer needs.
const LITTLE: f64 = 1.5;

/// What is weak about a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Weakness {
    /// It holds little evidence.
    LittleEvidence,
    /// It has few corners.
    FewCorners,
    /// Another building looks like it.
    LookAlike,
    /// The mirrored picture fits.
    MirrorSymmetric,
    /// It fits its own picture a step further.
    Repetitive,
    /// Earlier views of the building know the picture already.
    AddsNothing,
}

/// A weakness of one view, with what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// The building.
    pub building: String,
    /// The picture.
    pub image: String,
    /// What is weak.
    pub weakness: Weakness,
    /// The same in words, with the numbers.
    pub says: String,
    /// What to do.
    pub advice: &'static str,
}

/// The weaknesses that the measures of a view show; `most_corners` is what its profile allows.
pub fn warnings(building: &str, image: &str, lint: &ViewLint, most_corners: usize) -> Vec<Warning> {
    let mut found = Vec::new();
    let mut warn = |weakness, says: String, advice| {
        found.push(Warning { building: building.into(), image: image.into(), weakness, says, advice });
    };
    let ViewLint { needed_bits, median_bits, worst_bits, .. } = *lint;
    let corners = lint.repetition.of_corners;
    if (corners as f64) < FEW * most_corners as f64 {
        warn(
            Weakness::FewCorners,
            format!("the view has {corners} corners, {most_corners} would be possible"),
            "take a larger, sharper picture that the building fills",
        );
    }
    if median_bits < LITTLE * needed_bits {
        warn(
            Weakness::LittleEvidence,
            format!(
                "from elsewhere or in other light the view gives {median_bits:.0} bits, at worst {worst_bits:.0}, \
                 and an answer needs {needed_bits:.0}"
            ),
            "take another picture nearer and in even light, with more of the building's windows, edges and ornaments; \
             a second picture from 20 to 30 degrees aside helps too",
        );
    }
    for other in &lint.lookalikes {
        warn(
            Weakness::LookAlike,
            format!(
                "the picture looks like {:?} too, by {:.0} bits (by chance once in {})",
                other.name,
                other.bits,
                once_in(other.false_answer)
            ),
            "if both are one building, enroll it under one name; else take pictures of both from where they differ",
        );
    }
    if lint.mirror_bits >= needed_bits {
        warn(
            Weakness::MirrorSymmetric,
            format!("the mirrored picture fits the view with {:.0} bits: left and right look alike", lint.mirror_bits),
            "take another picture from aside, or with what stands on one side only in it, so that the side from \
             which it is seen can be told",
        );
    }
    let share = lint.repetition.corners as f64 / corners.max(1) as f64;
    if share >= REPEATS {
        let [right, down] = lint.repetition.shift_pixel;
        warn(
            Weakness::Repetitive,
            format!(
                "{} of {corners} corners look the same {right} px to the right and {down} px down: a pattern repeats",
                lint.repetition.corners
            ),
            "take another picture with the pattern's end in it: a roof line, a door, a corner of the building",
        );
    }
    if let Some(earlier) = lint.earlier_views_bits.filter(|&earlier| earlier >= median_bits.max(2.0 * needed_bits)) {
        warn(
            Weakness::AddsNothing,
            format!("other views of the building know this picture already, by {earlier:.0} bits"),
            "leave it out to save space and time, or take one from another side or in other light",
        );
    }
    found
}

/// `1 / p` to two digits, as people say it.
fn once_in(probability: f64) -> String {
    let times = 1.0 / probability;
    if times > 1e6 { "more than a million".into() } else { format!("{times:.0}") }
}
