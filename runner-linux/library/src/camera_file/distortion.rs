//! Models of lens distortion, in normalized coordinates `(X / Z, Y / Z)`.
//!
//! The coefficients mean what they mean in OpenCV (`calib3d`) and COLMAP (`sensor/models.h`), which agree where both
//! have a model.

/// What a lens does to straight lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Distortion {
    /// Nothing.
    #[default]
    None,
    /// `x (1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6) + 2 p1 x y + p2 (r2 + 2 x2)`, `y` alike: OpenCV's
    /// `plumb_bob` and `rational_polynomial`, COLMAP's `SIMPLE_RADIAL`, `RADIAL`, `OPENCV`, `FULL_OPENCV`.
    Radial {
        /// `k1` to `k6`.
        radial: [f64; 6],
        /// `p1` and `p2`.
        tangential: [f64; 2],
    },
    /// `theta (1 + k1 theta2 + k2 theta4 + k3 theta6 + k4 theta8)` for an angle `theta` from the axis: OpenCV's fisheye or
    /// `equidistant`, COLMAP's `OPENCV_FISHEYE`, `SIMPLE_RADIAL_FISHEYE`, `RADIAL_FISHEYE`.
    Fisheye([f64; 4]),
    /// `atan(2 r tan(omega / 2)) / omega`: COLMAP's `FOV`.
    FieldOfView(f64),
}

/// Newton steps to undo a distortion, at most.
const STEPS: usize = 50;
/// Half the distance over which derivatives are taken.
const H: f64 = 1e-6;

impl Distortion {
    /// Two radial coefficients.
    pub const fn radial(k1: f64, k2: f64) -> Self {
        Self::Radial { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] }
    }

    /// No distortion if all coefficients are zero.
    #[must_use]
    pub fn simplified(self) -> Self {
        let none = match self {
            Self::None => true,
            Self::Radial { radial, tangential } => radial.iter().chain(&tangential).all(|k| *k == 0.0),
            Self::FieldOfView(omega) => omega == 0.0,
            // A fisheye without coefficients still is no pinhole.
            Self::Fisheye(_) => false,
        };
        if none { Self::None } else { self }
    }

    /// Normalized coordinates as the lens shows them.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        match self {
            Self::None => [x, y],
            Self::Radial { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] } => {
                let up = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let scale = up / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                [
                    x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * scale + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
                ]
            }
            Self::Fisheye([k1, k2, k3, k4]) => {
                let r = libm::sqrt(r2);
                if r < 1e-12 {
                    return [x, y];
                }
                let theta = libm::atan(r);
                let t2 = theta * theta;
                let bent = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
                [x * bent / r, y * bent / r]
            }
            Self::FieldOfView(omega) => {
                let r = libm::sqrt(r2);
                if r < 1e-12 {
                    let scale = 2.0 * libm::tan(omega / 2.0) / omega;
                    return [x * scale, y * scale];
                }
                let bent = libm::atan(2.0 * r * libm::tan(omega / 2.0)) / omega;
                [x * bent / r, y * bent / r]
            }
        }
    }

    /// Normalized coordinates without the lens' distortion: the inverse of [`apply`](Self::apply) by Newton's method.
    ///
    /// `None` if there is none within the part around the axis in which the model does not fold over.
    pub fn undo(&self, seen: [f64; 2]) -> Option<[f64; 2]> {
        if *self == Self::None {
            return Some(seen);
        }
        let mut at = match self {
            // The angle is known at once; Newton mends the rest.
            Self::Fisheye(_) | Self::FieldOfView(_) => {
                let r = libm::sqrt(seen[0] * seen[0] + seen[1] * seen[1]);
                if (1e-12..1.5).contains(&r) { seen.map(|s| s * libm::tan(r) / r) } else { seen }
            }
            _ => seen,
        };
        for _ in 0..STEPS {
            let now = self.apply(at);
            let (ex, ey) = (seen[0] - now[0], seen[1] - now[1]);
            if ex.abs() + ey.abs() < 1e-13 {
                break;
            }
            let by = |dx: f64, dy: f64| {
                let (a, b) = (self.apply([at[0] + dx, at[1] + dy]), self.apply([at[0] - dx, at[1] - dy]));
                [(a[0] - b[0]) / (2.0 * H), (a[1] - b[1]) / (2.0 * H)]
            };
            let ([a, c], [b, d]) = (by(H, 0.0), by(0.0, H));
            let determinant = a * d - b * c;
            if !(determinant > 1e-9) {
                return None;
            }
            at = [at[0] + (d * ex - b * ey) / determinant, at[1] + (a * ey - c * ex) / determinant];
        }
        let back = self.apply(at);
        let off = (back[0] - seen[0]).abs() + (back[1] - seen[1]).abs();
        (off < 1e-9).then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_is_undone() {
        let models = [
            Distortion::radial(-0.3, 0.1),
            Distortion::Radial { radial: [0.2, -0.1, 0.01, 0.05, 0.0, 0.0], tangential: [0.001, -0.002] },
            Distortion::Fisheye([0.02, -0.01, 0.003, 0.0]),
            Distortion::FieldOfView(0.9),
        ];
        for model in models {
            for point in [[0.0, 0.0], [0.3, -0.2], [-0.5, 0.45], [0.01, 0.6]] {
                let back = model.undo(model.apply(point)).unwrap();
                let off = (back[0] - point[0]).abs() + (back[1] - point[1]).abs();
                assert!(off < 1e-9, "{model:?} {point:?} {back:?}");
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_nothing() {
        // r (1 - r2) is at most 0.385.
        assert_eq!(Distortion::radial(-1.0, 0.0).undo([0.5, 0.0]), None);
    }

    #[test]
    fn opencv_agrees() {
        // cv2.projectPoints and cv2.fisheye.projectPoints of (0.3, -0.2, 1) with K = I, OpenCV 4.
        let radial = Distortion::Radial { radial: [-0.28, 0.07, 0.01, 0.0, 0.0, 0.0], tangential: [0.001, -0.002] };
        let fisheye = Distortion::Fisheye([0.02, -0.01, 0.003, 0.001]);
        for (model, expected) in [(radial, [0.288_701_49, -0.192_510_99]), (fisheye, [0.288_578_28, -0.192_385_52])] {
            let [x, y] = model.apply([0.3, -0.2]);
            assert!((x - expected[0]).abs() < 6e-9 && (y - expected[1]).abs() < 6e-9, "{model:?}: {x} {y}");
        }
    }
}
