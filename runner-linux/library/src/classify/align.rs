//! Brings a test cloud into the frame of a base cloud.

use nalgebra::Vector3;
use serde::Serialize;

use super::cloud::{Cloud, Similarity, vector};
use crate::order;

/// How clouds come together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// Both clouds are in one frame whose origin is the building's centre, as known cameras put them there: nothing is to
    /// be done. (The thesis, 7.1: "reconstructed and centered in the same coordinate".)
    #[default]
    Centered,
    /// Scale and axes agree (metric cameras, north and up known), the origin does not: the best shift is searched.
    Shift,
    /// Nothing agrees: a similarity, refined by iterated closest points.
    Similarity,
}

/// Test points that take part, at most.
const SAMPLE: usize = 2_000;
/// The same while starts are compared, and points of the base then.
const COARSE_SAMPLE: usize = 300;
const COARSE_BASE: usize = 6_000;
/// Rounds of closest points, at most.
const ROUNDS: usize = 40;
const COARSE_ROUNDS: usize = 20;
/// Starts that are refined on the whole clouds.
const REFINED: usize = 4;
/// Share of the closest pairs that count in a round: what the base does not have must not pull.
const KEPT: f64 = 0.8;

/// The map from the test's frame to the base's that [`Align`] asks for.
///
/// `start` is what is known before, from correspondences for instance; without it [`Align::Similarity`] begins with equal
/// centroids, sizes and axes.
pub fn base_from_test(test: &Cloud, base: &Cloud, align: Align, start: Option<Similarity>) -> Similarity {
    match align {
        Align::Centered => Similarity::shift(Vector3::zeros()),
        Align::Shift => best_shift(test, base),
        Align::Similarity => {
            let start = start.unwrap_or_else(|| sized(test, base));
            closest_points(&test.sample(SAMPLE), base, start, ROUNDS, &|from, to| Similarity::fit(from, to, false)).0
        }
    }
}

/// Starts with centroids together and a quarter of the base to each side, horizontally and up and down: a test that shows
/// the front only has its centroid before the base's. The best of all starts on thinned clouds are refined on the whole.
fn best_shift(test: &Cloud, base: &Cloud) -> Similarity {
    let middle = base.centroid() - test.centroid();
    let [low, high] = base.extent();
    let quarter = (high - low) / 4.0;
    let coarse = test.sample(COARSE_SAMPLE);
    let thinned = base.sample(COARSE_BASE);
    let thinned = Cloud::new(thinned, Vec::new(), 0.0);
    let mut found = Vec::with_capacity(27);
    for x in [0.0, -1.0, 1.0] {
        for y in [0.0, -1.0, 1.0] {
            for z in [0.0, -0.5, 0.5] {
                let start = middle + quarter.component_mul(&Vector3::new(x, y, z));
                found.push(closest_points(&coarse, &thinned, Similarity::shift(start), COARSE_ROUNDS, &shifted));
            }
        }
    }
    // The sort is stable: of equally good starts the first.
    order::sort_by(&mut found, |a, b| a.1.total_cmp(&b.1));
    let mut refined: Vec<(Similarity, f64)> = Vec::new();
    for (start, _) in found {
        let apart =
            |other: &(Similarity, f64)| (other.0.translation - start.translation).norm() > 0.02 * (high - low).norm();
        if refined.len() < REFINED && refined.iter().all(apart) {
            refined.push(closest_points(&test.sample(SAMPLE), base, start, ROUNDS, &shifted));
        }
    }
    let sample = test.sample(SAMPLE);
    let mut settled: Vec<_> =
        refined.into_iter().map(|(map, _)| settle(&sample, base, map.translation, (high - low).norm())).collect();
    order::sort_by(&mut settled, |a, b| a.1.total_cmp(&b.1));
    Similarity::shift(settled.first().map_or(middle, |best| best.0))
}

/// Moves a shift in smaller and smaller steps along the axes while the mean squared distance of all points falls.
///
/// Closest points stick: points of a wall hold on to their neighbours one sample further, and the trimmed ones are just
/// those that know better.
fn settle(test: &[[f32; 3]], base: &Cloud, start: Vector3<f64>, size: f64) -> (Vector3<f64>, f64) {
    let error = |shift: &Vector3<f64>| {
        let map = Similarity::shift(*shift);
        let moved: Vec<[f32; 3]> = test.iter().map(|&point| map.apply_f32(point)).collect();
        let nearest = base.tree.nearest_of_each(&moved, &base.positions);
        nearest.iter().flatten().map(|nearest| f64::from(nearest.squared)).sum::<f64>() / test.len().max(1) as f64
    };
    let mut best = (start, error(&start));
    let mut step = 0.03 * size;
    while step > 0.0005 * size {
        let mut lowered = false;
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut next = best.0;
                next[axis] += sign * step;
                let now = error(&next);
                if now < best.1 {
                    best = (next, now);
                    lowered = true;
                }
            }
        }
        if !lowered {
            step *= 0.5;
        }
    }
    best
}

fn shifted(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Option<Similarity> {
    let sum = from.iter().zip(to).fold(Vector3::zeros(), |sum, (a, b)| sum + (b - a));
    (!from.is_empty()).then(|| Similarity::shift(sum / from.len() as f64))
}

fn sized(test: &Cloud, base: &Cloud) -> Similarity {
    let (a, b) = (test.centroid(), base.centroid());
    let spread = |cloud: &Cloud, middle: &Vector3<f64>| {
        let sum: f64 = cloud.positions.iter().map(|&point| (vector(point) - middle).norm_squared()).sum();
        libm::sqrt(sum / cloud.positions.len().max(1) as f64)
    };
    let scale = spread(base, &b) / spread(test, &a).max(f64::MIN_POSITIVE);
    Similarity { scale, translation: b - a * scale, ..Similarity::shift(Vector3::zeros()) }
}

/// Iterated closest points (Besl and Mc Kay, PAMI 1992), trimmed: the map, and the mean square of the kept distances.
fn closest_points(
    test: &[[f32; 3]],
    base: &Cloud,
    start: Similarity,
    rounds: usize,
    fit: &dyn Fn(&[Vector3<f64>], &[Vector3<f64>]) -> Option<Similarity>,
) -> (Similarity, f64) {
    let mut map = start;
    let mut error = f64::INFINITY;
    for _ in 0..rounds {
        let moved: Vec<[f32; 3]> = test.iter().map(|&point| map.apply_f32(point)).collect();
        let nearest = base.tree.nearest_of_each(&moved, &base.positions);
        let mut pairs: Vec<(f32, usize, u32)> = nearest
            .iter()
            .enumerate()
            .filter_map(|(number, nearest)| nearest.map(|nearest| (nearest.squared, number, nearest.number)))
            .collect();
        let kept = ((pairs.len() as f64 * KEPT) as usize).max(3).min(pairs.len());
        order::sort_by(&mut pairs, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pairs.truncate(kept);
        // The order of the cloud again, so that sums do not depend on distances' ties.
        let now = pairs.iter().map(|pair| f64::from(pair.0)).sum::<f64>() / kept.max(1) as f64;
        if !(now < error * (1.0 - 1e-4)) {
            error = error.min(now);
            break;
        }
        error = now;
        let moved_now: Vec<_> = pairs.iter().map(|pair| vector(moved[pair.1])).collect();
        let to: Vec<_> = pairs.iter().map(|pair| vector(base.positions[pair.2 as usize])).collect();
        let Some(step) = fit(&moved_now, &to) else { break };
        map = Similarity {
            scale: step.scale * map.scale,
            rotation: step.rotation * map.rotation,
            translation: step.rotation * map.translation * step.scale + step.translation,
        };
    }
    (map, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on three faces of a box with a notch.
    fn solid() -> Vec<[f32; 3]> {
        let mut points = Vec::new();
        for i in 0..30 {
            for j in 0..30 {
                let (a, b) = (i as f32 / 3.0, j as f32 / 3.0);
                points.push([a, 0.0, b * 1.5]);
                points.push([0.0, a, b * 1.5]);
                if !(a > 5.0 && b > 5.0) {
                    points.push([a, b, 15.0]);
                }
            }
        }
        points
    }

    #[test]
    fn a_part_is_shifted_to_where_it_belongs() {
        let base = solid();
        let part: Vec<[f32; 3]> =
            base.iter().filter(|p| p[0] < 4.0).map(|p| [p[0] + 9.0, p[1] - 3.0, p[2] + 1.0]).collect();
        let (base, test) = (Cloud::new(base, Vec::new(), 0.0), Cloud::new(part, Vec::new(), 0.0));
        let map = base_from_test(&test, &base, Align::Shift, None);
        assert!((map.translation - Vector3::new(-9.0, 3.0, -1.0)).norm() < 0.05, "{map:?}");
    }

    #[test]
    fn a_similarity_from_nearby_is_refined() {
        let base = solid();
        let turn = nalgebra::Rotation3::from_euler_angles(0.02, -0.03, 0.08);
        let truth = Similarity { scale: 0.9, rotation: *turn.matrix(), translation: Vector3::new(0.3, 0.2, -0.4) };
        let moved: Vec<[f32; 3]> = base.iter().map(|&p| truth.inverse().apply_f32(p)).collect();
        let (base, test) = (Cloud::new(base, Vec::new(), 0.0), Cloud::new(moved, Vec::new(), 0.0));
        let map = base_from_test(&test, &base, Align::Similarity, None);
        assert!((map.scale - 0.9).abs() < 0.01 && (map.rotation - truth.rotation).norm() < 0.02, "{map:?}");
    }
}
