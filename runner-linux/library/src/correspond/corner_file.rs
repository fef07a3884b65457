//! Corners from a file, picked by hand or found by another program: CSV or JSON.
//!
//! ```text
//! # whatever a person wants to note
//! number,x_px,y_px
//! 1,209.865,202.442
//! 2,353.333,158.893
//! ```
//!
//! The first line that is no comment names the columns; their order is free and others are not looked at. Pixels count from
//! the centre of the top-left pixel, x right, y down. As JSON:
//! `{"width_px": 640, "height_px": 480, "corners": [{"number": 1, "x_px": 209.865, "y_px": 202.442}]}`; the size may be left
//! out.

use std::fmt;
use std::path::{Path, PathBuf};

use daymark_core::geometry::COORDINATE_LIMIT;
use daymark_core::point::{ImagePoint, SUBPIXEL};
use serde::Deserialize;

use super::{Corners, MOST_CORNERS};

/// The columns that a file must have.
const COLUMNS: [&str; 3] = ["number", "x_px", "y_px"];
/// Largest coordinate, px.
const MOST_PX: f64 = (COORDINATE_LIMIT / SUBPIXEL) as f64;

/// What is wrong with a file of corners: which file, where, and what to do.
#[derive(Debug)]
pub struct CornerFileError {
    path: PathBuf,
    /// "line 3", "corner 2", or nothing if it is about the whole.
    place: Option<String>,
    fault: String,
}

impl fmt::Display for CornerFileError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: ", self.path.display())?;
        if let Some(place) = &self.place {
            write!(out, "{place}: ")?;
        }
        out.write_str(&self.fault)
    }
}

impl std::error::Error for CornerFileError {}

/// One corner as a file gives it, and where it stands in the file.
struct Row {
    place: String,
    number: u32,
    at_px: [f64; 2],
}

#[derive(Deserialize)]
struct JsonFile {
    width_px: Option<u32>,
    height_px: Option<u32>,
    corners: Vec<JsonCorner>,
}

#[derive(Deserialize)]
struct JsonCorner {
    number: u32,
    x_px: f64,
    y_px: f64,
}

/// Reads a file of corners: JSON if it begins with `{`, otherwise CSV.
///
/// # Errors
/// A file that cannot be read; a missing column; what is no number; two corners of one number; more corners than
/// [`MOST_CORNERS`]. Each names the line, or in JSON the corner.
pub fn read_corners(path: &Path) -> Result<Corners, CornerFileError> {
    let fail = |place: Option<String>, fault: String| CornerFileError { path: path.to_owned(), place, fault };
    let bytes =
        std::fs::read(path).map_err(|error| fail(None, format!("{error}; give a file of corners, CSV or JSON")))?;
    let is_json = bytes.iter().find(|byte| !byte.is_ascii_whitespace()) == Some(&b'{');
    let (rows, size) = if is_json { of_json(&bytes) } else { of_csv(&bytes).map(|rows| (rows, None)) }
        .map_err(|(place, fault)| fail(place, fault))?;
    if rows.len() > MOST_CORNERS {
        let fault = format!("{} corners, at most {MOST_CORNERS} can be matched: leave out the weakest", rows.len());
        return Err(fail(None, fault));
    }
    let mut corners = Corners {
        name: path.to_string_lossy().into_owned(),
        numbers: Vec::with_capacity(rows.len()),
        places: Vec::with_capacity(rows.len()),
        size_px: [0, 0],
        file_from_working: 1.0,
        picture: None,
    };
    for (index, row) in rows.iter().enumerate() {
        if let Some(same) = rows[..index].iter().find(|other| other.number == row.number) {
            let fault = format!("number {} is taken already, by {}: each corner needs its own", row.number, same.place);
            return Err(fail(Some(row.place.clone()), fault));
        }
        for (column, value) in [("x_px", row.at_px[0]), ("y_px", row.at_px[1])] {
            if !(value.abs() <= MOST_PX) {
                let fault = format!("{column} is {value}; a coordinate is a number from -{MOST_PX} to {MOST_PX}");
                return Err(fail(Some(row.place.clone()), fault));
            }
        }
        let sixteenths = row.at_px.map(|value| (value * f64::from(SUBPIXEL)).round_ties_even() as i32);
        corners.numbers.push(row.number);
        corners.places.push(ImagePoint::new(sixteenths[0], sixteenths[1]));
    }
    corners.size_px = size.unwrap_or_else(|| around(&corners.places));
    Ok(corners)
}

type Fault = (Option<String>, String);

fn of_csv(bytes: &[u8]) -> Result<Vec<Row>, Fault> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes));
    let expected = format!("the first line names the columns {}, in any order", COLUMNS.join(", "));
    let heads = reader.headers().map_err(|error| (None, format!("is no CSV: {error}")))?.clone();
    if heads.is_empty() || heads.len() == 1 && heads[0].is_empty() {
        return Err((None, format!("is empty; {expected}")));
    }
    let line = |position: Option<&csv::Position>| position.map(|position| format!("line {}", position.line()));
    let column = |name: &str| {
        heads.iter().position(|head| head == name).ok_or_else(|| {
            let found = heads.iter().collect::<Vec<_>>().join(", ");
            (line(heads.position()), format!("the column {name} is missing, found are {found}; {expected}"))
        })
    };
    let [number, x, y] = [column("number")?, column("x_px")?, column("y_px")?];
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| (line(error.position()), format!("is no CSV: {error}")))?;
        let place = line(record.position());
        let field = |at: usize| {
            record.get(at).ok_or_else(|| {
                let fault = format!("{} columns, the first line names {}", record.len(), heads.len());
                (place.clone(), fault)
            })
        };
        let coordinate = |at: usize| {
            let text = field(at)?;
            let number = text.parse().ok().filter(|value: &f64| value.is_finite());
            number.ok_or_else(|| (place.clone(), format!("{} is {text:?}, not a number of pixels", &heads[at])))
        };
        let text = field(number)?;
        let whole = text.parse().map_err(|_| {
            (place.clone(), format!("number is {text:?}; a corner's number is a whole one from 0 to {}", u32::MAX))
        })?;
        let at_px = [coordinate(x)?, coordinate(y)?];
        rows.push(Row { place: place.clone().unwrap_or_default(), number: whole, at_px });
    }
    Ok(rows)
}

fn of_json(bytes: &[u8]) -> Result<(Vec<Row>, Option<[u32; 2]>), Fault> {
    let file: JsonFile = serde_json::from_slice(bytes).map_err(|error| {
        let form = r#"{"corners": [{"number": 1, "x_px": 20.5, "y_px": 7.25}]}"#;
        (None, format!("is not JSON of the form {form}: {error}"))
    })?;
    let row = |(index, corner): (usize, JsonCorner)| Row {
        place: format!("corner {}", index + 1),
        number: corner.number,
        at_px: [corner.x_px, corner.y_px],
    };
    let size = file.width_px.zip(file.height_px).map(|(width, height)| [width, height]);
    Ok((file.corners.into_iter().enumerate().map(row).collect(), size))
}

/// A frame around corners whose picture is not known: a tenth wider than they are, from the origin.
fn around(places: &[ImagePoint]) -> [u32; 2] {
    let most = |of: fn(&ImagePoint) -> i32| places.iter().map(of).max().unwrap_or(0).max(SUBPIXEL) / SUBPIXEL;
    let least = |of: fn(&ImagePoint) -> i32| places.iter().map(of).min().unwrap_or(0).max(0) / SUBPIXEL;
    // As much room after the last corner as there is before the first.
    [most(|p| p.x) + least(|p| p.x), most(|p| p.y) + least(|p| p.y)].map(|side| side as u32 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Corners, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let name = format!("{}: ", file.path().display());
        read_corners(file.path()).map_err(|error| error.to_string().replacen(&name, "", 1))
    }

    #[test]
    fn columns_in_any_order_comments_and_others_are_read() {
        let corners =
            read("\u{feff}# of the tower\ny_px, name, number ,x_px\n# a remark\n2.5,roof,7,1\r\n-1,,3,0.04\n").unwrap();
        assert_eq!(corners.numbers, [7, 3]);
        assert_eq!(corners.places, [ImagePoint::new(16, 40), ImagePoint::new(1, -16)]);
    }

    #[test]
    fn json_gives_the_same() {
        let text = r#" {"width_px": 8, "height_px": 4, "corners": [{"number": 7, "x_px": 1, "y_px": 2.5}]}"#;
        let corners = read(text).unwrap();
        assert_eq!((corners.numbers, corners.places), (vec![7], vec![ImagePoint::new(16, 40)]));
        assert_eq!(corners.size_px, [8, 4]);
    }

    #[test]
    fn a_fault_is_told_with_its_line() {
        let many = (0..=MOST_CORNERS).fold("number,x_px,y_px\n".to_owned(), |text, n| text + &format!("{n},1,2\n"));
        let cases = [
            ("", "is empty; the first line names the columns number, x_px, y_px, in any order"),
            ("number,x,y_px\n1,2,3\n", "line 1: the column x_px is missing, found are number, x, y_px; the first"),
            ("# a\nnumber,x_px,y_px\n1,2,3\n2,NaN,3\n", "line 4: x_px is \"NaN\", not a number of pixels"),
            ("number,x_px,y_px\n1,2,3\n1,5,6\n", "line 3: number 1 is taken already, by line 2"),
            ("number,x_px,y_px\n-1,2,3\n", "line 2: number is \"-1\"; a corner's number is a whole one from 0"),
            ("number,x_px,y_px\n1,2\n", "line 2: 2 columns, the first line names 3"),
            ("number,x_px,y_px\n1,2,1e9\n", "line 2: y_px is 1000000000; a coordinate is a number from"),
            (&many, "513 corners, at most 512 can be matched"),
            (r#"{"corners": [{"number": 1, "x_px": 1}]}"#, "is not JSON of the form"),
        ];
        for (text, expected) in cases {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(expected), "{error:?} instead of {expected:?}");
        }
    }
}
