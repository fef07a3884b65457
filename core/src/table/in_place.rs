//! The reader in place: a table in flash, in a memory map, or in a file that was read.

use super::checksum::{TableId, crc32};
use super::encode::record_checksum;
use super::index::{Entry, IndexCheck, ViewEntry};
use super::landmark::{LandmarkRecord, LastName};
use super::{
    HEADER_BYTES, Header, LANDMARK_ENTRY_BYTES, Landmark, MODEL_ENTRY_BYTES, RecordKind, StoredModel, StoredView,
    TableError, VIEW_ENTRY_BYTES, ViewSource,
};
use crate::profile::Profile;
use core::ops::Range;

/// A table that is read where it lies. It borrows the bytes and holds nothing else, so that copies are free and
/// threads may each have one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LandmarkTable<'a> {
    bytes: &'a [u8],
    header: Header,
    landmark_index: &'a [[u8; LANDMARK_ENTRY_BYTES]],
    view_index: &'a [[u8; VIEW_ENTRY_BYTES]],
    /// Empty for a table without models.
    model_index: &'a [[u8; MODEL_ENTRY_BYTES]],
    /// Every record was read and accepted; the borrow keeps the bytes as they were.
    verified: bool,
}

impl<'a> LandmarkTable<'a> {
    /// Opens the table that `bytes` are, all of them. Checks the header, the index and the landmarks' records, and
    /// reads no view: about 110 bytes for each landmark and 16 for each view.
    ///
    /// # Errors
    ///
    /// Whatever a [`TableError`] can say but [`BufferTooSmall`](TableError::BufferTooSmall) and
    /// [`NoSuchRecord`](TableError::NoSuchRecord).
    pub fn open(bytes: &'a [u8]) -> Result<Self, TableError> {
        let header = Header::decode(bytes)?;
        header.check_length(bytes.len() as u64)?;
        let cut = TableError::Truncated { needed: u64::from(header.file_length()), available: bytes.len() as u64 };
        let part = |range: Range<u32>| bytes.get(range.start as usize..range.end as usize).ok_or(cut);
        let landmark_index = part(HEADER_BYTES as u32..header.view_index_begin())?;
        let view_index = part(header.view_index_begin()..header.model_index_begin())?;
        let model_index = part(header.model_index_begin()..header.records_begin())?;

        let mut id = TableId::new();
        id.update(landmark_index);
        id.update(view_index);
        id.update(model_index);
        header.check_id(id)?;

        let (landmark_index, _) = landmark_index.as_chunks();
        let (view_index, _) = view_index.as_chunks();
        let (model_index, _) = model_index.as_chunks();
        let mut check = IndexCheck::new(&header, header.file_length());
        landmark_index.iter().try_for_each(|entry| check.landmark(Entry::from_bytes(entry)))?;
        view_index.iter().try_for_each(|entry| check.view(ViewEntry::from_bytes(entry)))?;
        model_index.iter().try_for_each(|entry| check.model(Entry::from_bytes(entry)))?;
        check.finish(header.file_length())?;

        let table = Self { bytes, header, landmark_index, view_index, model_index, verified: false };
        let mut last_name = LastName::new();
        for (number, entry) in (0..).zip(landmark_index) {
            let record = table.landmark_record(number, Entry::from_bytes(entry))?;
            last_name.follow(record.name).map_err(|fault| landmark_fault(number, fault))?;
        }
        Ok(table)
    }

    /// The same table, with every view read and accepted once. Later reads then check nothing again, because the
    /// bytes are borrowed and cannot have changed: a view costs its few fields, whatever the number of its corners.
    /// This is for a table that is walked for every frame.
    ///
    /// Not for bytes that change behind the borrow, as a memory map of a file that someone else rewrites: reads stay
    /// safe and give corners of the new bytes, with no check of what they mean.
    ///
    /// # Errors
    ///
    /// The first damaged or wrong record.
    pub fn verified(mut self) -> Result<Self, TableError> {
        self.verify()?;
        self.verified = true;
        Ok(self)
    }

    /// Reads every view and every model, and accepts the table or says what is wrong with the first record that is.
    ///
    /// # Errors
    ///
    /// [`TableError::RecordChecksum`] or [`TableError::Record`].
    pub fn verify(&self) -> Result<(), TableError> {
        (0..self.view_count()).try_for_each(|number| self.view(number).map(|_| ()))?;
        (0..self.landmark_count()).try_for_each(|number| self.model(number).map(|_| ()))
    }

    /// The counts, limits and identity of the table.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// The class of device whose views the table holds.
    pub const fn profile(&self) -> Profile {
        self.header.profile()
    }

    /// How many landmarks the table holds.
    pub const fn landmark_count(&self) -> u32 {
        self.header.landmark_count()
    }

    /// How many views the table holds.
    pub const fn view_count(&self) -> u32 {
        self.header.view_count()
    }

    /// Landmark `number`. Finding its views takes O(log views).
    ///
    /// # Errors
    ///
    /// [`TableError::NoSuchRecord`]; the others only if the bytes changed after the table was opened.
    pub fn landmark(&self, number: u32) -> Result<Landmark<'a>, TableError> {
        let kind = RecordKind::Landmark;
        let entry = self.landmark_index.get(number as usize).ok_or(TableError::NoSuchRecord {
            kind,
            number,
            count: self.landmark_count(),
        })?;
        let LandmarkRecord { name, kind, position } = self.landmark_record(number, Entry::from_bytes(entry))?;
        let begin =
            |landmark| self.view_index.partition_point(|entry| ViewEntry::from_bytes(entry).landmark < landmark);
        let views = begin(number) as u32..begin(number.saturating_add(1)) as u32;
        Ok(Landmark { name, kind, position, views })
    }

    /// View `number`.
    ///
    /// # Errors
    ///
    /// [`TableError::RecordChecksum`], [`TableError::Record`] or [`TableError::NoSuchRecord`].
    pub fn view(&self, number: u32) -> Result<StoredView<'a>, TableError> {
        let kind = RecordKind::View;
        let entry = self.view_index.get(number as usize).ok_or(TableError::NoSuchRecord {
            kind,
            number,
            count: self.view_count(),
        })?;
        let entry = ViewEntry::from_bytes(entry);
        let record = entry.record.record(self.bytes)?;
        if self.verified {
            return StoredView::decode(record, entry.landmark, self.header.corners_limit(), true)
                .map_err(|fault| TableError::Record { kind, number, fault });
        }
        checked_view(&self.header, number, entry, record)
    }

    /// The model of landmark `number`, if it has one.
    ///
    /// # Errors
    ///
    /// [`TableError::RecordChecksum`], [`TableError::Record`] or [`TableError::NoSuchRecord`].
    pub fn model(&self, number: u32) -> Result<Option<StoredModel<'a>>, TableError> {
        let views = self.landmark(number)?.views;
        let Some(entry) = self.model_index.get(number as usize).map(Entry::from_bytes) else { return Ok(None) };
        if entry.length == 0 {
            return Ok(None);
        }
        let record = entry.record(self.bytes)?;
        checked_model(&self.header, number, views, entry, record, self.verified).map(Some)
    }

    fn landmark_record(&self, number: u32, entry: Entry) -> Result<LandmarkRecord<'a>, TableError> {
        checked_landmark(number, entry, entry.record(self.bytes)?)
    }
}

impl ViewSource for LandmarkTable<'_> {
    type Error = TableError;

    fn header(&self) -> &Header {
        &self.header
    }

    fn buffer_bytes(&self) -> usize {
        0
    }

    fn view<'s>(&'s mut self, number: u32, _: &'s mut [u8]) -> Result<StoredView<'s>, TableError> {
        LandmarkTable::view(self, number)
    }

    fn landmark<'s>(&'s mut self, number: u32, _: &'s mut [u8]) -> Result<Landmark<'s>, TableError> {
        LandmarkTable::landmark(self, number)
    }

    fn model_bytes(&self) -> usize {
        0
    }

    fn model<'s>(&'s mut self, number: u32, _: &'s mut [u8]) -> Result<Option<StoredModel<'s>>, TableError> {
        LandmarkTable::model(self, number)
    }
}

/// A view's record: checksum, form and meaning.
pub(super) fn checked_view<'a>(
    header: &Header,
    number: u32,
    entry: ViewEntry,
    record: &'a [u8],
) -> Result<StoredView<'a>, TableError> {
    let kind = RecordKind::View;
    let (stored, computed) = (entry.record.checksum, record_checksum(entry.landmark, record));
    if stored != computed {
        return Err(TableError::RecordChecksum { kind, number, stored, computed });
    }
    StoredView::decode(record, entry.landmark, header.corners_limit(), false).map_err(|fault| TableError::Record {
        kind,
        number,
        fault,
    })
}

/// A model's record: checksum, form and meaning, unless all that was checked before.
pub(super) fn checked_model<'a>(
    header: &Header,
    number: u32,
    views: Range<u32>,
    entry: Entry,
    record: &'a [u8],
    trusted: bool,
) -> Result<StoredModel<'a>, TableError> {
    let kind = RecordKind::Model;
    if !trusted {
        let (stored, computed) = (entry.checksum, record_checksum(number, record));
        if stored != computed {
            return Err(TableError::RecordChecksum { kind, number, stored, computed });
        }
    }
    StoredModel::decode(record, views.len() as u32, header.corners_limit(), trusted)
        .map_err(|fault| TableError::Record { kind, number, fault })
}

/// A landmark's record: checksum, form and meaning.
pub(super) fn checked_landmark(number: u32, entry: Entry, record: &[u8]) -> Result<LandmarkRecord<'_>, TableError> {
    let (stored, computed) = (entry.checksum, crc32(&[record]));
    if stored != computed {
        return Err(TableError::RecordChecksum { kind: RecordKind::Landmark, number, stored, computed });
    }
    LandmarkRecord::decode(record).map_err(|fault| landmark_fault(number, fault))
}

pub(super) const fn landmark_fault(number: u32, fault: super::RecordFault) -> TableError {
    TableError::Record { kind: RecordKind::Landmark, number, fault }
}
