//! Without a lens: from which side a building is seen, and between which distances.
//!
//! The direction hardly depends on the focal length (under weak perspective not at all), the range is proportional to it. So the
//! pose is solved for focal lengths from the shortest to the longest that a camera may have, and all answers that the frame does not
//! exclude are kept: where perspective is strong, few are left and the interval is short.

use super::intrinsics::Intrinsics;
use super::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use super::space::{dot, length, minus, scaled, unit};

/// Focal lengths that are tried, by equal factors.
const STEPS: u32 = 9;
/// A focal length is excluded if its pose is worse by more: chi-square of one degree, 99.7 %.
const EXCLUDED: f64 = 9.0;
/// What a correspondence that does not agree costs, in squared deviations.
const DISAGREES: f64 = 13.815_510_557_964_274;

/// From where a building is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// From the middle of the corners towards the observer, in the model frame, length one.
    pub towards_observer: [f64; 3],
    /// Cosine of the largest angle by which another focal length or the noise (two deviations) turns it, at most.
    pub cosine_of_error: f64,
    /// Nearest and farthest distance to the middle of the corners, metres.
    pub range_m: [f64; 2],
    /// Focal lengths that are not excluded, pixels.
    pub focal_px: [f64; 2],
    /// The middle of the corners in the model frame.
    pub centroid: [f64; 3],
    /// The best pose, whose position is not to be trusted.
    pub best: Pose,
}

impl<const POINTS: usize> PoseSolver<POINTS> {
    /// The direction and an interval of ranges for a camera with a focal length between `focal_px[0]` and `focal_px[1]` pixels and
    /// its principal point in the middle of the frame. Phones and cameras have 0.5 to 3 times the frame's longer side.
    ///
    /// Cost: nine poses.
    ///
    /// # Errors
    /// [`NoPose`] if no focal length gives a pose.
    pub fn direction(
        &mut self,
        points: &[PointInView],
        focal_px: [f64; 2],
        settings: &PoseSettings,
    ) -> Result<Direction, NoPose> {
        let [shortest, longest] = focal_px;
        if !(shortest > 0.0 && shortest <= longest && longest.is_finite()) {
            return Err(NoPose::NotFinite);
        }
        let centre = settings.frame_px.map(|size| (size - 1.0) / 2.0);
        let ratio = crate::math::exp2(crate::math::log2(longest / shortest) / f64::from(STEPS - 1));
        let variance = settings.deviation_px * settings.deviation_px;
        let mut tried: [Option<(f64, f64, Pose)>; STEPS as usize] = [None; STEPS as usize];
        let mut refusal = NoPose::NotFinite;
        let mut focal = shortest;
        for slot in &mut tried {
            let lens = Intrinsics::new([focal; 2], centre).map_err(|_| NoPose::NotFinite)?;
            match self.solve(points, &lens, settings) {
                Ok(pose) => {
                    let inside = pose.inliers as f64;
                    let squares = pose.residual_px * pose.residual_px * inside / variance;
                    *slot = Some((focal, squares + (pose.points as f64 - inside) * DISAGREES, pose));
                }
                Err(no) => refusal = no,
            }
            focal *= ratio;
        }
        let answers = || tried.iter().flatten();
        let best = answers().fold(None, |best: Option<&(f64, f64, Pose)>, one| match best {
            Some(best) if best.1 <= one.1 => Some(best),
            _ => Some(one),
        });
        let Some(&(_, least, best)) = best else { return Err(refusal) };
        let sight = |pose: &Pose| unit(minus(pose.camera_from_model.centre(), pose.centroid));
        let towards_observer = sight(&best).ok_or(NoPose::NotFinite)?;
        let mut cosine_of_error = 1.0_f64;
        let (mut range_m, mut focal_px) = ([f64::INFINITY, 0.0_f64], [f64::INFINITY, 0.0_f64]);
        // The truth may lie between two focal lengths, of which one is excluded: each answer stands for half a step beside it.
        let half = crate::math::sqrt_f64(ratio);
        for (focal, _, pose) in answers().filter(|(_, cost, _)| cost - least <= EXCLUDED) {
            let range = pose.range();
            let noise = 2.0 * pose.deviation();
            range_m = [range_m[0].min((range - noise) / half), range_m[1].max((range + noise) * half)];
            focal_px = [focal_px[0].min(focal / half), focal_px[1].max(focal * half)];
            if let Some(other) = sight(pose) {
                cosine_of_error = cosine_of_error.min(dot(other, towards_observer));
            }
        }
        // Noise turns it as well; small angles add up.
        let across = (2.0 * across_deviation(&best, towards_observer) / best.range()).min(1.0);
        cosine_of_error -= across * across / 2.0;
        Ok(Direction {
            towards_observer,
            cosine_of_error: cosine_of_error.max(-1.0),
            range_m,
            focal_px: [focal_px[0].max(shortest), focal_px[1].min(longest)],
            centroid: best.centroid,
            best,
        })
    }
}

/// Deviation of the centre across the line of sight, metres: what is left of the trace without the part along it.
fn across_deviation(pose: &Pose, sight: [f64; 3]) -> f64 {
    let [a, b, c, ..] = pose.covariance;
    let part = [a, b, c].map(|[x, y, z, ..]| [x, y, z]);
    let along = dot(super::space::apply(&part, sight), sight);
    crate::math::sqrt_f64(part[0][0] + part[1][1] + part[2][2] - along)
}

impl Direction {
    /// A point at a distance on the line of sight, in the model frame.
    pub fn at(&self, range_m: f64) -> [f64; 3] {
        super::space::plus(self.centroid, scaled(self.towards_observer, range_m))
    }

    /// The middle of the range's interval, metres.
    pub fn middle(&self) -> f64 {
        let [near, far] = self.range_m;
        0.5 * (near + far)
    }

    /// Whether it is a direction at all: the error is below a right angle.
    pub fn is_useful(&self) -> bool {
        self.cosine_of_error > 0.0 && length(self.towards_observer) > 0.0
    }
}
