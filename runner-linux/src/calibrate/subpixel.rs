//! A crossing to a hundredth of a pixel.
//!
//! Every gradient near the crossing is perpendicular to the way from there, because it stands on an edge that goes through
//! it. The point that fulfils this best, by least squares, is the crossing (Förstner and Gülch, 1987; OpenCV's
//! `cornerSubPix`). Noise has no direction and cancels in a window that is centred on the answer, so it is found again from
//! each answer until it stands.

use crate::picture::GrayImage;

/// Rounds at most.
const ROUNDS: usize = 40;
/// It stands if it moves less, pixels.
const STANDS: f64 = 1e-4;

/// The crossing near `start`, by the pixels within `reach`; `None` if it is too near the border, if there is none, or if it
/// is farther away than half the window.
pub(super) fn crossing(gray: &GrayImage, start: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let mut at = start;
    for _ in 0..ROUNDS {
        let next = better(gray, at, reach)?;
        let moved = (next[0] - at[0]).abs() + (next[1] - at[1]).abs();
        at = next;
        if !((at[0] - start[0]).abs().max((at[1] - start[1]).abs()) < (0.5 * reach).max(1.5)) {
            return None;
        }
        if moved < STANDS {
            break;
        }
    }
    Some(at)
}

fn better(gray: &GrayImage, [x, y]: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let inside = |low: f64, high: f64, length: usize| low >= 1.0 && high <= length as f64 - 2.0;
    if !inside(x - reach, x + reach, gray.width) || !inside(y - reach, y + reach, gray.height) {
        return None;
    }
    let first = |centre: f64| libm::ceil(centre - reach) as usize;
    let last = |centre: f64| libm::floor(centre + reach) as usize;
    // Falls to zero at the border of the window without a step, so that a pixel that enters changes nothing.
    let weight = |offset: f64| {
        let rest = 1.0 - offset * offset / (reach * reach);
        rest * rest
    };
    let (mut xx, mut xy, mut yy, mut bx, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for v in first(y)..=last(y) {
        let row = |v: usize| gray.pixels.get(v * gray.width..(v + 1) * gray.width);
        let (above, here, below) = (row(v - 1)?, row(v)?, row(v + 1)?);
        let dy = v as f64 - y;
        for u in first(x)..=last(x) {
            let dx = u as f64 - x;
            let gx = f64::from(*here.get(u + 1)?) - f64::from(*here.get(u - 1)?);
            let gy = f64::from(*below.get(u)?) - f64::from(*above.get(u)?);
            let w = weight(dx) * weight(dy);
            let (wxx, wxy, wyy) = (w * gx * gx, w * gx * gy, w * gy * gy);
            xx += wxx;
            xy += wxy;
            yy += wyy;
            bx += wxx * dx + wxy * dy;
            by += wxy * dx + wyy * dy;
        }
    }
    let determinant = xx * yy - xy * xy;
    // One edge alone leaves a direction open.
    (determinant > 1e-3 * (xx + yy) * (xx + yy))
        .then(|| [x + (yy * bx - xy * by) / determinant, y + (xx * by - xy * bx) / determinant])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two edges that cross at `at`, each pixel the mean of 16 x 16 parts.
    fn picture(at: [f64; 2]) -> GrayImage {
        let side = 41;
        let bright = |x: f64, y: f64| {
            let (x, y) = (x - at[0], y - at[1]);
            (0.9 * x + 0.2 * y > 0.0) != (0.3 * x - y > 0.0)
        };
        let pixel = |u: usize, v: usize| {
            let part = |offset: usize| (offset as f64 + 0.5) / 16.0 - 0.5;
            let count = (0..256).filter(|k| bright(u as f64 + part(k % 16), v as f64 + part(k / 16))).count();
            (40 + count * 160 / 256) as u8
        };
        let pixels = (0..side * side).map(|k| pixel(k % side, k / side)).collect();
        GrayImage { pixels, width: side, height: side }
    }

    #[test]
    fn crossings_between_pixels_are_met() {
        for at in [[20.0, 20.0], [20.37, 19.81], [19.5, 20.25]] {
            // Edges this sharp are worse than any lens makes them; it shows in the smallest window.
            for (reach, most) in [(3.0, 0.06), (6.5, 0.02), (10.0, 0.01)] {
                let found = crossing(&picture(at), [20.0, 20.0], reach).expect("a crossing");
                let off = libm::hypot(found[0] - at[0], found[1] - at[1]);
                assert!(off < most, "{at:?} {reach}: {found:?}");
            }
        }
    }

    #[test]
    fn an_edge_or_the_border_is_none() {
        let pixels = (0..41 * 41).map(|k| if k % 41 < 20 { 20 } else { 220 }).collect();
        let edge = GrayImage { pixels, width: 41, height: 41 };
        assert_eq!(crossing(&edge, [20.0, 20.0], 5.0), None);
        assert_eq!(crossing(&picture([20.0, 20.0]), [3.0, 20.0], 5.0), None);
        assert_eq!(crossing(&picture([20.0, 20.0]), [16.0, 16.0], 3.0), None, "too far away");
    }
}
