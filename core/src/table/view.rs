//! A view's record: the corners of one enrolled frame, packed and sorted.

use super::checksum::joined;
use super::{CornerFault, EncodeError, RecordFault};
use crate::feature::{COMMONNESS, Feature, Signature};
use crate::point::{ImagePoint, SUBPIXEL};
use serde::{Deserialize, Serialize};

/// Columns or rows of a view's frame, at most. The largest coordinate is then 1,023 px, 8,184 of 13 bits' 8,191.
pub const SIDE_LIMIT: u16 = 1_024;

/// Pyramid levels: a corner's level is below this.
pub const LEVELS: u8 = 5;

/// Bytes of a packed corner: 4 for its place and commonness, 16 for its signature.
pub const CORNER_BYTES: usize = 20;

/// Bytes before a view's corners, at most: width 2, height 2, number of corners 2.
pub const VIEW_HEADER_BYTES: usize = 6;

/// Bytes of a view's record, at least: three fields of one byte, one corner.
pub(super) const VIEW_BYTES_LEAST: usize = 3 + CORNER_BYTES;

/// A stored coordinate counts these steps of an [`ImagePoint`]: 1/8 px.
const GRID: i32 = 2;

// A corner's word: x, y, level, commonness from the lowest bit up.
const COORDINATE_BITS: u32 = 13;
const COORDINATE_MASK: u32 = (1 << COORDINATE_BITS) - 1;
const COORDINATE_LAST: i32 = COORDINATE_MASK as i32 * GRID;
const LEVEL_SHIFT: u32 = 2 * COORDINATE_BITS;
const LEVEL_BITS: u32 = 3;
const COMMONNESS_SHIFT: u32 = LEVEL_SHIFT + LEVEL_BITS;
const KEY_MASK: u32 = (1 << COMMONNESS_SHIFT) - 1;

const _: () = assert!((SIDE_LIMIT as i32 - 1) * SUBPIXEL <= COORDINATE_LAST && SUBPIXEL % GRID == 0);
const _: () = assert!(LEVELS <= 1 << LEVEL_BITS);
// Every value of the three highest bits is a commonness, so a reader has none to refuse.
const _: () = assert!(*COMMONNESS.end() as i32 - *COMMONNESS.start() as i32 == (u32::MAX >> COMMONNESS_SHIFT) as i32);

/// The corners of one enrolled frame, decoded where they are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredView<'a> {
    landmark: u32,
    width: u16,
    height: u16,
    corners: &'a [[u8; CORNER_BYTES]],
}

/// What precedes the corners, as `postcard` writes it.
#[derive(Serialize, Deserialize)]
struct Fields {
    width: u16,
    height: u16,
    corners: u16,
}

/// Bytes of three over-long or largest 16-bit integers.
const FIELDS_BYTES: usize = 9;

impl<'a> StoredView<'a> {
    /// The number of the landmark that this is a view of.
    pub const fn landmark(&self) -> u32 {
        self.landmark
    }

    /// Columns of the enrolled frame.
    pub const fn width(&self) -> u16 {
        self.width
    }

    /// Rows of the enrolled frame.
    pub const fn height(&self) -> u16 {
        self.height
    }

    /// How many corners it has; at least one, at most the table's limit.
    pub const fn len(&self) -> usize {
        self.corners.len()
    }

    /// Never true for a view of a table: each has a corner.
    pub const fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Corner `index`, in the order of level, row, column.
    #[inline]
    pub fn get(&self, index: usize) -> Option<Feature> {
        self.corners.get(index).map(unpacked)
    }

    /// The corners in the order of level, row, column.
    #[inline]
    pub fn features(&self) -> impl ExactSizeIterator<Item = Feature> + DoubleEndedIterator + Clone + 'a {
        self.corners.iter().map(unpacked)
    }

    /// Decodes a record. With `trusted`, an earlier call has accepted the very same bytes with the same limit, and
    /// what that call checked is not checked again.
    pub(super) fn decode(
        payload: &'a [u8],
        landmark: u32,
        corners_limit: u16,
        trusted: bool,
    ) -> Result<Self, RecordFault> {
        let (fields, rest) = postcard::take_from_bytes::<Fields>(payload).map_err(|_| RecordFault::Form)?;
        let fields_bytes = payload.len().saturating_sub(rest.len());
        let (corners, left_over) = rest.as_chunks::<CORNER_BYTES>();
        let Fields { width, height, corners: count } = fields;
        if corners.len() != usize::from(count) || !left_over.is_empty() {
            let expected = usize::from(count).saturating_mul(CORNER_BYTES).saturating_add(fields_bytes);
            return Err(RecordFault::Length { found: payload.len(), expected });
        }
        let view = Self { landmark, width, height, corners };
        if trusted {
            return Ok(view);
        }
        let mut canonical = [0; FIELDS_BYTES];
        let canonical = postcard::to_slice(&fields, &mut canonical).map_err(|_| RecordFault::NotCanonical)?;
        if !payload.starts_with(canonical) || canonical.len() != fields_bytes {
            return Err(RecordFault::NotCanonical);
        }
        check_counts(width, height, corners.len(), corners_limit)?;
        let mut order = CornerOrder::new(width, height);
        for (index, corner) in corners.iter().enumerate() {
            order.follow(word(corner)).map_err(|fault| RecordFault::Corner { index, fault })?;
        }
        Ok(view)
    }
}

/// Writes a view's record to the beginning of `buffer` and returns it. A record has at most [`VIEW_HEADER_BYTES`] and
/// [`CORNER_BYTES`] for each corner.
///
/// `features` stand on the 1/8 px grid ([`on_grid`]) and are sorted by [`corner_key`], without two of the same key;
/// `corners_limit` is the limit of the table that the view is for.
///
/// # Errors
///
/// A view that no reader would accept, with the corner at fault; a buffer that is too small.
pub fn encode_view<'b>(
    corners_limit: u16,
    width: u16,
    height: u16,
    features: &[Feature],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    check_counts(width, height, features.len(), corners_limit)?;
    let mut scratch = [0; FIELDS_BYTES];
    let fields = Fields { width, height, corners: features.len() as u16 };
    let fields = postcard::to_slice(&fields, &mut scratch).map_err(|_| RecordFault::Form)?;
    let needed = features.len().saturating_mul(CORNER_BYTES).saturating_add(fields.len());
    let available = buffer.len();
    let record = buffer.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, available })?;
    for (slot, byte) in record.iter_mut().zip(fields.iter()) {
        *slot = *byte;
    }
    let mut order = CornerOrder::new(width, height);
    let corners = record.get_mut(fields.len()..).unwrap_or_default();
    for (index, (slot, feature)) in corners.as_chunks_mut().0.iter_mut().zip(features).enumerate() {
        let word = packed(feature).and_then(|word| order.follow(word).map(|()| word));
        let word = word.map_err(|fault| RecordFault::Corner { index, fault })?;
        *slot = joined::<CORNER_BYTES>(&[&word.to_le_bytes(), &feature.signature.to_bytes()]);
    }
    Ok(record)
}

/// The corner's place in the order of a view, by level, then row, then column: sort by it, and keep one corner of each
/// key. Commonness and signature take no part: two corners at one place of a level are two of the same key, whatever
/// else they differ in, and no view holds both.
///
/// It is `x | y << 13 | level << 26` with x and y in 1/8 px, the lower 29 bits of the word that a packed corner begins
/// with.
///
/// ```
/// use daymark_core::feature::Feature;
/// use daymark_core::point::ImagePoint;
/// use daymark_core::table::corner_key;
///
/// let corner = Feature { position: ImagePoint::new(6, 4), level: 1, ..Feature::default() };
/// assert_eq!(corner_key(&corner), Ok(3 | 2 << 13 | 1 << 26));
/// assert_eq!(corner_key(&Feature { commonness: 5, ..corner }), corner_key(&corner));
/// ```
///
/// # Errors
///
/// [`CornerFault::Level`], [`CornerFault::OutsideFrame`] or [`CornerFault::OffGrid`]: no view can hold it.
pub const fn corner_key(feature: &Feature) -> Result<u32, CornerFault> {
    let ImagePoint { x, y } = feature.position;
    if feature.level >= LEVELS {
        return Err(CornerFault::Level { found: feature.level });
    }
    if x < 0 || y < 0 || x > COORDINATE_LAST || y > COORDINATE_LAST {
        return Err(CornerFault::OutsideFrame { x, y });
    }
    if x % GRID != 0 || y % GRID != 0 {
        return Err(CornerFault::OffGrid { x, y });
    }
    Ok((x / GRID) as u32 | ((y / GRID) as u32) << COORDINATE_BITS | (feature.level as u32) << LEVEL_SHIFT)
}

/// The place nearest to `position` that a view of a `width` x `height` frame can store a corner at: on the grid of
/// 1/8 px and within the frame. Half-way between two it is the one that is a multiple of 1/4 px, so that rounding
/// shifts a picture's corners in no direction.
///
/// For enrollment, before corners are sorted: two neighbours can come to one place.
///
/// ```
/// use daymark_core::point::ImagePoint;
/// use daymark_core::table::on_grid;
///
/// assert_eq!(on_grid(ImagePoint::new(801, 803), 640, 480), ImagePoint::new(800, 804));
/// assert_eq!(on_grid(ImagePoint::new(-3, 7_700), 640, 480), ImagePoint::new(0, 479 * 16));
/// ```
#[must_use]
pub fn on_grid(position: ImagePoint, width: u16, height: u16) -> ImagePoint {
    // Exactly half-way is an odd coordinate; bit 1 tells which of its neighbours is a multiple of 4.
    let nearest = |x: i32| x.saturating_add(x & (x >> 1) & 1) & -GRID;
    let within = |x: i32, side: u16| nearest(x.min(last(side)).max(0));
    ImagePoint::new(within(position.x, width), within(position.y, height))
}

/// The largest coordinate in a frame of `side` columns or rows.
fn last(side: u16) -> i32 {
    i32::from(side.saturating_sub(1)).saturating_mul(SUBPIXEL)
}

/// The word that a packed corner begins with.
fn packed(feature: &Feature) -> Result<u32, CornerFault> {
    let key = corner_key(feature)?;
    let found = feature.commonness;
    if !COMMONNESS.contains(&found) {
        return Err(CornerFault::Commonness { found });
    }
    let steps = found.wrapping_sub(*COMMONNESS.start());
    Ok(key | (steps as u32) << COMMONNESS_SHIFT)
}

const fn check_counts(width: u16, height: u16, corners: usize, corners_limit: u16) -> Result<(), RecordFault> {
    if width == 0 || height == 0 || width > SIDE_LIMIT || height > SIDE_LIMIT {
        return Err(RecordFault::FrameSize { width, height });
    }
    if corners == 0 || corners > corners_limit as usize {
        return Err(RecordFault::CornerCount { found: corners, allowed: corners_limit });
    }
    Ok(())
}

/// Goes through the words of a view's corners and refuses what cannot be.
struct CornerOrder {
    x_last: i32,
    y_last: i32,
    least: u32,
}

impl CornerOrder {
    fn new(width: u16, height: u16) -> Self {
        Self { x_last: last(width), y_last: last(height), least: 0 }
    }

    fn follow(&mut self, word: u32) -> Result<(), CornerFault> {
        let (ImagePoint { x, y }, level) = place(word);
        if level >= LEVELS {
            return Err(CornerFault::Level { found: level });
        }
        if x > self.x_last || y > self.y_last {
            return Err(CornerFault::OutsideFrame { x, y });
        }
        let key = word & KEY_MASK;
        if key < self.least {
            return Err(CornerFault::Order);
        }
        self.least = key.saturating_add(1);
        Ok(())
    }
}

#[inline]
const fn word(corner: &[u8; CORNER_BYTES]) -> u32 {
    let [w0, w1, w2, w3, ..] = *corner;
    u32::from_le_bytes([w0, w1, w2, w3])
}

/// The place and level in a corner's word.
#[inline]
const fn place(word: u32) -> (ImagePoint, u8) {
    let x = word & COORDINATE_MASK;
    let y = (word >> COORDINATE_BITS) & COORDINATE_MASK;
    (ImagePoint::new(x as i32 * GRID, y as i32 * GRID), (word >> LEVEL_SHIFT & ((1 << LEVEL_BITS) - 1)) as u8)
}

#[inline]
const fn commonness(word: u32) -> i8 {
    ((word >> COMMONNESS_SHIFT) as i8).wrapping_add(*COMMONNESS.start())
}

#[inline]
fn unpacked(corner: &[u8; CORNER_BYTES]) -> Feature {
    let word = word(corner);
    let (position, level) = place(word);
    let [_, _, _, _, signature @ ..] = *corner;
    Feature { position, level, commonness: commonness(word), signature: Signature::from_bytes(signature) }
}
