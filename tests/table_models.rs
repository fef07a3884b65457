//! Models in a landmark table: what is written is read, by both readers alike, and what cannot be is refused.

use daymark_core::feature::{Feature, Signature};
use daymark_core::point::ImagePoint;
use daymark_core::profile::Profile;
use daymark_core::table::{
    EncodeError, HEADER_BYTES, Header, IndexFault, Kind, LANDMARK_BYTES, LANDMARK_ENTRY_BYTES, LandmarkTable,
    MODEL_ENTRY_BYTES, ModelFacts, ModelFault, ModelledView, PackedPoint, RecordFault, RecordKind, StoredAzimuth,
    StreamError, TableEncoder, TableError, TableStream, VIEW_ENTRY_BYTES, encode_landmark, encode_model, encode_view,
};
use embedded_io::{ErrorType, Read, Seek, SeekFrom};
use proptest::prelude::*;
use std::convert::Infallible;

const LIMIT: u16 = 20;

/// A model of a landmark with two views.
#[derive(Debug, Clone, PartialEq)]
struct Model {
    facts: ModelFacts,
    views: Vec<(u16, Vec<PackedPoint>)>,
    triangles: Vec<[u16; 3]>,
}

impl Model {
    /// Five points of two views, two triangles.
    fn example() -> Self {
        let point = |corner, units| PackedPoint { corner, units };
        Self {
            facts: ModelFacts {
                unit_um: 1_500,
                scale_error: Some(200),
                azimuth: Some(StoredAzimuth { centidegrees: 27_050, deviation: 500 }),
                deviation: 12,
            },
            views: vec![
                (0, vec![point(0, [0, 0, 0]), point(3, [1_000, -20, 2_000]), point(19, [-32_768, 32_767, 1])]),
                (1, vec![point(2, [5, 6, 7]), point(4, [-5, -6, -7])]),
            ],
            triangles: vec![[0, 2, 1], [1, 3, 4]],
        }
    }

    fn record(&self) -> Result<Vec<u8>, EncodeError> {
        let views: Vec<ModelledView<'_>> =
            self.views.iter().map(|(view, points)| ModelledView { view: *view, points }).collect();
        let mut buffer = vec![0; 8_192];
        Ok(encode_model(LIMIT, 2, &self.facts, &views, &self.triangles, &mut buffer)?.to_vec())
    }
}

/// Landmarks "a", "b", ... with two views each, and these records of models.
fn table(models: &[Option<Vec<u8>>]) -> Result<Vec<u8>, EncodeError> {
    let count = models.len() as u32;
    let mut encoder = TableEncoder::with_models(Profile::Handheld, LIMIT, count, 2 * count)?;
    let (mut bytes, mut records) = (vec![0; HEADER_BYTES], Vec::new());
    for number in 0..count {
        let mut buffer = [0; LANDMARK_BYTES];
        let name = char::from(b'a' + number as u8).to_string();
        let record = encode_landmark(&name, Kind::Tower, None, &mut buffer)?;
        bytes.extend(encoder.push_landmark(record)?);
        records.extend_from_slice(record);
    }
    for number in 0..2 * count {
        let corner = |n: i32| Feature {
            position: ImagePoint::new(16 * n, 32 * number as i32),
            signature: Signature([n as u64, u64::from(number)]),
            ..Feature::default()
        };
        let features: Vec<Feature> = (0..i32::from(LIMIT)).map(corner).collect();
        let mut buffer = [0; 1_000];
        let record = encode_view(LIMIT, 640, 480, &features, &mut buffer)?;
        bytes.extend(encoder.push_view(number / 2, record)?);
        records.extend_from_slice(record);
    }
    for model in models {
        bytes.extend(encoder.push_model(2, model.as_deref())?);
        records.extend(model.iter().flatten());
    }
    assert_eq!(bytes.len(), encoder.records_begin());
    bytes[..HEADER_BYTES].copy_from_slice(&encoder.finish()?);
    bytes.append(&mut records);
    Ok(bytes)
}

/// A source in memory.
struct Source<'a>(&'a [u8], u64);

impl ErrorType for Source<'_> {
    type Error = Infallible;
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let rest = self.0.get(self.1 as usize..).unwrap_or_default();
        let length = rest.len().min(buffer.len()).min(7);
        buffer[..length].copy_from_slice(&rest[..length]);
        self.1 += length as u64;
        Ok(length)
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64, Infallible> {
        self.1 = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::End(by) => (self.0.len() as i64 + by) as u64,
            SeekFrom::Current(by) => (self.1 as i64 + by) as u64,
        };
        Ok(self.1)
    }
}

/// All models as the reader in place gives them; the reader from a stream must say the very same.
fn read(bytes: &[u8]) -> Result<Vec<Option<Model>>, TableError> {
    let in_place = read_in_place(bytes);
    let streamed = match read_streamed(bytes) {
        Ok(models) => Ok(models),
        Err(StreamError::Table(error)) => Err(error),
        Err(StreamError::Io(never)) => match never {},
    };
    assert_eq!(in_place, streamed);
    in_place
}

fn owned(model: daymark_core::table::StoredModel<'_>) -> Model {
    let points = |range: std::ops::Range<usize>| range.filter_map(|at| model.packed(at)).collect();
    Model {
        facts: model.facts(),
        views: model.views().map(|(view, range)| (view, points(range))).collect(),
        triangles: model.triangles().collect(),
    }
}

fn read_in_place(bytes: &[u8]) -> Result<Vec<Option<Model>>, TableError> {
    let table = LandmarkTable::open(bytes)?;
    table.verify()?;
    // Trusted reads give the same.
    let models = |table: LandmarkTable<'_>| -> Result<Vec<_>, TableError> {
        (0..table.landmark_count()).map(|number| Ok(table.model(number)?.map(owned))).collect()
    };
    let first = models(table)?;
    assert_eq!(Ok(&first), models(table.verified()?).as_ref());
    Ok(first)
}

fn read_streamed(bytes: &[u8]) -> Result<Vec<Option<Model>>, StreamError<Infallible>> {
    let mut table = TableStream::open(Source(bytes, 0))?;
    let mut buffer = vec![0; table.buffer_bytes().max(table.model_bytes())];
    table.verify(&mut buffer)?;
    (0..table.header().landmark_count()).map(|number| Ok(table.model(number, &mut buffer)?.map(owned))).collect()
}

#[test]
fn what_is_written_is_read() {
    let model = Model::example();
    let bytes = table(&[None, Some(model.record().expect("a record")), None]).expect("a table");
    assert_eq!(read(&bytes), Ok(vec![None, Some(model), None]));
    assert_eq!(Header::decode(&bytes).map(|header| (header.version(), header.has_models())), Ok((2, true)));

    let table = LandmarkTable::open(&bytes).expect("a table");
    let stored = table.model(1).expect("sound").expect("a model");
    let point = stored.get(1).expect("a point");
    assert_eq!((point.corner, stored.len()), (3, 5));
    for (found, expected) in point.position.iter().zip([1.5, -0.03, 3.0]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    assert_eq!(stored.views().collect::<Vec<_>>(), [(0, 0..3), (1, 3..5)]);
    assert!((stored.deviation_m() - 0.018).abs() < 1e-12);
    assert!(matches!(table.model(3), Err(TableError::NoSuchRecord { number: 3, count: 3, .. })));
}

#[test]
fn a_table_without_models_has_version_1_and_gives_none() {
    let empty = TableEncoder::new(Profile::Handheld, 100, 0, 0).and_then(TableEncoder::finish).expect("a table");
    assert_eq!(Header::decode(&empty).map(|header| header.version()), Ok(1));
    assert_eq!(read(&empty), Ok(Vec::new()));
    // One way to write it: the version with models needs a model.
    let none = Err(EncodeError::Index(IndexFault::NoModels));
    assert_eq!(table(&[None, None]).map(|_| ()), none);
}

/// What is wrong with a model, by changing the example.
fn fault(change: impl FnOnce(&mut Model)) -> ModelFault {
    let mut model = Model::example();
    change(&mut model);
    match model.record() {
        Err(EncodeError::Record(RecordFault::Model(fault))) => fault,
        other => panic!("{other:?}"),
    }
}

#[test]
fn models_that_cannot_be_are_refused() {
    assert_eq!(fault(|model| model.facts.unit_um = 0), ModelFault::Unit { found: 0 });
    assert_eq!(fault(|model| model.facts.unit_um = 1_000_001), ModelFault::Unit { found: 1_000_001 });
    assert_eq!(fault(|model| model.facts.scale_error = Some(10_001)), ModelFault::ScaleError { found: 10_001 });
    let turned = StoredAzimuth { centidegrees: 36_000, deviation: 0 };
    let azimuth = ModelFault::Azimuth { centidegrees: 36_000, deviation: 0 };
    assert_eq!(fault(|model| model.facts.azimuth = Some(turned)), azimuth);
    assert_eq!(fault(|model| model.views[0].1.truncate(0)), ModelFault::PointCount { found: 2 });
    assert_eq!(fault(|model| model.views[1].0 = 2), ModelFault::View { found: 2 });
    assert_eq!(fault(|model| model.views[1].0 = 0), ModelFault::View { found: 0 });
    assert_eq!(fault(|model| model.views.insert(1, (1, Vec::new()))), ModelFault::View { found: 1 });
    assert_eq!(fault(|model| model.views[0].1[1].corner = 0), ModelFault::Corner { point: 1, corner: 0 });
    assert_eq!(fault(|model| model.views[1].1[1].corner = 20), ModelFault::Corner { point: 4, corner: 20 });
    for wrong in [[0, 2, 5], [0, 1, 1], [1, 0, 2], [2, 3, 0]] {
        assert_eq!(fault(|model| model.triangles[0] = wrong), ModelFault::Triangle { index: 0 }, "{wrong:?}");
    }
    assert_eq!(fault(|model| model.triangles.swap(0, 1)), ModelFault::Triangle { index: 1 });
    assert_eq!(fault(|model| model.triangles[1] = [0, 2, 1]), ModelFault::Triangle { index: 1 });
    let many = (0..5_000).map(|_| PackedPoint { corner: 0, units: [0; 3] }).collect::<Vec<_>>();
    assert_eq!(fault(|model| model.views[0].1 = many), ModelFault::PointCount { found: 5_002 });
}

#[test]
fn a_model_of_another_landmark_and_an_odd_entry_are_refused() {
    let record = Model::example().record().expect("a record");
    let bytes = table(&[Some(record.clone()), None]).expect("a table");
    let entry = HEADER_BYTES + 2 * LANDMARK_ENTRY_BYTES + 4 * VIEW_ENTRY_BYTES;
    // The index guards its entries: only a program that computes the table id anew gets past it.
    let mut flipped = bytes.clone();
    flipped[entry + MODEL_ENTRY_BYTES] ^= 1;
    assert!(matches!(read(&flipped), Err(TableError::IndexChecksum { .. })));
    let last = bytes.len() - 1;
    let mut flipped = bytes;
    flipped[last] ^= 1;
    let error = read(&flipped).expect_err("damaged");
    assert!(matches!(error, TableError::RecordChecksum { kind: RecordKind::Model, number: 0, .. }), "{error:?}");

    let mut encoder = TableEncoder::with_models(Profile::Handheld, LIMIT, 1, 1).expect("an encoder");
    let early = encoder.push_model(1, Some(&record));
    assert!(matches!(early, Err(EncodeError::Count { kind: RecordKind::View, .. })), "{early:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Any flipped bit is noticed, by both readers with the same words.
    #[test]
    fn a_flipped_bit_is_noticed(at in any::<prop::sample::Index>(), bit in 0..8_u8) {
        let mut bytes = table(&[Some(Model::example().record().expect("a record")), None]).expect("a table");
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        prop_assert!(read(&bytes).is_err());
    }

    /// Nor is any cut taken for a table.
    #[test]
    fn a_cut_is_noticed(at in any::<prop::sample::Index>()) {
        let bytes = table(&[None, Some(Model::example().record().expect("a record"))]).expect("a table");
        prop_assert!(read(&bytes[..at.index(bytes.len())]).is_err());
    }

    /// Bytes that were never a model do not panic, and what is accepted is written the same way again.
    #[test]
    fn a_record_is_refused_or_canonical(change in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut record = Model::example().record().expect("a record");
        let at = change.index(record.len());
        record[at] = byte;
        if let Ok(bytes) = table(&[Some(record.clone())]) {
            let model = read(&bytes).expect("sound").remove(0).expect("a model");
            prop_assert_eq!(model.record().expect("a record"), record);
        }
    }
}
