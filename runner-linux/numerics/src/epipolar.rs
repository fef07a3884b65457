//! How two views with known lenses stand to one another: the essential matrix, robustly, and what keeps it from being
//! known.
//!
//! `x2 = R x1 + t` takes the first view frame to the second, `|t| = 1`; directions are normalized coordinates `(x, y)` of a
//! view, `E = [t] R`. A pair of directions has the Sampson distance `x2' E x1 / |(E x1, E' x2)|` (first-order geometric
//! error; Hartley and Zisserman, 11.4.3).

use std::ops::Range;

use crate::order;
use daymark_core::linear::NormalEquations;
use daymark_fixtures::random::SplitMix64;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// A pair of directions that may be the same point.
pub type Pair = [[f64; 2]; 2];

/// The pose of a second view against a first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativePose {
    /// `R`.
    pub rotation: Matrix3<f64>,
    /// `t`, of length one.
    pub direction: Vector3<f64>,
}

/// What the search for a relative pose gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The pose.
    pub pose: RelativePose,
    /// Numbers of the pairs that agree with it and lie in front of both views.
    pub inliers: Vec<usize>,
    /// The median angle between the two rays of an inlier, degrees.
    pub parallax_degree: f64,
    /// Share of the inliers that one rotation without translation explains.
    pub rotation_share: f64,
    /// Share of the inliers that one plane explains.
    pub plane_share: f64,
}

/// Samples of five, at most.
const SAMPLES: usize = 600;
/// Samples that are drawn in any case.
const MIN_SAMPLES: usize = 60;
/// Gauss-Newton steps from a sample's start.
const STEPS: usize = 12;

impl RelativePose {
    fn essential(&self) -> Matrix3<f64> {
        self.direction.cross_matrix() * self.rotation
    }

    /// Squared Sampson distance, in squared normalized units.
    pub fn squared_distance(&self, pair: &Pair) -> f64 {
        squared_distance(&self.essential(), pair)
    }

    /// The epipolar lines of many directions of both views, for pairs among them.
    pub fn lines(&self, first: &[[f64; 2]], second: &[[f64; 2]]) -> EpipolarLines {
        let essential = self.essential();
        EpipolarLines {
            of_first: first.iter().map(|&at| essential * homogeneous(at)).collect(),
            of_second: second
                .iter()
                .map(|&at| {
                    let line = essential.tr_mul(&homogeneous(at));
                    (at, line.x * line.x, line.y * line.y)
                })
                .collect(),
        }
    }

    /// Depths of a pair's point along the optical axes of the two views, for `|t| = 1`; `None` for parallel rays.
    pub fn depths(&self, [a, b]: &Pair) -> Option<[f64; 2]> {
        let (x, y) = (self.rotation * homogeneous(*a), homogeneous(*b));
        // s x + t = u y in the second frame, by least squares.
        let (xx, xy, yy) = (x.dot(&x), x.dot(&y), y.dot(&y));
        let determinant = xx * yy - xy * xy;
        if !(determinant > 1e-14 * xx * yy) {
            return None;
        }
        let (xt, yt) = (x.dot(&self.direction), y.dot(&self.direction));
        Some([(xy * yt - yy * xt) / determinant, (xx * yt - xy * xt) / determinant])
    }

    /// The four poses with the same essential matrix.
    fn twins(&self) -> [Self; 4] {
        let half_turn = 2.0 * self.direction * self.direction.transpose() - Matrix3::identity();
        let twisted = half_turn * self.rotation;
        [self.rotation, twisted]
            .map(|rotation| [1.0, -1.0].map(|sign| Self { rotation, direction: self.direction * sign }))
            .concat()
            .try_into()
            .unwrap_or([*self; 4])
    }

    /// The twin that has the most pairs in front of both views.
    fn in_front<'p>(&self, pairs: &(impl Iterator<Item = &'p Pair> + Clone)) -> Self {
        let count = |pose: &Self| {
            pairs.clone().filter(|pair| pose.depths(pair).is_some_and(|[a, b]| a > 0.0 && b > 0.0)).count()
        };
        let mut best = (*self, 0);
        for twin in self.twins() {
            let front = count(&twin);
            if front > best.1 {
                best = (twin, front);
            }
        }
        best.0
    }

    /// One Gauss-Newton step on the weighted Sampson distances; `None` if the pairs do not determine it.
    ///
    /// With `y = R x1`, `n = x2 . (t x y)`, a turn `w` of R changes n by `w . (x2 (t . y) - t (x2 . y))` and a change `d` of t
    /// by `d . (y x x2)`; t moves in the plane across itself.
    fn step<'p>(&self, pairs: impl Iterator<Item = &'p Pair>, scale: f64) -> Option<(Self, f64)> {
        let essential = self.essential();
        let across = if self.direction.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let (b, t) = (self.direction.cross(&across).normalize(), self.direction);
        let c = t.cross(&b);
        let mut equations = NormalEquations::<5>::new();
        for pair in pairs {
            let (one, other) = (homogeneous(pair[0]), homogeneous(pair[1]));
            let y = self.rotation * one;
            let (p, q) = (essential * one, essential.tr_mul(&other));
            let length = libm::sqrt(p.x * p.x + p.y * p.y + q.x * q.x + q.y * q.y);
            if !(length > 1e-12) {
                continue;
            }
            let turn = other * t.dot(&y) - t * other.dot(&y);
            let shift = y.cross(&other);
            let row = [turn.x, turn.y, turn.z, shift.dot(&b), shift.dot(&c)].map(|d| d / length);
            let residual = other.dot(&p) / length;
            // Cauchy's weight: pairs beyond the scale fade.
            let weight = 1.0 / (1.0 + residual * residual / (scale * scale));
            equations.add(&row, -residual, weight);
        }
        for unknown in 0..5 {
            equations.add_ridge(unknown, 1e-12);
        }
        let &[wx, wy, wz, db, dc] = equations.solve()?;
        let length = libm::sqrt(wx * wx + wy * wy + wz * wz + db * db + dc * dc);
        // No step beyond what linearization bears.
        let limit = if length > 0.5 { 0.5 / length } else { 1.0 };
        let turn = Rotation3::from_scaled_axis(Vector3::new(wx, wy, wz) * limit);
        let next =
            Self { rotation: turn.matrix() * self.rotation, direction: (t + (b * db + c * dc) * limit).normalize() };
        length.is_finite().then_some((next, length))
    }

    /// Robust least squares over these pairs; `scale` is where pairs begin to fade.
    #[must_use]
    pub fn refined(self, pairs: &[Pair], scale: f64, steps: usize) -> Self {
        self.refined_over(&pairs.iter(), scale, steps)
    }

    fn refined_over<'p>(mut self, pairs: &(impl Iterator<Item = &'p Pair> + Clone), scale: f64, steps: usize) -> Self {
        for _ in 0..steps {
            let Some((next, length)) = self.step(pairs.clone(), scale) else { break };
            self = next;
            if length < 1e-10 {
                break;
            }
        }
        self
    }
}

/// What is computed once for each direction of two views.
#[derive(Debug, Clone)]
pub struct EpipolarLines {
    /// Lines in the second view.
    of_first: Vec<Vector3<f64>>,
    /// Directions of the second view, and the squares of their lines' coefficients in the first.
    of_second: Vec<([f64; 2], f64, f64)>,
}

impl EpipolarLines {
    /// The second view's directions in the order of their y, so that those near a line are found in a part of them.
    pub fn by_height(&self, numbers: impl Iterator<Item = usize>) -> ByHeight {
        let mut entries: Vec<(f64, u32)> =
            numbers.map(|number| (self.of_second[number].0[1], number as u32)).filter(|(y, _)| y.is_finite()).collect();
        entries.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let of_all = |value: fn(&([f64; 2], f64, f64)) -> f64, pick: fn(f64, f64) -> f64, start: f64| {
            entries.iter().fold(start, |most, &(_, number)| pick(most, value(&self.of_second[number as usize])))
        };
        ByHeight {
            left: of_all(|second| second.0[0], f64::min, f64::INFINITY),
            right: of_all(|second| second.0[0], f64::max, f64::NEG_INFINITY),
            steepest: of_all(|second| second.1 + second.2, f64::max, 0.0),
            heights: entries.iter().map(|entry| entry.0).collect(),
            numbers: entries.iter().map(|entry| entry.1).collect(),
        }
    }

    /// The places in that order among which all are whose squared Sampson distance from the line of a direction of the first
    /// view is below `limit`.
    pub fn near(&self, first: usize, order: &ByHeight, limit: f64) -> Range<usize> {
        let p = &self.of_first[first];
        let across = p.x * p.x + p.y * p.y;
        // n^2 < limit (p_x^2 + p_y^2 + q_x^2 + q_y^2) with n = p_x x + p_y y + p_z, solved for y.
        let reach = 1.001 * libm::sqrt(limit * (across + order.steepest));
        let ends = [order.left, order.right].map(|x| -(p.x * x + p.z) / p.y);
        let margin = reach / p.y.abs();
        let (low, high) = (ends[0].min(ends[1]) - margin, ends[0].max(ends[1]) + margin);
        if !(low.is_finite() && high.is_finite()) {
            // A line straight up, or none.
            return 0..order.heights.len();
        }
        order.heights.partition_point(|&y| y < low)..order.heights.partition_point(|&y| y <= high)
    }

    /// The squared Sampson distance of a pair, by its numbers; NaN for a direction that is none.
    #[inline]
    pub fn squared_distance(&self, first: usize, second: usize) -> f64 {
        let (p, ([x, y], qx, qy)) = (&self.of_first[first], &self.of_second[second]);
        let n = x * p.x + y * p.y + p.z;
        let length = p.x * p.x + p.y * p.y + qx + qy;
        n * n / length
    }
}

/// Directions of the second view by their height.
#[derive(Debug, Clone)]
pub struct ByHeight {
    /// Their numbers.
    pub numbers: Vec<u32>,
    heights: Vec<f64>,
    /// The least and the largest x.
    left: f64,
    right: f64,
    /// The largest squared coefficient of a line in the first view.
    steepest: f64,
}

fn homogeneous([x, y]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(x, y, 1.0)
}

fn squared_distance(essential: &Matrix3<f64>, pair: &Pair) -> f64 {
    let (one, other) = (homogeneous(pair[0]), homogeneous(pair[1]));
    let (p, q) = (essential * one, essential.tr_mul(&other));
    let n = other.dot(&p);
    let length = p.x * p.x + p.y * p.y + q.x * q.x + q.y * q.y;
    if length > 0.0 { n * n / length } else { f64::INFINITY }
}

/// The relative pose that most pairs agree with: samples of five pairs, each solved by Gauss-Newton from several
/// directions of motion (Hedborg and Felsberg, "Fast iterative five point relative pose estimation", 2013), scored by
/// truncated squared distances (MSAC), every new best refined over its inliers.
///
/// `threshold` is the distance of an inlier in normalized units: pixels divided by the focal length. The same seed gives
/// the same estimate. `None` with fewer than eight pairs, or if no sample has eight inliers.
pub fn relative_pose(pairs: &[Pair], threshold: f64, seed: u64) -> Option<Estimate> {
    if pairs.len() < 8 {
        return None;
    }
    let limit = threshold * threshold;
    // Sums only grow: what is above the best is left early.
    let cost = |pose: &RelativePose, enough: f64| {
        let essential = pose.essential();
        let mut sum = 0.0;
        for part in pairs.chunks(32) {
            sum = part.iter().fold(sum, |sum, pair| {
                let squared = squared_distance(&essential, pair);
                sum + if squared < limit { squared } else { limit }
            });
            if sum >= enough {
                break;
            }
        }
        sum
    };
    let inliers_of = |pose: &RelativePose| -> Vec<usize> {
        let essential = pose.essential();
        (0..pairs.len()).filter(|&number| squared_distance(&essential, &pairs[number]) < limit).collect()
    };
    let mut random = SplitMix64::new(seed);
    let starts =
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 1.0, 0.0]].map(Vector3::from);
    let mut best: Option<(RelativePose, f64)> = None;
    let mut needed = SAMPLES;
    let mut drawn = 0;
    while drawn < needed.max(MIN_SAMPLES) {
        drawn += 1;
        let mut sample = [0; 5];
        for place in 0..5 {
            loop {
                let number = random.range(0, pairs.len() as i32) as usize;
                if !sample[..place].contains(&number) {
                    sample[place] = number;
                    break;
                }
            }
        }
        let known = best.map(|(pose, _)| pose);
        for start in starts {
            // A turn that is known already is a better start than none.
            let rotation = known.map_or(Matrix3::identity(), |pose| pose.rotation);
            let mut pose = RelativePose { rotation, direction: start.normalize() };
            let five = || sample.iter().map(|&number| &pairs[number]);
            pose = pose.refined_over(&five(), 1e3, STEPS);
            if five().any(|pair| !(pose.squared_distance(pair) < 1e-4 * limit)) {
                continue;
            }
            let least = best.map_or(f64::INFINITY, |best| best.1);
            let now = cost(&pose, least);
            if now >= least {
                continue;
            }
            best = Some((pose, now));
            for _ in 0..3 {
                let inliers = inliers_of(&pose);
                let refined = pose.refined_over(&inliers.iter().map(|&number| &pairs[number]), threshold, 6);
                let least = best.map_or(f64::INFINITY, |best| best.1);
                let lower = cost(&refined, least);
                if lower >= least {
                    break;
                }
                (pose, best) = (refined, Some((refined, lower)));
            }
            let share = inliers_of(&pose).len() as f64 / pairs.len() as f64;
            // 99.9 % certain that a sample of inliers was drawn.
            let clean = libm::pow(share, 5.0).clamp(1e-9, 1.0 - 1e-9);
            needed = SAMPLES.min(libm::ceil(-6.9 / libm::log(1.0 - clean)) as usize);
        }
    }
    let (pose, _) = best?;
    let agreeing = inliers_of(&pose);
    let pose = pose.in_front(&agreeing.iter().map(|&number| &pairs[number]));
    let inliers: Vec<usize> = agreeing
        .into_iter()
        .filter(|&number| pose.depths(&pairs[number]).is_some_and(|[a, b]| a > 0.0 && b > 0.0))
        .collect();
    if inliers.len() < 8 {
        return None;
    }
    let mut angles: Vec<f64> = inliers
        .iter()
        .map(|&number| {
            let [a, b] = pairs[number];
            (pose.rotation * homogeneous(a)).angle(&homogeneous(b)).to_degrees()
        })
        .collect();
    order::ascending(&mut angles);
    let chosen: Vec<&Pair> = inliers.iter().map(|&number| &pairs[number]).collect();
    let (rotation_share, plane_share) = (rotation_share(&chosen, threshold), plane_share(&chosen, threshold, seed));
    Some(Estimate { pose, parallax_degree: angles[angles.len() / 2], rotation_share, plane_share, inliers })
}

/// How many of the pairs one rotation explains: what a camera gives that only turned.
fn rotation_share(pairs: &[&Pair], threshold: f64) -> f64 {
    let mut weights = vec![1.0; pairs.len()];
    let mut rotation = Matrix3::identity();
    let mut share = 0.0;
    for _ in 0..10 {
        let mut sum = Matrix3::zeros();
        for (pair, weight) in pairs.iter().zip(&weights) {
            sum += homogeneous(pair[1]).normalize() * homogeneous(pair[0]).normalize().transpose() * *weight;
        }
        let svd = sum.svd(true, true);
        let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return 0.0 };
        let mut signs = Vector3::repeat(1.0);
        if u.determinant() * v.determinant() < 0.0 {
            signs[svd.singular_values.imin()] = -1.0;
        }
        rotation = u * Matrix3::from_diagonal(&signs) * v;
        let mut inside = 0;
        for (pair, weight) in pairs.iter().zip(&mut weights) {
            let off = (rotation * homogeneous(pair[0])).normalize() - homogeneous(pair[1]).normalize();
            let squared = off.norm_squared() / (threshold * threshold);
            inside += usize::from(squared < 1.0);
            *weight = 1.0 / (1.0 + squared);
        }
        share = inside as f64 / pairs.len().max(1) as f64;
    }
    debug_assert!(rotation.determinant() > 0.0);
    share
}

/// How many of the pairs one homography explains, by samples of four.
fn plane_share(pairs: &[&Pair], threshold: f64, seed: u64) -> f64 {
    if pairs.len() < 8 {
        return 0.0;
    }
    let limit = threshold * threshold;
    let mut random = SplitMix64::new(seed ^ 0x5bd1_e995);
    let near = |map: &Matrix3<f64>, pair: &Pair| {
        let to = map * homogeneous(pair[0]);
        let (dx, dy) = (to.x / to.z - pair[1][0], to.y / to.z - pair[1][1]);
        dx * dx + dy * dy < limit
    };
    let agreeing =
        |map: &Matrix3<f64>| -> Vec<&Pair> { pairs.iter().copied().filter(|pair| near(map, pair)).collect() };
    let mut most: Vec<&Pair> = Vec::new();
    for _ in 0..200 {
        let four = [(); 4].map(|()| pairs[random.range(0, pairs.len() as i32) as usize]);
        let Some(map) = homography(&four) else { continue };
        // A map that cannot have the most any more is left early.
        let (mut off, bearable) = (0, pairs.len() - most.len());
        let more = pairs.chunks(32).all(|part| {
            off += part.iter().filter(|pair| !near(&map, pair)).count();
            off < bearable
        });
        if more {
            most = agreeing(&map);
        }
    }
    // Four noisy points do not carry a map far: least squares over those that agree does.
    for _ in 0..4 {
        let Some(found) = homography(&most).map(|map| agreeing(&map)) else { break };
        if found.len() <= most.len() {
            break;
        }
        most = found;
    }
    most.len() as f64 / pairs.len() as f64
}

/// By linear least squares with `h33 = 1`; exact for four pairs.
fn homography(pairs: &[&Pair]) -> Option<Matrix3<f64>> {
    let mut equations = NormalEquations::<8>::new();
    for [[x, y], [u, v]] in pairs.iter().map(|pair| **pair) {
        equations.add(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, 1.0);
        equations.add(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, 1.0);
    }
    let &[a, b, c, d, e, f, g, h] = equations.solve()?;
    let map = Matrix3::new(a, b, c, d, e, f, g, h, 1.0);
    map.iter().all(|entry| entry.is_finite()).then_some(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in a box, or on a plane, seen by a second view that turned and moved; every `wrong`-th pair is at random.
    fn scene(motion: Vector3<f64>, flat: bool, wrong: usize) -> (Vec<Pair>, Matrix3<f64>) {
        let rotation = *Rotation3::from_euler_angles(0.05, -0.3, 0.02).matrix();
        let mut random = SplitMix64::new(4);
        let mut number = |low: f64, high: f64| random.metres(low, high);
        let pairs = (0..200)
            .map(|i| {
                let depth = if flat { 12.0 } else { number(8.0, 16.0) };
                let point = Vector3::new(number(-4.0, 4.0), number(-3.0, 3.0), depth);
                let seen = rotation * point + motion;
                let noise = 0.0004;
                let second = if wrong > 0 && i % wrong == 0 {
                    [number(-0.5, 0.5), number(-0.5, 0.5)]
                } else {
                    [seen.x / seen.z + number(-noise, noise), seen.y / seen.z + number(-noise, noise)]
                };
                [[point.x / point.z, point.y / point.z], second]
            })
            .collect();
        (pairs, rotation)
    }

    #[test]
    fn the_motion_is_found_among_wrong_pairs() {
        let motion = Vector3::new(3.0, 0.2, 0.8);
        let (pairs, rotation) = scene(motion, false, 3);
        let found = relative_pose(&pairs, 0.001, 1).unwrap();
        let turned = Rotation3::from_matrix_unchecked(found.pose.rotation * rotation.transpose()).angle().to_degrees();
        let off = found.pose.direction.angle(&motion).to_degrees();
        assert!(turned < 0.1 && off < 0.5, "{turned} {off}");
        assert!((125..=136).contains(&found.inliers.len()), "{}", found.inliers.len());
        assert!(found.rotation_share < 0.2 && found.plane_share < 0.5, "{found:?}");
        assert_eq!(relative_pose(&pairs, 0.001, 1), Some(found));
    }

    #[test]
    fn a_turn_and_a_plane_are_told() {
        let (turned, _) = scene(Vector3::zeros(), false, 0);
        let found = relative_pose(&turned, 0.001, 1);
        assert!(found.is_none_or(|found| found.rotation_share > 0.9));
        let (flat, _) = scene(Vector3::new(3.0, 0.2, 0.8), true, 0);
        let found = relative_pose(&flat, 0.001, 1).unwrap();
        assert!(found.plane_share > 0.9 && found.rotation_share < 0.5, "{found:?}");
    }

    #[test]
    fn all_that_lies_on_a_line_is_in_its_part_of_the_heights() {
        // Sideways, upwards, forwards and between: level, upright and radial lines.
        let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [3.0, 0.2, 0.8], [-0.3, 2.0, 1.0]];
        for motion in directions.map(Vector3::from) {
            let (pairs, rotation) = scene(motion, false, 3);
            let (first, mut second): (Vec<_>, Vec<_>) = pairs.iter().map(|pair| (pair[0], pair[1])).unzip();
            // One that has no direction is on no line.
            second[7] = [f64::NAN; 2];
            let lines = RelativePose { rotation, direction: motion.normalize() }.lines(&first, &second);
            let order = lines.by_height((0..second.len()).filter(|number| number % 5 != 0));
            for limit in [1e-7, 1e-5, 1e-3] {
                let (mut on_lines, mut looked_at) = (0, 0);
                for a in 0..first.len() {
                    let part = lines.near(a, &order, limit);
                    looked_at += part.len();
                    for (place, &b) in order.numbers.iter().enumerate() {
                        if lines.squared_distance(a, b as usize) < limit {
                            on_lines += 1;
                            assert!(part.contains(&place), "{motion}, line {a}, direction {b}, limit {limit}");
                        }
                    }
                }
                assert!(on_lines > 100 && looked_at <= first.len() * order.numbers.len());
                // Level lines meet few heights.
                assert!(motion.y != 0.0 || motion.z != 0.0 || limit > 1e-5 || looked_at < 10_000, "{looked_at}");
            }
        }
    }

    #[test]
    fn too_few_pairs_have_no_pose() {
        assert_eq!(relative_pose(&[[[0.0; 2]; 2]; 7], 0.001, 1), None);
    }
}
