//! Plain 3 x 4 projection matrices: `x ~ P (X, 1)`, taken apart into lens and place.

use nalgebra::{Matrix3, Vector3};

use super::FileCamera;
use super::distortion::Distortion;
use super::lens::Pose;

/// Reads twelve numbers, row by row.
///
/// # Errors
/// What is wrong with them.
pub fn parse(text: &str) -> Result<FileCamera, String> {
    let numbers = super::numbers(text)?;
    let found = numbers.len();
    let Ok::<[f64; 12], _>(all) = numbers.try_into() else {
        return Err(format!("it has {found} numbers; a 3 x 4 projection matrix has 12"));
    };
    let matrix = Matrix3::new(all[0], all[1], all[2], all[4], all[5], all[6], all[8], all[9], all[10]);
    let last = Vector3::new(all[3], all[7], all[11]);
    decompose(&matrix, &last).ok_or_else(|| {
        "its left 3 x 3 part is singular: an affine camera has no place, leave it out and use no cameras".to_owned()
    })
}

/// `M = K R` with an upper triangular `K` of positive diagonal (Hartley and Zisserman, 6.2.4), and `C = -M^-1 p`.
fn decompose(matrix: &Matrix3<f64>, last: &Vector3<f64>) -> Option<FileCamera> {
    let sign = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let position = -(matrix.try_inverse()? * last);
    let scale = sign / matrix.row(2).norm();
    let matrix = matrix * scale;
    let rows = [0, 1, 2].map(|row| Vector3::from(matrix.row(row).transpose()));
    let forward = rows[2];
    let cy = rows[1].dot(&forward);
    let down = rows[1] - forward * cy;
    let fy = down.norm();
    let down = down / fy;
    let (cx, skew) = (rows[0].dot(&forward), rows[0].dot(&down));
    let right = rows[0] - forward * cx - down * skew;
    let fx = right.norm();
    let right = right / fx;
    let finite = [fx, fy, cx, cy, skew, position.x, position.y, position.z].iter().all(|v| v.is_finite());
    (finite && fx > 0.0 && fy > 0.0).then(|| FileCamera {
        picture: None,
        size: None,
        focal: [fx, fy],
        centre: [cx, cy],
        skew,
        distortion: Distortion::None,
        focal_error: None,
        pose: Some(Pose {
            view_from_model: Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]),
            position,
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_taken_apart_and_put_together() {
        let turn = *nalgebra::Rotation3::from_euler_angles(0.4, -0.2, 1.3).matrix();
        let k = Matrix3::new(800.0, 1.5, 320.0, 0.0, 810.0, 240.0, 0.0, 0.0, 1.0);
        let centre = Vector3::new(3.0, -20.0, 1.7);
        for scale in [1.0, -0.01] {
            let m = k * turn * scale;
            let p = -(m * centre);
            let lines = [0, 1, 2].map(|r| format!("{} {} {} {}", m[(r, 0)], m[(r, 1)], m[(r, 2)], p[r]));
            let text = lines.join("\n");
            let camera = parse(&text).unwrap();
            let pose = camera.pose.unwrap();
            assert!((pose.position - centre).norm() < 1e-9 && (pose.view_from_model - turn).norm() < 1e-9);
            assert!((camera.focal[0] - 800.0).abs() < 1e-8 && (camera.skew - 1.5).abs() < 1e-8, "{camera:?}");
        }
        assert!(parse("1 0 0 5 0 1 0 5 0 0 0 1").unwrap_err().contains("singular"));
        assert!(parse("1 0 0").unwrap_err().contains("3 numbers"));
    }
}
