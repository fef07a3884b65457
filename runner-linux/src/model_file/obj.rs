//! Wavefront OBJ with a material file and one texture for each view.

use std::fmt::Write as _;

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
