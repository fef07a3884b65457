//! Maps between image frames, in pixels: affine and projective, and their weighted least-squares fits.
//!
//! `f32` with `+ - * /` in a fixed order; the 8 x 8 system of the homography is solved in `f64`.

use crate::linear::NormalEquations;
use crate::math::sqrt;

/// `y = L x + t`, an affine map of pixels to pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// `L`, row by row.
    pub linear: [[f32; 2]; 2],
    /// `t`, in pixels of the target frame.
    pub translation: [f32; 2],
}

impl Affine {
    /// Scales by `scale` and takes the point `from` to the point `to`.
    pub fn upright(scale: f32, from: [f32; 2], to: [f32; 2]) -> Self {
        Self { linear: [[scale, 0.0], [0.0, scale]], translation: [to[0] - scale * from[0], to[1] - scale * from[1]] }
    }

    /// The image of a point.
    #[inline]
    pub fn apply(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let [[a, b], [c, d]] = self.linear;
        [a * x + b * y + self.translation[0], c * x + d * y + self.translation[1]]
    }
}

/// `y ~ H (x, 1)`, a projective map of pixels to pixels with `H[2][2] = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(pub [[f32; 3]; 3]);

impl From<Affine> for Homography {
    fn from(map: Affine) -> Self {
        let [[a, b], [c, d]] = map.linear;
        let [x, y] = map.translation;
        Self([[a, b, x], [c, d, y], [0.0, 0.0, 1.0]])
    }
}

impl Homography {
    /// The image of a point. On and behind the vanishing line (`w <= 1e-6`) the division is by 1e-6: the image lies
    /// far outside any frame.
    #[inline]
    pub fn apply(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        let w = g * x + h * y + i;
        let w = if w > 1e-6 { w } else { 1e-6 };
        [(a * x + b * y + c) / w, (d * x + e * y + f) / w]
    }

    /// The derivative of the map at a point, row by row, and the point's denominator `w`.
    pub fn jacobian(&self, [x, y]: [f32; 2]) -> ([[f32; 2]; 2], f32) {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        let w = g * x + h * y + i;
        if !(w > 1e-6) {
            return ([[0.0; 2]; 2], w.max(0.0));
        }
        let (u, v) = ((a * x + b * y + c) / w, (d * x + e * y + f) / w);
        ([[(a - u * g) / w, (b - u * h) / w], [(d - v * g) / w, (e - v * h) / w]], w)
    }

    /// The shape of the map at a point of the source frame, if a camera could see an upright facade by it.
    ///
    /// `None` for mirror images and collapsed or exploded maps (determinant of the derivative outside 0.02..40), a
    /// ratio of its singular values above 3.5, the vertical turned by more than 0.45 rad, and points behind or close to
    /// the vanishing line (`w < 0.2`).
    pub fn shape(&self, at: [f32; 2]) -> Option<Shape> {
        /// Largest ratio of singular values.
        const STRETCH: f32 = 3.5;
        /// tan(0.45 rad).
        const LEAN: f32 = 0.483_055_1;
        let ([[a, b], [c, d]], w) = self.jacobian(at);
        let area = a * d - b * c;
        if !(w >= 0.2 && area > 0.02 && area < 40.0 && a > 0.0 && d > 0.0 && b.abs() <= LEAN * d) {
            return None;
        }
        // The singular values: their squares add up to the squared norm, their product is the area.
        let norm = a * a + b * b + c * c + d * d;
        let difference = sqrt(norm * norm - 4.0 * area * area);
        let ratio = sqrt((norm + difference) / (norm - difference));
        // NaN or infinite where the smaller one vanishes: then the ratio is beyond any limit.
        (ratio <= STRETCH).then(|| Shape { scale: sqrt(area), ratio, shear: [b / d, c / a] })
    }
}

/// The derivative of an upright map at a point, taken apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Square root of the area that a unit area maps to.
    pub scale: f32,
    /// Ratio of the larger to the smaller singular value, 1 or more: foreshortening.
    pub ratio: f32,
    /// How far the vertical leans to the side and the horizontal rises, as tangents.
    pub shear: [f32; 2],
}

/// A correspondence with its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPair {
    /// Point of the source frame, in pixels.
    pub from: [f32; 2],
    /// Point of the target frame, in pixels.
    pub to: [f32; 2],
    /// Weight, positive.
    pub weight: f32,
}

/// Weighted least squares for an affine map, with a ridge that pulls its linear part to `scale` times the identity.
///
/// `ridge` is in px², to be compared with the weighted second moments of the source points. `None` without weight or
/// if the points and the ridge leave the system singular.
pub fn fit_affine(pairs: &[WeightedPair], scale: f32, ridge: f32) -> Option<Affine> {
    let total = pairs.iter().fold(0.0, |sum, pair| sum + pair.weight);
    if !(total > 0.0) {
        return None;
    }
    let mean = |point: fn(&WeightedPair) -> [f32; 2]| {
        let sum = pairs.iter().fold([0.0; 2], |[x, y], pair| {
            let [px, py] = point(pair);
            [x + pair.weight * px, y + pair.weight * py]
        });
        [sum[0] / total, sum[1] / total]
    };
    let (from, to) = (mean(|pair| pair.from), mean(|pair| pair.to));
    // Second moments of the source (xx, xy, yy), and of target against source (b).
    let (mut xx, mut xy, mut yy) = (ridge, 0.0, ridge);
    let mut b = [[ridge * scale, 0.0], [0.0, ridge * scale]];
    for pair in pairs {
        let (x, y) = (pair.from[0] - from[0], pair.from[1] - from[1]);
        let (u, v) = (pair.to[0] - to[0], pair.to[1] - to[1]);
        let (wx, wy) = (pair.weight * x, pair.weight * y);
        xx += wx * x;
        xy += wx * y;
        yy += wy * y;
        b[0][0] += wx * u;
        b[0][1] += wy * u;
        b[1][0] += wx * v;
        b[1][1] += wy * v;
    }
    let determinant = xx * yy - xy * xy;
    if !(determinant > 0.0) {
        return None;
    }
    let row = |[p, q]: [f32; 2]| [(p * yy - q * xy) / determinant, (q * xx - p * xy) / determinant];
    let linear = [row(b[0]), row(b[1])];
    let translation = [0, 1].map(|i: usize| {
        let row = if i == 0 { linear[0] } else { linear[1] };
        (if i == 0 { to[0] } else { to[1] }) - row[0] * from[0] - row[1] * from[1]
    });
    Some(Affine { linear, translation })
}

/// Centre and half of the longer side of a frame: the coordinates in which a homography is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalization {
    centre: [f32; 2],
    half_side: f32,
}

impl Normalization {
    /// For a frame of this size in pixels.
    pub fn of_frame(width: u16, height: u16) -> Self {
        let (width, height) = (f32::from(width.max(1)), f32::from(height.max(1)));
        Self { centre: [width / 2.0, height / 2.0], half_side: if width > height { width / 2.0 } else { height / 2.0 } }
    }

    fn apply(self, point: [f32; 2]) -> [f64; 2] {
        let scaled = |p: f32, centre: f32| f64::from((p - centre) / self.half_side);
        [scaled(point[0], self.centre[0]), scaled(point[1], self.centre[1])]
    }
}

/// Weighted linear least squares for a homography with `h33 = 1` in normalized coordinates, with a ridge on the two
/// perspective terms.
///
/// Each pair gives two equations of the direct linear transform (Hartley and Zisserman, Multiple View Geometry, 4.1);
/// the normal equations are solved by Cholesky. `None` if they are singular or the map has no finite scale.
pub fn fit_homography(
    pairs: &[WeightedPair],
    source: Normalization,
    target: Normalization,
    ridge: f64,
) -> Option<Homography> {
    let mut equations = NormalEquations::<8>::new();
    for pair in pairs {
        let ([x, y], [u, v]) = (source.apply(pair.from), target.apply(pair.to));
        let weight = f64::from(pair.weight);
        equations.add(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, weight);
        equations.add(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, weight);
    }
    for perspective in 6..8 {
        equations.add_ridge(perspective, ridge);
    }
    let &[a, b, c, d, e, f, g, i] = equations.solve()?;
    // H = T_target^-1 h T_source
    let (s, t) = (f64::from(source.half_side), f64::from(target.half_side));
    let [sx, sy] = source.centre.map(f64::from);
    let [tx, ty] = target.centre.map(f64::from);
    let rows =
        [[t * a + tx * g, t * b + tx * i, t * c + tx], [t * d + ty * g, t * e + ty * i, t * f + ty], [g, i, 1.0]]
            .map(|[p, q, r]| [p / s, q / s, r - (p * sx + q * sy) / s]);
    let scale = rows[2][2];
    if !(scale > 1e-9) {
        return None;
    }
    Some(Homography(rows.map(|row| row.map(|value| (value / scale) as f32))))
}
