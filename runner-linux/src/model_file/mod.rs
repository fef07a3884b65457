//! Models as files: glTF 2.0 (binary), PLY and OBJ.
//!
//! A [`sheet`](sheet::sheets) is the part of a model that one view shows, with that part of its picture as the texture.

pub mod sheet;
pub mod gltf;
pub mod ply;
pub mod obj;

use std::path::Path;

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// glTF 2.0, binary (`.glb`).
    Gltf,
    /// Stanford PLY, binary (`.ply`).
    Ply,
    /// Wavefront OBJ with its material file and textures beside it (`.obj`).
    Obj,
}

impl Format {
    /// By a file's ending.
    ///
    /// # Errors
    /// What endings there are.
    pub fn of_path(path: &Path) -> Result<Self, String> {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match ending.as_str() {
            "glb" => Ok(Self::Gltf),
            "ply" => Ok(Self::Ply),
            "obj" => Ok(Self::Obj),
            _ => Err(format!("{} should end in .glb (glTF), .ply or .obj", path.display())),
        }
    }
}
