//! Several fixes of one observer: which agree, and what they say together.
//!
//! Fixes are combined by their covariances. If they contradict each other (chi-square, 99.9 %), the one without which the rest agrees best is
//! left out and named, and so on: an answer about the wrong building lies far from the others.

use heapless::Vec;

use super::geodesy::LocalFrame;
use super::{Evidence, Fix};
use crate::camera::space::{Matrix, Vector};
use crate::linear::NormalEquations;

/// 99.9 % of chi-square with 3, 6, 9, ... degrees of freedom.
const CHI_SQUARE: [f64; 8] = [16.266, 22.458, 27.877, 32.909, 37.697, 42.312, 46.797, 51.179];
/// Fixes, at most.
pub const MOST_FIXES: usize = CHI_SQUARE.len() + 1;

/// What fixes say together.
#[derive(Debug, Clone, PartialEq)]
pub struct Combined {
    /// The position, with bearing, range and heading of the first fix that agrees.
    pub fix: Fix,
    /// Numbers of the fixes that contradict the others, in the order in which they were left out.
    pub left_out: Vec<usize, MOST_FIXES>,
    /// Squared deviations between those that agree.
    pub chi_square: f64,
}

/// Why fixes give no common one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoAgreement {
    /// There is none.
    Empty,
    /// More than [`MOST_FIXES`].
    TooMany {
        /// Fixes.
        found: usize,
    },
    /// Two fixes contradict each other, and nothing says which is wrong.
    Contradiction,
    /// A covariance that has no inverse.
    Degenerate,
}

impl core::fmt::Display for NoAgreement {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => f.write_str("no fixes"),
            Self::TooMany { found } => write!(f, "{found} fixes, there is room for {MOST_FIXES}"),
            Self::Contradiction => f.write_str("two fixes contradict each other, and nothing says which is wrong"),
            Self::Degenerate => f.write_str("a fix whose covariance has no inverse"),
        }
    }
}

impl core::error::Error for NoAgreement {}

/// A position with its inverse covariance.
#[derive(Debug, Clone, Copy)]
struct Weighted {
    number: usize,
    at: Vector,
    information: Matrix,
}

/// The common fix of fixes from one place.
///
/// # Errors
/// [`NoAgreement`].
pub fn combine(fixes: &[Fix]) -> Result<Combined, NoAgreement> {
    let Some(first) = fixes.first() else { return Err(NoAgreement::Empty) };
    let frame = LocalFrame::new(first.position);
    let mut rest: Vec<Weighted, MOST_FIXES> = Vec::new();
    for (number, fix) in fixes.iter().enumerate() {
        let information = inverse(&fix.covariance).ok_or(NoAgreement::Degenerate)?;
        let weighted = Weighted { number, at: frame.local_from_wgs84(fix.position), information };
        rest.push(weighted).map_err(|_| NoAgreement::TooMany { found: fixes.len() })?;
    }
    let mut left_out = Vec::new();
    loop {
        let (mean, covariance, chi_square) = weigh(&rest, None).ok_or(NoAgreement::Degenerate)?;
        let limit = rest.len().checked_sub(2).and_then(|pairs| CHI_SQUARE.get(pairs));
        if limit.is_none_or(|limit| chi_square <= *limit) {
            let named = rest.first().and_then(|one| fixes.get(one.number)).unwrap_or(first);
            let evidence = if rest.len() > 1 { Evidence::Fixes { count: rest.len() } } else { named.evidence };
            let fix = Fix { position: frame.wgs84_from_local(mean), covariance, evidence, ..*named };
            return Ok(Combined { fix, left_out, chi_square });
        }
        if rest.len() == 2 {
            return Err(NoAgreement::Contradiction);
        }
        // The one without which the others agree best.
        let mut worst = (0, f64::INFINITY);
        for skipped in 0..rest.len() {
            if let Some((_, _, left)) = weigh(&rest, Some(skipped))
                && left < worst.1
            {
                worst = (skipped, left);
            }
        }
        let number = rest.get(worst.0).map_or(0, |one| one.number);
        rest.retain(|one| one.number != number);
        // No more are left out than there are.
        let _ = left_out.push(number);
    }
}

/// Weighted mean, its covariance, and the squared deviations from it.
fn weigh(fixes: &[Weighted], skipped: Option<usize>) -> Option<(Vector, Matrix, f64)> {
    let taken = || fixes.iter().enumerate().filter(move |(place, _)| Some(*place) != skipped).map(|(_, fix)| fix);
    let mut equations = NormalEquations::<3>::new();
    let mut sum = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for fix in taken() {
        for ((row, r), line) in sum.iter_mut().zip(&mut right).zip(&fix.information) {
            for ((entry, weight), x) in row.iter_mut().zip(line).zip(fix.at) {
                *entry += weight;
                *r += weight * x;
            }
        }
    }
    equations.set_left(sum);
    equations.set_right(right);
    let mean = *equations.solve()?;
    let covariance = inverse(&sum)?;
    let squares = taken().fold(0.0, |squares, fix| {
        let off = crate::camera::space::minus(fix.at, mean);
        squares + crate::camera::space::dot(off, crate::camera::space::apply(&fix.information, off))
    });
    Some((mean, covariance, squares))
}

/// Of a symmetric positive matrix; `None` if it is not.
pub(super) fn inverse(matrix: &Matrix) -> Option<Matrix> {
    let mut inverse = [[0.0; 3]; 3];
    for (number, row) in inverse.iter_mut().enumerate() {
        let mut equations = NormalEquations::<3>::new();
        equations.set_left(*matrix);
        let mut one = [0.0; 3];
        *one.get_mut(number)? = 1.0;
        equations.set_right(one);
        *row = *equations.solve()?;
    }
    inverse.as_flattened().iter().all(|entry| entry.is_finite()).then_some(inverse)
}
