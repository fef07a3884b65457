//! Proposals: a few pairs of corners whose places agree so well that chance hardly explains it.
//!
//! Every source of correspondences (nested hulls, local arrangements) yields proposals, and how surprising each is: the
//! number of bits by which the space of accidents shrinks, `log2(area of the picture / area in which the last corner was
//! expected)`, added up over the corners beyond the three that any affine map can join.

use heapless::Vec;

use super::cross_ratio::FivePoints;
use super::quad::Expected;
use crate::math::log2;
use crate::point::ImagePoint;

/// Squared Mahalanobis distance of two degrees of freedom that 99 % of the true quads keep.
pub(super) const GATE: f64 = 9.21;

/// What two views of the same corners are expected to keep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Invariance {
    /// Ratios of areas: weak perspective, corners of one plane.
    #[default]
    Affine,
    /// Cross-ratios of five points: any perspective, corners of one plane.
    Perspective,
}

/// On what terms corners are compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    /// Standard deviation of the noise of each coordinate, px.
    pub sigma: f32,
    /// Area of the second picture in which corners may lie, px².
    pub area: f64,
    /// What is kept.
    pub invariance: Invariance,
}

impl Terms {
    /// Bits of surprise that two quads agree up to an affine map; `None` if they do not.
    pub(super) fn affine_bits(self, p: &Expected, q: [ImagePoint; 4]) -> Option<f64> {
        let residual = p.residual(q)?;
        (residual.squared <= GATE).then(|| log2(self.area / (GATE * p.ellipse(residual))))
    }

    /// Bits of surprise that five points agree up to a perspective map; `None` if they do not.
    pub(super) fn perspective_bits(self, p: &FivePoints, q: [ImagePoint; 5]) -> Option<f64> {
        let deviation = p.deviation(&FivePoints::new(q)?, self.sigma)?;
        (deviation.squared <= GATE).then(|| deviation.bits - log2(GATE))
    }
}

/// Corners in a proposal, at most.
pub const MOST_PAIRS: usize = 5;

/// Corner `first` of the first picture is corner `second` of the second: numbers in the caller's lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Pairing {
    /// Number in the first list.
    pub first: u16,
    /// Number in the second list.
    pub second: u16,
}

/// Where a proposal comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Origin {
    /// Four vertices of two hull layers, in their cyclic order.
    Layers {
        /// Layer of the first picture, 0 is the outermost.
        first: u8,
        /// Layer of the second picture.
        second: u8,
        /// Vertices by which the second layer is shifted against the first.
        shift: u16,
    },
    /// A corner and four of its neighbours.
    Arrangement,
}

/// A few pairs that belong together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Proposal {
    /// The pairs: four or five.
    pub pairs: Vec<Pairing, MOST_PAIRS>,
    /// How surprising they would be by chance, in 1/256 bit.
    pub surprise: i32,
    /// Where it comes from.
    pub origin: Origin,
}

/// The most surprising proposals so far, in falling order; of equally surprising ones the first stays first, and the
/// weakest goes when there is no room.
#[derive(Debug, Clone)]
pub struct Proposals<const CAPACITY: usize> {
    list: Vec<Proposal, CAPACITY>,
    /// The surprise and the place in the list of each.
    order: Vec<(i32, u16), CAPACITY>,
    seen: usize,
}

impl<const CAPACITY: usize> Proposals<CAPACITY> {
    /// None yet.
    pub const fn new() -> Self {
        const { assert!(CAPACITY <= u16::MAX as usize, "a proposal has 16 bits for its place") };
        Self { list: Vec::new(), order: Vec::new(), seen: 0 }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.list.clear();
        self.order.clear();
        self.seen = 0;
    }

    /// Enters a proposal. Cost: at most `CAPACITY` moves of 8 bytes.
    pub fn add(&mut self, proposal: Proposal) {
        self.seen = self.seen.saturating_add(1);
        let mut entry = (proposal.surprise, self.list.len() as u16);
        if self.list.is_full() {
            let Some(&(weakest, place)) = self.order.last() else { return };
            if weakest >= proposal.surprise {
                return;
            }
            self.order.pop();
            entry.1 = place;
            if let Some(weakest) = self.list.get_mut(usize::from(place)) {
                *weakest = proposal;
            }
        } else {
            // There is room, or the capacity is zero and nothing can be kept.
            let _ = self.list.push(proposal);
        }
        let at = self.order.partition_point(|(surprise, _)| *surprise >= entry.0);
        for later in self.order.iter_mut().skip(at) {
            core::mem::swap(later, &mut entry);
        }
        let _ = self.order.push(entry);
    }

    /// The proposals, most surprising first.
    pub fn iter(&self) -> impl Iterator<Item = &Proposal> + Clone {
        self.order.iter().filter_map(|(_, place)| self.list.get(usize::from(*place)))
    }

    /// How many were offered, kept or not.
    pub const fn seen(&self) -> usize {
        self.seen
    }
}

impl<const CAPACITY: usize> Default for Proposals<CAPACITY> {
    fn default() -> Self {
        Self::new()
    }
}
