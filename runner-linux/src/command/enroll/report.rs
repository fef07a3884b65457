//! What was enrolled, and what the new views are worth: text and JSON.

use std::path::Path;

use daymark_core::table::LandmarkTable;
use serde::Serialize;

use super::tell;
use crate::command::CommandError;
use crate::command::table::facts::{SCHEMA_VERSION, TableFacts, position};
use crate::command::table::print as print_result;
use crate::enroll::advice::{Warning, warnings};
use crate::enroll::lint::{LookAlike, ViewLint};
use crate::enroll::position::Shown;
use crate::enroll::update::{Change, Enrolled, Outcome, PositionFrom};
use crate::report::finding::Position;
use crate::report::phrase::{count, printable};

#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    table: TableFacts,
    enrolled: Vec<EnrolledLandmark>,
    warnings: Vec<Warning>,
}

#[derive(Debug, Serialize)]
struct EnrolledLandmark {
    landmark: String,
    outcome: &'static str,
    views_before: usize,
    position: Option<Position>,
    /// `given`, `table`, or `camera`: where the camera stood, from EXIF data.
    position_from: Option<&'static str>,
    images: Vec<EnrolledImage>,
}

#[derive(Debug, Serialize)]
struct EnrolledImage {
    file: String,
    /// The table held this view already.
    known: bool,
    corners: usize,
    measures: Option<Measures>,
}

/// The form of [`ViewLint`] for programs.
#[derive(Debug, Serialize)]
struct Measures {
    needed_bits: f64,
    median_bits: f64,
    worst_bits: f64,
    lookalikes: Vec<LookAlikeMeasure>,
    mirror_bits: f64,
    repeated_corners: usize,
    repetition_shift_px: [i32; 2],
    earlier_views_bits: Option<f64>,
}

#[derive(Debug, Serialize)]
struct LookAlikeMeasure {
    landmark: String,
    evidence_bits: f64,
    probability_false_answer: f64,
}

impl From<&ViewLint> for Measures {
    fn from(lint: &ViewLint) -> Self {
        let lookalike = |LookAlike { name, bits, false_answer }: &LookAlike| LookAlikeMeasure {
            landmark: name.clone(),
            evidence_bits: *bits,
            probability_false_answer: *false_answer,
        };
        Self {
            needed_bits: lint.needed_bits,
            median_bits: lint.median_bits,
            worst_bits: lint.worst_bits,
            lookalikes: lint.lookalikes.iter().map(lookalike).collect(),
            mirror_bits: lint.mirror_bits,
            repeated_corners: lint.repetition.corners,
            repetition_shift_px: lint.repetition.shift_pixel,
            earlier_views_bits: lint.earlier_views_bits,
        }
    }
}

/// Prints the result to standard output, and to standard error what is weak. `lints` is empty if nothing was measured.
pub(super) fn print(
    json: bool,
    path: &Path,
    table: LandmarkTable<'_>,
    changes: &[Change],
    lints: &[Vec<Option<ViewLint>>],
) -> Result<(), CommandError> {
    let lint_of = |change: usize, picture: usize| lints.get(change)?.get(picture)?.as_ref();
    let mut found = Vec::new();
    let mut text = String::new();
    let mut enrolled = Vec::new();
    for (i, change) in changes.iter().enumerate() {
        text += &headline(change);
        let mut images = Vec::new();
        for (j, picture) in change.pictures.iter().enumerate() {
            let (file, lint) = (picture.path.to_string_lossy().into_owned(), lint_of(i, j));
            text += &line(picture, lint);
            found.extend(lint.into_iter().flat_map(|lint| warnings(&change.name, &file, lint, table.profile())));
            let measures = lint.map(Measures::from);
            images.push(EnrolledImage { file, known: picture.known, corners: picture.corners, measures });
        }
        enrolled.push(EnrolledLandmark {
            landmark: change.name.clone(),
            outcome: match change.outcome {
                Outcome::Added => "added",
                Outcome::Extended => "extended",
                Outcome::Replaced => "replaced",
                Outcome::Unchanged => "unchanged",
            },
            views_before: change.views_before,
            position: change.position.as_ref().map(|(at, _)| position(*at)),
            position_from: change.position.as_ref().map(|(_, from)| match from {
                PositionFrom::Given => "given",
                PositionFrom::Table => "table",
                PositionFrom::Camera(_) => "camera",
            }),
            images,
        });
    }
    for Warning { building, image, says, advice, .. } in &found {
        tell(&format!("warning: {}, {}: {says}; {advice}", printable(building), printable(image)));
    }
    let table = TableFacts::new(path, table.header());
    let document = Document { schema_version: SCHEMA_VERSION, table, enrolled, warnings: found };
    print_result(json, &document, || text + &document.table.line() + "\n")
}

fn headline(change: &Change) -> String {
    let new = change.pictures.iter().filter(|picture| !picture.known).count();
    let (new, before) = (count(new, "view"), count(change.views_before, "view"));
    let what = match change.outcome {
        Outcome::Added => format!("added with {new}"),
        Outcome::Extended => format!("{new} added to the {} that it had", change.views_before),
        Outcome::Replaced => format!("{before} replaced by {new}"),
        Outcome::Unchanged => "nothing new, the table has these views already".to_owned(),
    };
    let place = match &change.position {
        None => "  position unknown: give --at, or pictures with GPS data\n".to_owned(),
        Some((_, PositionFrom::Table)) => String::new(),
        Some((at, PositionFrom::Given)) => format!("  at {}\n", Shown(*at)),
        Some((at, PositionFrom::Camera(path))) => {
            let path = path.display().to_string();
            format!("  at {}: where the camera of {} stood, by its GPS data\n", Shown(*at), printable(&path))
        }
    };
    format!("{}: {what}\n{place}", printable(&change.name))
}

fn line(picture: &Enrolled, lint: Option<&ViewLint>) -> String {
    let file = printable(&picture.path.to_string_lossy());
    let corners = count(picture.corners, "corner");
    let worth = match lint {
        _ if picture.known => ", in the table already".to_owned(),
        None => String::new(),
        Some(ViewLint { median_bits, worst_bits, needed_bits, .. }) => format!(
            ", {median_bits:.0} bits of evidence from elsewhere, at worst {worst_bits:.0} (an answer needs {needed_bits:.0})"
        ),
    };
    format!("  {file}: {corners}{worth}\n")
}
