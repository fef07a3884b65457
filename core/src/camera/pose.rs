//! The camera's pose from points of a model and where they are seen, some of them wrongly.
//!
//! 1. POSIT from all points (`posit`), which is enough if hardly any correspondence is wrong;
//!    otherwise from drawn triples, the pose that most points agree with (`draw`).
//! 2. Gauss-Newton steps to full perspective (`adjust`): three with Tukey's weights in gates of 32, 12 and 6 deviations, two
//!    with the points within 3.72 deviations (of which a right correspondence stays out once in a thousand times).
//! 3. A model that is rather flat shows almost the same from two sides (Necker's reversal): the other pose is
//!    refined too, and named if it explains the frame about as well.
//! 4. Whether chance would do as well (`log2_chance`), how well the pose is known, what weak perspective would cost.
//!
//! ```
//! use daymark_core::camera::{Intrinsics, pose::{PointInView, PoseSettings, PoseSolver}};
//!
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! // Eight corners of a house, 10 m wide, 8 m deep and 6 m high, as a camera 30 m in front of it sees them.
//! let lens = Intrinsics::centred(560.0, 640, 480)?;
//! let corners = [[-5.0, 0.0, 0.0], [5.0, 0.0, 0.0], [-5.0, 8.0, 0.0], [5.0, 8.0, 0.0]];
//! let corners = [0.0, 6.0].map(|z| corners.map(|[x, y, _]| [x, y, z])).concat();
//! let seen = |[x, y, z]: [f64; 3]| lens.project([x, 1.7 - z, y + 30.0]).expect("in front");
//! let pairs: Vec<_> = corners.iter().map(|&model| PointInView { model, image: seen(model) }).collect();
//!
//! let pose = PoseSolver::<64>::new().solve(&pairs, &lens, &PoseSettings::of_frame(640, 480))?;
//! let [x, y, z] = pose.camera_from_model.centre();
//! assert!(x.abs() < 1e-3 && (y + 30.0).abs() < 1e-3 && (z - 1.7).abs() < 1e-3);
//! assert_eq!(pose.inliers, 8);
//! # Ok(())
//! # }
//! ```

use core::fmt;

use heapless::Vec;

use super::adjust::Problem;
use super::intrinsics::Intrinsics;
use super::placement::CameraFromModel;
use super::posit::Sight;
use super::solve::Question;
use super::space::{Matrix, Vector, axes, dot, length, minus, plus, scaled};
use super::weak_perspective::{ErrorBound, TooDeep};
use crate::math::sqrt_f64;

/// Correspondences without which there is no pose: three have up to four poses and no check.
pub const LEAST_POINTS: usize = 4;
/// Points on a line: the second axis of the model is less than this share of the first.
const COLLINEAR: f64 = 1e-4;

/// A point of the model and where the camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointInView {
    /// In the model's frame of reference, metres.
    pub model: [f64; 3],
    /// In the frame, pixels; lens distortion taken out.
    pub image: [f64; 2],
}

/// What is known beforehand, and what is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSettings {
    /// Standard deviation of a right correspondence's image coordinate, pixels.
    pub deviation_px: f64,
    /// Width and height of the frame, pixels: where wrong correspondences may lie.
    pub frame_px: [f64; 2],
    /// The share of right correspondences, at least.
    pub least_share: f64,
    /// The base-2 logarithm of how many poses chance may make as good as this one, at most.
    pub log2_chance: f64,
    /// A direction of the model frame in which the camera must lie from the points: the outside of a facade. Without it a
    /// flat model and its mirror image cannot be told apart.
    pub front: Option<[f64; 3]>,
    /// What weak perspective may cost before the pose reports it as too deep, pixels.
    pub weak_tolerance_px: f64,
}

impl PoseSettings {
    /// Corners found to half a pixel, half of them right at least, a pose by chance once in a million times, five
    /// pixels for weak perspective.
    pub const fn of_frame(width: u32, height: u32) -> Self {
        Self {
            deviation_px: 0.5,
            frame_px: [width as f64, height as f64],
            least_share: 0.5,
            log2_chance: -20.0,
            front: None,
            weak_tolerance_px: 5.0,
        }
    }
}

/// Where the camera stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The camera.
    pub camera_from_model: CameraFromModel,
    /// Covariance of its centre in the model frame (metres) and of a small turn in the camera frame (radians): x, y, z, and
    /// about right, down, forward. Scaled up if the residuals are larger than the deviation that was said.
    pub covariance: [[f64; 6]; 6],
    /// Correspondences that agree.
    pub inliers: usize,
    /// All correspondences.
    pub points: usize,
    /// Root mean square distance of those that agree, pixels.
    pub residual_px: f64,
    /// The base-2 logarithm of how many poses chance makes that are as good: a bound by counting (a-contrario, Moisan and Stival,
    /// IJCV 57, 2004), for wrong correspondences anywhere in the frame.
    pub log2_chance: f64,
    /// Middle of all correspondences' points in the model frame, metres.
    pub centroid: [f64; 3],
    /// Appendix A: what weak perspective costs the points that agree, or by how much it is out of its range.
    pub weak_perspective: Result<ErrorBound, TooDeep>,
    /// The other side, if the frame does not tell which it is.
    pub rival: Option<CameraFromModel>,
}

impl Pose {
    /// From the camera to the middle of the points, metres.
    pub fn range(&self) -> f64 {
        length(minus(self.camera_from_model.centre(), self.centroid))
    }

    /// The same pose if lengths, or the focal length, are known to this share only (one standard deviation): the range is
    /// uncertain by as much, so that `share^2 d d^T` is added to the centre's covariance, with `d` from the middle of the
    /// points to the centre.
    #[must_use]
    pub fn with_range_error(&self, share: f64) -> Self {
        let away = minus(self.camera_from_model.centre(), self.centroid);
        let mut covariance = self.covariance;
        for (row, x) in covariance.iter_mut().zip(away) {
            for (entry, y) in row.iter_mut().zip(away) {
                *entry += share * share * x * y;
            }
        }
        Self { covariance, ..*self }
    }

    /// Standard deviation of the centre in the direction that is known worst, metres.
    pub fn deviation(&self) -> f64 {
        let [a, b, c, ..] = self.covariance;
        let part: Matrix = [a, b, c].map(|[x, y, z, ..]| [x, y, z]);
        sqrt_f64(axes(&part).values[0])
    }
}

/// Why there is no pose. Not an error: it is what many frames are like.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NoPose {
    /// Fewer correspondences than a pose and its check need.
    TooFew {
        /// Correspondences.
        found: usize,
    },
    /// More correspondences than the solver holds: give it the best ones.
    TooMany {
        /// Correspondences.
        found: usize,
        /// What the solver holds.
        capacity: usize,
    },
    /// A coordinate or a setting is not a number that can be used.
    NotFinite,
    /// The model's points lie on a line, around which the camera could be anywhere, or in one place.
    Collinear,
    /// The image is a line: the model is seen edge-on.
    EdgeOn {
        /// Deviation of the image across the line, pixels.
        across_px: f64,
    },
    /// No pose has enough correspondences on its side: another building, or too many wrong correspondences.
    NoConsensus {
        /// Correspondences that agree with the best pose.
        inliers: usize,
        /// All.
        points: usize,
    },
    /// One plane of the model fits and nothing beside it: a mirror image, or another building with a facade like it.
    OnePlane {
        /// Correspondences on the plane that agree.
        inliers: usize,
        /// Correspondences off the plane, none of which agrees.
        off_plane: usize,
    },
    /// Chance would do as well.
    ByChance {
        /// Correspondences that agree.
        inliers: usize,
        /// See [`Pose::log2_chance`].
        log2_chance: f64,
    },
    /// The points are seen from behind their front: a mirror image.
    Mirrored,
    /// The points leave the position open.
    Undetermined {
        /// Its deviation, metres; infinite if nothing is known.
        deviation_m: f64,
    },
}

impl fmt::Display for NoPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFew { found } => {
                write!(f, "{found} corners with known places are seen, a position needs {LEAST_POINTS}")
            }
            Self::TooMany { found, capacity } => write!(f, "{found} corners, there is room for {capacity}"),
            Self::NotFinite => f.write_str("a coordinate or a setting is not a finite number in its range"),
            Self::Collinear => f.write_str("the corners lie on a line: the camera could be anywhere around it"),
            Self::EdgeOn { across_px } => {
                write!(
                    f,
                    "the corners are seen edge-on, {across_px:.1} px thin: look at the building from another side"
                )
            }
            Self::NoConsensus { inliers, points } => {
                write!(
                    f,
                    "only {inliers} of {points} corners fit one position: another building, or too many wrong matches"
                )
            }
            Self::OnePlane { inliers, off_plane } => write!(
                f,
                "{inliers} corners of one plane fit a position, and none of {off_plane} beside it: a mirror image, or another building"
            ),
            Self::ByChance { inliers, log2_chance } => {
                write!(f, "{inliers} corners fit one position, which chance does too (log2 {log2_chance:.1})")
            }
            Self::Mirrored => f.write_str("the facade is seen from behind: a mirror image"),
            Self::Undetermined { deviation_m } => {
                write!(
                    f,
                    "the corners leave the position open, by {deviation_m:.1} m: more of the building must be seen"
                )
            }
        }
    }
}

impl core::error::Error for NoPose {}

/// Working memory for up to `POINTS` correspondences.
#[derive(Debug, Clone)]
pub struct PoseSolver<const POINTS: usize> {
    sights: Vec<Sight, POINTS>,
}

impl<const POINTS: usize> Default for PoseSolver<POINTS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const POINTS: usize> PoseSolver<POINTS> {
    /// Empty: 40 bytes a point.
    pub const fn new() -> Self {
        Self { sights: Vec::new() }
    }

    /// The pose, or why there is none. The same correspondences in the same order give the same bits.
    ///
    /// # Errors
    /// [`NoPose`].
    pub fn solve(
        &mut self,
        points: &[PointInView],
        intrinsics: &Intrinsics,
        settings: &PoseSettings,
    ) -> Result<Pose, NoPose> {
        let centroid = self.centre(points, intrinsics, settings)?;
        let axes = axes(&scatter(&self.sights));
        let [first, second, _] = axes.values;
        if !(second > COLLINEAR * COLLINEAR * first) {
            return Err(NoPose::Collinear);
        }
        Question::new(Problem { sights: &self.sights, intrinsics }, settings).answer(&axes, centroid)
    }

    /// Fills the working memory with points about their centroid, and gives that.
    fn centre(
        &mut self,
        points: &[PointInView],
        intrinsics: &Intrinsics,
        settings: &PoseSettings,
    ) -> Result<Vector, NoPose> {
        if points.len() < LEAST_POINTS {
            return Err(NoPose::TooFew { found: points.len() });
        }
        if points.len() > POINTS {
            return Err(NoPose::TooMany { found: points.len(), capacity: POINTS });
        }
        let sum = points.iter().fold([0.0; 3], |sum, point| plus(sum, point.model));
        let centroid = scaled(sum, 1.0 / points.len() as f64);
        let [width, height] = settings.frame_px;
        let usable = |number: f64| number > 0.0 && number.is_finite();
        let image = points.iter().all(|point| point.image.iter().all(|x| x.is_finite()));
        if !image
            || !dot(centroid, centroid).is_finite()
            || ![settings.deviation_px, width, height].into_iter().all(usable)
        {
            return Err(NoPose::NotFinite);
        }
        self.sights.clear();
        for point in points {
            let sight = Sight { point: minus(point.model, centroid), ray: intrinsics.ray(point.image) };
            if self.sights.push(sight).is_err() {
                return Err(NoPose::TooMany { found: points.len(), capacity: POINTS });
            }
        }
        Ok(centroid)
    }
}

fn scatter(sights: &[Sight]) -> Matrix {
    let mut sum = [[0.0; 3]; 3];
    for Sight { point, .. } in sights {
        for (row, entry) in sum.iter_mut().zip(point) {
            *row = plus(*row, scaled(*point, *entry));
        }
    }
    sum
}
