//! Vectors and small matrices of space; `+ - * /` and square roots in the written order.

use crate::math::sqrt_f64;

pub(crate) type Vector = [f64; 3];
/// Row by row.
pub(crate) type Matrix = [[f64; 3]; 3];

pub(crate) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

#[inline]
pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub(crate) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(crate) fn scaled(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

#[inline]
pub(crate) fn length(a: Vector) -> f64 {
    sqrt_f64(dot(a, a))
}

/// The same direction with length one; `None` for zero and what is not finite.
#[inline]
pub(crate) fn unit(a: Vector) -> Option<Vector> {
    let length = length(a);
    (length > 0.0 && length.is_finite()).then(|| scaled(a, 1.0 / length))
}

#[inline]
pub(crate) fn apply(matrix: &Matrix, a: Vector) -> Vector {
    [dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)]
}

/// The transposed matrix times a vector.
#[inline]
pub(crate) fn apply_transposed(matrix: &Matrix, a: Vector) -> Vector {
    plus(plus(scaled(matrix[0], a[0]), scaled(matrix[1], a[1])), scaled(matrix[2], a[2]))
}

pub(crate) fn transposed(matrix: &Matrix) -> Matrix {
    let [[a, b, c], [d, e, f], [g, h, i]] = *matrix;
    [[a, d, g], [b, e, h], [c, f, i]]
}

/// `a b`.
pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| apply_transposed(b, row))
}

/// Eigenvalues of a symmetric matrix, largest first, with their directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    pub(crate) values: [f64; 3],
    pub(crate) directions: [Vector; 3],
}

/// Sweeps of Jacobi's method: it converges quadratically, and five leave nothing.
const SWEEPS: usize = 6;

/// By Jacobi's method (Golub and Van Loan, *Matrix Computations*, 8.5), a fixed number of sweeps.
pub(crate) fn axes(symmetric: &Matrix) -> Axes {
    let (mut a, mut v) = (*symmetric, IDENTITY);
    for _ in 0..SWEEPS {
        turn::<0, 1, 2>(&mut a, &mut v);
        turn::<0, 2, 1>(&mut a, &mut v);
        turn::<1, 2, 0>(&mut a, &mut v);
    }
    let mut entries = [(a[0][0], v[0]), (a[1][1], v[1]), (a[2][2], v[2])];
    for (first, second) in [(0, 1), (1, 2), (0, 1)] {
        if let (Some(one), Some(two)) = (entries.get(first).copied(), entries.get(second).copied())
            && two.0 > one.0
        {
            entries.swap(first, second);
        }
    }
    Axes { values: entries.map(|entry| entry.0), directions: entries.map(|entry| entry.1) }
}

/// Makes the entry (P, Q) zero; `v` holds the directions as rows.
#[inline]
fn turn<const P: usize, const Q: usize, const OTHER: usize>(a: &mut Matrix, v: &mut Matrix) {
    if a[P][Q] == 0.0 {
        return;
    }
    let tau = (a[Q][Q] - a[P][P]) / (2.0 * a[P][Q]);
    let root = sqrt_f64(1.0 + tau * tau);
    let t = if tau >= 0.0 { 1.0 / (tau + root) } else { 1.0 / (tau - root) };
    let c = 1.0 / sqrt_f64(1.0 + t * t);
    let s = t * c;
    let (pp, qq, pq) = (a[P][P], a[Q][Q], a[P][Q]);
    a[P][P] = pp - t * pq;
    a[Q][Q] = qq + t * pq;
    a[P][Q] = 0.0;
    a[Q][P] = 0.0;
    let (p, q) = (a[OTHER][P], a[OTHER][Q]);
    a[OTHER][P] = c * p - s * q;
    a[P][OTHER] = a[OTHER][P];
    a[OTHER][Q] = s * p + c * q;
    a[Q][OTHER] = a[OTHER][Q];
    let (row_p, row_q) = (v[P], v[Q]);
    v[P] = minus(scaled(row_p, c), scaled(row_q, s));
    v[Q] = plus(scaled(row_p, s), scaled(row_q, c));
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, SymmetricEigen};

    #[test]
    fn axes_are_those_of_nalgebra() {
        let mut state = 3_u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from((state >> 40) as u32) / f64::from(1 << 23) - 1.0
        };
        for case in 0..300 {
            let rows = [(); 3].map(|()| [number(), number(), if case % 3 == 0 { 0.0 } else { number() }]);
            let symmetric = product(&transposed(&rows), &rows);
            let found = axes(&symmetric);
            let flat: [f64; 9] = [symmetric[0], symmetric[1], symmetric[2]].concat().try_into().unwrap();
            let mut expected: Vec<f64> =
                SymmetricEigen::new(Matrix3::from_row_slice(&flat)).eigenvalues.iter().copied().collect();
            expected.sort_by(|a, b| b.total_cmp(a));
            for (number, direction) in found.directions.iter().enumerate() {
                assert!((found.values[number] - expected[number]).abs() < 1e-12);
                let image = apply(&symmetric, *direction);
                assert!(length(minus(image, scaled(*direction, found.values[number]))) < 1e-12);
                assert!((length(*direction) - 1.0).abs() < 1e-12);
            }
        }
    }

    extern crate std;
    use std::vec::Vec;
}
