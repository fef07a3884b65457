//! The board: a chessboard, with or without towers in its white squares.

use std::fmt;
use std::str::FromStr;

/// A chessboard, counted by its inner corners, where two black squares touch: one fewer than squares.
///
/// Frame of the board: origin at the first inner corner, x along the columns, y along the rows (down, as one reads), z into
/// the paper; millimetres. The square above and left of the first corner is black.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Inner corners in a row.
    pub columns: u8,
    /// Rows of inner corners.
    pub rows: u8,
    /// Side of a square, millimetres.
    pub square_mm: f64,
}

/// Fewest inner corners along a side.
pub const FEWEST: u8 = 3;
/// Most inner corners along a side.
pub const MOST: u8 = 40;

impl Board {
    /// Inner corners.
    pub const fn corners(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// A corner in the frame of the board.
    pub fn place(&self, [column, row]: [u8; 2]) -> [f64; 2] {
        [f64::from(column) * self.square_mm, f64::from(row) * self.square_mm]
    }

    /// The middle of the corners in the frame of the board.
    pub fn middle(&self) -> [f64; 2] {
        [f64::from(self.columns - 1) * self.square_mm / 2.0, f64::from(self.rows - 1) * self.square_mm / 2.0]
    }
}

/// How many inner corners, as in `9x6`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corners {
    /// In a row.
    pub columns: u8,
    /// Rows.
    pub rows: u8,
}

impl FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let advice = || {
            format!(
                "write inner corners as in 9x6, one fewer than squares each way, from {FEWEST}x{FEWEST} to {MOST}x{MOST}"
            )
        };
        let (columns, rows) = text.split_once(['x', 'X']).ok_or_else(advice)?;
        let count = |text: &str| text.trim().parse().ok().filter(|n| (FEWEST..=MOST).contains(n)).ok_or_else(advice);
        Ok(Self { columns: count(columns)?, rows: count(rows)? })
    }
}

impl fmt::Display for Corners {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.columns, self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_columns_by_rows() {
        assert_eq!("9x6".parse(), Ok(Corners { columns: 9, rows: 6 }));
        for wrong in ["9", "9x", "2x6", "9x41", "-9x6", "9*6", "9x6x3"] {
            assert!(wrong.parse::<Corners>().is_err(), "{wrong}");
        }
        let board = Board { columns: 9, rows: 6, square_mm: 25.0 };
        assert_eq!((board.corners(), board.place([8, 5]), board.middle()), (54, [200.0, 125.0], [100.0, 62.5]));
    }
}
