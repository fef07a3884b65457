//! The board in a picture: which crossing is which corner.

use std::collections::BTreeMap;
use std::fmt;

use super::Seen;
use super::board::{Board, MOST};
use super::grid::{Lattice, lattices};
use super::plane::Plane;
use super::saddle::saddles;
use super::subpixel::crossing;
use super::towers::{Patch, SAMPLES, alike, is_white, normalized, sample, templates, tower_of};
use crate::picture::GrayImage;

/// Crossings are looked for in pictures reduced to at most this longer side, then in halves of that.
const FIRST_SIDE: usize = 1_600;
/// Down to this one.
const LAST_SIDE: usize = 240;
/// Towers are known if they agree with the board's at least this much, on average.
const ALIKE: f32 = 0.45;
/// And this much better than anywhere else on the board.
const CLEARLY: f32 = 0.12;
/// White squares that it takes to know the place.
const FEWEST_SQUARES: usize = 4;
/// Corners of a plain board that may be missing, as a share: a reflection, a thumb.
const MISSING: f64 = 0.15;
/// Corners with which a picture says something about the lens.
const FEWEST_CORNERS: usize = 12;
/// Half the window of the last step as a share of the distance to the next corner: within the clean part of an edge.
const WINDOW: f64 = 0.28;
/// The same where towers stand.
const WINDOW_WITH_TOWERS: f64 = 0.2;

/// A board that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundBoard {
    /// Its corners, by row and column.
    pub seen: Vec<Seen>,
    /// Whether towers said which square is which; if not, the board was complete.
    pub towers: bool,
}

/// Why there is no board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoBoard {
    /// No rows and columns of crossings.
    Nothing {
        /// Crossings of black and white without order.
        crossings: usize,
    },
    /// There is a board with another number of corners.
    OtherBoard {
        /// Inner corners, the longer side first.
        found: [u32; 2],
    },
    /// A board without towers must be whole.
    Part {
        /// Corners that were found.
        found: usize,
    },
    /// The towers are mirrored.
    Mirrored,
}

impl fmt::Display for NoBoard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing { crossings: 0 } => f.write_str("there is no chessboard in it"),
            Self::Nothing { crossings } => {
                write!(f, "there is no chessboard in it, only {crossings} places where edges cross; is it sharp?")
            }
            Self::OtherBoard { found: [columns, rows] } => {
                write!(f, "the board in it has {columns} x {rows} inner corners; is --board right?")
            }
            Self::Part { found } => {
                write!(f, "only {found} corners of the board are seen, and a board without towers must be seen whole")
            }
            Self::Mirrored => f.write_str("the picture is mirrored; switch that off in the camera"),
        }
    }
}

/// Finds the board in a picture.
///
/// # Errors
/// [`NoBoard`] with the reason.
pub fn find(gray: &GrayImage, board: &Board) -> Result<FoundBoard, NoBoard> {
    let longer = gray.width.max(gray.height);
    let first = longer.div_ceil(FIRST_SIDE).max(1);
    let mut best: Result<FoundBoard, NoBoard> = Err(NoBoard::Nothing { crossings: 0 });
    let halves = (0..8).map(|halving| first << halving).filter(|k| longer / k >= LAST_SIDE || *k == first);
    for k in halves.chain((first > 1).then_some(1)) {
        let found = in_level(gray, k, board);
        if better(&found, &best) {
            best = found;
        }
        if best.as_ref().is_ok_and(|found| found.seen.len() == board.corners()) {
            break;
        }
    }
    best
}

/// More corners are better, then the reason that tells more.
fn better(new: &Result<FoundBoard, NoBoard>, old: &Result<FoundBoard, NoBoard>) -> bool {
    let rank = |result: &Result<FoundBoard, NoBoard>| match result {
        Ok(found) => (4, found.seen.len()),
        Err(NoBoard::Mirrored) => (3, 0),
        Err(NoBoard::OtherBoard { found: [columns, rows] }) => (2, (columns * rows) as usize),
        Err(NoBoard::Part { found }) => (1, *found),
        Err(NoBoard::Nothing { crossings }) => (0, *crossings),
    };
    rank(new) > rank(old)
}

fn in_level(gray: &GrayImage, k: usize, board: &Board) -> Result<FoundBoard, NoBoard> {
    let plane = Plane::reduced(gray, k);
    let saddles = saddles(&plane);
    let mut best = Err(NoBoard::Nothing { crossings: saddles.len() });
    for lattice in lattices(&saddles) {
        let found = placed(&plane, &lattice, board).and_then(|(corners, towers)| {
            let seen = refined(gray, k, &corners, towers);
            if seen.len() < FEWEST_CORNERS.min(board.corners()) {
                return Err(NoBoard::Part { found: seen.len() });
            }
            Ok(FoundBoard { seen, towers })
        });
        if better(&found, &best) {
            best = found;
        }
    }
    best
}

type Corners = BTreeMap<[u8; 2], [f64; 2]>;

/// Where corners are to a hundredth of a pixel.
fn refined(gray: &GrayImage, k: usize, corners: &Corners, towers: bool) -> Vec<Seen> {
    let scale = |v: f64| (v + 0.5) * k as f64 - 0.5;
    let full = |at: &[f64; 2]| at.map(scale);
    let window = if towers { WINDOW_WITH_TOWERS } else { WINDOW };
    corners
        .iter()
        .filter_map(|(&[column, row], at)| {
            let at = full(at);
            let beside =
                [(column.wrapping_sub(1), row), (column + 1, row), (column, row.wrapping_sub(1)), (column, row + 1)];
            let step = beside
                .iter()
                .filter_map(|&(column, row)| {
                    let [x, y] = full(corners.get(&[column, row])?);
                    Some(libm::hypot(x - at[0], y - at[1]))
                })
                .fold(f64::INFINITY, f64::min);
            let reach = (window * step).clamp(2.5, 20.0);
            Some(Seen { corner: [column, row], at: crossing(gray, at, reach)? })
        })
        .collect()
}

/// How columns and rows of a lattice become those of the board: mirrored, if so, turned by quarters, then moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Placement {
    mirrored: bool,
    turns: usize,
    offset: (i32, i32),
}

impl Placement {
    fn turned(&self, (i, j): (i32, i32)) -> (i32, i32) {
        let first = if self.mirrored { (-i, j) } else { (i, j) };
        (0..self.turns).fold(first, |(i, j), _| (-j, i))
    }

    fn corner(&self, place: (i32, i32)) -> (i32, i32) {
        let (i, j) = self.turned(place);
        (i + self.offset.0, j + self.offset.1)
    }

    /// The square of the board between a crossing of the lattice and the next one in both directions.
    fn square(&self, (i, j): (i32, i32)) -> [i32; 2] {
        let (a, b) = (self.corner((i, j)), self.corner((i + 1, j + 1)));
        [a.0.min(b.0) + 1, a.1.min(b.1) + 1]
    }
}

/// Each crossing's corner, by towers or by the whole board; and whether by towers.
fn placed(plane: &Plane, lattice: &Lattice, board: &Board) -> Result<(Corners, bool), NoBoard> {
    let (placement, towers) = match by_towers(plane, lattice) {
        Some(placement) if placement.mirrored => return Err(NoBoard::Mirrored),
        Some(placement) => (placement, true),
        None => (whole(lattice, board)?, false),
    };
    let mut corners = Corners::new();
    let mut beyond = [0_u32; 2];
    let mut outside = 0;
    for (&place, &at) in &lattice.places {
        let (column, row) = placement.corner(place);
        beyond = [beyond[0].max(column as u32 + 1), beyond[1].max(row as u32 + 1)];
        match (u8::try_from(column), u8::try_from(row)) {
            (Ok(column), Ok(row)) if column < board.columns && row < board.rows => {
                corners.insert([column, row], at);
            }
            _ => outside += 1,
        }
    }
    if outside > strays(board) {
        return Err(NoBoard::OtherBoard { found: beyond });
    }
    Ok((corners, towers))
}

/// Crossings beside the board that may look like some of it: fewer than half a row.
fn strays(board: &Board) -> usize {
    (usize::from(board.columns.min(board.rows)) - 1) / 2
}

/// By the towers in the white squares; `None` if there are none, or too few.
fn by_towers(plane: &Plane, lattice: &Lattice) -> Option<Placement> {
    let templates = templates();
    let squares: Vec<((i32, i32), Patch)> = lattice
        .places
        .keys()
        .filter(|(i, j)| (i + j).rem_euclid(2) == 0)
        .filter_map(|&place| Some((place, patch(plane, lattice, place)?)))
        .collect();
    if squares.len() < FEWEST_SQUARES {
        return None;
    }
    let mut first: Option<(f32, Placement)> = None;
    let mut second = f32::MIN;
    for (mirrored, turns) in [false, true].into_iter().flat_map(|mirrored| (0..4).map(move |turns| (mirrored, turns))) {
        let scores: Vec<[f32; 8]> = squares
            .iter()
            .map(|(_, seen)| templates.each_ref().map(|template| alike(seen, template, turns, mirrored)))
            .collect();
        let turned = Placement { mirrored, turns, offset: (0, 0) };
        let places = lattice.places.keys().map(|&place| turned.turned(place));
        let (mut low, mut high) = ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN));
        for (i, j) in places {
            low = (low.0.min(i), low.1.min(j));
            high = (high.0.max(i), high.1.max(j));
        }
        // Up to two stray columns or rows before the board.
        for row in -2 - low.1..=i32::from(MOST) - 1 - high.1 {
            for column in -2 - low.0..=i32::from(MOST) - 1 - high.0 {
                let placement = Placement { offset: (column, row), ..turned };
                // White squares of the lattice are white ones of the board, or none is.
                if squares.first().is_none_or(|(place, _)| !is_white(placement.square(*place))) {
                    continue;
                }
                let sum: f32 = squares
                    .iter()
                    .zip(&scores)
                    .map(|((place, _), scores)| scores[tower_of(placement.square(*place))])
                    .sum();
                let score = sum / squares.len() as f32;
                if first.is_none_or(|(best, _)| score > best) {
                    second = first.map_or(second, |(best, _)| best);
                    first = Some((score, placement));
                } else {
                    second = second.max(score);
                }
            }
        }
    }
    first.filter(|(score, _)| *score > ALIKE && *score > second + CLEARLY).map(|(_, placement)| placement)
}

/// The square of the lattice from a crossing on.
fn patch(plane: &Plane, lattice: &Lattice, (i, j): (i32, i32)) -> Option<Patch> {
    let corner = |di: i32, dj: i32| lattice.places.get(&(i + di, j + dj));
    let ([a, b], [c, d]) = ([corner(0, 0)?, corner(1, 0)?], [corner(0, 1)?, corner(1, 1)?]);
    let mut values = [0.0; SAMPLES];
    for (number, value) in values.iter_mut().enumerate() {
        let [x, y] = sample(number);
        let mix =
            |axis: usize| (a[axis] * (1.0 - x) + b[axis] * x) * (1.0 - y) + (c[axis] * (1.0 - x) + d[axis] * x) * y;
        *value = plane.at(mix(0), mix(1));
    }
    normalized(values)
}

/// A whole board: every placement that fills it, the first of those with its colours.
fn whole(lattice: &Lattice, board: &Board) -> Result<Placement, NoBoard> {
    let mut found: Vec<(bool, Placement)> = Vec::new();
    let size = [i32::from(board.columns), i32::from(board.rows)];
    for turns in 0..4 {
        let turned = Placement { mirrored: false, turns, offset: (0, 0) };
        let places: Vec<(i32, i32)> = lattice.places.keys().map(|&place| turned.turned(place)).collect();
        let lows = places.iter().fold((i32::MAX, i32::MAX), |low, p| (low.0.min(p.0), low.1.min(p.1)));
        let highs = places.iter().fold((i32::MIN, i32::MIN), |high, p| (high.0.max(p.0), high.1.max(p.1)));
        let range = |low: i32, high: i32, size: i32| (-high + size - 1).min(-low)..=(-low).max(size - 1 - high);
        for row in range(lows.1, highs.1, size[1]) {
            for column in range(lows.0, highs.0, size[0]) {
                let placement = Placement { offset: (column, row), ..turned };
                if fills(&places, (column, row), board) {
                    // The square before the first corner is black, so the one after it as well; in lattices the square
                    // after (0, 0) is white.
                    found.push((is_white(placement.square((0, 0))), placement));
                }
            }
        }
    }
    let Some(&(_, any)) = found.first() else { return Err(size_of(lattice, board)) };
    // A smaller board fits into a larger one at several places.
    let shifted = found.iter().any(|(_, other)| other.turns == any.turns && other.offset != any.offset);
    if shifted {
        return Err(size_of(lattice, board));
    }
    Ok(found.iter().find(|(colours, _)| *colours).map_or(any, |(_, placement)| *placement))
}

fn fills(places: &[(i32, i32)], (column, row): (i32, i32), board: &Board) -> bool {
    let (columns, rows) = (usize::from(board.columns), usize::from(board.rows));
    let mut in_column = vec![0; columns];
    let mut in_row = vec![0; rows];
    let mut inside = 0;
    for (i, j) in places {
        let (Ok(c), Ok(r)) = (usize::try_from(i + column), usize::try_from(j + row)) else { continue };
        if let (Some(in_column), Some(in_row)) = (in_column.get_mut(c), in_row.get_mut(r)) {
            *in_column += 1;
            *in_row += 1;
            inside += 1;
        }
    }
    let enough = inside as f64 >= (1.0 - MISSING) * board.corners() as f64;
    // Two corners in each of the outer columns and rows: otherwise the board could lie beside.
    let ends = [in_column.first(), in_column.last(), in_row.first(), in_row.last()];
    enough && places.len() - inside <= strays(board) && ends.iter().all(|count| count.is_some_and(|count| *count >= 2))
}

/// What the lattice is, if not this board.
fn size_of(lattice: &Lattice, board: &Board) -> NoBoard {
    let mut columns: BTreeMap<i32, u32> = BTreeMap::new();
    let mut rows: BTreeMap<i32, u32> = BTreeMap::new();
    for (i, j) in lattice.places.keys() {
        *columns.entry(*i).or_default() += 1;
        *rows.entry(*j).or_default() += 1;
    }
    let full = |lines: &BTreeMap<i32, u32>| {
        let most = lines.values().copied().max().unwrap_or(0);
        lines.values().filter(|count| 2 * **count > most).count() as u32
    };
    // Windows and tiles make small lattices.
    if lattice.places.len() < FEWEST_CORNERS.max(board.corners() / 4) {
        return NoBoard::Nothing { crossings: lattice.places.len() };
    }
    let (a, b) = (full(&columns), full(&rows));
    let found = [a.max(b), a.min(b)];
    let told = [board.columns.max(board.rows), board.columns.min(board.rows)].map(u32::from);
    // Less than the board each way may be a part of it.
    if found[0] <= told[0] && found[1] <= told[1] {
        NoBoard::Part { found: lattice.places.len() }
    } else {
        NoBoard::OtherBoard { found }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(columns: i32, rows: i32, left_out: &[(i32, i32)]) -> Lattice {
        let all = (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j)));
        let places = all.filter(|place| !left_out.contains(place)).map(|(i, j)| ((i - 2, j - 1), [0.0; 2])).collect();
        Lattice { places }
    }

    const BOARD: Board = Board { columns: 9, rows: 6, square_mm: 25.0 };

    #[test]
    fn a_whole_board_is_placed_by_its_colours() {
        let placement = whole(&lattice(9, 6, &[]), &BOARD).expect("whole");
        assert_eq!((placement.turns % 2, is_white(placement.square((0, 0)))), (0, true));
        // The same board upside down has the colours the other way round.
        let shifted =
            Lattice { places: lattice(9, 6, &[]).places.into_iter().map(|((i, j), at)| ((i + 1, j), at)).collect() };
        let other = whole(&shifted, &BOARD).expect("whole");
        assert_eq!((other.turns + 2) % 4, placement.turns);
        let upright = whole(&lattice(6, 9, &[]), &BOARD).expect("whole");
        assert_eq!(upright.turns % 2, 1);
        for symmetric in [(8, 6), (7, 7), (5, 5), (6, 4)] {
            let board = Board { columns: symmetric.0, rows: symmetric.1, square_mm: 1.0 };
            assert!(whole(&lattice(i32::from(symmetric.0), i32::from(symmetric.1), &[]), &board).is_ok());
        }
    }

    #[test]
    fn gaps_are_forgiven_and_other_sizes_are_not() {
        assert!(whole(&lattice(9, 6, &[(0, 0), (4, 3), (8, 5)]), &BOARD).is_ok());
        assert_eq!(whole(&lattice(10, 6, &[]), &BOARD), Err(NoBoard::OtherBoard { found: [10, 6] }));
        assert_eq!(whole(&lattice(9, 7, &[]), &BOARD), Err(NoBoard::OtherBoard { found: [9, 7] }));
        assert_eq!(whole(&lattice(8, 6, &[]), &BOARD), Err(NoBoard::Part { found: 48 }));
        // A column of which one corner is left could be beside the board.
        let gone: Vec<_> = (0..5).map(|j| (0, j)).collect();
        assert!(whole(&lattice(9, 6, &gone), &BOARD).is_err());
        // A stray crossing beside the board is none of it.
        assert!(whole(&lattice(10, 6, &[(9, 0), (9, 1), (9, 3), (9, 4), (9, 5)]), &BOARD).is_ok());
    }
}
