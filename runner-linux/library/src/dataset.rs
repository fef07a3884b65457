//! A folder of pictures with a manifest that says what each of them shows.
//!
//! ```json
//! {
//!   "recognition": [{"building": "town hall", "gallery": ["hall/1.jpg"], "queries": ["hall/2.jpg"]}],
//!   "negatives": ["elsewhere/1.jpg"],
//!   "equivalent_buildings": [["town hall", "city hall"]]
//! }
//! ```
//!
//! Paths count from the folder. A picture may also be an object with its path as `file`. Other keys are not looked at.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// The manifest's name in its folder.
pub const MANIFEST: &str = "manifest.json";

/// What a dataset holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dataset {
    /// The folder.
    pub folder: PathBuf,
    /// The buildings, in the order of the manifest.
    pub buildings: Vec<Building>,
    /// Pictures that show none of the buildings.
    pub negatives: Vec<String>,
    /// Names that mean the same building, each with the one that stands for all.
    same: BTreeMap<String, String>,
}

/// A building of a dataset.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Building {
    /// Its name.
    #[serde(rename = "building")]
    pub name: String,
    /// Pictures to enroll, from the folder.
    #[serde(deserialize_with = "pictures")]
    pub gallery: Vec<String>,
    /// Pictures to recognize, from the folder.
    #[serde(default, deserialize_with = "pictures")]
    pub queries: Vec<String>,
}

#[derive(Deserialize)]
struct Manifest {
    recognition: Vec<Building>,
    #[serde(default, deserialize_with = "pictures")]
    negatives: Vec<String>,
    #[serde(default)]
    equivalent_buildings: Vec<Vec<String>>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a picture must be a path, or an object with the path as \"file\"")]
enum Picture {
    Path(String),
    Object { file: String },
}

fn pictures<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let pictures = Vec::<Picture>::deserialize(deserializer)?;
    Ok(pictures.into_iter().map(|(Picture::Path(path) | Picture::Object { file: path })| path).collect())
}

/// Why a folder cannot be used as a dataset. Nothing was changed.
#[derive(Debug)]
#[non_exhaustive]
pub enum DatasetError {
    /// There is no folder of this name.
    NoFolder(PathBuf),
    /// The manifest cannot be read.
    Read(PathBuf, std::io::Error),
    /// The manifest is no JSON, or not of the form.
    Form(PathBuf, serde_json::Error),
    /// The manifest names no building.
    NoBuildings(PathBuf),
    /// Two entries have this name.
    NameTwice(PathBuf, String),
    /// A building has no gallery picture.
    NoGallery(PathBuf, String),
    /// An equivalence names a building that the manifest does not have.
    NoSuchBuilding(PathBuf, String),
    /// Pictures that the manifest names are not there.
    MissingPictures(PathBuf, Vec<String>),
}

impl Dataset {
    /// Reads the manifest of a folder, and sees that every picture in it is there.
    ///
    /// # Errors
    /// [`DatasetError`], which names what to correct.
    pub fn open(folder: &Path) -> Result<Self, DatasetError> {
        let path = folder.join(MANIFEST);
        if !folder.is_dir() {
            return Err(DatasetError::NoFolder(folder.to_owned()));
        }
        let text = std::fs::read(&path).map_err(|error| DatasetError::Read(path.clone(), error))?;
        let manifest: Manifest =
            serde_json::from_slice(&text).map_err(|error| DatasetError::Form(path.clone(), error))?;
        let dataset = Self::new(folder, &path, manifest)?;
        let missing: Vec<String> =
            dataset.pictures().filter(|picture| !folder.join(picture).is_file()).map(str::to_owned).collect();
        if missing.is_empty() { Ok(dataset) } else { Err(DatasetError::MissingPictures(path, missing)) }
    }

    fn new(folder: &Path, path: &Path, manifest: Manifest) -> Result<Self, DatasetError> {
        let Manifest { recognition: buildings, negatives, equivalent_buildings } = manifest;
        if buildings.is_empty() {
            return Err(DatasetError::NoBuildings(path.to_owned()));
        }
        let mut names = BTreeSet::new();
        for building in &buildings {
            if !names.insert(building.name.as_str()) {
                return Err(DatasetError::NameTwice(path.to_owned(), building.name.clone()));
            }
            if building.gallery.is_empty() {
                return Err(DatasetError::NoGallery(path.to_owned(), building.name.clone()));
            }
        }
        let mut same: BTreeMap<String, String> = BTreeMap::new();
        for group in equivalent_buildings {
            if let Some(name) = group.iter().find(|name| !names.contains(name.as_str())) {
                return Err(DatasetError::NoSuchBuilding(path.to_owned(), name.clone()));
            }
            // Groups that share a name are one group; the least name stands for it.
            let roots: BTreeSet<String> = group.iter().map(|name| same.get(name).unwrap_or(name).clone()).collect();
            let Some(least) = roots.first().cloned() else { continue };
            for root in same.values_mut().filter(|root| roots.contains(*root)) {
                root.clone_from(&least);
            }
            same.extend(roots.into_iter().chain(group).map(|name| (name, least.clone())));
        }
        Ok(Self { folder: folder.to_owned(), buildings, negatives, same })
    }

    /// The one name that stands for a building and all that are equivalent to it.
    pub fn same<'a>(&'a self, name: &'a str) -> &'a str {
        self.same.get(name).map_or(name, String::as_str)
    }

    /// The gallery and query pictures of all buildings and the negatives.
    fn pictures(&self) -> impl Iterator<Item = &str> {
        let of_buildings = self.buildings.iter().flat_map(|building| building.gallery.iter().chain(&building.queries));
        of_buildings.chain(&self.negatives).map(String::as_str)
    }
}

impl fmt::Display for DatasetError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        const EXAMPLE: &str = r#"{"recognition": [{"building": "town hall", "gallery": ["1.jpg"], "queries": ["2.jpg"]}], "negatives": ["3.jpg"]}"#;
        match self {
            Self::NoFolder(folder) => {
                write!(out, "{} is no folder; give the folder that holds {MANIFEST}", folder.display())
            }
            Self::Read(path, error) => write!(
                out,
                "cannot read {}: {error}; a dataset is a folder of pictures with a {MANIFEST} such as\n  {EXAMPLE}",
                path.display()
            ),
            Self::Form(path, error) => {
                write!(out, "{} is not as it should be: {error}; it should look like\n  {EXAMPLE}", path.display())
            }
            Self::NoBuildings(path) => write!(
                out,
                "{} names no building: \"recognition\" is empty; it should look like\n  {EXAMPLE}",
                path.display()
            ),
            Self::NameTwice(path, name) => write!(
                out,
                "{} has two entries for the building {name:?}; put all its pictures into one",
                path.display()
            ),
            Self::NoGallery(path, name) => write!(
                out,
                "{}: the building {name:?} has no picture in \"gallery\"; give it one, or leave the building out",
                path.display()
            ),
            Self::NoSuchBuilding(path, name) => write!(
                out,
                "{}: \"equivalent_buildings\" names {name:?}, and \"recognition\" has no building of this name",
                path.display()
            ),
            Self::MissingPictures(path, missing) => {
                let shown = missing.iter().take(5).fold(String::new(), |list, picture| list + "\n  " + picture);
                let more = missing.len().saturating_sub(5);
                let rest = if more > 0 { format!("\n  and {more} more") } else { String::new() };
                let folder = path.parent().unwrap_or(Path::new("."));
                write!(
                    out,
                    "{} that {} names cannot be found; put what is missing into {}, or take it out of the manifest:{shown}{rest}",
                    crate::report::phrase::count(missing.len(), "picture"),
                    path.display(),
                    folder.display()
                )
            }
        }
    }
}

impl std::error::Error for DatasetError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Read(_, error) => Some(error),
            Self::Form(_, error) => Some(error),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Dataset, String> {
        let path = Path::new("pictures/manifest.json");
        let manifest = serde_json::from_str(text).map_err(|error| error.to_string())?;
        Dataset::new(Path::new("pictures"), path, manifest).map_err(|error| error.to_string())
    }

    #[test]
    fn unknown_keys_are_ignored_and_pictures_may_be_objects() {
        let dataset = read(
            r#"{"licences": {}, "recognition": [{"building": "a", "gallery": ["1"], "queries": [{"file": "2", "x": 1}], "n": 3}],
                "negatives": ["3", {"file": "4", "of": "sky"}]}"#,
        )
        .expect("a dataset");
        assert_eq!(dataset.negatives, ["3", "4"]);
        assert_eq!(dataset.pictures().collect::<Vec<_>>(), ["1", "2", "3", "4"]);
        assert_eq!(dataset.same("a"), "a");
    }

    #[test]
    fn equivalence_goes_through() {
        let buildings = ["a", "b", "c", "d", "e"].map(|name| format!(r#"{{"building": "{name}", "gallery": ["1"]}}"#));
        let recognition = buildings.join(",");
        let dataset = read(&format!(
            r#"{{"recognition": [{recognition}], "equivalent_buildings": [["d", "c"], ["b", "a"], ["c", "b"]]}}"#
        ))
        .expect("a dataset");
        assert_eq!(["a", "b", "c", "d", "e"].map(|name| dataset.same(name)), ["a", "a", "a", "a", "e"]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let wrong = |text: &str, part: &str| {
            let error = read(text).expect_err("refused");
            assert!(error.contains(part), "{error}");
        };
        wrong(r#"{"recognition": []}"#, "names no building");
        wrong(r#"{"negatives": []}"#, "missing field `recognition`");
        wrong(r#"{"recognition": [{"building": "a", "gallery": []}]}"#, r#"the building "a" has no picture"#);
        wrong(r#"{"recognition": [{"building": "a", "gallery": [7]}]}"#, "a picture must be a path");
        let a = r#"{"building": "a", "gallery": ["1"]}"#;
        wrong(&format!(r#"{{"recognition": [{a}, {a}]}}"#), r#"two entries for the building "a""#);
        wrong(
            &format!(r#"{{"recognition": [{a}], "equivalent_buildings": [["a", "z"]]}}"#),
            r#"names "z", and "recognition" has no"#,
        );
    }
}
