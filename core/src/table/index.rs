//! The index: where each record is, and the checks that make offsets safe to follow.

use super::checksum::joined;
use super::landmark::{LANDMARK_BYTES, LANDMARK_BYTES_LEAST};
use super::model::{MODEL_BYTES_LEAST, MODEL_BYTES_MOST};
use super::view::{CORNER_BYTES, VIEW_BYTES_LEAST, VIEW_HEADER_BYTES};
use super::{Header, IndexFault, RecordKind, TableError};

/// Bytes of a landmark's entry in the index.
pub const LANDMARK_ENTRY_BYTES: usize = 12;

/// Bytes of a view's entry in the index.
pub const VIEW_ENTRY_BYTES: usize = 16;

/// Bytes of a model's entry in the index; there is one for each landmark.
pub const MODEL_ENTRY_BYTES: usize = 12;

/// Where a record is, and its CRC-32.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) offset: u32,
    pub(super) length: u32,
    pub(super) checksum: u32,
}

/// A view's entry: its landmark as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ViewEntry {
    pub(super) landmark: u32,
    pub(super) record: Entry,
}

impl Entry {
    pub(super) const fn from_bytes(bytes: &[u8; LANDMARK_ENTRY_BYTES]) -> Self {
        let [o0, o1, o2, o3, l0, l1, l2, l3, checksum @ ..] = *bytes;
        Self {
            offset: u32::from_le_bytes([o0, o1, o2, o3]),
            length: u32::from_le_bytes([l0, l1, l2, l3]),
            checksum: u32::from_le_bytes(checksum),
        }
    }

    pub(super) fn to_bytes(self) -> [u8; LANDMARK_ENTRY_BYTES] {
        joined(&[&self.offset.to_le_bytes(), &self.length.to_le_bytes(), &self.checksum.to_le_bytes()])
    }

    /// The record within the table's bytes.
    pub(super) fn record(self, table: &[u8]) -> Result<&[u8], TableError> {
        let end = u64::from(self.offset).saturating_add(u64::from(self.length));
        usize::try_from(end)
            .ok()
            .and_then(|end| table.get(self.offset as usize..end))
            .ok_or(TableError::Truncated { needed: end, available: table.len() as u64 })
    }
}

impl ViewEntry {
    pub(super) const fn from_bytes(bytes: &[u8; VIEW_ENTRY_BYTES]) -> Self {
        let [m0, m1, m2, m3, record @ ..] = *bytes;
        Self { landmark: u32::from_le_bytes([m0, m1, m2, m3]), record: Entry::from_bytes(&record) }
    }

    pub(super) fn to_bytes(self) -> [u8; VIEW_ENTRY_BYTES] {
        joined(&[&self.landmark.to_le_bytes(), &self.record.to_bytes()])
    }
}

/// Goes through an index once, entry by entry, and refuses what does not continue the entry before.
#[derive(Debug, Clone)]
pub(super) struct IndexCheck {
    file_length: u32,
    landmark_count: u32,
    view_longest: u32,
    /// Entries seen.
    landmarks: u32,
    views: u32,
    /// Landmarks `0..with_views` have views so far.
    with_views: u32,
    /// Entries of models seen, and how many of them are not empty.
    model_entries: u32,
    models: u32,
    has_models: bool,
    /// Where the last record ends.
    end: u32,
    longest: Longest,
}

/// Bytes of the longest records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Longest {
    /// Of landmarks and views, which a walk over the table reads.
    pub(super) walked: u32,
    /// Of models.
    pub(super) model: u32,
}

impl IndexCheck {
    /// For the index of the table with `header`, whose records end at `file_length` or before.
    pub(super) fn new(header: &Header, file_length: u32) -> Self {
        Self {
            file_length,
            landmark_count: header.landmark_count(),
            view_longest: VIEW_HEADER_BYTES as u32 + u32::from(header.corners_limit()) * CORNER_BYTES as u32,
            landmarks: 0,
            views: 0,
            with_views: 0,
            model_entries: 0,
            models: 0,
            has_models: header.has_models(),
            end: header.records_begin(),
            longest: Longest::default(),
        }
    }

    /// The next landmark's entry.
    pub(super) fn landmark(&mut self, entry: Entry) -> Result<(), TableError> {
        let number = self.landmarks;
        self.landmarks = number.saturating_add(1);
        let length = self.record(entry, LANDMARK_BYTES_LEAST as u32, LANDMARK_BYTES as u32);
        self.walked(length).map_err(|fault| TableError::Index { kind: RecordKind::Landmark, number, fault })
    }

    /// The next view's entry.
    pub(super) fn view(&mut self, entry: ViewEntry) -> Result<(), TableError> {
        let number = self.views;
        self.views = number.saturating_add(1);
        self.turn(entry.landmark)
            .and_then(|()| {
                let length = self.record(entry.record, VIEW_BYTES_LEAST as u32, self.view_longest);
                self.walked(length)
            })
            .map_err(|fault| TableError::Index { kind: RecordKind::View, number, fault })
    }

    /// The entry of the next landmark's model.
    pub(super) fn model(&mut self, entry: Entry) -> Result<(), TableError> {
        let number = self.model_entries;
        self.model_entries = number.saturating_add(1);
        let wrong = |fault| TableError::Index { kind: RecordKind::Model, number, fault };
        if entry.length == 0 {
            let empty = Entry { offset: self.end, length: 0, checksum: 0 };
            return if entry == empty { Ok(()) } else { Err(wrong(IndexFault::EmptyEntry)) };
        }
        let length = self.record(entry, MODEL_BYTES_LEAST as u32, MODEL_BYTES_MOST).map_err(wrong)?;
        self.models = self.models.saturating_add(1);
        self.longest.model = self.longest.model.max(length);
        Ok(())
    }

    /// Where the last record ends.
    pub(super) const fn end(&self) -> u32 {
        self.end
    }

    fn walked(&mut self, length: Result<u32, IndexFault>) -> Result<(), IndexFault> {
        self.longest.walked = self.longest.walked.max(length?);
        Ok(())
    }

    /// After the last entry: the lengths of the longest records, if the last one ends at `file_length`.
    pub(super) fn finish(&self, file_length: u32) -> Result<Longest, TableError> {
        if self.has_models && self.models == 0 {
            let number = self.landmark_count.saturating_sub(1);
            return Err(TableError::Index { kind: RecordKind::Model, number, fault: IndexFault::NoModels });
        }
        let fault = if self.with_views != self.landmark_count {
            IndexFault::LandmarkWithoutView { with_views: self.with_views, landmarks: self.landmark_count }
        } else if self.end != file_length {
            IndexFault::End { found: u64::from(self.end), file: file_length }
        } else {
            return Ok(self.longest);
        };
        Err(TableError::Index { kind: RecordKind::View, number: self.views.saturating_sub(1), fault })
    }

    /// A view's landmark is the one of the view before it, or the next.
    fn turn(&mut self, found: u32) -> Result<(), IndexFault> {
        let least = self.with_views.saturating_sub(1);
        let most = self.with_views.min(self.landmark_count.saturating_sub(1));
        if !(least..=most).contains(&found) {
            return Err(IndexFault::Landmark { found, least, most });
        }
        self.with_views = self.with_views.max(found.saturating_add(1));
        Ok(())
    }

    /// A record begins where the one before it ends. Returns its length.
    fn record(&mut self, entry: Entry, least: u32, most: u32) -> Result<u32, IndexFault> {
        let Entry { offset, length, .. } = entry;
        if offset != self.end {
            return Err(IndexFault::Offset { found: offset, expected: self.end });
        }
        if !(least..=most).contains(&length) {
            return Err(IndexFault::Length { found: length, least, most });
        }
        let end = offset.checked_add(length).filter(|end| *end <= self.file_length).ok_or(IndexFault::End {
            found: u64::from(offset).saturating_add(u64::from(length)),
            file: self.file_length,
        })?;
        self.end = end;
        Ok(length)
    }
}
