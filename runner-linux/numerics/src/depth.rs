//! A small renderer: a depth buffer for occlusion, and previews.

use daymark_core::camera::triangulate::Pinhole;

/// Which triangle is seen at each pixel, and how deep.
#[derive(Debug, Clone)]
pub struct DepthBuffer {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depth along the optical axis; infinite where nothing is.
    pub depths: Vec<f32>,
    /// Number of the triangle; `u32::MAX` where nothing is.
    pub triangles: Vec<u32>,
}

impl DepthBuffer {
    /// What `camera` sees, its picture made `scale` times as large. Triangles that reach behind the camera are left out.
    pub fn new(
        camera: &Pinhole,
        [width, height]: [usize; 2],
        scale: f64,
        positions: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Self {
        let mut buffer = Self {
            width,
            height,
            depths: vec![f32::INFINITY; width * height],
            triangles: vec![u32::MAX; width * height],
        };
        let image: Vec<Option<[f64; 3]>> = positions
            .iter()
            .map(|&position| {
                let [x, y] = camera.project(position)?;
                Some([(x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5, camera.depth(position)])
            })
            .collect();
        for (number, triangle) in (0_u32..).zip(triangles) {
            let [Some(a), Some(b), Some(c)] = triangle.map(|vertex| image.get(vertex as usize).copied().flatten())
            else {
                continue;
            };
            buffer.draw(number, [a, b, c]);
        }
        buffer
    }

    fn draw(&mut self, number: u32, [a, b, c]: [[f64; 3]; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if !(area.abs() > 1e-9) {
            return;
        }
        let range = |axis: usize, length: usize| {
            let low = a[axis].min(b[axis]).min(c[axis]).max(0.0);
            let high = a[axis].max(b[axis]).max(c[axis]).min(length as f64 - 1.0);
            if high < low { 0..0 } else { libm::ceil(low) as usize..libm::floor(high) as usize + 1 }
        };
        // Weights are linear in x and y, and so is the inverse of the depth.
        let weight = |p: [f64; 3], q: [f64; 3]| {
            let (dx, dy) = ((p[1] - q[1]) / area, (q[0] - p[0]) / area);
            (dx, dy, -(dx * p[0] + dy * p[1]))
        };
        let (u, v) = (weight(b, c), weight(c, a));
        let inverse = [a, b, c].map(|corner| 1.0 / corner[2]);
        let whole = range(0, self.width);
        // Where along a row a weight becomes positive or ends to be, by its slope.
        let inverse_slopes = [-1.0 / u.0, -1.0 / v.0, 1.0 / (u.0 + v.0)];
        for y in range(1, self.height) {
            let row = y as f64;
            let (u0, v0) = (u.1 * row + u.2, v.1 * row + v.2);
            let mut columns = whole.clone();
            for (offset, inverse) in [u0, v0, 1.0 - u0 - v0].into_iter().zip(inverse_slopes) {
                let edge = offset * inverse;
                // A column more on either side, and none for slopes that are near zero: rounding decides nothing here.
                if inverse > -1e9 && inverse < 0.0 && edge > 1.0 {
                    columns.start = columns.start.max(edge as usize - 1);
                } else if inverse > 0.0 && inverse < 1e9 {
                    columns.end = columns.end.min((edge + 2.0).max(0.0) as usize);
                }
            }
            if columns.start >= columns.end {
                continue;
            }
            let line = y * self.width;
            let (Some(depths), Some(numbers)) = (
                self.depths.get_mut(line + columns.start..line + columns.end),
                self.triangles.get_mut(line + columns.start..line + columns.end),
            ) else {
                continue;
            };
            for ((x, kept), triangle) in (columns.start as u32..).zip(depths).zip(numbers) {
                let x = f64::from(x);
                let (u, v) = (u.0 * x + u0, v.0 * x + v0);
                let w = 1.0 - u - v;
                if (u < 0.0) | (v < 0.0) | (w < 0.0) {
                    continue;
                }
                let depth = (1.0 / (u * inverse[0] + v * inverse[1] + w * inverse[2])) as f32;
                // The first of equals stays.
                if depth < *kept {
                    *kept = depth;
                    *triangle = number;
                }
            }
        }
    }

    /// The depth at a pixel of the buffer; infinite outside.
    pub fn depth_at(&self, x: f64, y: f64) -> f32 {
        let (x, y) = (libm::round(x), libm::round(y));
        if x < 0.0 || y < 0.0 || x >= self.width as f64 || y >= self.height as f64 {
            return f32::INFINITY;
        }
        self.depths[y as usize * self.width + x as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_of_two_triangles_is_seen() {
        let matrix = [[20.0, 0.0, 9.5], [0.0, 20.0, 9.5], [0.0, 0.0, 1.0]];
        let camera = Pinhole::new(matrix, [0.0; 3]).unwrap();
        let triangle = |depth: f64| [[-9.0, -9.0, depth], [9.0, -9.0, depth], [0.0, 18.0, depth]];
        let positions = [triangle(10.0), triangle(5.0)].concat();
        let buffer = DepthBuffer::new(&camera, [20, 20], 1.0, &positions, &[[0, 1, 2], [3, 4, 5]]);
        assert_eq!(buffer.triangles[10 * 20 + 10], 1);
        assert!((buffer.depth_at(10.0, 10.0) - 5.0).abs() < 1e-5);
        assert_eq!(buffer.depth_at(-1.0, 3.0), f32::INFINITY);
    }
}
