//! What was read goes into the table: a new building, more views of one, or other views of one.

use std::path::PathBuf;

use daymark_core::table::{GeoPosition, Kind, corner_key};

use super::plan::{Picture, Plan};
use crate::order;
use crate::picture::GrayImage;
use crate::table_file::{LandmarkEntry, OwnedTable, ViewEntry};

/// Kind of a new building, if nobody says.
const KIND: Kind = Kind::Building;

/// What became of a plan.
#[derive(Debug)]
pub struct Change {
    /// The building's name.
    pub name: String,
    /// What happened to it.
    pub outcome: Outcome,
    /// Views that it had before.
    pub views_before: usize,
    /// Its position now, and how it is known.
    pub position: Option<(GeoPosition, PositionFrom)>,
    /// The plan's pictures, in its order.
    pub pictures: Vec<Enrolled>,
}

/// A picture, and its view in the table.
#[derive(Debug)]
pub struct Enrolled {
    /// The file.
    pub path: PathBuf,
    /// Its pixels.
    pub gray: GrayImage,
    /// Corners of its view.
    pub corners: usize,
    /// The place of its view among the building's views.
    pub place: usize,
    /// The table held exactly this view already.
    pub known: bool,
    /// Where the camera stood, if the file says so.
    pub camera: Option<GeoPosition>,
}

/// What happened to a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It is new.
    Added,
    /// It has more views now.
    Extended,
    /// Its views were taken out, and new ones put in.
    Replaced,
    /// All its pictures were in the table already.
    Unchanged,
}

/// How a position is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PositionFrom {
    /// Somebody said it now.
    Given,
    /// The table had it.
    Table,
    /// It is the camera's place as this picture says.
    Camera(PathBuf),
    /// The places of several cameras, and where the building stands to them.
    Cameras,
}

/// Puts the pictures of a plan into the table. With `replace`, they replace the views that the building had.
pub fn apply(table: &mut OwnedTable, plan: Plan, pictures: Vec<Picture>, replace: bool) -> Change {
    let index = table.landmarks.iter().position(|landmark| landmark.name == plan.name);
    let index = index.unwrap_or_else(|| {
        let entry = LandmarkEntry {
            name: plan.name.clone(),
            kind: plan.kind.unwrap_or(KIND),
            position: None,
            views: Vec::new(),
            model: None,
        };
        table.landmarks.push(entry);
        table.landmarks.len() - 1
    });
    let landmark = &mut table.landmarks[index];
    let views_before = landmark.views.len();
    landmark.kind = plan.kind.unwrap_or(landmark.kind);
    let camera = || {
        let seen = pictures.iter().find_map(|picture| picture.camera.map(|at| (at, picture.path.clone())));
        seen.map(|(at, path)| (at, PositionFrom::Camera(path)))
    };
    let given = plan.position.map(|at| (at, PositionFrom::Given));
    let position = given.or(landmark.position.map(|at| (at, PositionFrom::Table))).or_else(camera);
    landmark.position = position.as_ref().map(|(at, _)| *at);

    let before = if replace { std::mem::take(&mut landmark.views) } else { landmark.views.clone() };
    if replace {
        landmark.model = None;
    }
    let mut enrolled = Vec::new();
    for Picture { path, gray, view, camera } in pictures {
        let corners = view.features.len();
        let found = landmark.views.iter().position(|other| is_same(other, &view));
        let place = found.unwrap_or(landmark.views.len());
        if found.is_none() {
            landmark.views.push(view);
        }
        enrolled.push(Enrolled { path, gray, corners, place, known: found.is_some(), camera });
    }
    let same = before.len() == landmark.views.len() && before.iter().zip(&landmark.views).all(|(a, b)| is_same(a, b));
    let outcome = match (views_before, replace) {
        (0, _) => Outcome::Added,
        _ if same => Outcome::Unchanged,
        (_, true) => Outcome::Replaced,
        (_, false) => Outcome::Extended,
    };
    Change { name: plan.name, outcome, views_before, position, pictures: enrolled }
}

/// Whether two views are one to a table, which sorts the corners.
pub fn is_same(a: &ViewEntry, b: &ViewEntry) -> bool {
    let sorted = |view: &ViewEntry| {
        let mut features = view.features.clone();
        order::sort_by_key(&mut features, |feature| corner_key(feature).unwrap_or(u32::MAX));
        features
    };
    (a.width, a.height, a.features.len()) == (b.width, b.height, b.features.len()) && sorted(a) == sorted(b)
}
