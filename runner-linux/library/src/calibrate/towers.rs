//! The towers in the white squares: which square is this, and which way is up?
//!
//! A plain chessboard tells its squares apart only if all of it is in the picture. Eight towers in its white squares tell
//! where each square is, so a part of the board is enough, and corners reach into the corners of the frame, where a lens
//! bends most. Every tower differs from the others turned or mirrored.

use super::board::Board;

/// The eight towers as outlines in a square of side 1: x right, y down. They stay a fifth away from its sides, so that the
/// crossings have clean edges around.
pub const OUTLINES: [&[[f64; 2]]; 8] = [
    // Bell tower: a spire, and a nave beside it.
    &[[0.22, 0.80], [0.22, 0.40], [0.36, 0.20], [0.50, 0.40], [0.50, 0.60], [0.80, 0.60], [0.80, 0.80]],
    // Exchange: a storey set back to the left.
    &[[0.20, 0.80], [0.20, 0.24], [0.52, 0.24], [0.52, 0.44], [0.80, 0.44], [0.80, 0.80]],
    // Water tower: a tank on a leg that stands aside, and a pump house.
    &[[0.60, 0.80], [0.60, 0.50], [0.20, 0.50], [0.20, 0.20], [0.80, 0.20], [0.80, 0.50], [0.72, 0.50], [0.72, 0.80]],
    // Guild house: a gable, and a gate on the right.
    &[
        [0.20, 0.80],
        [0.20, 0.48],
        [0.50, 0.20],
        [0.80, 0.48],
        [0.80, 0.80],
        [0.74, 0.80],
        [0.74, 0.56],
        [0.50, 0.56],
        [0.50, 0.80],
    ],
    // Hotel: a slab on the left.
    &[[0.20, 0.80], [0.20, 0.20], [0.36, 0.20], [0.36, 0.72], [0.80, 0.72], [0.80, 0.80]],
    // Office: two slabs and a bridge between.
    &[
        [0.20, 0.80],
        [0.20, 0.20],
        [0.32, 0.20],
        [0.32, 0.34],
        [0.58, 0.34],
        [0.58, 0.20],
        [0.80, 0.20],
        [0.80, 0.80],
        [0.58, 0.80],
        [0.58, 0.48],
        [0.32, 0.48],
        [0.32, 0.80],
    ],
    // Keep: low walls, one turret aside.
    &[
        [0.20, 0.80],
        [0.20, 0.50],
        [0.34, 0.50],
        [0.34, 0.64],
        [0.50, 0.64],
        [0.50, 0.20],
        [0.66, 0.20],
        [0.66, 0.64],
        [0.80, 0.64],
        [0.80, 0.80],
    ],
    // Chapel: one steep roof.
    &[[0.20, 0.80], [0.20, 0.30], [0.80, 0.62], [0.80, 0.80]],
];

/// Samples along a side of a square.
pub(super) const SIDE: usize = 14;
/// Numbers of a sampled square.
pub(super) const SAMPLES: usize = SIDE * SIDE;

/// What a square looks like, with mean 0 and length 1.
pub(super) type Patch = [f32; SAMPLES];

/// Which tower stands in a white square of the board, counted from the top left one. The same for boards of all sizes.
pub fn tower_of([column, row]: [i32; 2]) -> usize {
    let mut hash = (column as u32).wrapping_mul(0x9E37_79B1) ^ (row as u32).wrapping_mul(0x85EB_CA77) ^ 0x5F96;
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
    (hash >> 29) as usize
}

/// Whether a square of the board is white; those around the corners of an edge belong to the board too.
pub(super) fn is_white([column, row]: [i32; 2]) -> bool {
    (column + row).rem_euclid(2) == 1
}

/// Whether a point of the unit square lies in an outline, by the number of sides to its left.
pub(super) fn holds(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut inside = false;
    for (number, &[ax, ay]) in outline.iter().enumerate() {
        let [bx, by] = outline[(number + 1) % outline.len()];
        if (ay > y) != (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax {
            inside = !inside;
        }
    }
    inside
}

/// Where sample `number` lies in the square, from 0 to 1. The outermost eighth is left out: it belongs to the edges.
pub(super) fn sample(number: usize) -> [f64; 2] {
    let along = |n: usize| 0.125 + 0.75 * (n as f64 + 0.5) / SIDE as f64;
    [along(number % SIDE), along(number / SIDE)]
}

/// Takes away mean and length; `None` for a square without a picture in it.
pub(super) fn normalized(mut values: Patch) -> Option<Patch> {
    let mean = values.iter().sum::<f32>() / SAMPLES as f32;
    for value in &mut values {
        *value -= mean;
    }
    let squares = values.iter().map(|value| value * value).sum::<f32>();
    // Three gray levels of deviation.
    if !(squares > 9.0 * SAMPLES as f32) {
        return None;
    }
    let scale = 1.0 / libm::sqrtf(squares);
    for value in &mut values {
        *value *= scale;
    }
    Some(values)
}

/// The eight towers upright, as squares of a picture.
pub(super) fn templates() -> [Patch; 8] {
    OUTLINES.map(|outline| {
        let mut values = [0.0; SAMPLES];
        for (number, value) in values.iter_mut().enumerate() {
            *value = if holds(outline, sample(number)) { 0.0 } else { 255.0 };
        }
        normalized(values).unwrap_or([0.0; SAMPLES])
    })
}

/// How alike two squares are, the first one mirrored left to right, if so, and then turned by `turns` quarters (from +x
/// towards +y): from -1 to 1.
pub(super) fn alike(seen: &Patch, template: &Patch, turns: usize, mirrored: bool) -> f32 {
    let mut sum = 0.0;
    for (number, value) in seen.iter().enumerate() {
        let (mut column, mut row) = (number % SIDE, number / SIDE);
        if mirrored {
            column = SIDE - 1 - column;
        }
        for _ in 0..turns {
            (column, row) = (SIDE - 1 - row, column);
        }
        sum += value * template[row * SIDE + column];
    }
    sum
}

/// The white squares of a board with their towers.
pub fn towers(board: &Board) -> impl Iterator<Item = ([i32; 2], usize)> + use<> {
    let (columns, rows) = (i32::from(board.columns) + 1, i32::from(board.rows) + 1);
    (0..rows)
        .flat_map(move |row| (0..columns).map(move |column| [column, row]))
        .filter(|square| is_white(*square))
        .map(|square| (square, tower_of(square)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_tower_is_like_another_however_it_is_turned() {
        let templates = templates();
        for (a, one) in templates.iter().enumerate() {
            assert!((alike(one, one, 0, false) - 1.0).abs() < 1e-5);
            for (b, other) in templates.iter().enumerate() {
                for turns in 0..4 {
                    for mirrored in [false, true] {
                        let alike = alike(one, other, turns, mirrored);
                        let same = a == b && turns == 0 && !mirrored;
                        assert!(same || alike < 0.8, "{a} and {b}, {turns} turns, mirrored {mirrored}: {alike}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_window_of_the_arrangement_is_there_once() {
        // Three by three squares have four or five white ones.
        for colour in 0..2 {
            let mut seen = BTreeSet::new();
            for row in 0..20 {
                for column in 0..20 {
                    if (column + row) % 2 == colour {
                        let window: Vec<usize> = (0..9)
                            .map(|k| [column + k % 3, row + k / 3])
                            .filter(|square| is_white(*square))
                            .map(tower_of)
                            .collect();
                        assert!(seen.insert(window), "{column} {row}");
                    }
                }
            }
        }
    }

    #[test]
    fn towers_stand_in_white_squares_and_differ_from_their_neighbours_mostly() {
        let board = Board { columns: 9, rows: 6, square_mm: 25.0 };
        let all: Vec<_> = towers(&board).collect();
        assert_eq!(all.len(), 35);
        let kinds: BTreeSet<usize> = all.iter().map(|tower| tower.1).collect();
        assert_eq!(kinds.len(), 8, "{kinds:?}");
    }
}
