//! `daymark table list`, `show` and `verify`.

use std::fmt::Write as _;
use std::path::Path;

use daymark_core::table::{Header, LandmarkTable};
use serde::Serialize;

use super::facts::{LandmarkFacts, SCHEMA_VERSION, TableFacts, ViewFacts};
use super::near::suggestion;
use super::print;
use crate::command::CommandError;
use crate::report::finding::Position;
use crate::report::phrase::{count, grouped, printable};
use crate::table_file::{TableFileError, open_table, read_table};

pub(super) fn list(path: &Path, json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Document {
        schema_version: u32,
        table: TableFacts,
        landmarks: Vec<LandmarkFacts>,
    }
    let bytes = read_table(path)?;
    let table = open_table(path, &bytes)?;
    let landmarks = (0..table.landmark_count())
        .map(|number| {
            let landmark = table.landmark(number)?;
            let model = table.model(number)?;
            Ok(LandmarkFacts::new(&landmark, &ViewFacts::all(&table, &landmark)?, model.as_ref()))
        })
        .collect::<Result<Vec<_>, CommandError>>()?;
    let table = TableFacts::new(path, table.header());
    let document = Document { schema_version: SCHEMA_VERSION, table, landmarks };
    print(json, &document, || {
        let mut text = document.table.line() + "\n";
        let names = document.landmarks.iter().map(|landmark| landmark.landmark.chars().count());
        let width = names.max().unwrap_or(0);
        for LandmarkFacts { landmark, kind, position, views, model_points, bytes } in &document.landmarks {
            let at = position.as_ref().map_or_else(String::new, |at| format!("  {}", place(at)));
            let (views, bytes) = (count(*views, "view"), grouped(*bytes as u64));
            let model =
                if *model_points > 0 { format!("  model of {}", count(*model_points, "point")) } else { String::new() };
            let _ =
                writeln!(text, "  {:width$}  {kind:10}  {views:>9}  {bytes:>9} bytes{model}{at}", printable(landmark));
        }
        text
    })
}

pub(super) fn show(path: &Path, name: &str, json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Document {
        schema_version: u32,
        table: TableFacts,
        #[serde(flatten)]
        landmark: LandmarkFacts,
        view_list: Vec<ViewFacts>,
    }
    let bytes = read_table(path)?;
    let table = open_table(path, &bytes)?;
    let landmarks = (0..table.landmark_count()).map(|number| table.landmark(number)).collect::<Result<Vec<_>, _>>()?;
    let Some((number, landmark)) = (0..).zip(&landmarks).find(|(_, landmark)| landmark.name == name) else {
        return Err(no_such_landmark(path, name, landmarks.iter().map(|landmark| landmark.name)));
    };
    let view_list = ViewFacts::all(&table, landmark)?;
    let model = table.model(number)?;
    let landmark = LandmarkFacts::new(landmark, &view_list, model.as_ref());
    let table = TableFacts::new(path, table.header());
    let document = Document { schema_version: SCHEMA_VERSION, table, landmark, view_list };
    print(json, &document, || {
        let LandmarkFacts { landmark, kind, position, views, model_points, bytes } = &document.landmark;
        let (views, bytes) = (count(*views, "view"), grouped(*bytes as u64));
        let mut text = format!("{}: {kind}, {views}, {bytes} bytes\n", printable(landmark));
        let _ = match position {
            Some(at) => writeln!(text, "  stands at {}", place(at)),
            None => writeln!(text, "  position unknown; `daymark enroll --at` tells the table"),
        };
        let _ = match model_points {
            0 => writeln!(text, "  no model; `daymark enroll` makes one from pictures of several places"),
            points => writeln!(text, "  model of {}; `daymark table model` writes it", count(*points, "point")),
        };
        for ViewFacts { view, width_px, height_px, corners, corners_per_level, bytes } in &document.view_list {
            let levels = corners_per_level.map(|corners| corners.to_string()).join(" + ");
            let bytes = grouped(*bytes as u64);
            let _ = writeln!(
                text,
                "  view {view}: {width_px} x {height_px} px, {corners} corners ({levels}, finest level first), {bytes} bytes"
            );
        }
        text
    })
}

pub(super) fn verify(path: &Path, json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Document {
        schema_version: u32,
        file: String,
        sound: bool,
        /// Nothing if not even the header can be read.
        table: Option<TableFacts>,
        faults: Vec<String>,
    }
    // A file that cannot be read is neither sound nor not.
    let result = read_table(path);
    let (header, faults) = match &result {
        Err(TableFileError::Table(_, error)) => (None, vec![error.to_string()]),
        Err(_) => return Err(result.map(|_| ()).expect_err("an error").into()),
        Ok(bytes) => (Header::decode(bytes).ok(), faults(bytes)),
    };
    let document = Document {
        schema_version: SCHEMA_VERSION,
        file: path.to_string_lossy().into_owned(),
        sound: faults.is_empty(),
        table: header.map(|header| TableFacts::new(path, &header)),
        faults,
    };
    if document.sound {
        return print(json, &document, || {
            let line = document.table.as_ref().map(TableFacts::line).unwrap_or_default();
            format!("{line}\nsound: every checksum and every record is right\n")
        });
    }
    if json {
        print(json, &document, String::new)?;
    }
    Err(format!("{} is not sound: {}", path.display(), document.faults.join("\n  ")).into())
}

/// Everything that is wrong with a table: what keeps it from being opened, or each damaged view.
fn faults(bytes: &[u8]) -> Vec<String> {
    let table = match LandmarkTable::open(bytes) {
        Ok(table) => table,
        Err(error) => return vec![error.to_string()],
    };
    let mut faults = Vec::new();
    for number in 0..table.landmark_count() {
        faults.extend(table.model(number).err().map(|error| error.to_string()));
        match table.landmark(number) {
            Ok(landmark) => faults.extend(landmark.views.filter_map(|number| {
                let error = table.view(number).err()?;
                Some(format!("landmark {:?}: {error}", landmark.name))
            })),
            Err(error) => faults.push(error.to_string()),
        }
    }
    faults
}

pub(super) fn no_such_landmark<'a>(path: &Path, name: &str, names: impl Iterator<Item = &'a str>) -> CommandError {
    let suggestion = suggestion(name, names);
    let path = path.display();
    format!("{path} has no landmark {name:?}: {suggestion}`daymark table list {path}` names all").into()
}

fn place(at: &Position) -> String {
    format!("{:.6}, {:.6} (within {:.0} m)", at.latitude_deg, at.longitude_deg, at.error_m)
}
