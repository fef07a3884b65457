//! A landmark's record: name, kind and position.

use super::{EncodeError, Kind, RecordFault};
use crate::fix::Wgs84;
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Bytes of a name, at most.
pub const NAME_BYTES: usize = 64;

/// The poles, in 1e-7 degrees.
pub const LATITUDE_LIMIT_E7: i32 = 900_000_000;

/// The meridian opposite Greenwich, in 1e-7 degrees; -180 and 180 degrees are both allowed.
pub const LONGITUDE_LIMIT_E7: i32 = 1_800_000_000;

/// Half the way round the Earth in decimetres, rounded: no position is further off.
pub const ERROR_LIMIT_DM: u32 = 200_000_000;

/// Bytes of the fields before a name, at most: kind 1, mark 1, latitude 5, longitude 5, error 4, name's length 1.
const FIELDS_BYTES: usize = 17;

/// Bytes of a landmark's record, at most.
pub const LANDMARK_BYTES: usize = FIELDS_BYTES + NAME_BYTES;

/// Bytes of a landmark's record, at least: kind, no position, a name of one byte.
pub(super) const LANDMARK_BYTES_LEAST: usize = 4;

/// A place on WGS84 and how well it is known. One 1e-7 degree is at most 1.2 cm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct GeoPosition {
    /// Degrees north, times 1e7; within ±[`LATITUDE_LIMIT_E7`].
    pub latitude_e7: i32,
    /// Degrees east, times 1e7; within ±[`LONGITUDE_LIMIT_E7`].
    pub longitude_e7: i32,
    /// The true place lies within this many decimetres; at most [`ERROR_LIMIT_DM`].
    pub error_dm: u32,
}

impl GeoPosition {
    /// The place in degrees. Its height is unknown and stands as 0.
    pub fn wgs84(&self) -> Wgs84 {
        let [latitude_deg, longitude_deg] = [self.latitude_e7, self.longitude_e7].map(|e7| f64::from(e7) / 1e7);
        Wgs84 { latitude_deg, longitude_deg, altitude_m: 0.0 }
    }

    /// The true place lies within this many metres.
    pub fn error_m(&self) -> f64 {
        f64::from(self.error_dm) / 10.0
    }
}

/// A landmark as a table stores it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Landmark<'a> {
    /// What people call it: 1..=64 bytes of UTF-8 without control characters, unique in its table.
    pub name: &'a str,
    /// What sort of thing it is.
    pub kind: Kind,
    /// Where it stands, if known.
    pub position: Option<GeoPosition>,
    /// The numbers of its views, at least one.
    pub views: Range<u32>,
}

/// What precedes the name's bytes, as `postcard` writes it; together they are a struct with a string at its end.
#[derive(Serialize, Deserialize)]
struct Fields {
    kind: u8,
    position: Option<(i32, i32, u32)>,
    name_bytes: u8,
}

/// A landmark's own record; which views it has stands in the index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LandmarkRecord<'a> {
    pub(super) name: &'a str,
    pub(super) kind: Kind,
    pub(super) position: Option<GeoPosition>,
}

impl<'a> LandmarkRecord<'a> {
    /// Decodes a record, form and meaning.
    pub(super) fn decode(payload: &'a [u8]) -> Result<Self, RecordFault> {
        let (fields, name) = postcard::take_from_bytes::<Fields>(payload).map_err(|_| RecordFault::Form)?;
        let fields_bytes = payload.len().saturating_sub(name.len());
        let expected = fields_bytes.saturating_add(usize::from(fields.name_bytes));
        if payload.len() != expected {
            return Err(RecordFault::Length { found: payload.len(), expected });
        }
        let mut canonical = [0; FIELDS_BYTES];
        let canonical = postcard::to_slice(&fields, &mut canonical).map_err(|_| RecordFault::NotCanonical)?;
        if !payload.starts_with(canonical) || canonical.len() != fields_bytes {
            return Err(RecordFault::NotCanonical);
        }
        let record = Self {
            name: core::str::from_utf8(name).map_err(|_| RecordFault::NameNotUtf8)?,
            kind: Kind::from_code(fields.kind).ok_or(RecordFault::Kind { code: fields.kind })?,
            position: fields.position.map(|(latitude_e7, longitude_e7, error_dm)| GeoPosition {
                latitude_e7,
                longitude_e7,
                error_dm,
            }),
        };
        record.check().map(|()| record)
    }

    /// Encodes a record that passes the same checks.
    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        self.check()?;
        let fields = Fields {
            kind: self.kind.code(),
            position: self.position.map(|at| (at.latitude_e7, at.longitude_e7, at.error_dm)),
            name_bytes: self.name.len() as u8,
        };
        let mut scratch = [0; FIELDS_BYTES];
        let fields = postcard::to_slice(&fields, &mut scratch).map_err(|_| RecordFault::Form)?;
        let needed = fields.len().saturating_add(self.name.len());
        let available = buffer.len();
        let record = buffer.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, available })?;
        for (slot, byte) in record.iter_mut().zip(fields.iter().chain(self.name.as_bytes())) {
            *slot = *byte;
        }
        Ok(record)
    }

    fn check(&self) -> Result<(), RecordFault> {
        if !(1..=NAME_BYTES).contains(&self.name.len()) {
            return Err(RecordFault::NameLength { found: self.name.len() });
        }
        // Unicode's control characters (general category Cc), written out: U+0000..U+001F, U+007F..U+009F.
        if self.name.chars().any(|c| matches!(c, '\0'..='\x1F' | '\x7F'..='\u{9F}')) {
            return Err(RecordFault::NameControlCharacter);
        }
        let Some(at) = self.position else { return Ok(()) };
        if at.latitude_e7.unsigned_abs() > LATITUDE_LIMIT_E7.unsigned_abs() {
            return Err(RecordFault::Latitude { found: at.latitude_e7 });
        }
        if at.longitude_e7.unsigned_abs() > LONGITUDE_LIMIT_E7.unsigned_abs() {
            return Err(RecordFault::Longitude { found: at.longitude_e7 });
        }
        if at.error_dm > ERROR_LIMIT_DM {
            return Err(RecordFault::PositionError { found: at.error_dm });
        }
        Ok(())
    }
}

/// Writes a landmark's record to the beginning of `buffer`, which [`LANDMARK_BYTES`] always suffice for, and returns it.
///
/// # Errors
///
/// A name, position or error that no reader would accept; a buffer that is too small.
pub fn encode_landmark<'b>(
    name: &str,
    kind: Kind,
    position: Option<GeoPosition>,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    LandmarkRecord { name, kind, position }.encode(buffer)
}

/// The name of the landmark before, where its record is no longer at hand.
#[derive(Debug, Clone)]
pub(super) struct LastName {
    bytes: [u8; NAME_BYTES],
    length: usize,
}

impl LastName {
    /// Before the first landmark: every name sorts after it, because none is empty.
    pub(super) const fn new() -> Self {
        Self { bytes: [0; NAME_BYTES], length: 0 }
    }

    /// Takes the next name, which must sort after this one, bytewise.
    pub(super) fn follow(&mut self, name: &str) -> Result<(), RecordFault> {
        if !self.bytes.iter().take(self.length).lt(name.as_bytes()) {
            return Err(RecordFault::NameOrder);
        }
        self.length = name.len();
        for (slot, byte) in self.bytes.iter_mut().zip(name.as_bytes()) {
            *slot = *byte;
        }
        Ok(())
    }
}
