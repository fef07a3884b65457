//! The landmark table as `core/FORMAT.md` specifies it: its worked bytes, what they mean, and back.

use daymark_core::feature::{COMMONNESS, Feature, Signature};
use daymark_core::point::ImagePoint;
use daymark_core::profile::Profile;
use daymark_core::table::{
    CORNER_BYTES, CornerFault, EncodeError, GeoPosition, HEADER_BYTES, Header, Kind, LANDMARK_BYTES, Landmark,
    LandmarkTable, RecordFault, StoredView, StreamError, TableEncoder, TableError, TableLimit, TableStream,
    VIEW_HEADER_BYTES, VIEWS_LIMIT, ViewSource, corner_key, corners_limit, encode_landmark, encode_view, on_grid,
};
use embedded_io::{ErrorType, Read, Seek, SeekFrom};
use proptest::prelude::*;
use std::convert::Infallible;

const FORMAT: &str = include_str!("../core/FORMAT.md");

/// The bytes that FORMAT.md shows; the offset of each line must be where its bytes are.
fn worked_bytes() -> Vec<u8> {
    let block =
        FORMAT.split_once("```text\n").and_then(|(_, rest)| rest.split_once("```")).expect("a block of bytes").0;
    let mut bytes = Vec::new();
    for line in block.lines() {
        let (left, _meaning) = line.split_once('|').expect("a meaning");
        let mut words = left.split_whitespace();
        let offset = words.next().expect("an offset");
        assert_eq!(usize::from_str_radix(offset, 16), Ok(bytes.len()), "{line}");
        bytes.extend(words.map(|word| u8::from_str_radix(word, 16).expect("a byte")));
    }
    bytes
}

fn corner(x: i32, y: i32, level: u8, commonness: i8, signature: [u64; 2]) -> Feature {
    Feature { position: ImagePoint::new(x, y), level, commonness, signature: Signature(signature) }
}

/// A landmark with its views, each a frame size and sorted corners.
#[derive(Debug, Clone, PartialEq)]
struct Enrolled {
    name: String,
    kind: Kind,
    position: Option<GeoPosition>,
    views: Vec<(u16, u16, Vec<Feature>)>,
}

/// What the worked bytes mean, value by value.
fn worked_landmarks() -> Vec<Enrolled> {
    let lantern = GeoPosition { latitude_e7: 541_234_567, longitude_e7: -101_234_567, error_dm: 25 };
    vec![
        Enrolled {
            name: "Alte Brücke".into(),
            kind: Kind::Bridge,
            position: None,
            views: vec![(
                640,
                480,
                vec![
                    corner(810, 1608, 0, 0, [0x0123_4567_89AB_CDEF, 0xFEDC_BA98_7654_3210]),
                    corner(48, 32, 1, 6, [1, 2]),
                ],
            )],
        },
        Enrolled {
            name: "Lantern".into(),
            kind: Kind::Lighthouse,
            position: Some(lantern),
            views: vec![
                (320, 240, vec![corner(5104, 3824, 4, -1, [u64::MAX, 1 << 63])]),
                (64, 64, vec![corner(0, 0, 0, 2, [0, 0])]),
            ],
        },
    ]
}

/// The table of `landmarks`, through the encoder; they are sorted.
fn encoded(profile: Profile, limit: u16, landmarks: &[Enrolled]) -> Result<Vec<u8>, EncodeError> {
    let view_count = landmarks.iter().map(|landmark| landmark.views.len()).sum::<usize>();
    let mut encoder = TableEncoder::new(profile, limit, landmarks.len() as u32, view_count as u32)?;
    let (mut table, mut records) = (vec![0; HEADER_BYTES], Vec::new());
    for landmark in landmarks {
        let mut buffer = [0; LANDMARK_BYTES];
        let record = encode_landmark(&landmark.name, landmark.kind, landmark.position, &mut buffer)?;
        table.extend(encoder.push_landmark(record)?);
        records.extend_from_slice(record);
    }
    for (number, landmark) in (0..).zip(landmarks) {
        for (width, height, features) in &landmark.views {
            let mut buffer = vec![0; VIEW_HEADER_BYTES + features.len() * CORNER_BYTES];
            let record = encode_view(limit, *width, *height, features, &mut buffer)?;
            table.extend(encoder.push_view(number, record)?);
            records.extend_from_slice(record);
        }
    }
    assert_eq!(table.len(), encoder.records_begin());
    table[..HEADER_BYTES].copy_from_slice(&encoder.finish()?);
    table.append(&mut records);
    Ok(table)
}

fn owned_view(view: StoredView<'_>) -> (u16, u16, Vec<Feature>) {
    (view.width(), view.height(), view.features().collect())
}

/// Everything in a table, read through the face that the recognizer has.
fn read<S: ViewSource>(source: &mut S) -> Result<Vec<Enrolled>, S::Error> {
    let mut buffer = vec![0; source.buffer_bytes()];
    let mut landmarks = Vec::new();
    for number in 0..source.landmark_count() {
        let Landmark { name, kind, position, views } = source.landmark(number, &mut buffer)?;
        let (name, mut read_views) = (name.to_owned(), Vec::new());
        for view in views {
            let view = source.view(view, &mut buffer)?;
            assert_eq!(view.landmark(), number);
            read_views.push(owned_view(view));
        }
        landmarks.push(Enrolled { name, kind, position, views: read_views });
    }
    Ok(landmarks)
}

/// A source that gives at most `step` bytes at a time.
struct Source<'a> {
    bytes: &'a [u8],
    position: u64,
    step: usize,
    reads: usize,
}

impl<'a> Source<'a> {
    fn new(bytes: &'a [u8], step: usize) -> Self {
        Self { bytes, position: 0, step, reads: 0 }
    }
}

impl ErrorType for Source<'_> {
    type Error = Infallible;
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        self.reads += 1;
        let rest = self.bytes.get(self.position as usize..).unwrap_or_default();
        let count = buffer.len().min(rest.len()).min(self.step);
        buffer[..count].copy_from_slice(&rest[..count]);
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64, Infallible> {
        self.position = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::End(by) => self.bytes.len() as u64 + by as u64,
            SeekFrom::Current(by) => self.position + by as u64,
        };
        Ok(self.position)
    }
}

/// The same landmarks from the reader in place, the verified one and the stream.
fn assert_reads(bytes: &[u8], expected: &[Enrolled]) {
    let mut table = LandmarkTable::open(bytes).expect("a table");
    assert_eq!(read(&mut table).as_deref(), Ok(expected));
    assert_eq!(read(&mut table.verified().expect("sound")).as_deref(), Ok(expected));
    for step in [1, 7, usize::MAX] {
        let mut stream = TableStream::open(Source::new(bytes, step)).expect("a table");
        assert_eq!(stream.header(), table.header());
        assert_eq!(read(&mut stream).as_deref(), Ok(expected));
        let mut buffer = vec![0; stream.buffer_bytes()];
        assert_eq!(stream.verify(&mut buffer), Ok(()));
    }
}

#[test]
fn worked_bytes_hold_the_worked_landmarks() {
    let bytes = worked_bytes();
    assert_eq!(bytes.len(), 240);
    let table = LandmarkTable::open(&bytes).expect("the worked bytes are a table");
    assert_eq!((table.landmark_count(), table.view_count()), (2, 3));
    assert_eq!(table.profile(), Profile::Handheld);
    assert_eq!(table.header().corners_limit(), 100);
    assert_eq!(table.header().file_length(), 240);
    assert_eq!(table.header().table_id(), 0x1816_9D18_91B7_9AF9);
    assert_eq!(table.landmark(0).map(|landmark| landmark.views), Ok(0..1));
    assert_eq!(table.landmark(1).map(|landmark| landmark.views), Ok(1..3));
    assert_reads(&bytes, &worked_landmarks());
}

#[test]
fn worked_landmarks_give_the_worked_bytes() {
    assert_eq!(encoded(Profile::Handheld, 100, &worked_landmarks()), Ok(worked_bytes()));
}

#[test]
fn every_record_is_as_written_in_the_specification() {
    let mut buffer = [0xAA; 128];
    let at = |latitude_e7, longitude_e7, error_dm| Some(GeoPosition { latitude_e7, longitude_e7, error_dm });
    let landmarks: [(_, _, _, &[u8]); 4] = [
        // The shortest record: 4 bytes.
        ("x", Kind::Other, None, &[0, 0, 1, b'x']),
        // Zigzag: 0 and -1 take one byte each.
        ("é", Kind::House, at(0, -1, 0), &[2, 1, 0, 1, 0, 2, 0xC3, 0xA9]),
        // The limits: 1,800,000,000 - 1 = 0x6b49d1ff is -900,000,000; 3,600,000,000 = 0xd693a400; 200,000,000.
        (
            "S",
            Kind::Castle,
            at(-900_000_000, 1_800_000_000, 200_000_000),
            &[5, 1, 0xFF, 0xA3, 0xA7, 0xDA, 0x06, 0x80, 0xC8, 0xCE, 0xB4, 0x0D, 0x80, 0x84, 0xAF, 0x5F, 1, b'S'],
        ),
        ("a\u{A0}b", Kind::Tower, None, &[4, 0, 4, b'a', 0xC2, 0xA0, b'b']),
    ];
    for (name, kind, position, expected) in landmarks {
        assert_eq!(encode_landmark(name, kind, position, &mut buffer), Ok(expected), "{name}");
    }
    let longest = "n".repeat(64);
    let position = at(900_000_000, -1_800_000_000, 200_000_000);
    let longest = encode_landmark(&longest, Kind::Monument, position, &mut buffer).map(<[u8]>::len);
    assert_eq!(longest, Ok(LANDMARK_BYTES));

    // x 8,184, y 8,184, level 4: the last place of the largest frame; commonness 6; test 0 and test 127 set.
    let last = [corner(16_368, 16_368, 4, 6, [1, 1 << 63])];
    let expected = [0x80, 0x08, 0x80, 0x08, 1, 0xF8, 0x1F, 0xFF, 0xF3]
        .into_iter()
        .chain([1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x80])
        .collect::<Vec<u8>>();
    assert_eq!(encode_view(100, 1024, 1024, &last, &mut buffer), Ok(&expected[..]));
}

#[test]
fn kinds_have_one_code_and_one_name_each() {
    assert_eq!(Kind::ALL.len(), 9);
    for (code, kind) in (0..).zip(Kind::ALL) {
        assert_eq!(kind.code(), code);
        assert_eq!(Kind::from_code(code), Some(kind));
        assert_eq!(Kind::from_name(kind.name()), Some(kind));
        let row = format!("{code} {}", kind.name());
        assert!(FORMAT.contains(&row), "FORMAT.md names {row}");
    }
    assert_eq!((Kind::from_code(9), Kind::from_code(255)), (None, None));
    assert_eq!((Kind::from_name("Church"), Kind::from_name("")), (None, None));
}

/// `count` corners on a grid of one level, sorted.
fn grid(count: usize) -> Vec<Feature> {
    let place = |n: i32| corner(n % 40 * 256, n / 40 * 256, 0, (n % 8) as i8 - 1, [n as u64, !n as u64]);
    (0..count as i32).map(place).collect()
}

#[test]
fn a_view_with_its_index_entry_keeps_to_its_profile() {
    for (profile, corners, expected) in
        [(Profile::Handheld, 100, 2_021), (Profile::Board, 400, 8_022), (Profile::Board, 800, 16_022)]
    {
        let landmark = |views| Enrolled { name: "x".into(), kind: Kind::Other, position: None, views };
        let view = (640, 480, grid(corners));
        let limit = corners_limit(profile);
        let one = encoded(profile, limit, &[landmark(vec![view.clone()])]).expect("one view");
        let two = encoded(profile, limit, &[landmark(vec![view.clone(), view])]).expect("two views");
        assert_eq!(two.len() - one.len(), expected);
        assert!(expected <= profile.view_bytes());
    }
    assert_eq!((corners_limit(Profile::Handheld), corners_limit(Profile::Board)), (100, 800));
}

#[test]
fn a_table_of_nothing_is_a_table() {
    let bytes = encoded(Profile::Board, 400, &[]).expect("nothing is enrolled");
    assert_eq!(bytes.len(), 40);
    assert_reads(&bytes, &[]);
}

/// 40 landmarks of one to three views each: more than the stream's cache holds.
fn many() -> Vec<Enrolled> {
    let views = |n: usize| (0..=n % 3).map(|v| (640, 480, grid(1 + (n + v) % 5))).collect();
    let landmark = |n| Enrolled { name: format!("tower {n:02}"), kind: Kind::Tower, position: None, views: views(n) };
    (0..40).map(landmark).collect()
}

#[test]
fn stream_and_in_place_agree_in_any_order() {
    let bytes = encoded(Profile::Board, 400, &many()).expect("a table");
    assert_reads(&bytes, &many());
    let table = LandmarkTable::open(&bytes).expect("a table");
    let mut stream = TableStream::open(Source::new(&bytes, usize::MAX)).expect("a table");
    let mut buffer = vec![0; stream.buffer_bytes()];
    let count = table.view_count();
    assert_eq!(count, 79);
    for number in (0..count).map(|n| n * 37 % count).chain((0..count).rev()) {
        assert_eq!(stream.view(number, &mut buffer), table.view(number).map_err(StreamError::Table));
        let landmark = number * 40 / count;
        assert_eq!(stream.landmark(landmark, &mut buffer), table.landmark(landmark).map_err(StreamError::Table));
    }
}

#[test]
fn a_walk_over_the_views_seldom_goes_back_to_the_index() {
    let bytes = encoded(Profile::Board, 400, &many()).expect("a table");
    let mut buffer = [0; 256];
    let to_open = TableStream::open(Source::new(&bytes, usize::MAX)).expect("a table").into_inner().reads;
    let mut stream = TableStream::open(Source::new(&bytes, usize::MAX)).expect("a table");
    stream.verify(&mut buffer).expect("sound");
    // 79 records, and the index in pieces of 16 entries: 5.
    assert_eq!(stream.into_inner().reads - to_open, 79 + 5);
}

#[test]
fn a_view_gives_its_corners_by_number_and_from_both_ends() {
    let bytes = worked_bytes();
    let table = LandmarkTable::open(&bytes).expect("a table");
    let view = table.view(0).expect("a view");
    let expected = &worked_landmarks()[0].views[0].2;
    assert_eq!((view.len(), view.is_empty(), view.features().len()), (2, false, 2));
    assert_eq!((view.get(0), view.get(1), view.get(2)), (Some(expected[0]), Some(expected[1]), None));
    assert!(view.features().rev().eq(expected.iter().rev().copied()));
}

fn fault<T>(fault: RecordFault) -> Result<T, EncodeError> {
    Err(EncodeError::Record(fault))
}

#[test]
fn the_encoder_refuses_what_no_reader_accepts() {
    let mut buffer = [0; 256];
    let name = |name: &str| encode_landmark(name, Kind::Other, None, &mut [0; 128]).map(<[u8]>::len);
    assert_eq!(name(""), fault(RecordFault::NameLength { found: 0 }));
    assert_eq!(name(&"n".repeat(65)), fault(RecordFault::NameLength { found: 65 }));
    assert_eq!(name("a\nb"), fault(RecordFault::NameControlCharacter));
    let small = encode_landmark("tower", Kind::Other, None, &mut buffer[..7]);
    assert_eq!(small, Err(EncodeError::BufferTooSmall { needed: 8, available: 7 }));
    let small = encode_view(100, 64, 64, &grid(1), &mut buffer[..22]);
    assert_eq!(small, Err(EncodeError::BufferTooSmall { needed: 23, available: 22 }));
    let none = encode_view(100, 64, 64, &[], &mut buffer);
    assert_eq!(none, fault(RecordFault::CornerCount { found: 0, allowed: 100 }));
    let too_many = encode_view(1, 640, 480, &grid(2), &mut buffer);
    assert_eq!(too_many, fault(RecordFault::CornerCount { found: 2, allowed: 1 }));
    let outside = |x, y| (corner_key(&corner(x, y, 0, 0, [0; 2])), Err(CornerFault::OutsideFrame { x, y }));
    for (key, refused) in [outside(-1, 0), outside(0, i32::MIN), outside(16_383, 0), outside(0, 16_384)] {
        assert_eq!(key, refused);
    }
    assert_eq!(corner_key(&corner(0, 0, 5, 0, [0; 2])), Err(CornerFault::Level { found: 5 }));

    let mut unsorted = worked_landmarks();
    unsorted.swap(0, 1);
    assert_eq!(encoded(Profile::Board, 400, &unsorted), fault(RecordFault::NameOrder));
    let twice = [many()[0].clone(), many()[0].clone()];
    assert_eq!(encoded(Profile::Board, 400, &twice), fault(RecordFault::NameOrder));
    let mut without_view = worked_landmarks();
    without_view[0].views.clear();
    assert!(matches!(encoded(Profile::Board, 400, &without_view), Err(EncodeError::Index(_))));

    let views = TableEncoder::new(Profile::Board, 400, 1, VIEWS_LIMIT + 1).map(|_| ());
    let (limit, found, allowed) = (TableLimit::Views, 250_001, 250_000);
    assert_eq!(views, Err(EncodeError::LimitExceeded { limit, found, allowed }));
    assert!(matches!(TableEncoder::new(Profile::Handheld, 101, 0, 0), Err(EncodeError::Header(_))));
    assert!(matches!(TableEncoder::new(Profile::Board, 801, 0, 0), Err(EncodeError::Header(_))));

    let mut early = TableEncoder::new(Profile::Board, 400, 1, 1).expect("an encoder");
    assert!(matches!(early.push_view(0, &[]), Err(EncodeError::Count { found: 0, announced: 1, .. })));
    let record = encode_landmark("x", Kind::Other, None, &mut buffer).expect("a record");
    early.push_landmark(record).expect("an entry");
    assert!(matches!(early.push_landmark(record), Err(EncodeError::Count { found: 2, announced: 1, .. })));
    assert!(matches!(early.finish(), Err(EncodeError::Count { found: 0, announced: 1, .. })));
}

/// The corners that a view of 64 x 64 px gives back after it was written.
fn through_a_view(features: &[Feature]) -> Result<Vec<Feature>, EncodeError> {
    let view = (64, 64, features.to_vec());
    let landmark = Enrolled { name: "x".into(), kind: Kind::Other, position: None, views: vec![view] };
    let bytes = encoded(Profile::Handheld, 100, &[landmark])?;
    let table = LandmarkTable::open(&bytes).expect("it was written");
    Ok(table.view(0).expect("it was written").features().collect())
}

#[test]
fn every_commonness_comes_back_and_no_other_is_written() {
    let one = |commonness| [corner(1008, 1006, 4, commonness, [u64::MAX; 2])];
    for found in i8::MIN..=i8::MAX {
        let expected = if (-1..=6).contains(&found) {
            Ok(one(found).to_vec())
        } else {
            fault(RecordFault::Corner { index: 0, fault: CornerFault::Commonness { found } })
        };
        assert_eq!(through_a_view(&one(found)), expected);
    }
}

#[test]
fn a_corner_off_the_grid_is_not_written() {
    for (x, y) in [(1, 0), (0, 1), (1007, 1008), (1008, 1007), (501, 333)] {
        let features = [corner(0, 0, 0, 0, [0; 2]), corner(x, y, 1, 0, [0; 2])];
        let off_grid = CornerFault::OffGrid { x, y };
        assert_eq!(corner_key(&features[1]), Err(off_grid));
        assert_eq!(through_a_view(&features), fault(RecordFault::Corner { index: 1, fault: off_grid }));
    }
    let said = RecordFault::Corner { index: 1, fault: CornerFault::OffGrid { x: 1, y: 0 } }.to_string();
    assert_eq!(said, "corner 1: at 1, 0 (1/16 px) it lies off the grid of 1/8 px: round it");
    let said = CornerFault::Commonness { found: 7 }.to_string();
    assert_eq!(said, "commonness 7, allowed are -1 to 6");
}

#[test]
fn commonness_takes_no_part_in_the_order() {
    let at = |x, commonness| corner(x, 8, 2, commonness, [0; 2]);
    let falling = [at(0, 6), at(2, 3), at(4, -1)];
    assert_eq!(through_a_view(&falling), Ok(falling.to_vec()));
    let rising = [at(0, -1), at(2, 3), at(4, 6)];
    assert_eq!(through_a_view(&rising), Ok(rising.to_vec()));
    let order = fault(RecordFault::Corner { index: 1, fault: CornerFault::Order });
    for (first, second) in [(0, 0), (-1, 6), (6, -1), (2, 3)] {
        assert_eq!(corner_key(&at(4, first)), corner_key(&at(4, second)));
        assert_eq!(through_a_view(&[at(4, first), at(4, second)]), order, "two corners at one place");
        assert_eq!(through_a_view(&[at(4, first), at(2, second)]), order, "unsorted");
    }
}

#[test]
fn a_position_comes_to_the_nearest_place_of_the_grid() {
    let frame_40 = |x| on_grid(ImagePoint::new(x, 0), 40, 1).x;
    let expected = [(0, 0), (1, 0), (2, 2), (3, 4), (4, 4), (5, 4), (6, 6), (7, 8), (621, 620), (622, 622), (623, 624)];
    for (x, nearest) in expected {
        assert_eq!(frame_40(x), nearest, "{x}");
        assert_eq!(on_grid(ImagePoint::new(0, x), 1, 40), ImagePoint::new(0, nearest), "{x}");
    }
    for (x, clamped) in [(624, 624), (625, 624), (640, 624), (i32::MAX, 624), (-1, 0), (-2, 0), (i32::MIN, 0)] {
        assert_eq!(frame_40(x), clamped, "{x}");
    }
    let nowhere = on_grid(ImagePoint::new(7, 7), 0, 0);
    assert_eq!(nowhere, ImagePoint::new(0, 0), "an empty frame has no place, and none is stored");
}

#[test]
fn a_header_tells_how_much_of_a_flash_region_is_the_table() {
    let mut region = worked_bytes();
    region.resize(4096, 0xFF);
    assert_eq!(LandmarkTable::open(&region), Err(TableError::TrailingBytes { length: 240, available: 4096 }));
    let length = Header::decode(&region).expect("a header").file_length() as usize;
    assert_reads(&region[..length], &worked_landmarks());
}

#[test]
fn landmarks_are_found_by_the_id_only_if_their_content_is_the_same() {
    let id = |landmarks: &[Enrolled], profile, limit| {
        let bytes = encoded(profile, limit, landmarks).expect("a table");
        LandmarkTable::open(&bytes).expect("a table").header().table_id()
    };
    let worked = id(&worked_landmarks(), Profile::Handheld, 100);
    assert_eq!(worked, id(&worked_landmarks(), Profile::Handheld, 100));
    assert_ne!(worked, id(&worked_landmarks(), Profile::Board, 100));
    assert_ne!(worked, id(&worked_landmarks(), Profile::Handheld, 99));
    let mut other = worked_landmarks();
    other[1].views[1].2[0].signature.0[0] = 1;
    assert_ne!(worked, id(&other, Profile::Handheld, 100));
}

/// Sorted corners on the grid of a frame; the places come from few values, so that some nearly coincide.
fn corners(width: u16, height: u16) -> impl Strategy<Value = Vec<Feature>> {
    let side = |side: u16| {
        let last = i32::from(side - 1) * 8;
        prop_oneof![0..=last, Just(0), Just(last), Just(last / 2)].prop_map(|eighths| eighths * 2)
    };
    let one = (side(width), side(height), 0_u8..5, COMMONNESS, any::<[u64; 2]>());
    prop::collection::vec(one, 1..20).prop_map(|mut corners| {
        corners.sort_by_key(|&(x, y, level, ..)| (level, y, x));
        corners.dedup_by_key(|&mut (x, y, level, ..)| (level, y, x));
        corners.into_iter().map(|(x, y, level, common, signature)| corner(x, y, level, common, signature)).collect()
    })
}

fn enrolled() -> impl Strategy<Value = Enrolled> {
    let size = prop_oneof![Just(1_u16), Just(127), Just(128), Just(640), Just(1024), 1..=1024_u16];
    let view =
        (size.clone(), size).prop_flat_map(|(width, height)| (Just(width), Just(height), corners(width, height)));
    let latitude = prop_oneof![-900_000_000..=900_000_000_i32, Just(-900_000_000), Just(900_000_000)];
    let longitude = prop_oneof![-1_800_000_000..=1_800_000_000_i32, Just(-1_800_000_000), Just(1_800_000_000)];
    let position = (latitude, longitude, 0..=200_000_000_u32)
        .prop_map(|(latitude_e7, longitude_e7, error_dm)| GeoPosition { latitude_e7, longitude_e7, error_dm });
    // 16 characters of at most 4 bytes.
    let name = "[a-c]{1,2}|[^\\p{Cc}]{1,16}";
    let kind = prop::sample::select(Kind::ALL.to_vec());
    (name, kind, prop::option::of(position), prop::collection::vec(view, 1..5))
        .prop_map(|(name, kind, position, views)| Enrolled { name, kind, position, views })
}

proptest! {
    #[test]
    fn whatever_is_encoded_comes_back(mut landmarks in prop::collection::vec(enrolled(), 0..8)) {
        landmarks.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
        landmarks.dedup_by(|a, b| a.name == b.name);
        let bytes = encoded(Profile::Handheld, 100, &landmarks).expect("a table");
        assert_reads(&bytes, &landmarks);
    }

    /// Wherever enrollment finds a corner, it has a place in the table, and none that could be stored is nearer.
    #[test]
    fn whatever_is_brought_to_the_grid_can_be_stored(
        (width, height) in (1..=1024_u16, 1..=1024_u16),
        (x, y) in (-40..16_500, -40..16_500),
        (level, commonness) in (0_u8..5, COMMONNESS),
    ) {
        let position = on_grid(ImagePoint::new(x, y), width, height);
        let features = [corner(position.x, position.y, level, commonness, [0; 2])];
        prop_assert!(encode_view(100, width, height, &features, &mut [0; 32]).is_ok());
        prop_assert_eq!(on_grid(position, width, height), position);
        for (found, asked, side) in [(position.x, x, width), (position.y, y, height)] {
            let clamped = asked.clamp(0, i32::from(side - 1) * 16);
            prop_assert!((found - clamped).abs() <= 1);
        }
    }

    /// The key sorts as level, row and column do.
    #[test]
    fn the_key_sorts_by_level_row_column(two in prop::collection::vec((0_u8..5, 0..8192, 0..8192, COMMONNESS), 2)) {
        let key = |(level, y, x, commonness)| corner_key(&corner(x * 2, y * 2, level, commonness, [0; 2]));
        let place = |(level, y, x, _): (u8, i32, i32, i8)| (level, y, x);
        prop_assert!(key(two[0]).is_ok() && key(two[1]).is_ok());
        prop_assert_eq!(key(two[0]).ok().cmp(&key(two[1]).ok()), place(two[0]).cmp(&place(two[1])));
    }
}
