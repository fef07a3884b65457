//! Sums over correspondences about their centroids, and whether the points determine anything.

use super::Correspondence;

/// Second moments of points about their centroid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    pub(super) xx: f64,
    pub(super) xy: f64,
    pub(super) yy: f64,
    /// What rounding of the coordinates alone may add to a second moment.
    noise: f64,
}

impl Spread {
    fn new(largest: f64, count: f64) -> Self {
        let rounding = largest * ROUNDING;
        Self { xx: 0.0, xy: 0.0, yy: 0.0, noise: count * rounding * rounding }
    }

    fn add(&mut self, [x, y]: [f64; 2]) {
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    /// Sum of squared distances from the centroid.
    pub(super) fn total(&self) -> f64 {
        self.xx + self.yy
    }

    pub(super) fn determinant(&self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    /// More than one place.
    pub(super) fn has_extent(&self) -> bool {
        self.total() > self.noise
    }

    /// More than one line: across it the points reach further than rounding, and than 1e-7 of their reach along it.
    pub(super) fn spans_plane(&self) -> bool {
        let total = self.total();
        let least = total * THIN;
        // The smaller eigenvalue is the determinant by the larger one, which is at most the total.
        self.determinant() > total * if least > self.noise { least } else { self.noise }
    }
}

/// Rounding of a coordinate and of the centroid, as a share of the largest coordinate: 8 ulp.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Squared width by squared length of points that count as a line: rounding of the moments alone makes 1e-16.
const THIN: f64 = 1e-14;

/// Correspondences about their centroids.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    pub(super) from_centre: [f64; 2],
    pub(super) to_centre: [f64; 2],
    pub(super) from: Spread,
    pub(super) to: Spread,
    /// `Σ to fromᵀ`, row by row.
    pub(super) cross: [[f64; 2]; 2],
    pub(super) count: f64,
}

impl Moments {
    /// `None` without pairs, and where a coordinate or a sum is not finite.
    pub(super) fn of(pairs: &[Correspondence]) -> Option<Self> {
        let count = pairs.len() as f64;
        let mut sums = [0.0; 4];
        let (mut largest_from, mut largest_to) = (0.0_f64, 0.0_f64);
        for &Correspondence { from: [x, y], to: [u, v] } in pairs {
            sums = [sums[0] + x, sums[1] + y, sums[2] + u, sums[3] + v];
            largest_from = largest_from.max(x.abs()).max(y.abs());
            largest_to = largest_to.max(u.abs()).max(v.abs());
        }
        let [x, y, u, v] = sums.map(|sum| sum / count);
        let (from_centre, to_centre) = ([x, y], [u, v]);
        let (mut from, mut to) = (Spread::new(largest_from, count), Spread::new(largest_to, count));
        let mut cross = [[0.0; 2]; 2];
        for pair in pairs {
            let [x, y] = [pair.from[0] - x, pair.from[1] - y];
            let [u, v] = [pair.to[0] - u, pair.to[1] - v];
            from.add([x, y]);
            to.add([u, v]);
            let [[ux, uy], [vx, vy]] = cross;
            cross = [[ux + u * x, uy + u * y], [vx + v * x, vy + v * y]];
        }
        // NaN where a coordinate is not finite or there is no pair; infinite where a square is.
        let finite = (from.determinant() + to.determinant()).is_finite() && (from.total() + to.total()).is_finite();
        finite.then_some(Self { from_centre, to_centre, from, to, cross, count })
    }

    /// The translation that takes one centroid to the other.
    pub(super) fn translation(&self, [[a, b], [c, d]]: [[f64; 2]; 2]) -> [f64; 2] {
        let ([x, y], [u, v]) = (self.from_centre, self.to_centre);
        [u - (a * x + b * y), v - (c * x + d * y)]
    }
}
