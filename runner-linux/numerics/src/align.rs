//! A corner of one picture to a fraction of a pixel where another picture shows it: least-squares matching.
//!
//! Corners are found in each picture by itself, and each with an error of its own. What counts for a point in space is that
//! both mean the same place: the second picture's patch is laid over the first's by an affine map, a gain and a bias
//! (Lucas and Kanade, "An iterative image registration technique", 1981; Gruen, "Adaptive least squares correlation", 1985;
//! here in the inverse compositional form of Baker and Matthews, "Lucas-Kanade 20 years on", 2004: derivatives are the first
//! picture's, so that the equations are made once). With T the first patch, I the second picture, W the map and d an
//! offset from the corner,
//!
//! ```text
//! sum w(d) (I(W(d)) - a T(d) - b - grad T(d) . (A d + t))^2  ->  least;   W <- W o (d + (A d + t) / a)^-1
//! ```

use daymark_engine::gray::GrayImage;
use nalgebra::{Cholesky, Const, Matrix2, SMatrix, SVector, Vector2};

/// Pixels from the corner to the border of a patch.
const RADIUS: usize = 8;
/// Every second pixel of every second row is compared: the others would say nearly the same.
const STEP: usize = 2;
const SIDE: usize = 2 * RADIUS / STEP + 1;
/// With a pixel more on each side, for derivatives.
const FULL: usize = 2 * RADIUS + 3;
/// Steps, at most: more bring nothing that shows in the points.
const STEPS: usize = 3;
/// A step that moves less is the last, pixels.
const ENOUGH_PX: f64 = 0.05;
/// A corner that moves farther was another one, pixels.
const MAX_SHIFT_PX: f64 = 1.5;
/// The share of the second patch's variance that may stay unexplained.
const MAX_UNEXPLAINED: f64 = 0.3;

/// Gain, bias, shift, and how the shift changes with the offset.
type Unknowns = SVector<f64, 8>;

/// Aligns corners.
#[derive(Debug, Clone)]
pub struct Aligner {
    /// Weights along one axis: a Gaussian.
    weights: [f32; SIDE],
}

impl Default for Aligner {
    fn default() -> Self {
        let radius = RADIUS as f64;
        let weight = |place: usize| {
            let off = (place * STEP) as f64 - radius;
            libm::exp(-off * off / (0.5 * radius * radius)) as f32
        };
        Self { weights: std::array::from_fn(weight) }
    }
}

/// What is computed once for a corner of the first picture.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Of each sample: gray level from the mean, 1, derivatives along x and y, and both times the offset; all times the weight.
    columns: [[f32; 8]; SIDE * SIDE],
    weights: [f32; SIDE * SIDE],
    equations: Cholesky<f64, Const<8>>,
}

fn offset(place: usize) -> i64 {
    (place * STEP) as i64 - RADIUS as i64
}

impl Aligner {
    /// The patch around a point of a picture; `None` too near to the border, or where nothing is to be seen.
    pub fn patch(&self, picture: &GrayImage, at: [f64; 2]) -> Option<Patch> {
        let levels = levels(picture, at)?;
        let mean = levels.iter().flatten().sum::<f32>() / (FULL * FULL) as f32;
        let (mut columns, mut weights) = ([[0.0_f32; 8]; SIDE * SIDE], [0.0; SIDE * SIDE]);
        let mut products = [[0.0_f32; 8]; 8];
        for (number, (column, weight)) in columns.iter_mut().zip(&mut weights).enumerate() {
            let (row, along) = (number / SIDE, number % SIDE);
            let (x, y) = (1 + along * STEP, 1 + row * STEP);
            let (dx, dy) = (offset(along) as f32, offset(row) as f32);
            let gx = 0.5 * (levels[y][x + 1] - levels[y][x - 1]);
            let gy = 0.5 * (levels[y + 1][x] - levels[y - 1][x]);
            let plain = [levels[y][x] - mean, 1.0, gx, gy, gx * dx, gx * dy, gy * dx, gy * dy];
            *weight = self.weights[row] * self.weights[along];
            *column = plain.map(|entry| entry * *weight);
            for (line, left) in products.iter_mut().zip(plain) {
                for (sum, right) in line.iter_mut().zip(&*column) {
                    *sum += left * right;
                }
            }
        }
        let mut matrix =
            SMatrix::<f64, 8, 8>::from_fn(|row, column| f64::from(products[row.max(column)][row.min(column)]));
        for unknown in 0..8 {
            matrix[(unknown, unknown)] += 1e-6 * matrix[(unknown, unknown)] + 1e-6;
        }
        Some(Patch { columns, weights, equations: matrix.cholesky()? })
    }
}

impl Patch {
    /// Where another picture shows the patch's middle, from a place nearby; `None` if it does not show the patch there.
    pub fn found_in(&self, picture: &GrayImage, near: [f64; 2]) -> Option<[f64; 2]> {
        let near = Vector2::from(near);
        let (mut at, mut map) = (near, Matrix2::identity());
        for step in 0..STEPS {
            let mut sums = [0.0_f32; 8];
            let (mut squares, mut sum) = (0.0_f32, 0.0_f32);
            let samples = Samples::new(picture, at, &map)?;
            let mut numbers = self.columns.iter().zip(&self.weights);
            for row in 0..SIDE {
                for along in 0..SIDE {
                    let (column, weight) = numbers.next()?;
                    let level = samples.at(offset(along), offset(row));
                    for (sum, entry) in sums.iter_mut().zip(column) {
                        *sum += entry * level;
                    }
                    squares += weight * level * level;
                    sum += weight * level;
                }
            }
            let right = Unknowns::from(sums.map(f64::from));
            let found = self.equations.solve(&right);
            let gain = found[0];
            if !(gain > 0.2 && gain < 5.0) {
                return None;
            }
            let shift = Vector2::new(found[2], found[3]) / gain;
            let bend = Matrix2::new(found[4], found[5], found[6], found[7]) / gain;
            let inverse = (Matrix2::identity() + bend).try_inverse()?;
            // The inverse of d + bend d + shift is inverse (d - shift).
            let moved = map * inverse * shift;
            (at, map) = (at - moved, map * inverse);
            if !((at - near).norm() < MAX_SHIFT_PX) {
                return None;
            }
            if moved.norm() < ENOUGH_PX || step + 1 == STEPS {
                let whole =
                    f64::from(squares) - f64::from(sum) * f64::from(sum) / f64::from(self.weights.iter().sum::<f32>());
                let unexplained = f64::from(squares) - found.dot(&right);
                return (unexplained < MAX_UNEXPLAINED * whole).then_some(at.into());
            }
        }
        None
    }
}

/// A picture without its noise and finest detail, weights 1-2-1 along both axes: what is compared every second pixel only.
pub fn smoothed(picture: &GrayImage) -> GrayImage {
    let (width, height) = (picture.width, picture.height);
    let mut pixels = picture.pixels.clone();
    let mut sums = vec![0_u16; width];
    for y in 1..height.saturating_sub(1) {
        let Some([upper, middle, lower]) = rows(&picture.pixels, width, y) else { break };
        for (((sum, &a), &b), &c) in sums.iter_mut().zip(upper).zip(middle).zip(lower) {
            *sum = u16::from(a) + 2 * u16::from(b) + u16::from(c);
        }
        let Some(out) = pixels.get_mut(y * width + 1..(y + 1) * width - 1) else { break };
        let (left, right) = (sums.iter(), sums.iter().skip(2));
        for (((out, &a), &b), &c) in out.iter_mut().zip(left).zip(sums.iter().skip(1)).zip(right) {
            *out = ((a + 2 * b + c + 8) >> 4) as u8;
        }
    }
    GrayImage { pixels, width, height }
}

fn rows(pixels: &[u8], width: usize, y: usize) -> Option<[&[u8]; 3]> {
    let row = |y: usize| pixels.get(y * width..(y + 1) * width);
    Some([row(y - 1)?, row(y)?, row(y + 1)?])
}

/// Gray levels around a point, a pixel apart, between pixels linearly.
fn levels(picture: &GrayImage, [x, y]: [f64; 2]) -> Option<[[f32; FULL]; FULL]> {
    let reach = (RADIUS + 1) as f64;
    let (left, top) = (x - reach, y - reach);
    let most = |length: usize| length as f64 - (FULL + 1) as f64;
    if !(left >= 0.0 && top >= 0.0 && left <= most(picture.width) && top <= most(picture.height)) {
        return None;
    }
    let (column, row) = (left as usize, top as usize);
    let (fx, fy) = ((left - column as f64) as f32, (top - row as f64) as f32);
    let along = |row: usize| -> Option<[f32; FULL]> {
        let pixels = picture.pixels.get(row * picture.width + column..)?.first_chunk::<{ FULL + 1 }>()?;
        Some(std::array::from_fn(|i| f32::from(pixels[i]) * (1.0 - fx) + f32::from(pixels[i + 1]) * fx))
    };
    let mut levels = [[0.0; FULL]; FULL];
    let mut upper = along(row)?;
    for (number, levels) in levels.iter_mut().enumerate() {
        let lower = along(row + number + 1)?;
        *levels = std::array::from_fn(|i| upper[i] * (1.0 - fy) + lower[i] * fy);
        upper = lower;
    }
    Some(levels)
}

/// Gray levels of a picture by offsets through an affine map, in 1/65,536 px.
struct Samples<'p> {
    picture: &'p GrayImage,
    at: [i64; 2],
    map: [[i64; 2]; 2],
}

impl<'p> Samples<'p> {
    /// `None` if the patch reaches over the border.
    fn new(picture: &'p GrayImage, at: Vector2<f64>, map: &Matrix2<f64>) -> Option<Self> {
        let reach = |row: usize| RADIUS as f64 * (map[(row, 0)].abs() + map[(row, 1)].abs()) + 0.1;
        let within =
            |place: f64, reach: f64, length: usize| place - reach >= 0.0 && place + reach <= length as f64 - 1.1;
        let inside = within(at.x, reach(0), picture.width) && within(at.y, reach(1), picture.height);
        let fixed = |value: f64| (value * 65_536.0) as i64;
        let map = [0, 1].map(|row| [fixed(map[(row, 0)]), fixed(map[(row, 1)])]);
        inside.then(|| Self { picture, at: [fixed(at.x), fixed(at.y)], map })
    }

    #[inline(always)]
    fn at(&self, dx: i64, dy: i64) -> f32 {
        let [x, y] = [0, 1].map(|axis| self.at[axis] + self.map[axis][0] * dx + self.map[axis][1] * dy);
        let share = |place: i64| (place & 0xFFFF) as i32 as f32 * (1.0 / 65_536.0);
        let first = (y >> 16) as usize * self.picture.width + (x >> 16) as usize;
        let fx = share(x);
        let two = |first: usize| {
            let [a, b] = *self.picture.pixels.get(first..).and_then(<[u8]>::first_chunk).unwrap_or(&[0; 2]);
            let (a, b) = (i32::from(a), i32::from(b));
            a as f32 + (b - a) as f32 * fx
        };
        let (upper, lower) = (two(first), two(first + self.picture.width));
        upper + (lower - upper) * share(y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth pattern, drawn where an affine map puts it, with another brightness.
    fn picture(map: Matrix2<f64>, middle: [f64; 2], gain: f64, bias: f64) -> GrayImage {
        let back = map.try_inverse().unwrap();
        let pixels = (0..64 * 64)
            .map(|number| {
                let at = Vector2::new(f64::from(number % 64) - middle[0], f64::from(number / 64) - middle[1]);
                let [x, y]: [f64; 2] = (back * at).into();
                let level =
                    100.0 + 50.0 * libm::tanh(0.6 * x) * libm::tanh(0.5 * y) + 20.0 * libm::sin(0.35 * x + 0.2 * y);
                (gain * level + bias + 0.5) as u8
            })
            .collect();
        GrayImage { pixels, width: 64, height: 64 }
    }

    #[test]
    fn a_corner_is_found_to_a_fraction_of_a_pixel() {
        let first = picture(Matrix2::identity(), [31.3, 30.8], 1.0, 0.0);
        let turned = Matrix2::new(1.08, 0.06, -0.05, 0.93);
        let second = picture(turned, [33.62, 29.17], 1.2, -20.0);
        let patch = Aligner::default().patch(&first, [31.3, 30.8]).unwrap();
        for near in [[33.0, 29.0], [34.2, 29.9], [33.62, 28.4]] {
            let [x, y] = patch.found_in(&second, near).unwrap();
            assert!((x - 33.62).abs() < 0.05 && (y - 29.17).abs() < 0.05, "{x} {y}");
        }
    }

    #[test]
    fn what_is_not_there_is_not_found() {
        let first = picture(Matrix2::identity(), [31.3, 30.8], 1.0, 0.0);
        let aligner = Aligner::default();
        let patch = aligner.patch(&first, [31.3, 30.8]).unwrap();
        let mirrored = picture(Matrix2::new(-1.0, 0.0, 0.0, 1.0), [31.3, 30.8], 1.0, 0.0);
        assert_eq!(patch.found_in(&mirrored, [31.3, 30.8]), None);
        let flat = GrayImage { pixels: vec![90; 64 * 64], width: 64, height: 64 };
        assert_eq!(patch.found_in(&flat, [31.3, 30.8]), None);
        // Too far away, too near to the border, no number.
        assert_eq!(patch.found_in(&first, [34.3, 30.8]), None);
        assert_eq!(patch.found_in(&first, [5.0, 30.8]), None);
        assert_eq!(patch.found_in(&first, [f64::NAN, 30.8]), None);
        assert!(aligner.patch(&first, [8.0, 30.8]).is_none());
        assert!(aligner.patch(&first, [31.3, 54.0]).is_none());
        assert!(aligner.patch(&first, [f64::NAN; 2]).is_none());
    }
}
