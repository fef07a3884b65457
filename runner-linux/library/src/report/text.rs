//! A finding as lines of text.

use std::fmt::Write as _;

use super::explain::{Explained, ExplainedCorner, ViewExplanation};
use super::finding::{Candidate, Finding};
use super::phrase::{count, milliseconds, printable, probability, signed_bits};

/// Corners that an explanation lists.
const LISTED: usize = 12;

/// A finding, without its explanation, as text with a line end.
pub fn finding(finding: &Finding, max_false_answer: f64) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_finding(&mut text, finding, max_false_answer);
    text
}

fn write_finding(out: &mut String, finding: &Finding, max_false_answer: f64) -> std::fmt::Result {
    write!(out, "{}: {}", printable(&finding.file), finding.verdict.label())?;
    if let (Some(_), Some(best)) = (&finding.landmark, &finding.best) {
        writeln!(out, "  {}", named(best))?;
        let p = probability(best.probability_false_answer);
        writeln!(out, "  false       with a probability of {p} (limit {})", probability(max_false_answer))?;
        let corners = count(usize::from(best.supporting_corners), "corner");
        writeln!(out, "  evidence    {:.1} bits from {corners} of view {}", best.evidence_bits, best.view)?;
    } else {
        writeln!(out)?;
    }
    if let Some(reason) = &finding.reason {
        writeln!(out, "  reason      {}", reason.message)?;
        writeln!(out, "  try         {}", reason.advice)?;
    }
    if finding.landmark.is_none()
        && let Some(best) = &finding.best
    {
        writeln!(out, "  best        {}", with_evidence(best))?;
    }
    if let Some(other) = &finding.runner_up {
        writeln!(out, "  runner-up   {}", with_evidence(other))?;
    }
    if let Some(at) = finding.best.as_ref().filter(|_| finding.landmark.is_some()).and_then(|best| best.position) {
        let (latitude, longitude) = (at.latitude_deg, at.longitude_deg);
        let within = if at.error_m > 0.0 { format!(", within {} m", at.error_m) } else { String::new() };
        writeln!(out, "  stands at   {latitude:.6}, {longitude:.6} degrees{within}")?;
    }
    if let Some(observer) = &finding.observer {
        observer.write(out)?;
    }
    if let Some(times) = finding.times {
        writeln!(
            out,
            "  time        {} for {}, {} for {}",
            milliseconds(times.features_ms),
            count(finding.corners, "corner"),
            milliseconds(times.matching_ms),
            count(finding.views_compared as usize, "stored view"),
        )?;
    }
    if let Some(file) = &finding.overlay_file {
        writeln!(out, "  overlay     {}", printable(file))?;
    }
    if let Some(file) = &finding.map_file {
        writeln!(out, "  map         {}", printable(file))?;
    }
    Ok(())
}

fn named(candidate: &Candidate) -> String {
    format!("{} ({})", candidate.landmark, candidate.kind)
}

fn with_evidence(candidate: &Candidate) -> String {
    format!(
        "{}, {:.1} bits: as an answer it would be false with {}",
        named(candidate),
        candidate.evidence_bits,
        probability(candidate.probability_false_answer)
    )
}

/// An explanation as text with a line end.
pub fn explanation(explained: &Explained) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_explanation(&mut text, explained);
    text
}

fn write_explanation(out: &mut String, explained: &Explained) -> std::fmt::Result {
    let Some(best) = &explained.best else {
        return writeln!(out, "  why         no stored view was found in the frame, so there is nothing to explain");
    };
    writeln!(out, "  why {}", best.landmark)?;
    write_view(out, best)?;
    write_corners(out, &best.corners)?;
    if let Some(runner_up) = &explained.runner_up {
        writeln!(out, "  why not {}", runner_up.landmark)?;
        if let Some(why) = &explained.why_the_runner_up_lost {
            writeln!(out, "    {why}")?;
        }
        write_view(out, runner_up)?;
    }
    Ok(())
}

fn write_view(out: &mut String, view: &ViewExplanation) -> std::fmt::Result {
    let [(for_it, for_bits), (against, against_bits)] = view.for_and_against();
    writeln!(
        out,
        "    view {}: {} for it ({}), {against} against it ({}); all told, with how plausible the map is, {:.1} bits",
        view.view,
        count(for_it, "corner"),
        signed_bits(for_bits),
        signed_bits(against_bits),
        view.evidence_bits,
    )?;
    let map = view.map;
    let way = if map.lean_deg < 0.0 { "counter-clockwise" } else { "clockwise" };
    writeln!(
        out,
        "    map: {:.2} times the size of the stored view, its vertical leans {:.1} degrees {way}, stretch {:.2}",
        map.scale,
        map.lean_deg.abs(),
        map.stretch
    )?;
    for group in &view.groups {
        let residual = group.median_residual_px.map_or(String::new(), |px| format!("  residual {px:.1} px (median)"));
        writeln!(
            out,
            "      {:<10}{:>14}  {:>11}{residual}",
            group.said.name(),
            count(group.corners, "corner"),
            signed_bits(group.evidence_bits),
        )?;
    }
    Ok(())
}

fn write_corners(out: &mut String, corners: &[ExplainedCorner]) -> std::fmt::Result {
    writeln!(
        out,
        "    {:<8}{:>6}{:>17}{:>17}{:>11}{:>11}",
        "corner", "level", "in the view", "in the frame", "residual", "evidence"
    )?;
    let against = corners.iter().rev().take_while(|corner| corner.evidence_bits < 0.0).count();
    let listed_against = against.min(LISTED / 4);
    let in_favour = corners.iter().take(LISTED.min(corners.len() - against));
    for corner in in_favour {
        write_corner(out, corner)?;
    }
    let left = corners.len() - LISTED.min(corners.len() - against) - listed_against;
    if left > 0 {
        writeln!(out, "    ... {left} more; --json lists all")?;
    }
    corners.iter().skip(corners.len() - listed_against).try_for_each(|corner| write_corner(out, corner))
}

fn write_corner(out: &mut String, corner: &ExplainedCorner) -> std::fmt::Result {
    let place = |[x, y]: [f32; 2]| format!("{x:.1}, {y:.1}");
    let found = corner.found_px.map_or_else(|| "-".to_owned(), place);
    let residual = corner.residual_px.map_or_else(|| "-".to_owned(), |px| format!("{px:.1} px"));
    writeln!(
        out,
        "    #{:<7}{:>6}{:>17}{:>17}{:>11}{:>11}",
        corner.corner,
        corner.level,
        place(corner.in_view_px),
        found,
        residual,
        format!("{:+.1}", corner.evidence_bits),
    )
}
