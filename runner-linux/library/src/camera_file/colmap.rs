//! COLMAP models: `cameras` and `images` as text or binary (COLMAP, "Output Format"). Points are not read.
//!
//! COLMAP puts the first pixel's centre at (0.5, 0.5); here it is (0, 0).

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::distortion::Distortion;
use super::lens::Pose;
use super::{CameraFileError, FileCamera, read};

/// The cameras of all pictures of a model: the text files of a folder, or the binary ones.
///
/// # Errors
/// [`CameraFileError`].
pub fn folder(path: &Path) -> Result<Vec<FileCamera>, CameraFileError> {
    let file = |name: &str| path.join(name);
    let (cameras, images, binary) = if file("cameras.bin").is_file() && file("images.bin").is_file() {
        (file("cameras.bin"), file("images.bin"), true)
    } else if file("cameras.txt").is_file() && file("images.txt").is_file() {
        (file("cameras.txt"), file("images.txt"), false)
    } else {
        return Err(CameraFileError::new(
            path,
            "the folder has neither cameras.bin and images.bin nor cameras.txt and images.txt",
        ));
    };
    let (camera_bytes, image_bytes) = (read(&cameras)?, read(&images)?);
    let lenses = if binary { binary_cameras(&camera_bytes) } else { text_cameras(&camera_bytes) };
    let lenses = lenses.map_err(|what| CameraFileError::new(&cameras, what))?;
    let shots = if binary { binary_images(&image_bytes) } else { text_images(&image_bytes) };
    let shots = shots.map_err(|what| CameraFileError::new(&images, what))?;
    shots
        .into_iter()
        .map(|shot| {
            let lens = lenses.get(&shot.camera).ok_or_else(|| {
                CameraFileError::new(
                    &images,
                    format!("the picture {} has camera {}, which {} lacks", shot.name, shot.camera, cameras.display()),
                )
            })?;
            Ok(FileCamera { picture: Some(shot.name), pose: Some(shot.pose), ..lens.clone() })
        })
        .collect()
}

struct Shot {
    name: String,
    camera: u32,
    pose: Pose,
}

impl Shot {
    fn new(name: String, camera: u32, [w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Result<Self, String> {
        let turn = Quaternion::new(w, x, y, z);
        if !(turn.norm() > 0.5 && turn.norm() < 2.0) || translation.iter().any(|t| !t.is_finite()) {
            return Err(format!("the place of {name} is none"));
        }
        let rotation: Matrix3<f64> = *UnitQuaternion::from_quaternion(turn).to_rotation_matrix().matrix();
        Ok(Self { name, camera, pose: Pose::from_translation(rotation, Vector3::from(translation)) })
    }
}

/// COLMAP's models in the order of their numbers, and how many parameters each has.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

fn lens(model: &str, size: [u32; 2], p: &[f64]) -> Result<FileCamera, String> {
    let known = MODELS.iter().find(|(name, _)| *name == model && model != "THIN_PRISM_FISHEYE");
    let Some(&(_, count)) = known else {
        return Err(format!("the camera model {model} is not known here; convert it with `colmap image_undistorter`"));
    };
    if p.len() != count {
        return Err(format!("a camera {model} has {} parameters instead of {count}", p.len()));
    }
    // Models with one focal length have it first, then the principal point.
    let single = !matches!(model, "PINHOLE" | "OPENCV" | "OPENCV_FISHEYE" | "FULL_OPENCV" | "FOV");
    let (focal, centre, rest) =
        if single { ([p[0], p[0]], [p[1], p[2]], &p[3..]) } else { ([p[0], p[1]], [p[2], p[3]], &p[4..]) };
    if !(focal[0] > 0.0 && focal[1] > 0.0) || size.contains(&0) {
        return Err(format!("a camera {model} has a focal length or size that is not positive"));
    }
    let k = |place: usize| rest.get(place).copied().unwrap_or(0.0);
    let distortion = match model {
        "SIMPLE_RADIAL" | "RADIAL" => Distortion::radial(k(0), k(1)),
        "OPENCV" => Distortion::Radial { radial: [k(0), k(1), 0.0, 0.0, 0.0, 0.0], tangential: [k(2), k(3)] },
        "FULL_OPENCV" => Distortion::Radial { radial: [k(0), k(1), k(4), k(5), k(6), k(7)], tangential: [k(2), k(3)] },
        "OPENCV_FISHEYE" => Distortion::Fisheye([k(0), k(1), k(2), k(3)]),
        "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" => Distortion::Fisheye([k(0), k(1), 0.0, 0.0]),
        "FOV" => Distortion::FieldOfView(k(0)),
        _ => Distortion::None,
    };
    let centre = centre.map(|c| c - 0.5);
    Ok(FileCamera {
        picture: None,
        size: Some(size),
        focal,
        centre,
        skew: 0.0,
        distortion,
        focal_error: None,
        pose: None,
    })
}

fn lines(bytes: &[u8]) -> Result<impl Iterator<Item = &str>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
    Ok(text.lines().filter(|line| !line.starts_with('#')))
}

fn number<T: std::str::FromStr>(word: Option<&str>, what: &str) -> Result<T, String> {
    word.and_then(|word| word.parse().ok()).ok_or_else(|| format!("a line lacks its {what}"))
}

fn text_cameras(bytes: &[u8]) -> Result<BTreeMap<u32, FileCamera>, String> {
    let mut cameras = BTreeMap::new();
    for line in lines(bytes)?.filter(|line| !line.trim().is_empty()) {
        let mut words = line.split_whitespace();
        let id = number(words.next(), "camera")?;
        let model = words.next().unwrap_or("");
        let size = [number(words.next(), "width")?, number(words.next(), "height")?];
        let parameters: Vec<f64> = words.map(|word| number(Some(word), "parameters")).collect::<Result<_, _>>()?;
        cameras.insert(id, lens(model, size, &parameters)?);
    }
    Ok(cameras)
}

fn text_images(bytes: &[u8]) -> Result<Vec<Shot>, String> {
    let mut shots = Vec::new();
    let mut lines = lines(bytes)?;
    // Two lines a picture; the second one, its points, may be empty.
    while let Some(line) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        lines.next();
        let mut words = line.split_whitespace();
        words.next();
        let mut all = [0.0; 7];
        for value in &mut all {
            *value = number(words.next(), "place")?;
        }
        let camera = number(words.next(), "camera")?;
        let name = words.collect::<Vec<_>>().join(" ");
        let [w, x, y, z, tx, ty, tz] = all;
        shots.push(Shot::new(name, camera, [w, x, y, z], [tx, ty, tz])?);
    }
    Ok(shots)
}

/// Little-endian values, one after the other.
struct Bytes<'b>(&'b [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or("it ends too early")?;
        self.0 = rest;
        Ok(*first)
    }

    fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let mut all = [0.0; N];
        for value in &mut all {
            *value = f64::from_le_bytes(self.take()?);
        }
        Ok(all)
    }

    fn text(&mut self) -> Result<String, String> {
        let end = self.0.iter().position(|&byte| byte == 0).ok_or("it ends too early")?;
        let text = String::from_utf8_lossy(&self.0[..end]).into_owned();
        self.0 = &self.0[end + 1..];
        Ok(text)
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        let rest = usize::try_from(count).ok().and_then(|count| self.0.get(count..)).ok_or("it ends too early")?;
        self.0 = rest;
        Ok(())
    }
}

fn binary_cameras(bytes: &[u8]) -> Result<BTreeMap<u32, FileCamera>, String> {
    let mut bytes = Bytes(bytes);
    let mut cameras = BTreeMap::new();
    for _ in 0..bytes.u64()? {
        let id = bytes.u32()?;
        let code = bytes.u32()?;
        let (width, height) = (bytes.u64()?, bytes.u64()?);
        let &(model, count) =
            MODELS.get(code as usize).ok_or_else(|| format!("a camera has the unknown model number {code}"))?;
        let parameters: Vec<f64> = (0..count).map(|_| Ok(bytes.f64s::<1>()?[0])).collect::<Result<_, String>>()?;
        let side = |length: u64| u32::try_from(length).map_err(|_| format!("a camera is {length} pixels long"));
        cameras.insert(id, lens(model, [side(width)?, side(height)?], &parameters)?);
    }
    Ok(cameras)
}

fn binary_images(bytes: &[u8]) -> Result<Vec<Shot>, String> {
    let mut bytes = Bytes(bytes);
    let mut shots = Vec::new();
    for _ in 0..bytes.u64()? {
        bytes.u32()?;
        let [w, x, y, z, tx, ty, tz] = bytes.f64s()?;
        let camera = bytes.u32()?;
        let name = bytes.text()?;
        // x, y and the number of the point.
        let points = bytes.u64()?;
        bytes.skip(points.checked_mul(24).ok_or("it ends too early")?)?;
        shots.push(Shot::new(name, camera, [w, x, y, z], [tx, ty, tz])?);
    }
    Ok(shots)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERAS: &[u8] =
        b"# comment\n1 SIMPLE_RADIAL 1296 1936 2435.38 648 968 -0.0336\n2 PINHOLE 640 480 500 501 320 240\n";
    const IMAGES: &[u8] = b"# two lines each\n1 1 0 0 0 1 2 3 1 a b.JPG\n10 20 -1 30 40 7\n2 0.7071067811865476 0 0 0.7071067811865476 0 0 5 2 c.png\n\n";

    fn packed() -> (Vec<u8>, Vec<u8>) {
        let mut cameras = 2_u64.to_le_bytes().to_vec();
        for (id, code, size, p) in [
            (1_u32, 2_u32, [1296_u64, 1936], vec![2435.38, 648.0, 968.0, -0.0336]),
            (2, 1, [640, 480], vec![500.0, 501.0, 320.0, 240.0]),
        ] {
            cameras.extend(id.to_le_bytes());
            cameras.extend(code.to_le_bytes());
            cameras.extend(size.iter().flat_map(|s| s.to_le_bytes()));
            cameras.extend(p.iter().flat_map(|p: &f64| p.to_le_bytes()));
        }
        let mut images = 2_u64.to_le_bytes().to_vec();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (id, place, camera, name, points) in [
            (1_u32, [1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0], 1_u32, "a b.JPG", 2_u64),
            (2, [half, 0.0, 0.0, half, 0.0, 0.0, 5.0], 2, "c.png", 0),
        ] {
            images.extend(id.to_le_bytes());
            images.extend(place.iter().flat_map(|p: &f64| p.to_le_bytes()));
            images.extend(camera.to_le_bytes());
            images.extend(name.bytes().chain([0]));
            images.extend(points.to_le_bytes());
            images.extend(vec![9; 24 * points as usize]);
        }
        (cameras, images)
    }

    #[test]
    fn text_and_binary_say_the_same() {
        let folder_of = |names: [&str; 2], contents: [&[u8]; 2]| {
            let folder = tempfile::tempdir().unwrap();
            for (name, content) in names.iter().zip(contents) {
                std::fs::write(folder.path().join(name), content).unwrap();
            }
            folder
        };
        let (cameras, images) = packed();
        let text = folder_of(["cameras.txt", "images.txt"], [CAMERAS, IMAGES]);
        let binary = folder_of(["cameras.bin", "images.bin"], [&cameras, &images]);
        let (text, binary) = (folder(text.path()).unwrap(), folder(binary.path()).unwrap());
        assert_eq!(text, binary);
        assert_eq!(text.len(), 2);
        assert_eq!(text[0].picture.as_deref(), Some("a b.JPG"));
        assert_eq!((text[0].centre, text[0].distortion), ([647.5, 967.5], Distortion::radial(-0.0336, 0.0)));
        assert_eq!(text[0].pose.unwrap().position, Vector3::new(-1.0, -2.0, -3.0));
        // A quarter turn about z: x_view = -y_model.
        let view = text[1].pose.unwrap().to_view(&Vector3::new(0.0, 1.0, 0.0));
        assert!((view - Vector3::new(-1.0, 0.0, 5.0)).norm() < 1e-12, "{view}");
        // Cut anywhere, it is an error.
        for cut in 0..images.len() {
            assert!(binary_images(&images[..cut]).is_err(), "{cut}");
        }
        for cut in 0..cameras.len() {
            assert!(binary_cameras(&cameras[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn what_is_not_known_is_said() {
        assert!(text_cameras(b"1 MAGIC 3 4 5").unwrap_err().contains("MAGIC"));
        assert!(text_cameras(b"1 PINHOLE 3 4 5").unwrap_err().contains("1 parameters instead of 4"));
        assert!(text_images(b"1 0 0 0 0 1 2 3 1 a.jpg\n\n").is_err());
    }
}
