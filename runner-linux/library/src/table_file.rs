//! Landmark tables as files: read whole, built from what was enrolled, replaced atomically.
//!
//! The format and its checks are `daymark_core::table`'s; this file adds the file system. A table on disk is replaced
//! as a whole: the new bytes go to a temporary file in the same folder, to the disk, and then by renaming to the
//! table's name. A crash at any instant leaves the old table or the new one.

mod model_entry;
mod replace;

pub use model_entry::ModelEntry;
pub use replace::replace_file;

use crate::order;
use daymark_core::feature::Feature;
use daymark_core::profile::Profile;
use daymark_core::table::{
    CORNER_BYTES, EncodeError, GeoPosition, HEADER_BYTES, Header, Kind, LANDMARK_BYTES, LandmarkTable, TableEncoder,
    TableError, VIEW_HEADER_BYTES, corner_key, encode_landmark, encode_view,
};
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// A table that can be changed: what was enrolled, in memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnedTable {
    /// The class of device that the table is for.
    pub profile: Profile,
    /// The landmarks, in any order.
    pub landmarks: Vec<LandmarkEntry>,
}

/// A landmark with its views.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LandmarkEntry {
    /// Its name, unique in the table.
    pub name: String,
    /// What sort of thing it is.
    pub kind: Kind,
    /// Where it stands, if known.
    pub position: Option<GeoPosition>,
    /// Its views, at least one, in the order in which they were enrolled; the table keeps that order.
    pub views: Vec<ViewEntry>,
    /// Where corners of its views are in space, if that is known.
    pub model: Option<ModelEntry>,
}

/// One enrolled frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewEntry {
    /// Columns of the frame.
    pub width: u16,
    /// Rows of the frame.
    pub height: u16,
    /// Its corners, in any order.
    pub features: Vec<Feature>,
}

/// Why a table cannot be built: what was enrolled is to blame, and this says which part.
#[derive(Debug)]
#[non_exhaustive]
pub enum BuildError {
    /// A landmark cannot be stored; correct its name or position.
    Landmark(String, EncodeError),
    /// Two landmarks have this name; give one of them another.
    DuplicateName(String),
    /// A landmark has no view, so nothing could ever show it; enroll a view or leave it out.
    NoViews(String),
    /// A view of a landmark cannot be stored; the number counts from 0.
    View(String, usize, EncodeError),
    /// A landmark's model cannot be stored.
    Model(String, EncodeError),
    /// The table as a whole cannot be stored.
    Table(EncodeError),
}

/// Why a table file cannot be read or written.
#[derive(Debug)]
#[non_exhaustive]
pub enum TableFileError {
    /// The file cannot be read.
    Read(PathBuf, io::Error),
    /// The file was read and is no sound table.
    Table(PathBuf, TableError),
    /// What was enrolled does not make a table; nothing was written.
    Build(BuildError),
    /// The new table cannot be written; a table that was there is unchanged.
    Write(PathBuf, io::Error),
    /// A folder, a device or a pipe has the table's name; nothing was written.
    NotAFile(PathBuf),
    /// The new table is in place, but the disk did not confirm it; it may be the old one after a power failure.
    Unconfirmed(PathBuf, io::Error),
}

impl OwnedTable {
    /// A table with nothing enrolled.
    pub const fn new(profile: Profile) -> Self {
        Self { profile, landmarks: Vec::new() }
    }

    /// Copies everything that `table` holds.
    ///
    /// # Errors
    ///
    /// The first damaged or wrong record.
    pub fn from_table(table: &LandmarkTable<'_>) -> Result<Self, TableError> {
        let view = |number| {
            table.view(number).map(|view| ViewEntry {
                width: view.width(),
                height: view.height(),
                features: view.features().collect(),
            })
        };
        let landmark = |number| {
            let landmark = table.landmark(number)?;
            Ok(LandmarkEntry {
                name: landmark.name.to_owned(),
                kind: landmark.kind,
                position: landmark.position,
                views: landmark.views.map(view).collect::<Result<_, TableError>>()?,
                model: table.model(number)?.map(|model| ModelEntry::of(&model)),
            })
        };
        let landmarks = (0..table.landmark_count()).map(landmark).collect::<Result<_, TableError>>()?;
        Ok(Self { profile: table.profile(), landmarks })
    }

    /// Reads the table at `path`, all of it.
    ///
    /// # Errors
    ///
    /// [`TableFileError::Read`] or [`TableFileError::Table`].
    pub fn load(path: &Path) -> Result<Self, TableFileError> {
        let bytes = read_table(path)?;
        let table = open_table(path, &bytes)?;
        Self::from_table(&table).map_err(|error| TableFileError::Table(path.to_owned(), error))
    }

    /// The table's bytes: the same for the same landmarks, whatever the order of landmarks and of corners.
    ///
    /// # Errors
    ///
    /// The first landmark or view that cannot be stored.
    pub fn to_bytes(&self) -> Result<Vec<u8>, BuildError> {
        let mut landmarks: Vec<&LandmarkEntry> = self.landmarks.iter().collect();
        order::sort_by(&mut landmarks, |a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
        if let Some(twice) = landmarks.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(BuildError::DuplicateName(twice[0].name.clone()));
        }
        if let Some(landmark) = landmarks.iter().find(|landmark| landmark.views.is_empty()) {
            return Err(BuildError::NoViews(landmark.name.clone()));
        }
        let views = || landmarks.iter().flat_map(|landmark| &landmark.views);
        let most_corners = views().map(|view| view.features.len()).max().unwrap_or(0);
        // What does not fit the types is beyond the limits, and the encoder says so of the largest number as well.
        let corners_limit = u16::try_from(most_corners.max(self.profile.corners_per_view())).unwrap_or(u16::MAX);
        let landmark_count = u32::try_from(landmarks.len()).unwrap_or(u32::MAX);
        let view_count = u32::try_from(views().count()).unwrap_or(u32::MAX);
        let has_models = landmarks.iter().any(|landmark| landmark.model.is_some());
        let new = if has_models { TableEncoder::with_models } else { TableEncoder::new };
        let mut encoder = new(self.profile, corners_limit, landmark_count, view_count).map_err(BuildError::Table)?;

        let mut table = vec![0; HEADER_BYTES];
        let mut records = Vec::new();
        for landmark in &landmarks {
            let mut buffer = [0; LANDMARK_BYTES];
            let entry = encode_landmark(&landmark.name, landmark.kind, landmark.position, &mut buffer)
                .and_then(|record| {
                    records.extend_from_slice(record);
                    encoder.push_landmark(record)
                })
                .map_err(|error| BuildError::Landmark(landmark.name.clone(), error))?;
            table.extend(entry);
        }
        for (number, landmark) in (0..).zip(&landmarks) {
            for (place, view) in landmark.views.iter().enumerate() {
                let entry = encode_sorted(corners_limit, view)
                    .and_then(|record| {
                        records.extend_from_slice(&record);
                        encoder.push_view(number, &record)
                    })
                    .map_err(|error| BuildError::View(landmark.name.clone(), place, error))?;
                table.extend(entry);
            }
        }
        for landmark in landmarks.iter().filter(|_| has_models) {
            let views = u32::try_from(landmark.views.len()).unwrap_or(u32::MAX);
            let record = landmark.model.as_ref().map(|model| model.encode(corners_limit, &landmark.views)).transpose();
            let entry = record
                .and_then(|record| {
                    records.extend(record.iter().flatten());
                    encoder.push_model(views, record.as_deref())
                })
                .map_err(|error| BuildError::Model(landmark.name.clone(), error))?;
            table.extend(entry);
        }
        let header = encoder.finish().map_err(BuildError::Table)?;
        table.splice(..HEADER_BYTES, header);
        table.append(&mut records);
        Ok(table)
    }

    /// Writes the table to `path`, in place of a table that is there, and returns its bytes.
    ///
    /// # Errors
    ///
    /// Anything but [`TableFileError::Read`] and [`TableFileError::Table`].
    pub fn save(&self, path: &Path) -> Result<Vec<u8>, TableFileError> {
        let bytes = self.to_bytes().map_err(TableFileError::Build)?;
        replace_file(path, &bytes)?;
        Ok(bytes)
    }
}

fn encode_sorted(corners_limit: u16, view: &ViewEntry) -> Result<Vec<u8>, EncodeError> {
    let mut features = view.features.clone();
    // A corner that has no place in any view sorts to the end and is refused there.
    order::sort_by_key(&mut features, |feature| corner_key(feature).unwrap_or(u32::MAX));
    let mut record = vec![0; VIEW_HEADER_BYTES + features.len() * CORNER_BYTES];
    let length = encode_view(corners_limit, view.width, view.height, &features, &mut record)?.len();
    record.truncate(length);
    Ok(record)
}

/// Reads the bytes of the table at `path`. A file that is something else is refused after its first 40 bytes, however
/// long it is. The records are not checked yet: that is [`open_table`].
///
/// # Errors
///
/// [`TableFileError::Read`] or [`TableFileError::Table`].
pub fn read_table(path: &Path) -> Result<Vec<u8>, TableFileError> {
    let read = |error| TableFileError::Read(path.to_owned(), error);
    let file = File::open(path).map_err(read)?;
    let mut bytes = Vec::new();
    (&file).take(HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(read)?;
    Header::decode(&bytes).map_err(|error| TableFileError::Table(path.to_owned(), error))?;
    file.take(u64::from(u32::MAX)).read_to_end(&mut bytes).map_err(read)?;
    Ok(bytes)
}

/// Opens the table that [`read_table`] has read from `path`, and checks every record once, so that walking it is
/// cheap afterwards.
///
/// # Errors
///
/// [`TableFileError::Table`].
pub fn open_table<'b>(path: &Path, bytes: &'b [u8]) -> Result<LandmarkTable<'b>, TableFileError> {
    LandmarkTable::open(bytes)
        .and_then(LandmarkTable::verified)
        .map_err(|error| TableFileError::Table(path.to_owned(), error))
}

impl fmt::Display for BuildError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Landmark(name, error) => write!(out, "landmark {name:?}: {error}"),
            Self::DuplicateName(name) => write!(out, "two landmarks are called {name:?}: give one another name"),
            Self::NoViews(name) => write!(out, "landmark {name:?} has no view: enroll one, or leave it out"),
            Self::View(name, view, error) => write!(out, "landmark {name:?}, view {view}: {error}"),
            Self::Model(name, error) => write!(out, "landmark {name:?}, model: {error}"),
            Self::Table(error) => error.fmt(out),
        }
    }
}

impl std::error::Error for BuildError {}

impl fmt::Display for TableFileError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(path, error) => {
                let advice = match error.kind() {
                    ErrorKind::NotFound => "enroll a landmark first, or give the path of a table",
                    ErrorKind::IsADirectory => "give the path of the table in the folder",
                    ErrorKind::PermissionDenied => "ask for permission to read it",
                    _ => "see to the disk",
                };
                write!(out, "cannot read {}: {error}; {advice}", path.display())
            }
            Self::Table(path, error) => write!(out, "{}: {error}", path.display()),
            Self::Build(error) => write!(out, "nothing was written: {error}"),
            Self::Write(path, error) => {
                let advice = match error.kind() {
                    ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "make room on the disk",
                    ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                        "the folder must be writable, for the new table is made beside the old one"
                    }
                    ErrorKind::NotFound | ErrorKind::NotADirectory => "make the folder first",
                    _ => "see to the disk",
                };
                write!(out, "cannot write {}: {error}; {advice}. A table that was there is unchanged", path.display())
            }
            Self::NotAFile(path) => {
                write!(out, "cannot write {}: it is a folder or a device; give the path of a file", path.display())
            }
            Self::Unconfirmed(path, error) => write!(
                out,
                "{} is written, but the disk did not confirm it: {error}; save again before the power goes",
                path.display()
            ),
        }
    }
}

impl std::error::Error for TableFileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Read(_, error) | Self::Write(_, error) | Self::Unconfirmed(_, error) => Some(error),
            Self::Table(_, error) => Some(error),
            Self::Build(error) => Some(error),
            Self::NotAFile(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_core::point::ImagePoint;
    use daymark_core::table::RecordFault;
    use std::fs;

    fn view(seed: u64) -> ViewEntry {
        let corner = |n: u64| Feature {
            position: ImagePoint::new(((n * 7_919 + seed) % 1_000 * 8) as i32, (n * 16) as i32),
            level: (n % 5) as u8,
            commonness: (n % 8) as i8 - 1,
            signature: daymark_core::feature::Signature([n, seed]),
        };
        ViewEntry { width: 640, height: 480, features: (0..100).map(corner).collect() }
    }

    fn landmark(name: &str, views: &[u64]) -> LandmarkEntry {
        let views = views.iter().copied().map(view).collect();
        LandmarkEntry { name: name.to_owned(), kind: Kind::Tower, position: None, views, model: None }
    }

    fn two_landmarks() -> OwnedTable {
        let landmarks = vec![landmark("east tower", &[1, 2]), landmark("west tower", &[3])];
        OwnedTable { profile: Profile::Handheld, landmarks }
    }

    /// The names in `folder`: nothing temporary may stay.
    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| entry.expect("an entry").file_name().into_string().expect("UTF-8");
        let mut names: Vec<_> = fs::read_dir(folder).expect("a folder").map(name).collect();
        order::sort(&mut names);
        names
    }

    #[test]
    fn order_of_landmarks_and_corners_does_not_change_the_bytes() {
        let sorted = two_landmarks().to_bytes().expect("a table");
        let mut other = two_landmarks();
        other.landmarks.reverse();
        other.landmarks.iter_mut().flat_map(|landmark| &mut landmark.views).for_each(|view| view.features.reverse());
        assert_eq!(other.to_bytes().expect("a table"), sorted);
        other.landmarks[1].views.reverse();
        assert_ne!(other.to_bytes().expect("a table"), sorted, "the order of enrollment is content");
    }

    #[test]
    fn what_is_saved_is_loaded() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("town.daymark");
        let bytes = two_landmarks().save(&path).expect("saved");
        assert_eq!(fs::read(&path).expect("a file"), bytes);
        assert_eq!(bytes.len(), 40 + 2 * (12 + 3 + 10) + 3 * 2_021);
        let loaded = OwnedTable::load(&path).expect("loaded");
        assert_eq!(loaded.to_bytes().expect("a table"), bytes);
        assert_eq!(loaded.landmarks.len(), 2);
        let numbers = loaded.landmarks.iter().map(|landmark| landmark.views.len()).collect::<Vec<_>>();
        assert_eq!(numbers, [2, 1]);
        let table = open_table(&path, &bytes).expect("sound");
        assert_eq!(OwnedTable::from_table(&table), Ok(loaded));
        assert_eq!(names(folder.path()), ["town.daymark"]);
    }

    #[test]
    fn what_cannot_be_read_is_named_with_what_to_do() {
        let folder = tempfile::tempdir().expect("a folder");
        let said = |path: &Path| OwnedTable::load(path).expect_err("no table").to_string();
        let missing = folder.path().join("town.daymark");
        assert!(said(&missing).contains("enroll a landmark first"), "{}", said(&missing));
        assert!(said(folder.path()).contains("give the path of the table in the folder"), "{}", said(folder.path()));
        // Endless, and refused by its first bytes.
        assert!(said(Path::new("/dev/zero")).contains("not a landmark table"), "{}", said(Path::new("/dev/zero")));
        let mut bytes = two_landmarks().to_bytes().expect("a table");
        *bytes.last_mut().expect("a byte") ^= 1;
        fs::write(&missing, &bytes).expect("a file");
        let damaged = OwnedTable::load(&missing).expect_err("damaged");
        let expected = format!("{}: view 2 is damaged", missing.display());
        assert!(damaged.to_string().starts_with(&expected), "{damaged}");
        assert!(open_table(&missing, &bytes).is_err(), "every record is checked at once");
        bytes.push(0);
        fs::write(&missing, &bytes).expect("a file");
        assert!(said(&missing).contains("ends after"), "{}", said(&missing));
    }

    #[test]
    fn what_cannot_be_stored_is_named_and_not_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("town.daymark");
        let said = |landmarks: Vec<LandmarkEntry>| {
            let table = OwnedTable { profile: Profile::Handheld, landmarks };
            table.save(&path).expect_err("refused").to_string()
        };
        let twice = said(vec![landmark("tower", &[1]), landmark("tower", &[2])]);
        assert!(twice.contains(r#"two landmarks are called "tower""#), "{twice}");
        let none = said(vec![landmark("tower", &[])]);
        assert!(none.contains(r#"landmark "tower" has no view"#), "{none}");
        let name = said(vec![landmark("tow\ner", &[1])]);
        assert!(
            name.contains(r#"landmark "tow\ner": the record cannot be stored: its name holds a control"#),
            "{name}"
        );
        let mut outside = landmark("tower", &[1, 2]);
        outside.views[1].features[7].position.x = -1;
        let corner = said(vec![outside]);
        assert!(corner.contains(r#"landmark "tower", view 1: "#) && corner.contains("at -1, "), "{corner}");
        let mut off_grid = landmark("tower", &[1]);
        off_grid.views[0].features[7].position.x += 1;
        let corner = said(vec![off_grid]);
        assert!(corner.contains(r#"landmark "tower", view 0: "#) && corner.contains("the grid of 1/8 px"), "{corner}");
        let mut common = landmark("tower", &[1]);
        common.views[0].features[7].commonness = 7;
        let corner = said(vec![common]);
        assert!(corner.contains("commonness 7, allowed are -1 to 6"), "{corner}");
        let mut large = landmark("tower", &[1]);
        large.views[0].features.push(Feature { level: 4, ..Feature::default() });
        let large = OwnedTable { profile: Profile::Handheld, landmarks: vec![large] };
        assert!(matches!(large.to_bytes(), Err(BuildError::Table(EncodeError::Header(_)))));
        let mut double = landmark("tower", &[1]);
        double.views[0].features[1] = Feature { commonness: 6, ..double.views[0].features[0] };
        let double = OwnedTable { profile: Profile::Handheld, landmarks: vec![double] };
        let Err(BuildError::View(_, 0, EncodeError::Record(RecordFault::Corner { index: 1, .. }))) = double.to_bytes()
        else {
            panic!("two corners at one place")
        };
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_view_of_more_corners_than_enrollment_keeps_raises_the_tables_limit() {
        let mut views = vec![view(1)];
        let more = |n: i32| Feature { position: ImagePoint::new(2 * n, 0), ..Feature::default() };
        views[0].features = (0..500).map(more).collect();
        let landmark = LandmarkEntry { views, ..landmark("tower", &[]) };
        let limit = |table: &OwnedTable| Header::decode(&table.to_bytes().expect("a table")).map(|h| h.corners_limit());
        assert_eq!(limit(&OwnedTable { profile: Profile::Board, landmarks: vec![landmark] }), Ok(500));
        assert_eq!(limit(&OwnedTable { profile: Profile::Board, ..two_landmarks() }), Ok(400));
    }
}
