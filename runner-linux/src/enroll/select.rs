//! Which corners of a picture are worth storing: those that are found again, and not confused, in simulated views.

use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::feature::Feature;
use daymark_core::kernel::Kernels;
use daymark_core::math::log2_q8;
use daymark_core::pyramid::{level_bytes, scale};

use super::simulate::CHANGES;
use crate::picture::GrayImage;

/// Candidates of a picture, at most.
pub const MOST_CANDIDATES: usize = 1_600;
/// A distance from here on counts as not found.
const LOST: i64 = 54;
/// e^0.55, the tolerance of a corner's scale.
const SCALE_TOLERANCE: f32 = 1.733_253;
/// Cells over the picture that share the places, and the least distance of two kept corners in pixels.
const CELLS: [usize; 2] = [6, 5];
const LEAST_DISTANCE: f32 = 5.0;

/// Settings of an enrollment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Selection {
    /// The corners that are tried.
    pub candidates: FrontEnd,
    /// Exactly how a frame will be read.
    pub query: FrontEnd,
    /// Corners that are kept, at most.
    pub keep: usize,
}

type WideExtractor = Extractor<256, { 48 * 3 * 64 }>;

/// The corners to store, best first for the places and then in the table's order.
pub fn select_corners<K: Kernels>(kernels: &K, image: &GrayImage, selection: Selection) -> Vec<Feature> {
    let mut extractor: Box<WideExtractor> = Box::default();
    let mut levels = vec![0; level_bytes(image.width, image.height)];
    let mut features: Box<FeatureSet<MOST_CANDIDATES>> = Box::default();
    let mut extract = |image: &GrayImage, front_end| -> Vec<Feature> {
        let Ok(view) = image.view() else { return Vec::new() };
        match extractor.extract(kernels, view, front_end, &mut levels, &mut features) {
            Ok(()) => features.view().iter().collect(),
            Err(_) => Vec::new(),
        }
    };
    let candidates = extract(image, selection.candidates);
    let mut scores = vec![0_i64; candidates.len()];
    for (seed, change) in CHANGES.iter().enumerate() {
        let found = extract(&change.render(image, seed as u64), selection.query);
        let map_scale = daymark_core::math::sqrt(change.area() as f32);
        for (candidate, score) in candidates.iter().zip(&mut scores) {
            let [x, y] = candidate.position.to_pixels();
            let place = change.apply(image, [f64::from(x), f64::from(y)]);
            *score += survival(candidate, place, map_scale, &found);
        }
    }
    keep_spread(&candidates, &scores, image, selection.keep)
}

/// `(1 - d / 53.8) / (1 + log2(1 + rank) / 2)` in Q16, at least 0: `d` the distance to the nearest signature at the
/// right place, `rank` the number of corners elsewhere that are nearer.
fn survival(candidate: &Feature, [x, y]: [f64; 2], map_scale: f32, found: &[Feature]) -> i64 {
    let expected = scale(candidate.level) * map_scale;
    let right = |feature: &Feature| {
        let size = scale(feature.level);
        let [px, py] = feature.position.to_pixels();
        let (dx, dy) = (f64::from(px) - x, f64::from(py) - y);
        let radius = f64::from(3.0 + 1.2 * size);
        dx * dx + dy * dy < radius * radius
            && size < expected * SCALE_TOLERANCE
            && expected < size * SCALE_TOLERANCE
    };
    let distance = |feature: &Feature| candidate.signature.distance(feature.signature);
    let Some(nearest) = found.iter().filter(|feature| right(feature)).map(distance).min() else { return 0 };
    let rank = found.iter().filter(|feature| distance(feature) < nearest && !right(feature)).count();
    let closeness = (5_376 - 100 * i64::from(nearest)).max(0);
    debug_assert!(closeness == 0 || i64::from(nearest) < LOST);
    (closeness << 24) / (5_376 * (256 + i64::from(log2_q8(1 + rank as u32)) / 2))
}

/// The best corners, at most two even shares a cell and 5 px apart; then the best that are left.
fn keep_spread(candidates: &[Feature], scores: &[i64], image: &GrayImage, keep: usize) -> Vec<Feature> {
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(scores[i]));
    let share = (2 * keep).div_ceil(CELLS[0] * CELLS[1]);
    let mut counts = vec![0; CELLS[0] * CELLS[1]];
    let mut kept: Vec<usize> = Vec::new();
    let apart = |a: usize, b: usize| {
        let [[ax, ay], [bx, by]] = [a, b].map(|i| candidates[i].position.to_pixels());
        (ax - bx) * (ax - bx) + (ay - by) * (ay - by) >= LEAST_DISTANCE * LEAST_DISTANCE
    };
    for &i in &order {
        let [x, y] = candidates[i].position.to_pixels();
        let cell = |p: f32, length: usize, cells: usize| ((p as usize * cells) / length).min(cells - 1);
        let cell = cell(y, image.height, CELLS[1]) * CELLS[0] + cell(x, image.width, CELLS[0]);
        if kept.len() < keep && counts[cell] < share && kept.iter().all(|&other| apart(i, other)) {
            counts[cell] += 1;
            kept.push(i);
        }
    }
    for i in order {
        if kept.len() < keep && !kept.contains(&i) {
            kept.push(i);
        }
    }
    let mut features: Vec<Feature> = kept.into_iter().map(|i| candidates[i]).collect();
    features.sort_by_key(|feature| (feature.level, feature.position.y, feature.position.x));
    features.dedup_by_key(|feature| (feature.level, feature.position));
    features
}
