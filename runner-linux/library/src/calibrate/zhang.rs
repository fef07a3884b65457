//! A first lens and first places, from homographies (Zhang, "A flexible new technique for camera calibration", PAMI 22, 2000).
//!
//! The images of two perpendicular, equally long directions of the board bind the focal length (equations 3 and 4). With the
//! principal point in the middle and square pixels one unknown is left, which every picture tells that is not parallel to the
//! board; the paper's closed form of five unknowns is exact only without noise, and refining does the rest anyway.

use daymark_core::family::{Correspondence, Family, Perspective};
use nalgebra::{Matrix3, Vector3};

use super::Seen;
use super::board::Board;
use crate::camera_file::lens::{Lens, Pose};

/// The map to pixels from millimetres on the board, from the corners that are seen.
pub fn image_from_board(board: &Board, seen: &[Seen]) -> Option<Matrix3<f64>> {
    let pairs: Vec<Correspondence> =
        seen.iter().map(|seen| Correspondence { from: board.place(seen.corner), to: seen.at }).collect();
    let matrix = Perspective::fit(&pairs)?.matrix();
    Some(Matrix3::from_row_slice(matrix.as_flattened()))
}

/// How far the board is tilted against the picture plane, in degrees, without any lens: by how unlike the scales in its two
/// directions are in the middle of the board. 0 for a board parallel to the picture, wherever it is.
pub fn tilt_degrees(image_from_board: &Matrix3<f64>, board: &Board) -> f64 {
    let [x, y] = board.middle();
    let image = image_from_board * Vector3::new(x, y, 1.0);
    let (u, v, w) = (image.x / image.z, image.y / image.z, image.z);
    let h = image_from_board;
    let a = (h[(0, 0)] - u * h[(2, 0)]) / w;
    let b = (h[(0, 1)] - u * h[(2, 1)]) / w;
    let c = (h[(1, 0)] - v * h[(2, 0)]) / w;
    let d = (h[(1, 1)] - v * h[(2, 1)]) / w;
    // Singular values of a 2 x 2 matrix.
    let sum = libm::hypot(a + d, c - b);
    let difference = libm::hypot(a - d, b + c);
    let ratio = ((sum - difference).abs() / (sum + difference)).min(1.0);
    libm::acos(ratio).to_degrees()
}

/// The focal length in pixels that fits the homographies best, for a lens without distortion; `None` if they do not tell.
pub fn focal_length(homographies: &[Matrix3<f64>], width: u32, height: u32) -> Option<f64> {
    let middle = Lens::of_focal(width, height, 1.0).centre;
    let to_middle = Matrix3::new(1.0, 0.0, -middle[0], 0.0, 1.0, -middle[1], 0.0, 0.0, 1.0);
    // a / f2 + b = 0, for each equation.
    let (mut ab, mut aa) = (0.0, 0.0);
    for homography in homographies {
        let h = to_middle * homography;
        let scale = h.column(0).xy().norm() * h.column(1).xy().norm();
        if !(scale > 0.0) {
            continue;
        }
        let (first, second) = (h.column(0), h.column(1));
        let rows = [
            (first.xy().dot(&second.xy()), first.z * second.z),
            (first.xy().norm_squared() - second.xy().norm_squared(), first.z * first.z - second.z * second.z),
        ];
        for (a, b) in rows {
            let (a, b) = (a / scale, b / scale);
            ab += a * b;
            aa += a * a;
        }
    }
    // a is free of units, b has those of 1 / f2.
    let inverse_square = -ab / aa;
    let focal = 1.0 / libm::sqrt(inverse_square);
    let longer = f64::from(width.max(height));
    (0.1 * longer..30.0 * longer).contains(&focal).then_some(focal)
}

/// Where the camera of a homography stands, by this lens; the board lies before it.
pub fn pose(lens: &Lens, image_from_board: &Matrix3<f64>) -> Option<Pose> {
    let mut view_from_board = lens.matrix().try_inverse()? * image_from_board;
    let scale = 2.0 / (view_from_board.column(0).norm() + view_from_board.column(1).norm());
    view_from_board *= if view_from_board[(2, 2)] < 0.0 { -scale } else { scale };
    let (first, second) = (view_from_board.column(0).into_owned(), view_from_board.column(1).into_owned());
    // The nearest pair of perpendicular directions: turn both by the same angle.
    let (sum, difference) = ((first + second).try_normalize(1e-12)?, (first - second).try_normalize(1e-12)?);
    let difference = (difference - sum * sum.dot(&difference)).try_normalize(1e-12)?;
    let (x, y) = ((sum + difference).normalize(), (sum - difference).normalize());
    let turn = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let step = view_from_board.column(2).into_owned();
    (step.iter().chain(turn.iter()).all(|v| v.is_finite())).then(|| Pose::from_translation(turn, step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    const BOARD: Board = Board { columns: 9, rows: 6, square_mm: 25.0 };

    fn seen(lens: &Lens, pose: &Pose) -> Vec<Seen> {
        (0..54)
            .map(|k| {
                let corner = [k % 9, k / 9];
                let [x, y] = BOARD.place(corner);
                let view = pose.to_view(&Vector3::new(x, y, 0.0));
                Seen { corner, at: lens.ideal_from_normalized([view.x / view.z, view.y / view.z]) }
            })
            .collect()
    }

    fn at(x: f64, y: f64) -> Pose {
        let turn = *Rotation3::from_euler_angles(x, y, 0.2).matrix();
        Pose::from_translation(turn, Vector3::new(-90.0, -60.0, 400.0))
    }

    #[test]
    fn exact_homographies_give_the_lens_and_the_places() {
        let lens = Lens::of_focal(640, 480, 560.0);
        let poses = [at(0.4, 0.1), at(-0.1, 0.5), at(-0.3, -0.4)];
        let maps: Vec<_> = poses.iter().map(|pose| image_from_board(&BOARD, &seen(&lens, pose)).unwrap()).collect();
        let focal = focal_length(&maps, 640, 480).unwrap();
        assert!((focal - 560.0).abs() < 1e-4, "{focal}");
        for (map, truth) in maps.iter().zip(&poses) {
            let found = pose(&lens, map).unwrap();
            assert!((found.position - truth.position).norm() < 1e-4, "{found:?}");
            assert!((found.view_from_model - truth.view_from_model).norm() < 1e-7);
        }
    }

    #[test]
    fn parallel_boards_say_nothing_of_the_focal_length() {
        let lens = Lens::of_focal(640, 480, 560.0);
        let flat = |z: f64| Pose::from_translation(Matrix3::identity(), Vector3::new(20.0, -60.0, z));
        let maps: Vec<_> =
            [300.0, 400.0].iter().map(|z| image_from_board(&BOARD, &seen(&lens, &flat(*z))).unwrap()).collect();
        assert!(maps.iter().all(|map| tilt_degrees(map, &BOARD) < 1e-3));
        assert_eq!(focal_length(&maps, 640, 480), None);
        let tilted = image_from_board(&BOARD, &seen(&lens, &at(0.0, 0.5))).unwrap();
        assert!((tilt_degrees(&tilted, &BOARD) - 0.5_f64.to_degrees()).abs() < 6.0);
    }
}
