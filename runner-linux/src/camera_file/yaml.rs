//! Lenses from OpenCV's `FileStorage` YAML and ROS' `camera_info` YAML.
//!
//! Both are a small part of YAML (and OpenCV's first line is none): keys at the beginning of a line, numbers, and `data:`
//! lists in brackets. That part is read here.

use super::FileCamera;
use super::distortion::Distortion;

const MATRIX: [&str; 5] = ["camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "intrinsics"];
const COEFFICIENTS: [&str; 5] =
    ["distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "dist_coeffs", "D"];
/// The key of the focal length's relative error, one standard deviation.
pub(crate) const FOCAL_ERROR: &str = "focal_length_relative_error";

/// Reads the text of a file.
///
/// # Errors
/// What is wrong with it.
pub fn parse(text: &str) -> Result<FileCamera, String> {
    let matrix = MATRIX
        .iter()
        .find_map(|key| list(text, key))
        .ok_or_else(|| format!("it has no camera matrix ({})", MATRIX.join(", ")))??;
    let found = matrix.len();
    let Ok::<[f64; 9], _>([fx, skew, cx, _, fy, cy, _, _, last]) = matrix.try_into() else {
        return Err(format!("its camera matrix has {found} numbers instead of 9"));
    };
    if !(fx > 0.0 && fy > 0.0 && last == 1.0) {
        return Err(format!("its camera matrix has focal lengths {fx} and {fy} and ends in {last} instead of 1"));
    }
    let coefficients = COEFFICIENTS.iter().find_map(|key| list(text, key)).transpose()?.unwrap_or_default();
    let model = ["distortion_model", "model"].iter().find_map(|key| scalar(text, key)).unwrap_or("");
    let whole = |keys: [&str; 3]| {
        keys.iter().find_map(|key| scalar(text, key)?.parse::<u32>().ok().filter(|length| *length > 0))
    };
    let size = whole(["image_width", "imageWidth", "width"]).zip(whole(["image_height", "imageHeight", "height"]));
    Ok(FileCamera {
        picture: None,
        size: size.map(|(width, height)| [width, height]),
        focal: [fx, fy],
        centre: [cx, cy],
        skew,
        distortion: distortion(model, &coefficients)?,
        focal_error: focal_error(text)?,
        pose: None,
    })
}

/// A key of our own, which other readers pass over.
fn focal_error(text: &str) -> Result<Option<f64>, String> {
    let Some(value) = scalar(text, FOCAL_ERROR) else { return Ok(None) };
    match value.parse::<f64>() {
        Ok(error) if (0.0..1.0).contains(&error) => Ok(Some(error)),
        _ => Err(format!("its {FOCAL_ERROR} is \"{value}\", not a number between 0 and 1")),
    }
}

fn distortion(model: &str, coefficients: &[f64]) -> Result<Distortion, String> {
    let k = |place: usize| coefficients.get(place).copied().unwrap_or(0.0);
    let count = coefficients.len();
    match (model.trim_matches(['"', '\'']), count) {
        (_, 0) => Ok(Distortion::None),
        ("equidistant" | "fisheye", 4) => Ok(Distortion::Fisheye([k(0), k(1), k(2), k(3)])),
        ("" | "plumb_bob" | "rational_polynomial" | "pinhole", 4 | 5 | 8) => {
            Ok(Distortion::Radial { radial: [k(0), k(1), k(4), k(5), k(6), k(7)], tangential: [k(2), k(3)] })
        }
        // Twelve and fourteen have thin prism and tilt after the eight.
        ("" | "plumb_bob" | "rational_polynomial", 12 | 14) if coefficients.iter().skip(8).all(|k| *k == 0.0) => {
            Ok(Distortion::Radial { radial: [k(0), k(1), k(4), k(5), k(6), k(7)], tangential: [k(2), k(3)] })
        }
        (model, count) => Err(format!(
            "its distortion \"{model}\" with {count} coefficients is not known here; known are plumb_bob, \
             rational_polynomial and equidistant"
        )),
    }
}

/// What stands behind a key at the beginning of a line (blanks before it allowed).
fn after<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let word = line.trim_start();
        if let Some(rest) = word.strip_prefix(key).and_then(|rest| rest.trim_start().strip_prefix(':')) {
            let offset = start + (line.len() - rest.len());
            return text.get(offset..);
        }
        start += line.len();
    }
    None
}

fn scalar<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    after(text, key)?.lines().next().map(|value| value.split('#').next().unwrap_or("").trim())
}

/// The numbers in the first brackets behind a key, if no other key of the first column stands between.
fn list(text: &str, key: &str) -> Option<Result<Vec<f64>, String>> {
    let rest = after(text, key)?;
    let open = rest.find('[')?;
    let between = rest.get(..open)?;
    // Another key at the left margin: the list belongs to it.
    if between.lines().skip(1).any(|line| line.starts_with(|c: char| c.is_alphabetic())) {
        return None;
    }
    let inside = rest.get(open + 1..)?;
    let Some(close) = inside.find(']') else { return Some(Err(format!("the list of {key} has no end"))) };
    Some(super::numbers(inside.get(..close)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPENCV: &str = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   \
        cols: 3\n   dt: d\n   data: [ 657.4, 0., 319.5, 0.,\n       658.1, 239.5, 0., 0., 1. ]\n\
        distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   \
        data: [ -0.28, 0.07, 1e-3, -2.0e-03, 0.01 ]\navg_reprojection_error: 0.4\n";

    const ROS: &str = "image_width: 800\nimage_height: 600\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [400, 0, 400, 0, 401, 300, 0, 0, 1]\ndistortion_model: equidistant\ndistortion_coefficients:\n  rows: 1\n  \
        cols: 4\n  data: [0.01, 0.02, 0.03, 0.04]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";

    #[test]
    fn both_dialects() {
        let camera = parse(OPENCV).unwrap();
        assert_eq!((camera.size, camera.focal), (Some([640, 480]), [657.4, 658.1]));
        let expected = Distortion::Radial { radial: [-0.28, 0.07, 0.01, 0.0, 0.0, 0.0], tangential: [1e-3, -2e-3] };
        assert_eq!(camera.distortion, expected);
        let camera = parse(ROS).unwrap();
        assert_eq!(camera.distortion, Distortion::Fisheye([0.01, 0.02, 0.03, 0.04]));
        assert_eq!(camera.centre, [400.0, 300.0]);
    }

    #[test]
    fn what_is_missing_or_unknown_is_said() {
        assert!(parse("image_width: 3").unwrap_err().contains("no camera matrix"));
        assert!(parse(&ROS.replace("equidistant", "magic")).unwrap_err().contains("\"magic\""));
        assert!(parse(&OPENCV.replace("0., 1. ]", "0. ]")).unwrap_err().contains("8 numbers"));
        // A matrix without data does not take the next list.
        let cut = ROS.replace("  data: [400, 0, 400, 0, 401, 300, 0, 0, 1]\n", "");
        assert!(parse(&cut).is_err());
    }
}
