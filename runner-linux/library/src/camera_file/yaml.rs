//! Lenses from and to OpenCV's `FileStorage` YAML and ROS' `camera_info` YAML.
//!
//! Both are a small part of YAML (and OpenCV's first line is none): keys at the beginning of a line, numbers, and `data:`
//! lists in brackets. That part is read here.

use super::FileCamera;
use super::distortion::Distortion;
use super::lens::Lens;

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

/// Which of the two forms is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `cv::FileStorage` reads it.
    OpenCv,
    /// `camera_info_manager` and `camera_calibration_parsers` read it.
    Ros,
}

/// The text of a file that holds this lens; [`parse`] gives the same numbers back, to the last bit. `notes` are further
/// keys with their values, which readers pass over that do not know them. `None` for a distortion that these forms do not know.
pub fn text(lens: &Lens, form: Form, camera_name: &str, notes: &[(&str, f64)]) -> Option<String> {
    let (model, coefficients) = match lens.distortion {
        Distortion::None => ("plumb_bob", vec![0.0; 5]),
        Distortion::Radial { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] } => {
            let short = vec![k1, k2, p1, p2, k3];
            let rational = [k4, k5, k6];
            if rational == [0.0; 3] {
                ("plumb_bob", short)
            } else {
                ("rational_polynomial", [short.as_slice(), &rational].concat())
            }
        }
        Distortion::Fisheye(k) => ("equidistant", k.to_vec()),
        Distortion::FieldOfView(_) => return None,
    };
    let ([fx, fy], [cx, cy]) = (lens.focal, lens.centre);
    let matrix = [fx, lens.skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let projection = [fx, lens.skew, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let list = |numbers: &[f64]| numbers.iter().map(|n| format!("{n:?}")).collect::<Vec<_>>().join(", ");
    let entry = |key: &str, rows: usize, numbers: &[f64]| {
        let columns = numbers.len() / rows;
        let data = list(numbers);
        match form {
            Form::OpenCv => {
                format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
            }
            Form::Ros => format!("{key}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"),
        }
    };
    let header = match form {
        Form::OpenCv => "%YAML:1.0\n---\n",
        Form::Ros => "",
    };
    let mut parts = vec![format!("{header}image_width: {}\nimage_height: {}\n", lens.width, lens.height)];
    if form == Form::Ros {
        parts.push(format!("camera_name: {camera_name}\n"));
    }
    parts.push(entry("camera_matrix", 3, &matrix));
    parts.push(format!("distortion_model: {model}\n"));
    // OpenCV wants a column, ROS a row.
    parts.push(entry("distortion_coefficients", if form == Form::Ros { 1 } else { coefficients.len() }, &coefficients));
    if form == Form::Ros {
        parts.push(entry("rectification_matrix", 3, &identity));
        parts.push(entry("projection_matrix", 3, &projection));
    }
    parts.extend(notes.iter().map(|(key, value)| format!("{key}: {value:?}\n")));
    Some(parts.concat())
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

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        let third = 1.0 / 3.0;
        let models = [
            Distortion::Radial {
                radial: [-0.1 * third, 1e-17, third, 0.0, 0.0, 0.0],
                tangential: [1e-3 * third, -2e-5],
            },
            Distortion::Radial { radial: [third; 6], tangential: [0.0, -third] },
            Distortion::Fisheye([third, -1e-9, 0.0, 2.0]),
            Distortion::None,
        ];
        for distortion in models {
            let lens = Lens {
                focal: [1e3 * third, 334.0],
                centre: [319.5 + 1e-13, 1e2 * third],
                distortion,
                ..Lens::of_focal(640, 480, 1.0)
            };
            for form in [Form::OpenCv, Form::Ros] {
                let text = text(&lens, form, "front", &[(FOCAL_ERROR, 0.001 * third)]).unwrap();
                let camera = parse(&text).unwrap();
                assert_eq!(camera.lens(640, 480).unwrap(), lens, "{text}");
                assert_eq!(camera.focal_error, Some(0.001 * third));
            }
        }
        assert_eq!(
            text(&Lens { distortion: Distortion::FieldOfView(0.9), ..Lens::of_focal(9, 9, 9.0) }, Form::Ros, "", &[]),
            None
        );
    }
}
