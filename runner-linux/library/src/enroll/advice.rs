//! What the measures of a view mean in plain words, and what to do.

use daymark_core::profile::Profile;
use serde::Serialize;

use super::lint::ViewLint;
use crate::report::phrase::probability;

/// Below this share of the corners that the profile allows, a view has few.
const FEW: f64 = 0.75;
/// From this share of its corners on, a view that fits its own picture a step further repeats itself: 3 of the 74.
const REPEATS: f64 = 0.12;
/// From this share of its own evidence on, the mirrored picture fits: 5 of the 74.
const MIRRORED: f64 = 0.2;
/// From this share of a view's evidence on, what earlier views of the building say is enough.
const KNOWN: f64 = 0.5;

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

/// What good views give in the median and in the worst of their simulated views, in multiples of what an answer usually
/// needs. Of 74 good photographs of 65 buildings one is below in each profile; of eight of them blurred by
/// 6 px, at a quarter of their size, or at 5 % of their light, most or all.
const fn good(profile: Profile) -> [f64; 2] {
    match profile {
        Profile::Board => [26.0, 15.0],
        _ => [12.0, 6.0],
    }
}

/// The weaknesses that the measures of a view show.
pub fn warnings(building: &str, image: &str, lint: &ViewLint, profile: Profile) -> Vec<Warning> {
    let most_corners = profile.corners_per_view();
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
    let [good_median, good_worst] = good(profile).map(|times| times * lint.usually_needed_bits);
    if median_bits < good_median || worst_bits < good_worst {
        warn(
            Weakness::LittleEvidence,
            format!(
                "seen from elsewhere or in other light the view gives {median_bits:.0} bits, at worst {worst_bits:.0}; \
                 good pictures give {good_median:.0} and {good_worst:.0}"
            ),
            "take another picture in good light, sharp, and so near that the building fills it",
        );
    }
    for other in &lint.lookalikes {
        warn(
            Weakness::LookAlike,
            format!(
                "the picture looks like {:?} too, by {:.0} bits (by chance: {})",
                other.name,
                other.bits,
                probability(other.false_answer)
            ),
            "if both are one building, enroll it under one name; else take pictures of both from where they differ",
        );
    }
    if lint.mirror_bits >= needed_bits.max(MIRRORED * median_bits) {
        warn(
            Weakness::MirrorSymmetric,
            format!("the mirrored picture fits the view with {:.0} bits: left and right look alike", lint.mirror_bits),
            "take another picture from aside, or with what stands on one side only in it, so that the side from \
             which it is seen can be told",
        );
    }
    let share = lint.repetition.corners as f64 / corners.max(1) as f64;
    if share >= REPEATS {
        warn(
            Weakness::Repetitive,
            format!(
                "{} of {corners} corners look the same {}: a pattern repeats",
                lint.repetition.corners,
                direction(lint.repetition.shift_pixel)
            ),
            "take another picture with the pattern's end in it: a roof line, a door, a corner of the building",
        );
    }
    if let Some(earlier) = lint.earlier_views_bits.filter(|&earlier| earlier >= needed_bits.max(KNOWN * median_bits)) {
        warn(
            Weakness::AddsNothing,
            format!("other views of the building know this picture already, by {earlier:.0} bits"),
            "leave it out to save space and time, or take one from another side or in other light",
        );
    }
    found
}

/// A shift in words.
fn direction([x, y]: [i32; 2]) -> String {
    let across = format!("{} px to the {}", x.abs(), if x < 0 { "left" } else { "right" });
    let along = format!("{} px {}", y.abs(), if y < 0 { "up" } else { "down" });
    match (x, y) {
        (_, 0) => across,
        (0, _) => along,
        _ => format!("{across} and {along}"),
    }
}
