//! The only caller of `libm`: real functions beyond `+ - * /`, with the same bits on every target.
//!
//! `core` itself has no such functions and `std`'s differ between systems, so a result may use these and nothing else.

/// Square root, correctly rounded. NaN-free for `x >= 0`; negative input gives 0, so that no NaN enters a result.
#[inline]
pub fn sqrt(x: f32) -> f32 {
    if x > 0.0 { libm::sqrtf(x) } else { 0.0 }
}

/// [`sqrt`] in `f64`.
#[inline]
pub fn sqrt_f64(x: f64) -> f64 {
    if x > 0.0 { libm::sqrt(x) } else { 0.0 }
}

/// `2^x`, within 1 ulp.
#[inline]
pub fn exp2(x: f64) -> f64 {
    libm::exp2(x)
}

/// `log2(x)`, within 1 ulp; the least finite number for `x <= 0`, so that no NaN or infinity enters a result.
#[inline]
pub fn log2(x: f64) -> f64 {
    if x > 0.0 { libm::log2(x) } else { f64::MIN }
}

/// `floor(x)`, exact.
#[inline]
pub fn floor(x: f64) -> f64 {
    libm::floor(x)
}

/// `(sin x, cos x)` of radians, within 1 ulp each; 0 and 1 for what is not finite, so that no NaN enters a result.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if x.is_finite() { (libm::sin(x), libm::cos(x)) } else { (0.0, 1.0) }
}

/// `atan2(y, x)` in radians, within 1 ulp; 0 for two zeros.
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    if y == 0.0 && x == 0.0 { 0.0 } else { libm::atan2(y, x) }
}

/// `log2(n)` in 1/256 bit, rounded down; 0 for `n = 0`.
///
/// Integer arithmetic only: the mantissa is squared eight times, each overflow beyond 2 giving one bit
/// (Clay S. Turner, "A Fast Binary Logarithm Algorithm", IEEE Signal Processing Magazine, 2010). Exact to the unit.
pub const fn log2_q8(n: u32) -> i32 {
    if n == 0 {
        return 0;
    }
    let whole = n.ilog2();
    // Mantissa in [1, 2) with 31 fractional bits.
    let mut mantissa = (n as u64) << (31 - whole);
    let mut result = whole as i32;
    let mut step = 0;
    while step < 8 {
        mantissa = (mantissa * mantissa) >> 31;
        result <<= 1;
        if mantissa >= 1 << 32 {
            result |= 1;
            mantissa >>= 1;
        }
        step += 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log2_is_exact_at_powers_and_rounds_down_between() {
        for bit in 0..32 {
            assert_eq!(log2_q8(1 << bit), bit << 8);
        }
        for n in 1..=5_000_u32 {
            let exact = libm::log2(f64::from(n)) * 256.0;
            let found = f64::from(log2_q8(n));
            assert!(found <= exact + 1e-9 && exact - found < 1.001, "n = {n}: {found} against {exact}");
        }
        assert_eq!(log2_q8(0), 0);
    }

    #[test]
    fn no_nan_from_a_negative_root() {
        assert_eq!(sqrt(-1.0), 0.0);
        assert_eq!(sqrt(2.25), 1.5);
    }
}
