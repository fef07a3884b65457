//! A corner with its signature, on the query side and as a table stores it.

use crate::point::ImagePoint;

/// Bits of a [`Signature`].
pub const SIGNATURE_BITS: u32 = 128;

/// 128 binary intensity tests around a corner; bit `t` is bit `t % 64` of word `t / 64`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, PartialOrd, Ord)]
pub struct Signature(pub [u64; 2]);

impl Signature {
    /// Hamming distance: the number of tests that came out differently, 0..=128.
    #[inline(always)]
    pub const fn distance(self, other: Self) -> u32 {
        (self.0[0] ^ other.0[0]).count_ones() + (self.0[1] ^ other.0[1]).count_ones()
    }

    /// The 16 bytes of a record: word 0, then word 1, little endian.
    pub const fn to_bytes(self) -> [u8; 16] {
        ((self.0[0] as u128) | ((self.0[1] as u128) << 64)).to_le_bytes()
    }

    /// The inverse of [`Signature::to_bytes`].
    pub const fn from_bytes(bytes: [u8; 16]) -> Self {
        let bits = u128::from_le_bytes(bytes);
        Self([bits as u64, (bits >> 64) as u64])
    }
}

/// The least and the largest commonness of a stored corner, in bits.
pub const COMMONNESS: core::ops::RangeInclusive<i8> = -1..=6;

/// A corner of one pyramid level with its signature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Feature {
    /// Where, in the base frame (level 0).
    pub position: ImagePoint,
    /// The pyramid level it was found on.
    pub level: u8,
    /// How much more often than by chance signatures like this one are met, in bits (log2), within [`COMMONNESS`]:
    /// windows and bricks are common, a clock is not. It lowers the surprise of a match. Measured at enrollment; 0 for
    /// the corners of a frame.
    pub commonness: i8,
    /// What it looks like.
    pub signature: Signature,
}
