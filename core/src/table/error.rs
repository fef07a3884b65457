//! What a reader of tables refuses, by blame: not a table, damaged, too new, the caller's mistake, the source's.

use super::{HeaderFault, IndexFault, RecordFault};
use core::fmt;

/// The kinds of record in a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RecordKind {
    /// A landmark: name, kind, position.
    Landmark,
    /// A view: the corners of one enrolled frame.
    View,
    /// A model: where corners of a landmark's views are in space.
    Model,
}

/// What there was too much of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TableLimit {
    /// Views in one table; there are never more landmarks than views.
    Views,
    /// Bytes of one table.
    FileBytes,
}

/// Why a table, or a record of it, cannot be read. A refused table is never partly used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TableError {
    /// There is not a single byte: an empty file, a flash region that was never written. Enroll, or restore a copy.
    Empty,
    /// It is something else. Give the table's own file.
    NotATable {
        /// The first eight bytes; zero where there are fewer.
        found: [u8; 8],
    },
    /// A newer program wrote it. Update, or enroll again with this program.
    NewerVersion {
        /// The version in the header.
        found: u16,
        /// The newest version that this program reads.
        supported: u16,
    },
    /// The end is missing. Restore the table from a copy.
    Truncated {
        /// Bytes of the whole table; of its header alone if even that is cut.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// More bytes follow the table. Give exactly its bytes: [`Header::file_length`](super::Header::file_length) says
    /// how many, for instance to cut them out of a flash region.
    TrailingBytes {
        /// Bytes of the table.
        length: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// The header was damaged. Restore the table from a copy.
    HeaderChecksum {
        /// The CRC-32 in the header.
        stored: u32,
        /// The CRC-32 of the header.
        computed: u32,
    },
    /// The header was written wrong, and is not damaged. Enroll again.
    Header(HeaderFault),
    /// The index was damaged. Restore the table from a copy.
    IndexChecksum {
        /// The table id in the header.
        stored: u64,
        /// The id computed from the index and the header.
        computed: u64,
    },
    /// The index was written wrong, and is not damaged. Enroll again.
    Index {
        /// The kind of the record that the entry is for.
        kind: RecordKind,
        /// The number of that record.
        number: u32,
        /// What is wrong with the entry.
        fault: IndexFault,
    },
    /// A record was damaged; the others may be sound. Restore the table from a copy.
    RecordChecksum {
        /// The kind of the record.
        kind: RecordKind,
        /// Its number.
        number: u32,
        /// The CRC-32 in the index.
        stored: u32,
        /// The CRC-32 of the record.
        computed: u32,
    },
    /// A record was written wrong, and is not damaged. Enroll again.
    Record {
        /// The kind of the record.
        kind: RecordKind,
        /// Its number.
        number: u32,
        /// What is wrong with it.
        fault: RecordFault,
    },
    /// The table is larger than any reader takes. Split it.
    LimitExceeded {
        /// What there is too much of.
        limit: TableLimit,
        /// How much there is.
        found: u64,
        /// How much is allowed.
        allowed: u64,
    },
    /// The caller's buffer cannot take the record. Give a buffer of
    /// [`ViewSource::buffer_bytes`](super::ViewSource::buffer_bytes).
    BufferTooSmall {
        /// Bytes of the record.
        needed: usize,
        /// Bytes of the buffer.
        available: usize,
    },
    /// The caller asked for a record that the table does not have. Stay below the count.
    NoSuchRecord {
        /// The kind of the record.
        kind: RecordKind,
        /// The number that was asked for.
        number: u32,
        /// How many there are.
        count: u32,
    },
}

/// Why a table cannot be read from a stream: the table is to blame, or its source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamError<E> {
    /// The table, or the caller; the reader in place would have said the same.
    Table(TableError),
    /// Reading or seeking failed. Try again, or see to the medium.
    Io(E),
}

impl<E> From<TableError> for StreamError<E> {
    fn from(error: TableError) -> Self {
        Self::Table(error)
    }
}

impl fmt::Display for RecordKind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Landmark => "landmark",
            Self::View => "view",
            Self::Model => "model",
        })
    }
}

impl fmt::Display for TableLimit {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Views => "views",
            Self::FileBytes => "bytes",
        })
    }
}

const RESTORE: &str = "restore the table from a copy, or enroll again";

impl fmt::Display for TableError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Empty => write!(out, "the landmark table is empty (0 bytes): {RESTORE}"),
            Self::NotATable { found } => {
                out.write_str("not a landmark table: it begins with")?;
                for byte in found {
                    write!(out, " {byte:02x}")?;
                }
                out.write_str("; give the file that enrollment wrote")
            }
            Self::NewerVersion { found, supported } => {
                write!(out, "written by format version {found}; this program reads version {supported}: update daymark")
            }
            Self::Truncated { needed, available } => {
                write!(out, "the landmark table is cut short: {available} of {needed} bytes are there; {RESTORE}")
            }
            Self::TrailingBytes { length, available } => write!(
                out,
                "the landmark table ends after {length} bytes, but {available} are there: give exactly the table, {RESTORE}"
            ),
            Self::HeaderChecksum { stored, computed } => {
                write!(out, "the header is damaged (CRC-32 {computed:08x}, written was {stored:08x}): {RESTORE}")
            }
            Self::Header(fault) => write!(out, "the header was written wrong: {fault}; {RESTORE}"),
            Self::IndexChecksum { stored, computed } => {
                write!(out, "the index is damaged (table id {computed:016x}, written was {stored:016x}): {RESTORE}")
            }
            Self::Index { kind, number, fault } => {
                write!(out, "the index entry of {kind} {number} was written wrong: {fault}; {RESTORE}")
            }
            Self::RecordChecksum { kind, number, stored, computed } => {
                write!(out, "{kind} {number} is damaged (CRC-32 {computed:08x}, written was {stored:08x}): {RESTORE}")
            }
            Self::Record { kind, number, fault } => {
                write!(out, "{kind} {number} was written wrong: {fault}; {RESTORE}")
            }
            Self::LimitExceeded { limit, found, allowed } => {
                write!(out, "{found} {limit}, but a landmark table holds at most {allowed}: split the table")
            }
            Self::BufferTooSmall { needed, available } => {
                write!(out, "the record needs a buffer of {needed} bytes, {available} were given: give a larger one")
            }
            Self::NoSuchRecord { kind, number, count } => {
                write!(out, "there is no {kind} {number}: the table holds {count}, counted from 0")
            }
        }
    }
}

impl core::error::Error for TableError {}

impl<E: fmt::Display> fmt::Display for StreamError<E> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Table(error) => error.fmt(out),
            Self::Io(error) => {
                write!(out, "the landmark table cannot be read: {error}; try again or see to the medium")
            }
        }
    }
}

impl<E: core::error::Error + 'static> core::error::Error for StreamError<E> {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Table(_) => None,
            Self::Io(error) => Some(error),
        }
    }
}
