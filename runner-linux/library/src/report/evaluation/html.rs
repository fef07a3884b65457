//! An evaluation as a page: the figures, two plots, and the pictures of every miss and every false answer.

use std::fmt::Write as _;

use svg::Document;
use svg::node::element::{Image, Polygon};

use super::score::{interval, recall_curve, share};
use super::{Evaluation, Guess, Judged, Outcome};
use crate::order;
use crate::picture::GrayImage;
use crate::report::page::{escape, table, tile};
use crate::report::phrase::{count, milliseconds, probability};
use crate::report::plot::{Axis, Curve, Mark, Plot};
use crate::report::{data_uri, overlay, page};

/// Longer side of the pictures on the page.
const SIDE: usize = 360;

/// Reads a picture of the dataset as it was compared; none if it is gone.
type Read<'a> = &'a dyn Fn(&str) -> Option<GrayImage>;

/// The page, which needs nothing beside it.
pub fn page(evaluation: &Evaluation, read: Read<'_>) -> String {
    let mut body = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut body, evaluation, read);
    page::page("daymark: evaluation", &body)
}

fn write_page(out: &mut String, evaluation: &Evaluation, read: Read<'_>) -> std::fmt::Result {
    let scores = &evaluation.scores;
    writeln!(out, "<h1>How good are the answers?</h1>")?;
    writeln!(
        out,
        "<p class=\"pale\">Profile {}, table {}: {} in {}. {} queries, {}.</p>",
        evaluation.profile,
        evaluation.table.table_id,
        count(evaluation.table.landmarks as usize, "building"),
        count(evaluation.table.views as usize, "stored view"),
        scores.queries,
        count(scores.negatives, "negative"),
    )?;
    out.push_str("<div class=\"tiles\">\n");
    out.push_str(&tile(&format!("{:.3}", scores.recall_at_1), "recall@1"));
    out.push_str(&tile(&format!("{:.3}", scores.recall_at_zero_false_accepts), "recall at zero false accepts"));
    out.push_str(&tile(&count(evaluation.bytes_per_view, "byte"), "a stored view"));
    if let Some(times) = &evaluation.times {
        out.push_str(&tile(&milliseconds(times.whole_frame_p50_ms), "a frame (median)"));
        out.push_str(&tile(&milliseconds(times.one_view_p50_ms), "a stored view (median)"));
    }
    out.push_str("</div>\n");
    writeln!(
        out,
        "<h2>Does the stated probability hold?</h2>\n<p class=\"pale\">Red: the share of negatives whose best building \
         states this probability or a smaller one. Dashed: where that should be. Green points: negatives that were \
         answered, with 95 % intervals; a frame that two buildings fit about equally well is not answered.</p>\n\
         <div class=\"row\">"
    )?;
    writeln!(out, "{}\n{}\n</div>", reliability_plot(evaluation).to_svg(), recall_plot(evaluation).to_svg())?;
    out.push_str(&stated_table(evaluation));
    writeln!(out, "<h2>By source</h2>")?;
    out.push_str(&source_table(evaluation));
    write_pictures(out, evaluation, read)
}

fn decades(from: i32) -> Vec<(f64, String)> {
    (from..=0).map(|power| libm::pow(10.0, f64::from(power))).map(|p| (p, probability(p))).collect()
}

fn reliability_plot(evaluation: &Evaluation) -> Plot {
    let negatives: Vec<&Judged> = evaluation.frames.iter().filter(|frame| frame.shows.is_none()).collect();
    let stated = |frame: &&Judged| frame.best.as_ref().map_or(1.0, |best| best.probability_false_answer);
    let mut probabilities: Vec<f64> = negatives.iter().map(stated).collect();
    order::ascending(&mut probabilities);
    let mut steps = Vec::new();
    for (below, &p) in probabilities.iter().enumerate() {
        steps.push([p, share(below, negatives.len())]);
        steps.push([p, share(below + 1, negatives.len())]);
    }
    let marks = evaluation.scores.at_stated_probability.iter().map(|row| Mark {
        at: [row.stated, row.false_accept_rate],
        interval: interval(row.false_accepts_on_negatives, negatives.len()),
        remark: format!("{} of {}", row.false_accepts_on_negatives, negatives.len()),
    });
    Plot {
        title: "Negatives that were taken for a building".to_owned(),
        x: Axis {
            label: "stated probability of a false answer, at most".to_owned(),
            from: 1e-4,
            to: 1.0,
            logarithmic: true,
            ticks: decades(-4),
        },
        y: Axis { label: "observed share".to_owned(), from: 1e-3, to: 1.0, logarithmic: true, ticks: decades(-3) },
        curves: vec![
            Curve { points: vec![[1e-3, 1e-3], [1.0, 1.0]], colour: "var(--pale, #889)", dashed: true },
            Curve { points: steps, colour: "var(--bad, #c8372d)", dashed: false },
        ],
        marks: marks.collect(),
    }
}

fn recall_plot(evaluation: &Evaluation) -> Plot {
    /// False accepts up to which the curve is drawn.
    const SHOWN: f64 = 20.0;
    let queries = evaluation.scores.queries.max(1) as f64;
    let curve = recall_curve(&evaluation.frames);
    let mut points: Vec<[f64; 2]> =
        curve.into_iter().map(|(wrong, right)| [wrong as f64, right as f64 / queries]).collect();
    points.retain(|[wrong, _]| *wrong <= SHOWN);
    let level = evaluation.scores.recall_at_1;
    Plot {
        title: "Recall against false accepts".to_owned(),
        x: Axis {
            label: "false accepts: negatives and wrong buildings".to_owned(),
            from: 0.0,
            to: SHOWN,
            logarithmic: false,
            ticks: (0..=4).map(|tick| (f64::from(tick * 5), (tick * 5).to_string())).collect(),
        },
        y: Axis {
            label: "share of queries answered right".to_owned(),
            from: 0.0,
            to: 1.0,
            logarithmic: false,
            ticks: (0..=5).map(|tick| (f64::from(tick) / 5.0, format!("{:.1}", f64::from(tick) / 5.0))).collect(),
        },
        curves: vec![
            Curve { points: vec![[0.0, level], [SHOWN, level]], colour: "var(--pale, #889)", dashed: true },
            Curve { points, colour: "var(--good, #0f8a55)", dashed: false },
        ],
        marks: Vec::new(),
    }
}

fn stated_table(evaluation: &Evaluation) -> String {
    let rows = evaluation.scores.at_stated_probability.iter().map(|row| {
        let accepted = format!("{} ({:.1} %)", row.false_accepts_on_negatives, 100.0 * row.false_accept_rate);
        let counts = [row.right, row.wrong, row.ambiguous, row.unknown].map(|count| count.to_string());
        [probability(row.stated), accepted].into_iter().chain(counts).collect()
    });
    table(
        &["stated, at most", "negatives accepted", "right", "wrong", "ambiguous", "unknown"],
        &rows.collect::<Vec<_>>(),
    )
}

fn source_table(evaluation: &Evaluation) -> String {
    let rows = evaluation.scores.sources.iter().map(|source| {
        let counts = [
            source.queries,
            source.right_at_1,
            source.right_at_zero_false_accepts,
            source.right,
            source.wrong,
            source.negatives,
            source.false_accepts,
        ];
        std::iter::once(source.source.clone()).chain(counts.map(|count| count.to_string())).collect()
    });
    let limit = format!("right at {}", probability(evaluation.settings.max_false_answer));
    let heads = ["source", "queries", "right at 1", "at zero false", &limit, "wrong", "negatives", "false accepts"];
    table(&heads, &rows.collect::<Vec<_>>())
}

/// Frames to look at.
struct Section {
    title: &'static str,
    what: String,
    open: bool,
    belongs: fn(&Judged) -> bool,
}

fn write_pictures(out: &mut String, evaluation: &Evaluation, read: Read<'_>) -> std::fmt::Result {
    let limit = probability(evaluation.settings.max_false_answer);
    let sections = [
        Section {
            title: "False answers",
            what: format!("Negatives and queries for which a wrong building was named at {limit}."),
            open: true,
            belongs: |frame| frame.outcome == Outcome::Wrong,
        },
        Section {
            title: "Misses",
            what: "Queries whose building is not the one with the most evidence.".to_owned(),
            open: true,
            belongs: |frame| frame.shows.is_some() && !frame.right_at_1 && frame.outcome != Outcome::Wrong,
        },
        Section {
            title: "Right, but not sure",
            what: format!("Queries whose building fits best, and which are not answered at {limit}."),
            open: false,
            belongs: |frame| frame.right_at_1 && matches!(frame.outcome, Outcome::Ambiguous | Outcome::Unknown),
        },
    ];
    for Section { title, what, open, belongs } in sections {
        let frames: Vec<&Judged> = evaluation.frames.iter().filter(|frame| belongs(frame)).collect();
        writeln!(out, "<h2>{title}: {}</h2>\n<p class=\"pale\">{}</p>", frames.len(), escape(&what))?;
        if frames.is_empty() {
            continue;
        }
        let open = if open { " open" } else { "" };
        writeln!(out, "<details{open}><summary>{}</summary>", count(frames.len(), "frame"))?;
        for frame in frames {
            write_frame(out, evaluation, frame, read)?;
        }
        writeln!(out, "</details>")?;
    }
    Ok(())
}

fn write_frame(out: &mut String, evaluation: &Evaluation, frame: &Judged, read: Read<'_>) -> std::fmt::Result {
    let shows = frame.shows.as_deref().unwrap_or("none of the buildings");
    let taken = frame.best.as_ref().map_or("nothing fits".to_owned(), |best| {
        let p = probability(best.probability_false_answer);
        format!("best {} with {:.1} bits, false with {p}", best.building, best.evidence_bits)
    });
    writeln!(out, "<div class=\"card\"><h3>{}: {}</h3>\n<div class=\"trio\">", escape(shows), escape(&taken))?;
    let frame_picture = read(&frame.file);
    let best_picture = frame.best.as_ref().and_then(|best| read(&best.gallery_file));
    if let Some(picture) = &frame_picture {
        let outline = frame.best.as_ref().zip(best_picture.as_ref());
        write_figure(out, &with_outline(picture, outline), &format!("the frame: {}", frame.file))?;
    }
    if let Some((best, picture)) = frame.best.as_ref().zip(best_picture) {
        write_figure(out, &plain(picture), &format!("best view, {}: {}", best.building, best.gallery_file))?;
    }
    let truth = frame.shows.as_deref().and_then(|shows| true_view(evaluation, frame, shows));
    if let Some((file, picture)) = truth.and_then(|file| Some((file, read(file)?))) {
        write_figure(out, &plain(picture), &format!("its own view: {file}"))?;
    }
    writeln!(out, "</div></div>")
}

/// A gallery picture of the building that the frame shows: the runner-up's if that is the one, or the first.
fn true_view<'a>(evaluation: &'a Evaluation, frame: &'a Judged, shows: &str) -> Option<&'a str> {
    let guesses = [&frame.best, &frame.runner_up];
    let guessed = guesses.into_iter().flatten().find(|guess| guess.building == shows);
    let first = || evaluation.table.gallery.iter().find(|view| view.building == shows);
    guessed.map(|guess| guess.gallery_file.as_str()).or_else(|| first().map(|view| view.file.as_str()))
}

fn write_figure(out: &mut String, picture: &str, caption: &str) -> std::fmt::Result {
    writeln!(out, "<figure>{picture}<figcaption>{}</figcaption></figure>", escape(caption))
}

fn plain(picture: GrayImage) -> String {
    format!("<img loading=\"lazy\" alt=\"\" src=\"{}\">", data_uri::jpeg(&picture.scaled_to(SIDE)))
}

/// The frame with the outline of the view that was found in it.
fn with_outline(picture: &GrayImage, best: Option<(&Guess, &GrayImage)>) -> String {
    let (width, height) = (picture.width, picture.height);
    let small = picture.clone().scaled_to(SIDE);
    let image = Image::new().set("width", width).set("height", height).set("href", data_uri::jpeg(&small));
    let mut document = Document::new().set("viewBox", format!("0 0 {width} {height}")).add(image);
    if let Some((guess, stored)) = best {
        let points = overlay::outline_points(stored.width as u16, stored.height as u16, guess.frame_from_view);
        let points = points.map(|[x, y]| format!("{:.1},{:.1}", x + 0.5, y + 0.5)).join(" ");
        let polygon = |colour: &str, width: f32| {
            let polygon = Polygon::new().set("points", points.as_str()).set("fill", "none");
            polygon.set("stroke", colour).set("stroke-width", width)
        };
        document = document.add(polygon(overlay::NIGHT, 7.0)).add(polygon("#ffd34d", 3.5));
    }
    document.to_string()
}
