//! The board to print or to show: a chessboard with the eight towers in its white squares.

use std::fmt::Write as _;

use super::board::Board;
use super::towers::{OUTLINES, holds, is_white, tower_of, towers};
use crate::picture::GrayImage;

/// White around the board, in squares: crossings need it, and lines of text below.
const MARGIN: f64 = 0.5;
/// Room for the ruler and the text, millimetres.
const FOOT_MM: f64 = 14.0;
/// A screen, pixels.
const SCREEN: [usize; 2] = [1_920, 1_080];
/// Parts of a pixel's side that are looked at.
const PARTS: usize = 4;

/// The board as SVG in millimetres, with a ruler that shows whether the printer kept the size.
pub fn svg(board: &Board) -> String {
    let square = board.square_mm;
    let margin = MARGIN * square;
    let [across, down] = [board.columns, board.rows].map(|corners| (f64::from(corners) + 1.0) * square);
    let (width, height) = (across + 2.0 * margin, down + 2.0 * margin + FOOT_MM);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
         <title>daymark board {} x {}, squares of {square} mm</title>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n<g fill=\"#000\" transform=\"translate({margin} {margin}) \
         scale({square})\">\n",
        board.columns, board.rows
    );
    // One path, so that no line shows between squares that touch.
    svg.push_str("<path d=\"");
    for row in 0..=i32::from(board.rows) {
        for column in (0..=i32::from(board.columns)).filter(|column| !is_white([*column, row])) {
            // Writing to a string cannot fail.
            let _ = write!(svg, "M{column} {row}h1v1h-1z");
        }
    }
    svg.push_str("\"/>\n");
    for ([column, row], tower) in towers(board) {
        let _ = write!(svg, "<path transform=\"translate({column} {row})\" d=\"");
        for (number, [x, y]) in OUTLINES[tower].iter().enumerate() {
            let _ = write!(svg, "{}{x} {y}", if number == 0 { 'M' } else { 'L' });
        }
        svg.push_str("z\"/>\n");
    }
    let ruler = if across >= 100.0 { 100.0 } else { libm::floor(across / 10.0).max(1.0) * 10.0 };
    let at = down + 2.0 * margin;
    let _ = write!(
        svg,
        "</g>\n<path d=\"M{margin} {at}v4m0 -2h{ruler}m0 -2v4\" fill=\"none\" stroke=\"#000\" stroke-width=\"0.2\"/>\n\
         <text x=\"{margin}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"3.2\">{ruler} mm if printed at full size. \
         daymark calibrate --board {}x{} --square-mm {square}</text>\n</svg>\n",
        at + 9.0,
        board.columns,
        board.rows
    );
    svg
}

/// The board in pixels as large as a screen of 1920 x 1080 can show it; edges between pixels are gray.
pub fn picture(board: &Board) -> GrayImage {
    let sides = |corners: u8| f64::from(corners) + 1.0 + 2.0 * MARGIN;
    let [columns, rows] = [sides(board.columns), sides(board.rows)];
    // Even, so that all edges lie between pixels.
    let square = 2.0 * libm::floor((SCREEN[0] as f64 / columns).min(SCREEN[1] as f64 / rows) / 2.0).max(4.0);
    let [width, height] = [columns, rows].map(|squares| libm::round(squares * square) as usize);
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let mut white = 0;
            for part in 0..PARTS * PARTS {
                let place = |pixel: usize, part: usize| {
                    (pixel as f64 + (part as f64 + 0.5) / PARTS as f64) / square - MARGIN - 1.0
                };
                white += usize::from(is_light(board, [place(x, part % PARTS), place(y, part / PARTS)], true));
            }
            pixels.push((white * 255 / (PARTS * PARTS)) as u8);
        }
    }
    GrayImage { pixels, width, height }
}

/// Whether the board is white at a point; in squares from its first inner corner. With towers, or plain.
pub fn is_light(board: &Board, [x, y]: [f64; 2], with_towers: bool) -> bool {
    let (column, row) = (libm::floor(x) + 1.0, libm::floor(y) + 1.0);
    let inside = |at: f64, corners: u8| at >= 0.0 && at <= f64::from(corners);
    if !inside(column, board.columns) || !inside(row, board.rows) {
        return true;
    }
    let square = [column as i32, row as i32];
    is_white(square) && !(with_towers && holds(OUTLINES[tower_of(square)], [x + 1.0 - column, y + 1.0 - row]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::find;

    #[test]
    fn the_picture_of_the_board_is_found_with_every_corner() {
        let board = Board { columns: 9, rows: 6, square_mm: 25.0 };
        let picture = picture(&board);
        assert!(picture.width <= 1_920 && picture.height <= 1_080);
        let found = find(&picture, &board).expect("a board");
        assert!(found.towers && found.seen.len() == 54);
        let square = (found.seen[1].at[1] - found.seen[0].at[1]).round();
        for seen in found.seen {
            let expected = seen.corner.map(|at| (f64::from(at) + 1.0 + MARGIN) * square - 0.5);
            let off = (seen.at[0] - expected[0]).abs().max((seen.at[1] - expected[1]).abs());
            assert!(off < 0.02, "{seen:?} {expected:?}");
        }
    }

    #[test]
    fn the_drawing_has_all_squares_and_towers() {
        let svg = svg(&Board { columns: 9, rows: 6, square_mm: 25.0 });
        assert!(svg.starts_with("<svg") && svg.contains("width=\"275mm\" height=\"214mm\""), "{}", &svg[..120]);
        assert_eq!((svg.matches("h1v1h-1z").count(), svg.matches("<path transform").count()), (35, 35));
        assert!(svg.contains("100 mm if printed"));
    }
}
