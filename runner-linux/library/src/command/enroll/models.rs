//! Models for what was enrolled: each building with two or more new pictures.

use std::path::PathBuf;

use daymark_core::fix::LocalFrame;
use daymark_core::table::GeoPosition;

use crate::command::CommandError;
use crate::command::synthesize::cameras::cameras;
use crate::enroll::model::{Known, KnownScale, Modelled, Shot, WithoutModel, model};
use crate::enroll::plan::Modelling;
use crate::enroll::position::{CAMERA_ERROR_METRES, position};
use crate::enroll::update::{Change, PositionFrom};
use crate::parallel;
use crate::picture::{PictureError, read_gray};
use crate::synthesize::view::View;
use crate::table_file::OwnedTable;

/// Longer side of the pictures from which the cameras are placed.
const SIDE: usize = 1_600;

/// What became of a building's model.
#[derive(Debug)]
pub(super) enum ModelOutcome {
    /// A new one is in the table.
    Made(Box<Modelled>),
    /// The table's stays; the new pictures would give one with fewer points, or none.
    Kept(usize),
    /// There is none.
    Without(WithoutModel),
    /// Nobody wants one.
    NotWanted,
}

/// Makes the models, several buildings at a time. The table does not depend on how many.
///
/// # Errors
/// Cameras or pictures that cannot be used; nothing was written.
pub(super) fn add_models(
    table: &mut OwnedTable,
    changes: &mut [Change],
    wishes: &[Modelling],
    done: &(dyn Fn() + Sync),
) -> Result<Vec<ModelOutcome>, CommandError> {
    let made: Vec<Result<Option<Result<Modelled, WithoutModel>>, String>> = {
        let table = &*table;
        let work: Vec<(&Change, &Modelling)> = changes.iter().zip(wishes).collect();
        parallel::map(&work, |(change, wish)| {
            let made = one(table, change, wish).map_err(|error| format!("{}: {error}", change.name));
            done();
            made
        })
    };
    let mut outcomes = Vec::new();
    for (change, made) in changes.iter_mut().zip(made) {
        let made = made?;
        let Some(landmark) = table.landmarks.iter_mut().find(|landmark| landmark.name == change.name) else { continue };
        let kept = landmark.model.as_ref().map(crate::table_file::ModelEntry::points);
        outcomes.push(match (made, kept) {
            (None, None) => ModelOutcome::NotWanted,
            (None | Some(Err(_)), Some(points)) => ModelOutcome::Kept(points),
            (Some(Ok(new)), Some(points)) if new.entry.points() < points => ModelOutcome::Kept(points),
            (Some(Err(why)), None) => ModelOutcome::Without(why),
            (Some(Ok(new)), _) => {
                landmark.model = Some(new.entry.clone());
                if let Some(at) = new.origin.and_then(|origin| origin_position(change, origin))
                    && !matches!(change.position, Some((_, PositionFrom::Given)))
                {
                    landmark.position = Some(at);
                    change.position = Some((at, PositionFrom::Cameras));
                }
                ModelOutcome::Made(Box::new(new))
            }
        });
    }
    Ok(outcomes)
}

type Made = Option<Result<Modelled, WithoutModel>>;

fn one(table: &OwnedTable, change: &Change, wish: &Modelling) -> Result<Made, CommandError> {
    let Some(landmark) = table.landmarks.iter().find(|landmark| landmark.name == change.name) else { return Ok(None) };
    if wish.unwanted {
        return Ok(None);
    }
    if change.pictures.len() < 2 {
        return Ok(Some(Err(WithoutModel::OnePicture)));
    }
    let pictures: Vec<_> = parallel::try_map(&change.pictures, |picture| {
        let gray = read_gray(&picture.path)?;
        let size = [gray.width as u32, gray.height as u32];
        Ok::<_, PictureError>((gray.scaled_to(SIDE), size))
    })?;
    let sizes: Vec<[u32; 2]> = pictures.iter().map(|(_, size)| *size).collect();
    let images: Vec<PathBuf> = change.pictures.iter().map(|picture| picture.path.clone()).collect();
    let (lenses, cameras) = cameras(&images, &sizes, &wish.cameras, wish.focal_px, false)?;
    let frame = place_frame(change);
    let shots = change.pictures.iter().zip(pictures).zip(lenses).map(|((picture, (gray, _)), lens)| Shot {
        full: View {
            name: View::name_of(&picture.path),
            lens: lens.scaled_to(gray.width as u32, gray.height as u32),
            gray,
            rgb: Vec::new(),
        },
        small: &picture.gray,
        stored: (&landmark.views[picture.place], picture.place as u16),
        place: frame.zip(picture.camera).map(|(frame, at)| {
            let [east, north, _] = frame.local_from_wgs84(at.wgs84());
            [east, north]
        }),
    });
    let scale = match (wish.distance_m, wish.height_m) {
        (Some(metres), _) => KnownScale::Distance(metres),
        (_, Some(metres)) => KnownScale::Height(metres),
        _ => KnownScale::Places,
    };
    Ok(Some(model(shots.collect(), &Known { cameras, scale, facing: wish.facing })))
}

/// The east-north-up frame at the first picture that says where it was taken.
fn place_frame(change: &Change) -> Option<LocalFrame> {
    change.pictures.iter().find_map(|picture| picture.camera).map(|at| LocalFrame::new(at.wgs84()))
}

/// Where the model's origin is, by the pictures' places.
fn origin_position(change: &Change, [east, north]: [f64; 2]) -> Option<GeoPosition> {
    let at = place_frame(change)?.wgs84_from_local([east, north, 0.0]);
    let receivers = change.pictures.iter().filter_map(|picture| picture.camera);
    // What a single picture's place allows for the way to the building is known now.
    let error = receivers.map(|at| at.error_m() - CAMERA_ERROR_METRES).fold(10.0, f64::max);
    position(at.latitude_deg, at.longitude_deg, error).ok()
}
