//! Values between the pixels of a picture.

use daymark_engine::gray::GrayImage;

/// The mean of the gray levels half a pixel to the left and right, above and below, 0 to 255; between pixels linearly,
/// beyond the border the border's. 0 in an empty picture and for a point that is none.
pub fn mean_gray_at(gray: &GrayImage, at: [f64; 2]) -> f32 {
    let width = gray.width;
    if at[0] >= 0.5
        && at[1] >= 0.5
        && let Some(Spot { left, upper, fx, fy, .. }) = Spot::of(gray, [at[0] - 0.5, at[1] - 0.5])
        && left + 2 < width
        && let Some(rest) = gray.pixels.get(upper + left..)
        && let (Some(a), Some(b), Some(c)) = (row_of(rest), row_of(skip(rest, width)), row_of(skip(rest, 2 * width)))
    {
        // The four squares between pixels overlap: nine pixels with the products of three weights.
        let along = |[p, q, r]: [u8; 3]| (1.0 - fx) * f32::from(p) + f32::from(q) + fx * f32::from(r);
        return 0.25 * ((1.0 - fy) * along(a) + along(b) + fy * along(c));
    }
    let offsets = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
    0.25 * offsets.iter().map(|[dx, dy]| gray_at(gray, [at[0] + dx, at[1] + dy])).sum::<f32>()
}

fn gray_at(gray: &GrayImage, at: [f64; 2]) -> f32 {
    let pixel = |number: usize| [gray.pixels.get(number).map_or(0.0, |&pixel| f32::from(pixel))];
    Spot::of(gray, at).map_or(0.0, |spot| spot.between(pixel)[0])
}

/// Red, green and blue at a point of the picture, 0 to 255, between pixels linearly; `rgb` has the colours of the same pixels,
/// rows packed, or nothing for a gray picture.
pub fn colour_at(gray: &GrayImage, rgb: &[u8], at: [f64; 2]) -> [f32; 3] {
    if rgb.is_empty() {
        return [gray_at(gray, at); 3];
    }
    let Some(spot) = Spot::of(gray, at) else { return [0.0; 3] };
    // Four lanes are one vector; the fourth is the next pixel's.
    let pixel = |number: usize| {
        let rest = skip(rgb, 3 * number);
        match rest.first_chunk::<4>() {
            Some(four) => four.map(f32::from),
            None => row_of(rest).map_or([0.0; 4], |[r, g, b]| [r, g, b, 0].map(f32::from)),
        }
    };
    let [r, g, b, _] = spot.between(pixel);
    [r, g, b]
}

fn skip(values: &[u8], count: usize) -> &[u8] {
    values.get(count..).unwrap_or_default()
}

fn row_of(values: &[u8]) -> Option<[u8; 3]> {
    values.first_chunk::<3>().copied()
}

/// The four pixels around a point of a picture, and where between them it lies.
struct Spot {
    left: usize,
    right: usize,
    /// Numbers of the first pixels of the rows.
    upper: usize,
    lower: usize,
    fx: f32,
    fy: f32,
}

impl Spot {
    /// The value between those of the four pixels.
    #[inline]
    fn between<const N: usize>(&self, pixel: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        let mix = |a: [f32; N], b: [f32; N], share: f32| {
            let mut mixed = a;
            for (mixed, b) in mixed.iter_mut().zip(b) {
                *mixed += (b - *mixed) * share;
            }
            mixed
        };
        let upper = mix(pixel(self.upper + self.left), pixel(self.upper + self.right), self.fx);
        let lower = mix(pixel(self.lower + self.left), pixel(self.lower + self.right), self.fx);
        mix(upper, lower, self.fy)
    }

    /// `None` in an empty picture, or for a point that is none.
    #[inline]
    fn of(gray: &GrayImage, [x, y]: [f64; 2]) -> Option<Self> {
        let (width, height) = (gray.width, gray.height);
        if width == 0 || height == 0 || !x.is_finite() || !y.is_finite() {
            return None;
        }
        // Pictures are shorter than 2^31 pixels; 32 bits are converted faster.
        let place = |at: f64, length: usize| {
            let last = length as i32 - 1;
            let most = f64::from(last);
            let at = if at > 0.0 { if at < most { at } else { most } } else { 0.0 };
            let first = (at as i32).min((last - 1).max(0));
            (first as usize, (first + 1).min(last) as usize, (at - f64::from(first)) as f32)
        };
        let ((left, right, fx), (upper, lower, fy)) = (place(x, width), place(y, height));
        Some(Self { left, right, upper: upper * width, lower: lower * width, fx, fy })
    }
}
