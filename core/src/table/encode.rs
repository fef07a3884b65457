//! How a table is written: one definition for enrollment, the tests and the golden files.

use super::checksum::{TableId, crc32};
use super::header::{FORMAT_VERSION, VERSION_WITHOUT_MODELS};
use super::index::{Entry, IndexCheck, ViewEntry};
use super::landmark::{LandmarkRecord, LastName};
use super::{
    HEADER_BYTES, Header, HeaderFault, IndexFault, LANDMARK_ENTRY_BYTES, MODEL_ENTRY_BYTES, RecordFault, RecordKind,
    StoredModel, StoredView, TableError, TableLimit, VIEW_ENTRY_BYTES,
};
use crate::profile::Profile;
use core::fmt;

pub use super::landmark::encode_landmark;
pub use super::model::encode_model;
pub use super::view::encode_view;

/// Why something cannot be written; the caller knows which record it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EncodeError {
    /// No reader would accept the record. Correct what it is made from.
    Record(RecordFault),
    /// No reader would accept the table's limits. Correct them.
    Header(HeaderFault),
    /// No reader would accept the record in this place. Give views in the order of their landmarks.
    Index(IndexFault),
    /// The table would be larger than any reader takes. Split it.
    LimitExceeded {
        /// What there is too much of.
        limit: TableLimit,
        /// How much there is.
        found: u64,
        /// How much is allowed.
        allowed: u64,
    },
    /// The buffer cannot take the record. Give a larger one.
    BufferTooSmall {
        /// Bytes of the record.
        needed: usize,
        /// Bytes of the buffer.
        available: usize,
    },
    /// Another number of records than was announced, or a landmark after the first view.
    Count {
        /// The kind of the records.
        kind: RecordKind,
        /// How many came, with the one that was too much.
        found: u32,
        /// How many were announced.
        announced: u32,
    },
}

/// Makes the header and the index of a table whose records go by one after the other: first every landmark, sorted by
/// name, then every view, in the order of their landmarks, then, if there are models, that of every landmark or none.
///
/// It holds no records and no index. What each call returns goes to the table in the same order: the entries after
/// the first [`HEADER_BYTES`], the records after all entries, the header to the front at the end. It accepts nothing
/// that a reader would refuse, so the same records always give the same bytes and every table that it makes opens.
///
/// ```
/// use daymark_core::profile::Profile;
/// use daymark_core::table::{EncodeError, LandmarkTable, TableEncoder};
///
/// // The smallest table: nothing is enrolled yet.
/// let header = TableEncoder::new(Profile::Handheld, 100, 0, 0)?.finish()?;
/// assert_eq!(LandmarkTable::open(&header).map(|table| table.view_count()), Ok(0));
/// # Ok::<(), EncodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct TableEncoder {
    header: Header,
    check: IndexCheck,
    id: TableId,
    last_name: LastName,
    landmarks: u32,
    views: u32,
    models: u32,
}

impl TableEncoder {
    /// A table of `landmark_count` landmarks and `view_count` views with at most `corners_limit` corners each.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Header`] or [`EncodeError::LimitExceeded`].
    pub fn new(
        profile: Profile,
        corners_limit: u16,
        landmark_count: u32,
        view_count: u32,
    ) -> Result<Self, EncodeError> {
        Self::of_version(VERSION_WITHOUT_MODELS, profile, corners_limit, landmark_count, view_count)
    }

    /// The same for a table in which some landmark has a model.
    ///
    /// # Errors
    ///
    /// As [`TableEncoder::new`].
    pub fn with_models(
        profile: Profile,
        corners_limit: u16,
        landmark_count: u32,
        view_count: u32,
    ) -> Result<Self, EncodeError> {
        Self::of_version(FORMAT_VERSION, profile, corners_limit, landmark_count, view_count)
    }

    fn of_version(
        version: u16,
        profile: Profile,
        corners_limit: u16,
        landmark_count: u32,
        view_count: u32,
    ) -> Result<Self, EncodeError> {
        let header = Header::new(version, profile, corners_limit, landmark_count, view_count)?;
        Ok(Self {
            header,
            check: IndexCheck::new(&header, u32::MAX),
            id: TableId::new(),
            last_name: LastName::new(),
            landmarks: 0,
            views: 0,
            models: 0,
        })
    }

    /// Where the first record goes, right after the index.
    pub const fn records_begin(&self) -> usize {
        self.header.records_begin() as usize
    }

    /// Takes the next landmark's record, as [`encode_landmark`] gives it, and returns its entry in the index.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Record`] with [`RecordFault::NameOrder`] if it does not sort after the one before, and all that
    /// a reader would refuse; [`EncodeError::Count`] if it is one too many.
    pub fn push_landmark(&mut self, record: &[u8]) -> Result<[u8; LANDMARK_ENTRY_BYTES], EncodeError> {
        let (found, announced) = (self.landmarks.saturating_add(1), self.header.landmark_count());
        if found > announced || self.views > 0 {
            return Err(EncodeError::Count { kind: RecordKind::Landmark, found, announced });
        }
        self.last_name.follow(LandmarkRecord::decode(record)?.name)?;
        let entry = self.entry(record, crc32(&[record]))?;
        self.check.landmark(entry)?;
        self.landmarks = found;
        let bytes = entry.to_bytes();
        self.id.update(&bytes);
        Ok(bytes)
    }

    /// Takes the next view's record, as [`encode_view`] gives it, and returns its entry in the index.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Index`] if `landmark` is neither that of the view before nor the next, and all that a reader
    /// would refuse; [`EncodeError::Count`] if it is one too many, or landmarks are still to come.
    pub fn push_view(&mut self, landmark: u32, record: &[u8]) -> Result<[u8; VIEW_ENTRY_BYTES], EncodeError> {
        self.complete(RecordKind::Landmark)?;
        let (found, announced) = (self.views.saturating_add(1), self.header.view_count());
        if found > announced {
            return Err(EncodeError::Count { kind: RecordKind::View, found, announced });
        }
        StoredView::decode(record, landmark, self.header.corners_limit(), false)?;
        let entry = ViewEntry { landmark, record: self.entry(record, record_checksum(landmark, record))? };
        self.check.view(entry)?;
        self.views = found;
        let bytes = entry.to_bytes();
        self.id.update(&bytes);
        Ok(bytes)
    }

    /// Takes the next landmark's model, as [`encode_model`] gives it, or none, and returns its entry in the index.
    /// `landmark_views` is how many views the landmark has.
    ///
    /// # Errors
    ///
    /// All that a reader would refuse; [`EncodeError::Count`] if it is one too many, or views are still to come.
    pub fn push_model(
        &mut self,
        landmark_views: u32,
        record: Option<&[u8]>,
    ) -> Result<[u8; MODEL_ENTRY_BYTES], EncodeError> {
        self.complete(RecordKind::View)?;
        let (number, announced) = (self.models, self.announced(RecordKind::Model));
        let found = number.saturating_add(1);
        if found > announced {
            return Err(EncodeError::Count { kind: RecordKind::Model, found, announced });
        }
        let entry = match record {
            Some(record) => {
                StoredModel::decode(record, landmark_views, self.header.corners_limit(), false)?;
                self.entry(record, record_checksum(number, record))?
            }
            None => Entry { offset: self.check.end(), length: 0, checksum: 0 },
        };
        self.check.model(entry)?;
        self.models = found;
        let bytes = entry.to_bytes();
        self.id.update(&bytes);
        Ok(bytes)
    }

    /// The header, after the last record.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Count`] if records are missing, [`EncodeError::Index`] if the last landmarks have no view, or models were
    /// announced and no landmark has one.
    pub fn finish(self) -> Result<[u8; HEADER_BYTES], EncodeError> {
        self.complete(RecordKind::Landmark)?;
        self.complete(RecordKind::View)?;
        self.complete(RecordKind::Model)?;
        let end = self.check.end();
        self.check.finish(end)?;
        let header = self.header.completed(end, 0)?;
        Ok(header.completed(end, header.id_after(self.id))?.to_bytes())
    }

    fn complete(&self, kind: RecordKind) -> Result<(), EncodeError> {
        let announced = self.announced(kind);
        let found = match kind {
            RecordKind::Landmark => self.landmarks,
            RecordKind::View => self.views,
            RecordKind::Model => self.models,
        };
        if found == announced { Ok(()) } else { Err(EncodeError::Count { kind, found, announced }) }
    }

    fn announced(&self, kind: RecordKind) -> u32 {
        match kind {
            RecordKind::Landmark => self.header.landmark_count(),
            RecordKind::View => self.header.view_count(),
            RecordKind::Model if self.header.has_models() => self.header.landmark_count(),
            RecordKind::Model => 0,
        }
    }

    fn entry(&self, record: &[u8], checksum: u32) -> Result<Entry, EncodeError> {
        let end = u64::from(self.check.end()).saturating_add(record.len() as u64);
        if u32::try_from(end).is_err() {
            let (limit, allowed) = (TableLimit::FileBytes, u64::from(u32::MAX));
            return Err(EncodeError::LimitExceeded { limit, found: end, allowed });
        }
        Ok(Entry { offset: self.check.end(), length: record.len() as u32, checksum })
    }
}

/// The CRC-32 of a view's or a model's record: over the number of its landmark, then its bytes, so that no damage to an
/// index that was sound when the table was opened gives it to another landmark.
pub(super) fn record_checksum(landmark: u32, record: &[u8]) -> u32 {
    crc32(&[&landmark.to_le_bytes(), record])
}

impl From<RecordFault> for EncodeError {
    fn from(fault: RecordFault) -> Self {
        Self::Record(fault)
    }
}

/// The checks that the encoder shares with the readers give only these.
impl From<TableError> for EncodeError {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Header(fault) => Self::Header(fault),
            TableError::Index { fault, .. } => Self::Index(fault),
            TableError::Record { fault, .. } => Self::Record(fault),
            TableError::LimitExceeded { limit, found, allowed } => Self::LimitExceeded { limit, found, allowed },
            _ => Self::Record(RecordFault::Form),
        }
    }
}

impl fmt::Display for EncodeError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Record(fault) => write!(out, "the record cannot be stored: {fault}"),
            Self::Header(fault) => write!(out, "the table cannot be written: {fault}"),
            Self::Index(fault) => write!(out, "the record cannot be stored in this place: {fault}"),
            Self::LimitExceeded { limit, found, allowed } => {
                write!(out, "{found} {limit}, but a landmark table holds at most {allowed}: split the table")
            }
            Self::BufferTooSmall { needed, available } => {
                write!(out, "the record needs a buffer of {needed} bytes, {available} were given: give a larger one")
            }
            Self::Count { kind, found, announced } => {
                write!(out, "{found} records of kind {kind} where {announced} were announced")
            }
        }
    }
}

impl core::error::Error for EncodeError {}
