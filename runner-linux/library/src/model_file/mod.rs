//! Models as files: glTF 2.0 (binary), PLY and OBJ.
//!
//! A [`sheet`](sheet::sheets) is the part of a model that one view shows, with that part of its picture as the texture.

pub mod points;
pub mod sheet;
pub mod gltf;
pub mod ply;
pub mod obj;

use std::path::Path;

use points::Points;

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

/// Reads the points of a model's file: PLY, binary glTF, or OBJ with its material file and textures beside it.
///
/// # Errors
/// What is wrong with the file.
pub fn read(path: &Path) -> Result<Points, String> {
    let format = Format::of_path(path)?;
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    match format {
        Format::Ply => ply::read(&bytes),
        Format::Gltf => gltf::read(&bytes),
        Format::Obj => {
            let beside = |name: &str| {
                // Names are of files beside it, and lead nowhere else.
                let name = Path::new(name).file_name().ok_or_else(|| format!("{name:?} names no file"))?;
                std::fs::read(path.with_file_name(name)).map_err(|error| format!("{}: {error}", name.display()))
            };
            obj::read(&bytes, beside)
        }
    }
}
