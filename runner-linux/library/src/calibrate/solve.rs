//! From boards in pictures to a lens, or to the reason why there is none.

use core::fmt;

use nalgebra::Matrix3;

use super::board::Board;
use super::quality::{Advice, Coverage, advice};
use super::refine::{Fit, Model, Shot, UNKNOWNS, adjust, fit};
use super::{FoundBoard, NoBoard, Seen, zhang};
use crate::camera_file::lens::Lens;
use crate::order;

/// Pictures it takes.
pub const FEWEST_PICTURES: usize = 3;
/// If no board is tilted more than this, focal length and distance cannot be told apart, degrees.
pub const LEAST_TILT: f64 = 8.0;
/// A relative error of the focal length that is no calibration.
pub const WORST_FOCAL_ERROR: f64 = 0.03;
/// Distances of corners that are no calibration, as a share of the longer side.
const WORST_RMS: f64 = 0.005;
/// A picture whose distances are this many times those of the middle one is set aside.
const BAD_PICTURE: f64 = 3.0;
/// And larger than this, pixels.
const BAD_PICTURE_PX: f64 = 0.4;
/// Corners beyond this many standard deviations are left out.
const BAD_CORNER: f64 = 4.0;
/// The median length of a plane Gaussian vector, in standard deviations of a coordinate.
const MEDIAN_LENGTH: f64 = 1.177_41;
/// Rounds in which pictures and corners are left out.
const ROUNDS: usize = 6;

/// What became of a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// It is part of the calibration.
    Used {
        /// Corners that count.
        corners: usize,
        /// Corners that lie beside where all others want them.
        left_out: usize,
        /// Root mean square distance of those that count, pixels.
        rms_px: f64,
        /// Angle between board and picture plane.
        tilt_degrees: f64,
        /// Whether towers said which corner is which.
        towers: bool,
    },
    /// There is no board in it.
    NoBoard(NoBoard),
    /// Its corners do not fit the lens of the others.
    Apart {
        /// Root mean square distance, pixels.
        rms_px: f64,
        /// That of the middle picture.
        middle_px: f64,
    },
    /// Its corners lie on a line.
    OnALine,
}

/// A calibrated lens.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The lens.
    pub lens: Lens,
    /// fx, fy, cx, cy, k1, k2, p1, p2, k3.
    pub numbers: [f64; UNKNOWNS],
    /// Their standard deviations, 0 for what was not adjusted.
    pub deviations: [f64; UNKNOWNS],
    /// Root mean square distance of the corners from where this lens wants them, pixels.
    pub rms_px: f64,
    /// Corners that count.
    pub corners: usize,
    /// What of the frame was covered.
    pub coverage: Coverage,
    /// What to do better.
    pub advice: Vec<Advice>,
    /// Each corner that counts, where it was seen.
    pub seen: Vec<[f64; 2]>,
}

impl Calibration {
    /// The larger relative standard deviation of the two focal lengths.
    pub fn focal_error(&self) -> f64 {
        let [fx, fy, ..] = self.numbers;
        let [dx, dy, ..] = self.deviations;
        (dx / fx).max(dy / fy)
    }
}

/// Why there is no calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoCalibration {
    /// Too few pictures with a board.
    TooFewPictures {
        /// With a board that fits.
        usable: usize,
        /// All.
        given: usize,
    },
    /// All boards are parallel to the picture.
    Parallel {
        /// The largest angle between a board and its picture.
        largest_tilt_degrees: f64,
    },
    /// No lens of this kind puts the corners where they are.
    NoLensFits {
        /// Root mean square distance of the best, pixels.
        rms_px: f64,
    },
    /// The pictures leave too much open.
    Uncertain {
        /// Relative standard deviation of the focal length; infinite if it is open.
        focal_error: f64,
        /// The largest angle between a board and its picture.
        largest_tilt_degrees: f64,
    },
}

impl NoCalibration {
    /// The name in JSON.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::TooFewPictures { .. } => "too_few_pictures",
            Self::Parallel { .. } => "parallel",
            Self::NoLensFits { .. } => "no_lens_fits",
            Self::Uncertain { .. } => "uncertain",
        }
    }
}

impl fmt::Display for NoCalibration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewPictures { usable, given } => write!(
                f,
                "the board was found in {usable} of {given} pictures, and {FEWEST_PICTURES} are the least; 10 to 20 make a good \
                 calibration"
            ),
            Self::Parallel { largest_tilt_degrees } => write!(
                f,
                "no board is tilted by more than {largest_tilt_degrees:.1} degrees against the picture, and without {LEAST_TILT} \
                 a longer lens looks like a shorter distance: tilt the board by 20 to 45 degrees, each time another way"
            ),
            Self::NoLensFits { rms_px } => write!(
                f,
                "the best lens misses the corners by {rms_px:.1} px: is the board flat, is --board right, and are all pictures \
                 of one camera with one focus and zoom? For a lens that bends very much try --k3"
            ),
            Self::Uncertain { focal_error, largest_tilt_degrees } => {
                if focal_error.is_finite() {
                    write!(f, "the focal length is open by {:.1} %", 100.0 * focal_error)?;
                } else {
                    f.write_str("the focal length is open")?;
                }
                write!(
                    f,
                    ", more than {:.0} %; the largest tilt is {largest_tilt_degrees:.0} degrees: take more pictures, with the board \
                     tilted by 20 to 45 degrees about both axes and filling the frame",
                    100.0 * WORST_FOCAL_ERROR
                )
            }
        }
    }
}

struct Picture<'p> {
    number: usize,
    found: &'p FoundBoard,
    tilt_degrees: f64,
    image_from_board: Matrix3<f64>,
}

/// The lens of these boards, and what became of each picture, in their order.
pub fn solve(
    found: &[Result<FoundBoard, NoBoard>],
    board: &Board,
    [width, height]: [u32; 2],
    with_k3: bool,
) -> (Result<Calibration, NoCalibration>, Vec<Fate>) {
    let mut fates = Vec::new();
    let mut pictures = Vec::new();
    for (number, found) in found.iter().enumerate() {
        let found = match found {
            Ok(found) => found,
            Err(reason) => {
                fates.push(Fate::NoBoard(*reason));
                continue;
            }
        };
        // Replaced below, unless nothing is known of the picture.
        fates.push(Fate::OnALine);
        if let Some(map) = zhang::image_from_board(board, &found.seen) {
            let tilt_degrees = zhang::tilt_degrees(&map, board);
            pictures.push(Picture { number, found, tilt_degrees, image_from_board: map });
        }
    }
    for picture in &pictures {
        fates[picture.number] = used(picture, &picture.found.seen, f64::NAN, picture.tilt_degrees);
    }
    let given = found.len();
    let size = Size { width, height, with_k3 };
    for _ in 0..given.max(1) {
        let largest_tilt_degrees = pictures.iter().map(|picture| picture.tilt_degrees).fold(0.0, f64::max);
        if pictures.len() < FEWEST_PICTURES {
            return (Err(NoCalibration::TooFewPictures { usable: pictures.len(), given }), fates);
        }
        if largest_tilt_degrees < LEAST_TILT {
            return (Err(NoCalibration::Parallel { largest_tilt_degrees }), fates);
        }
        let Some((model, shots, fit)) = size.adjusted(board, &pictures) else {
            return (Err(NoCalibration::Uncertain { focal_error: f64::INFINITY, largest_tilt_degrees }), fates);
        };
        let mut sorted = fit.rms_of_shots_px.clone();
        order::ascending(&mut sorted);
        let middle_px = sorted.get((sorted.len() - 1) / 2).copied().unwrap_or(0.0);
        // One at a time, the worst: it bends the lens for the others.
        let worst = fit.rms_of_shots_px.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        if let Some((at, &rms_px)) = worst
            && rms_px > BAD_PICTURE_PX.max(BAD_PICTURE * middle_px)
        {
            fates[pictures.remove(at).number] = Fate::Apart { rms_px, middle_px };
            continue;
        }
        for ((picture, shot), &rms_px) in pictures.iter().zip(&shots).zip(&fit.rms_of_shots_px) {
            let tilt = libm::acos(shot.pose.view_from_model[(2, 2)].abs().min(1.0)).to_degrees();
            fates[picture.number] = used(picture, &shot.seen, rms_px, tilt);
        }
        return (judged(&model, &shots, &fit, largest_tilt_degrees, &fates), fates);
    }
    (Err(NoCalibration::TooFewPictures { usable: 0, given }), fates)
}

fn used(picture: &Picture<'_>, seen: &[Seen], rms_px: f64, tilt_degrees: f64) -> Fate {
    let corners = seen.len();
    let left_out = picture.found.seen.len() - corners;
    Fate::Used { corners, left_out, rms_px, tilt_degrees, towers: picture.found.towers }
}

fn judged(
    model: &Model,
    shots: &[Shot],
    fit: &Fit,
    largest_tilt_degrees: f64,
    fates: &[Fate],
) -> Result<Calibration, NoCalibration> {
    let lens = model.lens();
    if fit.rms_px > WORST_RMS * f64::from(lens.width.max(lens.height)) {
        return Err(NoCalibration::NoLensFits { rms_px: fit.rms_px });
    }
    let seen: Vec<[f64; 2]> = shots.iter().flat_map(|shot| shot.seen.iter().map(|seen| seen.at)).collect();
    let coverage = Coverage::new(&seen, [lens.width, lens.height]);
    let mut calibration = Calibration {
        lens,
        numbers: model.numbers(),
        deviations: fit.deviations,
        rms_px: fit.rms_px,
        corners: seen.len(),
        coverage,
        advice: Vec::new(),
        seen,
    };
    let focal_error = calibration.focal_error();
    if !(focal_error < WORST_FOCAL_ERROR) {
        return Err(NoCalibration::Uncertain { focal_error, largest_tilt_degrees });
    }
    calibration.advice = advice(&calibration, fates);
    Ok(calibration)
}

#[derive(Debug, Clone, Copy)]
struct Size {
    width: u32,
    height: u32,
    with_k3: bool,
}

impl Size {
    /// The lens of these pictures; `None` if they leave it open.
    fn adjusted(self, board: &Board, pictures: &[Picture<'_>]) -> Option<(Model, Vec<Shot>, Fit)> {
        let maps: Vec<Matrix3<f64>> = pictures.iter().map(|picture| picture.image_from_board).collect();
        let longer = f64::from(self.width.max(self.height));
        let told = zhang::focal_length(&maps, self.width, self.height);
        // Distortion may bend the first guess; a few others cost nothing.
        let starts = told.into_iter().chain([0.8, 0.5, 1.5].map(|share| share * longer));
        let mut best: Option<(f64, Model, Vec<Shot>)> = None;
        for focal in starts {
            let mut model = Model::new(self.width, self.height, focal, self.with_k3);
            let mut shots = pictures
                .iter()
                .map(|picture| {
                    let pose = zhang::pose(&model.lens(), &picture.image_from_board)?;
                    Some(Shot { seen: picture.found.seen.clone(), pose })
                })
                .collect::<Option<Vec<_>>>()?;
            adjust(&mut model, board, &mut shots, f64::INFINITY);
            let Some(rms) = fit(&model, board, &shots).map(|fit| fit.rms_px) else { continue };
            if rms.is_finite() && model.lens().focal.iter().all(|f| *f > 0.0) && best.as_ref().is_none_or(|b| rms < b.0)
            {
                best = Some((rms, model, shots));
            }
            // One pixel in a thousand: nothing better is to be expected elsewhere.
            if best.as_ref().is_some_and(|best| best.0 < 1e-3 * longer) {
                break;
            }
        }
        let (_, mut model, mut shots) = best?;
        for _ in 0..ROUNDS {
            let now = fit(&model, board, &shots)?;
            let sigma = (median(now.distances_px.iter().flatten().copied().collect()) / MEDIAN_LENGTH).max(1e-6);
            adjust(&mut model, board, &mut shots, 3.0 * sigma);
            let distances = fit(&model, board, &shots)?.distances_px;
            let mut left_out = 0;
            for (shot, distances) in shots.iter_mut().zip(&distances) {
                let keep: Vec<bool> = distances.iter().map(|distance| *distance <= BAD_CORNER * sigma).collect();
                let kept = keep.iter().filter(|keep| **keep).count();
                // A picture that is wrong as a whole is set aside as a whole.
                if 2 * kept < shot.seen.len() || kept == shot.seen.len() {
                    continue;
                }
                left_out += shot.seen.len() - kept;
                let mut keep = keep.into_iter();
                shot.seen.retain(|_| keep.next().unwrap_or(true));
            }
            adjust(&mut model, board, &mut shots, f64::INFINITY);
            if left_out == 0 {
                break;
            }
        }
        let fit = fit(&model, board, &shots)?;
        Some((model, shots, fit))
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    order::ascending(&mut values);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
