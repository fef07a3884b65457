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
    /// See [`gradient_row`].
    fn gradient_row(&self, rows: [&[u8]; 3], out: [&mut [i16]; 2]) {
        gradient_row(rows, out);
    }
    /// See [`tensor_row`].
    fn tensor_row(&self, gradients: [&[i16]; 2], out: [&mut [i32]; 3]) {
        tensor_row(gradients, out);
    }
    /// See [`response_row`].
    fn response_row(&self, rows: [[&[i32]; 3]; 5], out: &mut [f32]) {
        response_row(rows, out);
    }
    /// See [`peak_flags`].
    fn peak_flags(&self, rows: [&[f32]; 3], least: f32, flags: &mut [u8]) {
        peak_flags(rows, least, flags);
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
    /// See [`marks_at_most`].
    fn marks_at_most(&self, values: &[u8], limit: u8, marks: &mut [u64]) {
        marks_at_most(values, limit, marks);
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

/// One row of 3 x 3 Sobel gradients `[gx, gy]` (n columns, |g| <= 1,020) from three neighbouring rows of n + 2.
#[inline(always)]
pub fn gradient_row(rows: [&[u8]; 3], out: [&mut [i16]; 2]) {
    let [above, centre, below] = rows;
    let [gx, gy] = out;
    let edges = from(above, 0).zip(from(above, 2)).zip(from(below, 0)).zip(from(below, 2));
    let cross = from(centre, 0).zip(from(centre, 2)).zip(from(above, 1)).zip(from(below, 1));
    for (((gx, gy), (((a0, a2), b0), b2)), (((c0, c2), a1), b1)) in gx.iter_mut().zip(gy).zip(edges).zip(cross) {
        let [a0, a1, a2, c0, c2, b0, b1, b2] = [a0, a1, a2, c0, c2, b0, b1, b2].map(|&pixel| i16::from(pixel));
        *gx = 2 * (c2 - c0) + (a2 - a0) + (b2 - b0);
        *gy = 2 * (b1 - a1) + (b0 - a0) + (b2 - a2);
    }
}

/// One row of the structure tensor, smoothed along the row: the products `[gx gx, gy gy, gx gy]` under a binomial
/// 1-4-6-4-1 with `>> 4`. n columns from gradients of n + 4.
#[inline(always)]
pub fn tensor_row(gradients: [&[i16]; 2], out: [&mut [i32]; 3]) {
    let ([gx, gy], [xx, yy, xy]) = (gradients, out);
    smooth_products(gx, gx, xx);
    smooth_products(gy, gy, yy);
    smooth_products(gx, gy, xy);
}

#[inline(always)]
fn smooth_products(a: &[i16], b: &[i16], out: &mut [i32]) {
    let products = |start: usize| from(a, start).zip(from(b, start)).map(|(&a, &b)| i32::from(a) * i32::from(b));
    let outer = products(0).zip(products(4));
    let inner = products(1).zip(products(2)).zip(products(3));
    for (((p0, p4), ((p1, p2), p3)), out) in outer.zip(inner).zip(out) {
        *out = binomial([p0, p1, p2, p3, p4]);
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

/// Marks possible peaks of the middle row with 1: `least` or more, above the left and upper neighbour, not below the right
/// and lower one. The first and last column are not marked.
#[inline(always)]
pub fn peak_flags(rows: [&[f32]; 3], least: f32, flags: &mut [u8]) {
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
        let peak = (centre >= least) & (centre > left) & (centre >= right) & (centre > up) & (centre >= down);
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

/// The three smallest values of at most `limit`, the first of equal ones first. At most [`NUMBER_LIMIT`] `+ 1` values
/// are looked at.
#[inline(always)]
pub fn nearest_three(row: &[u8], limit: u8) -> Nearest {
    // Each lane keeps the three smallest of its values, as keys of value and chunk: no branches.
    let mut smallest = [[u16::MAX; NEAREST_LANES]; 3];
    let (chunks, rest) = row.as_chunks::<NEAREST_LANES>();
    for (number, chunk) in (0..NEAREST_CHUNKS).zip(chunks) {
        keep_three_smallest(&mut smallest, chunk, number);
    }
    if chunks.len() < usize::from(NEAREST_CHUNKS) {
        keep_three_smallest(&mut smallest, rest, chunks.len() as u16);
    }
    let mut nearest = Nearest { distances: [255; 3], places: [0; 3] };
    for (distance, place) in nearest.distances.iter_mut().zip(&mut nearest.places) {
        let [first, second, third] = &mut smallest;
        let mut best = u32::MAX;
        for (lane, &key) in (0..).zip(first.iter()) {
            let key = u32::from(key) << NEAREST_LANES.ilog2() | lane;
            best = if key < best { key } else { best };
        }
        if best >> NUMBER_BITS > u32::from(limit) {
            break;
        }
        (*distance, *place) = ((best >> NUMBER_BITS) as u8, (best & NUMBER_LIMIT as u32) as u16);
        let lane = best as usize % NEAREST_LANES;
        (first[lane], second[lane], third[lane]) = (second[lane], third[lane], u16::MAX);
    }
    nearest
}

/// Values that [`nearest_three`] looks at side by side.
const NEAREST_LANES: usize = 32;
/// Chunks of as many values; a key of value and chunk has 16 bits.
const NEAREST_CHUNKS: u16 = 1 << (NUMBER_BITS - NEAREST_LANES.ilog2());

#[inline(always)]
fn keep_three_smallest(smallest: &mut [[u16; NEAREST_LANES]; 3], values: &[u8], number: u16) {
    let [first, second, third] = smallest;
    let lanes = first.iter_mut().zip(second).zip(third);
    for (((first, second), third), &value) in lanes.zip(values) {
        let key = u16::from(value) << NEAREST_CHUNKS.ilog2() | number;
        let (a, larger) = (key.min(*first), key.max(*first));
        let (b, larger) = (larger.min(*second), larger.max(*second));
        (*first, *second, *third) = (a, b, larger.min(*third));
    }
}

/// Which of the first 64 values are at most `limit`, a bit each.
#[inline(always)]
fn at_most(values: &[u8], limit: u8) -> u64 {
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
    bits(&marks)
}

/// Bit `i` is byte `i`, each 0 or 1.
#[inline(always)]
fn bits(marks: &[u8; 64]) -> u64 {
    // The product has byte i at bit 56 + i; no two terms meet, so nothing carries.
    let gathered = |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    marks.as_chunks::<8>().0.iter().enumerate().fold(0, |bits, (number, eight)| bits | gathered(eight) << (8 * number))
}

/// Calls `found` with the places of the bytes that are 1; the others are 0.
#[inline(always)]
pub fn each_marked(marks: &[u8], mut found: impl FnMut(usize)) {
    let (chunks, rest) = marks.as_chunks::<64>();
    let mut padded = [0; 64];
    for (padded, &mark) in padded.iter_mut().zip(rest) {
        *padded = mark;
    }
    for (number, marks) in chunks.iter().chain((!rest.is_empty()).then_some(&padded)).enumerate() {
        let mut bits = bits(marks);
        while bits != 0 {
            found(number * 64 + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// Marks the values of at most `limit`: bit `i % 64` of word `i / 64` for value `i`.
#[inline(always)]
pub fn marks_at_most(values: &[u8], limit: u8, marks: &mut [u64]) {
    for (marks, values) in marks.iter_mut().zip(values.chunks(64)) {
        *marks = at_most(values, limit);
    }
}

/// The places of the bits that are 1.
#[inline(always)]
pub fn places(marks: &[u64]) -> impl Iterator<Item = usize> {
    marks.iter().enumerate().flat_map(|(number, &marks)| {
        let mut rest = marks;
        core::iter::from_fn(move || {
            let bit = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
            rest &= rest - 1;
            Some(number * 64 + bit)
        })
    })
}

/// Corners of the frame that look like one stored corner, side by side.
pub const LANES: usize = 16;

/// A block of corners of the frame that look like one stored corner; what fills it up has no gain.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
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
    let mut found = false;
    for block in blocks {
        let mut squared = [0.0; LANES];
        let mut near = false;
        for (lane, squared) in squared.iter_mut().enumerate() {
            let [dx, dy] = [block.x[lane] - search.at[0], block.y[lane] - search.at[1]];
            *squared = dx * dx + dy * dy;
            near |= *squared <= search.radius_squared;
        }
        // Few blocks have a corner within the radius; the division is for them.
        if !near {
            continue;
        }
        found = true;
        for (lane, best) in best.iter_mut().enumerate() {
            let (gain, level, number) = (block.gain[lane], block.level[lane], block.number[lane]);
            let key = search_key(search, squared[lane], gain, level, number);
            *best = if key > *best { key } else { *best };
        }
    }
    if found { best.into_iter().fold(0, |best, key| if key > best { key } else { best }) } else { 0 }
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
