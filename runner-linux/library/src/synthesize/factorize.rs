//! Shape and motion when nothing is known of the cameras: affine factorization, and the metric upgrade of three views or
//! more.
//!
//! Under an affine camera `x = A X + b`. With every point seen by every view, images relative to their centroids form a
//! matrix of rank 3, `W = M S` (Tomasi and Kanade, IJCV 1992). `M Q, Q^-1 S` fits as well for any Q; weak perspective asks
//! for rows of equal length at right angles in each view, which three views turn into linear equations for `Q Q'`.
//!
//! What pictures without perspective cannot say: the scale, and which of two shapes that mirror one another in depth it is.

use std::fmt;

use daymark_core::camera::triangulate::Pinhole;
use daymark_fixtures::random::SplitMix64;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, SMatrix, SVector, Vector3};

use super::view::{Station, Track};
use crate::camera_file::lens::Pose;
use crate::order;

/// What a factorization gave.
#[derive(Debug, Clone)]
pub struct Factorization {
    /// Cameras, as pinholes so far away that perspective vanishes.
    pub stations: Vec<Option<Station>>,
    /// The tracks that entered: seen by all views.
    pub tracks: Vec<Track>,
    /// Whether angles mean something (up to mirroring in depth); if not, the shape is right up to an affine map.
    pub metric: bool,
    /// Fourth singular value against the third: what is left beyond rank 3.
    pub fourth_share: f64,
    /// Root mean square distance of the images from those of the model, pixels.
    pub rms_px: f64,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoShape {
    /// Too few points are seen by all views.
    TooFewTracks {
        /// Points seen by all views.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// The points lie in a plane, or the camera did not move around them: rank 2.
    Flat {
        /// Third singular value against the second.
        third_share: f64,
    },
}

impl fmt::Display for NoShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewTracks { found, needed } => write!(
                f,
                "only {found} corners are seen by all pictures, {needed} are needed without a focal length: give --focal-px, or \
                 fewer pictures that overlap more"
            ),
            Self::Flat { third_share } => write!(
                f,
                "the pictures hold no depth: what is left beyond a plane is {:.2} % of it; take pictures from other sides",
                third_share * 100.0
            ),
        }
    }
}

/// Points that a factorization needs, at least.
pub const MIN_TRACKS: usize = 12;
/// A third singular value below this share of the second is noise.
const FLAT: f64 = 0.01;
/// How many sizes of the model away cameras are put.
const FAR: f64 = 5_000.0;

/// Factorizes the tracks that all `views` see.
///
/// # Errors
/// [`NoShape`].
pub fn factorize(tracks: &[Track], views: usize) -> Result<Factorization, NoShape> {
    let whole: Vec<&Track> = tracks.iter().filter(|track| track.sightings.len() == views).collect();
    let count = whole.len();
    if count < MIN_TRACKS || views < 2 {
        return Err(NoShape::TooFewTracks { found: count, needed: MIN_TRACKS });
    }
    let mut images = DMatrix::<f64>::zeros(2 * views, count);
    for (column, track) in whole.iter().enumerate() {
        for (view, &(_, [x, y])) in track.sightings.iter().enumerate() {
            images[(2 * view, column)] = x;
            images[(2 * view + 1, column)] = y;
        }
    }
    let centroids: Vec<f64> = images.row_iter().map(|row| row.sum() / count as f64).collect();
    for (mut row, centroid) in images.row_iter_mut().zip(&centroids) {
        row.add_scalar_mut(-centroid);
    }
    // The left singular vectors are the eigenvectors of W W', which is small.
    let eigen = (&images * images.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..2 * views).collect();
    order::sort_by(&mut order, |&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let singular = |place: usize| order.get(place).map_or(0.0, |&at| libm::sqrt(eigen.eigenvalues[at].max(0.0)));
    if !(singular(2) > FLAT * singular(1)) {
        return Err(NoShape::Flat { third_share: singular(2) / singular(1).max(f64::MIN_POSITIVE) });
    }
    // M has orthonormal columns, scaled so that the shape has the size of the first picture.
    let scale = libm::sqrt(2.0 / views as f64).max(0.1);
    let mut cameras = DMatrix::<f64>::zeros(2 * views, 3);
    for (column, &at) in order.iter().take(3).enumerate() {
        cameras.set_column(column, &(eigen.eigenvectors.column(at) / scale));
    }
    let mut shape: Matrix3xX<f64> = Matrix3xX::from_columns(
        &(0..count)
            .map(|column| {
                let seen = cameras.transpose() * images.column(column) * (scale * scale);
                Vector3::new(seen[0], seen[1], seen[2])
            })
            .collect::<Vec<_>>(),
    );
    let residual = &images - &cameras * DMatrix::from_iterator(3, count, shape.iter().copied());
    let rms_px = libm::sqrt(residual.norm_squared() / (views * count) as f64);
    let metric = upgrade(&cameras, views);
    if let Some(q) = metric
        && let Some(back) = q.try_inverse()
    {
        cameras *= DMatrix::from_iterator(3, 3, q.iter().copied());
        shape = back * shape;
    }
    let extent = shape.column_iter().map(|point| point.norm()).fold(0.0, f64::max);
    let stations = (0..views)
        .map(|view| {
            let row = |axis: usize| cameras.row(2 * view + axis).transpose();
            let (a, b) = (row(0), row(1));
            let (a, b) = (Vector3::new(a[0], a[1], a[2]), Vector3::new(b[0], b[1], b[2]));
            distant(&a, &b, [centroids[2 * view], centroids[2 * view + 1]], FAR * extent)
        })
        .collect();
    Ok(Factorization {
        stations,
        tracks: whole.into_iter().cloned().collect(),
        metric: metric.is_some(),
        fourth_share: singular(3) / singular(2),
        rms_px,
    })
}

/// The map Q with `M Q` having rows of equal length at right angles in each view, the first view's of length one.
fn upgrade(cameras: &DMatrix<f64>, views: usize) -> Option<Matrix3<f64>> {
    if views < 3 {
        return None;
    }
    let row = |number: usize| [cameras[(number, 0)], cameras[(number, 1)], cameras[(number, 2)]];
    // a' G b for a symmetric G, as a row of its six entries.
    let form = |a: [f64; 3], b: [f64; 3]| {
        [
            a[0] * b[0],
            a[0] * b[1] + a[1] * b[0],
            a[0] * b[2] + a[2] * b[0],
            a[1] * b[1],
            a[1] * b[2] + a[2] * b[1],
            a[2] * b[2],
        ]
    };
    let mut left = DMatrix::<f64>::zeros(2 * views + 1, 6);
    let mut right = DVector::<f64>::zeros(2 * views + 1);
    for view in 0..views {
        let (a, b) = (row(2 * view), row(2 * view + 1));
        let (aa, bb, ab) = (form(a, a), form(b, b), form(a, b));
        for entry in 0..6 {
            left[(2 * view, entry)] = aa[entry] - bb[entry];
            left[(2 * view + 1, entry)] = ab[entry];
            if view == 0 {
                left[(2 * views, entry)] = f64::midpoint(aa[entry], bb[entry]);
            }
        }
    }
    right[2 * views] = 1.0;
    let normal = left.transpose() * &left;
    let normal = SMatrix::<f64, 6, 6>::from_iterator(normal.iter().copied());
    let side = left.transpose() * right;
    let side = SVector::<f64, 6>::from_iterator(side.iter().copied());
    // Views that only turn about their axes, or all about one line, leave it open.
    let eigen = normal.symmetric_eigenvalues();
    if !(eigen.min() > 1e-9 * eigen.max()) {
        return None;
    }
    let g = normal.cholesky()?.solve(&side);
    let gram = Matrix3::new(g[0], g[1], g[2], g[1], g[3], g[4], g[2], g[4], g[5]);
    // Not positive: the pictures are too far from weak perspective for the upgrade.
    Some(gram.cholesky()?.l())
}

/// A pinhole so far away that it sees what the affine camera with rows `a`, `b` and centre `c` sees.
fn distant(a: &Vector3<f64>, b: &Vector3<f64>, [x, y]: [f64; 2], distance: f64) -> Option<Station> {
    let forward = a.cross(b).try_normalize(1e-12)?;
    let position = -forward * distance;
    let rows = [a * distance + forward * x, b * distance + forward * y, forward].map(<[f64; 3]>::from);
    let right = a.try_normalize(1e-12)?;
    let pose = Pose {
        view_from_model: Matrix3::from_rows(&[
            right.transpose(),
            forward.cross(&right).transpose(),
            forward.transpose(),
        ]),
        position,
    };
    Some(Station { pose, pinhole: Pinhole::new(rows, position.into())? })
}

/// Numbers of the pairs of image points that one affine epipolar geometry explains (`a x + b y + c x' + d y' + e = 0`;
/// Hartley and Zisserman, 14.2): samples of four, scored by truncated squares, refined over the inliers.
pub fn affine_inliers(pairs: &[[[f64; 2]; 2]], threshold_px: f64, seed: u64) -> Vec<usize> {
    if pairs.len() < 8 {
        return Vec::new();
    }
    let mut random = SplitMix64::new(seed);
    let point = |number: usize| {
        let [[x, y], [u, v]] = pairs[number];
        SVector::<f64, 4>::new(x, y, u, v)
    };
    let limit = threshold_px * threshold_px;
    let fit = |numbers: &[usize]| {
        let mean = numbers.iter().fold(SVector::<f64, 4>::zeros(), |sum, &n| sum + point(n)) / numbers.len() as f64;
        let scatter = numbers.iter().fold(SMatrix::<f64, 4, 4>::zeros(), |sum, &n| {
            let off = point(n) - mean;
            sum + off * off.transpose()
        });
        let eigen = scatter.symmetric_eigen();
        let normal: SVector<f64, 4> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        (mean, normal)
    };
    let inside = |(mean, normal): &(SVector<f64, 4>, SVector<f64, 4>)| -> (f64, Vec<usize>) {
        let mut cost = 0.0;
        let mut numbers = Vec::new();
        for number in 0..pairs.len() {
            let distance = (point(number) - mean).dot(normal);
            if distance * distance < limit {
                numbers.push(number);
            }
            cost += (distance * distance).min(limit);
        }
        (cost, numbers)
    };
    let mut best: (f64, Vec<usize>) = (f64::INFINITY, Vec::new());
    for _ in 0..500 {
        let mut sample = Vec::with_capacity(4);
        while sample.len() < 4 {
            let number = random.range(0, pairs.len() as i32) as usize;
            if !sample.contains(&number) {
                sample.push(number);
            }
        }
        let mut now = inside(&fit(&sample));
        if now.0 >= best.0 {
            continue;
        }
        for _ in 0..3 {
            let refined = inside(&fit(&now.1));
            if refined.0 >= now.0 {
                break;
            }
            now = refined;
        }
        best = now;
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// Weak-perspective images of a box of points.
    fn tracks(views: usize) -> (Vec<Track>, Vec<Vector3<f64>>) {
        let mut random = SplitMix64::new(2);
        let points: Vec<Vector3<f64>> = (0..30)
            .map(|_| Vector3::new(random.metres(-4.0, 4.0), random.metres(-3.0, 3.0), random.metres(-2.0, 2.0)))
            .collect();
        let tracks = (0_u32..)
            .zip(&points)
            .map(|(number, point)| {
                let sightings = (0..views)
                    .map(|view| {
                        let turn = Rotation3::from_euler_angles(
                            0.1 * view as f64,
                            0.25 * view as f64 - 0.2,
                            0.03 * view as f64,
                        );
                        let seen = turn * point * (40.0 + 3.0 * view as f64);
                        (view, [seen.x + 320.0, seen.y + 240.0])
                    })
                    .collect();
                Track { number, sightings }
            })
            .collect();
        (tracks, points)
    }

    fn positions(found: &Factorization) -> Vec<Vector3<f64>> {
        let rules = super::super::triangulate::Rules { min_parallax_degree: 0.0, ..Default::default() };
        let (vertices, refused) = super::super::triangulate::points(&found.tracks, &found.stations, &rules);
        assert!(refused.is_empty(), "{refused:?}");
        vertices.into_iter().map(|vertex| vertex.position).collect()
    }

    #[test]
    fn three_views_give_the_shape_up_to_similarity_and_mirror() {
        let (tracks, points) = tracks(4);
        let found = factorize(&tracks, 4).unwrap();
        assert!(found.metric && found.rms_px < 1e-6 && found.fourth_share < 1e-6, "{found:?}");
        let shape = positions(&found);
        let mirrored: Vec<_> = shape.iter().map(|p| -p).collect();
        let off = |shape: &[Vector3<f64>]| {
            let map = crate::classify::cloud::Similarity::fit(shape, &points, false).unwrap();
            shape.iter().zip(&points).map(|(a, b)| (map.apply(a) - b).norm()).fold(0.0, f64::max)
        };
        let least = off(&shape).min(off(&mirrored));
        assert!(least < 0.01, "{least}");
    }

    #[test]
    fn two_views_give_it_up_to_an_affine_map() {
        let (tracks, points) = tracks(2);
        let found = factorize(&tracks, 2).unwrap();
        assert!(!found.metric && found.rms_px < 1e-6, "{found:?}");
        // Least squares for an affine map.
        let shape = positions(&found);
        let mut left = DMatrix::<f64>::zeros(30, 4);
        let mut right = DMatrix::<f64>::zeros(30, 3);
        for (row, (a, b)) in shape.iter().zip(&points).enumerate() {
            left.row_mut(row).copy_from_slice(&[a.x, a.y, a.z, 1.0]);
            right.row_mut(row).copy_from_slice(&[b.x, b.y, b.z]);
        }
        let normal = (left.transpose() * &left).cholesky().unwrap();
        let map = normal.solve(&(left.transpose() * &right));
        assert!((left * map - right).amax() < 0.01);
    }

    #[test]
    fn what_holds_no_depth_is_refused() {
        let (mut tracks, _) = tracks(3);
        assert_eq!(factorize(&tracks[..5], 3).unwrap_err(), NoShape::TooFewTracks { found: 5, needed: MIN_TRACKS });
        for track in &mut tracks {
            let first = track.sightings[0].1;
            for sighting in &mut track.sightings {
                sighting.1 = [first[0] + 5.0, first[1] * 0.9];
            }
        }
        assert!(matches!(factorize(&tracks, 3), Err(NoShape::Flat { .. })));
    }

    #[test]
    fn wrong_pairs_are_no_inliers() {
        let (tracks, _) = tracks(2);
        let mut pairs: Vec<[[f64; 2]; 2]> = tracks.iter().map(|t| [t.sightings[0].1, t.sightings[1].1]).collect();
        for pair in pairs.iter_mut().step_by(5) {
            pair[1][1] += 40.0;
        }
        let inliers = affine_inliers(&pairs, 1.0, 3);
        assert_eq!(inliers.len(), 24);
        assert!(inliers.iter().all(|number| number % 5 != 0));
    }
}
