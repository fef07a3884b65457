//! The eight towers: pictures of which the depth of every pixel is known, so that every corner can be carried over.

use daymark_core::point::{ImagePoint, SUBPIXEL};
use daymark_fixtures::pick::camera_at;
use daymark_fixtures::random::SplitMix64;
use daymark_fixtures::{Lens, Scene, Sensor, Tower, Truth as Depths, render};

use super::pair::{Pair, Truth, Whereabouts, pixels};
use crate::command::CommandError;
use crate::correspond::automatic;
use crate::picture::GrayImage;

/// Degrees around the tower from the middle of its front at which the first picture is taken.
const FIRST_ANGLE: f64 = 10.0;
/// Noise of an automatic corner, px; what is added comes on top.
pub(super) const CORNER_NOISE_PX: f64 = 0.7;

/// How the second picture and the corners are disturbed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Disturbance {
    /// Degrees around the tower between the two pictures.
    pub angle: f64,
    /// Noise of each pixel of both pictures, grey levels, on top of a good camera's by day.
    pub gray_levels: i32,
    /// Noise added to each coordinate of each corner, px.
    pub noise_px: f64,
    /// Share of each picture's corners that is taken away.
    pub missing: f64,
}

/// A picture with its corners and depths.
pub(super) struct Seen {
    truth: Depths,
    corners: Vec<ImagePoint>,
}

/// Takes a picture of a tower; `which` is 0 for the first of a pair, 1 for the second: the noise of the sensor differs.
pub(super) fn see(tower: &Tower, angle: f64, gray_levels: i32, which: u64, count: usize) -> Result<Seen, CommandError> {
    let seed = u64::from(tower.number) * 10 + which;
    let daylight = Sensor::daylight(seed);
    let sensor = Sensor { noise: daylight.noise + gray_levels * 16, ..daylight };
    let scene = Scene::alone(tower.clone(), u64::from(tower.number));
    let frame = render(&scene, &camera_at(tower, FIRST_ANGLE + angle), &sensor);
    let image = GrayImage { pixels: frame.gray, width: Lens::VGA.width as usize, height: Lens::VGA.height as usize };
    let corners = automatic::corners(&image, count)?;
    Ok(Seen { truth: frame.truth, corners })
}

/// The pair that a seed makes of two pictures.
pub(super) fn pair(first: &Seen, second: &Seen, disturbance: Disturbance, seed: u64) -> Pair {
    let mut random = SplitMix64::new(seed);
    let mut kept = [&first.corners, &second.corners].map(|corners| {
        let mut corners = corners.clone();
        let missing = (corners.len() as f64 * disturbance.missing).round_ties_even() as usize;
        for _ in 0..missing {
            let at = random.range(0, corners.len() as i32) as usize;
            corners.remove(at);
        }
        corners
    });
    let undisturbed = kept.clone();
    for corner in kept.iter_mut().flatten() {
        let mut step = || (normal(&mut random) * disturbance.noise_px * f64::from(SUBPIXEL)).round_ties_even() as i32;
        *corner = ImagePoint::new(corner.x + step(), corner.y + step());
    }
    let [first_undisturbed, undisturbed] = undisturbed;
    let places = first_undisturbed.iter().map(|&corner| carry(&first.truth, &second.truth, pixels(corner)));
    let camera = &second.truth.camera;
    let noise = libm::sqrt(CORNER_NOISE_PX * CORNER_NOISE_PX + disturbance.noise_px * disturbance.noise_px);
    Pair {
        truth: Truth::Places(places.collect()),
        area: f64::from(camera.width) * f64::from(camera.height),
        corners: kept,
        undisturbed,
        first_undisturbed,
        noise_px: noise as f32,
    }
}

/// The nearest depth within a pixel: what is in front owns the edge.
fn depths_around(truth: &Depths, [x, y]: [f64; 2]) -> impl Iterator<Item = f64> + '_ {
    let (width, height) = (i64::from(truth.camera.width), i64::from(truth.camera.height));
    let (column, row) = (x.round_ties_even() as i64, y.round_ties_even() as i64);
    let around = (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| (column + dx, row + dy)));
    let within = around.filter(move |(x, y)| (0..width).contains(x) && (0..height).contains(y));
    within.filter_map(move |(x, y)| truth.depths.get((y * width + x) as usize).copied().map(f64::from))
}

/// Where a corner of the first picture is in the second.
fn carry(first: &Depths, second: &Depths, at: [f64; 2]) -> Whereabouts {
    let depth = depths_around(first, at).fold(f64::INFINITY, f64::min);
    if !depth.is_finite() {
        return Whereabouts::Hidden;
    }
    let world = first.camera.position + first.camera.ray(at[0], at[1]) * depth;
    let Some(image) = second.camera.project(world).filter(|image| second.camera.holds(*image)) else {
        return Whereabouts::Hidden;
    };
    // Two percent of the distance: a wall seen at a slant changes by as much within a pixel.
    let seen = depths_around(second, [image.x, image.y]).any(|depth| (depth - image.depth).abs() < 0.02 * image.depth);
    if seen { Whereabouts::At([image.x, image.y]) } else { Whereabouts::Hidden }
}

/// Normally distributed enough: the sum of twelve even ones.
fn normal(random: &mut SplitMix64) -> f64 {
    (0..12).map(|_| f64::from(random.range(0, 1 << 20)) / f64::from(1 << 20)).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The renderer's own corners must be carried to where the renderer sees them.
    #[test]
    fn true_corners_are_carried_to_their_true_places() {
        let tower = &Tower::eight()[1];
        let [first, second] = [0.0, 10.0].map(|angle| see(tower, angle, 0, 0, 50).unwrap());
        let mut carried = 0;
        for corner in first.truth.visible(0) {
            let Some(there) = second.truth.visible(0).find(|other| other.number == corner.number) else { continue };
            if let Whereabouts::At([x, y]) = carry(&first.truth, &second.truth, [corner.image.x, corner.image.y]) {
                let (dx, dy) = (x - there.image.x, y - there.image.y);
                carried += usize::from(dx * dx + dy * dy < 1.0);
            }
        }
        let both = first.truth.visible(0).filter(|a| second.truth.visible(0).any(|b| a.number == b.number)).count();
        assert!(carried * 10 >= both * 9 && both > 60, "{carried} of {both}");
    }

    #[test]
    fn noise_has_the_deviation_that_it_should() {
        let mut random = SplitMix64::new(5);
        let values: Vec<f64> = (0..10_000).map(|_| normal(&mut random)).collect();
        let square = values.iter().map(|value| value * value).sum::<f64>() / 1e4;
        let mean = values.iter().sum::<f64>() / 1e4;
        assert!((square - 1.0).abs() < 0.05 && mean.abs() < 0.03, "{square} {mean}");
    }
}
