//! Wavefront OBJ with a material file and one texture for each view.

use std::collections::HashMap;
use std::fmt::Write as _;

use super::points::{Points, Texture};
use super::sheet::Sheet;
use crate::synthesize::dense::DenseCloud;

/// The files: name and bytes, the OBJ file last, so that whoever finds it finds the others.
///
/// `stem` is the common part of the names, without ending.
pub fn files(cloud: &DenseCloud, sheets: &[Sheet], stem: &str, comments: &[String]) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let (mut object, mut material) = (String::new(), String::new());
    // Writing to a string cannot fail.
    for comment in comments {
        let _ = writeln!(object, "# {}", comment.replace(|c: char| c.is_control(), " "));
    }
    let _ = writeln!(object, "mtllib {stem}.mtl");
    for [x, y, z] in &cloud.positions {
        let _ = writeln!(object, "v {x} {y} {z}");
    }
    let mut before = 1;
    for sheet in sheets {
        let name = sheet.view.map_or_else(|| "unseen".to_owned(), |view| format!("view-{}", view + 1));
        let _ = writeln!(material, "newmtl {name}\nKa 1 1 1\nKd 1 1 1\nillum 0");
        if !sheet.jpeg.is_empty() {
            let picture = format!("{stem}-{name}.jpg");
            let _ = writeln!(material, "map_Kd {picture}");
            files.push((picture, sheet.jpeg.clone()));
        }
        // Texture coordinates count from the lower left corner.
        for [u, v] in &sheet.uv {
            let _ = writeln!(object, "vt {u} {}", 1.0 - v);
        }
        let _ = writeln!(object, "usemtl {name}");
        for triangle in &sheet.triangles {
            let [a, b, c] = triangle.map(|index| format!("{}/{}", sheet.points[index as usize] + 1, index + before));
            let _ = writeln!(object, "f {a} {b} {c}");
        }
        before += sheet.uv.len() as u32;
    }
    files.push((format!("{stem}.mtl"), material.into_bytes()));
    files.push((format!("{stem}.obj"), object.into_bytes()));
    files
}

/// Reads the points of an OBJ file that faces have, with the gray levels of its textures; `beside` reads a file by name.
///
/// # Errors
/// What is wrong with the file, or with those that it names.
pub fn read(bytes: &[u8], beside: impl Fn(&str) -> Result<Vec<u8>, String>) -> Result<Points, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
    let mut textures: HashMap<String, Texture> = HashMap::new();
    let mut texture: Option<&str> = None;
    let (mut positions, mut uv): (Vec<[f32; 3]>, Vec<[f32; 2]>) = (Vec::new(), Vec::new());
    // Sum and count of the gray levels of each point's corners, and whether a face has it.
    let mut seen: Vec<(f64, u32, bool)> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let wrong = |what: &str| format!("line {number}: {what}");
        let mut words = line.split_ascii_whitespace();
        let rest = line.trim().split_once(char::is_whitespace).map(|(_, rest)| rest.trim());
        match words.next() {
            Some("v") => {
                positions.push(numbers(words).ok_or_else(|| wrong("a point is not three numbers"))?);
                seen.push((0.0, 0, false));
            }
            Some("vt") => uv.push(numbers(words).ok_or_else(|| wrong("a texture coordinate is not two numbers"))?),
            Some("mtllib") => {
                let name = rest.ok_or_else(|| wrong("the material file has no name"))?;
                textures.extend(materials(&beside(name)?, &beside)?);
            }
            Some("usemtl") => texture = rest,
            Some("f") => {
                for corner in words {
                    let mut parts = corner.split('/').map(str::parse::<i64>);
                    let count_back = |index: i64, length: usize| {
                        // Numbers begin at one; negative ones count from the end.
                        let place = if index < 0 { length as i64 + index } else { index - 1 };
                        usize::try_from(place).ok().filter(|place| *place < length)
                    };
                    let point = parts.next().and_then(Result::ok).and_then(|index| count_back(index, positions.len()));
                    let entry = point.and_then(|point| seen.get_mut(point));
                    let entry = entry.ok_or_else(|| wrong("a face has a corner that is no point"))?;
                    entry.2 = true;
                    let at = parts.next().and_then(Result::ok).and_then(|index| count_back(index, uv.len()));
                    let texture = texture.and_then(|name| textures.get(name));
                    if let (Some(at), Some(texture)) = (at.and_then(|at| uv.get(at)), texture) {
                        // Texture coordinates count from the lower left corner.
                        let gray = texture.gray_at([at[0], 1.0 - at[1]]);
                        (entry.0, entry.1) = (entry.0 + f64::from(gray), entry.1 + 1);
                    }
                }
            }
            _ => {}
        }
    }
    // A file without faces is a cloud.
    let all = seen.iter().all(|(.., has_face)| !has_face);
    let mut points = Points::default();
    for (position, (sum, count, has_face)) in positions.into_iter().zip(seen) {
        if all || has_face {
            points.positions.push(position);
            points.gray.push(if count > 0 { (sum / f64::from(count)) as f32 } else { f32::NAN });
            points.deviations.push(0.0);
        }
    }
    if points.positions.is_empty() { Err("it has no points".to_owned()) } else { Ok(points) }
}

fn numbers<'w, const N: usize>(mut words: impl Iterator<Item = &'w str>) -> Option<[f32; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    Some(numbers)
}

/// The textures of a material file, by the names of the materials.
fn materials(
    bytes: &[u8],
    beside: &impl Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Vec<(String, Texture)>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "its material file is not text".to_owned())?;
    let mut found = Vec::new();
    let mut name = "";
    for line in text.lines() {
        match line.trim().split_once(char::is_whitespace) {
            Some(("newmtl", material)) => name = material.trim(),
            Some(("map_Kd", file)) => found.push((name.to_owned(), Texture::decode(&beside(file.trim())?)?)),
            _ => {}
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_faces_have_the_gray_levels_of_their_corners() {
        let mut picture = Vec::new();
        image::GrayImage::from_fn(4, 4, |x, _| image::Luma([if x < 2 { 51 } else { 204 }]))
            .write_to(&mut std::io::Cursor::new(&mut picture), image::ImageFormat::Png)
            .unwrap();
        let beside = |name: &str| match name {
            "a.mtl" => Ok(b"newmtl wall\nmap_Kd wall.png\n".to_vec()),
            "wall.png" => Ok(picture.clone()),
            other => Err(format!("{other} is not there")),
        };
        let text = "mtllib a.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nv 0 0 0\nvt 0 0\nvt 1 0\nusemtl wall\nf 1/1 -3/2 3\n";
        let points = read(text.as_bytes(), beside).unwrap();
        // The fourth point belongs to no face, the third corner has no texture coordinate.
        assert_eq!(points.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
        assert_eq!(points.gray[..2], [0.2, 0.8]);
        assert!(points.gray[2].is_nan());
        let lost = read(text.replace("a.mtl", "b.mtl").as_bytes(), beside).unwrap_err();
        assert!(lost.contains("b.mtl is not there"), "{lost}");
        assert!(read(text.replace("-3/2", "9/2").as_bytes(), beside).unwrap_err().contains("line 9"));
        assert!(read(b"solid", beside).is_err());
    }
}
