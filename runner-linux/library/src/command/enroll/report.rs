//! What was enrolled, and what the new views are worth: text and JSON.

use std::path::Path;

use daymark_core::table::{LandmarkTable, StoredModel};
use serde::Serialize;

use super::models::ModelOutcome;
use super::tell;
use crate::command::CommandError;
use crate::command::table::facts::{SCHEMA_VERSION, TableFacts, position};
use crate::command::table::print as print_result;
use crate::enroll::advice::{Warning, warnings};
use crate::enroll::lint::{LookAlike, ViewLint};
use crate::enroll::model::WithoutModel;
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
    /// `given`, `table`, `camera`: where the camera stood, from EXIF data, or `cameras`: from several of those and the model.
    position_from: Option<&'static str>,
    model: Option<ModelFound>,
    /// Why there is none.
    without_model: Option<String>,
    /// What a frame of this building cannot tell the observer's position without.
    missing_for_a_position: Vec<&'static str>,
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
    models: &[ModelOutcome],
    lints: &[Vec<Option<ViewLint>>],
) -> Result<(), CommandError> {
    let lint_of = |change: usize, picture: usize| lints.get(change)?.get(picture)?.as_ref();
    let mut found = Vec::new();
    let mut text = String::new();
    let mut enrolled = Vec::new();
    for (i, change) in changes.iter().enumerate() {
        text += &headline(change);
        let outcome = models.get(i);
        let stored = stored_model(&table, &change.name)?;
        let missing = missing(change, stored.as_ref());
        text += &model_lines(outcome, stored.as_ref(), &missing);
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
                PositionFrom::Cameras => "cameras",
            }),
            model: stored.map(|stored| ModelFound::new(outcome, &stored)),
            without_model: match outcome {
                Some(ModelOutcome::Without(why)) => Some(why.to_string()),
                _ => None,
            },
            missing_for_a_position: missing,
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

/// The model that the table has now.
fn stored_model<'a>(table: &LandmarkTable<'a>, name: &str) -> Result<Option<StoredModel<'a>>, CommandError> {
    for number in 0..table.landmark_count() {
        if table.landmark(number)?.name == name {
            return Ok(table.model(number)?);
        }
    }
    Ok(None)
}

/// A building's model, for programs.
#[derive(Debug, Serialize)]
struct ModelFound {
    /// It was made now; otherwise the table had it.
    new: bool,
    points: usize,
    /// Of a new one: corners that several views show, and those whose place was read off the surface.
    triangulated: Option<usize>,
    on_surface: Option<usize>,
    triangles: usize,
    /// Deviation of a point in the direction that is known worst, the median; without a scale in units of the model.
    deviation_m: f64,
    /// Relative deviation of lengths; null if they mean nothing.
    scale_error: Option<f64>,
    /// Azimuth towards which the front looks.
    facing_deg: Option<f64>,
    facing_error_deg: Option<f64>,
    /// Of a new one: the map from the frame of the cameras' files to the model's (x east of the front's middle as one faces
    /// it, y into the building, z up): `x_model = scale * rotation * x_cameras + translation`.
    model_from_cameras: Option<SimilarityFacts>,
}

#[derive(Debug, Serialize)]
struct SimilarityFacts {
    scale: f64,
    rotation: [[f64; 3]; 3],
    translation_m: [f64; 3],
}

impl ModelFound {
    fn new(outcome: Option<&ModelOutcome>, stored: &StoredModel<'_>) -> Self {
        let facts = stored.facts();
        let made = match outcome {
            Some(ModelOutcome::Made(made)) => Some(made),
            _ => None,
        };
        Self {
            new: made.is_some(),
            points: stored.len(),
            triangulated: made.map(|made| made.triangulated),
            on_surface: made.map(|made| made.on_surface),
            triangles: stored.triangles().len(),
            deviation_m: stored.deviation_m(),
            scale_error: facts.scale_error.map(|error| f64::from(error) / 1e4),
            facing_deg: facts.azimuth.map(|at| (f64::from(at.centidegrees) / 100.0 + 180.0) % 360.0),
            facing_error_deg: facts.azimuth.map(|at| f64::from(at.deviation) / 100.0),
            model_from_cameras: made.map(|made| {
                let map = &made.model_from_cameras;
                let row = |row: usize| [0, 1, 2].map(|column| map.rotation[(row, column)]);
                SimilarityFacts {
                    scale: map.scale,
                    rotation: [row(0), row(1), row(2)],
                    translation_m: map.translation.into(),
                }
            }),
        }
    }
}

/// What is still wanted for a position from a frame of this building.
fn missing(change: &Change, stored: Option<&StoredModel<'_>>) -> Vec<&'static str> {
    let facts = stored.map(StoredModel::facts);
    let lacking = [
        (stored.is_none(), "model"),
        (facts.is_some_and(|facts| facts.scale_error.is_none()), "scale"),
        (facts.is_some_and(|facts| facts.azimuth.is_none()), "facing"),
        (change.position.is_none(), "position"),
    ];
    lacking.into_iter().filter(|(lacks, _)| *lacks).map(|(_, what)| what).collect()
}

fn model_lines(outcome: Option<&ModelOutcome>, stored: Option<&StoredModel<'_>>, missing: &[&str]) -> String {
    let mut text = match outcome {
        Some(ModelOutcome::Made(made)) => format!(
            "  model: {} of {} corners have a place, {} by several views, {} on the surface between\n",
            made.triangulated + made.on_surface,
            made.triangulated + made.on_surface + made.without,
            made.triangulated,
            made.on_surface,
        ),
        Some(ModelOutcome::Kept(points)) => format!("  model: the table's stays, with {}\n", count(*points, "point")),
        // One picture is the usual case, and nothing is wrong with it.
        Some(ModelOutcome::Without(WithoutModel::OnePicture) | ModelOutcome::NotWanted) | None => String::new(),
        Some(ModelOutcome::Without(why)) => format!("  no model: {why}\n"),
    };
    if stored.is_some() && !missing.is_empty() {
        let give = missing.iter().map(|what| match *what {
            "scale" => "--height-m or --distance-m",
            "facing" => "--facing",
            _ => "--at",
        });
        let give: Vec<&str> = give.collect();
        text += "  a frame of it tells the side and the relative distance; for a position give ";
        text += &give.join(", ");
        text += "\n";
    }
    text
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
        Some((at, PositionFrom::Cameras)) => format!("  at {}, by the GPS data of the pictures\n", Shown(*at)),
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
