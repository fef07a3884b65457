//! Tables that are damaged, cut, foreign, newer or written wrong: each is refused with its reason, by both readers.

use crc::{CRC_32_ISO_HDLC, CRC_64_XZ, Crc};
use daymark_core::table::{
    CornerFault, HEADER_BYTES, Header, HeaderFault, IndexFault, LandmarkTable, RecordFault, RecordKind, StreamError,
    TableError, TableLimit, TableStream, ViewSource,
};
use embedded_io::{ErrorKind, ErrorType, Read, Seek, SeekFrom};
use proptest::prelude::*;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const CRC64: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// A table as FORMAT.md lays it out, with right checksums around whatever the records hold.
#[derive(Clone)]
struct Raw {
    landmarks: Vec<Vec<u8>>,
    views: Vec<(u32, Vec<u8>)>,
}

impl Raw {
    /// Two landmarks, "a" with one view and "b" with two; handheld.
    fn sound() -> Self {
        let view = |corner: u32| view(64, 64, &[corner, corner + 16]);
        Self {
            landmarks: vec![vec![0, 0, 1, b'a'], vec![3, 1, 2, 4, 5, 1, b'b']],
            views: vec![(0, view(0)), (1, view(0x100)), (1, view(0x180))],
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut end = 40 + 12 * self.landmarks.len() + 16 * self.views.len();
        let (mut index, mut records) = (Vec::new(), Vec::new());
        let mut entry = |record: &Vec<u8>, first: &[u8]| {
            let mut bytes = first.to_vec();
            bytes.extend((end as u32).to_le_bytes());
            bytes.extend((record.len() as u32).to_le_bytes());
            bytes.extend(CRC32.checksum(&[first, record].concat()).to_le_bytes());
            end += record.len();
            records.extend_from_slice(record);
            bytes
        };
        self.landmarks.iter().for_each(|record| index.extend(entry(record, &[])));
        self.views.iter().for_each(|(landmark, record)| index.extend(entry(record, &landmark.to_le_bytes())));
        let mut bytes = b"DAYMARK\x1A\x01\x00\x01\x00\x80\x00\x64\x00".to_vec();
        bytes.extend((self.landmarks.len() as u32).to_le_bytes());
        bytes.extend((self.views.len() as u32).to_le_bytes());
        bytes.extend((end as u32).to_le_bytes());
        bytes.extend([0; 12]);
        resealed([bytes, index, records].concat())
    }

    /// The sound table with another record for landmark 1.
    fn with_landmark(record: &[u8]) -> Vec<u8> {
        let mut raw = Self::sound();
        raw.landmarks[1] = record.to_vec();
        raw.bytes()
    }

    /// The sound table with another record for view 2.
    fn with_view(record: Vec<u8>) -> Vec<u8> {
        let mut raw = Self::sound();
        raw.views[2].1 = record;
        raw.bytes()
    }
}

/// A view's record with sides below 128 px, and the corners' numbers; signatures of zeros.
fn view(width: u8, height: u8, corners: &[u32]) -> Vec<u8> {
    let mut record = vec![width, height, corners.len() as u8];
    for corner in corners {
        record.extend(corner.to_le_bytes());
        record.extend([0; 16]);
    }
    record
}

/// A corner's number of commonness -1; x and y in 1/8 px.
fn number(x: u32, y: u32, level: u32) -> u32 {
    x | y << 13 | level << 26
}

/// The bytes with the table id and the header's checksum computed anew, as a program would that means what it writes.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let count = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")) as usize;
    let index_end = (40 + 12 * count(16) + 16 * count(20)).min(bytes.len());
    let id = CRC64.checksum(&[&bytes[40..index_end], &bytes[..28]].concat());
    bytes[28..36].copy_from_slice(&id.to_le_bytes());
    resealed_header(bytes)
}

fn resealed_header(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = CRC32.checksum(&bytes[..36]);
    bytes[36..40].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// The sound table with other bytes at `at`, sealed again.
fn patched(at: usize, new: &[u8]) -> Vec<u8> {
    let mut bytes = Raw::sound().bytes();
    bytes[at..at + new.len()].copy_from_slice(new);
    resealed(bytes)
}

/// Where entry fields of the sound table are.
const LANDMARK_1: usize = 40 + 12;
const VIEW_0: usize = 40 + 24;
const VIEW_2: usize = VIEW_0 + 32;

struct Source<'a> {
    bytes: &'a [u8],
    position: u64,
    /// Reads that still succeed.
    good_reads: usize,
    /// Added to the number of bytes that a read reports.
    boast: usize,
    /// Added to the length that seeking to the end reports.
    promise: u64,
}

impl<'a> Source<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0, good_reads: usize::MAX, boast: 0, promise: 0 }
    }
}

impl ErrorType for Source<'_> {
    type Error = ErrorKind;
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        self.good_reads = self.good_reads.checked_sub(1).ok_or(ErrorKind::TimedOut)?;
        let rest = self.bytes.get(self.position as usize..).unwrap_or_default();
        let count = buffer.len().min(rest.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.position += count as u64;
        Ok(count + self.boast)
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64, ErrorKind> {
        self.position = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::End(by) => self.bytes.len() as u64 + self.promise + by as u64,
            SeekFrom::Current(by) => self.position + by as u64,
        };
        Ok(self.position)
    }
}

/// Reads every record there is, and returns how many.
fn read<S: ViewSource>(source: &mut S, buffer: &mut [u8]) -> Result<u32, S::Error> {
    for number in 0..source.landmark_count() {
        source.landmark(number, buffer)?;
    }
    for number in 0..source.view_count() {
        let view = source.view(number, buffer)?;
        assert!(view.landmark() < source.landmark_count());
    }
    Ok(source.landmark_count() + source.view_count())
}

/// What both readers say of `bytes`, which is the same.
fn outcome(bytes: &[u8]) -> Result<u32, TableError> {
    let in_place = LandmarkTable::open(bytes).and_then(|mut table| read(&mut table, &mut []));
    let verified = LandmarkTable::open(bytes).and_then(LandmarkTable::verified);
    assert_eq!(verified.and_then(|mut table| read(&mut table, &mut [])), in_place);
    let streamed = TableStream::open(Source::new(bytes)).and_then(|mut stream| {
        let mut buffer = vec![0; stream.buffer_bytes()];
        read(&mut stream, &mut buffer)
    });
    assert_eq!(streamed, in_place.map_err(StreamError::Table));
    in_place
}

fn header_fault(fault: HeaderFault) -> Result<u32, TableError> {
    Err(TableError::Header(fault))
}

fn landmark_entry(number: u32, fault: IndexFault) -> Result<u32, TableError> {
    Err(TableError::Index { kind: RecordKind::Landmark, number, fault })
}

fn view_entry(number: u32, fault: IndexFault) -> Result<u32, TableError> {
    Err(TableError::Index { kind: RecordKind::View, number, fault })
}

/// What is said of landmark 1 if its record is `record`.
fn landmark_outcome(record: &[u8]) -> Result<u32, RecordFault> {
    outcome(&Raw::with_landmark(record)).map_err(|error| match error {
        TableError::Record { kind: RecordKind::Landmark, number: 1, fault } => fault,
        other => panic!("{other:?}"),
    })
}

/// What is said of view 2 if its record is `record`.
fn view_outcome(record: Vec<u8>) -> Result<u32, RecordFault> {
    outcome(&Raw::with_view(record)).map_err(|error| match error {
        TableError::Record { kind: RecordKind::View, number: 2, fault } => fault,
        other => panic!("{other:?}"),
    })
}

fn corner_fault<T>(index: usize, fault: CornerFault) -> Result<T, RecordFault> {
    Err(RecordFault::Corner { index, fault })
}

#[test]
fn the_table_that_the_others_are_made_from_is_sound() {
    assert_eq!(outcome(&Raw::sound().bytes()), Ok(5));
    assert_eq!(Raw::sound().bytes(), patched(0, &[]));
}

#[test]
fn every_length_but_the_right_one_is_refused() {
    let bytes = Raw::sound().bytes();
    assert_eq!(bytes.len(), 252);
    assert_eq!(outcome(&[]), Err(TableError::Empty));
    for length in 1..bytes.len() {
        let needed = if length < HEADER_BYTES { 40 } else { 252 };
        let expected = Err(TableError::Truncated { needed, available: length as u64 });
        assert_eq!(outcome(&bytes[..length]), expected, "{length} bytes");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert_eq!(outcome(&longer), Err(TableError::TrailingBytes { length: 252, available: 253 }));
}

#[test]
fn every_flipped_bit_is_refused() {
    let sound = Raw::sound().bytes();
    for bit in 0..sound.len() * 8 {
        let mut bytes = sound.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let error = outcome(&bytes).expect_err("a flipped bit");
        let (is_expected, part) = match bit / 8 {
            0..8 => (matches!(error, TableError::NotATable { .. }), "magic"),
            8..40 => (matches!(error, TableError::HeaderChecksum { .. }), "header"),
            40..112 => (matches!(error, TableError::IndexChecksum { .. }), "index"),
            _ => (matches!(error, TableError::RecordChecksum { .. }), "records"),
        };
        assert!(is_expected, "bit {bit} in the {part}: {error:?}");
    }
}

#[test]
fn a_foreign_file_is_refused_by_its_first_bytes() {
    let png = *b"\x89PNG\r\n\x1A\n";
    assert_eq!(outcome(&[&png[..], &[0; 100]].concat()), Err(TableError::NotATable { found: png }));
    assert_eq!(outcome(b"DAY off"), Err(TableError::NotATable { found: *b"DAY off\0" }));
    assert_eq!(outcome(&[0xFF; 4096]), Err(TableError::NotATable { found: [0xFF; 8] }));
    let text = outcome(b"hi").expect_err("two letters").to_string();
    let said = "not a landmark table: it begins with 68 69 00 00 00 00 00 00; give the file that enrollment wrote";
    assert_eq!(text, said);
}

#[test]
fn a_newer_version_is_refused_by_name() {
    // Whatever else it holds: only magic, version and checksum are where they were.
    let mut newer = resealed_header([&b"DAYMARK\x1A\x03\x00"[..], &[0xEE; 90]].concat());
    assert_eq!(outcome(&newer), Err(TableError::NewerVersion { found: 3, supported: 2 }));
    let text = outcome(&newer).expect_err("newer").to_string();
    assert_eq!(text, "written by format version 3; this program reads version 2: update daymark");
    newer[8] = 4;
    assert!(matches!(outcome(&newer), Err(TableError::HeaderChecksum { .. })), "damaged, not newer");
}

#[test]
fn a_header_that_was_written_wrong_is_refused() {
    assert_eq!(outcome(&patched(8, &[0, 0])), header_fault(HeaderFault::Version));
    assert_eq!(outcome(&patched(10, &[0])), header_fault(HeaderFault::Profile { code: 0 }));
    assert_eq!(outcome(&patched(10, &[3])), header_fault(HeaderFault::Profile { code: 3 }));
    assert_eq!(outcome(&patched(11, &[1])), header_fault(HeaderFault::Reserved { found: 1 }));
    let bits = HeaderFault::SignatureBits { found: 256, expected: 128 };
    assert_eq!(outcome(&patched(12, &[0, 1])), header_fault(bits));
    assert_eq!(outcome(&patched(14, &[0])), header_fault(HeaderFault::CornersLimit { found: 0, allowed: 100 }));
    assert_eq!(outcome(&patched(14, &[101])), header_fault(HeaderFault::CornersLimit { found: 101, allowed: 100 }));
    assert_eq!(outcome(&patched(16, &[4])), header_fault(HeaderFault::LandmarkCount { landmarks: 4, views: 3 }));
    assert_eq!(outcome(&patched(16, &[0])), header_fault(HeaderFault::LandmarkCount { landmarks: 0, views: 3 }));
    let views = TableError::LimitExceeded { limit: TableLimit::Views, found: 250_001, allowed: 250_000 };
    assert_eq!(outcome(&patched(20, &250_001_u32.to_le_bytes())), Err(views));
    assert_eq!(outcome(&patched(24, &[111])), header_fault(HeaderFault::FileLength { found: 111, needed: 112 }));
    let mut none = resealed([&Raw { landmarks: vec![], views: vec![] }.bytes()[..], &[0]].concat());
    none[24] = 41;
    let none = resealed(none);
    assert_eq!(outcome(&none), header_fault(HeaderFault::FileLength { found: 41, needed: 40 }));
}

#[test]
fn an_index_that_leads_astray_is_refused() {
    let (least, most) = (4, 81);
    // "a" is at 112, 4 bytes; "b" at 116, 7 bytes; the views at 123, 43 bytes each.
    let overlap = IndexFault::Offset { found: 115, expected: 116 };
    assert_eq!(outcome(&patched(LANDMARK_1, &[115])), landmark_entry(1, overlap));
    let gap = IndexFault::Offset { found: 117, expected: 116 };
    assert_eq!(outcome(&patched(LANDMARK_1, &[117])), landmark_entry(1, gap));
    let outside = IndexFault::Offset { found: u32::MAX, expected: 116 };
    assert_eq!(outcome(&patched(LANDMARK_1, &[0xFF; 4])), landmark_entry(1, outside));
    let length = |found| landmark_entry(1, IndexFault::Length { found, least, most });
    assert_eq!(outcome(&patched(LANDMARK_1 + 4, &[3])), length(3));
    assert_eq!(outcome(&patched(LANDMARK_1 + 4, &[82])), length(82));
    // Offset and length that add up to more than 32 bits hold: refused before they are added.
    assert_eq!(outcome(&patched(LANDMARK_1 + 4, &[0xFF; 4])), length(u32::MAX));
    let shifted = IndexFault::Offset { found: 123, expected: 124 };
    assert_eq!(outcome(&patched(LANDMARK_1 + 4, &[8])), view_entry(0, shifted));
    let length = |found| view_entry(2, IndexFault::Length { found, least: 23, most: 2006 });
    assert_eq!(outcome(&patched(VIEW_2 + 8, &2007_u32.to_le_bytes())), length(2007));
    assert_eq!(outcome(&patched(VIEW_2 + 8, &[22])), length(22));
    assert_eq!(outcome(&patched(VIEW_2 + 8, &[44])), view_entry(2, IndexFault::End { found: 253, file: 252 }));
    assert_eq!(outcome(&patched(VIEW_2 + 8, &[42])), view_entry(2, IndexFault::End { found: 251, file: 252 }));
}

#[test]
fn a_view_out_of_its_landmarks_turn_is_refused() {
    let turn = |number, found, least, most| view_entry(number, IndexFault::Landmark { found, least, most });
    assert_eq!(outcome(&patched(VIEW_0, &[1])), turn(0, 1, 0, 0));
    assert_eq!(outcome(&patched(VIEW_2, &[0])), turn(2, 0, 1, 1));
    assert_eq!(outcome(&patched(VIEW_2, &[2])), turn(2, 2, 1, 1));
    assert_eq!(outcome(&patched(VIEW_2, &[0xFF; 4])), turn(2, u32::MAX, 1, 1));
    let mut raw = Raw::sound();
    raw.views.remove(0);
    assert_eq!(outcome(&raw.bytes()), turn(0, 1, 0, 0));
}

#[test]
fn a_landmark_without_view_is_refused() {
    let mut raw = Raw::sound();
    raw.landmarks.push(vec![0, 0, 1, b'c']);
    let fault = IndexFault::LandmarkWithoutView { with_views: 2, landmarks: 3 };
    assert_eq!(outcome(&raw.bytes()), view_entry(2, fault));
}

#[test]
fn a_view_is_not_taken_for_another_landmarks() {
    // View 1 is moved to landmark 0 and the index sealed again; the turns are right, the view's checksum is not.
    let moved = patched(VIEW_0 + 16, &[0]);
    let error = outcome(&moved).expect_err("a view of landmark 1, said to be of landmark 0");
    assert!(matches!(error, TableError::RecordChecksum { kind: RecordKind::View, number: 1, .. }), "{error:?}");
}

#[test]
fn names_are_unique_and_sorted() {
    for name in [b'a', b'A'] {
        assert_eq!(landmark_outcome(&[0, 0, 1, name]), Err(RecordFault::NameOrder));
    }
    assert_eq!(landmark_outcome(&[0, 0, 2, b'a', b'!']), Ok(5));
}

#[test]
fn a_landmark_that_was_written_wrong_is_refused() {
    assert_eq!(landmark_outcome(&[0, 0, 0, 0]), Err(RecordFault::Length { found: 4, expected: 3 }));
    assert_eq!(landmark_outcome(&[0, 1, 0, 0, 0, 0]), Err(RecordFault::NameLength { found: 0 }));
    let name = |bytes: &[u8]| landmark_outcome(&[&[0, 0, bytes.len() as u8], bytes].concat());
    assert_eq!(name(&[b'n'; 64]), Ok(5));
    assert_eq!(name(&[b'n'; 65]), Err(RecordFault::NameLength { found: 65 }));
    assert_eq!(name(&[b'b', 0xC3]), Err(RecordFault::NameNotUtf8));
    for control in ["b\0", "b\n", "b\x1F", "b\x7F", "b\u{80}", "b\u{9F}"] {
        assert_eq!(name(control.as_bytes()), Err(RecordFault::NameControlCharacter), "{control:?}");
    }
    assert_eq!(name("b\u{A0}".as_bytes()), Ok(5));
    assert_eq!(landmark_outcome(&[9, 0, 1, b'b']), Err(RecordFault::Kind { code: 9 }));
    assert_eq!(landmark_outcome(&[0, 2, 1, b'b']), Err(RecordFault::Form));
    assert_eq!(landmark_outcome(&[0, 1, 0x80, 0x80]), Err(RecordFault::Form));
    assert_eq!(landmark_outcome(&[0, 0, 1, b'b', b'b']), Err(RecordFault::Length { found: 5, expected: 4 }));
    assert_eq!(landmark_outcome(&[0, 0, 2, b'b']), Err(RecordFault::Length { found: 4, expected: 5 }));
}

#[test]
fn a_position_that_is_not_on_the_earth_is_refused() {
    let landmark = |latitude: &[u8], longitude: &[u8], error: &[u8]| {
        landmark_outcome(&[&[0, 1], latitude, longitude, error, &[1, b'b']].concat())
    };
    // 1,800,000,000 is 80 a4 a7 da 06; zigzag: 900,000,000, and one less is -900,000,000.
    assert_eq!(landmark(&[0x80, 0xA4, 0xA7, 0xDA, 0x06], &[0], &[0]), Ok(5));
    assert_eq!(
        landmark(&[0x82, 0xA4, 0xA7, 0xDA, 0x06], &[0], &[0]),
        Err(RecordFault::Latitude { found: 900_000_001 })
    );
    let south = RecordFault::Latitude { found: -900_000_001 };
    assert_eq!(landmark(&[0x81, 0xA4, 0xA7, 0xDA, 0x06], &[0], &[0]), Err(south));
    assert_eq!(landmark(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F], &[0], &[0]), Err(RecordFault::Latitude { found: i32::MIN }));
    let east = RecordFault::Longitude { found: 1_800_000_001 };
    assert_eq!(landmark(&[0], &[0x82, 0xC8, 0xCE, 0xB4, 0x0D], &[0]), Err(east));
    assert_eq!(landmark(&[0], &[0xFF, 0xFF, 0xFF, 0xFF, 0x0F], &[0]), Err(RecordFault::Longitude { found: i32::MIN }));
    let error = RecordFault::PositionError { found: 200_000_001 };
    assert_eq!(landmark(&[0], &[0], &[0x81, 0x84, 0xAF, 0x5F]), Err(error));
}

#[test]
fn an_integer_longer_than_it_needs_is_refused() {
    let long = Err(RecordFault::NotCanonical);
    assert_eq!(landmark_outcome(&[0, 1, 0x82, 0x00, 4, 5, 1, b'b']), long);
    assert_eq!(landmark_outcome(&[0, 1, 2, 0x84, 0x80, 0x00, 5, 1, b'b']), long);
    assert_eq!(landmark_outcome(&[0, 1, 2, 4, 0x85, 0x80, 0x80, 0x80, 0x00, 1, b'b']), long);
    let corner = [0; 20];
    assert_eq!(view_outcome([&[0xC0, 0x00, 64, 1][..], &corner].concat()), long);
    assert_eq!(view_outcome([&[64, 0xC0, 0x80, 0x00, 1][..], &corner].concat()), long);
    assert_eq!(view_outcome([&[64, 64, 0x81, 0x00][..], &corner].concat()), long);
}

#[test]
fn a_view_that_was_written_wrong_is_refused() {
    let frame = |width, height| Err(RecordFault::FrameSize { width, height });
    assert_eq!(view_outcome(view(0, 64, &[0])), frame(0, 64));
    assert_eq!(view_outcome(view(64, 0, &[0])), frame(64, 0));
    assert_eq!(view_outcome([&[0x81, 0x08, 64, 1][..], &[0; 20]].concat()), frame(1025, 64));
    assert_eq!(view_outcome([&[64, 0xFF, 0xFF, 0x03, 1][..], &[0; 20]].concat()), frame(64, 65_535));
    assert_eq!(view_outcome(vec![0xFF; 23]), Err(RecordFault::Form));
    let corners = (0..100).collect::<Vec<u32>>();
    assert_eq!(view_outcome(view(64, 64, &corners)), Ok(5));
    let length = |found, expected| Err(RecordFault::Length { found, expected });
    let none = [&view(64, 64, &[])[..], &[0; 20]].concat();
    assert_eq!(view_outcome(none), length(23, 3));
    let cut = |corners: &[u32]| view(64, 64, corners).split_last().map(|(_, rest)| rest.to_vec()).expect("bytes");
    assert_eq!(view_outcome(cut(&[0, 1])), length(42, 43));
    assert_eq!(view_outcome([&view(64, 64, &[0, 1])[..], &[0]].concat()), length(44, 43));
    // As many corners as bytes for them allow, and a limit that is lower: a table that allows one corner.
    let mut fewer = Raw::sound().bytes();
    fewer[14] = 2;
    assert_eq!(outcome(&resealed(fewer.clone())), Ok(5));
    fewer[14] = 1;
    let most = 26;
    assert_eq!(outcome(&resealed(fewer)), view_entry(0, IndexFault::Length { found: 43, least: 23, most }));
}

#[test]
fn a_corner_that_cannot_be_is_refused() {
    // The frame is 64 x 64 px: coordinates are at most 63 * 8 = 504.
    let last = number(504, 504, 4);
    assert_eq!(view_outcome(view(64, 64, &[0, last])), Ok(5));
    for commonness in [0, 7 << 29] {
        let of = |number| view(64, 64, &[number | commonness]);
        assert_eq!(view_outcome(of(last)), Ok(5));
        assert_eq!(view_outcome(of(number(0, 0, 5))), corner_fault(0, CornerFault::Level { found: 5 }));
        assert_eq!(view_outcome(of(number(0, 0, 7))), corner_fault(0, CornerFault::Level { found: 7 }));
        // In the error as everywhere outside the table: in 1/16 px.
        let outside = |x, y| corner_fault(0, CornerFault::OutsideFrame { x, y });
        assert_eq!(view_outcome(of(number(505, 0, 0))), outside(1010, 0));
        assert_eq!(view_outcome(of(number(0, 505, 0))), outside(0, 1010));
        assert_eq!(view_outcome(of(number(8191, 0, 0))), outside(16_382, 0));
        assert_eq!(view_outcome(view(64, 63, &[number(0, 504, 0) | commonness])), outside(0, 1008));
    }
    for unsorted in [[1, 0], [1 << 13, 9], [1 << 26, number(504, 504, 0)], [last, 0]] {
        assert_eq!(view_outcome(view(64, 64, &unsorted)), corner_fault(1, CornerFault::Order), "{unsorted:?}");
    }
    assert_eq!(view_outcome(view(64, 64, &[0, 7, 7])), corner_fault(2, CornerFault::Order));
}

#[test]
fn a_corners_commonness_does_not_sort() {
    for (first, second) in [(0, 0), (0, 7), (7, 0), (3, 4)] {
        let two = |a: u32, b: u32| view(64, 64, &[a | first << 29, b | second << 29]);
        assert_eq!(view_outcome(two(number(2, 2, 2), number(3, 2, 2))), Ok(5));
        assert_eq!(view_outcome(two(number(2, 2, 2), number(2, 2, 2))), corner_fault(1, CornerFault::Order));
        assert_eq!(view_outcome(two(number(3, 2, 2), number(2, 2, 2))), corner_fault(1, CornerFault::Order));
    }
}

#[test]
fn the_callers_mistakes_are_told() {
    let bytes = Raw::sound().bytes();
    let table = LandmarkTable::open(&bytes).expect("sound");
    let mut stream = TableStream::open(Source::new(&bytes)).expect("sound");
    assert_eq!(stream.buffer_bytes(), 43);
    let mut buffer = [0; 43];
    for number in [3, u32::MAX] {
        let missing = TableError::NoSuchRecord { kind: RecordKind::View, number, count: 3 };
        assert_eq!(table.view(number), Err(missing));
        assert_eq!(stream.view(number, &mut buffer), Err(StreamError::Table(missing)));
        let missing = TableError::NoSuchRecord { kind: RecordKind::Landmark, number, count: 2 };
        assert_eq!(table.landmark(number), Err(missing));
        assert_eq!(stream.landmark(number, &mut buffer), Err(StreamError::Table(missing)));
    }
    let small = StreamError::Table(TableError::BufferTooSmall { needed: 43, available: 42 });
    assert_eq!(stream.view(0, &mut buffer[..42]), Err(small));
    let small = StreamError::Table(TableError::BufferTooSmall { needed: 7, available: 0 });
    assert_eq!(stream.landmark(1, &mut []), Err(small));
    assert!(stream.view(0, &mut buffer).is_ok(), "still usable");
}

#[test]
fn a_source_that_fails_is_to_blame() {
    let bytes = Raw::sound().bytes();
    let mut needed = 0;
    // Fails at the first read, the second, and so on, until nothing needs that many.
    while let Err(error) = TableStream::open(Source { good_reads: needed, ..Source::new(&bytes) }) {
        assert_eq!(error, StreamError::Io(ErrorKind::TimedOut));
        needed += 1;
    }
    // Header, two parts of the index, one piece of entries, two landmarks.
    assert_eq!(needed, 6);
    let mut stream = TableStream::open(Source { good_reads: 6, ..Source::new(&bytes) }).expect("sound");
    let error = stream.view(0, &mut [0; 43]).expect_err("no read is left");
    assert_eq!(error, StreamError::Io(ErrorKind::TimedOut));
    assert!(error.to_string().starts_with("the landmark table cannot be read: "), "{error}");
}

#[test]
fn a_source_that_lies_does_no_harm() {
    let bytes = Raw::sound().bytes();
    let boasting = TableStream::open(Source { boast: 1000, ..Source::new(&bytes) });
    assert!(boasting.is_ok(), "it gave what was asked for, all the same");
    let short = &bytes[..20];
    let promising = TableStream::open(Source { promise: 232, ..Source::new(short) });
    let error = promising.map(|_| ()).expect_err("20 bytes");
    assert_eq!(error, StreamError::Table(TableError::Truncated { needed: 40, available: 20 }));
    let boasting = TableStream::open(Source { promise: 232, boast: 1000, ..Source::new(short) });
    assert!(matches!(boasting.map(|_| ()), Err(StreamError::Table(TableError::HeaderChecksum { .. }))));
}

#[test]
fn every_refusal_says_what_to_do() {
    let faults = [
        outcome(&[]),
        outcome(b"hi"),
        outcome(&Raw::sound().bytes()[..100]),
        outcome(&patched(10, &[9])),
        outcome(&patched(LANDMARK_1, &[115])),
        outcome(&Raw::with_landmark(&[9, 0, 1, b'b'])),
        outcome(&Raw::with_view(view(64, 64, &[7, 7]))),
    ];
    let expected = [
        "the landmark table is empty (0 bytes): restore the table from a copy, or enroll again",
        "not a landmark table: it begins with 68 69 00 00 00 00 00 00; give the file that enrollment wrote",
        "the landmark table is cut short: 100 of 252 bytes are there; restore the table from a copy, or enroll again",
        "the header was written wrong: profile 9 does not exist; restore the table from a copy, or enroll again",
        "the index entry of landmark 1 was written wrong: it begins at byte 115, the record before it ends at 116; \
         restore the table from a copy, or enroll again",
        "landmark 1 was written wrong: kind 9 does not exist; restore the table from a copy, or enroll again",
        "view 2 was written wrong: corner 1: it does not sort after the one before it by level, row, column; restore \
         the table from a copy, or enroll again",
    ];
    assert_eq!(faults.len(), expected.len());
    for (fault, expected) in faults.into_iter().zip(expected) {
        assert_eq!(fault.expect_err("refused").to_string(), expected);
    }
}

/// `record` with up to three bytes changed, mostly to small numbers, and up to two added.
fn changed(record: &[u8]) -> impl Strategy<Value = Vec<u8>> + use<> {
    let byte = || prop_oneof![0..4_u8, any::<u8>(), Just(0x80)];
    let changes = prop::collection::vec((0..record.len(), byte()), 0..4);
    let added = prop::collection::vec(byte(), 0..3);
    (Just(record.to_vec()), changes, prop_oneof![4 => Just(vec![]), 1 => added]).prop_map(
        |(mut record, changes, added)| {
            for (at, byte) in changes {
                record[at] = byte;
            }
            record.extend(added);
            record
        },
    )
}

proptest! {
    /// Bytes changed at random and sealed again pass the checksums of header and index, and reach the checks behind.
    #[test]
    fn nothing_panics_and_both_readers_agree(
        changes in prop::collection::vec((8..252_usize, any::<u8>()), 1..6),
        length in prop_oneof![4 => Just(252_usize), 1 => 40..252_usize],
    ) {
        let mut bytes = Raw::sound().bytes();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        bytes.truncate(length);
        let _ = outcome(&resealed(bytes));
    }

    /// A record with any bytes changed, under a right checksum, is refused or is the one way to write what it says.
    #[test]
    fn any_record_is_refused_or_canonical(
        landmark in changed(&[3, 1, 2, 4, 5, 1, b'b']),
        view in changed(&view(64, 64, &[7, 9])),
    ) {
        let mut raw = Raw::sound();
        raw.landmarks[1] = landmark;
        raw.views[2].1 = view;
        let bytes = raw.bytes();
        if outcome(&bytes).is_ok() {
            let table = LandmarkTable::open(&bytes).expect("it was");
            let mut buffer = [0; 128];
            let read = table.landmark(1).expect("it was");
            let encoded = daymark_core::table::encode_landmark(read.name, read.kind, read.position, &mut buffer);
            prop_assert_eq!(encoded, Ok(&raw.landmarks[1][..]));
            let read = table.view(2).expect("it was");
            let features = read.features().collect::<Vec<_>>();
            let encoded =
                daymark_core::table::encode_view(100, read.width(), read.height(), &features, &mut buffer);
            prop_assert_eq!(encoded, Ok(&raw.views[2].1[..]));
        }
    }

    /// Also under a right checksum, with small numbers as they are in a true header.
    #[test]
    fn a_header_of_any_bytes_is_read_or_refused(
        fields in prop::collection::vec(prop_oneof![2 => Just(0_u8), 1 => 0..4_u8, 1 => any::<u8>()], 30),
        rest in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        prop_assert!(outcome(&rest).is_err());
        let mut bytes = [b"DAYMARK\x1A\x01\x00", &fields[..], &rest].concat();
        bytes[10] = 1 + bytes[10] % 2;
        bytes[11..14].copy_from_slice(&[0, 128, 0]);
        let bytes = resealed_header(bytes);
        prop_assert!(outcome(&bytes).is_err(), "the table id is not right");
        if let Ok(header) = Header::decode(&bytes) {
            prop_assert!((1..=800).contains(&header.corners_limit()));
            prop_assert!(header.landmark_count() <= header.view_count() && header.view_count() <= 250_000);
            let index = 12 * header.landmark_count() + 16 * header.view_count();
            prop_assert!(header.file_length() >= 40 + index);
        }
    }
}
