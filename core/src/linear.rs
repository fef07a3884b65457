//! Weighted linear least squares in a few unknowns: normal equations, solved in place by Cholesky.
//!
//! `f64` with `+ - * /` and one square root a column, in a fixed order; no copies of the matrix, and no index that could
//! fail.

use crate::math::sqrt_f64;

/// The normal equations of a least-squares problem, added up equation by equation.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalEquations<const UNKNOWNS: usize> {
    /// The lower triangle, row by row; what is above the diagonal stays zero.
    lower: [[f64; UNKNOWNS]; UNKNOWNS],
    right: [f64; UNKNOWNS],
}

impl<const UNKNOWNS: usize> NormalEquations<UNKNOWNS> {
    /// No equations yet.
    pub const fn new() -> Self {
        Self { lower: [[0.0; UNKNOWNS]; UNKNOWNS], right: [0.0; UNKNOWNS] }
    }

    /// Adds the equation `coefficients * unknowns = value` with a weight.
    pub fn add(&mut self, coefficients: &[f64; UNKNOWNS], value: f64, weight: f64) {
        let rows = self.lower.iter_mut().zip(&mut self.right).zip(coefficients).enumerate();
        for (number, ((row, right), coefficient)) in rows {
            let weighted = coefficient * weight;
            for (sum, other) in row.iter_mut().zip(coefficients).take(number + 1) {
                *sum += weighted * other;
            }
            *right += weighted * value;
        }
    }

    /// Pulls one unknown towards zero.
    pub fn add_ridge(&mut self, unknown: usize, ridge: f64) {
        if let Some(diagonal) = self.lower.get_mut(unknown).and_then(|row| row.get_mut(unknown)) {
            *diagonal += ridge;
        }
    }

    /// The unknowns; `None` if the equations do not determine them, or hold a NaN. The solution takes the equations'
    /// place, so that nothing is copied: they are of no use afterwards.
    pub fn solve(&mut self) -> Option<&[f64; UNKNOWNS]> {
        // L L^T = A, row by row: of each row first what is left of the diagonal, by the finished rows above.
        for number in 0..UNKNOWNS {
            let (finished, rest) = self.lower.split_at_mut_checked(number)?;
            let row = rest.first_mut()?;
            for (column, above) in finished.iter().enumerate() {
                let (left, right) = row.split_at_mut_checked(column)?;
                let entry = right.first_mut()?;
                for (a, b) in left.iter().zip(above) {
                    *entry -= b * a;
                }
                *entry /= above.get(column)?;
            }
            let (left, right) = row.split_at_mut_checked(number)?;
            let diagonal = right.first_mut()?;
            for a in left {
                *diagonal -= *a * *a;
            }
            if !(*diagonal > 0.0) {
                return None;
            }
            *diagonal = sqrt_f64(*diagonal);
        }
        // L y = right, then L^T x = y.
        for number in 0..UNKNOWNS {
            let (known, rest) = self.right.split_at_mut_checked(number)?;
            let (row, value) = (self.lower.get(number)?, rest.first_mut()?);
            for (y, a) in known.iter().zip(row) {
                *value -= y * a;
            }
            *value /= row.get(number)?;
        }
        for number in (0..UNKNOWNS).rev() {
            let (rest, known) = self.right.split_at_mut_checked(number + 1)?;
            let value = rest.last_mut()?;
            let mut sum = 0.0;
            for (x, below) in known.iter().zip(self.lower.iter().skip(number + 1)) {
                sum += below.get(number)? * x;
            }
            *value = (*value - sum) / self.lower.get(number)?.get(number)?;
        }
        Some(&self.right)
    }

    /// After [`Self::solve`]: the least share of an unknown's own weight that the unknowns before it leave, 0..=1. It is 1 for
    /// independent unknowns and about 1e-15 where rounding alone kept the equations from being singular.
    pub fn determinacy(&self) -> f64 {
        let mut least = 1.0;
        for (number, row) in self.lower.iter().enumerate() {
            let own = row.get(number).map_or(0.0, |diagonal| diagonal * diagonal);
            let all = row.iter().fold(0.0, |sum, entry| sum + entry * entry);
            if !(own >= least * all) {
                least = own / all;
            }
        }
        least
    }
}

impl<const UNKNOWNS: usize> Default for NormalEquations<UNKNOWNS> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    /// Numbers in -1..1 by a linear congruence.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 7_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from((state >> 40) as u32) / f64::from(1 << 23) - 1.0
        }
    }

    #[test]
    fn bits_are_those_of_nalgebra() {
        let mut number = numbers();
        for _ in 0..500 {
            let mut equations = NormalEquations::<8>::new();
            let (mut matrix, mut right) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
            for _ in 0..12 {
                let (row, value, weight) = ([(); 8].map(|()| number()), number(), number() + 1.0);
                equations.add(&row, value, weight);
                let weighted = SVector::from(row) * weight;
                matrix += weighted * SVector::from(row).transpose();
                right += weighted * value;
            }
            equations.add_ridge(7, 0.02);
            matrix[(7, 7)] += 0.02;
            let expected: [f64; 8] = matrix.cholesky().unwrap().solve(&right).into();
            assert_eq!(equations.solve().unwrap().map(f64::to_bits), expected.map(f64::to_bits));
        }
    }

    #[test]
    fn how_well_unknowns_are_told_apart() {
        let mut equations = NormalEquations::<2>::new();
        equations.add(&[3.0, 0.0], 1.0, 1.0);
        equations.add(&[0.0, 5.0], 1.0, 1.0);
        assert!(equations.solve().is_some());
        assert_eq!(equations.determinacy(), 1.0);
        // The second unknown's column is (1, 1, 0) against (1, 0, 0): half of its weight is its own.
        let mut equations = NormalEquations::<2>::new();
        equations.add(&[1.0, 1.0], 1.0, 1.0);
        equations.add(&[0.0, 1.0], 1.0, 1.0);
        assert!(equations.solve().is_some());
        assert_eq!(equations.determinacy(), 0.5);
    }

    #[test]
    fn what_is_not_determined_is_not_solved() {
        let mut equations = NormalEquations::<2>::new();
        assert_eq!(equations.clone().solve(), None);
        equations.add(&[2.0, 0.0], 6.0, 1.0);
        assert_eq!(equations.clone().solve(), None);
        equations.add(&[0.0, 1.0], 5.0, 4.0);
        assert_eq!(equations.clone().solve(), Some(&[3.0, 5.0]));
        equations.add(&[f64::NAN, 1.0], 1.0, 2.0);
        assert_eq!(equations.solve(), None);
    }
}
