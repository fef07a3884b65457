//! The file that names many buildings and their pictures.
//!
//! ```toml
//! [[building]]
//! name = "Old gate"
//! kind = "tower"              # optional
//! at = [52.5163, 13.3777]     # optional: degrees north, degrees east
//! position_error = 20         # optional: metres
//! facing = 184                # optional: azimuth towards which the front looks, degrees
//! facing_error = 5            # optional: degrees
//! cameras = ["cameras.yaml"]  # optional: as in `daymark synthesize`
//! focal_px = 3100             # optional, if EXIF data do not say it
//! distance_m = 12.5           # optional: between the first two cameras; or
//! height_m = 31               # optional: of what the pictures show
//! images = ["gate-1.jpg", "gate-2.jpg"]
//! ```
//!
//! Paths are relative to the manifest.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use daymark_core::table::Kind;
use serde::Deserialize;
use toml::Spanned;

use super::plan::{FACING_ERROR_DEGREES, Modelling, Plan, check_name};
use super::position::{GIVEN_ERROR_METRES, position};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default)]
    building: Vec<Building>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Building {
    name: Spanned<String>,
    kind: Option<Spanned<String>>,
    at: Option<Spanned<[f64; 2]>>,
    position_error: Option<Spanned<f64>>,
    images: Spanned<Vec<PathBuf>>,
    facing: Option<f64>,
    facing_error: Option<f64>,
    #[serde(default)]
    cameras: Vec<PathBuf>,
    focal_px: Option<f64>,
    distance_m: Option<f64>,
    height_m: Option<f64>,
}

/// Reads a manifest: one plan for each building, in its order.
///
/// # Errors
/// [`ManifestError`], which names the file and, where there is one, the line.
pub fn read(path: &Path) -> Result<Vec<Plan>, ManifestError> {
    let text = std::fs::read_to_string(path).map_err(|error| ManifestError {
        path: path.to_owned(),
        line: None,
        says: unreadable(&error),
    })?;
    parse(path, &text)
}

fn unreadable(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::InvalidData => "it is not a text file; give a TOML file that names the buildings".into(),
        std::io::ErrorKind::IsADirectory => "it is a folder; give the TOML file that names the buildings".into(),
        _ => format!("it cannot be read: {error}"),
    }
}

fn parse(path: &Path, text: &str) -> Result<Vec<Plan>, ManifestError> {
    let line_of = |span: Range<usize>| 1 + text.bytes().take(span.start).filter(|&byte| byte == b'\n').count();
    let fail = |line, says: String| ManifestError { path: path.to_owned(), line, says };
    let manifest: Manifest = toml::from_str(text)
        .map_err(|error| fail(error.span().map(line_of), error.message().trim_end().replace('\n', "; ")))?;
    if manifest.building.is_empty() {
        return Err(fail(None, "it names no building; begin each with [[building]]".into()));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut lines = BTreeMap::new();
    let mut plans = Vec::new();
    for building in manifest.building {
        let modelling = modelling(&building, folder);
        let Building { name, kind, at, position_error, images, .. } = building;
        let line = line_of(name.span());
        let name = name.into_inner();
        let wrong = |span, says: &str| fail(Some(line_of(span)), format!("building {name:?}: {says}"));
        check_name(&name).map_err(|says| fail(Some(line), format!("building {name:?}: {says}")))?;
        if let Some(first) = lines.insert(name.clone(), line) {
            let says =
                format!("building {name:?} is in line {first} already; put all its pictures there, or rename one");
            return Err(fail(Some(line), says));
        }
        let kind = kind.map(|kind| {
            let known = Kind::ALL.map(Kind::name).join(", ");
            let says = || format!("there is no kind {:?}; the kinds are {known}", kind.get_ref());
            Kind::from_name(kind.get_ref()).ok_or_else(|| wrong(kind.span(), &says()))
        });
        let error = position_error.as_ref().map_or(GIVEN_ERROR_METRES, |error| *error.get_ref());
        let place = match (&at, &position_error) {
            (Some(at), _) => {
                let &[latitude, longitude] = at.get_ref();
                Some(position(latitude, longitude, error).map_err(|error| wrong(at.span(), &error.to_string()))?)
            }
            (None, Some(error)) => {
                return Err(wrong(error.span(), "it has a position_error without a position; add at = [lat, lon]"));
            }
            (None, None) => None,
        };
        if images.get_ref().is_empty() {
            return Err(wrong(images.span(), "it has no pictures; name at least one in images"));
        }
        modelling.check().map_err(|says| fail(Some(line), format!("building {name:?}: {says}")))?;
        plans.push(Plan {
            modelling,
            kind: kind.transpose()?,
            position: place,
            images: images.into_inner().into_iter().map(|image| folder.join(image)).collect(),
            origin: format!("{}, line {line}, building {name:?}: ", path.display()),
            name,
        });
    }
    Ok(plans)
}

fn modelling(building: &Building, folder: &Path) -> Modelling {
    Modelling {
        unwanted: false,
        cameras: building.cameras.iter().map(|path| folder.join(path)).collect(),
        focal_px: building.focal_px,
        distance_m: building.distance_m,
        height_m: building.height_m,
        facing: building.facing.map(|azimuth| [azimuth, building.facing_error.unwrap_or(FACING_ERROR_DEGREES)]),
    }
}

/// A manifest that cannot be followed. Nothing was enrolled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestError {
    path: PathBuf,
    line: Option<usize>,
    says: String,
}

impl fmt::Display for ManifestError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "the manifest {}", self.path.display())?;
        if let Some(line) = self.line {
            write!(out, ", line {line}")?;
        }
        write!(out, ": {}. Nothing was enrolled", self.says)
    }
}

impl std::error::Error for ManifestError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn plans(text: &str) -> Result<Vec<Plan>, String> {
        parse(Path::new("town/m.toml"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_manifest_is_plans_in_its_order() {
        let text = r#"
            [[building]]
            name = "Old gate"
            kind = "tower"
            at = [52.5, -13]
            images = ["a.jpg", "/b.jpg"]
            [[building]]
            name = "Mill"
            images = ["c.jpg"]
        "#;
        let plans = plans(text).expect("plans");
        assert_eq!(plans.iter().map(|plan| plan.name.as_str()).collect::<Vec<_>>(), ["Old gate", "Mill"]);
        assert_eq!(plans[0].images, [Path::new("town/a.jpg"), Path::new("/b.jpg")]);
        assert_eq!(plans[0].kind, Some(Kind::Tower));
        let at = plans[0].position.expect("a position");
        assert_eq!((at.latitude_e7, at.longitude_e7, at.error_dm), (525_000_000, -130_000_000, 200));
        assert_eq!((plans[1].kind, plans[1].position), (None, None));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let said = |text: &str| plans(text).expect_err("refused");
        let one = |fields: &str| said(&format!("[[building]]\nname = \"Mill\"\n{fields}"));
        let expected = [
            (said(""), "m.toml: it names no building"),
            (said("# x\n[[building]]\nimages = []"), "line 2: missing field `name`"),
            (one(""), "line 1: missing field `images`"),
            (one("images = []"), "line 3: building \"Mill\": it has no pictures"),
            (one("images = \"a.jpg\""), "line 3: invalid type: string"),
            (one("image = [\"a.jpg\"]"), "line 3: unknown field `image`"),
            (
                one("kind = \"mill\"\nimages = [\"a\"]"),
                "line 3: building \"Mill\": there is no kind \"mill\"; the kinds",
            ),
            (one("at = [1]\nimages = [\"a\"]"), "line 3: invalid length 1"),
            (one("at = [91, 0]\nimages = [\"a\"]"), "line 3: building \"Mill\": the latitude 91"),
            (one("at = [1, 0]\nposition_error = -1\nimages = [\"a\"]"), "the position error -1"),
            (one("position_error = 1\nimages = [\"a\"]"), "line 3: building \"Mill\": it has a position_error without"),
            (
                one("images = [\"a\"]\n[[building]]\nname = \"Mill\"\nimages = [\"b\"]"),
                "line 5: building \"Mill\" is in line 2",
            ),
            (said("[[building]\nname = 1"), "line 1: "),
        ];
        for (said, expected) in expected {
            assert!(said.contains(expected), "{said:?} lacks {expected:?}");
            assert!(said.ends_with("Nothing was enrolled"), "{said}");
        }
    }
}
