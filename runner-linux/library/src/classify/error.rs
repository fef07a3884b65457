//! How much two clouds differ, in shape and in intensity.

use serde::Serialize;

use super::cloud::{Cloud, Similarity};

/// The difference of two shapes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShapeError {
    /// Mean squared distance from the test's points to the nearest of the base, squared units: the thesis' error (7.1).
    pub one_sided: f64,
    /// The mean of that and of the same from the base's points to the test's.
    pub symmetric: f64,
}

/// The difference of intensities over corresponding points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntensityError {
    /// Mean squared difference of gray levels, 0 black to 1 white (7.2).
    pub plain: f64,
    /// The share of the test's variance that no gain and bias of the base explains, `1 - r^2`; 1 where bright answers
    /// dark.
    pub free: f64,
    /// Points that were compared.
    pub points: usize,
}

/// Everything that one comparison gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The shapes.
    pub shape: ShapeError,
    /// The intensities; `None` if too few points correspond.
    pub intensity: Option<IntensityError>,
    /// Distance of each of the test's points.
    pub distances: Vec<f32>,
    /// The map by which they were compared.
    pub base_from_test: Similarity,
}

/// Fewer corresponding points say nothing about intensity.
const MIN_POINTS: usize = 30;

/// Compares a test with a base in the base's frame. `reach` is how far corresponding points may be apart for their
/// intensities to be compared.
pub fn compare(test: &Cloud, base: &Cloud, base_from_test: Similarity, reach: f64) -> Comparison {
    let (distances, intensity) = compare_one_sided(test, base, &base_from_test, reach);
    let one_sided = mean(&distances);
    // Back in the test's frame its own tree answers; distances there are smaller by the scale.
    let test_from_base = base_from_test.inverse();
    let back: Vec<[f32; 3]> = base.positions.iter().map(|&point| test_from_base.apply_f32(point)).collect();
    let other: Vec<f32> = test
        .tree
        .nearest_of_each(&back, &test.positions)
        .iter()
        .map(|n| n.map_or(f32::INFINITY, |n| n.squared))
        .collect();
    let other = mean(&other) * base_from_test.scale * base_from_test.scale;
    Comparison {
        shape: ShapeError { one_sided, symmetric: f64::midpoint(one_sided, other) },
        intensity,
        distances: distances.into_iter().map(libm::sqrtf).collect(),
        base_from_test,
    }
}

/// The squared distances of a test's points from a base, and their intensities' error: the half of [`compare`] that needs no
/// tree of the test.
pub fn compare_one_sided(
    test: &Cloud,
    base: &Cloud,
    base_from_test: &Similarity,
    reach: f64,
) -> (Vec<f32>, Option<IntensityError>) {
    let moved: Vec<[f32; 3]> = test.positions.iter().map(|&point| base_from_test.apply_f32(point)).collect();
    let nearest = base.tree.nearest_of_each(&moved, &base.positions);
    let distances = nearest.iter().map(|n| n.map_or(f32::INFINITY, |n| n.squared)).collect();
    let pairs = test.gray.iter().zip(&nearest).filter_map(|(&gray, nearest)| {
        let nearest = (*nearest)?;
        let there = *base.gray.get(nearest.number as usize)?;
        let near = f64::from(nearest.squared) <= reach * reach;
        (near && gray.is_finite() && there.is_finite()).then(|| (f64::from(gray), f64::from(there)))
    });
    (distances, intensity(pairs))
}

/// The mean of squared distances; 0 of none.
pub fn mean(squares: &[f32]) -> f64 {
    squares.iter().map(|&s| f64::from(s)).sum::<f64>() / squares.len().max(1) as f64
}

fn intensity(pairs: impl Iterator<Item = (f64, f64)>) -> Option<IntensityError> {
    let (mut n, mut a, mut b, mut aa, mut ab, mut bb, mut plain) = (0_usize, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (test, base) in pairs {
        n += 1;
        a += test;
        b += base;
        aa += test * test;
        ab += test * base;
        bb += base * base;
        plain += (test - base) * (test - base);
    }
    if n < MIN_POINTS {
        return None;
    }
    let count = n as f64;
    let (vaa, vab, vbb) = (aa - a * a / count, ab - a * b / count, bb - b * b / count);
    // A blank wall explains nothing.
    let free = if vab > 0.0 && vaa > 0.0 && vbb > 0.0 { (1.0 - vab * vab / (vaa * vbb)).clamp(0.0, 1.0) } else { 1.0 };
    Some(IntensityError { plain: plain / count, free, points: n })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn line(count: usize, gray: impl Fn(usize) -> f32) -> Cloud {
        let positions = (0..count).map(|i| [i as f32, 0.0, 0.0]).collect();
        Cloud::new(positions, (0..count).map(gray).collect(), 0.0)
    }

    #[test]
    fn distances_of_clouds_known_by_hand() {
        let (test, base) = (line(40, |_| 0.5), line(60, |_| 0.5));
        let found = compare(&test, &base, Similarity::shift(Vector3::new(0.0, 3.0, 0.0)), 1.0);
        assert_eq!(found.shape.one_sided, 9.0);
        // 20 of the base's points lie 1 to 20 beyond the end of the test.
        let beyond: f64 = (1..=20).map(|i| f64::from(i * i)).sum::<f64>() / 60.0;
        assert!((found.shape.symmetric - (9.0 + 9.0 + beyond) / 2.0).abs() < 1e-9);
        assert_eq!(found.intensity, None, "nothing within reach");
    }

    #[test]
    fn gain_and_bias_do_not_count_but_inversion_does() {
        let wave = |i: usize| 0.5 + 0.3 * libm::sinf(i as f32);
        let base = line(50, wave);
        let still = Similarity::shift(Vector3::zeros());
        let bright = compare(&line(50, |i| 0.6 * wave(i) + 0.3), &base, still, 0.1).intensity.unwrap();
        assert!(bright.free < 1e-6 && bright.plain > 0.005, "{bright:?}");
        let inverted = compare(&line(50, |i| 1.0 - wave(i)), &base, still, 0.1).intensity.unwrap();
        assert_eq!(inverted.free, 1.0);
        let blank = compare(&line(50, |_| 0.5), &base, still, 0.1).intensity.unwrap();
        assert_eq!(blank.free, 1.0);
    }
}
