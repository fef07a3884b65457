//! Gray images in memory, and their scaling: exact integers, the same bytes everywhere.

use daymark_core::image::{FrameError, GrayView};

/// A gray image that owns its pixels, rows packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    /// Row after row, 0 black to 255 white.
    pub pixels: Vec<u8>,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl GrayImage {
    /// The image as core reads it.
    ///
    /// # Errors
    /// [`FrameError`] if a side is 0 or too long.
    pub fn view(&self) -> Result<GrayView<'_>, FrameError> {
        GrayView::new(&self.pixels, self.width, self.height, self.width)
    }

    /// Scales so that the longer side is `side`: down by exact area averages, up between pixel centres.
    #[must_use]
    pub fn scaled_to(self, side: usize) -> Self {
        let longer = self.width.max(self.height);
        if longer == side {
            return self;
        }
        let scaled = |length: usize| ((length * side * 2 + longer) / (2 * longer)).max(1);
        let (width, height) = (scaled(self.width), scaled(self.height));
        if longer > side { area_average(&self, width, height) } else { interpolated(&self, width, height) }
    }
}

/// Colours of a picture scaled as [`GrayImage::scaled_to`] scales: three channels, one after the other.
#[must_use]
pub fn scaled_colours(rgb: &[u8], width: usize, height: usize, side: usize) -> Vec<u8> {
    if width.max(height) == side || rgb.is_empty() {
        return rgb.to_vec();
    }
    let channels = [0, 1, 2].map(|channel| {
        let pixels = rgb.iter().skip(channel).step_by(3).copied().collect();
        GrayImage { pixels, width, height }.scaled_to(side).pixels
    });
    let [red, green, blue] = &channels;
    red.iter().zip(green).zip(blue).flat_map(|((&r, &g), &b)| [r, g, b]).collect()
}

/// Bilinear enlargement; pixel areas align, the border repeats outwards. Positions in Q16, weights in Q8.
fn interpolated(image: &GrayImage, width: usize, height: usize) -> GrayImage {
    let place = |at: usize, from: usize, to: usize| {
        let q16 = ((((2 * at + 1) * from) << 16) / (2 * to)).saturating_sub(1 << 15);
        let first = (q16 >> 16).min(from - 1);
        (first, (first + 1).min(from - 1), (q16 >> 8 & 255) as u32)
    };
    let columns: Vec<_> = (0..width).map(|x| place(x, image.width, width)).collect();
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        let (upper, lower, fy) = place(y, image.height, height);
        let row = |y: usize| &image.pixels[y * image.width..(y + 1) * image.width];
        let (upper, lower) = (row(upper), row(lower));
        pixels.extend(columns.iter().map(|&(left, right, fx)| {
            let along = |row: &[u8]| u32::from(row[left]) * (256 - fx) + u32::from(row[right]) * fx;
            ((along(upper) * (256 - fy) + along(lower) * fy + 32_768) >> 16) as u8
        }));
    }
    GrayImage { pixels, width, height }
}

/// The weights of a box average along one axis: for each output the first input and the weights from there, of which
/// each sums up to the input's length. Lengths are integers, so that the average is exact.
fn box_weights(input: usize, output: usize) -> Vec<(usize, Vec<u32>)> {
    // In units of 1 / output px an input pixel is `output` long and an output pixel `input`.
    (0..output)
        .map(|i| {
            let (start, end) = (i * input, (i + 1) * input);
            let first = start / output;
            let last = end.div_ceil(output);
            let weight = |p: usize| ((p + 1) * output).min(end) - (p * output).max(start);
            (first, (first..last).map(|p| weight(p) as u32).collect())
        })
        .collect()
}

fn area_average(image: &GrayImage, width: usize, height: usize) -> GrayImage {
    let columns = box_weights(image.width, width);
    let rows = box_weights(image.height, height);
    let total = (image.width * image.height) as u64;
    let mut pixels = Vec::with_capacity(width * height);
    let mut sums = vec![0_u64; image.width];
    for (first, weights) in rows {
        sums.fill(0);
        for (row, weight) in image.pixels.chunks_exact(image.width).skip(first).zip(weights) {
            for (sum, &pixel) in sums.iter_mut().zip(row) {
                *sum += u64::from(pixel) * u64::from(weight);
            }
        }
        pixels.extend(columns.iter().map(|(first, weights)| {
            let sum: u64 = sums[*first..].iter().zip(weights).map(|(&sum, &weight)| sum * u64::from(weight)).sum();
            ((sum + total / 2) / total) as u8
        }));
    }
    GrayImage { pixels, width, height }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_average_is_exact() {
        let image = GrayImage { pixels: vec![0, 90, 30, 30, 60, 255], width: 3, height: 2 };
        // One output column covers 1.5 inputs: (0 + 45) / 1.5 = 30 in the upper row.
        assert_eq!(area_average(&image, 2, 2).pixels, [30, 50, 40, 190]);
        assert_eq!(area_average(&image, 1, 1).pixels, [78]);
        assert_eq!(image.clone().scaled_to(3), image);
    }

    #[test]
    fn enlargement_interpolates_between_pixel_centres() {
        let image = GrayImage { pixels: vec![0, 100], width: 2, height: 1 };
        let enlarged = image.scaled_to(4);
        assert_eq!((enlarged.width, enlarged.height), (4, 2));
        assert_eq!(enlarged.pixels, [0, 25, 75, 100, 0, 25, 75, 100]);
    }
}
