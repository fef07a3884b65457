//! What of a model's file is compared: points with gray levels.

use std::collections::HashMap;

use crate::picture::PictureFile;

/// Points of a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points {
    /// Positions in the model frame: z up.
    pub positions: Vec<[f32; 3]>,
    /// Gray levels 0 to 1 of points with a colour; NaN for others.
    pub gray: Vec<f32>,
    /// Standard deviations; 0 where the file has none.
    pub deviations: Vec<f32>,
}

/// Rec. 601, as pictures are read: red, green and blue to gray in the same range.
pub(super) fn gray_of([r, g, b]: [f64; 3]) -> f64 {
    0.299 * r + 0.587 * g + 0.114 * b
}

impl Points {
    /// Points whose position is repeated are one: where it came first, with the mean of the gray levels that are known.
    ///
    /// Files that colour triangles hold a point once for each of them, and would count it as often.
    #[must_use]
    pub(super) fn joined(self) -> Self {
        let mut places = HashMap::with_capacity(self.positions.len());
        let mut sums: Vec<(f64, u32)> = Vec::new();
        let mut joined = Self::default();
        for ((position, gray), deviation) in self.positions.into_iter().zip(self.gray).zip(self.deviations) {
            let place = *places.entry(position.map(f32::to_bits)).or_insert_with(|| {
                joined.positions.push(position);
                joined.deviations.push(deviation);
                sums.push((0.0, 0));
                sums.len() - 1
            });
            if gray.is_finite() {
                sums[place] = (sums[place].0 + f64::from(gray), sums[place].1 + 1);
            }
        }
        let mean = |&(sum, count): &(f64, u32)| if count > 0 { (sum / f64::from(count)) as f32 } else { f32::NAN };
        joined.gray = sums.iter().map(mean).collect();
        joined
    }
}

/// A texture: gray levels of a picture, by texture coordinates.
#[derive(Debug)]
pub(super) struct Texture {
    picture: image::GrayImage,
}

impl Texture {
    /// From the bytes of a JPEG or PNG file.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, String> {
        let mut file = std::io::Cursor::new(bytes);
        let file: &mut dyn PictureFile = &mut file;
        let mut reader = image::ImageReader::new(file)
            .with_guessed_format()
            .map_err(|error| format!("a texture cannot be read: {error}"))?;
        let mut limits = image::Limits::default();
        limits.max_alloc = Some(MAX_TEXTURE_BYTES);
        reader.limits(limits);
        let picture = reader.decode().map_err(|error| format!("a texture cannot be read: {error}"))?;
        let picture = match picture {
            image::DynamicImage::ImageLuma8(gray) => gray,
            other => {
                let rgb = other.to_rgb8();
                let gray = |pixel: &[u8]| match pixel {
                    &[r, g, b] => (gray_of([r, g, b].map(f64::from)) + 0.5) as u8,
                    _ => 0,
                };
                let pixels = rgb.chunks_exact(3).map(gray).collect();
                image::GrayImage::from_vec(rgb.width(), rgb.height(), pixels).unwrap_or_default()
            }
        };
        Ok(Self { picture })
    }

    /// The gray level, 0 to 1, at texture coordinates that count right and down from the top-left corner.
    pub(super) fn gray_at(&self, [u, v]: [f32; 2]) -> f32 {
        let (width, height) = self.picture.dimensions();
        if width == 0 || height == 0 || !u.is_finite() || !v.is_finite() {
            return f32::NAN;
        }
        let place = |at: f32, length: u32| {
            let at = (f64::from(at) * f64::from(length) - 0.5).clamp(0.0, f64::from(length - 1));
            let first = (at as u32).min(length.saturating_sub(2));
            (first, (first + 1).min(length - 1), at - f64::from(first))
        };
        let ((left, right, fx), (upper, lower, fy)) = (place(u, width), place(v, height));
        let pixel = |x: u32, y: u32| self.picture.get_pixel_checked(x, y).map_or(0.0, |pixel| f64::from(pixel.0[0]));
        let along = |y: u32| pixel(left, y) * (1.0 - fx) + pixel(right, y) * fx;
        ((along(upper) * (1.0 - fy) + along(lower) * fy) / 255.0) as f32
    }
}

/// Memory that decoding a texture may take.
const MAX_TEXTURE_BYTES: u64 = 1 << 29;
