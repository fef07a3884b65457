//! Rows of pixels: the pyramid, the tone curve, the structure tensor and its response, the box sums of a signature.

use super::{BoxSums, PATCH_STRIDE, Patch, WINDOW_STRIDE};

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
