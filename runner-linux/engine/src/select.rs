//! Which corners of a picture are worth storing: those that are found again, and not confused, in simulated views.

use daymark_core::candidate::surprise;
use daymark_core::extract::FrontEnd;
use daymark_core::feature::{COMMONNESS, Feature, Signature};
use daymark_core::math::{exp2, log2, log2_q8};
use daymark_core::pyramid::scale;
use daymark_core::table::on_grid;

use crate::gray::GrayImage;
use crate::reader::FrameReader;
use crate::simd::Processor;
use crate::simulate::CHANGES;

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

/// A corner that may be stored, with what the simulated views and the turned copies said of it.
struct Candidate {
    feature: Feature,
    /// Survival in the simulated views, 0..=6 in Q24.
    survival: i64,
    /// log2 of how much more often than by chance the turned copies hold a signature like this.
    commonness: f64,
}

/// The corners to store, in the table's order. Deterministic: the same picture gives the same corners.
///
/// Six simulated views are read exactly like frames; a candidate is worth what it survives, divided by the root of how
/// common its signature is.
pub fn select_corners(processor: Processor, image: &GrayImage, selection: Selection) -> Vec<Feature> {
    let mut reader = FrameReader::new(processor);
    let fresh = |feature| Candidate { feature, survival: 0, commonness: 0.0 };
    let mut candidates: Vec<Candidate> =
        features(&mut reader, image, selection.candidates).into_iter().map(fresh).collect();
    for (seed, change) in CHANGES.iter().enumerate() {
        let found = features(&mut reader, &change.render(image, seed as u64), selection.query);
        let map_scale = daymark_core::math::sqrt(change.area() as f32);
        for candidate in &mut candidates {
            let [x, y] = candidate.feature.position.to_pixels();
            let place = change.apply(image, [f64::from(x), f64::from(y)]);
            observe(candidate, place, map_scale, &found);
        }
    }
    let strangers: Vec<Signature> = turned_copies(image)
        .iter()
        .flat_map(|turned| features(&mut reader, turned, selection.query))
        .map(|feature| feature.signature)
        .collect();
    for candidate in &mut candidates {
        candidate.commonness = commonness(candidate.feature.signature, &strangers);
    }
    keep_spread(&candidates, image, selection.keep)
}

/// The features of a picture, read as a camera frame is; none of one beyond core's limits.
fn features(reader: &mut FrameReader, image: &GrayImage, front_end: FrontEnd) -> Vec<Feature> {
    reader.read(image, front_end).map_or(Vec::new(), |features| features.iter().collect())
}

/// Adds `(1 - d / 53.8) / (1 + log2(1 + rank) / 2)`, at least 0, to a candidate's survival: `d` is the distance to the
/// nearest signature at the right place, `rank` the number of corners elsewhere that are nearer.
fn observe(candidate: &mut Candidate, [x, y]: [f64; 2], map_scale: f32, found: &[Feature]) {
    let expected = scale(candidate.feature.level) * map_scale;
    let is_here = |feature: &Feature| {
        let size = scale(feature.level);
        let [px, py] = feature.position.to_pixels();
        let (dx, dy) = (f64::from(px) - x, f64::from(py) - y);
        let radius = f64::from(3.0 + 1.2 * size);
        dx * dx + dy * dy < radius * radius && size < expected * SCALE_TOLERANCE && expected < size * SCALE_TOLERANCE
    };
    let distance = |feature: &Feature| candidate.feature.signature.distance(feature.signature);
    let Some(least) = found.iter().filter(|feature| is_here(feature)).map(distance).min() else { return };
    let rank = found.iter().filter(|feature| distance(feature) < least && !is_here(feature)).count();
    let closeness = (5_376 - 100 * i64::from(least)).max(0);
    candidate.survival += (closeness << 24) / (5_376 * (256 + i64::from(log2_q8(1 + rank as u32)) / 2)) * 256;
}

/// The picture upside down, turned by 180 degrees, and both kinds turned by 90: like the picture in every statistic,
/// but a building that no frame shows. What matches there matches by chance.
fn turned_copies(image: &GrayImage) -> [GrayImage; 4] {
    let copy = |pixels: Vec<u8>| GrayImage { pixels, ..*image };
    let flipped = copy(image.pixels.chunks(image.width).rev().flatten().copied().collect());
    let turned = copy(image.pixels.iter().rev().copied().collect());
    let quarter = |image: &GrayImage| GrayImage {
        pixels: (0..image.width)
            .flat_map(|x| (0..image.height).rev().map(move |y| image.pixels[y * image.width + x]))
            .collect(),
        width: image.height,
        height: image.width,
    };
    let (on_side, flipped_on_side) = (quarter(image), quarter(&flipped));
    [flipped, turned, on_side, flipped_on_side]
}

/// `log2((k + 4) / (expected + 4))` within -1..=6: `k` strangers are as near as one in 2^10 would be by chance.
fn commonness(signature: Signature, strangers: &[Signature]) -> f64 {
    /// A surprise of 10 bits, in 1/8 bit.
    const TEN_BITS: u8 = 80;
    let farthest = (0..=128_u8).take_while(|&distance| surprise(distance) >= TEN_BITS).last().unwrap_or(0);
    let near = strangers.iter().filter(|&&other| signature.distance(other) <= u32::from(farthest)).count();
    let expected = strangers.len() as f64 * exp2(-f64::from(surprise(farthest)) / 8.0);
    let (least, most) = (f64::from(*COMMONNESS.start()), f64::from(*COMMONNESS.end()));
    log2((near as f64 + 4.0) / (expected + 4.0)).clamp(least, most)
}

/// The best corners, at most two even shares a cell and 5 px apart; then the best that are left.
fn keep_spread(candidates: &[Candidate], image: &GrayImage, keep: usize) -> Vec<Feature> {
    let worth = |candidate: &Candidate| (candidate.survival as f64 * exp2(-candidate.commonness / 2.0)) as i64;
    let worths: Vec<i64> = candidates.iter().map(worth).collect();
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(worths[i]));
    let share = (2 * keep).div_ceil(CELLS[0] * CELLS[1]);
    let mut counts = vec![0; CELLS[0] * CELLS[1]];
    let mut kept: Vec<usize> = Vec::new();
    let place = |i: usize| candidates[i].feature.position.to_pixels();
    let apart = |a: usize, b: usize| {
        let [[ax, ay], [bx, by]] = [place(a), place(b)];
        (ax - bx) * (ax - bx) + (ay - by) * (ay - by) >= LEAST_DISTANCE * LEAST_DISTANCE
    };
    for &i in &order {
        let [x, y] = place(i);
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
    let mut features: Vec<Feature> = kept.into_iter().map(|i| stored(&candidates[i], image)).collect();
    features.sort_by_key(|feature| (feature.level, feature.position.y, feature.position.x));
    features.dedup_by_key(|feature| (feature.level, feature.position));
    features
}

/// The candidate as the table keeps it.
fn stored(candidate: &Candidate, image: &GrayImage) -> Feature {
    Feature {
        position: on_grid(candidate.feature.position, image.width as u16, image.height as u16),
        commonness: libm::round(candidate.commonness) as i8,
        ..candidate.feature
    }
}
