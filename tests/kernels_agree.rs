//! Every kernel set that runs here gives the same bits as the portable loops: one by one, and as a whole engine.

use std::path::Path;

use daymark::engine::{Engine, selection};
use daymark::enroll::select::select_corners;
use daymark::picture::{GrayImage, read_gray};
use daymark::simd::Processor;
use daymark::table_file::{LandmarkEntry, OwnedTable, ViewEntry};
use daymark_core::feature::Signature;
use daymark_core::kernel::{
    BoxSums, Kernels, LANES, LookAlikes, PATCH, PATCH_STRIDE, Portable, Search, Seed, VoteColumns, places,
};
use daymark_core::profile::Profile;
use daymark_core::table::{Kind, LandmarkTable};
use daymark_core::verdict::FalseAnswer;
use daymark_fixtures::{Lens, Tower, Trial, View};

/// Kernel sets to compare with the portable one.
fn others() -> Vec<(&'static str, Processor)> {
    Processor::available().into_iter().map(|processor| (processor.name(), processor)).collect()
}

fn drawn(width: usize, height: usize, gray: impl Fn(usize, usize) -> u8) -> GrayImage {
    let pixels = (0..width * height).map(|i| gray(i % width, i / width)).collect();
    GrayImage { pixels, width, height }
}

/// `SplitMix64` (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    fn bytes(&mut self, count: usize, limit: u64) -> Vec<u8> {
        (0..count).map(|_| self.below(limit) as u8).collect()
    }

    /// A coordinate in a frame, on the 1/16 px grid.
    fn coordinate(&mut self) -> f32 {
        self.below(640 * 16) as f32 / 16.0
    }
}

fn noise(width: usize, height: usize, seed: u64) -> GrayImage {
    GrayImage { pixels: Random(seed).bytes(width * height, 256), width, height }
}

fn tower(number: u32, part: &str) -> GrayImage {
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/files");
    read_gray(&files.join(format!("tower-{number}-{part}.pgm"))).expect("a committed picture")
}

/// Fixtures, noise, blank and extreme pictures, with sides that fill no vector evenly.
fn pictures() -> Vec<GrayImage> {
    let checkers = |width, height, cell: usize| drawn(width, height, |x, y| ((x / cell + y / cell) % 2 * 255) as u8);
    let blank = |gray| drawn(64, 65, |_, _| gray);
    let mut pictures = vec![
        tower(3, "left"),
        tower(6, "right"),
        noise(64, 65, 1),
        noise(641, 479, 2),
        noise(24, 24, 3),
        checkers(641, 479, 1),
        checkers(64, 65, 2),
        checkers(24, 24, 3),
        checkers(101, 67, 7),
    ];
    pictures.extend([0, 1, 127, 128, 255].map(blank));
    pictures
}

/// Pictures of every width up to a few vectors of bytes, for the ends of rows.
fn narrow_pictures() -> impl Iterator<Item = GrayImage> {
    (1..=150).map(|width| noise(width, 9, 100 + width as u64))
}

#[test]
fn rows_of_pixels_and_of_responses() {
    for (name, kernels) in others() {
        for picture in pictures().into_iter().chain(narrow_pictures()) {
            let rows: Vec<&[u8]> = picture.pixels.chunks_exact(picture.width).collect();
            let size = (picture.width, picture.height);
            for rows in rows.windows(3) {
                let rows = [rows[0], rows[1], rows[2]];
                assert_eq!(pixel_rows(kernels.kernels(), rows), pixel_rows(&Portable, rows), "{name}, {size:?}");
            }
            assert_eq!(responses(kernels.kernels(), &rows), responses(&Portable, &rows), "{name}, {size:?}");
        }
    }
}

/// What the pyramid and the tone curve make of three neighbouring rows.
fn pixel_rows(kernels: &dyn Kernels, rows: [&[u8]; 3]) -> Vec<Vec<u8>> {
    let width = rows[0].len();
    let mut toned = vec![7; width];
    kernels.tone_row(rows[0], &mut toned);
    let mut half = vec![7; width / 2];
    kernels.halve(rows[0], rows[1], &mut half);
    let mut all = vec![toned, half];
    for weights in [[5, 2, 0], [3, 4, 0], [1, 5, 1], [4, 3, 0], [2, 5, 0]] {
        let mut shrunk = vec![7; width / 7 * 5];
        kernels.shrink_seven_to_five(rows, weights, &mut shrunk);
        all.push(shrunk);
    }
    all
}

/// The tensor, the bits of the response and the flags of a whole picture.
fn responses(kernels: &dyn Kernels, rows: &[&[u8]]) -> (Vec<[Vec<i32>; 3]>, Vec<Vec<u32>>, Vec<Vec<u8>>) {
    let columns = rows[0].len().saturating_sub(6);
    let tensor: Vec<[Vec<i32>; 3]> = rows
        .windows(3)
        .map(|rows| {
            let mut gradients = [0; 2].map(|_| vec![0; columns + 4]);
            kernels.gradient_row([rows[0], rows[1], rows[2]], gradients.each_mut().map(Vec::as_mut_slice));
            let mut out = [0; 3].map(|_| vec![0; columns]);
            let slices = out.each_mut().map(Vec::as_mut_slice);
            kernels.tensor_row(gradients.each_ref().map(Vec::as_slice), slices);
            out
        })
        .collect();
    let response: Vec<Vec<f32>> = tensor
        .windows(5)
        .map(|five| {
            let mut out = vec![0.0; columns];
            let rows = [0, 1, 2, 3, 4].map(|row: usize| five[row].each_ref().map(Vec::as_slice));
            kernels.response_row(rows, &mut out);
            out
        })
        .collect();
    let flags = response
        .windows(3)
        .map(|three| {
            let mut flags = vec![9; columns];
            kernels.peak_flags([&three[0], &three[1], &three[2]], f32::from_bits(1), &mut flags);
            flags
        })
        .collect();
    let bits = response.iter().map(|row| row.iter().map(|value| value.to_bits()).collect()).collect();
    (tensor, bits, flags)
}

#[test]
fn box_sums_of_patches() {
    for (name, kernels) in others() {
        for picture in pictures() {
            for start in (0..picture.pixels.len()).step_by(1_009) {
                let mut patch = [0; PATCH * PATCH_STRIDE];
                let pixels = picture.pixels.iter().cycle().skip(start);
                patch.iter_mut().zip(pixels).for_each(|(out, &pixel)| *out = pixel);
                let sums = |kernels: &dyn Kernels| {
                    let mut sums: BoxSums = [0; 2_048];
                    kernels.box_sums(&patch, &mut sums);
                    sums
                };
                assert_eq!(sums(kernels.kernels()), sums(&Portable), "{name}, {} px from {start}", picture.width);
            }
        }
    }
}

#[test]
fn rows_of_distances() {
    let mut random = Random(11);
    let mut signatures: Vec<Signature> = (0..800).map(|_| Signature([random.next(), random.next()])).collect();
    signatures.extend([Signature([0; 2]), Signature([u64::MAX; 2]), Signature([1, 1 << 63]), Signature([0; 2])]);
    for (name, kernels) in others() {
        for count in (0..150).chain([300, 799, 804]) {
            let others = &signatures[804 - count..];
            for &signature in [&signatures[0], &signatures[800], &signatures[801]] {
                let distances = |kernels: &dyn Kernels| {
                    let mut out = vec![200; count];
                    kernels.distances(signature, others, &mut out);
                    out
                };
                let row = distances(kernels.kernels());
                assert_eq!(row, distances(&Portable), "{name}, {count} signatures");
                assert_eq!(searches(kernels.kernels(), &row), searches(&Portable, &row), "{name}, {count} distances");
            }
            // Few values, so that many are equal; and every value that a byte has.
            for limit in [2, 5, 129, 256] {
                let row = random.bytes(count, limit);
                assert_eq!(searches(kernels.kernels(), &row), searches(&Portable, &row), "{name}, {row:?}");
            }
        }
    }
}

/// What is asked of a row of distances.
fn searches(kernels: &dyn Kernels, row: &[u8]) -> Vec<(u32, Vec<usize>, [u8; 3], [u16; 3])> {
    let search = |limit| {
        let mut marks = vec![0; row.len().div_ceil(64)];
        kernels.marks_at_most(row, limit, &mut marks);
        let places = places(&marks).collect();
        let nearest = kernels.nearest_three(row, limit);
        (kernels.count_below(row, limit), places, nearest.distances, nearest.places)
    };
    [0, 1, 4, 31, 62, 128, 254, 255].map(search).into()
}

#[test]
fn look_alikes_and_votes() {
    let mut random = Random(12);
    let block = |random: &mut Random| LookAlikes {
        x: [0; LANES].map(|_| random.coordinate()),
        y: [0; LANES].map(|_| random.coordinate()),
        gain: [0; LANES].map(|_| random.below(769) as i32),
        level: [0; LANES].map(|_| 1 << random.below(5)),
        number: [0; LANES].map(|_| random.below(2_048) as i32),
    };
    let blocks: Vec<LookAlikes> = (0..40).map(|_| block(&mut random)).collect();
    let from: Vec<[f32; 2]> = (0..200).map(|_| [random.coordinate(), random.coordinate()]).collect();
    let shaken = |p: f32, random: &mut Random| p + random.below(600) as f32 / 16.0;
    let column = |axis: usize| -> Vec<f32> { from.iter().map(|point| point[axis]).collect() };
    let (from_x, from_y) = (column(0), column(1));
    let to_x: Vec<f32> = from_x.iter().map(|&x| shaken(x, &mut random)).collect();
    let to_y: Vec<f32> = from_y.iter().map(|&y| shaken(y, &mut random)).collect();
    let step: Vec<f32> = (0..200).map(|_| random.below(5) as f32 - 2.0).collect();
    let gain: Vec<i32> = (0..200).map(|_| random.below(769) as i32).collect();
    let (mut found, mut agreed) = (0, 0);
    for (name, kernels) in others() {
        for round in 0..400 {
            let radius = [10.0, 24.0, 44.0 / 3.0, 640.0][round % 4];
            let at = [random.coordinate(), random.coordinate()];
            let search = Search { at, radius_squared: radius * radius, levels: random.below(32) as i32 };
            let blocks = &blocks[..round % 41];
            let key = Portable.closest(blocks, search);
            assert_eq!(kernels.kernels().closest(blocks, search), key, "{name}, {search:?}");
            found += i32::from(key > 0);

            let n = round % 201;
            let columns = VoteColumns {
                from_x: &from_x[..n],
                from_y: &from_y[..n],
                to_x: &to_x[..n],
                to_y: &to_y[..n],
                step: &step[..n],
                gain: &gain[..n],
            };
            let seed = random.below(200) as usize;
            let (to, scale) = ([to_x[seed], to_y[seed]], [0.5, 1.0, 1.4, 2.8][round / 4 % 4]);
            let seed = Seed { from: from[seed], to, scale, step: step[seed] };
            let votes = |kernels: &dyn Kernels| {
                let mut agrees = vec![9; n];
                (kernels.votes(seed, columns, &mut agrees), agrees)
            };
            assert_eq!(votes(kernels.kernels()), votes(&Portable), "{name}, {seed:?}");
            agreed += votes(&Portable).0;
        }
    }
    assert!(found > 100 && agreed > 100_000, "the searches find something: {found}, {agreed}");
}

/// The corners that enrollment keeps, with each kernel set; all the same.
fn enrolled(picture: &GrayImage, profile: Profile) -> ViewEntry {
    let select = |processor: Processor| select_corners(processor, picture, selection(profile));
    let features = select(Processor::Portable);
    for processor in Processor::available() {
        assert!(select(processor) == features, "{}: enrollment differs", processor.name());
    }
    ViewEntry { width: picture.width as u16, height: picture.height as u16, features }
}

/// Features, evidence of every corner, and verdict, as text: a number's text tells its bits.
fn everything(engine: &mut Engine, frame: &GrayImage, mut table: LandmarkTable<'_>) -> Vec<String> {
    engine.extract(frame).expect("a frame");
    let mut told: Vec<String> = engine.features().iter().map(|feature| format!("{feature:?}")).collect();
    let recognition = engine.recognize(&mut table, FalseAnswer::ONE_PERCENT).expect("a sound table");
    told.push(format!("{recognition:?}"));
    for number in 0..3 {
        let view = table.view(number).expect("a sound table");
        told.push(format!("{:?}", engine.explain(&view)));
    }
    told
}

#[test]
fn the_whole_engine() {
    let vga = View::trial(&Tower::eight()[1], Trial::Between, Lens::VGA).render();
    let vga = GrayImage { pixels: vga.gray, width: vga.width as usize, height: vga.height as usize };
    let frames: Vec<GrayImage> =
        pictures().into_iter().chain([vga]).chain([1, 2, 5].map(|number| tower(number, "right"))).collect();
    for profile in Profile::ALL {
        let landmark = |number| LandmarkEntry {
            name: format!("Tower {number}"),
            kind: Kind::Tower,
            position: None,
            views: vec![enrolled(&tower(number, "left"), profile)],
            model: None,
        };
        let landmarks = [1, 2, 3].map(landmark).into();
        let bytes = OwnedTable { profile, landmarks }.to_bytes().expect("a table");
        let table = LandmarkTable::open(&bytes).expect("a table");
        let mut portable = Engine::with_processor(profile, Processor::Portable);
        let mut known = 0;
        for processor in Processor::available() {
            let mut engine = Engine::with_processor(profile, processor);
            for (number, frame) in frames.iter().enumerate() {
                let (told, expected) = (everything(&mut engine, frame, table), everything(&mut portable, frame, table));
                let first = told.iter().zip(&expected).find(|(told, expected)| told != expected);
                assert_eq!(first, None, "{}, {profile:?}, frame {number}", processor.name());
                assert_eq!(told.len(), expected.len());
                known += usize::from(told.iter().any(|line| line.contains("Known(")));
            }
        }
        assert!(known >= 2 * Processor::available().len(), "{profile:?}: only {known} frames show a known tower");
    }
}
