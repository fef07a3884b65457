//! The lens and all places by least squares over all corners (Levenberg-Marquardt), with the covariance of the lens.
//!
//! The unknowns of a picture are bound to the others through the lens only, so they are eliminated picture by picture (Schur
//! complement) and what is left is a system of at most nine unknowns. Its inverse times the variance of a coordinate is the
//! covariance of the lens. Sums run in the order of pictures and corners.

use nalgebra::{Matrix2x3, Matrix6, Rotation3, SMatrix, SVector, Vector2, Vector3, Vector6};

use super::Seen;
use super::board::Board;
use crate::camera_file::distortion::Distortion;
use crate::camera_file::lens::{Lens, Pose};

/// fx, fy, cx, cy, k1, k2, p1, p2, k3.
pub const UNKNOWNS: usize = 9;
/// Steps at most.
const STEPS: usize = 200;

type Numbers = SVector<f64, UNKNOWNS>;
type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// A picture of the board.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Corners that are seen.
    pub seen: Vec<Seen>,
    /// The board in the camera's view, as far as it is known.
    pub pose: Pose,
}

/// The lens as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    numbers: Numbers,
    /// Unknowns that are adjusted: all but k3, or all.
    free: usize,
    size: [u32; 2],
}

impl Model {
    /// Starts with this focal length; `with_k3` for lenses that bend more than two coefficients can say.
    pub fn new(width: u32, height: u32, focal: f64, with_k3: bool) -> Self {
        let [cx, cy] = Lens::of_focal(width, height, focal).centre;
        let numbers = Numbers::from([focal, focal, cx, cy, 0.0, 0.0, 0.0, 0.0, 0.0]);
        Self { numbers, free: if with_k3 { UNKNOWNS } else { UNKNOWNS - 1 }, size: [width, height] }
    }

    /// The lens.
    pub fn lens(&self) -> Lens {
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = self.numbers.into();
        Lens {
            width: self.size[0],
            height: self.size[1],
            focal: [fx, fy],
            centre: [cx, cy],
            skew: 0.0,
            distortion: Distortion::Radial { radial: [k1, k2, k3, 0.0, 0.0, 0.0], tangential: [p1, p2] },
        }
    }

    /// fx, fy, cx, cy, k1, k2, p1, p2, k3.
    pub fn numbers(&self) -> [f64; UNKNOWNS] {
        self.numbers.into()
    }

    /// How many of them were adjusted.
    pub const fn free(&self) -> usize {
        self.free
    }
}

/// What is left of a corner, and how it changes.
struct Linear {
    residual: Vector2<f64>,
    lens: SMatrix<f64, 2, UNKNOWNS>,
    pose: SMatrix<f64, 2, 6>,
}

fn place(board: &Board, corner: [u8; 2]) -> Vector3<f64> {
    let [x, y] = board.place(corner);
    Vector3::new(x, y, 0.0)
}

/// Where the corner is seen less where it should be seen; `None` behind the camera.
fn residual(model: &Model, board: &Board, pose: &Pose, seen: &Seen) -> Option<Vector2<f64>> {
    let view = pose.to_view(&place(board, seen.corner));
    if !(view.z > 1e-9) {
        return None;
    }
    let lens = model.lens();
    let bent = lens.distortion.apply([view.x / view.z, view.y / view.z]);
    Some(Vector2::from(seen.at) - Vector2::from(lens.ideal_from_normalized(bent)))
}

fn linear(model: &Model, board: &Board, pose: &Pose, seen: &Seen) -> Option<Linear> {
    let turned = pose.view_from_model * place(board, seen.corner);
    let view = turned + pose.translation();
    if !(view.z > 1e-9) {
        return None;
    }
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = model.numbers.into();
    let (x, y) = (view.x / view.z, view.y / view.z);
    let r2 = x * x + y * y;
    let (r4, r6) = (r2 * r2, r2 * r2 * r2);
    let scale = 1.0 + k1 * r2 + k2 * r4 + k3 * r6;
    let by_r2 = k1 + 2.0 * k2 * r2 + 3.0 * k3 * r4;
    let bent_x = x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let bent_y = y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    let residual = Vector2::new(seen.at[0] - (fx * bent_x + cx), seen.at[1] - (fy * bent_y + cy));
    let across = 2.0 * x * y * by_r2 + 2.0 * p1 * x + 2.0 * p2 * y;
    let by_normalized = nalgebra::Matrix2::new(
        fx * (scale + 2.0 * x * x * by_r2 + 2.0 * p1 * y + 6.0 * p2 * x),
        fx * across,
        fy * across,
        fy * (scale + 2.0 * y * y * by_r2 + 6.0 * p1 * y + 2.0 * p2 * x),
    );
    let by_view = by_normalized * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / view.z;
    let mut pose = SMatrix::<f64, 2, 6>::zeros();
    // A turn w moves a turned point by w x turned.
    pose.fixed_columns_mut::<3>(0).copy_from(&(-(by_view * turned.cross_matrix())));
    pose.fixed_columns_mut::<3>(3).copy_from(&by_view);
    let lens = SMatrix::<f64, 2, UNKNOWNS>::from_rows(&[
        nalgebra::RowSVector::from([
            bent_x,
            0.0,
            1.0,
            0.0,
            fx * x * r2,
            fx * x * r4,
            fx * 2.0 * x * y,
            fx * (r2 + 2.0 * x * x),
            fx * x * r6,
        ]),
        nalgebra::RowSVector::from([
            0.0,
            bent_y,
            0.0,
            1.0,
            fy * y * r2,
            fy * y * r4,
            fy * (r2 + 2.0 * y * y),
            fy * 2.0 * x * y,
            fy * y * r6,
        ]),
    ]);
    Some(Linear { residual, lens, pose })
}

/// The normal equations of a picture.
struct Block {
    pose: Matrix6<f64>,
    pose_side: Vector6<f64>,
    across: SMatrix<f64, UNKNOWNS, 6>,
}

struct System {
    lens: Matrix,
    lens_side: Numbers,
    blocks: Vec<Block>,
}

/// How far residuals count fully, pixels; beyond, linearly (Huber).
fn weight(residual: &Vector2<f64>, huber: f64) -> f64 {
    let length = residual.norm();
    if length <= huber { 1.0 } else { huber / length }
}

impl System {
    fn new(model: &Model, board: &Board, shots: &[Shot], huber: f64) -> Self {
        let mut system = Self { lens: Matrix::zeros(), lens_side: Numbers::zeros(), blocks: Vec::new() };
        for shot in shots {
            let mut block = Block { pose: Matrix6::zeros(), pose_side: Vector6::zeros(), across: SMatrix::zeros() };
            for seen in &shot.seen {
                let Some(mut at) = linear(model, board, &shot.pose, seen) else { continue };
                let w = weight(&at.residual, huber);
                for fixed in model.free..UNKNOWNS {
                    at.lens.column_mut(fixed).fill(0.0);
                }
                let (lens, pose) = (at.lens.transpose() * w, at.pose.transpose() * w);
                system.lens += lens * at.lens;
                system.lens_side += lens * at.residual;
                block.pose += pose * at.pose;
                block.pose_side += pose * at.residual;
                block.across += lens * at.pose;
            }
            system.blocks.push(block);
        }
        system
    }

    /// The system of the lens after the pictures are eliminated, with the diagonal raised by `damping`.
    fn reduced(&self, free: usize, damping: f64) -> Option<(Matrix, Numbers, Vec<Matrix6<f64>>)> {
        let mut matrix = self.lens;
        let mut side = self.lens_side;
        for unknown in 0..UNKNOWNS {
            matrix[(unknown, unknown)] += if unknown < free { damping * matrix[(unknown, unknown)] } else { 1.0 };
        }
        let mut inverses = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut pose = block.pose;
            for unknown in 0..6 {
                pose[(unknown, unknown)] += damping * pose[(unknown, unknown)];
            }
            let inverse = pose.try_inverse()?;
            let folded = block.across * inverse;
            matrix -= folded * block.across.transpose();
            side -= folded * block.pose_side;
            inverses.push(inverse);
        }
        Some((matrix, side, inverses))
    }
}

/// The inverse of a symmetric matrix whose unknowns have very different units; `None` if a direction is open.
fn inverse(matrix: &Matrix) -> Option<Matrix> {
    let scales = matrix.diagonal().map(|d| 1.0 / libm::sqrt(d));
    if !scales.iter().all(|scale| scale.is_finite()) {
        return None;
    }
    let scaling = Matrix::from_diagonal(&scales);
    let scaled = scaling * matrix * scaling;
    let inverse = scaled.cholesky()?.inverse();
    let found = scaling * inverse * scaling;
    found.iter().all(|v| v.is_finite()).then_some(found)
}

fn cost(model: &Model, board: &Board, shots: &[Shot], huber: f64) -> f64 {
    let mut sum = 0.0;
    for shot in shots {
        for seen in &shot.seen {
            let Some(residual) = residual(model, board, &shot.pose, seen) else { return f64::INFINITY };
            let length = residual.norm();
            sum += if length <= huber { length * length } else { huber * (2.0 * length - huber) };
        }
    }
    sum
}

/// Lowers the sum of squares; residuals beyond `huber` count linearly. Returns whether it came to rest.
pub fn adjust(model: &mut Model, board: &Board, shots: &mut [Shot], huber: f64) -> bool {
    let mut damping = 1e-3;
    let mut now = cost(model, board, shots, huber);
    if !now.is_finite() {
        return false;
    }
    for _ in 0..STEPS {
        let system = System::new(model, board, shots, huber);
        let mut stands = false;
        let mut better = false;
        while damping < 1e9 {
            if let Some((next, next_shots)) = step(model, shots, &system, damping) {
                let after = cost(&next, board, &next_shots, huber);
                if after < now {
                    stands = now - after < 1e-12 * now;
                    better = true;
                    now = after;
                    *model = next;
                    shots.clone_from_slice(&next_shots);
                    damping = (damping * 0.1).max(1e-12);
                    break;
                }
            }
            damping *= 10.0;
        }
        if stands || !better {
            return true;
        }
    }
    false
}

fn step(model: &Model, shots: &[Shot], system: &System, damping: f64) -> Option<(Model, Vec<Shot>)> {
    let (matrix, side, inverses) = system.reduced(model.free, damping)?;
    let change = inverse(&matrix)? * side;
    let mut next = *model;
    next.numbers += change;
    let shots = shots
        .iter()
        .zip(&system.blocks)
        .zip(inverses)
        .map(|((shot, block), inverse)| {
            let moved = inverse * (block.pose_side - block.across.transpose() * change);
            let turn = Rotation3::new(moved.fixed_rows::<3>(0).into_owned());
            let translation = shot.pose.translation() + moved.fixed_rows::<3>(3);
            let pose = Pose::from_translation(turn.matrix() * shot.pose.view_from_model, translation);
            Shot { pose, ..shot.clone() }
        })
        .collect();
    Some((next, shots))
}

/// How well a lens fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Standard deviations of fx, fy, cx, cy, k1, k2, p1, p2, k3; 0 for what was not adjusted.
    pub deviations: [f64; UNKNOWNS],
    /// Root mean square of the distances of corners from where they should be, pixels.
    pub rms_px: f64,
    /// The same for each picture.
    pub rms_of_shots_px: Vec<f64>,
    /// The distance of each corner of each picture, pixels; infinite behind the camera.
    pub distances_px: Vec<Vec<f64>>,
}

/// How well the lens fits; `None` if the pictures leave something of it open.
pub fn fit(model: &Model, board: &Board, shots: &[Shot]) -> Option<Fit> {
    let distances_px: Vec<Vec<f64>> = shots
        .iter()
        .map(|shot| {
            let distance = |seen| residual(model, board, &shot.pose, seen).map_or(f64::INFINITY, |r| r.norm());
            shot.seen.iter().map(distance).collect()
        })
        .collect();
    let squares = |distances: &[f64]| distances.iter().map(|d| d * d).sum::<f64>();
    let total: f64 = distances_px.iter().map(|distances| squares(distances)).sum();
    let corners: usize = distances_px.iter().map(Vec::len).sum();
    let freedom = (2 * corners).checked_sub(model.free + 6 * shots.len()).filter(|freedom| *freedom > 0)?;
    let (matrix, ..) = System::new(model, board, shots, f64::INFINITY).reduced(model.free, 0.0)?;
    let covariance = inverse(&matrix)? * (total / freedom as f64);
    let mut deviations = [0.0; UNKNOWNS];
    for (unknown, deviation) in deviations.iter_mut().enumerate().take(model.free) {
        *deviation = libm::sqrt(covariance[(unknown, unknown)]);
    }
    Some(Fit {
        deviations,
        rms_px: libm::sqrt(total / corners as f64),
        rms_of_shots_px: distances_px.iter().map(|d| libm::sqrt(squares(d) / d.len().max(1) as f64)).collect(),
        distances_px,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_fixtures::distort::Distortion as Noise;

    const BOARD: Board = Board { columns: 9, rows: 6, square_mm: 25.0 };
    const TRUTH: [f64; UNKNOWNS] = [562.0, 558.0, 325.0, 236.0, -0.21, 0.06, 0.001, -0.0008, 0.0];

    /// Pictures from all around with noise of `sigma` px; places a little off.
    fn shots(truth: &Model, sigma: f64, seed: u64) -> Vec<Shot> {
        let mut noise = Noise::new(seed);
        let angles =
            [(0.4, 0.1), (-0.4, 0.0), (0.0, 0.5), (0.1, -0.45), (0.3, 0.3), (-0.3, 0.3), (0.0, 0.05), (-0.3, -0.4)];
        angles
            .iter()
            .enumerate()
            .map(|(number, &(x, y))| {
                let turn = *Rotation3::from_euler_angles(x, y, 0.3 * number as f64).matrix();
                let middle = Vector3::new(100.0, 62.5, 0.0);
                let aside = Vector3::new(60.0 * (number % 3) as f64 - 60.0, 40.0 * (number % 2) as f64 - 20.0, 330.0);
                let pose = Pose::from_translation(turn, aside - turn * middle);
                let seen = (0..54)
                    .map(|k| {
                        let mut seen = Seen { corner: [k % 9, k / 9], at: [0.0; 2] };
                        let expected = -residual(truth, &BOARD, &pose, &seen).unwrap();
                        seen.at = [expected.x + sigma * noise.normal(), expected.y + sigma * noise.normal()];
                        seen
                    })
                    .collect();
                let off = Rotation3::from_euler_angles(0.03, -0.02, 0.01) * turn;
                Shot { seen, pose: Pose::from_translation(off, pose.translation() * 1.05) }
            })
            .collect()
    }

    fn truth() -> Model {
        Model { numbers: Numbers::from(TRUTH), ..Model::new(640, 480, 560.0, false) }
    }

    #[test]
    fn exact_corners_give_the_lens_back() {
        let mut shots = shots(&truth(), 0.0, 1);
        let mut model = Model::new(640, 480, 600.0, false);
        assert!(adjust(&mut model, &BOARD, &mut shots, f64::INFINITY));
        for (found, expected) in model.numbers().iter().zip(TRUTH) {
            assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{:?}", model.numbers());
        }
    }

    #[test]
    fn deviations_are_honest() {
        // The mean square of errors in units of their deviations is 1; 100 trials of 8 unknowns leave it within 0.2.
        let mut sum = 0.0;
        let trials = 100;
        for seed in 0..trials {
            let mut shots = shots(&truth(), 0.2, seed);
            let mut model = truth();
            assert!(adjust(&mut model, &BOARD, &mut shots, f64::INFINITY));
            let fit = fit(&model, &BOARD, &shots).unwrap();
            for ((found, expected), deviation) in model.numbers().iter().zip(TRUTH).zip(fit.deviations).take(8) {
                let off = (found - expected) / deviation;
                sum += off * off;
            }
        }
        let mean = sum / (8.0 * trials as f64);
        assert!((0.8..1.25).contains(&mean), "{mean}");
    }

    #[test]
    fn derivatives_are_those_of_the_residual() {
        let shots = shots(&truth(), 0.0, 3);
        let with_k3 = Model { free: UNKNOWNS, numbers: truth().numbers.map(|v| v * 1.02 + 1e-3), ..truth() };
        let (shot, seen) = (&shots[2], &shots[2].seen[13]);
        let linear = linear(&with_k3, &BOARD, &shot.pose, seen).unwrap();
        for unknown in 0..UNKNOWNS {
            let by = |h: f64| {
                let mut model = with_k3;
                model.numbers[unknown] += h;
                residual(&model, &BOARD, &shot.pose, seen).unwrap()
            };
            let slope = (by(-1e-5) - by(1e-5)) / 2e-5;
            assert!((slope - linear.lens.column(unknown)).norm() < 1e-4 * (1.0 + slope.norm()), "{unknown}");
        }
        for unknown in 0..6 {
            let by = |h: f64| {
                let mut moved = [0.0; 6];
                moved[unknown] = h;
                let [a, b, c, x, y, z] = moved;
                let turn = Rotation3::new(Vector3::new(a, b, c)).matrix() * shot.pose.view_from_model;
                let pose = Pose::from_translation(turn, shot.pose.translation() + Vector3::new(x, y, z));
                residual(&with_k3, &BOARD, &pose, seen).unwrap()
            };
            let slope = (by(-1e-6) - by(1e-6)) / 2e-6;
            assert!((slope - linear.pose.column(unknown)).norm() < 1e-4 * (1.0 + slope.norm()), "{unknown}");
        }
    }
}
