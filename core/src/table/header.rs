//! The first 40 bytes: what a table is, how large, and whose.

use super::checksum::{TableId, crc32, joined};
use super::{
    HeaderFault, LANDMARK_ENTRY_BYTES, MODEL_ENTRY_BYTES, TableError, TableLimit, VIEW_ENTRY_BYTES, VIEWS_LIMIT,
};
use crate::feature::SIGNATURE_BITS;
use crate::profile::Profile;
use core::cmp::Ordering;

/// The first eight bytes of every table, of every version: `DAYMARK` and the control character that ends a text file.
pub const MAGIC: [u8; 8] = *b"DAYMARK\x1A";

/// The newest format version that this program reads and writes: a table with models.
pub const FORMAT_VERSION: u16 = 2;

/// The version of a table without models.
pub const VERSION_WITHOUT_MODELS: u16 = 1;

/// Bytes of the header, of every version.
pub const HEADER_BYTES: usize = 40;

/// The counts, limits and identity of a table, checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    version: u16,
    profile: Profile,
    corners_limit: u16,
    landmark_count: u32,
    view_count: u32,
    file_length: u32,
    table_id: u64,
}

impl Header {
    /// The format version: 2 if a landmark of the table has a model, else 1.
    pub const fn version(&self) -> u16 {
        self.version
    }

    /// Whether a landmark of the table has a model.
    pub const fn has_models(&self) -> bool {
        self.version > VERSION_WITHOUT_MODELS
    }

    /// The class of device whose views the table holds.
    pub const fn profile(&self) -> Profile {
        self.profile
    }

    /// No view holds more corners than this.
    pub const fn corners_limit(&self) -> u16 {
        self.corners_limit
    }

    /// How many landmarks the table holds.
    pub const fn landmark_count(&self) -> u32 {
        self.landmark_count
    }

    /// How many views the table holds.
    pub const fn view_count(&self) -> u32 {
        self.view_count
    }

    /// Bytes of the whole table.
    pub const fn file_length(&self) -> u32 {
        self.file_length
    }

    /// A number made from the content: tables with different ids differ, and tables with the same id are the same
    /// unless someone worked at it or by a chance of about 2^-32. Reports name their table by it.
    pub const fn table_id(&self) -> u64 {
        self.table_id
    }

    /// Decodes the first [`HEADER_BYTES`] of `bytes`, and looks at nothing after them.
    ///
    /// ```
    /// use daymark_core::table::{Header, TableError};
    ///
    /// // A table at the beginning of a larger flash region: the header says how much of the region it is.
    /// fn table_in(region: &[u8]) -> Result<Option<&[u8]>, TableError> {
    ///     Ok(region.get(..Header::decode(region)?.file_length() as usize))
    /// }
    /// assert!(table_in(&[0xFF; 64]).is_err());
    /// ```
    ///
    /// # Errors
    ///
    /// [`TableError::Empty`], [`NotATable`](TableError::NotATable), [`Truncated`](TableError::Truncated),
    /// [`HeaderChecksum`](TableError::HeaderChecksum), [`NewerVersion`](TableError::NewerVersion),
    /// [`Header`](TableError::Header) or [`LimitExceeded`](TableError::LimitExceeded), in this order.
    pub fn decode(bytes: &[u8]) -> Result<Self, TableError> {
        if bytes.is_empty() {
            return Err(TableError::Empty);
        }
        if bytes.iter().zip(&MAGIC).any(|(found, expected)| found != expected) {
            return Err(TableError::NotATable { found: joined(&[bytes]) });
        }
        let cut = TableError::Truncated { needed: HEADER_BYTES as u64, available: bytes.len() as u64 };
        let header: &[u8; HEADER_BYTES] = bytes.first_chunk().ok_or(cut)?;
        let Parts { version, profile, reserved, bits, corners, landmarks, views, length, id, checksum } =
            Parts::of(header).ok_or(cut)?;
        let computed = crc32(&[header.get(..CHECKSUM_AT).unwrap_or_default()]);
        if checksum != computed {
            return Err(TableError::HeaderChecksum { stored: checksum, computed });
        }
        if version > FORMAT_VERSION {
            return Err(TableError::NewerVersion { found: version, supported: FORMAT_VERSION });
        }
        let fault = if version == 0 {
            HeaderFault::Version
        } else if reserved != 0 {
            HeaderFault::Reserved { found: reserved }
        } else if u32::from(bits) != SIGNATURE_BITS {
            HeaderFault::SignatureBits { found: bits, expected: SIGNATURE_BITS as u16 }
        } else if let Some(profile) = Profile::from_code(profile) {
            let header = Self::new(version, profile, corners, landmarks, views)?;
            return header.completed(length, id);
        } else {
            HeaderFault::Profile { code: profile }
        };
        Err(TableError::Header(fault))
    }

    /// A header without length and id, its limit and counts checked.
    pub(super) fn new(
        version: u16,
        profile: Profile,
        corners_limit: u16,
        landmark_count: u32,
        view_count: u32,
    ) -> Result<Self, TableError> {
        let allowed = super::corners_limit(profile);
        if !(1..=allowed).contains(&corners_limit) {
            return Err(TableError::Header(HeaderFault::CornersLimit { found: corners_limit, allowed }));
        }
        if view_count > VIEWS_LIMIT {
            let (found, allowed) = (u64::from(view_count), u64::from(VIEWS_LIMIT));
            return Err(TableError::LimitExceeded { limit: TableLimit::Views, found, allowed });
        }
        if landmark_count > view_count || (landmark_count == 0) != (view_count == 0) {
            let fault = HeaderFault::LandmarkCount { landmarks: landmark_count, views: view_count };
            return Err(TableError::Header(fault));
        }
        Ok(Self { version, profile, corners_limit, landmark_count, view_count, file_length: 0, table_id: 0 })
    }

    /// The header with its length and id, the length checked.
    pub(super) fn completed(self, file_length: u32, table_id: u64) -> Result<Self, TableError> {
        let needed = self.records_begin();
        if file_length < needed || (self.view_count == 0 && file_length != needed) {
            return Err(TableError::Header(HeaderFault::FileLength { found: file_length, needed }));
        }
        Ok(Self { file_length, table_id, ..self })
    }

    /// The header's bytes.
    pub(super) fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let identified = self.identified_bytes();
        let id = self.table_id.to_le_bytes();
        joined(&[&identified, &id, &crc32(&[&identified, &id]).to_le_bytes()])
    }

    /// The header's bytes before the id, which take part in it.
    fn identified_bytes(self) -> [u8; ID_AT] {
        joined(&[
            &MAGIC,
            &self.version.to_le_bytes(),
            &[self.profile.code(), 0],
            &(SIGNATURE_BITS as u16).to_le_bytes(),
            &self.corners_limit.to_le_bytes(),
            &self.landmark_count.to_le_bytes(),
            &self.view_count.to_le_bytes(),
            &self.file_length.to_le_bytes(),
        ])
    }

    /// The id of the table with this header, from the CRC-64 that has gone through its index.
    pub(super) fn id_after(self, mut index: TableId) -> u64 {
        index.update(&self.identified_bytes());
        index.finish()
    }

    /// Checks the id against the CRC-64 that has gone through the index.
    pub(super) fn check_id(&self, index: TableId) -> Result<(), TableError> {
        let (stored, computed) = (self.table_id, self.id_after(index));
        if stored == computed { Ok(()) } else { Err(TableError::IndexChecksum { stored, computed }) }
    }

    /// Checks the length against the bytes that are there.
    pub(super) fn check_length(&self, available: u64) -> Result<(), TableError> {
        let length = u64::from(self.file_length);
        match available.cmp(&length) {
            Ordering::Less => Err(TableError::Truncated { needed: length, available }),
            Ordering::Greater => Err(TableError::TrailingBytes { length, available }),
            Ordering::Equal => Ok(()),
        }
    }

    /// Where the index of the views begins.
    pub(super) const fn view_index_begin(&self) -> u32 {
        (HEADER_BYTES as u32).saturating_add(self.landmark_count.saturating_mul(LANDMARK_ENTRY_BYTES as u32))
    }

    /// Where the index of the views ends and that of the models begins, if there are any.
    pub(super) const fn model_index_begin(&self) -> u32 {
        self.view_index_begin().saturating_add(self.view_count.saturating_mul(VIEW_ENTRY_BYTES as u32))
    }

    /// Where the index ends and the records begin. [`VIEWS_LIMIT`] keeps it far below 2^32.
    pub(super) const fn records_begin(&self) -> u32 {
        let models = if self.has_models() { self.landmark_count } else { 0 };
        self.model_index_begin().saturating_add(models.saturating_mul(MODEL_ENTRY_BYTES as u32))
    }
}

/// Bytes before the table id.
const ID_AT: usize = 28;

/// Bytes before the header's CRC-32.
const CHECKSUM_AT: usize = 36;

/// The fields of a header as they stand in it, unchecked.
struct Parts {
    version: u16,
    profile: u8,
    reserved: u8,
    bits: u16,
    corners: u16,
    landmarks: u32,
    views: u32,
    length: u32,
    id: u64,
    checksum: u32,
}

impl Parts {
    /// Cannot fail for 40 bytes; written so that this needs no proof.
    fn of(header: &[u8; HEADER_BYTES]) -> Option<Self> {
        let (_, rest) = header.split_first_chunk::<{ MAGIC.len() }>()?;
        let (version, rest) = rest.split_first_chunk()?;
        let ([profile, reserved], rest) = rest.split_first_chunk()?;
        let (bits, rest) = rest.split_first_chunk()?;
        let (corners, rest) = rest.split_first_chunk()?;
        let (landmarks, rest) = rest.split_first_chunk()?;
        let (views, rest) = rest.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let (id, rest) = rest.split_first_chunk()?;
        Some(Self {
            version: u16::from_le_bytes(*version),
            profile: *profile,
            reserved: *reserved,
            bits: u16::from_le_bytes(*bits),
            corners: u16::from_le_bytes(*corners),
            landmarks: u32::from_le_bytes(*landmarks),
            views: u32::from_le_bytes(*views),
            length: u32::from_le_bytes(*length),
            id: u64::from_le_bytes(*id),
            checksum: u32::from_le_bytes(*rest.first_chunk()?),
        })
    }
}
