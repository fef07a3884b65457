//! Corners picked by hand: one file a picture, one line a corner.
//!
//! `number,x,y` in pixels of the picture (origin at the centre of the top-left pixel); the same number is the same corner of
//! the building in every picture. Lines that begin with `#` and a heading are passed over.

use std::collections::BTreeMap;

/// Reads the text of a file.
///
/// # Errors
/// The line that is wrong, and how.
pub fn parse(text: &str) -> Result<BTreeMap<u32, [f64; 2]>, String> {
    let mut corners = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') || (number == 1 && line.starts_with(|c: char| c.is_alphabetic())) {
            continue;
        }
        let words: Vec<&str> = line.split([',', ';', '\t', ' ']).filter(|word| !word.is_empty()).collect();
        let corner = match words.as_slice() {
            [corner, x, y] => corner.parse::<u32>().ok().zip(x.parse::<f64>().ok().zip(y.parse::<f64>().ok())),
            _ => None,
        };
        let Some((corner, (x, y))) = corner.filter(|(_, (x, y))| x.is_finite() && y.is_finite()) else {
            return Err(format!("line {number} is not \"number,x,y\""));
        };
        if corners.insert(corner, [x, y]).is_some() {
            return Err(format!("line {number} has corner {corner} a second time"));
        }
    }
    if corners.is_empty() { Err("it has no corners".to_owned()) } else { Ok(corners) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_what_are_none() {
        let corners = parse("number,x,y\n# by hand\n1,10.5,20\n7; 3 ;4\n\n").unwrap();
        assert_eq!(corners, BTreeMap::from([(1, [10.5, 20.0]), (7, [3.0, 4.0])]));
        assert!(parse("1,2,3\n1,2,3").unwrap_err().contains("line 2 has corner 1 a second time"));
        assert!(parse("1,2,3\nx,2,3").unwrap_err().contains("line 2"));
        assert!(parse("1,2,NaN").is_err());
        assert!(parse("").unwrap_err().contains("no corners"));
    }
}
