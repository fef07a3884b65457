//! What is known of the cameras: their files, a focal length on the command line, or EXIF.

use std::path::{Path, PathBuf};

use daymark_core::fix::{LocalFrame, Wgs84};

use crate::camera_file::lens::{Lens, Pose};
use crate::camera_file::{CameraFileError, FileCamera, cameras as read};
use crate::command::CommandError;
use crate::enroll::position;
use crate::lens_source::ExifFocal;
use crate::synthesize::reconstruct::Cameras;
use crate::synthesize::view::View;

/// The lens of each picture (for its own size), and the places if they are known.
pub(in crate::command) fn cameras(
    images: &[PathBuf],
    sizes: &[[u32; 2]],
    files: &[PathBuf],
    focal_px: Option<f64>,
    fixed_lens: bool,
) -> Result<(Vec<Lens>, Cameras), CommandError> {
    if !files.is_empty() {
        return from_files(images, sizes, files);
    }
    if let Some(focal) = focal_px {
        let longest = sizes.iter().flatten().copied().max().unwrap_or(0);
        if !(focal > 0.1 * f64::from(longest) && focal < 100.0 * f64::from(longest)) {
            return Err(format!("a focal length of {focal} pixels does not fit pictures of {longest} pixels").into());
        }
        let lenses = sizes.iter().map(|&[width, height]| Lens::of_focal(width, height, focal)).collect();
        return Ok((lenses, Cameras::Unknown { free_lens: !fixed_lens }));
    }
    let focal: Vec<Option<f64>> = images
        .iter()
        .zip(sizes)
        .map(|(path, &[width, height])| Some(ExifFocal::of_picture(path)?.in_pixels(width, height)?.0))
        .collect();
    if focal.iter().any(Option::is_none) {
        // Nothing is known: affine cameras need no focal length. Any number keeps the lens a lens.
        let lenses = sizes.iter().map(|&[width, height]| Lens::of_focal(width, height, f64::from(width.max(height))));
        return Ok((lenses.collect(), Cameras::Affine));
    }
    let lenses = focal
        .into_iter()
        .flatten()
        .zip(sizes)
        .map(|(focal, &[width, height])| Lens::of_focal(width, height, focal))
        .collect();
    // EXIF rounds to a millimetre.
    Ok((lenses, Cameras::Unknown { free_lens: !fixed_lens }))
}

fn from_files(images: &[PathBuf], sizes: &[[u32; 2]], files: &[PathBuf]) -> Result<(Vec<Lens>, Cameras), CommandError> {
    let mut found: Vec<(&Path, Vec<FileCamera>)> = Vec::new();
    for path in files {
        found.push((path, read(path)?));
    }
    let chosen: Vec<(&Path, FileCamera)> = match found.as_slice() {
        // Pictures by name: with and without folders, as COLMAP writes them.
        [(path, cameras)] if cameras.iter().any(|camera| camera.picture.is_some()) => images
            .iter()
            .map(|image| {
                let name = View::name_of(image);
                let same = |camera: &&FileCamera| {
                    camera.picture.as_deref().is_some_and(|picture| View::name_of(Path::new(picture)) == name)
                };
                cameras.iter().find(same).map(|camera| (*path, camera.clone())).ok_or_else(|| CameraFileError {
                    path: path.to_path_buf(),
                    what: format!("it has {} pictures, and {name} is not among them", cameras.len()),
                })
            })
            .collect::<Result<_, _>>()?,
        [(path, cameras)] if cameras.len() == 1 && cameras[0].pose.is_none() => {
            images.iter().map(|_| (*path, cameras[0].clone())).collect()
        }
        several if several.len() == images.len() => {
            several.iter().filter_map(|(path, cameras)| Some((*path, cameras.first()?.clone()))).collect()
        }
        several => {
            return Err(format!(
                "--cameras needs a COLMAP folder, one lens, or one file for each picture: {} pictures, {} files",
                images.len(),
                several.len()
            )
            .into());
        }
    };
    let mut lenses = Vec::new();
    for ((path, camera), &[width, height]) in chosen.iter().zip(sizes) {
        let lens = camera.lens(width, height).map_err(|other| CameraFileError {
            path: path.to_path_buf(),
            what: format!(
                "it is for pictures of {} x {} pixels, and the picture has {} x {}",
                other.said[0], other.said[1], other.found[0], other.found[1]
            ),
        })?;
        lenses.push(lens);
    }
    let poses: Vec<Pose> = chosen.iter().filter_map(|(_, camera)| camera.pose).collect();
    if poses.len() == images.len() {
        return Ok((lenses, Cameras::Known(poses)));
    }
    // A calibrated lens is better than what a few pictures say about it.
    Ok((lenses, Cameras::Unknown { free_lens: false }))
}

/// Where pictures were taken by their EXIF: metres east and north of the first that says it.
pub(super) fn places(images: &[PathBuf]) -> Vec<Option<[f64; 2]>> {
    let places: Vec<Option<Wgs84>> = images.iter().map(|path| Some(position::of_camera(path)?.wgs84())).collect();
    let Some(origin) = places.iter().flatten().next() else { return vec![None; images.len()] };
    let frame = LocalFrame::new(*origin);
    let level = |place: Wgs84| {
        let [east, north, _] = frame.local_from_wgs84(place);
        [east, north]
    };
    places.into_iter().map(|place| place.map(level)).collect()
}
