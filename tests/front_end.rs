//! From a frame to its features: the same whatever the memory, well placed, steady under light, and equal to twins that
//! are written plainly.

use std::path::Path;

use daymark_core::corner::{BORDER, CELLS, CornerDetector, KEPT_PER_SHARE, LevelCorner};
use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::feature::Feature;
use daymark_core::image::GrayView;
use daymark_core::kernel::Portable;
use daymark_core::point::ImagePoint;
use daymark_core::pyramid::{LEVELS, base_from_level, level_bytes, scale, visit_levels};
use daymark_core::signature::{SignatureScratch, describe};
use daymark_core::tone::TonedFrame;

#[allow(dead_code, reason = "of the fixed tables the twin needs the tests of the signature only")]
#[path = "../core/src/model.rs"]
mod model;

const SETTINGS: FrontEnd = FrontEnd { features: 600, cell_share_tenths: 12 };
const SLOTS: usize = SETTINGS.slots();

struct Picture {
    pixels: Vec<u8>,
    width: usize,
    height: usize,
}

impl Picture {
    fn drawn(width: usize, height: usize, gray: impl Fn(usize, usize) -> u8) -> Self {
        Self { pixels: (0..width * height).map(|i| gray(i % width, i / width)).collect(), width, height }
    }

    /// Gray levels without any order, the same every time.
    fn noise(width: usize, height: usize) -> Self {
        Self::drawn(width, height, |x, y| {
            let mut hash = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
            hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
            (hash ^ (hash >> 12)).wrapping_mul(0x297a_2d39).to_le_bytes()[3]
        })
    }

    fn checkers(width: usize, height: usize, cell: usize) -> Self {
        Self::drawn(width, height, |x, y| ((x / cell + y / cell) % 2 * 255) as u8)
    }

    /// A committed picture, 320 x 240.
    fn tower(number: u32) -> Self {
        let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/files");
        let file = std::fs::read(files.join(format!("tower-{number}-left.pgm"))).expect("a committed picture");
        Self { pixels: file[file.len() - 320 * 240..].to_vec(), width: 320, height: 240 }
    }

    fn changed(&self, change: impl Fn(f64) -> f64) -> Self {
        let pixels = self.pixels.iter().map(|&gray| change(f64::from(gray)).clamp(0.0, 255.0) as u8).collect();
        Self { pixels, ..*self }
    }

    fn view(&self) -> GrayView<'_> {
        GrayView::new(&self.pixels, self.width, self.height, self.width).expect("a frame")
    }

    fn at(&self, x: i64, y: i64) -> i64 {
        let (x, y) = (x.clamp(0, self.width as i64 - 1), y.clamp(0, self.height as i64 - 1));
        i64::from(self.pixels[y as usize * self.width + x as usize])
    }

    fn features<const STRIP: usize>(&self) -> Vec<Feature> {
        let (mut toned, mut levels) = (vec![0; self.pixels.len()], vec![0; level_bytes(self.width, self.height)]);
        let toned = TonedFrame::write(&Portable, self.view(), &mut toned).expect("enough memory");
        let mut features = Box::new(FeatureSet::<600>::new());
        let mut extractor = Box::new(Extractor::<STRIP, SLOTS>::new());
        extractor.extract(&Portable, toned, SETTINGS, &mut levels, &mut features).expect("enough memory");
        features.view().iter().collect()
    }

    fn levels(&self) -> Vec<(usize, Self)> {
        let mut levels = Vec::new();
        let mut scratch = vec![0; level_bytes(self.width, self.height)];
        visit_levels(&Portable, self.view(), &mut scratch, |number, level| {
            let (width, height) = (level.width(), level.height());
            levels.push((usize::from(number), Self::drawn(width, height, |x, y| level.row(y)[x])));
        })
        .expect("enough memory");
        levels
    }

    fn levels_in_order(&self) -> Vec<Self> {
        let mut levels = self.levels();
        levels.sort_by_key(|(number, _)| *number);
        levels.into_iter().map(|(_, level)| level).collect()
    }

    fn corners(&self, count: usize, share: usize) -> Vec<LevelCorner> {
        let mut corners = Vec::new();
        let mut detector = Box::new(CornerDetector::<64, SLOTS>::new());
        detector.detect(&Portable, self.view(), count, share, |corner| corners.push(corner));
        corners
    }
}

fn pictures() -> Vec<Picture> {
    vec![
        Picture::tower(2),
        Picture::tower(7),
        Picture::noise(161, 117),
        Picture::noise(24, 24),
        Picture::noise(64, 65),
        Picture::checkers(120, 97, 9),
        Picture::checkers(64, 65, 2),
    ]
}

#[test]
fn the_width_of_the_strip_does_not_matter() {
    for picture in pictures() {
        let expected = picture.features::<64>();
        assert!(expected == picture.features::<13>(), "one column at a time");
        assert!(expected == picture.features::<48>());
        assert!(expected == picture.features::<256>());
        assert!(expected == picture.features::<700>(), "the whole width at once");
    }
    assert!(Picture::tower(2).features::<48>().len() > 300);
}

#[test]
fn corners_keep_off_the_border_and_each_other_and_within_the_budget() {
    for picture in pictures() {
        for (number, level) in picture.levels() {
            for settings in [SETTINGS, FrontEnd { features: 40, ..SETTINGS }] {
                let corners = level.corners(settings.level_count(number), settings.cell_share(number));
                assert!(corners.len() <= settings.level_count(number));
                for (i, a) in corners.iter().enumerate() {
                    let inside = |p: u16, side: usize| (BORDER..side - BORDER).contains(&usize::from(p));
                    assert!(inside(a.column, level.width) && inside(a.row, level.height), "{a:?}");
                    let near = |b: &LevelCorner| a.column.abs_diff(b.column).max(a.row.abs_diff(b.row)) <= 3;
                    assert!(!corners[..i].iter().any(near), "{a:?} has a neighbour");
                }
            }
        }
    }
}

#[test]
fn a_drawn_corner_is_found_where_it_is_drawn() {
    // Two bright quarters that meet at a point, each pixel as bright as the share of it that they cover.
    let share = |pixel: usize, at: f64| (at - pixel as f64 + 0.5).clamp(0.0, 1.0);
    for step in 0..64_u32 {
        let [x, y] = [60.0 + f64::from(step % 8) / 8.0, 63.0 + f64::from(step / 8) / 8.0];
        let picture = Picture::drawn(128, 128, |column, row| {
            let (left, above) = (share(column, x), share(row, y));
            (60.0 + 120.0 * (left * above + (1.0 - left) * (1.0 - above))) as u8
        });
        // Largest error along an axis, in pixels of the level.
        let error = |level: u8, position: ImagePoint| {
            let [found_x, found_y] = position.to_pixels().map(f64::from);
            (found_x - x).abs().max((found_y - y).abs()) / f64::from(scale(level))
        };
        let features = picture.features::<64>();
        for (number, level) in (0_u8..).zip(picture.levels_in_order()) {
            let corners = level.corners(284, 8).into_iter().map(LevelCorner::subpixel);
            let errors = corners.map(|(x, y)| error(number, base_from_level(number, x, y)));
            let least = errors.fold(f64::INFINITY, f64::min);
            assert!(least < 0.6, "({x}, {y}) on level {number}: {least} px of that level beside it");
            // The tone curve brightens the pixels on the edges and so moves them apart.
            let features = features.iter().filter(|feature| feature.level == number);
            let least = features.map(|feature| error(number, feature.position)).fold(f64::INFINITY, f64::min);
            assert!(least < 0.8, "({x}, {y}) on level {number}, toned: {least} px of that level beside it");
        }
    }
}

#[test]
fn light_and_exposure_change_few_signatures() {
    let changes: [(&str, fn(f64) -> f64); 5] = [
        ("darker", |gray| gray * 0.5),
        ("brighter", |gray| gray + 25.0),
        ("less contrast", |gray| gray * 0.6 + 70.0),
        ("gamma 0.7", |gray| 255.0 * (gray / 255.0).powf(0.7)),
        ("gamma 1.4", |gray| 255.0 * (gray / 255.0).powf(1.4)),
    ];
    for number in [1, 4, 8] {
        let picture = Picture::tower(number);
        let before = picture.features::<64>();
        for (name, change) in changes {
            let after = picture.changed(change).features::<64>();
            let again = |a: &Feature| {
                let same = |b: &&Feature| {
                    let apart = (a.position.x - b.position.x).abs().max((a.position.y - b.position.y).abs());
                    a.level == b.level && apart <= 16
                };
                after.iter().filter(same).map(|b| a.signature.distance(b.signature)).min()
            };
            let distances: Vec<u32> = before.iter().filter_map(again).collect();
            let kept = distances.iter().filter(|&&distance| distance <= 12).count();
            // Corners compete for places, so that not all come again.
            let (all, again) = (before.len(), distances.len());
            assert!(10 * again >= 6 * all, "tower {number}, {name}: {again} of {all} corners found again");
            assert!(10 * kept >= 8 * again, "tower {number}, {name}: {kept} of {again} signatures stay");
        }
    }
}

#[test]
fn a_blank_frame_has_no_corner() {
    for gray in [0, 1, 77, 254, 255] {
        assert_eq!(Picture::drawn(200, 150, |_, _| gray).features::<64>(), []);
    }
    assert_eq!(Picture::noise(23, 300).features::<64>(), [], "too narrow");
    let edge = Picture::drawn(200, 150, |x, _| if x < 100 { 20 } else { 220 });
    assert_eq!(edge.features::<64>(), [], "a straight edge");
}

/// `20 R` of Harris and Stephens with `k = 0.05` for the pixel `x`, `y`, in integers up to the tensor.
fn response(picture: &Picture, x: i64, y: i64) -> f32 {
    const BINOMIAL: [i64; 5] = [1, 4, 6, 4, 1];
    let gradient = |x: i64, y: i64| {
        let p = |dx: i64, dy: i64| picture.at(x + dx, y + dy);
        let across = p(1, -1) + 2 * p(1, 0) + p(1, 1) - p(-1, -1) - 2 * p(-1, 0) - p(-1, 1);
        let down = p(-1, 1) + 2 * p(0, 1) + p(1, 1) - p(-1, -1) - 2 * p(0, -1) - p(1, -1);
        (across, down)
    };
    let smoothed = |product: fn(i64, i64) -> i64| {
        let mut sum = 0;
        for (dy, weight) in (-2..).zip(BINOMIAL) {
            let mut row = 0;
            for (dx, weight) in (-2..).zip(BINOMIAL) {
                let (across, down) = gradient(x + dx, y + dy);
                row += weight * product(across, down);
            }
            sum += weight * (row >> 4);
        }
        (sum >> 4) as f32
    };
    let (a, b, c) = (smoothed(|x, _| x * x), smoothed(|_, y| y * y), smoothed(|x, y| x * y));
    20.0 * (a * b - c * c) - (a + b) * (a + b)
}

/// What `CornerDetector` does, without rolling rows, strips, floors and bisection.
fn plain_corners(picture: &Picture, count: usize, share: usize) -> Vec<LevelCorner> {
    let (width, height) = (picture.width, picture.height);
    let responses: Vec<Vec<f32>> =
        (0..height as i64).map(|y| (0..width as i64).map(|x| response(picture, x, y)).collect()).collect();
    let mut cells: Vec<Vec<(f32, LevelCorner)>> = vec![Vec::new(); CELLS];
    for row in BORDER..height - BORDER {
        for column in BORDER..width - BORDER {
            let here = responses[row][column];
            let beaten =
                (row - 3..=row + 3).flat_map(|y| (column - 3..=column + 3).map(move |x| (y, x))).any(|other| {
                    let there = responses[other.0][other.1];
                    there > here || (there == here && other < (row, column))
                });
            if here > 0.0 && !beaten {
                let vertex = |before: f32, after: f32| {
                    let curvature = 2.0 * here - before - after;
                    let offset = if curvature > 0.0 { 8.0 * (after - before) / curvature } else { 0.0 };
                    ((offset + 0.5).floor() as i8).min(7)
                };
                let dx = vertex(responses[row][column - 1], responses[row][column + 1]);
                let dy = vertex(responses[row - 1][column], responses[row + 1][column]);
                let across = |p: usize, cells: usize, side: usize| ((p * ((cells << 16) / side)) >> 16).min(cells - 1);
                let corner = LevelCorner { column: column as u16, row: row as u16, dx, dy };
                cells[across(row, 6, height) * 8 + across(column, 8, width)].push((here, corner));
            }
        }
    }
    // Strongest first; of equal ones the first in raster order, in which they came.
    for cell in &mut cells {
        cell.sort_by(|a, b| b.0.total_cmp(&a.0));
        cell.truncate(KEPT_PER_SHARE * share);
    }
    let raster = |corner: &LevelCorner| (corner.row, corner.column);
    let strongest = |mut all: Vec<(f32, LevelCorner)>, count: usize| {
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(raster(&a.1).cmp(&raster(&b.1))));
        all.truncate(count);
        all
    };
    let first: Vec<_> = cells.iter().flat_map(|cell| cell.iter().take(share).copied()).collect();
    let rest: Vec<_> = cells.iter().flat_map(|cell| cell.iter().skip(share).copied()).collect();
    let fill = count.saturating_sub(first.len());
    let chosen = [strongest(first, count), strongest(rest, fill)].concat();
    cells.into_iter().flatten().filter(|peak| chosen.contains(peak)).map(|(_, corner)| corner).collect()
}

#[test]
fn corners_are_those_of_a_plain_detector() {
    for picture in pictures() {
        for (count, share) in [(284, 8), (30, 1), (48, 2), (1, 1), (0, 1)] {
            let (found, expected) = (picture.corners(count, share), plain_corners(&picture, count, share));
            let size = (picture.width, picture.height);
            assert_eq!(found, expected, "{count} corners, {share} a cell, {size:?}");
        }
    }
}

/// One bit after the other: the signs of differences of direct sums of 25 pixels.
fn plain_signature(picture: &Picture, column: u16, row: u16) -> [u64; 2] {
    let sum = |x: i8, y: i8| -> i64 {
        let (x, y) = (i64::from(column) + i64::from(x), i64::from(row) + i64::from(y));
        (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))).map(|(dx, dy)| picture.at(x + dx, y + dy)).sum()
    };
    let mut words = [0; 2];
    for (number, [ax, ay, bx, by]) in (0_u32..).zip(model::TESTS) {
        let difference = sum(ax, ay) - sum(bx, by);
        let bit = if difference.abs() > 12 {
            difference < 0
        } else {
            let parts = [(u32::from(column), 73_856_093), (u32::from(row), 19_349_663), (number, 83_492_791_u32)];
            let hash = parts.iter().fold(0, |hash, &(part, factor)| hash ^ part.wrapping_mul(factor));
            let hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
            ((hash ^ (hash >> 13)) >> 7) & 1 == 1
        };
        words[number as usize / 64] |= u64::from(bit) << (number % 64);
    }
    words
}

#[test]
fn signatures_are_those_of_direct_sums() {
    let mut scratch = SignatureScratch::new();
    for picture in pictures().iter().chain([&Picture::drawn(40, 50, |_, _| 9)]) {
        let (last_column, last_row) = (picture.width as u16 - 1, picture.height as u16 - 1);
        let inside = (0..=last_column).step_by(7).flat_map(|x| (0..=last_row).step_by(11).map(move |y| (x, y)));
        let at_ends = [(0, last_row), (last_column, 0), (last_column, last_row), (20, 20), (last_column - 20, 20)];
        for (column, row) in inside.chain(at_ends) {
            let found = describe(&Portable, picture.view(), column, row, &mut scratch).0;
            let size = (picture.width, picture.height);
            assert_eq!(found, plain_signature(picture, column, row), "({column}, {row}) of {size:?}");
        }
    }
}

/// Averages over squares with sides of `from / to` pixels, in units of `1 / to` px: exact, and rounded once.
fn plain_average(picture: &Picture, from: usize, to: usize) -> Picture {
    // How much of each pixel along an axis belongs to output `i`.
    let parts = |i: usize| {
        let (begin, end) = (i * from, (i + 1) * from);
        (begin / to..end.div_ceil(to)).map(move |p| (p, ((p + 1) * to).min(end) - (p * to).max(begin)))
    };
    Picture::drawn(picture.width * to / from, picture.height * to / from, |x, y| {
        let sum: usize = parts(y)
            .flat_map(|(py, wy)| parts(x).map(move |(px, wx)| (px, py, wx * wy)))
            .map(|(px, py, weight)| weight * usize::from(picture.pixels[py * picture.width + px]))
            .sum();
        ((2 * sum + from * from) / (2 * from * from)) as u8
    })
}

#[test]
fn levels_are_exact_averages_of_areas() {
    let odd = (24..=38).flat_map(|width| [(width, 31), (29, width)]);
    for (width, height) in odd.chain([(320, 240), (641, 479), (64, 65), (1, 1), (2, 9), (7, 7)]) {
        for picture in [Picture::noise(width, height), Picture::checkers(width, height, 1)] {
            let (one, two) = (plain_average(&picture, 7, 5), plain_average(&picture, 2, 1));
            let (three, four) = (plain_average(&one, 2, 1), plain_average(&two, 2, 1));
            let expected = [&picture, &one, &two, &three, &four];
            let levels = picture.levels();
            for (number, found) in &levels {
                let expected = expected[*number];
                let size = (width, height, *number);
                assert_eq!((found.width, found.height), (expected.width, expected.height), "{size:?}");
                assert!(found.pixels == expected.pixels, "{size:?}");
            }
            assert!(levels.len() == LEVELS || width.min(height) < 24, "{width} x {height}");
        }
    }
}
