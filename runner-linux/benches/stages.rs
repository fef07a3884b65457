//! The stages of recognition with each kernel set that runs here: `cargo bench -p daymark`.

use std::sync::LazyLock;

use daymark::engine::Engine;
use daymark::enroll;
use daymark::picture::GrayImage;
use daymark::simd::Processor;
use daymark::table_file::{LandmarkEntry, OwnedTable};
use daymark_core::corner::CornerDetector;
use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::profile::Profile;
use daymark_core::pyramid::{level_bytes, visit_levels};
use daymark_core::table::{Kind, LandmarkTable};
use daymark_core::tone::TonedFrame;
use daymark_core::verdict::FalseAnswer;
use daymark_fixtures::{Lens, Tower, Trial, View};
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

/// Width of a strip of responses, as the engine has it.
const STRIP: usize = 336;
/// The most features that a stage is asked for.
const MOST: FrontEnd = front_end(800);
type WideExtractor = Extractor<STRIP, { MOST.slots() }>;

const fn front_end(features: u16) -> FrontEnd {
    FrontEnd { features, cell_share_tenths: 12 }
}

fn drawn(view: &View) -> GrayImage {
    let frame = view.render();
    GrayImage { pixels: frame.gray, width: frame.width as usize, height: frame.height as usize }
}

/// 640 x 480 px, and the same frame under the tone curve.
static FRAME: LazyLock<GrayImage> =
    LazyLock::new(|| drawn(&View::trial(&Tower::eight()[0], Trial::Between, Lens::VGA)));
static TONED: LazyLock<GrayImage> = LazyLock::new(|| {
    let toned = FRAME.pixels.iter().map(|&gray| daymark_core::kernel::tone(gray)).collect();
    GrayImage { pixels: toned, ..*FRAME }
});

fn names() -> Vec<&'static str> {
    Processor::available().into_iter().map(Processor::name).collect()
}

fn processor(name: &str) -> Processor {
    Processor::available().into_iter().find(|processor| processor.name() == name).unwrap_or(Processor::Portable)
}

fn levels() -> Vec<u8> {
    vec![0; level_bytes(FRAME.width, FRAME.height)]
}

#[divan::bench(args = names())]
fn tone(bencher: Bencher<'_, '_>, name: &str) {
    let (frame, mut out) = (FRAME.view().expect("a frame"), vec![0; FRAME.pixels.len()]);
    let processor = processor(name);
    let kernels = processor.kernels();
    bencher.bench_local(|| TonedFrame::write(kernels, black_box(frame), &mut out).is_ok());
}

#[divan::bench(args = names())]
fn pyramid(bencher: Bencher<'_, '_>, name: &str) {
    let (frame, mut levels) = (TONED.view().expect("a frame"), levels());
    let processor = processor(name);
    let kernels = processor.kernels();
    bencher.bench_local(|| {
        visit_levels(kernels, black_box(frame), &mut levels, |_, level| {
            black_box(level);
        })
    });
}

#[divan::bench(args = names())]
fn corners_first_level(bencher: Bencher<'_, '_>, name: &str) {
    let frame = TONED.view().expect("a frame");
    let mut detector: Box<CornerDetector<STRIP, { MOST.slots() }>> = Box::default();
    let processor = processor(name);
    let kernels = processor.kernels();
    bencher.bench_local(|| {
        detector.detect(kernels, black_box(frame), MOST.level_count(0), MOST.cell_share(0), |corner| {
            black_box(corner);
        });
    });
}

#[divan::bench(args = names())]
fn corners_all_levels(bencher: Bencher<'_, '_>, name: &str) {
    let (mut pixels, mut levels) = (FRAME.pixels.clone(), levels());
    let frame = TonedFrame::in_place(&mut pixels, FRAME.width, FRAME.height, FRAME.width).expect("a frame");
    let mut extractor: Box<WideExtractor> = Box::default();
    let processor = processor(name);
    let kernels = processor.kernels();
    bencher.bench_local(|| extractor.count_corners(kernels, black_box(frame), front_end(600), &mut levels));
}

#[divan::bench(args = names(), consts = [600, 800])]
fn features<const COUNT: u16>(bencher: Bencher<'_, '_>, name: &str) {
    let (frame, mut toned, mut levels) = (FRAME.view().expect("a frame"), vec![0; FRAME.pixels.len()], levels());
    let mut extractor: Box<WideExtractor> = Box::default();
    let mut features: Box<FeatureSet<800>> = Box::default();
    let processor = processor(name);
    let kernels = processor.kernels();
    bencher.bench_local(|| {
        let toned = TonedFrame::write(kernels, black_box(frame), &mut toned).expect("enough memory");
        extractor.extract(kernels, toned, front_end(COUNT), &mut levels, &mut features)
    });
}

/// A table with one view, of the tower that the frame shows or of another.
fn table(tower: &Tower) -> Vec<u8> {
    let [left, _] = View::enrollment(tower, Lens::VGA);
    let view = enroll::view(&drawn(&left), Profile::Handheld).expect("a view");
    let landmark =
        LandmarkEntry { name: tower.name.clone(), kind: Kind::Tower, position: None, views: vec![view], model: None };
    OwnedTable { profile: Profile::Handheld, landmarks: vec![landmark] }.to_bytes().expect("a table")
}

#[divan::bench(args = names())]
fn view_match_right(bencher: Bencher<'_, '_>, name: &str) {
    view_match(bencher, name, &Tower::eight()[0]);
}

#[divan::bench(args = names())]
fn view_match_wrong(bencher: Bencher<'_, '_>, name: &str) {
    view_match(bencher, name, &Tower::eight()[5]);
}

/// With the arrangement of the frame's corners, which a larger table pays for once.
fn view_match(bencher: Bencher<'_, '_>, name: &str, tower: &Tower) {
    let bytes = table(tower);
    let mut table = LandmarkTable::open(&bytes).and_then(LandmarkTable::verified).expect("a table");
    let mut engine = Engine::with_processor(Profile::Handheld, processor(name));
    engine.extract(&FRAME).expect("a frame");
    bencher.bench_local(|| engine.recognize(&mut table, FalseAnswer::ONE_PERCENT).map(|found| found.best));
}
