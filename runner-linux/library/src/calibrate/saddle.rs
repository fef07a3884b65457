//! Where black and white squares cross: saddles of the brightness with four sectors around.
//!
//! The determinant of the Hessian is negative at a saddle and most negative where a chessboard crosses. A ring around it must
//! change between dark and bright exactly four times, and opposite changes must lie on one line: edges, letters and leaves
//! have saddles too, and none of them has that.

use core::f64::consts::{PI, TAU};

use super::plane::Plane;

use crate::order;

/// Where two edges cross.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Saddle {
    /// Pixels of the plane.
    pub(super) at: [f64; 2],
    /// Directions of the two edges, in 0..pi from +x towards +y: over the first it gets brighter as the angle grows, over
    /// the second darker.
    pub(super) edges: [f64; 2],
    /// How strong it is.
    pub(super) response: f32,
}

/// Samples of the ring.
const RING: usize = 32;
/// Radii of the ring in pixels, tried in this order.
const RADII: [f64; 2] = [4.0, 2.5];
/// Difference of bright and dark on the ring, at least.
const CONTRAST: f32 = 10.0;
/// Saddles of less than this share of the strongest are left alone.
const SHARE: f32 = 0.01;
/// Saddles that are looked at, the strongest first.
const MOST: usize = 6_000;
/// Opposite edges lie on one line within this angle.
const STRAIGHT: f64 = 0.45;
/// The two edges are this far from being one, at least.
const OPEN: f64 = 0.3;

/// The difference of two directions of lines, at most a right angle.
pub(super) fn between(a: f64, b: f64) -> f64 {
    let apart = (a - b).abs() % PI;
    apart.min(PI - apart)
}

/// All saddles of a plane, the strongest first.
pub(super) fn saddles(plane: &Plane) -> Vec<Saddle> {
    let plane = plane.smoothed();
    let (width, height) = (plane.width, plane.height);
    if width < 16 || height < 16 {
        return Vec::new();
    }
    let mut responses = vec![0.0_f32; width * height];
    for y in 1..height - 1 {
        let (above, here, below) = (plane.row(y - 1), plane.row(y), plane.row(y + 1));
        for x in 1..width - 1 {
            let xx = here[x - 1] - 2.0 * here[x] + here[x + 1];
            let yy = above[x] - 2.0 * here[x] + below[x];
            let xy = 0.25 * ((above[x - 1] + below[x + 1]) - (above[x + 1] + below[x - 1]));
            responses[y * width + x] = (xy * xy - xx * yy).max(0.0);
        }
    }
    let strongest = responses.iter().copied().fold(0.0_f32, f32::max);
    let mut peaks = Vec::new();
    for y in 3..height - 3 {
        for x in 3..width - 3 {
            let response = responses[y * width + x];
            if response > SHARE * strongest && response > 0.5 && is_peak(&responses, width, x, y) {
                peaks.push((response, y, x));
            }
        }
    }
    // The strongest first, then in the order of rows.
    order::sort_by(&mut peaks, |a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    peaks.truncate(MOST);
    peaks.into_iter().filter_map(|(response, y, x)| crossing(&plane, response, [x as f64, y as f64])).collect()
}

/// Whether no pixel within two is larger; of equal ones the first in the order of rows.
fn is_peak(responses: &[f32], width: usize, x: usize, y: usize) -> bool {
    let own = responses[y * width + x];
    (y - 2..=y + 2).all(|v| {
        (x - 2..=x + 2).all(|u| {
            let other = responses[v * width + u];
            other < own || (other == own && (v, u) >= (y, x))
        })
    })
}

fn crossing(plane: &Plane, response: f32, at: [f64; 2]) -> Option<Saddle> {
    RADII.iter().find_map(|&radius| Some(Saddle { at, edges: edges(plane, at, radius)?, response }))
}

/// The edges that a ring crosses, if there are four that make two lines.
fn edges(plane: &Plane, [x, y]: [f64; 2], radius: f64) -> Option<[f64; 2]> {
    let reach = radius + 1.0;
    if x < reach || y < reach || x + reach >= plane.width as f64 || y + reach >= plane.height as f64 {
        return None;
    }
    let mut ring = [0.0_f32; RING];
    for (number, value) in ring.iter_mut().enumerate() {
        let angle = TAU * number as f64 / RING as f64;
        *value = plane.at(x + radius * libm::cos(angle), y + radius * libm::sin(angle));
    }
    let bright = ring.iter().copied().fold(f32::MIN, f32::max);
    let dark = ring.iter().copied().fold(f32::MAX, f32::min);
    if bright - dark < CONTRAST {
        return None;
    }
    let middle = f32::midpoint(bright, dark);
    let mut changes = [(0.0_f64, false); 4];
    let mut count = 0;
    for (number, &value) in ring.iter().enumerate() {
        let next = ring[(number + 1) % RING];
        if (value < middle) != (next < middle) {
            let part = f64::from((middle - value) / (next - value));
            *changes.get_mut(count)? = (TAU * (number as f64 + part) / RING as f64, next > value);
            count += 1;
        }
    }
    if count < 4 {
        return None;
    }
    let line = |one: f64, other: f64| {
        // The mean direction of an angle and its opposite.
        let off = other - one - PI;
        let off = if off > PI { off - TAU } else { off };
        (off.abs() < STRAIGHT).then(|| (one + off / 2.0 + TAU) % PI)
    };
    let (first, second) = (line(changes[0].0, changes[2].0)?, line(changes[1].0, changes[3].0)?);
    if between(first, second) < OPEN {
        return None;
    }
    // Dark and bright alternate, so opposite changes are alike.
    Some(if changes[0].1 { [first, second] } else { [second, first] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::GrayImage;

    fn plane(gray: impl Fn(f64, f64) -> bool) -> Plane {
        let side = 41;
        let pixels = (0..side * side)
            .map(|at| if gray((at % side) as f64 - 20.3, (at / side) as f64 - 19.8) { 200 } else { 40 })
            .collect();
        Plane::reduced(&GrayImage { pixels, width: side, height: side }, 1)
    }

    #[test]
    fn a_crossing_is_found_with_its_edges() {
        // Bright where the angle is between 20 and 100 degrees, and opposite.
        let cross = |degrees: f64, x: f64, y: f64| {
            let (sine, cosine) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
            y * cosine - x * sine > 0.0
        };
        let found = saddles(&plane(|x, y| cross(20.0, x, y) != cross(100.0, x, y)));
        assert_eq!(found.len(), 1, "{found:?}");
        let Saddle { at, edges: [brighter, darker], .. } = found[0];
        assert!((at[0] - 20.3).abs() < 1.0 && (at[1] - 19.8).abs() < 1.0, "{at:?}");
        assert!((brighter.to_degrees() - 20.0).abs() < 5.0 && (darker.to_degrees() - 100.0).abs() < 5.0);
    }

    #[test]
    fn edges_corners_and_stripes_are_no_crossings() {
        for (what, found) in [
            ("edge", saddles(&plane(|x, y| x + 0.3 * y > 0.0))),
            ("corner", saddles(&plane(|x, y| x > 0.0 && y > 0.0))),
            ("stripe", saddles(&plane(|x, _| x.abs() < 3.0))),
            ("dot", saddles(&plane(|x, y| x * x + y * y < 9.0))),
        ] {
            assert!(found.is_empty(), "{what}: {found:?}");
        }
    }
}
