//! The `.camera` files of Strecha's multi-view sets: `K`, three zeros, the rotation from camera to world, the centre, the
//! size. `P = K [R^T | -R^T C]`.

use nalgebra::{Matrix3, Vector3};

use super::FileCamera;
use super::distortion::Distortion;
use super::lens::Pose;

/// Reads the text of a file.
///
/// # Errors
/// What is wrong with it.
pub fn parse(text: &str) -> Result<FileCamera, String> {
    let numbers = super::numbers(text)?;
    let found = numbers.len();
    let Ok::<[f64; 26], _>(all) = numbers.try_into() else {
        return Err(format!("it has {found} numbers; a .camera file has 26 (K, 0 0 0, R, C, width and height)"));
    };
    let turn = Matrix3::from_row_slice(&all[12..21]);
    if (turn * turn.transpose() - Matrix3::identity()).norm() > 1e-3 || turn.determinant() < 0.0 {
        return Err("its rotation is no rotation".to_owned());
    }
    if !(all[0] > 0.0 && all[4] > 0.0 && all[24] >= 1.0 && all[25] >= 1.0) {
        return Err("its focal length or size is not positive".to_owned());
    }
    Ok(FileCamera {
        picture: None,
        size: Some([all[24] as u32, all[25] as u32]),
        focal: [all[0], all[4]],
        centre: [all[2], all[5]],
        skew: all[1],
        distortion: Distortion::None,
        focal_error: None,
        pose: Some(Pose { view_from_model: turn.transpose(), position: Vector3::new(all[21], all[22], all[23]) }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_and_what_is_none() {
        let text = "1000 0 320\n0 1010 240\n0 0 1\n0 0 0\n0 0 1\n1 0 0\n0 1 0\n-6 -14 0.5\n640 480\n";
        let camera = parse(text).unwrap();
        assert_eq!((camera.focal, camera.centre, camera.size), ([1000.0, 1010.0], [320.0, 240.0], Some([640, 480])));
        // The first column of R is the camera's x axis in the world.
        let pose = camera.pose.unwrap();
        assert_eq!(pose.to_view(&Vector3::new(-6.0, -13.0, 0.5)), Vector3::new(1.0, 0.0, 0.0));
        assert!(parse("1 2 3").unwrap_err().contains("3 numbers"));
        assert!(parse(&text.replace("0 1 0", "0 3 0")).unwrap_err().contains("rotation"));
        assert!(parse(&text.replace("640", "x")).unwrap_err().contains("\"x\""));
    }
}
