//! Real pairs: photographs whose cameras are known, and facades whose planes were marked by hand.

use std::fs;
use std::path::Path;

use daymark_core::geometry::{HullLayers, Orientation, orientation};
use daymark_core::point::{ImagePoint, SUBPIXEL};
use daymark_core::transform::{Homography, Normalization, WeightedPair, fit_homography};
use serde::Deserialize;

use super::pair::{Pair, Truth, Whereabouts, pixels};
use super::towers::CORNER_NOISE_PX;
use crate::command::CommandError;
use crate::correspond::automatic;
use crate::engine::FRAME_SIDE;
use crate::order;
use crate::picture::read_gray;

/// Pictures of the set with cameras.
const PICTURES: usize = 8;
/// A marked plane counts from so many pairs on, and if its homography misses them by no more than this, px (median).
const LEAST_MARKS: usize = 6;
const MOST_MISS_PX: f64 = 2.0;
const MOST_MARKS: usize = 1_024;

/// A photograph at the working size.
struct Photo {
    corners: Vec<ImagePoint>,
    size_px: [usize; 2],
    /// Pixels of the file for one here.
    scale: f64,
}

fn photo(path: &Path, count: usize) -> Result<Photo, CommandError> {
    let image = read_gray(path)?;
    let scale = image.width.max(image.height) as f64 / FRAME_SIDE as f64;
    let image = image.scaled_to(FRAME_SIDE);
    Ok(Photo { corners: automatic::corners(&image, count)?, size_px: [image.width, image.height], scale })
}

fn pair(first: &Photo, second: &Photo, truth: Truth) -> Pair {
    Pair {
        corners: [first.corners.clone(), second.corners.clone()],
        undisturbed: second.corners.clone(),
        first_undisturbed: first.corners.clone(),
        area: (second.size_px[0] * second.size_px[1]) as f64,
        truth,
        noise_px: CORNER_NOISE_PX as f32,
    }
}

type Matrix = [[f64; 3]; 3];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|column: usize| (0..3).map(|i| row[i] * b[i][column]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    [0, 1, 2].map(|row: usize| a.map(|line| line[row]))
}

/// Calibration, rotation `world_from_view` and centre of a camera, as a `.camera` file has them.
struct Known {
    calibration: Matrix,
    world_from_view: Matrix,
    centre: [f64; 3],
}

impl Known {
    fn read(path: &Path) -> Result<Self, CommandError> {
        let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        // K by rows, the distortion, R by rows, C, and the size.
        let row = |from: usize| -> Result<[f64; 3], CommandError> {
            let row = numbers.get(from..from + 3).and_then(|row| row.try_into().ok());
            row.ok_or_else(|| format!("{}: {} numbers, at least 24 are expected", path.display(), numbers.len()).into())
        };
        Ok(Self {
            calibration: [row(0)?, row(3)?, row(6)?],
            world_from_view: [row(12)?, row(15)?, row(18)?],
            centre: row(21)?,
        })
    }

    /// `K^-1`: the calibration is upper triangular.
    fn rays(&self) -> Matrix {
        let [[f, skew, x], [_, g, y], _] = self.calibration;
        [[1.0 / f, -skew / (f * g), (skew * y - g * x) / (f * g)], [0.0, 1.0 / g, -y / g], [0.0, 0.0, 1.0]]
    }
}

/// `x2^T F x1 = 0` of two cameras `K (R^T | -R^T C)`, in pixels of pictures reduced by these scales.
///
/// `F = [e]_x K2 R2^T R1 K1^-1` with the epipole `e = K2 R2^T (C1 - C2)` (Hartley and Zisserman, 9.2.2).
fn fundamental(first: &Known, second: &Known, scales: [f64; 2]) -> Matrix {
    let view = times(&second.calibration, &transposed(&second.world_from_view));
    let apart = [0, 1, 2].map(|i: usize| first.centre[i] - second.centre[i]);
    let [x, y, z] = view.map(|row| (0..3).map(|i| row[i] * apart[i]).sum::<f64>());
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let matrix = times(&cross, &times(&view, &times(&first.world_from_view, &first.rays())));
    // Pixel areas align: the file's pixel is (x + 1/2) s - 1/2.
    let [one, two] = scales.map(|s| [[s, 0.0, s / 2.0 - 0.5], [0.0, s, s / 2.0 - 0.5], [0.0, 0.0, 1.0]]);
    times(&transposed(&two), &times(&matrix, &one))
}

/// The photographs with known cameras, in the order in which they were taken.
pub(super) struct WithCameras(Vec<(Photo, Known)>);

impl WithCameras {
    /// Reads them.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn read(folder: &Path, count: usize) -> Result<Self, CommandError> {
        let folder = folder.join("reconstruction/Herz-Jesus-P8");
        let read = |number: usize| {
            let name = format!("{number:04}.jpg");
            let known = Known::read(&folder.join("gt").join(format!("{name}.camera")))?;
            Ok((photo(&folder.join(name), count)?, known))
        };
        (0..PICTURES).map(read).collect::<Result<_, _>>().map(Self)
    }

    /// The pairs whose numbers differ by `step`.
    pub(super) fn pairs(&self, step: usize) -> Vec<Pair> {
        let of = |((first, a), (second, b)): (&(Photo, Known), &(Photo, Known))| {
            pair(first, second, Truth::Epipolar(fundamental(a, b, [first.scale, second.scale])))
        };
        self.0.iter().zip(self.0.iter().skip(step)).map(of).collect()
    }
}

fn both<T>(results: [Result<T, CommandError>; 2]) -> Result<[T; 2], CommandError> {
    let [first, second] = results;
    Ok([first?, second?])
}

/// Hand-marked matches: `x1, y1, x2, y2, plane`, plane 0 being none.
#[derive(Deserialize)]
struct Marks {
    rows: Vec<[f64; 5]>,
}

/// A plane of a facade: its outline in the first picture, and its map.
struct Plane {
    outline: Vec<ImagePoint>,
    second_from_first: Homography,
}

/// Pairs of facades with marked planes, in the order of their names.
///
/// # Errors
/// A folder or file that cannot be read.
pub(super) fn with_planes(folder: &Path, count: usize) -> Result<Vec<Pair>, CommandError> {
    let folder = folder.join("reconstruction/adelaide-plane-pairs");
    let fail = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let gt = folder.join("gt");
    let mut names = Vec::new();
    for entry in fs::read_dir(&gt).map_err(|error| fail(&gt, &error))? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        names.extend(name.strip_suffix("_planes.json").map(str::to_owned));
    }
    order::sort(&mut names);
    let mut pairs = Vec::new();
    for name in names {
        let path = gt.join(format!("{name}_planes.json"));
        let text = fs::read(&path).map_err(|error| fail(&path, &error))?;
        let marks: Marks = serde_json::from_slice(&text).map_err(|error| fail(&path, &error))?;
        let [first, second] = both([1, 2].map(|number| {
            let file = |end: &str| folder.join(format!("{name}_{number}.{end}"));
            photo(&Some(file("jpg")).filter(|path| path.exists()).unwrap_or_else(|| file("png")), count)
        }))?;
        let planes = planes(&marks, &first, &second);
        let places = first.corners.iter().map(|&corner| whereabouts(corner, &planes)).collect();
        pairs.push(pair(&first, &second, Truth::Places(places)));
    }
    Ok(pairs)
}

fn planes(marks: &Marks, first: &Photo, second: &Photo) -> Vec<Plane> {
    let most = marks.rows.iter().map(|row| row[4] as usize).max().unwrap_or(0);
    (1..=most).filter_map(|number| plane(marks, number, first, second)).collect()
}

/// The plane with this number, if it is marked well enough.
fn plane(marks: &Marks, number: usize, first: &Photo, second: &Photo) -> Option<Plane> {
    let reduced = |value: f64, scale: f64| ((value + 0.5) / scale - 0.5) as f32;
    let of_plane = marks.rows.iter().filter(|row| row[4] as usize == number).take(MOST_MARKS);
    let pairs: Vec<WeightedPair> = of_plane
        .map(|&[x1, y1, x2, y2, _]| WeightedPair {
            from: [x1, y1].map(|value| reduced(value, first.scale)),
            to: [x2, y2].map(|value| reduced(value, second.scale)),
            weight: 1.0,
        })
        .collect();
    if pairs.len() < LEAST_MARKS {
        return None;
    }
    let frame = |photo: &Photo| Normalization::of_frame(photo.size_px[0] as u16, photo.size_px[1] as u16);
    let map = fit_homography(&pairs, frame(first), frame(second), 0.0)?;
    let mut misses: Vec<f64> = pairs
        .iter()
        .map(|pair| {
            let [x, y] = map.apply(pair.from);
            let (dx, dy) = (f64::from(x - pair.to[0]), f64::from(y - pair.to[1]));
            libm::sqrt(dx * dx + dy * dy)
        })
        .collect();
    order::ascending(&mut misses);
    let corners: Vec<ImagePoint> = pairs
        .iter()
        .map(|pair| {
            let [x, y] = pair.from.map(|value| (value * SUBPIXEL as f32).round_ties_even() as i32);
            ImagePoint::new(x, y)
        })
        .collect();
    let mut hull = Box::new(HullLayers::<MOST_MARKS, { MOST_MARKS / 3 }>::new());
    hull.peel(&corners).ok()?;
    let outline: Vec<ImagePoint> = hull.layer(0).iter().map(|&vertex| corners[usize::from(vertex)]).collect();
    (misses[misses.len() / 2] <= MOST_MISS_PX && outline.len() > 2).then_some(Plane { outline, second_from_first: map })
}

/// Within the marks of one plane its map says where; elsewhere nobody knows.
fn whereabouts(corner: ImagePoint, planes: &[Plane]) -> Whereabouts {
    let within = |plane: &&Plane| {
        let next = plane.outline.iter().cycle().skip(1);
        let inside = |(&a, &b): (&ImagePoint, &ImagePoint)| orientation(a, b, corner) == Orientation::Clockwise;
        plane.outline.iter().zip(next).all(inside)
    };
    let mut of = planes.iter().filter(within);
    match (of.next(), of.next()) {
        (Some(plane), None) => {
            let [x, y] = pixels(corner).map(|value| value as f32);
            Whereabouts::At(plane.second_from_first.apply([x, y]).map(f64::from))
        }
        _ => Whereabouts::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_the_scene_satisfies_the_epipolar_constraint() {
        let calibration = [[500.0, 2.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]];
        let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let turned = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]];
        let first = Known { calibration, world_from_view: straight, centre: [1.0, 0.0, -3.0] };
        let second = Known { calibration, world_from_view: turned, centre: [-4.0, 0.5, -2.0] };
        let image = |camera: &Known, point: [f64; 3], scale: f64| {
            let apart = [0, 1, 2].map(|i: usize| point[i] - camera.centre[i]);
            let view = times(&camera.calibration, &transposed(&camera.world_from_view));
            let [x, y, z] = view.map(|row| (0..3).map(|i| row[i] * apart[i]).sum::<f64>());
            [x / z, y / z].map(|value| (value + 0.5) / scale - 0.5)
        };
        let matrix = fundamental(&first, &second, [2.0, 3.0]);
        for point in [[0.0, 0.0, 9.0], [2.0, -1.0, 7.0], [-1.5, 2.0, 12.0]] {
            let [x, y] = image(&first, point, 2.0);
            let [u, v] = image(&second, point, 3.0);
            let line = matrix.map(|row| row[0] * x + row[1] * y + row[2]);
            let away = (line[0] * u + line[1] * v + line[2]) / libm::sqrt(line[0] * line[0] + line[1] * line[1]);
            assert!(away.abs() < 1e-9, "{away}");
        }
    }
}
