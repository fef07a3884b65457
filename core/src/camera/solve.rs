//! The steps from correspondences about their centroid to a judged pose; [`super::pose`] says which.

use super::adjust::{Problem, Weighting, of_centre};
use super::draw;
use super::placement::CameraFromModel;
use super::pose::{LEAST_POINTS, NoPose, Pose, PoseSettings};
use super::posit::{Shape, Sight};
use super::space::{Axes, Vector, axes, dot, length, minus, plus, scaled};
use super::weak_perspective::{ErrorBound, Extent, TooDeep, WeakPerspective};
use crate::math::{log2, sqrt_f64};

/// Squared gate of right correspondences in squared deviations: chi-square of two degrees, 99.9 %.
const GATE: f64 = 13.815_510_557_964_274;
/// Gates of the steps with soft weights, in deviations.
const SOFT_GATES: [f64; 3] = [32.0, 12.0, 6.0];
/// Steps with the right correspondences alone.
const HARD_STEPS: usize = 2;
/// Gate of the draws, in deviations: three noisy points predict the others badly.
const DRAW_GATE: f64 = 8.0;
/// Flat up to rounding: the third axis is less than this share of the second.
const FLAT: f64 = 0.01;
/// Flat enough that the other side may look alike.
const RATHER_FLAT: f64 = 0.3;
/// POSIT from all points stands if so many of them agree.
const NEARLY_ALL: f64 = 0.9;
/// The other side of a flat model is a rival if it is worse by less: likelihoods 1000 to 1.
const RIVAL_WITHIN: f64 = 13.815_510_557_964_274;
/// Two poses are one if their centres are closer than this, in deviations of the centre.
const SAME_WITHIN: f64 = 3.0;
/// A point lies beside a plane if it is farther from it than this share of the second deviation of the points on it.
const BESIDE: f64 = 0.1;
/// So many points beside a plane, all of them wrong, are no accident: 3 in 1,000 if a third of all correspondences are wrong.
const WITNESSES: usize = 5;
/// A model seen edge-on has an image thinner than this, in deviations.
const THIN: f64 = 2.0;
/// The position is left open if its deviation is more than this share of the range.
const OPEN: f64 = 0.5;

/// A pose about the centroid, after its steps.
#[derive(Debug, Clone, Copy)]
struct Settled {
    pose: CameraFromModel,
    inside: usize,
    cost: f64,
}

/// Correspondences about their centroid, and what is asked of them.
pub(super) struct Question<'a> {
    problem: Problem<'a>,
    settings: &'a PoseSettings,
    front: Option<Vector>,
    gate_squared: f64,
}

impl<'a> Question<'a> {
    pub(super) fn new(problem: Problem<'a>, settings: &'a PoseSettings) -> Self {
        let gate_squared = GATE * settings.deviation_px * settings.deviation_px;
        Self { problem, settings, front: settings.front, gate_squared }
    }

    /// The pose, with the model's axes and the centroid in its own frame.
    pub(super) fn answer(mut self, model: &Axes, centroid: Vector) -> Result<Pose, NoPose> {
        let flatness = sqrt_f64(model.values[2] / model.values[1]);
        let shape = Shape { sights: self.problem.sights, axes: model };
        let settled = self.by_all(shape, flatness).or_else(|| self.by_draws());
        let points = self.problem.sights.len();
        let Some(settled) = settled.filter(|settled| self.stands(settled)) else {
            let inliers = settled.map_or(0, |settled| settled.inside);
            // Does it fit from behind?
            let behind = self.front.take().is_some()
                && self.by_all(shape, flatness).or_else(|| self.by_draws()).is_some_and(|other| self.stands(&other));
            return Err(if behind { NoPose::Mirrored } else { NoPose::NoConsensus { inliers, points } });
        };
        self.beside_plane(&settled)?;
        let across_px = self.thickness(&settled.pose);
        if !(across_px > THIN * self.settings.deviation_px) {
            return Err(NoPose::EdgeOn { across_px });
        }
        let other = (flatness < RATHER_FLAT).then(|| self.other_side(&settled, model)).flatten();
        match other {
            Some(other) if other.cost < settled.cost => self.judge(other, Some(settled), centroid),
            other => self.judge(settled, other, centroid),
        }
    }

    /// Whether a camera stands in front; about the centroid.
    fn in_front(&self, pose: &CameraFromModel) -> bool {
        self.front.is_none_or(|front| dot(front, pose.centre()) > 0.0)
    }

    /// Whether enough points agree.
    fn stands(&self, settled: &Settled) -> bool {
        let points = self.problem.sights.len() as f64;
        settled.inside >= LEAST_POINTS && settled.inside as f64 >= self.settings.least_share * points
    }

    fn settle(&self, start: CameraFromModel) -> Option<Settled> {
        let deviation = self.settings.deviation_px;
        let mut pose = start;
        for gate in SOFT_GATES {
            let gate = gate * deviation;
            pose = self.problem.step(&pose, gate * gate, Weighting::Soft)?;
        }
        for _ in 0..HARD_STEPS {
            pose = self.problem.step(&pose, self.gate_squared, Weighting::Hard)?;
        }
        let agreement = self.problem.agreement(&pose, self.gate_squared);
        let cost = agreement.cost(self.problem.sights.len(), self.gate_squared);
        self.in_front(&pose).then_some(Settled { pose, inside: agreement.inside, cost })
    }

    /// POSIT from all points, if nearly all of them agree.
    fn by_all(&self, shape: Shape<'_>, flatness: f64) -> Option<Settled> {
        let solid = if flatness > FLAT { shape.solid() } else { None };
        let flat = if flatness < RATHER_FLAT { shape.flat() } else { [None; 2] };
        let wide = SOFT_GATES[0] * self.settings.deviation_px;
        let enough = NEARLY_ALL * self.problem.sights.len() as f64;
        let mut best: Option<Settled> = None;
        for start in [solid, flat[0], flat[1]].into_iter().flatten() {
            if (self.problem.agreement(&start, wide * wide).inside as f64) < enough {
                continue;
            }
            if let Some(settled) = self.settle(start)
                && best.is_none_or(|best| settled.cost < best.cost)
            {
                best = Some(settled);
            }
        }
        best.filter(|best| best.inside as f64 >= enough)
    }

    fn by_draws(&self) -> Option<Settled> {
        let gate = DRAW_GATE * self.settings.deviation_px;
        let start = draw::of_most(&self.problem, gate * gate, |pose| self.in_front(pose))?;
        self.settle(start)
    }

    /// The pose on the other side of a rather flat model.
    fn other_side(&self, settled: &Settled, model: &Axes) -> Option<Settled> {
        let [.., normal] = model.directions;
        self.settle(settled.pose.reversed(normal)?).filter(|other| self.stands(other))
    }

    /// Refuses a pose that only the points of one plane agree with, if there are others to tell.
    fn beside_plane(&self, settled: &Settled) -> Result<(), NoPose> {
        let agrees = |sight: &Sight| self.problem.distance_squared(&settled.pose, sight) <= self.gate_squared;
        let inside = || self.problem.sights.iter().filter(|sight| agrees(sight));
        let share = 1.0 / settled.inside.max(1) as f64;
        let middle = inside().fold([0.0; 3], |sum, sight| plus(sum, scaled(sight.point, share)));
        let mut scatter = [[0.0; 3]; 3];
        for sight in inside() {
            let off = minus(sight.point, middle);
            for (row, entry) in scatter.iter_mut().zip(off) {
                *row = plus(*row, scaled(off, entry * share));
            }
        }
        let Axes { values: [_, width, thickness], directions: [.., normal] } = axes(&scatter);
        if thickness > FLAT * FLAT * width {
            return Ok(());
        }
        let beside = BESIDE * sqrt_f64(width);
        let sights = self.problem.sights.iter();
        let off_plane = sights.filter(|sight| dot(minus(sight.point, middle), normal).abs() > beside).count();
        if off_plane < WITNESSES { Ok(()) } else { Err(NoPose::OnePlane { inliers: settled.inside, off_plane }) }
    }

    /// Deviation of the image of the agreeing points along its thinner axis, px.
    fn thickness(&self, pose: &CameraFromModel) -> f64 {
        let [fx, fy] = self.problem.intrinsics.focal();
        let inside = || {
            let sights = self.problem.sights.iter();
            sights.filter(|sight| self.problem.distance_squared(pose, sight) <= self.gate_squared)
        };
        let count = inside().count().max(1) as f64;
        let [x, y] = inside().fold([0.0; 2], |[x, y], sight| [x + sight.ray[0] / count, y + sight.ray[1] / count]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for sight in inside() {
            let (u, v) = (fx * (sight.ray[0] - x), fy * (sight.ray[1] - y));
            xx += u * u / count;
            xy += u * v / count;
            yy += v * v / count;
        }
        let root = sqrt_f64((xx - yy) * (xx - yy) + 4.0 * xy * xy);
        sqrt_f64((xx + yy - root) / 2.0)
    }

    fn judge(&self, settled: Settled, other: Option<Settled>, centroid: Vector) -> Result<Pose, NoPose> {
        let Settled { pose, inside, .. } = settled;
        let points = self.problem.sights.len();
        let log2_chance = self.log2_chance(inside);
        if !(log2_chance <= self.settings.log2_chance) {
            return Err(NoPose::ByChance { inliers: inside, log2_chance });
        }
        let squares = self.problem.agreement(&pose, self.gate_squared).squares;
        let variance = self.settings.deviation_px * self.settings.deviation_px;
        let free = (2 * inside).saturating_sub(6).max(1) as f64;
        let factor = variance.max(squares / free);
        let of_pose = self.problem.covariance(&pose, self.gate_squared);
        let Some(of_pose) = of_pose else { return Err(NoPose::Undetermined { deviation_m: f64::INFINITY }) };
        let covariance = of_centre(&pose, &of_pose).map(|row| row.map(|entry| entry * factor));
        let mut found = Pose {
            camera_from_model: pose.about(centroid.map(|x| -x)),
            covariance,
            inliers: inside,
            points,
            residual_px: sqrt_f64(squares / inside.max(1) as f64),
            log2_chance,
            centroid,
            weak_perspective: self.weak_perspective(&pose)?,
            rival: None,
        };
        if !(found.deviation() <= OPEN * found.range()) {
            return Err(NoPose::Undetermined { deviation_m: found.deviation() });
        }
        let rival = other.filter(|other| other.cost - settled.cost < RIVAL_WITHIN * variance);
        if let Some(rival) = rival {
            let apart = minus(rival.pose.centre(), pose.centre());
            if length(apart) > SAME_WITHIN * found.deviation() {
                found.rival = Some(rival.pose.about(centroid.map(|x| -x)));
            } else {
                // One maximum with two tops: the covariance covers both.
                for (row, x) in found.covariance.iter_mut().zip(apart) {
                    for (entry, y) in row.iter_mut().zip(apart) {
                        *entry += x * y;
                    }
                }
            }
        }
        Ok(found)
    }

    /// Appendix A for the points that agree.
    fn weak_perspective(&self, pose: &CameraFromModel) -> Result<Result<ErrorBound, TooDeep>, NoPose> {
        let inside = self.problem.sights.iter();
        let inside = inside.filter(|sight| self.problem.distance_squared(pose, sight) <= self.gate_squared);
        let extent = Extent::of_points(inside.map(|sight| pose.apply(sight.point)));
        let focal = self.problem.intrinsics.longest();
        let model = extent.and_then(|extent| Some((extent, WeakPerspective::balanced(focal, extent)?)));
        // Points that agree lie in front of the camera.
        let (extent, model) = model.ok_or(NoPose::NotFinite)?;
        Ok(model.check(extent, self.settings.weak_tolerance_px))
    }

    /// `2 (n - 3) C(n, k) C(k, 3) p^(k - 3)`: tests of triples with two poses each, times the probability that all others of
    /// the k that agree do so by chance, each with the gate's share `p` of the frame.
    fn log2_chance(&self, inside: usize) -> f64 {
        let [width, height] = self.settings.frame_px;
        let share = (core::f64::consts::PI * self.gate_squared / (width * height)).min(1.0);
        let (n, k) = (self.problem.sights.len(), inside);
        let mut sum = 1.0 + log2(n.saturating_sub(3) as f64) + log2_choose(n, k) + log2_choose(k, 3);
        sum += k.saturating_sub(3) as f64 * log2(share);
        sum
    }
}

/// `log2 C(n, k)`.
fn log2_choose(n: usize, k: usize) -> f64 {
    let few = k.min(n.saturating_sub(k));
    (1..=few).fold(0.0, |sum, number| sum + log2((n + 1 - number) as f64 / number as f64))
}
