//! What a calibration rests on, and what would make it better.

use core::fmt;

use super::solve::{Calibration, Fate};
use crate::camera_file::lens::Lens;

/// Cells of the frame along each side.
const CELLS: usize = 8;
/// Pictures of a good calibration, at least.
const GOOD_PICTURES: usize = 8;
/// A tilt that says much of the focal length, degrees.
const GOOD_TILT: f64 = 15.0;
/// Pictures with such a tilt, at least.
const TILTED_PICTURES: usize = 3;
/// A relative error of the focal length that is good enough for a position.
const GOOD_FOCAL_ERROR: f64 = 0.005;
/// A distance of corners as a share of the longer side that sharp pictures of a flat board stay below.
const GOOD_RMS: f64 = 0.001;

/// What of the frame had corners of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coverage {
    /// Share of 8 x 8 cells with a corner.
    pub share: f64,
    /// Corners in the left, middle and right third.
    pub columns: [usize; 3],
    /// Corners in the upper, middle and lower third.
    pub rows: [usize; 3],
    /// The largest distance from the middle of the frame, as a share of half its diagonal.
    pub radius: f64,
}

impl Coverage {
    pub(super) fn new(seen: &[[f64; 2]], [width, height]: [u32; 2]) -> Self {
        let [width, height] = [width, height].map(f64::from);
        let mut cells = [[false; CELLS]; CELLS];
        let mut coverage = Self { share: 0.0, columns: [0; 3], rows: [0; 3], radius: 0.0 };
        for &[x, y] in seen {
            let (x, y) = ((x + 0.5) / width, (y + 0.5) / height);
            let part = |at: f64, of: usize| ((at * of as f64).max(0.0) as usize).min(of - 1);
            cells[part(y, CELLS)][part(x, CELLS)] = true;
            coverage.columns[part(x, 3)] += 1;
            coverage.rows[part(y, 3)] += 1;
            let radius = libm::hypot((x - 0.5) * width, (y - 0.5) * height) / (0.5 * libm::hypot(width, height));
            coverage.radius = coverage.radius.max(radius);
        }
        let covered = cells.as_flattened().iter().filter(|cell| **cell).count();
        coverage.share = covered as f64 / (CELLS * CELLS) as f64;
        coverage
    }
}

/// What would make a calibration better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Advice {
    /// A third of the frame had no corner.
    NoCornerIn(&'static str),
    /// Few boards are tilted.
    TiltMore {
        /// Pictures with a good tilt.
        tilted: usize,
    },
    /// Few pictures.
    MorePictures {
        /// How many.
        used: usize,
    },
    /// The focal length could be known better.
    OpenFocalLength {
        /// Its relative standard deviation.
        relative_error: f64,
    },
    /// Corners are not where a lens of this kind would put them.
    LargeDistances {
        /// Root mean square, pixels.
        rms_px: f64,
    },
    /// The outer part of the frame is extrapolated.
    ReachOut {
        /// How far corners reached, as a share of half the diagonal.
        radius: f64,
    },
    /// The lens folds over in a corner of the frame.
    Folds,
}

impl Advice {
    /// The name in JSON.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::NoCornerIn(_) => "no_corner_in_third",
            Self::TiltMore { .. } => "tilt_more",
            Self::MorePictures { .. } => "more_pictures",
            Self::OpenFocalLength { .. } => "open_focal_length",
            Self::LargeDistances { .. } => "large_distances",
            Self::ReachOut { .. } => "reach_out",
            Self::Folds => "folds",
        }
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCornerIn(third) => {
                write!(f, "no corner of the board was in the {third} third of the frame: show it there too")
            }
            Self::TiltMore { tilted } => write!(
                f,
                "only {tilted} boards are tilted by more than {GOOD_TILT:.0} degrees: tilt it by 20 to 45, about both axes"
            ),
            Self::MorePictures { used } => {
                write!(f, "{used} pictures are few: {GOOD_PICTURES} to 20 from different sides are better")
            }
            Self::OpenFocalLength { relative_error } => write!(
                f,
                "the focal length is open by {:.1} %, and every distance with it: take more tilted pictures that fill the frame",
                100.0 * relative_error
            ),
            Self::LargeDistances { rms_px } => write!(
                f,
                "corners are {rms_px:.2} px beside where they should be: a board that is not flat, motion, or a lens that needs --k3"
            ),
            Self::ReachOut { radius } => write!(
                f,
                "corners reach {:.0} % of the way into the frame's corners, and the lens is a guess beyond: let the board touch them",
                100.0 * radius
            ),
            Self::Folds => f.write_str(
                "the distortion folds over in a corner of the frame, where no board was: nothing there can be used",
            ),
        }
    }
}

pub(super) fn advice(calibration: &Calibration, fates: &[Fate]) -> Vec<Advice> {
    let mut advice = Vec::new();
    let Coverage { columns, rows, radius, .. } = calibration.coverage;
    let thirds =
        columns.into_iter().zip(["left", "middle", "right"]).chain(rows.into_iter().zip(["upper", "middle", "lower"]));
    advice.extend(thirds.filter(|(count, _)| *count == 0).map(|(_, third)| Advice::NoCornerIn(third)));
    let tilts = fates.iter().filter_map(|fate| match fate {
        Fate::Used { tilt_degrees, .. } => Some(*tilt_degrees),
        _ => None,
    });
    let used = tilts.clone().count();
    let tilted = tilts.filter(|tilt| *tilt > GOOD_TILT).count();
    if tilted < TILTED_PICTURES {
        advice.push(Advice::TiltMore { tilted });
    }
    if used < GOOD_PICTURES {
        advice.push(Advice::MorePictures { used });
    }
    let relative_error = calibration.focal_error();
    if relative_error > GOOD_FOCAL_ERROR {
        advice.push(Advice::OpenFocalLength { relative_error });
    }
    let Lens { width, height, .. } = calibration.lens;
    if calibration.rms_px > GOOD_RMS * f64::from(width.max(height)) {
        advice.push(Advice::LargeDistances { rms_px: calibration.rms_px });
    }
    let corner = |x: u32, y: u32| [f64::from(x) - 0.5, f64::from(y) - 0.5];
    let corners = [corner(0, 0), corner(width, 0), corner(0, height), corner(width, height)];
    if corners.iter().any(|corner| calibration.lens.ideal_from_picture(*corner).is_none()) {
        advice.push(Advice::Folds);
    } else if radius < 0.75 {
        advice.push(Advice::ReachOut { radius });
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_counts_cells_and_thirds() {
        let coverage = Coverage::new(&[[0.0, 0.0], [639.0, 479.0], [320.0, 240.0], [322.0, 241.0]], [640, 480]);
        assert_eq!((coverage.columns, coverage.rows), ([1, 2, 1], [1, 2, 1]));
        assert!((coverage.share - 3.0 / 64.0).abs() < 1e-12 && coverage.radius > 0.99);
    }
}
