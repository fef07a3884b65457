//! A finding as text.

use std::fmt::Write as _;

use super::fate::QuadFate;
use super::finding::{CorrespondenceFound, CountsFound, Finding, PictureFound};
use crate::report::phrase;

/// The finding for people.
pub fn finding(finding: &Finding) -> String {
    let mut text = String::new();
    for picture in &finding.pictures {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", picture_line(picture));
    }
    let _ = writeln!(text, "{}", headline(finding));
    if let Some(checked) = finding.checked {
        let _ = writeln!(
            text,
            "of {} numbers in both files {} are matched rightly; {} matches are wrong",
            checked.common, checked.right, checked.wrong
        );
    }
    if !finding.correspondences.is_empty() {
        let _ = writeln!(text, "\n   first  second      layers  shift  found by        residual");
        for found in &finding.correspondences {
            row(&mut text, found);
        }
    }
    text.push('\n');
    if let Some(proposals) = finding.proposals {
        for (source, counts) in [("hull layers", proposals.layers), ("local arrangements", proposals.arrangements)] {
            if let Some(line) = counts_line(counts) {
                let _ = writeln!(text, "proposals of {source}: {line}");
            }
        }
    }
    let all: usize = finding.layer_quads.values().sum();
    if all > 0 {
        let _ = writeln!(text, "quads of the first picture's layers: {all}");
        for fate in QuadFate::ALL {
            if let Some(count) = finding.layer_quads.get(fate.name()) {
                let _ = writeln!(text, "  {count:>4} {}", fate.says());
            }
        }
    }
    text
}

fn picture_line(picture: &PictureFound) -> String {
    let sizes: Vec<String> = picture.layers.iter().map(|layer| layer.len().to_string()).collect();
    let within = match picture.remainder.len() {
        0 => String::new(),
        rest => format!(" and {rest} within"),
    };
    let layers = if sizes.is_empty() { String::new() } else { format!(" ({})", sizes.join(", ")) };
    format!(
        "{}: {} in {}{layers}{within}",
        phrase::printable(&picture.file),
        phrase::count(picture.corners, "corner"),
        phrase::count(picture.layers.len(), "layer"),
    )
}

/// The answer in one line.
pub fn headline(finding: &Finding) -> String {
    let count = phrase::count(finding.correspondences.len(), "correspondence");
    match (&finding.map, finding.median_epipolar_distance_px, finding.agreeing_quads, &finding.reason) {
        (Some(map), ..) => {
            format!(
                "{count}: one map explains them, {:.0} bits beyond chance at {} px of noise",
                map.bits, map.noise_px
            )
        }
        (_, Some(median), ..) => format!(
            "{count}: a scene with relief; neighbours agree, and all with one epipolar constraint (median {median:.2} px)"
        ),
        (_, _, Some(quads), _) => {
            format!(
                "{count} by the plain rule: {} of the layers agree; nothing is verified",
                phrase::count(quads, "quad")
            )
        }
        (_, _, _, Some(reason)) => format!("no correspondence: {}", reason.message),
        _ => count,
    }
}

fn row(text: &mut String, found: &CorrespondenceFound) {
    let layer = |layer: Option<u16>| layer.map_or_else(|| "in".to_owned(), |layer| layer.to_string());
    let layers = format!("{} → {}", layer(found.layers[0]), layer(found.layers[1]));
    let shift = found.shift.map_or_else(|| "-".to_owned(), |shift| format!("+{shift}"));
    let residual = found.residual_px.map_or_else(|| "-".to_owned(), |px| format!("{px:.2} px"));
    let _ = writeln!(
        text,
        "{:>8}{:>8}{layers:>12}{shift:>7}  {:<14}{residual:>10}",
        found.first, found.second, found.found_by
    );
}

fn counts_line(counts: CountsFound) -> Option<String> {
    if counts.seen == 0 {
        return None;
    }
    let parts = [
        (counts.accepted, "accepted"),
        (counts.contradicts, "contradict the matches"),
        (counts.off, "lie off the map"),
        (counts.undecided, "undecided"),
        (counts.unverified, "not verified"),
        (counts.crowded_out, "less surprising than those"),
    ];
    let told: Vec<String> =
        parts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    Some(format!("{}: {}", counts.seen, told.join(", ")))
}
