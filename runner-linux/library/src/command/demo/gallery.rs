//! The page that the demo leaves to look at.

use std::fmt::Write as _;
use std::path::Path;

use super::scene::Lesson;
use super::{Enrolled, Seen, answer, is_right};
use crate::report::page::{self, escape, tile};
use crate::report::phrase;

/// The page; its pictures lie beside it.
pub(super) fn page(enrolled: &[Enrolled], seen: &[Seen], table: &Path, table_bytes: usize) -> String {
    let mut body = String::new();
    // Writing to a string cannot fail.
    let _ = write_body(&mut body, enrolled, seen, table, table_bytes);
    page::page("daymark: demo", &body)
}

fn write_body(
    out: &mut String,
    enrolled: &[Enrolled],
    seen: &[Seen],
    table: &Path,
    table_bytes: usize,
) -> std::fmt::Result {
    let right = seen.iter().filter(|seen| is_right(seen)).count();
    let times = seen.iter().filter_map(|seen| seen.finding.times);
    let slowest = times.map(|times| times.features_ms + times.matching_ms).fold(0.0, f64::max);
    writeln!(out, "<h1>A star tracker for buildings</h1>")?;
    writeln!(
        out,
        "<p>Eight buildings were enrolled from two pictures each. Then the program was shown frames that differ from \
         all of these, and frames of something else. It drew everything itself: nothing was downloaded or trained.</p>"
    )?;
    out.push_str("<div class=\"tiles\">\n");
    out.push_str(&tile(&format!("{right} of {}", seen.len()), "frames answered as they should be"));
    out.push_str(&tile(&phrase::count(table_bytes, "byte"), "the whole table, without pictures"));
    out.push_str(&tile(&phrase::milliseconds(slowest), "the slowest frame, on one thread"));
    out.push_str("</div>\n");
    let lessons = [
        (
            Lesson::Known,
            "Known",
            "Left the stored view, right the frame. Rings are corners that were found again; the gold ones are strong \
             evidence, and a line leads to each from its place in the stored view. The white outline is the stored \
             view as the frame shows it; crosses are stored corners that were not found.",
        ),
        (
            Lesson::Twin,
            "Told apart",
            "These two are the same solid. What tells them apart is their facades, and only that.",
        ),
        (
            Lesson::Unknown,
            "Not enrolled",
            "The best of all stored views is drawn here too, with the little that spoke for it. Too little: no name.",
        ),
    ];
    for (lesson, title, what) in lessons {
        writeln!(out, "<h2>{title}</h2>\n<p class=\"pale\">{what}</p>")?;
        for seen in seen.iter().filter(|seen| seen.shot.lesson == lesson) {
            write_seen(out, seen)?;
        }
    }
    writeln!(out, "<h2>What was enrolled</h2>")?;
    let file = table.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
    writeln!(
        out,
        "<p class=\"pale\">Of each picture the 100 corners are kept that are found again most surely from elsewhere. \
         They are in <a href=\"{0}\"><code>{0}</code></a>; the pictures are not.</p>\n<div class=\"trio\">",
        escape(&file)
    )?;
    for view in enrolled {
        writeln!(
            out,
            "<figure><img loading=\"lazy\" alt=\"\" src=\"{}\"><figcaption>{}</figcaption></figure>",
            escape(&view.file),
            escape(&view.building)
        )?;
    }
    writeln!(out, "</div>")
}

fn write_seen(out: &mut String, seen: &Seen) -> std::fmt::Result {
    let shows = seen.shot.shows.as_deref().unwrap_or("Not enrolled");
    let (class, verdict) = if is_right(seen) { ("good", "as it should be") } else { ("bad", "not as it should be") };
    writeln!(
        out,
        "<div class=\"card\"><h3>{}, {}</h3>\n<figure class=\"wide\"><a href=\"{overlay}\"><img loading=\"lazy\" \
         alt=\"\" src=\"{overlay}\"></a><figcaption>{} <b class=\"{class}\">{verdict}</b> \u{b7} <a href=\"{}\">the \
         frame in colour</a></figcaption></figure></div>",
        escape(shows),
        escape(seen.shot.remark),
        escape(answer(&seen.finding).trim_start_matches("-> ")),
        escape(&seen.frame_file),
        overlay = escape(&seen.overlay_file),
    )
}
