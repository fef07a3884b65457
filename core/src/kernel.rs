//! The inner loops, each written once as a plain loop over slices.
//!
//! A caller who knows its processor implements [`Kernels`] and compiles the same loops for a wider instruction set;
//! the default methods are these loops as they stand. All of it is integer arithmetic, or single `f32` operations that
//! are never reassociated, so every implementation gives the same bits: a test in the Linux runner compares them.
//!
//! Every function works on the shortest of its slices and never fails.

use crate::feature::Signature;

/// Side of a signature's window of box sums, in pixels of its level: offsets −18..=18.
pub const WINDOW: usize = 37;
/// Side of the pixel patch under that window: each box reaches 2 px further.
pub const PATCH: usize = WINDOW + 4;
/// Row stride of the box sums; the columns beyond [`WINDOW`] hold nothing of use.
pub const WINDOW_STRIDE: usize = 40;
/// Row stride of a patch.
pub const PATCH_STRIDE: usize = WINDOW_STRIDE + 4;

/// A pixel patch around a corner.
pub type Patch = [u8; PATCH * PATCH_STRIDE];
/// 5 x 5 box sums of a [`Patch`]; the length is a power of two so that an index can be masked instead of checked.
pub type BoxSums = [u16; 2_048];

/// The inner loops of the recognizer. Implement it to compile them for a wider instruction set.
pub trait Kernels {
    /// See [`shrink_seven_to_five`].
    fn shrink_seven_to_five(&self, rows: [&[u8]; 3], weights: [u16; 3], out: &mut [u8]) {
        shrink_seven_to_five(rows, weights, out);
    }
    /// See [`halve`].
    fn halve(&self, upper: &[u8], lower: &[u8], out: &mut [u8]) {
        halve(upper, lower, out);
    }
    /// See [`tone_row`].
    fn tone_row(&self, row: &[u8], out: &mut [u8]) {
        tone_row(row, out);
    }
    /// See [`structure_row`].
    fn structure_row(&self, rows: [&[u8]; 3], products: [&mut [i32]; 3], out: [&mut [i32]; 3]) {
        structure_row(rows, products, out);
    }
    /// See [`response_row`].
    fn response_row(&self, rows: [[&[i32]; 3]; 5], out: &mut [f32]) {
        response_row(rows, out);
    }
    /// See [`peak_flags`].
    fn peak_flags(&self, rows: [&[f32]; 3], flags: &mut [u8]) {
        peak_flags(rows, flags);
    }
    /// See [`box_sums`].
    fn box_sums(&self, patch: &Patch, sums: &mut BoxSums) {
        box_sums(patch, sums);
    }
    /// See [`distances`].
    fn distances(&self, signature: Signature, others: &[Signature], out: &mut [u8]) {
        distances(signature, others, out);
    }
    /// See [`count_below`].
    fn count_below(&self, values: &[u8], limit: u8) -> u32 {
        count_below(values, limit)
    }
    /// See [`each_at_most`].
    fn each_at_most(&self, values: &[u8], limit: u8, found: &mut dyn FnMut(usize)) {
        each_at_most(values, limit, found);
    }
    /// See [`closest`].
    fn closest(&self, blocks: &[LookAlikes], search: Search) -> i32 {
        closest(blocks, search)
    }
    /// See [`nearest_three`].
    fn nearest_three(&self, row: &[u8], limit: u8) -> Nearest {
        nearest_three(row, limit)
    }
    /// See [`votes`].
    fn votes(&self, seed: Seed, columns: VoteColumns<'_>, agrees: &mut [u8]) -> i32 {
        votes(seed, columns, agrees)
    }
}

/// The loops exactly as they stand, for any processor.
#[derive(Debug, Clone, Copy, Default)]
pub struct Portable;

impl Kernels for Portable {}

/// One row of the 7:5 area average: three rows with weights that add up to 7 are combined, then each seven columns
/// become five. Rounded to nearest; exact in `u16` (at most 49 * 255).
#[inline(always)]
pub fn shrink_seven_to_five(rows: [&[u8]; 3], weights: [u16; 3], out: &mut [u8]) {
    let [upper, middle, lower] = rows;
    let [a, b, c] = weights;
    let columns = upper.chunks_exact(7).zip(middle.chunks_exact(7)).zip(lower.chunks_exact(7));
    for (((upper, middle), lower), out) in columns.zip(out.chunks_exact_mut(5)) {
        let mut sum = [0_u16; 7];
        for (((sum, &u), &m), &l) in sum.iter_mut().zip(upper).zip(middle).zip(lower) {
            *sum = a * u16::from(u) + b * u16::from(m) + c * u16::from(l);
        }
        let [s0, s1, s2, s3, s4, s5, s6] = sum;
        let five = [5 * s0 + 2 * s1, 3 * s1 + 4 * s2, s2 + 5 * s3 + s4, 4 * s4 + 3 * s5, 2 * s5 + 5 * s6];
        for (out, sum) in out.iter_mut().zip(five) {
            *out = ((sum + 24) / 49) as u8;
        }
    }
}

/// One row of the 2 x 2 average, rounded to nearest.
#[inline(always)]
pub fn halve(upper: &[u8], lower: &[u8], out: &mut [u8]) {
    for ((upper, lower), out) in upper.chunks_exact(2).zip(lower.chunks_exact(2)).zip(out) {
        let ([u0, u1], [l0, l1]) = (pair(upper), pair(lower));
        *out = ((u0 + u1 + l0 + l1 + 2) >> 2) as u8;
    }
}

#[inline(always)]
fn pair(chunk: &[u8]) -> [u16; 2] {
    match chunk {
        &[a, b] => [u16::from(a), u16::from(b)],
        _ => [0; 2],
    }
}

/// One row under the tone curve of [`tone`].
#[inline(always)]
pub fn tone_row(row: &[u8], out: &mut [u8]) {
    for (&gray, out) in row.iter().zip(out) {
        *out = tone(gray);
    }
}

/// The tone curve, close to `16 sqrt(gray)`.
///
/// It is the least of the six tangents of `16 sqrt(v)` at 1/4, 1, 4, 16, 64 and 256, `2^k v + 2^(6 - k)`: concave,
/// within 7 % of the root (and 4 at black), and nothing but saturating additions.
#[inline(always)]
pub const fn tone(gray: u8) -> u8 {
    let v2 = gray.saturating_add(gray);
    let v4 = v2.saturating_add(v2);
    let v8 = v4.saturating_add(v4);
    let v16 = v8.saturating_add(v8);
    let dark = least(least(v16.saturating_add(4), v8.saturating_add(8)), v4.saturating_add(16));
    let bright = least(least(v2.saturating_add(32), gray.saturating_add(64)), (gray >> 1).saturating_add(128));
    least(dark, bright)
}

#[inline(always)]
const fn least(a: u8, b: u8) -> u8 {
    if a < b { a } else { b }
}

/// One row of the structure tensor, smoothed along the row.
///
/// `rows` are three neighbouring rows of n + 6 columns. 3 x 3 Sobel gradients (|g| <= 1,020) give the products
/// `[gx gx, gy gy, gx gy]` in `products` (n + 4 columns); binomial 1-4-6-4-1 with `>> 4` gives `out` (n columns).
#[inline(always)]
pub fn structure_row(rows: [&[u8]; 3], products: [&mut [i32]; 3], out: [&mut [i32]; 3]) {
    let [above, centre, below] = rows;
    let [xx, yy, xy] = products;
    let edges = from(above, 0).zip(from(above, 2)).zip(from(below, 0)).zip(from(below, 2));
    let cross = from(centre, 0).zip(from(centre, 2)).zip(from(above, 1)).zip(from(below, 1));
    let gradients = edges.zip(cross).map(|((((a0, a2), b0), b2), (((c0, c2), a1), b1))| {
        let [a0, a1, a2, c0, c2, b0, b1, b2] = [a0, a1, a2, c0, c2, b0, b1, b2].map(|&pixel| i16::from(pixel));
        [2 * (c2 - c0) + (a2 - a0) + (b2 - b0), 2 * (b1 - a1) + (b0 - a0) + (b2 - a2)]
    });
    let products = xx.iter_mut().zip(yy.iter_mut()).zip(xy.iter_mut());
    for (((xx, yy), xy), [gx, gy]) in products.zip(gradients) {
        let (gx, gy) = (i32::from(gx), i32::from(gy));
        (*xx, *yy, *xy) = (gx * gx, gy * gy, gx * gy);
    }
    for (products, out) in [xx, yy, xy].into_iter().zip(out) {
        let outer = from(products, 0).zip(from(products, 4));
        let inner = from(products, 1).zip(from(products, 2)).zip(from(products, 3));
        for (((p0, p4), ((p1, p2), p3)), out) in outer.zip(inner).zip(out) {
            *out = binomial([*p0, *p1, *p2, *p3, *p4]);
        }
    }
}

/// The elements from `start` on.
#[inline(always)]
fn from<T>(row: &[T], start: usize) -> core::slice::Iter<'_, T> {
    row.get(start..).unwrap_or(&[]).iter()
}

/// 1-4-6-4-1 with `>> 4`.
#[inline(always)]
fn binomial([p0, p1, p2, p3, p4]: [i32; 5]) -> i32 {
    (p0 + p4 + 4 * (p1 + p2 + p3) + 2 * p2) >> 4
}

/// One row of the Harris response from five rows of the tensor: binomial 1-4-6-4-1 with `>> 4` down the columns gives
/// the smoothed tensor `a, b, c` (integers below 2^20), then `20 (a b - c c) - (a + b)^2`, that is `20 R` with
/// `k = 0.05` (Harris and Stephens 1988).
///
/// The last expression is `f32`: `a`, `b`, `c` enter exactly, each operation is one IEEE operation in the written
/// order, and a response takes 4 bytes instead of 8.
#[inline(always)]
pub fn response_row(rows: [[&[i32]; 3]; 5], out: &mut [f32]) {
    let [[xx0, yy0, xy0], [xx1, yy1, xy1], [xx2, yy2, xy2], [xx3, yy3, xy3], [xx4, yy4, xy4]] = rows;
    let xx = smoothed_columns([xx0, xx1, xx2, xx3, xx4]);
    let yy = smoothed_columns([yy0, yy1, yy2, yy3, yy4]);
    let xy = smoothed_columns([xy0, xy1, xy2, xy3, xy4]);
    for (((a, b), c), out) in xx.zip(yy).zip(xy).zip(out) {
        let trace = a + b;
        *out = 20.0 * (a * b - c * c) - trace * trace;
    }
}

#[inline(always)]
fn smoothed_columns([r0, r1, r2, r3, r4]: [&[i32]; 5]) -> impl Iterator<Item = f32> {
    let columns = r0.iter().zip(r1).zip(r2).zip(r3).zip(r4);
    columns.map(|((((p0, p1), p2), p3), p4)| binomial([*p0, *p1, *p2, *p3, *p4]) as f32)
}

/// Marks possible peaks of the middle row with 1: positive, above the left and upper neighbour, not below the right
/// and lower one. The first and last column are not marked.
#[inline(always)]
pub fn peak_flags(rows: [&[f32]; 3], flags: &mut [u8]) {
    let [up, mid, down] = rows;
    let n = flags.len().min(up.len()).min(mid.len()).min(down.len());
    if n < 2 {
        return flags.fill(0);
    }
    let inner = n - 2;
    let (Some(left), Some(centre), Some(right), Some(up), Some(down), Some(inside)) = (
        mid.get(..inner),
        mid.get(1..=inner),
        mid.get(2..n),
        up.get(1..=inner),
        down.get(1..=inner),
        flags.get_mut(1..=inner),
    ) else {
        return;
    };
    let horizontal = left.iter().zip(centre).zip(right);
    for ((((&left, &centre), &right), (&up, &down)), flag) in horizontal.zip(up.iter().zip(down)).zip(inside) {
        let peak = (centre > 0.0) & (centre > left) & (centre >= right) & (centre > up) & (centre >= down);
        *flag = u8::from(peak);
    }
    for edge in [0, n - 1] {
        if let Some(flag) = flags.get_mut(edge) {
            *flag = 0;
        }
    }
}

/// 5 x 5 box sums of a patch (not divided, at most 6,375, so that dark frames keep their precision).
///
/// Row `y`, column `x` of the window stands at `y * WINDOW_STRIDE + x`.
#[inline(always)]
pub fn box_sums(patch: &Patch, sums: &mut BoxSums) {
    // Sums down five rows, moved by adding the row that enters and subtracting the one that leaves.
    let mut columns = [0_u16; PATCH_STRIDE];
    for row in patch.chunks_exact(PATCH_STRIDE).take(4) {
        for (sum, &pixel) in columns.iter_mut().zip(row) {
            *sum += u16::from(pixel);
        }
    }
    let entering = patch.chunks_exact(PATCH_STRIDE).skip(4);
    let leaving = patch.chunks_exact(PATCH_STRIDE);
    for ((entering, leaving), sums) in entering.zip(leaving).zip(sums.chunks_exact_mut(WINDOW_STRIDE)) {
        for (sum, &pixel) in columns.iter_mut().zip(entering) {
            *sum += u16::from(pixel);
        }
        for (sum, window) in sums.iter_mut().zip(columns.windows(5)) {
            let &[c0, c1, c2, c3, c4] = window else { return };
            *sum = c0 + c1 + c2 + c3 + c4;
        }
        for (sum, &pixel) in columns.iter_mut().zip(leaving) {
            *sum -= u16::from(pixel);
        }
    }
}

/// Hamming distances of one signature to many, 0..=128 each.
#[inline(always)]
pub fn distances(signature: Signature, others: &[Signature], out: &mut [u8]) {
    for (out, &other) in out.iter_mut().zip(others) {
        *out = signature.distance(other) as u8;
    }
}

/// How many values are below the limit.
#[inline(always)]
pub fn count_below(values: &[u8], limit: u8) -> u32 {
    // Byte lanes first: 255 values cannot overflow a lane.
    values.chunks(255).map(|chunk| u32::from(chunk.iter().fold(0_u8, |n, &v| n + u8::from(v < limit)))).sum()
}

/// The three nearest of a row of distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nearest {
    /// Distances, ascending; 255 where there is none.
    pub distances: [u8; 3],
    /// Their places in the row; of equal distances the first come first.
    pub places: [u16; 3],
}

/// The three smallest values of at most `limit`, the first of equal ones first.
#[inline(always)]
pub fn nearest_three(row: &[u8], limit: u8) -> Nearest {
    let mut nearest = Nearest { distances: [255; 3], places: [0; 3] };
    let mut bound = limit;
    for (number, chunk) in row.chunks(64).enumerate() {
        for (group, mut marks) in at_most(chunk, bound).into_iter().enumerate() {
            while marks != 0 {
                let offset = group * 8 + marks.trailing_zeros() as usize / 8;
                marks &= marks - 1;
                let Some(&distance) = chunk.get(offset) else { break };
                if distance > bound {
                    continue;
                }
                let place = (number * 64 + offset) as u16;
                let [d0, d1, d2] = nearest.distances;
                let [p0, p1, _] = nearest.places;
                if distance < d0 {
                    nearest = Nearest { distances: [distance, d0, d1], places: [place, p0, p1] };
                } else if distance < d1 {
                    nearest = Nearest { distances: [d0, distance, d1], places: [p0, place, p1] };
                } else if distance < d2 {
                    nearest = Nearest { distances: [d0, d1, distance], places: [p0, p1, place] };
                }
                // Equal to the third does not enter.
                bound = bound.min(nearest.distances[2].saturating_sub(1));
            }
        }
    }
    nearest
}

/// Marks the values of at most `limit` among the first 64: byte `b` of word `w` is 1 for value `8 w + b`.
#[inline(always)]
fn at_most(values: &[u8], limit: u8) -> [u64; 8] {
    let mut marks = [0; 64];
    if let Some(values) = values.first_chunk::<64>() {
        for (mark, &value) in marks.iter_mut().zip(values) {
            *mark = u8::from(value <= limit);
        }
    } else {
        for (mark, &value) in marks.iter_mut().zip(values) {
            *mark = u8::from(value <= limit);
        }
    }
    let mut words = [0; 8];
    for (word, marks) in words.iter_mut().zip(marks.as_chunks::<8>().0) {
        *word = u64::from_le_bytes(*marks);
    }
    words
}

/// The places of the bytes that are not 0, eight at a look.
#[inline(always)]
pub fn marked(marks: &[u8]) -> impl Iterator<Item = usize> {
    let (chunks, rest) = marks.as_chunks::<8>();
    let tail = chunks.len() * 8;
    let in_chunks = chunks.iter().enumerate().flat_map(|(number, chunk)| {
        let mut bits = u64::from_le_bytes(*chunk);
        core::iter::from_fn(move || {
            if bits == 0 {
                return None;
            }
            let place = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            Some(number * 8 + place / 8)
        })
    });
    in_chunks.chain(rest.iter().enumerate().filter(|(_, mark)| **mark != 0).map(move |(i, _)| tail + i))
}

/// Calls `found` with the place of every value of at most `limit`, in order.
#[inline(always)]
pub fn each_at_most(values: &[u8], limit: u8, found: &mut dyn FnMut(usize)) {
    for (number, chunk) in values.chunks(64).enumerate() {
        for (group, mut marks) in at_most(chunk, limit).into_iter().enumerate() {
            while marks != 0 {
                found(number * 64 + group * 8 + marks.trailing_zeros() as usize / 8);
                marks &= marks - 1;
            }
        }
    }
}

/// Corners of the frame that look like one stored corner, side by side.
pub const LANES: usize = 16;

/// A block of corners of the frame that look like one stored corner; what fills it up has no gain.
#[derive(Debug, Clone, Copy)]
pub struct LookAlikes {
    /// x in the frame, px.
    pub x: [f32; LANES],
    /// y in the frame, px.
    pub y: [f32; LANES],
    /// Gain in 1/64 bit.
    pub gain: [i32; LANES],
    /// The corner's level, as the bit of that number.
    pub level: [i32; LANES],
    /// The corner's number.
    pub number: [i32; LANES],
}

/// A place to search around, in the frame.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// The place, px.
    pub at: [f32; 2],
    /// Square of the radius, px².
    pub radius_squared: f32,
    /// The levels that fit, a bit each.
    pub levels: i32,
}

/// Weight of a corner at a squared distance of `squared` px² from where it is searched: gain times closeness,
/// `gain * round(1024 (1 - squared / (1.2 radius²)))`, and below it the corner's number, the lower the larger. At most
/// 768 * 1,024 * 2^11 < 2^31.
///
/// The larger key wins, whatever the order in which corners are looked at. `0` stands for none.
#[inline(always)]
pub fn search_key(search: Search, squared: f32, gain: i32, level: i32, number: i32) -> i32 {
    /// Adding 2^23 leaves the rounded integer in the low bits of an `f32`: a cast that vectorizes.
    const TO_INTEGER: f32 = 8_388_608.0;
    let closeness = 1_024.0 * (1.0 - squared / (1.2 * search.radius_squared));
    let closeness = ((closeness + TO_INTEGER).to_bits() & 0x7ff) as i32;
    let fits = (squared <= search.radius_squared) & (level & search.levels != 0) & (gain > 0);
    let key = gain.wrapping_mul(closeness) << NUMBER_BITS | (NUMBER_LIMIT - number);
    if fits { key } else { 0 }
}

/// Bits of a corner's number in a [`search_key`].
pub const NUMBER_BITS: u32 = 11;
/// Corners of a frame have numbers up to this.
pub const NUMBER_LIMIT: i32 = (1 << NUMBER_BITS) - 1;

/// The largest [`search_key`] of the corners.
#[inline(always)]
pub fn closest(blocks: &[LookAlikes], search: Search) -> i32 {
    let mut best = [0; LANES];
    for block in blocks {
        for (lane, best) in best.iter_mut().enumerate() {
            let [dx, dy] = [block.x[lane] - search.at[0], block.y[lane] - search.at[1]];
            let (gain, level, number) = (block.gain[lane], block.level[lane], block.number[lane]);
            let key = search_key(search, dx * dx + dy * dy, gain, level, number);
            *best = if key > *best { key } else { *best };
        }
    }
    best.into_iter().fold(0, |best, key| if key > best { key } else { best })
}

/// Candidate correspondences as columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct VoteColumns<'a> {
    /// x in the stored view, px.
    pub from_x: &'a [f32],
    /// y in the stored view, px.
    pub from_y: &'a [f32],
    /// x in the frame, px.
    pub to_x: &'a [f32],
    /// y in the frame, px.
    pub to_y: &'a [f32],
    /// Level in the frame minus level in the view.
    pub step: &'a [f32],
    /// Weight of the vote.
    pub gain: &'a [i32],
}

/// A map that one correspondence proposes: upright, scaled by its levels, through its two points.
#[derive(Debug, Clone, Copy)]
pub struct Seed {
    /// The point in the stored view, px.
    pub from: [f32; 2],
    /// The point in the frame, px.
    pub to: [f32; 2],
    /// Scale of the map.
    pub scale: f32,
    /// Level in the frame minus level in the view.
    pub step: f32,
}

/// Position error that a seed allows at its own place, in pixels.
pub const SLACK: f32 = 10.0;
/// Position error that a seed allows for each pixel of distance from its place: roll to about 12 degrees,
/// foreshortening and relief.
pub const SLACK_PER_PIXEL: f32 = 0.22;

/// Which correspondences agree with a seed, and the sum of their gains.
///
/// Agreement: error `r < SLACK + SLACK_PER_PIXEL e` with `e` the predicted distance from the seed, and a level step
/// that differs by at most one. The root is avoided: with `D = r² - SLACK² - SLACK_PER_PIXEL² e²` the condition is
/// `D < 0` or `D² < (2 SLACK SLACK_PER_PIXEL)² e²`.
#[inline(always)]
pub fn votes(seed: Seed, columns: VoteColumns<'_>, agrees: &mut [u8]) -> i32 {
    let VoteColumns { from_x, from_y, to_x, to_y, step, gain } = columns;
    let n = from_x.len();
    let (Some(from_y), Some(to_x), Some(to_y), Some(step), Some(gain), Some(agrees)) =
        (from_y.get(..n), to_x.get(..n), to_y.get(..n), step.get(..n), gain.get(..n), agrees.get_mut(..n))
    else {
        return 0;
    };
    let mut sum = 0;
    for i in 0..n {
        let (ex, ey) = ((from_x[i] - seed.from[0]) * seed.scale, (from_y[i] - seed.from[1]) * seed.scale);
        let (rx, ry) = (seed.to[0] + ex - to_x[i], seed.to[1] + ey - to_y[i]);
        let (e, r) = (ex * ex + ey * ey, rx * rx + ry * ry);
        let excess = r - (SLACK * SLACK) - (SLACK_PER_PIXEL * SLACK_PER_PIXEL) * e;
        let cross = 2.0 * SLACK * SLACK_PER_PIXEL;
        let near = (excess < 0.0) | (excess * excess < (cross * cross) * e);
        let turn = step[i] - seed.step;
        let agree = near & (turn.abs() <= 1.0);
        agrees[i] = u8::from(agree);
        sum += if agree { gain[i] } else { 0 };
    }
    sum
}
