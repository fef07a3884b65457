//! Two loops of core again, with instructions that the compiler does not find by itself.
//!
//! - `tensor_row`: 1-4-6-4-1 is 1-1 after 1-3-3-1, and one instruction adds two neighbouring products of 16 bits, for
//!   every other column: a row of the tensor takes two thirds of the time.
//! - `marks_at_most`: a comparison of bytes as bits of a register, without the way through memory.

use daymark_core::kernel;

/// Defines the module `$name` for vectors of `$bytes` bytes.
macro_rules! by_hand {
    (
        $name:ident, $features:literal, $bytes:literal, $vector:ident, $load:ident, $store:ident, $madd:ident, $add:ident,
        $shift:ident, $interleave:ident, $marks:ident
    ) => {
        pub(super) mod $name {
            use super::*;

            /// Columns that are worked on at once: as many 16-bit lanes as a vector has.
            const SPAN: usize = $bytes / 2;

            /// [`kernel::tensor_row`].
            #[target_feature(enable = $features)]
            pub(in super::super) fn tensor_row(gradients: [&[i16]; 2], out: [&mut [i32]; 3]) {
                let ([gx, gy], [xx, yy, xy]) = (gradients, out);
                let n = gx.len().min(gy.len()).saturating_sub(4).min(xx.len()).min(yy.len()).min(xy.len());
                if n < SPAN {
                    return kernel::tensor_row([gx, gy], [xx, yy, xy]);
                }
                let (mut start, mut done) = (0, 0);
                while done < n {
                    let (Some(gx), Some(gy)) = (span(gx, start), span(gy, start)) else { return };
                    let (Some(xx), Some(yy), Some(xy)) =
                        (span_mut(xx, start), span_mut(yy, start), span_mut(xy, start))
                    else {
                        return;
                    };
                    let (x, y) = (shifted(gx), shifted(gy));
                    smooth_products(x, x, xx);
                    smooth_products(y, y, yy);
                    smooth_products(x, y, xy);
                    // The last span ends with the row and may overlap the one before.
                    done = start + SPAN;
                    start = done.min(n - SPAN);
                }
            }

            #[inline]
            fn span(row: &[i16], start: usize) -> Option<&[i16; SPAN + 4]> {
                row.get(start..)?.first_chunk()
            }

            #[inline]
            fn span_mut(row: &mut [i32], start: usize) -> Option<&mut [i32; SPAN]> {
                row.get_mut(start..)?.first_chunk_mut()
            }

            /// The span from columns 0, 1, 2, 3 and 4 on.
            #[inline]
            #[target_feature(enable = $features)]
            fn shifted(row: &[i16; SPAN + 4]) -> [$vector; 5] {
                [0, 1, 2, 3, 4].map(|shift| {
                    // SAFETY: `SPAN` elements from `shift <= 4` on lie within the array; the load needs no alignment.
                    unsafe { $load(row.as_ptr().add(shift).cast()) }
                })
            }

            #[inline]
            #[target_feature(enable = $features)]
            fn smooth_products(a: [$vector; 5], b: [$vector; 5], out: &mut [i32; SPAN]) {
                let [a0, a1, a2, a3, a4] = a;
                let [b0, b1, b2, b3, b4] = b;
                // `s[k]`: in lane i the products of columns 2 i + k and 2 i + k + 1, added; at most 2 * 1,020².
                let s = [$madd(a0, b0), $madd(a1, b1), $madd(a2, b2), $madd(a3, b3), $madd(a4, b4)];
                let smoothed = |s0, s1, s2, s3| {
                    let inner = $add(s1, s2);
                    $shift::<4>($add($add(s0, s3), $add($add(inner, inner), inner)))
                };
                let even = smoothed(s[0], s[1], s[2], s[3]);
                let odd = smoothed(s[1], s[2], s[3], s[4]);
                let [left, right] = $interleave(even, odd);
                let out = out.as_mut_ptr();
                // SAFETY: half of the array and the other half; the stores need no alignment.
                unsafe {
                    $store(out.cast(), left);
                    $store(out.add(SPAN / 2).cast(), right);
                }
            }

            /// [`kernel::marks_at_most`].
            #[target_feature(enable = $features)]
            pub(in super::super) fn marks_at_most(values: &[u8], limit: u8, marks: &mut [u64]) {
                let (chunks, rest) = values.as_chunks::<64>();
                let (whole, last) = marks.split_at_mut(chunks.len().min(marks.len()));
                for (marks, chunk) in whole.iter_mut().zip(chunks) {
                    *marks = $marks(chunk, limit);
                }
                if let Some(last) = last.first_mut()
                    && !rest.is_empty()
                {
                    let mut padded = [0; 64];
                    padded[..rest.len()].copy_from_slice(rest);
                    *last = $marks(&padded, limit) & ((1 << rest.len()) - 1);
                }
            }
        }
    };
}

use std::arch::x86_64::{
    __m256i, __m512i, _mm256_add_epi32, _mm256_cmpeq_epi8, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_min_epu8,
    _mm256_movemask_epi8, _mm256_permute2x128_si256, _mm256_set1_epi8, _mm256_srai_epi32, _mm256_storeu_si256,
    _mm256_unpackhi_epi32, _mm256_unpacklo_epi32, _mm512_add_epi32, _mm512_cmple_epu8_mask, _mm512_loadu_si512,
    _mm512_madd_epi16, _mm512_permutex2var_epi32, _mm512_set1_epi8, _mm512_setr_epi32, _mm512_srai_epi32,
    _mm512_storeu_si512,
};

by_hand!(
    avx2,
    "avx2",
    32,
    __m256i,
    _mm256_loadu_si256,
    _mm256_storeu_si256,
    _mm256_madd_epi16,
    _mm256_add_epi32,
    _mm256_srai_epi32,
    interleave_avx2,
    marks_avx2
);
by_hand!(
    avx512,
    "avx512f,avx512bw",
    64,
    __m512i,
    _mm512_loadu_si512,
    _mm512_storeu_si512,
    _mm512_madd_epi16,
    _mm512_add_epi32,
    _mm512_srai_epi32,
    interleave_avx512,
    marks_avx512
);

#[inline]
#[target_feature(enable = "avx2")]
fn interleave_avx2(even: __m256i, odd: __m256i) -> [__m256i; 2] {
    let (low, high) = (_mm256_unpacklo_epi32(even, odd), _mm256_unpackhi_epi32(even, odd));
    [_mm256_permute2x128_si256::<0x20>(low, high), _mm256_permute2x128_si256::<0x31>(low, high)]
}

#[inline]
#[target_feature(enable = "avx512f")]
fn interleave_avx512(even: __m512i, odd: __m512i) -> [__m512i; 2] {
    let left = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    let right = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    [_mm512_permutex2var_epi32(even, left, odd), _mm512_permutex2var_epi32(even, right, odd)]
}

#[inline]
#[target_feature(enable = "avx2")]
fn marks_avx2(values: &[u8; 64], limit: u8) -> u64 {
    let limit = _mm256_set1_epi8(limit.cast_signed());
    let half = |start: usize| {
        // SAFETY: 32 bytes from 0 or 32 on lie within the array; the load needs no alignment.
        let values = unsafe { _mm256_loadu_si256(values.as_ptr().add(start).cast()) };
        let at_most = _mm256_cmpeq_epi8(_mm256_min_epu8(values, limit), values);
        u64::from(_mm256_movemask_epi8(at_most).cast_unsigned())
    };
    half(0) | half(32) << 32
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn marks_avx512(values: &[u8; 64], limit: u8) -> u64 {
    // SAFETY: the array has 64 bytes; the load needs no alignment.
    let values = unsafe { _mm512_loadu_si512(values.as_ptr().cast()) };
    _mm512_cmple_epu8_mask(values, _mm512_set1_epi8(limit.cast_signed()))
}
