//! An evaluation as text.

use std::fmt::Write as _;

use super::score::{Bin, Source, Stated, interval};
use super::{Evaluation, Times};
use crate::report::phrase::{count, grouped, milliseconds, printable, probability};

/// The evaluation as text with a line end.
pub fn evaluation(evaluation: &Evaluation) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_evaluation(&mut text, evaluation);
    text
}

fn write_evaluation(out: &mut String, evaluation: &Evaluation) -> std::fmt::Result {
    let Evaluation { table, scores, .. } = evaluation;
    writeln!(
        out,
        "profile {}: {} in {}, {} a view; {}, {}",
        evaluation.profile,
        count(table.landmarks as usize, "building"),
        count(table.views as usize, "stored view"),
        count(evaluation.bytes_per_view, "byte"),
        format_args!("{} queries", grouped(scores.queries as u64)),
        count(scores.negatives, "negative"),
    )?;
    for file in &table.not_enrolled {
        writeln!(out, "not enrolled, too few corners: {}", printable(file))?;
    }
    writeln!(out)?;
    writeln!(out, "recall@1                      {:.3}", scores.recall_at_1)?;
    writeln!(out, "recall at zero false accepts  {:.3}", scores.recall_at_zero_false_accepts)?;
    if let Some(bits) = scores.most_false_evidence_bits {
        writeln!(out, "  (right, and more than the {bits:.1} bits of the most evident false building)")?;
    }
    writeln!(out)?;
    write_stated(out, &scores.at_stated_probability, scores.negatives)?;
    writeln!(out)?;
    write_reliability(out, &scores.reliability)?;
    writeln!(out)?;
    write_sources(out, &scores.sources, evaluation.settings.max_false_answer)?;
    match &evaluation.times {
        Some(times) => write_times(out, times),
        None => Ok(()),
    }
}

fn write_stated(out: &mut String, rows: &[Stated], negatives: usize) -> std::fmt::Result {
    writeln!(out, "answers, if they may be false with at most a stated probability:")?;
    writeln!(
        out,
        "  {:>8}  {:>24}  {:>15}  {:>6}  {:>6}  {:>10}  {:>8}",
        "stated", "negatives accepted", "95 % interval", "right", "wrong", "ambiguous", "unknown"
    )?;
    for row in rows {
        let [low, high] = interval(row.false_accepts_on_negatives, negatives);
        let accepted =
            format!("{} of {} ({:.1} %)", row.false_accepts_on_negatives, negatives, 100.0 * row.false_accept_rate);
        writeln!(
            out,
            "  {:>8}  {accepted:>24}  {:>15}  {:>6}  {:>6}  {:>10}  {:>8}",
            probability(row.stated),
            format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high),
            row.right,
            row.wrong,
            row.ambiguous,
            row.unknown,
        )?;
    }
    Ok(())
}

fn write_reliability(out: &mut String, bins: &[Bin]) -> std::fmt::Result {
    writeln!(out, "reliability, by the stated probability that the best building is false:")?;
    writeln!(
        out,
        "  {:>18}  {:>6}  {:>6}  {:>9}  {:>14}  {:>21}",
        "stated", "right", "wrong", "negatives", "observed false", "negatives up to here"
    )?;
    for bin in bins {
        let members = bin.right + bin.wrong + bin.negatives;
        let observed = if members == 0 { "-".to_owned() } else { format!("{:.1} %", 100.0 * bin.observed_false) };
        writeln!(
            out,
            "  {:>18}  {:>6}  {:>6}  {:>9}  {observed:>14}  {:>19.1} %",
            format!("{} to {}", bin.stated_from, bin.stated_to),
            bin.right,
            bin.wrong,
            bin.negatives,
            100.0 * bin.negatives_up_to_here,
        )?;
    }
    Ok(())
}

fn write_sources(out: &mut String, sources: &[Source], limit: f64) -> std::fmt::Result {
    let limit = format!("right at {}", probability(limit));
    let width = sources.iter().map(|source| source.source.chars().count()).max().unwrap_or(0).max(6);
    writeln!(
        out,
        "  {:<width$}  {:>7}  {:>10}  {:>15}  {limit:>12}  {:>5}  {:>9}  {:>14}",
        "source", "queries", "right at 1", "at zero false", "wrong", "negatives", "false accepts"
    )?;
    for source in sources {
        writeln!(
            out,
            "  {:<width$}  {:>7}  {:>10}  {:>15}  {:>12}  {:>5}  {:>9}  {:>14}",
            printable(&source.source),
            source.queries,
            source.right_at_1,
            source.right_at_zero_false_accepts,
            source.right,
            source.wrong,
            source.negatives,
            source.false_accepts,
        )?;
    }
    Ok(())
}

fn write_times(out: &mut String, times: &Times) -> std::fmt::Result {
    writeln!(out, "\n  {:<22}{:>12}{:>12}", "time", "p50", "p99")?;
    let rows = [
        ("features of a frame", times.features_p50_ms, times.features_p99_ms),
        ("one stored view", times.one_view_p50_ms, times.one_view_p99_ms),
        ("whole frame", times.whole_frame_p50_ms, times.whole_frame_p99_ms),
        ("enrolling a view", times.enroll_view_p50_ms, times.enroll_view_p99_ms),
    ];
    for (name, median, slow) in rows {
        writeln!(out, "  {name:<22}{:>12}{:>12}", milliseconds(median), milliseconds(slow))?;
    }
    Ok(())
}
