//! A gray picture in real numbers, to be smoothed and sampled between pixels.

use crate::picture::GrayImage;

/// Pixels in rows; the border repeats outwards.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pixels: Vec<f32>,
}

impl Plane {
    /// Means of `k` x `k` pixels; what is left over at the right and at the bottom is dropped.
    pub(super) fn reduced(gray: &GrayImage, k: usize) -> Self {
        let (width, height) = (gray.width / k, gray.height / k);
        let scale = 1.0 / (k * k) as f32;
        let mut pixels = Vec::with_capacity(width * height);
        let mut sums = vec![0_u32; width];
        for rows in gray.pixels.chunks_exact(gray.width * k).take(height) {
            sums.fill(0);
            for row in rows.chunks_exact(gray.width) {
                for (sum, part) in sums.iter_mut().zip(row.chunks_exact(k)) {
                    *sum += part.iter().map(|&pixel| u32::from(pixel)).sum::<u32>();
                }
            }
            pixels.extend(sums.iter().map(|&sum| sum as f32 * scale));
        }
        Self { width, height, pixels }
    }

    /// The pixels from `left`, `top` on, as many as there are of `width` x `height`.
    pub(super) fn part(gray: &GrayImage, [left, top]: [usize; 2], width: usize, height: usize) -> Self {
        let width = width.min(gray.width.saturating_sub(left));
        let rows = gray.pixels.chunks_exact(gray.width).skip(top).take(height);
        let height = rows.len();
        let pixels = rows.flat_map(|row| row.iter().skip(left).take(width).map(|&pixel| f32::from(pixel))).collect();
        Self { width, height, pixels }
    }

    /// Smoothed by (1 4 6 4 1) / 16 along both axes: a Gaussian of one pixel.
    pub(super) fn smoothed(&self) -> Self {
        let weigh = |a: f32, b: f32, c: f32, d: f32, e: f32| ((a + e) + 4.0 * (b + d) + 6.0 * c) * (1.0 / 16.0);
        let mut along = Vec::with_capacity(self.pixels.len());
        for row in self.pixels.chunks_exact(self.width) {
            let at = |x: usize| row[x.clamp(2, self.width + 1) - 2];
            along.extend((2..self.width + 2).map(|x| weigh(at(x - 2), at(x - 1), at(x), at(x + 1), at(x + 2))));
        }
        let row = |y: usize| {
            let y = y.clamp(2, self.height + 1) - 2;
            &along[y * self.width..][..self.width]
        };
        let mut pixels = Vec::with_capacity(along.len());
        for y in 2..self.height + 2 {
            let (a, b, c, d, e) = (row(y - 2), row(y - 1), row(y), row(y + 1), row(y + 2));
            pixels.extend((0..self.width).map(|x| weigh(a[x], b[x], c[x], d[x], e[x])));
        }
        Self { pixels, ..*self }
    }

    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.pixels[y * self.width..][..self.width]
    }

    /// Between pixels: bilinear. Outside: the border.
    pub(super) fn at(&self, x: f64, y: f64) -> f32 {
        let x = x.clamp(0.0, (self.width - 1) as f64);
        let y = y.clamp(0.0, (self.height - 1) as f64);
        let (column, row) =
            ((x as usize).min(self.width.saturating_sub(2)), (y as usize).min(self.height.saturating_sub(2)));
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let pixel = |dx: usize, dy: usize| {
            self.pixels[(row + dy).min(self.height - 1) * self.width + (column + dx).min(self.width - 1)]
        };
        let upper = pixel(0, 0) * (1.0 - fx) + pixel(1, 0) * fx;
        let lower = pixel(0, 1) * (1.0 - fx) + pixel(1, 1) * fx;
        upper * (1.0 - fy) + lower * fy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_smoothing_and_sampling_keep_a_ramp() {
        let pixels = (0..32 * 24).map(|at| (4 * (at % 32) + 2 * (at / 32)) as u8).collect();
        let plane = Plane::reduced(&GrayImage { pixels, width: 32, height: 24 }, 2);
        assert_eq!((plane.width, plane.height), (16, 12));
        // A pixel of the half picture is two wide and lies between two.
        assert_eq!(plane.at(5.0, 3.0), 4.0 * 10.5 + 2.0 * 6.5);
        assert!((plane.smoothed().at(5.25, 3.5) - (4.0 * 11.0 + 2.0 * 7.5)).abs() < 1e-4);
        assert_eq!(plane.at(-3.0, -1.0), plane.at(0.0, 0.0));
    }
}
