//! Pictures of a chessboard through a known lens: distortion, blur, uneven light, noise, clutter around.

use daymark::calibrate::board::Board;
use daymark::calibrate::pattern::is_light;
use daymark::camera_file::lens::{Lens, Pose};
use daymark::picture::GrayImage;
use daymark_fixtures::distort::Distortion as Noise;
use nalgebra::{Rotation3, Vector3};

/// Parts of a pixel's side.
const PARTS: usize = 4;

/// What makes a picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot {
    /// Where the board is, in the camera's view.
    pub(crate) pose: Pose,
    /// Whether towers stand in its white squares.
    pub(crate) towers: bool,
    /// Gray levels of noise.
    pub(crate) noise: f64,
    /// Rounds of a small blur (0.7 px each).
    pub(crate) blur: usize,
    /// For the noise.
    pub(crate) seed: u64,
}

/// The middle of the board at `place` (mm, in the view), turned about the axes of the view by these angles.
pub(crate) fn stand(board: &Board, [x, y, roll]: [f64; 3], place: [f64; 3]) -> Pose {
    let turn = (Rotation3::from_euler_angles(x, y, 0.0) * Rotation3::from_euler_angles(0.0, 0.0, roll)).into_inner();
    let [u, v] = board.middle();
    Pose::from_translation(turn, Vector3::from(place) - turn * Vector3::new(u, v, 0.0))
}

/// A lens as a camera.
pub(crate) struct Studio {
    lens: Lens,
    board: Board,
    /// The direction at each corner of each pixel.
    rays: Vec<[f64; 2]>,
}

impl Studio {
    pub(crate) fn new(lens: Lens, board: Board) -> Self {
        let mut rays = Vec::new();
        for y in 0..=lens.height {
            for x in 0..=lens.width {
                let at = [f64::from(x) - 0.5, f64::from(y) - 0.5];
                let ray = lens.distortion.undo(lens.normalized_from_ideal(at)).expect("a lens that does not fold");
                rays.push(ray);
            }
        }
        Self { lens, board, rays }
    }

    pub(crate) fn picture(&self, shot: &Shot) -> GrayImage {
        let (width, height) = (self.lens.width as usize, self.lens.height as usize);
        let back = shot.pose.view_from_model.transpose();
        let from = shot.pose.position;
        let mut light = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let corner = |dx: usize, dy: usize| self.rays[(y + dy) * (width + 1) + x + dx];
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
                let mut sum = 0.0;
                for part in 0..PARTS * PARTS {
                    let [u, v] = [part % PARTS, part / PARTS].map(|p| (p as f64 + 0.5) / PARTS as f64);
                    let mix = |k: usize| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v;
                    let ray = back * Vector3::new(mix(0), mix(1), 1.0);
                    let far = -from.z / ray.z;
                    sum += if far > 0.0 {
                        self.seen(from.x + far * ray.x, from.y + far * ray.y, shot.towers)
                    } else {
                        90.0
                    };
                }
                // Darker to the right and below.
                let lit = 1.0 - 0.3 * x as f64 / width as f64 - 0.15 * y as f64 / height as f64;
                light.push(sum * lit / (PARTS * PARTS) as f64);
            }
        }
        for _ in 0..shot.blur {
            light = blurred(&light, width, height);
        }
        let mut noise = Noise::new(shot.seed);
        let pixels = light.iter().map(|l| (l + shot.noise * noise.normal()).round().clamp(0.0, 255.0) as u8).collect();
        GrayImage { pixels, width, height }
    }

    /// The board on its sheet, the sheet on a wall of dark and bright stones.
    fn seen(&self, x: f64, y: f64, towers: bool) -> f64 {
        let (x, y) = (x / self.board.square_mm, y / self.board.square_mm);
        let inside = |at: f64, corners: u8| at > -1.6 && at < f64::from(corners) + 0.6;
        if inside(x, self.board.columns) && inside(y, self.board.rows) {
            return if is_light(&self.board, [x, y], towers) { 225.0 } else { 30.0 };
        }
        let row = (y * 1.3).floor();
        let column = (x * 0.7 + 0.5 * row).floor();
        60.0 + 25.0 * ((row * 12.9898 + column * 78.233).sin() * 43_758.545_3).rem_euclid(1.0) * 5.0
    }
}

fn blurred(light: &[f64], width: usize, height: usize) -> Vec<f64> {
    let weigh = |a: f64, b: f64, c: f64| 0.25 * a + 0.5 * b + 0.25 * c;
    let at = |x: usize, y: usize| light[y.min(height - 1) * width + x.min(width - 1)];
    let along: Vec<f64> = (0..width * height)
        .map(|k| (k % width, k / width))
        .map(|(x, y)| weigh(at(x.saturating_sub(1), y), at(x, y), at(x + 1, y)))
        .collect();
    let at = |x: usize, y: usize| along[y.min(height - 1) * width + x];
    (0..width * height)
        .map(|k| (k % width, k / width))
        .map(|(x, y)| weigh(at(x, y.saturating_sub(1)), at(x, y), at(x, y + 1)))
        .collect()
}
