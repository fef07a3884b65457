//! Committed pictures as frames and tables, in the profile of a small device.

#![allow(dead_code, reason = "each test uses a part of it")]

use std::path::Path;

use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::feature::Feature;
use daymark_core::image::GrayView;
use daymark_core::kernel::Portable;
use daymark_core::profile::Profile;
use daymark_core::pyramid::level_bytes;
use daymark_core::recognizer::Recognizer;
use daymark_core::table::{
    CORNER_BYTES, HEADER_BYTES, Kind, LANDMARK_BYTES, LandmarkTable, TableEncoder, VIEW_HEADER_BYTES, corner_key,
    encode_landmark, encode_view, on_grid,
};
use daymark_core::tone::TonedFrame;
use daymark_core::verdict::{FalseAnswer, Recognition};

pub(crate) const STORED: usize = 100;
pub(crate) const QUERY: usize = 300;
pub(crate) const FRAME: FrontEnd = FrontEnd { features: QUERY as u16, cell_share_tenths: 12 };
pub(crate) const VIEW: FrontEnd = FrontEnd { features: STORED as u16, cell_share_tenths: 25 };

pub(crate) type Frame = FeatureSet<QUERY>;

/// A committed picture, 320 x 240: its pixels.
pub(crate) fn tower(number: u32, part: &str) -> Vec<u8> {
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/files");
    let file = std::fs::read(files.join(format!("tower-{number}-{part}.pgm"))).expect("a committed picture");
    file[file.len() - 320 * 240..].to_vec()
}

pub(crate) fn read(pixels: &[u8], front_end: FrontEnd) -> Frame {
    let frame = GrayView::new(pixels, 320, 240, 320).expect("a frame");
    let (mut toned, mut levels) = (vec![0; 320 * 240], vec![0; level_bytes(320, 240)]);
    let toned = TonedFrame::write(&Portable, frame, &mut toned).expect("enough memory");
    let mut features = Frame::new();
    let mut extractor = Box::new(Extractor::<48, { FRAME.slots() }>::new());
    extractor.extract(&Portable, toned, front_end, &mut levels, &mut features).expect("enough memory");
    features
}

pub(crate) fn set(features: impl IntoIterator<Item = Feature>) -> Frame {
    let mut set = Frame::new();
    set.reset(320, 240);
    for feature in features {
        set.push(feature).expect("room for all");
    }
    set
}

/// The strongest corners as a view would store them, with every commonness there is.
pub(crate) fn stored(pixels: &[u8]) -> Frame {
    let features = read(pixels, VIEW);
    let columns = features.view();
    let numbered = columns.iter().zip(0_i8..);
    set(numbered.map(|(feature, number)| Feature { commonness: number % 8 - 1, ..feature }).take(STORED))
}

/// A table of one landmark for each name, in the order of the names; each with these views.
pub(crate) fn table(landmarks: &[(&str, &[&Frame])]) -> Vec<u8> {
    let mut landmarks = landmarks.to_vec();
    landmarks.sort_by_key(|(name, _)| *name);
    let (limit, views) = (STORED as u16, landmarks.iter().map(|(_, views)| views.len()).sum::<usize>());
    let mut encoder =
        TableEncoder::new(Profile::Handheld, limit, landmarks.len() as u32, views as u32).expect("a table");
    let (mut bytes, mut records) = (vec![0; HEADER_BYTES], Vec::new());
    for (name, _) in &landmarks {
        let mut buffer = [0; LANDMARK_BYTES];
        let record = encode_landmark(name, Kind::Tower, None, &mut buffer).expect("a name");
        bytes.extend(encoder.push_landmark(record).expect("a landmark"));
        records.extend_from_slice(record);
    }
    for (number, (_, views)) in (0..).zip(&landmarks) {
        for view in *views {
            let place = |feature: Feature| Feature { position: on_grid(feature.position, 320, 240), ..feature };
            let mut features: Vec<Feature> = view.view().iter().map(place).collect();
            features.sort_by_key(corner_key_of);
            features.dedup_by_key(|feature| corner_key_of(feature));
            let mut buffer = [0; VIEW_HEADER_BYTES + STORED * CORNER_BYTES];
            let record = encode_view(limit, 320, 240, &features, &mut buffer).expect("a view");
            bytes.extend(encoder.push_view(number, record).expect("a view"));
            records.extend_from_slice(record);
        }
    }
    bytes[..HEADER_BYTES].copy_from_slice(&encoder.finish().expect("a table"));
    bytes.append(&mut records);
    bytes
}

fn corner_key_of(feature: &Feature) -> u32 {
    corner_key(feature).expect("a corner on the grid")
}

pub(crate) fn recognize(table: &[u8], frame: &Frame) -> Recognition {
    let mut table = LandmarkTable::open(table).expect("a table");
    let mut recognizer = Box::new(Recognizer::<STORED, { 2 * STORED }, 512, QUERY>::new());
    let mut distances = vec![0; STORED * QUERY];
    let limit = FalseAnswer::ONE_PERCENT;
    recognizer.recognize(&Portable, frame.view(), &mut table, &mut distances, &mut [], limit).expect("a sound table")
}
