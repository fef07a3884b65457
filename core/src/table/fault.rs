//! What is wrong inside a header, an index entry or a record: the reason within a [`TableError`](super::TableError).

use super::model::ModelFault;
use super::{CORNER_BYTES, ERROR_LIMIT_DM, LATITUDE_LIMIT_E7, LEVELS, LONGITUDE_LIMIT_E7, NAME_BYTES, SIDE_LIMIT};
use crate::feature::COMMONNESS;
use core::fmt;

/// A header whose checksum is right and whose content is not: a faulty program wrote it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum HeaderFault {
    /// There is no format version 0.
    Version,
    /// No profile has this code.
    Profile {
        /// The code that was found.
        code: u8,
    },
    /// The reserved byte is not zero.
    Reserved {
        /// The byte that was found.
        found: u8,
    },
    /// Signatures of another length.
    SignatureBits {
        /// Bits in the table.
        found: u16,
        /// Bits of this program's signatures.
        expected: u16,
    },
    /// No corners at all, or more than the profile allows.
    CornersLimit {
        /// The limit in the table.
        found: u16,
        /// The profile's largest.
        allowed: u16,
    },
    /// More landmarks than views: one of them would have none.
    LandmarkCount {
        /// Landmarks in the header.
        landmarks: u32,
        /// Views in the header.
        views: u32,
    },
    /// The file is said to end within its own index, or to hold records that its index does not have.
    FileLength {
        /// The length in the header.
        found: u32,
        /// Bytes of header and index.
        needed: u32,
    },
}

/// An index entry that does not continue the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum IndexFault {
    /// The record does not begin where the record before it ends: a gap, or an overlap.
    Offset {
        /// The offset in the entry.
        found: u32,
        /// Where the record before it ends.
        expected: u32,
    },
    /// No record of this kind and profile can have this length.
    Length {
        /// The length in the entry.
        found: u32,
        /// The shortest possible.
        least: u32,
        /// The longest possible.
        most: u32,
    },
    /// The record ends after the end of the file, or the last one before it.
    End {
        /// Where the record ends.
        found: u64,
        /// The file's length in the header.
        file: u32,
    },
    /// The view belongs neither to the landmark of the view before it nor to the next one.
    Landmark {
        /// The landmark in the entry.
        found: u32,
        /// The landmark of the view before it; 0 for the first view.
        least: u32,
        /// The landmark after that one, if there is one; 0 for the first view.
        most: u32,
    },
    /// A landmark without a model whose entry is not an empty one: the offset at which the next record would begin, no length,
    /// no checksum.
    EmptyEntry,
    /// The version says that there are models, and no landmark has one.
    NoModels,
    /// The last view does not belong to the last landmark, so that some landmarks have no view.
    LandmarkWithoutView {
        /// The last landmark that has views, plus one.
        with_views: u32,
        /// Landmarks in the header.
        landmarks: u32,
    },
}

/// A record whose form or meaning is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RecordFault {
    /// The fields cannot be decoded.
    Form,
    /// The fields decode, but are not written in the one way they must be: an over-long integer.
    NotCanonical,
    /// The record is longer or shorter than its own fields say.
    Length {
        /// Bytes of the record.
        found: usize,
        /// Bytes that its fields announce.
        expected: usize,
    },
    /// The name is empty or too long.
    NameLength {
        /// Its bytes.
        found: usize,
    },
    /// The name is not UTF-8.
    NameNotUtf8,
    /// The name holds a control character.
    NameControlCharacter,
    /// The name does not sort after the name before it: unsorted, or there twice.
    NameOrder,
    /// No kind has this code.
    Kind {
        /// The code that was found.
        code: u8,
    },
    /// The latitude is beyond a pole.
    Latitude {
        /// In 1e-7 degrees.
        found: i32,
    },
    /// The longitude is beyond 180 degrees.
    Longitude {
        /// In 1e-7 degrees.
        found: i32,
    },
    /// The position error is larger than the Earth.
    PositionError {
        /// In decimetres.
        found: u32,
    },
    /// The view's frame is empty or too large.
    FrameSize {
        /// Columns.
        width: u16,
        /// Rows.
        height: u16,
    },
    /// The view has no corner, or more than its table allows.
    CornerCount {
        /// Corners of the view.
        found: usize,
        /// The table's limit.
        allowed: u16,
    },
    /// One corner is wrong.
    Corner {
        /// Its place in the view.
        index: usize,
        /// What is wrong with it.
        fault: CornerFault,
    },
    /// The model cannot be.
    Model(ModelFault),
}

/// A corner of a view that cannot be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CornerFault {
    /// There is no such pyramid level.
    Level {
        /// The level that was found.
        found: u8,
    },
    /// It lies outside the view's frame.
    OutsideFrame {
        /// In 1/16 px.
        x: i32,
        /// In 1/16 px.
        y: i32,
    },
    /// It does not stand on the grid of 1/8 px; only in writing. Bring it there with
    /// [`on_grid`](super::on_grid).
    OffGrid {
        /// In 1/16 px; x or y is odd.
        x: i32,
        /// In 1/16 px.
        y: i32,
    },
    /// Its commonness has no room in a table; only in writing.
    Commonness {
        /// In bits, outside [`COMMONNESS`].
        found: i8,
    },
    /// It does not sort after the corner before it by level, row, column.
    Order,
}

impl fmt::Display for HeaderFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Version => write!(out, "format version 0 does not exist"),
            Self::Profile { code } => write!(out, "profile {code} does not exist"),
            Self::Reserved { found } => write!(out, "the reserved byte is {found}, not 0"),
            Self::SignatureBits { found, expected } => {
                write!(out, "its signatures have {found} bits, this program's {expected}")
            }
            Self::CornersLimit { found, allowed } => {
                write!(out, "it allows {found} corners a view, its profile 1 to {allowed}")
            }
            Self::LandmarkCount { landmarks, views } => {
                write!(out, "{landmarks} landmarks cannot share {views} views, each needs one")
            }
            Self::FileLength { found, needed } => {
                write!(out, "a length of {found} bytes does not fit the index, which ends at {needed}")
            }
        }
    }
}

impl fmt::Display for IndexFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Offset { found, expected } => {
                write!(out, "it begins at byte {found}, the record before it ends at {expected}")
            }
            Self::Length { found, least, most } => write!(out, "{found} bytes long, possible are {least} to {most}"),
            Self::End { found, file } => write!(out, "it ends at byte {found}, the file at {file}"),
            Self::Landmark { found, least, most } => {
                write!(out, "it belongs to landmark {found}, the turn is at {least} to {most}")
            }
            Self::EmptyEntry => write!(out, "it is for no model and not written like that"),
            Self::NoModels => write!(out, "no landmark has a model, but the version says so"),
            Self::LandmarkWithoutView { with_views, landmarks } => {
                write!(out, "it is the last, and only {with_views} of {landmarks} landmarks have views")
            }
        }
    }
}

impl fmt::Display for RecordFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Form => write!(out, "its fields cannot be decoded"),
            Self::NotCanonical => write!(out, "an integer in it is written longer than it needs"),
            Self::Length { found, expected } => {
                write!(out, "it is {found} bytes long, its fields announce {expected}")
            }
            Self::NameLength { found } => write!(out, "its name has {found} bytes, allowed are 1 to {NAME_BYTES}"),
            Self::NameNotUtf8 => write!(out, "its name is not UTF-8"),
            Self::NameControlCharacter => write!(out, "its name holds a control character"),
            Self::NameOrder => write!(out, "its name is there twice or does not sort after the one before it"),
            Self::Kind { code } => write!(out, "kind {code} does not exist"),
            Self::Latitude { found } => {
                write!(out, "latitude {found}e-7 degrees, allowed are -{LATITUDE_LIMIT_E7} to {LATITUDE_LIMIT_E7}")
            }
            Self::Longitude { found } => {
                write!(out, "longitude {found}e-7 degrees, allowed are -{LONGITUDE_LIMIT_E7} to {LONGITUDE_LIMIT_E7}")
            }
            Self::PositionError { found } => {
                write!(out, "position error {found} dm, allowed are 0 to {ERROR_LIMIT_DM}")
            }
            Self::FrameSize { width, height } => {
                write!(out, "its frame is {width} x {height} px, allowed are 1 to {SIDE_LIMIT} each")
            }
            Self::CornerCount { found, allowed } => {
                write!(out, "it has {found} corners ({CORNER_BYTES} bytes each), its table allows 1 to {allowed}")
            }
            Self::Corner { index, fault } => write!(out, "corner {index}: {fault}"),
            Self::Model(fault) => fault.fmt(out),
        }
    }
}

impl fmt::Display for CornerFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Level { found } => write!(out, "level {found}, the levels are 0 to {}", LEVELS.saturating_sub(1)),
            Self::OutsideFrame { x, y } => write!(out, "at {x}, {y} (1/16 px) it lies outside the view's frame"),
            Self::OffGrid { x, y } => write!(out, "at {x}, {y} (1/16 px) it lies off the grid of 1/8 px: round it"),
            Self::Commonness { found } => {
                let (least, most) = (COMMONNESS.start(), COMMONNESS.end());
                write!(out, "commonness {found}, allowed are {least} to {most}")
            }
            Self::Order => write!(out, "it does not sort after the one before it by level, row, column"),
        }
    }
}

impl core::error::Error for RecordFault {}
