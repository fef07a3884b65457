//! Which features of two views look alike.

use daymark_core::feature::Signature;
use daymark_core::kernel::{Kernels, places};
use daymark_engine::simd::Processor;

use crate::epipolar::EpipolarLines;
use crate::order;

/// Bits by which matching signatures may differ, of 128.
const MAX_BITS: u32 = 40;
/// The best match must have at most this share of the next one's bits, in hundredths.
const RATIO_PERCENT: u32 = 85;
/// Along a line there are fewer to be mistaken for.
const GUIDED_RATIO_PERCENT: u32 = 80;
/// A line holds dozens of features, and one of them is always on it: signatures must be nearer than elsewhere.
const MAX_GUIDED_BITS: u8 = 28;
/// Bits at which a rival is looked at.
const MAX_RIVAL_BITS: u8 = 48;
/// What lies this near is the same place, no competitor; pixels.
const SAME_PLACE: f64 = 6.0;

/// The features of a view as columns.
#[derive(Debug, Clone, Default)]
pub struct ViewFeatures {
    /// Where they are in the picture, pixels.
    pub points: Vec<[f64; 2]>,
    /// The same without distortion; NaN where no ray comes from.
    pub ideal: Vec<[f64; 2]>,
    /// Their signatures.
    pub signatures: Vec<Signature>,
}

/// Pairs of features whose signatures are nearest to one another in both directions, clearly nearer than the next ones
/// elsewhere. Ties have no match. `O(n m)`.
pub fn mutual_matches(first: &ViewFeatures, second: &ViewFeatures) -> Vec<[u32; 2]> {
    let processor = Processor::detect();
    let kernels = processor.kernels();
    let mut row = Row::new(first.points.len().max(second.points.len()));
    (0..first.points.len())
        .filter_map(|number| {
            let best = row.nearest(kernels, first.signatures[number], second)?;
            // The way back is looked for only where there is one.
            let back = row.nearest(kernels, second.signatures[best], first)?;
            (back == number).then_some([number as u32, best as u32])
        })
        .collect()
}

/// Distances of one signature from many, and room to look for the near ones.
struct Row {
    distances: Vec<u8>,
    marks: Vec<u64>,
}

impl Row {
    fn new(length: usize) -> Self {
        Self { distances: vec![0; length], marks: vec![0; length.div_ceil(64)] }
    }

    /// The feature nearest to a signature, if it is near and no other one elsewhere comes close.
    fn nearest(&mut self, kernels: &dyn Kernels, signature: Signature, to: &ViewFeatures) -> Option<usize> {
        let row = self.distances.get_mut(..to.signatures.len())?;
        let marks = self.marks.get_mut(..row.len().div_ceil(64))?;
        kernels.distances(signature, &to.signatures, row);
        let least = row.iter().copied().min()?;
        if u32::from(least) > MAX_BITS {
            return None;
        }
        kernels.marks_at_most(row, (u32::from(least) * 100 / RATIO_PERCENT) as u8, marks);
        let best = places(marks).find(|&place| row[place] == least)?;
        let rival = places(marks).any(|other| elsewhere(to.points[other], to.points[best]));
        (!rival).then_some(best)
    }
}

fn elsewhere(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() > SAME_PLACE || (a[1] - b[1]).abs() > SAME_PLACE
}

/// For features without a match: the nearest signature among those on its epipolar line, if no other one there comes close.
///
/// `lines` has the features of both views; on the line is what lies below `limit`, a squared Sampson distance.
pub fn guided_matches(
    first: &ViewFeatures,
    second: &ViewFeatures,
    known: &[[u32; 2]],
    lines: &EpipolarLines,
    limit: f64,
) -> Vec<[u32; 2]> {
    // What has no direction is NaN, and not below.
    let near = |a: usize, b: usize| lines.squared_distance(a, b) < limit;
    let (mut left, mut right) = (vec![false; first.points.len()], vec![false; second.points.len()]);
    for &[a, b] in known {
        (left[a as usize], right[b as usize]) = (true, true);
    }
    // What is left of the second view, side by side in the order of height: a line meets a part of it.
    let by_height = lines.by_height((0..right.len()).filter(|&b| !right[b]));
    let signatures: Vec<Signature> = by_height.numbers.iter().map(|&b| second.signatures[b as usize]).collect();
    let mut found: Vec<(u8, [u32; 2])> = Vec::new();
    let processor = Processor::detect();
    let kernels = processor.kernels();
    let Row { mut distances, mut marks } = Row::new(signatures.len());
    for (a, signature) in first.signatures.iter().enumerate().filter(|(a, _)| !left[*a]) {
        let part = lines.near(a, &by_height, limit);
        let rest = &by_height.numbers[part.clone()];
        let (distances, marks) = (&mut distances[..rest.len()], &mut marks[..rest.len().div_ceil(64)]);
        kernels.distances(*signature, &signatures[part], distances);
        // Most have nothing that is near enough: their rivals need not be looked at.
        kernels.marks_at_most(distances, MAX_GUIDED_BITS, marks);
        let allowed = places(marks).filter(|&place| near(a, rest[place] as usize));
        let Some((least, best)) = allowed.map(|place| (distances[place], rest[place])).min() else { continue };
        kernels.marks_at_most(distances, MAX_RIVAL_BITS, marks);
        let mut rivals = places(marks).filter(|&place| {
            u32::from(least) * 100 > u32::from(distances[place]) * GUIDED_RATIO_PERCENT
                && elsewhere(second.points[rest[place] as usize], second.points[best as usize])
        });
        if !rivals.any(|rival| near(a, rest[rival] as usize)) {
            found.push((least, [a as u32, best]));
        }
    }
    // One to one, the best first.
    order::sort(&mut found);
    found
        .into_iter()
        .filter_map(|(_, pair)| {
            let taken = std::mem::replace(&mut right[pair[1] as usize], true);
            (!taken).then_some(pair)
        })
        .collect()
}
