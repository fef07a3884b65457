//! A flat facade: the camera's pose from the homography of its plane, or from its four corners and its width.
//!
//! **Facade frame.** The origin is the facade's lower left corner as seen from outside, x to the right along it, z up, y into the
//! building, metres. Its plane is y = 0, and who sees it stands at y < 0.
//!
//! A homography `H` of (x, z) is `K [r1 r3 t]` up to scale: the columns of a rotation and a translation. From the corners of a
//! rectangle alone the ratio of its sides follows, `|K^-1 h2| / |K^-1 h1|`, so one known side makes it metric (Z. Zhang,
//! PAMI 22, 2000, section 2.3, the other way round).

use core::fmt;

use super::intrinsics::Intrinsics;
use super::placement::CameraFromModel;
use super::pose::PointInView;
use super::space::{Vector, cross, dot, length, minus, plus, scaled, transposed, unit};
use crate::family::{Correspondence, Family, Perspective};

/// The sides of a rectangle seen by this camera are orthogonal and in the right ratio up to this much; a rectangle whose corners
/// are off by 1 % of its sides stays below.
const SKEW: f64 = 0.1;
/// Half the root of two.
const HALF_ROOT: f64 = core::f64::consts::FRAC_1_SQRT_2;

/// Why a facade gives no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NoFacade {
    /// The corners do not make a quadrilateral, or the width is not positive.
    Degenerate,
    /// It is seen from behind: the corners go round the wrong way, as in a mirror.
    Mirrored,
    /// With these intrinsics no rectangle looks like this.
    NotARectangle {
        /// How far its sides are from orthogonal (cosine), or their ratio from the given one, whichever is more.
        skew: f64,
    },
}

impl fmt::Display for NoFacade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degenerate => f.write_str("the facade's corners make no quadrilateral, or its width is not positive"),
            Self::Mirrored => f.write_str("the facade is seen from behind: its corners go round the wrong way"),
            Self::NotARectangle { skew } => {
                write!(f, "through this lens no rectangle looks like this: its sides are off by {skew:.2}")
            }
        }
    }
}

impl core::error::Error for NoFacade {}

/// A facade and the camera that sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facade {
    /// The camera.
    pub camera_from_facade: CameraFromModel,
    /// Width and height, metres.
    pub size: [f64; 2],
    /// How far its sides are from a rectangle's: see [`NoFacade::NotARectangle`].
    pub skew: f64,
}

/// The columns of `K^-1 H` for (x, z) in the facade.
fn columns(image_from_facade: &Perspective, intrinsics: &Intrinsics) -> [Vector; 3] {
    let ([fx, fy], [cx, cy]) = (intrinsics.focal(), intrinsics.centre());
    transposed(&image_from_facade.matrix()).map(|[x, y, w]| [(x - cx * w) / fx, (y - cy * w) / fy, w])
}

/// The pose from a homography that takes facade coordinates (x, z) in metres to pixels.
///
/// # Errors
/// [`NoFacade`].
pub fn pose_from_homography(
    image_from_facade: &Perspective,
    intrinsics: &Intrinsics,
) -> Result<(CameraFromModel, f64), NoFacade> {
    let [across, up, origin] = columns(image_from_facade, intrinsics);
    let sides = length(across) + length(up);
    let (Some(x), Some(z)) = (unit(across), unit(up)) else { return Err(NoFacade::Degenerate) };
    let ratio = length(across) / length(up);
    let skew = dot(x, z).abs().max((ratio.max(1.0 / ratio) - 1.0).abs());
    let (Some(sum), Some(difference)) = (unit(plus(x, z)), unit(minus(x, z))) else { return Err(NoFacade::Degenerate) };
    let x = scaled(plus(sum, difference), HALF_ROOT);
    let z = scaled(minus(sum, difference), HALF_ROOT);
    let rotation = transposed(&[x, cross(z, x), z]);
    let pose = CameraFromModel::new(rotation, scaled(origin, 2.0 / sides)).ok_or(NoFacade::Degenerate)?;
    if !(pose.centre()[1] < 0.0) {
        return Err(NoFacade::Mirrored);
    }
    if !(skew <= SKEW) {
        return Err(NoFacade::NotARectangle { skew });
    }
    Ok((pose, skew))
}

impl Facade {
    /// From where its corners are seen (pixels; upper left, upper right, lower right, lower left, as seen from outside) and its
    /// width in metres.
    ///
    /// Each corner that is off by a pixel moves the answer; [`Self::points`] with [`super::pose::PoseSolver`] tells by how much.
    ///
    /// # Errors
    /// [`NoFacade`].
    pub fn from_width(corners_px: [[f64; 2]; 4], width_m: f64, intrinsics: &Intrinsics) -> Result<Self, NoFacade> {
        if !(width_m > 0.0 && width_m.is_finite()) {
            return Err(NoFacade::Degenerate);
        }
        let unit_square = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        let pairs = |to_facade: [f64; 2]| {
            let mut pairs = [Correspondence { from: [0.0; 2], to: [0.0; 2] }; 4];
            for ((pair, [x, z]), to) in pairs.iter_mut().zip(unit_square).zip(corners_px) {
                *pair = Correspondence { from: [x * to_facade[0], z * to_facade[1]], to };
            }
            pairs
        };
        let of_square = Perspective::fit(&pairs([1.0; 2])).ok_or(NoFacade::Degenerate)?;
        let [across, up, _] = columns(&of_square, intrinsics);
        let size = [width_m, width_m * length(up) / length(across)];
        let map = Perspective::fit(&pairs(size)).ok_or(NoFacade::Degenerate)?;
        let (camera_from_facade, skew) = pose_from_homography(&map, intrinsics)?;
        Ok(Self { camera_from_facade, size, skew })
    }

    /// Its corners and where this camera sees them, in the order of [`Self::from_width`]; for the pose solver, which refines and
    /// says how well the pose is known.
    pub fn points(&self, corners_px: [[f64; 2]; 4]) -> [PointInView; 4] {
        let [width, height] = self.size;
        let mut points = [PointInView { model: [0.0; 3], image: [0.0; 2] }; 4];
        let places = [[0.0, height], [width, height], [width, 0.0], [0.0, 0.0]];
        for ((point, [x, z]), image) in points.iter_mut().zip(places).zip(corners_px) {
            *point = PointInView { model: [x, 0.0, z], image };
        }
        points
    }
}
