//! Points of the model from their images in two or more views with known cameras, and how far they may be off.
//!
//! [`Pinhole`] is the camera `x ~ M (X - C)`: `M = K R` takes a direction of the model frame to the image (pixels, origin
//! at the centre of the top-left pixel, x right, y down), `C` is the pinhole in the model frame. Lens distortion must be
//! taken out of the images' points before. Lengths have the model's unit, metres if it is metric.
//!
//! `f64` with `+ - * /` and square roots, in the written order.

use crate::linear::NormalEquations;
use crate::math::sqrt_f64;

type Matrix3 = [[f64; 3]; 3];

/// A pinhole camera without distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    image_from_direction: Matrix3,
    direction_from_image: Matrix3,
    centre: [f64; 3],
}

impl Pinhole {
    /// From `M = K R`, row by row, and the pinhole `C`.
    ///
    /// `None` if `M` has no finite inverse. The third row is made a unit vector that points forward, so that depths are
    /// lengths; `det M < 0` (a matrix known up to its sign) is turned around.
    pub fn new(image_from_direction: Matrix3, centre: [f64; 3]) -> Option<Self> {
        let determinant = dot(cross(image_from_direction[0], image_from_direction[1]), image_from_direction[2]);
        let forward = image_from_direction[2];
        let length = sqrt_f64(dot(forward, forward));
        let scale = if determinant < 0.0 { -length } else { length };
        if !(length > 0.0) || !determinant.is_finite() || centre.iter().any(|c| !c.is_finite()) {
            return None;
        }
        let image_from_direction = image_from_direction.map(|row| row.map(|entry| entry / scale));
        Some(Self { image_from_direction, direction_from_image: inverse(&image_from_direction)?, centre })
    }

    /// From a 3 x 4 projection matrix `P = [M | -M C]`, known up to scale and sign. `None` if `M` is singular: an affine
    /// camera has no pinhole.
    pub fn from_matrix(image_from_model: &[[f64; 4]; 3]) -> Option<Self> {
        let matrix = image_from_model.map(|[a, b, c, _]| [a, b, c]);
        let last = image_from_model.map(|row| -row[3]);
        Self::new(matrix, apply(&inverse(&matrix)?, last))
    }

    /// The pinhole in the model frame.
    pub const fn centre(&self) -> [f64; 3] {
        self.centre
    }

    /// `M`, with a third row of length one.
    pub const fn image_from_direction(&self) -> &Matrix3 {
        &self.image_from_direction
    }

    /// How far a point lies in front of the pinhole along the optical axis; negative behind it.
    pub fn depth(&self, point: [f64; 3]) -> f64 {
        dot(self.image_from_direction[2], minus(point, self.centre))
    }

    /// The image of a point, in pixels; `None` unless it lies in front.
    pub fn project(&self, point: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, depth] = apply(&self.image_from_direction, minus(point, self.centre));
        (depth > 0.0).then(|| [x / depth, y / depth])
    }

    /// The direction in the model frame of what is seen at an image point, with a depth of one.
    pub fn direction(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        apply(&self.direction_from_image, [x, y, 1.0])
    }
}

/// A point as one camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting<'a> {
    /// The camera.
    pub camera: &'a Pinhole,
    /// Where it sees the point, in pixels.
    pub at: [f64; 2],
}

/// A point of the model with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangulated {
    /// The point, in the model frame.
    pub position: [f64; 3],
    /// Covariance of the position for independent errors of the asked deviation in every image coordinate.
    pub covariance: [[f64; 3]; 3],
    /// Root mean square distance between the point's images and its sightings, in pixels.
    pub reprojection_px: f64,
    /// Sine of the largest angle between two of its rays; 1 for angles beyond 90 degrees.
    pub parallax_sine: f64,
}

impl Triangulated {
    /// Standard deviation in the direction that is known worst, at most: the root of the covariance's trace.
    pub fn deviation(&self) -> f64 {
        sqrt_f64(self.covariance[0][0] + self.covariance[1][1] + self.covariance[2][2])
    }
}

/// Why there is no point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoPoint {
    /// Fewer than two sightings.
    TooFewViews,
    /// The rays are parallel as far as numbers tell.
    Parallel,
    /// The rays meet behind a camera.
    Behind,
}

impl core::fmt::Display for NoPoint {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooFewViews => "fewer than two views see the point",
            Self::Parallel => "its rays are parallel",
            Self::Behind => "its rays meet behind a camera",
        })
    }
}

/// Gauss-Newton steps, at most; two or three are enough where the point is well determined.
const STEPS: usize = 12;

/// The point with the least sum of squared reprojection errors, and its covariance `deviation_px^2 (J^T J)^-1`.
///
/// It starts at the point nearest to all rays (least squares over `|(I - d d^T)(X - C)|^2`) and takes Gauss-Newton steps
/// while they lower the error (Hartley and Zisserman, Multiple View Geometry, 12.3 and 5.2).
///
/// # Errors
/// [`NoPoint`]. A small parallax is no error here: see [`Triangulated::parallax_sine`] and the covariance.
pub fn triangulate(sightings: &[Sighting<'_>], deviation_px: f64) -> Result<Triangulated, NoPoint> {
    if sightings.len() < 2 {
        return Err(NoPoint::TooFewViews);
    }
    let mut position = nearest_to_rays(sightings).ok_or(NoPoint::Parallel)?;
    let mut error = squared_error(sightings, position).ok_or(NoPoint::Behind)?;
    for _ in 0..STEPS {
        let mut equations = NormalEquations::<3>::new();
        for sighting in sightings {
            let (residual, rows) = linearized(sighting, position).ok_or(NoPoint::Behind)?;
            equations.add(&rows[0], residual[0], 1.0);
            equations.add(&rows[1], residual[1], 1.0);
        }
        let Some(&step) = equations.solve() else { break };
        let next = plus(position, step);
        match squared_error(sightings, next) {
            Some(lower) if lower < error => {
                let gain = error - lower;
                (position, error) = (next, lower);
                if gain <= 1e-12 * error {
                    break;
                }
            }
            _ => break,
        }
    }
    let mut information = [[0.0; 3]; 3];
    for sighting in sightings {
        let (_, rows) = linearized(sighting, position).ok_or(NoPoint::Behind)?;
        for row in rows {
            for (sums, a) in information.iter_mut().zip(row) {
                for (sum, b) in sums.iter_mut().zip(row) {
                    *sum += a * b;
                }
            }
        }
    }
    let variance = deviation_px * deviation_px;
    let covariance = inverse(&information).ok_or(NoPoint::Parallel)?.map(|row| row.map(|entry| entry * variance));
    Ok(Triangulated {
        position,
        covariance,
        reprojection_px: sqrt_f64(error / sightings.len() as f64),
        parallax_sine: parallax_sine(sightings, position),
    })
}

/// The residual (seen minus predicted, pixels) and the derivative of the prediction by the point.
fn linearized(sighting: &Sighting<'_>, point: [f64; 3]) -> Option<([f64; 2], [[f64; 3]; 2])> {
    let m = &sighting.camera.image_from_direction;
    let [x, y, depth] = apply(m, minus(point, sighting.camera.centre));
    if !(depth > 0.0) {
        return None;
    }
    let (u, v) = (x / depth, y / depth);
    let row = |along: [f64; 3], image: f64| {
        [
            (along[0] - image * m[2][0]) / depth,
            (along[1] - image * m[2][1]) / depth,
            (along[2] - image * m[2][2]) / depth,
        ]
    };
    Some(([sighting.at[0] - u, sighting.at[1] - v], [row(m[0], u), row(m[1], v)]))
}

fn squared_error(sightings: &[Sighting<'_>], point: [f64; 3]) -> Option<f64> {
    let mut sum = 0.0;
    for sighting in sightings {
        let [u, v] = sighting.camera.project(point)?;
        let (dx, dy) = (u - sighting.at[0], v - sighting.at[1]);
        sum += dx * dx + dy * dy;
    }
    sum.is_finite().then_some(sum)
}

fn nearest_to_rays(sightings: &[Sighting<'_>]) -> Option<[f64; 3]> {
    // Relative to the first pinhole: coordinates far from the origin lose nothing.
    let origin = sightings.first()?.camera.centre;
    let mut matrix = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for sighting in sightings {
        let direction = sighting.camera.direction(sighting.at);
        let squared = dot(direction, direction);
        let offset = minus(sighting.camera.centre, origin);
        let along = dot(direction, offset) / squared;
        for (axis, (row, value)) in matrix.iter_mut().zip(&mut right).enumerate() {
            let d = component(direction, axis);
            for (other, entry) in row.iter_mut().enumerate() {
                *entry += f64::from(u8::from(axis == other)) - d * component(direction, other) / squared;
            }
            *value += component(offset, axis) - d * along;
        }
    }
    // Two rays at an angle a leave a determinant of about 2 sin^2 a: 1e-12 is a twentieth of a second of arc.
    let determinant = dot(cross(matrix[0], matrix[1]), matrix[2]);
    if !(determinant > 1e-12) {
        return None;
    }
    Some(plus(apply(&inverse(&matrix)?, right), origin))
}

fn parallax_sine(sightings: &[Sighting<'_>], point: [f64; 3]) -> f64 {
    let mut largest = 0.0;
    for (index, one) in sightings.iter().enumerate() {
        let a = minus(point, one.camera.centre);
        for other in sightings.iter().skip(index + 1) {
            let b = minus(point, other.camera.centre);
            let across = cross(a, b);
            let sine = if dot(a, b) < 0.0 { 1.0 } else { sqrt_f64(dot(across, across) / (dot(a, a) * dot(b, b))) };
            if sine > largest {
                largest = sine;
            }
        }
    }
    largest
}

/// Two cameras, prepared for many points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoPair {
    first: Pinhole,
    second: Pinhole,
    base: [f64; 3],
}

impl StereoPair {
    /// The pair; its points come out in the cameras' common model frame.
    pub fn new(first: &Pinhole, second: &Pinhole) -> Self {
        Self { first: *first, second: *second, base: minus(second.centre, first.centre) }
    }

    /// The middle of the shortest connection of the two rays.
    ///
    /// Not finite for parallel rays; a point behind the cameras is given as it is. Not the least reprojection error:
    /// for that, and for covariances, use [`triangulate`]. About 80 operations and one division.
    #[inline(always)]
    pub fn point(&self, first: [f64; 2], second: [f64; 2]) -> [f64; 3] {
        let (d, e) = (self.first.direction(first), self.second.direction(second));
        let (dd, de, ee) = (dot(d, d), dot(d, e), dot(e, e));
        let (db, eb) = (dot(d, self.base), dot(e, self.base));
        let half = 0.5 / (dd * ee - de * de);
        let (s, t) = ((ee * db - de * eb) * half, (de * db - dd * eb) * half);
        let middle = |c: f64, b: f64, d: f64, e: f64| c + 0.5 * b + (s * d + t * e);
        let (c, b) = (self.first.centre, self.base);
        [middle(c[0], b[0], d[0], e[0]), middle(c[1], b[1], d[1], e[1]), middle(c[2], b[2], d[2], e[2])]
    }

    /// [`point`](Self::point) for each of as many points as the shortest of the three slices has.
    pub fn points(&self, first: &[[f64; 2]], second: &[[f64; 2]], model: &mut [[f64; 3]]) {
        for ((point, &first), &second) in model.iter_mut().zip(first).zip(second) {
            *point = self.point(first, second);
        }
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn apply(matrix: &Matrix3, vector: [f64; 3]) -> [f64; 3] {
    [dot(matrix[0], vector), dot(matrix[1], vector), dot(matrix[2], vector)]
}

fn component(vector: [f64; 3], axis: usize) -> f64 {
    vector.get(axis).copied().unwrap_or(0.0)
}

/// By the adjugate; `None` if the determinant is zero or anything is not finite.
fn inverse(matrix: &Matrix3) -> Option<Matrix3> {
    let [a, b, c] = *matrix;
    let (x, y, z) = (cross(b, c), cross(c, a), cross(a, b));
    let determinant = dot(a, x);
    if !(determinant.abs() > 0.0) {
        return None;
    }
    let rows =
        [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]].map(|row| row.map(|entry| entry / determinant));
    rows.iter().flatten().all(|entry| entry.is_finite()).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks along +y from (x, -30, 2), turned towards the z axis by the slope `turn`.
    fn camera(x: f64, turn: f64) -> Pinhole {
        let unit = 1.0 / sqrt_f64(1.0 + turn * turn);
        let (right, forward) = ([unit, -turn * unit, 0.0], [turn * unit, unit, 0.0]);
        let row = |axis: [f64; 3], focal: f64, centre: f64| {
            [
                focal * axis[0] + centre * forward[0],
                focal * axis[1] + centre * forward[1],
                focal * axis[2] + centre * forward[2],
            ]
        };
        let matrix = [row(right, 560.0, 319.5), row([0.0, 0.0, -1.0], 560.0, 239.5), forward];
        Pinhole::new(matrix, [x, -30.0, 2.0]).unwrap()
    }

    const POINT: [f64; 3] = [1.5, -2.0, 7.0];

    #[test]
    fn exact_images_give_the_point_back() {
        let cameras = [camera(-8.0, 0.25), camera(9.0, -0.3), camera(1.0, 0.0)];
        let sightings = cameras.each_ref().map(|camera| Sighting { camera, at: camera.project(POINT).unwrap() });
        for views in [&sightings[..2], &sightings[..]] {
            let found = triangulate(views, 1.0).unwrap();
            for (found, true_) in found.position.iter().zip(POINT) {
                assert!((found - true_).abs() < 1e-9, "{found} {true_}");
            }
            assert!(found.reprojection_px < 1e-9);
        }
        let pair = StereoPair::new(&cameras[0], &cameras[1]);
        let point = pair.point(sightings[0].at, sightings[1].at);
        assert!(point.iter().zip(POINT).all(|(a, b)| (a - b).abs() < 1e-9), "{point:?}");
    }

    #[test]
    fn the_covariance_is_that_of_many_noisy_points() {
        let cameras = [camera(-8.0, 0.25), camera(9.0, -0.3)];
        let exact = cameras.each_ref().map(|camera| camera.project(POINT).unwrap());
        let mut state = 9_u64;
        let mut noise = || {
            // The sum of twelve uniform numbers has a variance of one.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + f64::from((state >> 32) as u32) / 4_294_967_296.0
            })
        };
        let mut spread = [[0.0; 3]; 3];
        let mut said = [[0.0; 3]; 3];
        let rounds = 4_000;
        for _ in 0..rounds {
            let sightings = [0, 1].map(|i: usize| Sighting {
                camera: &cameras[i],
                at: [exact[i][0] + 0.5 * noise(), exact[i][1] + 0.5 * noise()],
            });
            let found = triangulate(&sightings, 0.5).unwrap();
            let off = minus(found.position, POINT);
            for i in 0..3 {
                for j in 0..3 {
                    spread[i][j] += off[i] * off[j] / f64::from(rounds);
                    said[i][j] += found.covariance[i][j] / f64::from(rounds);
                }
            }
        }
        for axis in 0..3 {
            let ratio = spread[axis][axis] / said[axis][axis];
            assert!((0.9..1.1).contains(&ratio), "axis {axis}: {spread:?} against {said:?}");
        }
    }

    #[test]
    fn the_least_reprojection_error_is_found() {
        let cameras = [camera(-8.0, 0.25), camera(9.0, -0.3), camera(1.0, 0.0)];
        let mut sightings = cameras.each_ref().map(|camera| Sighting { camera, at: camera.project(POINT).unwrap() });
        sightings[1].at[0] += 3.0;
        sightings[2].at[1] -= 2.0;
        let found = triangulate(&sightings, 1.0).unwrap();
        let least = squared_error(&sightings, found.position).unwrap();
        for axis in 0..3 {
            for step in [-1e-4, 1e-4] {
                let mut near = found.position;
                near[axis] += step;
                assert!(squared_error(&sightings, near).unwrap() > least);
            }
        }
    }

    #[test]
    fn no_point_has_a_reason() {
        let camera = camera(0.0, 0.0);
        let sighting = Sighting { camera: &camera, at: [300.0, 200.0] };
        assert_eq!(triangulate(&[sighting], 1.0), Err(NoPoint::TooFewViews));
        assert_eq!(triangulate(&[sighting, sighting], 1.0), Err(NoPoint::Parallel));
        let other = self::camera(4.0, 0.0);
        let crossed =
            [Sighting { camera: &camera, at: [200.0, 200.0] }, Sighting { camera: &other, at: [400.0, 200.0] }];
        assert_eq!(triangulate(&crossed, 1.0), Err(NoPoint::Behind));
        assert_eq!(Pinhole::new([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [0.0; 3]), None);
    }

    #[test]
    fn a_matrix_of_any_scale_and_sign_is_the_same_camera() {
        let camera = camera(3.0, 0.1);
        let m = camera.image_from_direction;
        let p = [0, 1, 2].map(|i: usize| {
            let row = m[i];
            [row[0], row[1], row[2], -dot(row, camera.centre)].map(|entry| entry * -7.5)
        });
        let found = Pinhole::from_matrix(&p).unwrap();
        let (a, b) = (camera.project(POINT).unwrap(), found.project(POINT).unwrap());
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
        assert!((found.depth(POINT) - camera.depth(POINT)).abs() < 1e-9);
    }
}
