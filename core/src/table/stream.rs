//! The reader from a stream: a table on a card or in serial flash, one record in memory at a time.

use super::checksum::TableId;
use super::in_place::{checked_landmark, checked_model, checked_view, landmark_fault};
use super::index::{Entry, IndexCheck, Longest, ViewEntry};
use super::landmark::{LANDMARK_BYTES, LandmarkRecord, LastName};
use super::{
    HEADER_BYTES, Header, LANDMARK_ENTRY_BYTES, Landmark, MODEL_ENTRY_BYTES, RecordKind, StoredModel, StoredView,
    StreamError, TableError, VIEW_ENTRY_BYTES, ViewSource,
};
use embedded_io::{Read, Seek, SeekFrom};

/// Index entries that are read in one go, so that a walk over the views does not go back to the index for each.
const ENTRIES: usize = 16;

/// A table that is read record by record. It makes the same checks as [`LandmarkTable`](super::LandmarkTable), at
/// every read, and gives the same results.
///
/// It holds 16 index entries, 256 bytes; records go into the caller's buffer.
#[derive(Debug)]
pub struct TableStream<R> {
    reader: R,
    header: Header,
    longest: Longest,
    /// Entries of the views from `cached_from` on.
    cached: [[u8; VIEW_ENTRY_BYTES]; ENTRIES],
    cached_from: u32,
    cached_count: u32,
}

impl<R: Read + Seek> TableStream<R> {
    /// Opens the table that `reader` gives from its first byte to its last. Checks the header, the index and the
    /// landmarks' records, and reads no view.
    ///
    /// # Errors
    ///
    /// [`StreamError::Table`] with the very error of [`LandmarkTable::open`](super::LandmarkTable::open), or
    /// [`StreamError::Io`].
    pub fn open(mut reader: R) -> Result<Self, StreamError<R::Error>> {
        let available = reader.seek(SeekFrom::End(0)).map_err(StreamError::Io)?;
        let mut first = [0; HEADER_BYTES];
        let there = usize::try_from(available).unwrap_or(HEADER_BYTES).min(HEADER_BYTES);
        let first = first.get_mut(..there).unwrap_or_default();
        read_at(&mut reader, 0, first)?;
        let header = Header::decode(first)?;
        header.check_length(available)?;

        let (cached, cached_from, cached_count) = ([[0; VIEW_ENTRY_BYTES]; ENTRIES], 0, 0);
        let mut table = Self { reader, header, longest: Longest::default(), cached, cached_from, cached_count };
        table.longest = table.check_index()?;
        table.check_landmarks()?;
        Ok(table)
    }

    /// Reads every view and every model through `buffer`, and accepts the table or says what is wrong with the first record
    /// that is. The buffer must take the models as well ([`TableStream::model_bytes`]).
    ///
    /// # Errors
    ///
    /// As [`TableStream::view`].
    pub fn verify(&mut self, buffer: &mut [u8]) -> Result<(), StreamError<R::Error>> {
        (0..self.header.view_count()).try_for_each(|number| self.view(number, buffer).map(|_| ()))?;
        (0..self.header.landmark_count()).try_for_each(|number| self.model(number, buffer).map(|_| ()))
    }

    /// The counts, limits and identity of the table.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes of a buffer that takes any landmark and any view of this table.
    pub const fn buffer_bytes(&self) -> usize {
        self.longest.walked as usize
    }

    /// Bytes of a buffer that takes any model of this table; 0 if there is none.
    pub const fn model_bytes(&self) -> usize {
        self.longest.model as usize
    }

    /// Landmark `number`, read into `buffer`. Finding its views takes O(log views) reads of 16 bytes.
    ///
    /// # Errors
    ///
    /// [`TableError::NoSuchRecord`], [`TableError::BufferTooSmall`], [`StreamError::Io`]; the others only if the
    /// source changed after the table was opened.
    pub fn landmark<'b>(&mut self, number: u32, buffer: &'b mut [u8]) -> Result<Landmark<'b>, StreamError<R::Error>> {
        let (kind, count) = (RecordKind::Landmark, self.header.landmark_count());
        if number >= count {
            return Err(TableError::NoSuchRecord { kind, number, count }.into());
        }
        let mut entry = [0; LANDMARK_ENTRY_BYTES];
        let at = number.saturating_mul(LANDMARK_ENTRY_BYTES as u32).saturating_add(HEADER_BYTES as u32);
        read_at(&mut self.reader, at, &mut entry)?;
        let entry = Entry::from_bytes(&entry);
        let begin = self.first_view(number, 0)?;
        let views = begin..self.first_view(number.saturating_add(1), begin)?;
        let record = self.record(entry, buffer)?;
        let LandmarkRecord { name, kind, position } = checked_landmark(number, entry, record)?;
        Ok(Landmark { name, kind, position, views })
    }

    /// View `number`, read into `buffer`.
    ///
    /// # Errors
    ///
    /// [`TableError::RecordChecksum`], [`TableError::Record`], [`TableError::NoSuchRecord`],
    /// [`TableError::BufferTooSmall`] or [`StreamError::Io`].
    pub fn view<'b>(&mut self, number: u32, buffer: &'b mut [u8]) -> Result<StoredView<'b>, StreamError<R::Error>> {
        let entry = self.view_entry(number)?;
        let record = self.record(entry.record, buffer)?;
        Ok(checked_view(&self.header, number, entry, record)?)
    }

    /// The model of landmark `number`, read into `buffer`, if it has one.
    ///
    /// # Errors
    ///
    /// As [`TableStream::view`].
    pub fn model<'b>(
        &mut self,
        number: u32,
        buffer: &'b mut [u8],
    ) -> Result<Option<StoredModel<'b>>, StreamError<R::Error>> {
        let (kind, count) = (RecordKind::Landmark, self.header.landmark_count());
        if number >= count {
            return Err(TableError::NoSuchRecord { kind, number, count }.into());
        }
        if !self.header.has_models() {
            return Ok(None);
        }
        let mut entry = [0; MODEL_ENTRY_BYTES];
        let at = number.saturating_mul(MODEL_ENTRY_BYTES as u32).saturating_add(self.header.model_index_begin());
        read_at(&mut self.reader, at, &mut entry)?;
        let entry = Entry::from_bytes(&entry);
        if entry.length == 0 {
            return Ok(None);
        }
        let begin = self.first_view(number, 0)?;
        let views = begin..self.first_view(number.saturating_add(1), begin)?;
        let record = self.record(entry, buffer)?;
        Ok(Some(checked_model(&self.header, number, views, entry, record, false)?))
    }

    /// The source, for another use.
    pub fn into_inner(self) -> R {
        self.reader
    }

    /// Goes through the index once, and returns the lengths of the longest records. Damage is reported before what
    /// does not fit together, as the reader in place does.
    fn check_index(&mut self) -> Result<Longest, StreamError<R::Error>> {
        let header = self.header;
        let mut id = TableId::new();
        let mut check = IndexCheck::new(&header, header.file_length());
        let mut result = Ok(());
        let begin = HEADER_BYTES as u32;
        each_entry(&mut self.reader, begin, header.landmark_count(), |bytes| {
            id.update(bytes);
            result = result.and_then(|()| check.landmark(Entry::from_bytes(bytes)));
        })?;
        each_entry(&mut self.reader, header.view_index_begin(), header.view_count(), |bytes| {
            id.update(bytes);
            result = result.and_then(|()| check.view(ViewEntry::from_bytes(bytes)));
        })?;
        let models = if header.has_models() { header.landmark_count() } else { 0 };
        each_entry(&mut self.reader, header.model_index_begin(), models, |bytes| {
            id.update(bytes);
            result = result.and_then(|()| check.model(Entry::from_bytes(bytes)));
        })?;
        header.check_id(id)?;
        Ok(result.and_then(|()| check.finish(header.file_length()))?)
    }

    /// Reads the landmarks' records, a few index entries at a time.
    fn check_landmarks(&mut self) -> Result<(), StreamError<R::Error>> {
        let count = self.header.landmark_count();
        let mut last_name = LastName::new();
        let mut number = 0;
        while number < count {
            let mut entries = [[0; LANDMARK_ENTRY_BYTES]; ENTRIES];
            let at = number.saturating_mul(LANDMARK_ENTRY_BYTES as u32).saturating_add(HEADER_BYTES as u32);
            let entries = read_entries(&mut self.reader, at, count.saturating_sub(number), &mut entries)?;
            for entry in entries {
                let entry = Entry::from_bytes(entry);
                let mut buffer = [0; LANDMARK_BYTES];
                let record = checked_landmark(number, entry, self.record(entry, &mut buffer)?)?;
                last_name.follow(record.name).map_err(|fault| landmark_fault(number, fault))?;
                number = number.saturating_add(1);
            }
        }
        Ok(())
    }

    /// The first view from `begin` on that is of `landmark` or a later one. It passes by the cache, which a walk over
    /// the views still needs.
    fn first_view(&mut self, landmark: u32, mut begin: u32) -> Result<u32, StreamError<R::Error>> {
        let mut end = self.header.view_count();
        while begin < end {
            let middle = begin.midpoint(end);
            let mut entry = [0; VIEW_ENTRY_BYTES];
            let at = self.view_entry_at(middle);
            read_at(&mut self.reader, at, &mut entry)?;
            if ViewEntry::from_bytes(&entry).landmark < landmark {
                begin = middle.saturating_add(1);
            } else {
                end = middle;
            }
        }
        Ok(begin)
    }

    /// The entry of view `number`, from the cache if it is there.
    fn view_entry(&mut self, number: u32) -> Result<ViewEntry, StreamError<R::Error>> {
        let (kind, count) = (RecordKind::View, self.header.view_count());
        let missing = TableError::NoSuchRecord { kind, number, count };
        if number >= count {
            return Err(missing.into());
        }
        let place = number.wrapping_sub(self.cached_from);
        if place >= self.cached_count {
            self.cached_count = 0;
            let (at, left) = (self.view_entry_at(number), count.saturating_sub(number));
            self.cached_count = read_entries(&mut self.reader, at, left, &mut self.cached)?.len() as u32;
            self.cached_from = number;
        }
        let place = number.wrapping_sub(self.cached_from) as usize;
        Ok(ViewEntry::from_bytes(self.cached.get(place).ok_or(missing)?))
    }

    /// Where the entry of view `number` is.
    const fn view_entry_at(&self, number: u32) -> u32 {
        self.header.view_index_begin().saturating_add(number.saturating_mul(VIEW_ENTRY_BYTES as u32))
    }

    /// Reads a record into the beginning of `buffer`.
    fn record<'b>(&mut self, entry: Entry, buffer: &'b mut [u8]) -> Result<&'b [u8], StreamError<R::Error>> {
        let (needed, available) = (entry.length as usize, buffer.len());
        let record = buffer.get_mut(..needed).ok_or(TableError::BufferTooSmall { needed, available })?;
        read_at(&mut self.reader, entry.offset, record)?;
        Ok(record)
    }
}

impl<R: Read + Seek> ViewSource for TableStream<R>
where
    R::Error: 'static,
{
    type Error = StreamError<R::Error>;

    fn header(&self) -> &Header {
        &self.header
    }

    fn buffer_bytes(&self) -> usize {
        TableStream::buffer_bytes(self)
    }

    fn view<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<StoredView<'s>, Self::Error> {
        TableStream::view(self, number, buffer)
    }

    fn landmark<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Landmark<'s>, Self::Error> {
        TableStream::landmark(self, number, buffer)
    }

    fn model_bytes(&self) -> usize {
        TableStream::model_bytes(self)
    }

    fn model<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Option<StoredModel<'s>>, Self::Error> {
        TableStream::model(self, number, buffer)
    }
}

/// Calls `take` with each of `count` entries of the index from byte `at` on.
fn each_entry<R: Read + Seek, const BYTES: usize>(
    reader: &mut R,
    at: u32,
    count: u32,
    mut take: impl FnMut(&[u8; BYTES]),
) -> Result<(), StreamError<R::Error>> {
    let (mut at, mut left) = (at, count);
    while left > 0 {
        let mut entries = [[0; BYTES]; ENTRIES];
        let entries = read_entries(reader, at, left, &mut entries)?;
        entries.iter().for_each(&mut take);
        left = left.saturating_sub(entries.len() as u32);
        at = at.saturating_add(entries.as_flattened().len() as u32);
    }
    Ok(())
}

/// Reads as many of the `left` entries from byte `at` on as `entries` takes.
fn read_entries<'e, R: Read + Seek, const BYTES: usize>(
    reader: &mut R,
    at: u32,
    left: u32,
    entries: &'e mut [[u8; BYTES]; ENTRIES],
) -> Result<&'e [[u8; BYTES]], StreamError<R::Error>> {
    let entries = entries.get_mut(..ENTRIES.min(left as usize)).unwrap_or_default();
    read_at(reader, at, entries.as_flattened_mut())?;
    Ok(entries)
}

/// Fills `bytes` from byte `at` of the source on. Not `Read::read_exact`: that trusts a source not to say that it
/// read more than it was asked for.
fn read_at<R: Read + Seek>(reader: &mut R, at: u32, bytes: &mut [u8]) -> Result<(), StreamError<R::Error>> {
    reader.seek(SeekFrom::Start(u64::from(at))).map_err(StreamError::Io)?;
    let needed = u64::from(at).saturating_add(bytes.len() as u64);
    let mut left = bytes;
    while !left.is_empty() {
        let read = reader.read(left).map_err(StreamError::Io)?;
        if read == 0 {
            let available = needed.saturating_sub(left.len() as u64);
            return Err(TableError::Truncated { needed, available }.into());
        }
        left = left.get_mut(read..).unwrap_or_default();
    }
    Ok(())
}
