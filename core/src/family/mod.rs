//! The four families of plane maps between views, what each keeps, and the map that correspondences determine.
//!
//! | family | map | free | pairs | keeps |
//! |---|---|---:|---:|---|
//! | [`Rigid`] | `R x + t` | 3 | 2 | lengths, angles |
//! | [`Similarity`] | `α R x + t` | 4 | 2 | angles, ratios of lengths |
//! | [`Affine`] | `L x + t`, `det L ≠ 0` | 6 | 3 | ratios of areas; midpoints; parallels |
//! | [`Perspective`] | `H (x, 1)` up to scale | 8 | 4 | cross-ratios of five points; lines |
//!
//! Each family is part of the next (`From`), and keeps what the next one keeps. *Relative* invariants change by a factor
//! that depends on the map alone, a power of its determinant; with the power 0 they are *absolute* (thesis 4.1):
//! [`Family::invariance`], [`Family::factor`].
//!
//! `f64`, with `+ - * /` and [`crate::math`] in the written order. Any unit of length; all maps are named
//! `target_from_source`. The maps of the recognizer ([`crate::transform`]) are `f32` with ridges that its calibration knows;
//! `widened` and `narrowed` lead from one to the other.
//!
//! ```
//! use daymark_core::family::{Affine, Correspondence, Family, invariant::area_ratio};
//!
//! fn example() -> Option<()> {
//!     let pairs = [([0.0, 0.0], [7.0, 1.0]), ([1.0, 0.0], [9.0, 2.0]), ([0.0, 1.0], [6.0, 4.0])]
//!         .map(|(from, to)| Correspondence { from, to });
//!     let frame_from_view = Affine::fit(&pairs)?;
//!     let quad = [[0.0, 0.0], [3.0, 0.0], [4.0, 2.0], [1.0, 3.0]];
//!     let in_frame = quad.map(|point| frame_from_view.apply(point));
//!     assert!((area_ratio(&quad)? - area_ratio(&in_frame)?).abs() < 1e-12);
//!
//!     let view_from_frame = frame_from_view.inverse()?;
//!     let [x, y] = frame_from_view.then(&view_from_frame).apply([5.0, 6.0]);
//!     assert!((x - 5.0).abs() + (y - 6.0).abs() < 1e-12);
//!     Some(())
//! }
//! # example().unwrap();
//! ```

mod affine;
mod moments;
mod perspective;
mod rigid;
mod similarity;
pub mod invariant;

pub use affine::Affine;
pub use invariant::{Invariance, Invariant};
pub use perspective::Perspective;
pub use rigid::Rigid;
pub use similarity::Similarity;

use crate::math::sqrt_f64;

/// A point in two views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// In the source frame.
    pub from: [f64; 2],
    /// In the target frame.
    pub to: [f64; 2],
}

/// A family of plane maps, closed under composition and inversion.
pub trait Family: Copy + Sized {
    /// The fewest correspondences that determine a map.
    const MINIMAL: usize;

    /// Numbers that are free to choose.
    const FREEDOM: usize;

    /// The map that moves nothing.
    const IDENTITY: Self;

    /// The image of a point; `None` where there is none, which only [`Perspective`] knows.
    fn image(&self, point: [f64; 2]) -> Option<[f64; 2]>;

    /// `source_from_target`; `None` if its numbers are not finite.
    fn inverse(&self) -> Option<Self>;

    /// `c_from_b.after(&b_from_a)` is `c_from_a`.
    #[must_use]
    fn after(&self, first: &Self) -> Self;

    /// `b_from_a.then(&c_from_b)` is `c_from_a`.
    #[must_use]
    fn then(&self, second: &Self) -> Self {
        second.after(self)
    }

    /// The map `target_from_source` with the least squared error: through all pairs if there are [`Self::MINIMAL`] and the
    /// family can; which error is said at each family.
    ///
    /// `None` for fewer pairs than [`Self::MINIMAL`], for points that do not determine a map (coincident, collinear), and
    /// where a coordinate is not finite. `O(pairs)`, nothing stored.
    fn fit(pairs: &[Correspondence]) -> Option<Self>;

    /// Determinant of the linear part: the factor of signed areas. `None` for a family whose maps have another at each
    /// point.
    fn determinant(&self) -> Option<f64>;

    /// How the family treats an invariant.
    fn invariance(invariant: Invariant) -> Invariance;

    /// What this map multiplies an invariant by: 1 if it is absolute; `None` if the family does not keep it.
    fn factor(&self, invariant: Invariant) -> Option<f64> {
        match Self::invariance(invariant) {
            Invariance::Absolute => Some(1.0),
            Invariance::Relative { half_powers: 1 } => self.determinant().map(|area| sqrt_f64(area.abs())),
            // Areas are signed.
            Invariance::Relative { .. } => self.determinant(),
            Invariance::Broken => None,
        }
    }
}
