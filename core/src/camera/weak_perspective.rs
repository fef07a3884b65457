//! Weak perspective: one depth for the whole object, and what that costs in pixels (thesis 4.3 and Appendix A).
//!
//! A point (x, y, z) is seen at `f/z (x, y)`. Weak perspective puts all points at an average depth Z, `f/Z (x, y)`: a
//! projection parallel to the optical axis on the plane `z = Z` and a scale, so an affine map. With `ΔZ = z - Z` it is off by
//!
//! ```text
//! perspective - weak = -(f/Z) (ΔZ / (Z + ΔZ)) (x, y)  =  f (1/z - 1/Z) (x, y)
//! ```
//!
//! which is exact, not the first term of a series. The distance from the optical axis counts, so an object at the border of
//! the frame is off by more than one in its middle: a part of that is a shift of the whole object.
//!
//! ```
//! use daymark_core::camera::weak_perspective::{Extent, WeakPerspective};
//!
//! # fn example() -> Option<()> {
//! // A tower 10 m deep, up to 15 m from the optical axis, 95 m away; 700 px of focal length.
//! let tower = Extent::new(95.0, 105.0, 15.0)?;
//! let model = WeakPerspective::balanced(700.0, tower)?;
//! let bound = model.bound(tower);
//! assert!((5.2..5.3).contains(&bound.error_px));
//! assert!(model.check(tower, 6.0).is_ok() && model.check(tower, 3.0).is_err());
//! # Some(())
//! # }
//! # example().unwrap();
//! ```

use core::fmt;

use crate::math::sqrt_f64;

/// Where the points of an object lie in the camera frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    nearest: f64,
    farthest: f64,
    radius: f64,
}

impl Extent {
    /// Depths from `nearest` to `farthest`, in metres from the camera along the optical axis, and the largest distance
    /// from that axis. `None` unless `0 < nearest <= farthest` and `0 <= radius`, all finite: what is at or behind the
    /// centre of projection has no image.
    pub fn new(nearest: f64, farthest: f64, radius: f64) -> Option<Self> {
        let finite = farthest.is_finite() && radius.is_finite();
        (finite && nearest > 0.0 && nearest <= farthest && radius >= 0.0).then_some(Self { nearest, farthest, radius })
    }

    /// Of these points (x, y, z) of the camera frame. `None` without points, or if one is not in front of the camera or
    /// not finite.
    pub fn of_points(points: impl IntoIterator<Item = [f64; 3]>) -> Option<Self> {
        let mut extent: Option<Self> = None;
        for [x, y, depth] in points {
            let squared = x * x + y * y;
            if !squared.is_finite() {
                return None;
            }
            let point = Self::new(depth, depth, sqrt_f64(squared))?;
            extent = Some(extent.map_or(point, |all| Self {
                nearest: all.nearest.min(point.nearest),
                farthest: all.farthest.max(point.farthest),
                radius: all.radius.max(point.radius),
            }));
        }
        extent
    }

    /// Depth of the nearest point, in metres.
    pub fn nearest(&self) -> f64 {
        self.nearest
    }

    /// Depth of the farthest point, in metres.
    pub fn farthest(&self) -> f64 {
        self.farthest
    }

    /// Largest distance from the optical axis, in metres.
    pub fn radius(&self) -> f64 {
        self.radius
    }
}

/// What weak perspective costs an object at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBound {
    /// No point of the extent is off by more, in pixels; a point at its rim is.
    pub error_px: f64,
    /// The larger of `|ΔZ| / Z`: the thesis wants it far below 1.
    pub relative_depth: f64,
}

/// Weak perspective is too far off for an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TooDeep {
    /// How far off, in pixels.
    pub error_px: f64,
    /// What was allowed, in pixels.
    pub tolerance_px: f64,
    /// Depths at which the tolerance would be kept at this distance from the axis, in metres.
    pub depths_within: [f64; 2],
}

impl fmt::Display for TooDeep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { error_px, tolerance_px, depths_within: [nearest, farthest] } = *self;
        write!(
            f,
            "weak perspective is off by up to {error_px:.2} px, {tolerance_px:.2} px are allowed: it would do for depths \
             from {nearest:.1} m to {farthest:.1} m; use full perspective"
        )
    }
}

impl core::error::Error for TooDeep {}

/// `f/Z (x, y)`: a camera that sees every point at the same depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeakPerspective {
    focal_length_px: f64,
    average_depth: f64,
}

impl WeakPerspective {
    /// A focal length in pixels and the average depth Z in metres; `None` unless both are positive and finite.
    pub fn new(focal_length_px: f64, average_depth: f64) -> Option<Self> {
        let sound = |number: f64| number > 0.0 && number.is_finite();
        (sound(focal_length_px) && sound(average_depth)).then_some(Self { focal_length_px, average_depth })
    }

    /// With the average depth that makes the bound for this object least: the harmonic mean of its nearest and farthest depth,
    /// where both are off alike. Their middle would be worse for the nearest point.
    pub fn balanced(focal_length_px: f64, object: Extent) -> Option<Self> {
        let Extent { nearest, farthest, .. } = object;
        Self::new(focal_length_px, 2.0 * nearest / (nearest + farthest) * farthest)
    }

    /// Z, in metres.
    pub fn average_depth(&self) -> f64 {
        self.average_depth
    }

    /// `f / Z`, in pixels a metre.
    pub fn scale(&self) -> f64 {
        self.focal_length_px / self.average_depth
    }

    /// Where weak perspective sees a point, in pixels from the principal point; its depth does not matter.
    pub fn project(&self, [x, y, _]: [f64; 3]) -> [f64; 2] {
        [self.scale() * x, self.scale() * y]
    }

    /// Where the camera sees it, `f/z (x, y)`; `None` if it is not in front of the camera.
    pub fn project_exactly(&self, [x, y, depth]: [f64; 3]) -> Option<[f64; 2]> {
        (depth > 0.0).then(|| [self.focal_length_px * x / depth, self.focal_length_px * y / depth])
    }

    /// Perspective minus weak perspective at a point, in pixels: `-(f/Z) (ΔZ / (Z + ΔZ)) (x, y)` with `ΔZ = z - Z`
    /// (Appendix A). `None` if it is not in front of the camera (`Z + ΔZ <= 0`), where the formula means nothing.
    pub fn error(&self, [x, y, depth]: [f64; 3]) -> Option<[f64; 2]> {
        (depth > 0.0).then(|| {
            let factor = -self.scale() * self.relative_error(depth);
            [factor * x, factor * y]
        })
    }

    /// `ΔZ / (Z + ΔZ)`, grows with the depth from minus infinity to 1.
    fn relative_error(&self, depth: f64) -> f64 {
        (depth - self.average_depth) / depth
    }

    /// The largest error over the extent: the factor grows with the depth, so it is largest at one of the two ends, and the
    /// error is largest at the rim.
    pub fn bound(&self, object: Extent) -> ErrorBound {
        let at = |depth: f64| self.relative_error(depth).abs();
        let depth_share = |depth: f64| (depth - self.average_depth).abs() / self.average_depth;
        let Extent { nearest, farthest, radius } = object;
        ErrorBound {
            error_px: self.scale() * at(nearest).max(at(farthest)) * radius,
            relative_depth: depth_share(nearest).max(depth_share(farthest)),
        }
    }

    /// The nearest and the farthest depth at which points up to `radius` metres from the optical axis are off by at most
    /// `tolerance_px`: `Z / (1 + e)` and `Z / (1 - e)` with `e = tolerance Z / (f radius)`. The second is infinite from
    /// `e = 1` on: the image of such a point keeps within the tolerance however far it is. `Z` twice without a positive
    /// tolerance.
    pub fn depths_within(&self, tolerance_px: f64, radius: f64) -> [f64; 2] {
        let z = self.average_depth;
        let reach = self.scale() * radius;
        if !(tolerance_px > 0.0) {
            return [z, z];
        }
        if !(tolerance_px < reach) {
            let nearest = if reach > 0.0 { z / (1.0 + tolerance_px / reach) } else { 0.0 };
            return [nearest, f64::INFINITY];
        }
        let e = tolerance_px / reach;
        [z / (1.0 + e), z / (1.0 - e)]
    }

    /// The bound, if it is within the tolerance.
    ///
    /// # Errors
    /// [`TooDeep`], with the depths that would do.
    pub fn check(&self, object: Extent, tolerance_px: f64) -> Result<ErrorBound, TooDeep> {
        let bound = self.bound(object);
        if bound.error_px <= tolerance_px {
            return Ok(bound);
        }
        let depths_within = self.depths_within(tolerance_px, object.radius);
        Err(TooDeep { error_px: bound.error_px, tolerance_px, depths_within })
    }
}
