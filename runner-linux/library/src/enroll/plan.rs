//! What somebody wants enrolled, and the pictures of it, read by many threads in a fixed order.

use std::fmt;
use std::path::{Path, PathBuf};

use daymark_core::profile::Profile;
use daymark_core::table::{GeoPosition, Kind, LANDMARK_BYTES, encode_landmark};

use super::{TooFewCorners, position, view};
use crate::engine::FRAME_SIDE;
use crate::parallel;
use crate::picture::{GrayImage, PictureError, Reason, read_gray};
use crate::table_file::ViewEntry;

/// Failures that are told at once, at most.
const FAILURES_TOLD: usize = 10;

/// One building to enroll.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Its name in the table.
    pub name: String,
    /// What sort of thing it is, if it is said.
    pub kind: Option<Kind>,
    /// Where it stands, if it is said.
    pub position: Option<GeoPosition>,
    /// Its pictures.
    pub images: Vec<PathBuf>,
    /// What is known for its model.
    pub modelling: Modelling,
    /// Where the plan stands, to begin a message with; empty for the command line.
    pub origin: String,
}

/// What is known for a building's model, beside its pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Modelling {
    /// Nobody wants a model.
    pub unwanted: bool,
    /// Files of cameras.
    pub cameras: Vec<PathBuf>,
    /// Focal length, pixels of the pictures as they are.
    pub focal_px: Option<f64>,
    /// Metres between the cameras of the first two pictures.
    pub distance_m: Option<f64>,
    /// Metres from the lowest to the highest point of what the pictures show.
    pub height_m: Option<f64>,
    /// Azimuth towards which the front looks and its deviation, degrees.
    pub facing: Option<[f64; 2]>,
}

/// How well an azimuth is known if nobody says: a map or a compass tells it to that, degrees.
pub const FACING_ERROR_DEGREES: f64 = 5.0;

impl Modelling {
    /// Whether the numbers can be.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<(), String> {
        for (what, metres) in [("distance", self.distance_m), ("height", self.height_m)] {
            if let Some(metres) = metres.filter(|metres| !(*metres > 0.0 && *metres < 1e5)) {
                return Err(format!("{metres} m is no {what} at a building"));
            }
        }
        if self.distance_m.is_some() && self.height_m.is_some() {
            return Err("a distance and a height are two scales: give one of them".to_owned());
        }
        match self.facing {
            Some([degrees, _]) if !(0.0..=360.0).contains(&degrees) => {
                Err(format!("an azimuth of {degrees} degrees: give 0 to 360, from north over east"))
            }
            Some([_, deviation]) if !(0.0..=180.0).contains(&deviation) => {
                Err(format!("an azimuth that is uncertain by {deviation} degrees: give 0 to 180"))
            }
            _ => Ok(()),
        }
    }
}

/// A picture that is read and fit to be a view.
#[derive(Debug)]
pub struct Picture {
    /// The file.
    pub path: PathBuf,
    /// Its pixels, shrunk to [`FRAME_SIDE`].
    pub gray: GrayImage,
    /// What the table stores of it.
    pub view: ViewEntry,
    /// Where the camera stood, if the file says so.
    pub camera: Option<GeoPosition>,
}

/// Whether a table can hold this name; if not, why.
///
/// # Errors
/// The reason, and what to do.
pub fn check_name(name: &str) -> Result<(), String> {
    match encode_landmark(name, Kind::default(), None, &mut [0; LANDMARK_BYTES]) {
        Ok(_) => Ok(()),
        Err(error) => Err(format!("{error}; give another name")),
    }
}

/// Reads the pictures of all plans in the threads of the current pool. The result does not depend on their number.
/// `done` is called after each picture.
///
/// # Errors
/// [`PicturesError`]: all pictures that cannot be enrolled.
pub fn read_pictures(
    plans: &[Plan],
    profile: Profile,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Vec<Picture>>, PicturesError> {
    let all: Vec<(&Plan, &PathBuf)> =
        plans.iter().flat_map(|plan| plan.images.iter().map(move |path| (plan, path))).collect();
    // A path that is wrong is told before minutes of work.
    let missing = |(plan, path): &(&Plan, &PathBuf)| {
        let error = std::fs::metadata(path).err()?;
        let error = PictureError { path: (*path).clone(), reason: Reason::Io(error.to_string()) };
        Some(format!("{}{error}; correct the path", plan.origin))
    };
    PicturesError::of(all.iter().filter_map(missing).collect(), all.len())?;

    let results = parallel::map(&all, |(plan, path)| {
        let picture = read_picture(path, profile).map_err(|says| format!("{}{says}", plan.origin));
        done();
        picture
    });
    let (mut pictures, mut failures) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(picture) => pictures.push(picture),
            Err(failure) => failures.push(failure),
        }
    }
    PicturesError::of(failures, all.len())?;
    let mut pictures = pictures.into_iter();
    Ok(plans.iter().map(|plan| pictures.by_ref().take(plan.images.len()).collect()).collect())
}

fn read_picture(path: &Path, profile: Profile) -> Result<Picture, String> {
    let gray = read_gray(path).map_err(|error| error.to_string())?.scaled_to(FRAME_SIDE);
    let says = |error: TooFewCorners| format!("the picture {} cannot be enrolled: {error}", path.display());
    let view = view(&gray, profile).map_err(says)?;
    Ok(Picture { path: path.to_owned(), gray, view, camera: position::of_camera(path) })
}

/// Pictures that cannot be enrolled. Nothing was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PicturesError {
    failures: Vec<String>,
    pictures: usize,
}

impl PicturesError {
    fn of(failures: Vec<String>, pictures: usize) -> Result<(), Self> {
        if failures.is_empty() { Ok(()) } else { Err(Self { failures, pictures }) }
    }
}

impl fmt::Display for PicturesError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.failures.as_slice() {
            [only] => out.write_str(only)?,
            failures => {
                write!(out, "{} of {} pictures cannot be enrolled:", failures.len(), self.pictures)?;
                failures.iter().take(FAILURES_TOLD).try_for_each(|failure| write!(out, "\n  {failure}"))?;
                if let Some(more @ 1..) = failures.len().checked_sub(FAILURES_TOLD) {
                    write!(out, "\n  and {more} more")?;
                }
            }
        }
        write!(out, "{}Nothing was enrolled", if self.failures.len() == 1 { ". " } else { "\n" })
    }
}

impl std::error::Error for PicturesError {}
