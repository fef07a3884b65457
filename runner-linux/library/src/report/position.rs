//! Where the observer stands, for text and JSON.

use std::fmt::Write as _;

use daymark_core::camera::pose::Pose;
use serde::Serialize;

use crate::lens_source::{KnownLens, LensSource};
use crate::observer::{Observer, Place};
use crate::output::fix::{Fix, FixMethod};

/// Everything that is said about the observer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObserverFacts {
    /// On Earth; null if the table does not know where the landmark stands.
    pub fix: Option<Fix>,
    /// In the frame of the landmark's model; null without one.
    pub pose: Option<PoseFacts>,
    /// Nearest and farthest distance to the middle of the corners, if the lens is not known; metres, or units of a model
    /// without a scale.
    pub range_interval_m: Option<[f64; 2]>,
    /// The lens that was used.
    pub lens: LensFacts,
    /// What keeps the position from being better, each with what to do.
    pub lacking: Vec<String>,
}

/// The camera in the model's frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseFacts {
    /// Whether lengths are metres; otherwise they are units of the model.
    pub metric: bool,
    /// The centre of projection: x along the front to the right of who faces it, y into the building, z up.
    pub position_in_model_m: [f64; 3],
    /// Standard deviation of the centre in the direction that is known worst.
    pub deviation_m: f64,
    /// The camera's axes (right, down, forward) in the model's frame, as rows.
    pub camera_from_model: [[f64; 3]; 3],
    /// From the camera to the middle of the corners.
    pub range_m: f64,
    /// Corners that agree.
    pub inliers: usize,
    /// Corners that were matched.
    pub corners: usize,
    /// Root mean square distance of those that agree.
    pub residual_px: f64,
    /// Base-2 logarithm of how many poses chance makes that are as good.
    pub log2_chance: f64,
    /// The frame leaves open on which of two sides the camera stands; this is the better one.
    pub has_rival: bool,
}

/// The lens that was used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LensFacts {
    /// Where it comes from.
    pub source: LensSource,
    /// Focal length, pixels of the frame as it was compared.
    pub focal_px: f64,
    /// Its relative error, one standard deviation.
    pub relative_error: f64,
}

impl ObserverFacts {
    /// What is said about an observer.
    pub fn new(observer: &Observer, lens: &KnownLens) -> Self {
        let (pose, interval) = match &observer.place {
            Place::Pose { located, metric, .. } => (Some(PoseFacts::new(&located.pose, *metric)), None),
            Place::Direction(direction) => (None, Some(direction.range_m)),
            Place::NoPose(_) | Place::NoModel => (None, None),
        };
        Self {
            fix: observer.fix.as_ref().map(|sighted| Fix::of(&sighted.fix)),
            pose,
            range_interval_m: interval,
            lens: LensFacts { source: lens.source, focal_px: lens.lens.focal[0], relative_error: lens.relative_error },
            lacking: observer.lacking.clone(),
        }
    }

    /// Lines of text.
    ///
    /// # Errors
    /// None: writing to a string cannot fail.
    pub fn write(&self, out: &mut String) -> std::fmt::Result {
        if let Some(fix) = &self.fix {
            let (latitude, longitude) = (fix.latitude_deg, fix.longitude_deg);
            writeln!(
                out,
                "  you are at  {latitude:.6}, {longitude:.6} degrees, within {} m (95 %): {}",
                metres(fix.radius_95_m),
                fix.method.phrase()
            )?;
            if let (Some(range), Some(bearing)) = (fix.range_m, fix.bearing_deg) {
                write!(out, "  it bears    {bearing:.1} degrees, {} m away", metres(range))?;
                if let Some(heading) = fix.heading_deg {
                    write!(out, "; the camera points to {heading:.1} degrees")?;
                }
                writeln!(out)?;
            }
        }
        if let Some(pose) = &self.pose {
            let unit = if pose.metric { "m" } else { "units of its model" };
            let [x, y, z] = pose.position_in_model_m;
            let side = if x < 0.0 { "left" } else { "right" };
            let (before, depth) = if y < 0.0 { ("before", -y) } else { ("behind", y) };
            writeln!(
                out,
                "  pose        {} {unit} {before} its middle, {} to the {side}, {} above its foot, +-{}; {} of {} corners agree to {:.2} px",
                metres(depth),
                metres(x.abs()),
                metres(z),
                metres(pose.deviation_m),
                pose.inliers,
                pose.corners,
                pose.residual_px,
            )?;
        }
        if let Some([near, far]) = self.range_interval_m {
            writeln!(out, "  distance    between {} and {} m", metres(near), metres(far))?;
        }
        let is_exact = self.fix.is_some_and(|fix| fix.method == FixMethod::Pose);
        for lacking in self.lacking.iter().filter(|_| !is_exact) {
            writeln!(out, "  position    {lacking}")?;
        }
        Ok(())
    }
}

impl PoseFacts {
    fn new(pose: &Pose, metric: bool) -> Self {
        Self {
            metric,
            position_in_model_m: pose.camera_from_model.centre(),
            deviation_m: pose.deviation(),
            camera_from_model: *pose.camera_from_model.rotation(),
            range_m: pose.range(),
            inliers: pose.inliers,
            corners: pose.points,
            residual_px: pose.residual_px,
            log2_chance: pose.log2_chance,
            has_rival: pose.rival.is_some(),
        }
    }
}

/// A length with as many digits as it deserves.
fn metres(length: f64) -> String {
    if length.abs() < 9.995 {
        format!("{length:.2}")
    } else if length.abs() < 99.95 {
        format!("{length:.1}")
    } else {
        format!("{length:.0}")
    }
}
