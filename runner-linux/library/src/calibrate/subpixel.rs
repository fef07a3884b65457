//! A crossing to a hundredth of a pixel.
//!
//! Every gradient near the crossing is perpendicular to the way from there, because it stands on an edge that goes through
//! it. The point that fulfils this best, by least squares, is the crossing (Förstner and Gülch, 1987; OpenCV's
//! `cornerSubPix`). Noise has no direction and cancels in a window that is centred on the answer, so it is found again from
//! each answer until it stands.

use super::plane::Plane;
use crate::picture::GrayImage;

/// Rounds at most.
const ROUNDS: usize = 100;
/// It stands if it moves less, pixels.
const STANDS: f64 = 1e-5;

/// How often pixels are smoothed by a Gaussian of 1 px before gradients are taken, for windows of at least this reach: noise of
/// single pixels is the largest part of a gradient in dim and blurred pictures, and a larger window has room for wider edges.
const SMOOTHING: [(f64, usize); 4] = [(9.0, 4), (7.0, 3), (5.0, 2), (3.5, 1)];

/// The crossing near `start`, by the pixels within `reach`; `None` if it is too near the border, if there is none, or if it
/// is farther away than half the window.
pub(super) fn crossing(gray: &GrayImage, start: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let farthest = (0.5 * reach).max(1.5);
    let rounds = SMOOTHING.iter().find(|(least, _)| reach >= *least).map_or(0, |(_, rounds)| *rounds);
    let room = reach + farthest + 2.0 * rounds as f64 + 2.0;
    let first = start.map(|at| libm::floor(at - room).max(0.0));
    let side = libm::ceil(2.0 * room) as usize + 2;
    let mut part = Plane::part(gray, first.map(|at| at as usize), side, side);
    if part.width < 3 || part.height < 3 {
        return None;
    }
    for _ in 0..rounds {
        part = part.smoothed();
    }
    let start = [start[0] - first[0], start[1] - first[1]];
    let mut at = start;
    let mut before: Option<[f64; 2]> = None;
    for _ in 0..ROUNDS {
        let next = better(&part, at, reach)?;
        let step = [next[0] - at[0], next[1] - at[1]];
        at = next;
        // Steps shrink evenly, the slower the more the middle of the window is blurred: after two of them their sum is known.
        let ratio = before.map_or(0.0, |b| (b[0] * step[0] + b[1] * step[1]) / (b[0] * b[0] + b[1] * b[1]));
        let rest = if (0.1..0.995).contains(&ratio) { ratio / (1.0 - ratio) } else { 0.0 };
        let jump = step.map(|s| (s * rest).clamp(-0.5, 0.5));
        at = [at[0] + jump[0], at[1] + jump[1]];
        before = (rest == 0.0).then_some(step);
        if !((at[0] - start[0]).abs().max((at[1] - start[1]).abs()) < farthest) {
            return None;
        }
        if step[0].abs() + step[1].abs() < STANDS {
            break;
        }
    }
    Some([at[0] + first[0], at[1] + first[1]])
}

fn better(part: &Plane, [x, y]: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let inside = |low: f64, high: f64, length: usize| low >= 1.0 && high <= length as f64 - 2.0;
    if !inside(x - reach, x + reach, part.width) || !inside(y - reach, y + reach, part.height) {
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
        let (above, here, below) = (part.row(v - 1), part.row(v), part.row(v + 1));
        let dy = v as f64 - y;
        for u in first(x)..=last(x) {
            let dx = u as f64 - x;
            let gx = f64::from(here[u + 1]) - f64::from(here[u - 1]);
            let gy = f64::from(below[u]) - f64::from(above[u]);
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
            // Edges without any blur are sharper than a lens makes them: what sampling adds shows in small windows.
            for (reach, most) in [(3.0, 0.08), (6.5, 0.03), (10.0, 0.015)] {
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
