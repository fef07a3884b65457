//! Views of a picture from elsewhere: warped, relit, blurred, with noise. Integer arithmetic and a fixed seed.

use crate::gray::GrayImage;

/// What a simulated view does to the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Linear part of the map `simulated_from_picture`, row by row; the centre stays.
    pub linear: [[f64; 2]; 2],
    /// Exponent of the tone curve.
    pub gamma: f64,
    /// Standard deviation of the blur, in pixels; 0 for none.
    pub blur: f64,
}

const fn change(linear: [[f64; 2]; 2], gamma: f64, blur: f64) -> Change {
    Change { linear, gamma, blur }
}

/// Seen from the side, from two corners, from afar, rolled and near, rolled the other way in bad light.
pub const CHANGES: [Change; 6] = [
    change([[0.72, 0.0], [0.0, 1.0]], 1.0, 0.0),
    change([[0.8, 0.0], [0.12, 0.95]], 0.6, 0.0),
    change([[0.8, 0.0], [-0.12, 0.95]], 1.4, 0.0),
    change([[0.62, 0.0], [0.0, 0.62]], 1.0, 0.0),
    // 1.25 times a rotation by 6 degrees.
    change([[1.243_152, -0.130_661], [0.130_661, 1.243_152]], 1.0, 0.0),
    // A rotation by -5 degrees.
    change([[0.996_195, 0.087_156], [-0.087_156, 0.996_195]], 0.5, 1.2),
];

/// Standard deviation of the noise in gray levels.
const NOISE: f64 = 2.5;

impl Change {
    /// Where a point of the picture (px) comes to lie.
    pub fn apply(&self, image: &GrayImage, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cx, cy] = [image.width as f64 / 2.0, image.height as f64 / 2.0];
        let [[a, b], [c, d]] = self.linear;
        [cx + a * (x - cx) + b * (y - cy), cy + c * (x - cx) + d * (y - cy)]
    }

    /// The square of the change of scale.
    pub fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.linear;
        a * d - b * c
    }

    /// The simulated view, of the same size; the border repeats outwards.
    pub fn render(&self, image: &GrayImage, seed: u64) -> GrayImage {
        let mut view = self.warp(image);
        if self.blur > 0.0 {
            blur(&mut view, self.blur);
        }
        let curve = tone_curve(self.gamma);
        let mut noise = Noise(seed);
        for pixel in &mut view.pixels {
            *pixel = (i32::from(curve[usize::from(*pixel)]) + noise.next()).clamp(0, 255) as u8;
        }
        view
    }

    /// Bilinear, positions in Q16, weights in Q8.
    fn warp(&self, image: &GrayImage) -> GrayImage {
        let area = self.area();
        let [[a, b], [c, d]] = self.linear;
        let q16 = |value: f64| (value * 65_536.0) as i64;
        let inverse = [[q16(d / area), q16(-b / area)], [q16(-c / area), q16(a / area)]];
        let (cx, cy) = ((image.width as i64) << 15, (image.height as i64) << 15);
        let (right, bottom) = (image.width as i64 - 1, image.height as i64 - 1);
        let row = |y: i64| {
            let start = y.clamp(0, bottom) as usize * image.width;
            &image.pixels[start..start + image.width]
        };
        let mut pixels = Vec::with_capacity(image.pixels.len());
        for y in 0..image.height as i64 {
            let dy = (y << 16) - cy;
            for x in 0..image.width as i64 {
                let dx = (x << 16) - cx;
                let u = cx + ((inverse[0][0] * dx + inverse[0][1] * dy) >> 16);
                let v = cy + ((inverse[1][0] * dx + inverse[1][1] * dy) >> 16);
                let (column, fx) = (u >> 16, (u >> 8 & 255) as u32);
                let (upper, fy) = (v >> 16, (v >> 8 & 255) as u32);
                let (left_x, right_x) = (column.clamp(0, right) as usize, (column + 1).clamp(0, right) as usize);
                let along = |row: &[u8]| u32::from(row[left_x]) * (256 - fx) + u32::from(row[right_x]) * fx;
                let sum = along(row(upper)) * (256 - fy) + along(row(upper + 1)) * fy;
                pixels.push(((sum + 32_768) >> 16) as u8);
            }
        }
        GrayImage { pixels, width: image.width, height: image.height }
    }
}

/// `255 (g / 255)^gamma`, rounded down.
fn tone_curve(gamma: f64) -> [u8; 256] {
    let mut curve = [0; 256];
    for (gray, out) in curve.iter_mut().enumerate() {
        *out = (255.0 * libm::pow(gray as f64 / 255.0, gamma)) as u8;
    }
    curve
}

/// Separable Gaussian with integer weights that sum up to 65,536.
fn blur(image: &mut GrayImage, sigma: f64) {
    let reach = libm::ceil(3.0 * sigma) as i64;
    let real: Vec<f64> = (-reach..=reach).map(|i| libm::exp(-(i * i) as f64 / (2.0 * sigma * sigma))).collect();
    let total: f64 = real.iter().sum();
    let mut weights: Vec<u32> = real.iter().map(|w| (w / total * 65_536.0) as u32).collect();
    let rest = 65_536 - weights.iter().sum::<u32>();
    weights[reach as usize] += rest;
    for along_x in [true, false] {
        let source = image.clone();
        let (right, bottom) = (source.width as i64 - 1, source.height as i64 - 1);
        for y in 0..source.height {
            for x in 0..source.width {
                let mut sum = 32_768;
                for (offset, &weight) in (-reach..).zip(&weights) {
                    let (px, py) = if along_x { (x as i64 + offset, y as i64) } else { (x as i64, y as i64 + offset) };
                    let at = py.clamp(0, bottom) as usize * source.width + px.clamp(0, right) as usize;
                    sum += u32::from(source.pixels[at]) * weight;
                }
                image.pixels[y * source.width + x] = (sum >> 16) as u8;
            }
        }
    }
}

/// Nearly normal noise: the sum of the eight bytes of a `SplitMix64` number (Steele et al. 2014), scaled.
struct Noise(u64);

impl Noise {
    /// The next value, in gray levels.
    fn next(&mut self) -> i32 {
        /// The sum has mean 8 * 127.5 and standard deviation sqrt(8 * (256^2 - 1) / 12) = 209.02.
        const SCALE: i32 = (NOISE / 209.02 * 65_536.0) as i32;
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        let sum: i32 = z.to_le_bytes().iter().map(|&byte| i32::from(byte)).sum();
        ((sum - 1_020) * SCALE + 32_768) >> 16
    }
}
