//! A pose from matched corners, and then from all corners that it finds.
//!
//! Recognition matches the corners of one view at a time, along one plane. Their pose says where every other corner of the
//! model should be seen: those that are seen there, and look alike, give the pose that counts.
//!
//! ```text
//!  matched corners ── pose ── model corners projected ── nearest in appearance within the gate, one to one ── pose
//! ```

use heapless::Vec;

use super::intrinsics::Intrinsics;
use super::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use crate::feature::Signature;

/// A corner of a model and what it looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelCorner {
    /// In the model frame, metres.
    pub position: [f64; 3],
    /// Of the view from which it was enrolled.
    pub signature: Signature,
}

/// A corner of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameCorner {
    /// Pixels, lens distortion taken out.
    pub image: [f64; 2],
    /// What it looks like.
    pub signature: Signature,
}

/// Radii around the expected places in which corners are looked for, in deviations of a coordinate, round by round.
const RADII: [f64; 2] = [10.0, 5.0];
/// Signatures that differ in more of their 128 bits are not alike: those of unrelated corners differ in 64 +- 6.
const MOST_BITS: u32 = 40;

/// Working memory for up to `POINTS` corners of a model.
#[derive(Debug, Clone)]
pub struct Locator<const POINTS: usize> {
    solver: PoseSolver<POINTS>,
    pairs: Vec<PointInView, POINTS>,
    /// For each corner of the model, bits and number of the frame's corner that it takes.
    taken: Vec<Option<(u32, u16)>, POINTS>,
}

/// A pose, and which corners it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// The pose.
    pub pose: Pose,
    /// Correspondences that the first pose found; 0 if that one stands.
    pub guided: usize,
}

impl<const POINTS: usize> Default for Locator<POINTS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const POINTS: usize> Locator<POINTS> {
    /// Empty: 112 bytes a corner.
    pub const fn new() -> Self {
        Self { solver: PoseSolver::new(), pairs: Vec::new(), taken: Vec::new() }
    }

    /// The pose of a frame. `matched` are numbers of a model's and a frame's corner; numbers that do not exist are passed
    /// over. A model with more corners than `POINTS` is looked for with the first ones.
    ///
    /// Cost: three poses, and two looks at each pair of a model's and a frame's corner.
    ///
    /// # Errors
    /// [`NoPose`] of the matched corners.
    pub fn locate(
        &mut self,
        model: &[ModelCorner],
        frame: &[FrameCorner],
        matched: &[[u16; 2]],
        intrinsics: &Intrinsics,
        settings: &PoseSettings,
    ) -> Result<Located, NoPose> {
        self.pairs.clear();
        for [corner, seen] in matched {
            if let (Some(corner), Some(seen)) = (model.get(usize::from(*corner)), frame.get(usize::from(*seen))) {
                // What does not fit is left out: the first ones are the best.
                let _ = self.pairs.push(PointInView { model: corner.position, image: seen.image });
            }
        }
        let mut best = Located { pose: self.solver.solve(&self.pairs, intrinsics, settings)?, guided: 0 };
        for radius in RADII {
            self.look(model, frame, &best.pose, intrinsics, radius * settings.deviation_px);
            let Ok(pose) = self.solver.solve(&self.pairs, intrinsics, settings) else { break };
            if pose.inliers < best.pose.inliers {
                break;
            }
            best = Located { pose, guided: self.pairs.len() };
        }
        Ok(best)
    }

    /// Fills `pairs` with the corners that are seen where the pose expects them.
    fn look(&mut self, model: &[ModelCorner], frame: &[FrameCorner], pose: &Pose, lens: &Intrinsics, radius: f64) {
        self.taken.clear();
        for corner in model.iter().take(POINTS) {
            let expected = lens.project(pose.camera_from_model.apply(corner.position));
            let found = expected.and_then(|at| nearest(corner.signature, at, frame, radius));
            // As many as were taken.
            let _ = self.taken.push(found);
        }
        self.pairs.clear();
        for (number, (corner, taken)) in model.iter().zip(&self.taken).enumerate() {
            let Some((bits, seen)) = *taken else { continue };
            // One to one: a frame's corner belongs to the model's corner that it resembles most, among equals to the first.
            let rival = |(other, rival): (usize, &Option<(u32, u16)>)| {
                rival.is_some_and(|(other_bits, other_seen)| other_seen == seen && (other_bits, other) < (bits, number))
            };
            if self.taken.iter().enumerate().any(rival) {
                continue;
            }
            if let Some(seen) = frame.get(usize::from(seen)) {
                let _ = self.pairs.push(PointInView { model: corner.position, image: seen.image });
            }
        }
    }
}

/// Of the frame's corners within `radius` of a place the one that differs in the fewest bits, if few enough.
fn nearest(signature: Signature, [x, y]: [f64; 2], frame: &[FrameCorner], radius: f64) -> Option<(u32, u16)> {
    let mut best = None;
    for (number, corner) in (0_u16..).zip(frame) {
        let [u, v] = corner.image;
        let (dx, dy) = (u - x, v - y);
        if !(dx * dx + dy * dy <= radius * radius) {
            continue;
        }
        let bits = signature.distance(corner.signature);
        if bits <= MOST_BITS && best.is_none_or(|(least, _)| bits < least) {
            best = Some((bits, number));
        }
    }
    best
}
