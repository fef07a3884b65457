//! Point sets, each one different, so that no branch predictor learns them.

use std::path::Path;

use daymark_core::extract::{Extractor, FeatureSet, FrontEnd};
use daymark_core::image::GrayView;
use daymark_core::kernel::Portable;
use daymark_core::point::{ImagePoint, SUBPIXEL};
use daymark_core::pyramid::level_bytes;
use daymark_core::tone::TonedFrame;

/// Points timed for each program, over all sets of a size.
const POINTS: usize = 400_000;

/// Where points come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Uniform in a frame of 640 x 480 px.
    Frame,
    /// Uniform in a square of 65,536 steps.
    Square,
    /// Chosen from the corners of the committed pictures, each set under an affine map of its own.
    Corners,
    /// The four corners of windows in rows and columns, some missing: many on one line.
    Windows,
}

impl Source {
    pub fn name(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::Square => "square",
            Self::Corners => "corners",
            Self::Windows => "windows",
        }
    }
}

pub struct Sets {
    pub source: Source,
    pub size: usize,
    pub all: Vec<Vec<ImagePoint>>,
}

impl Sets {
    pub fn new(source: Source, size: usize) -> Self {
        let mut random = Random(7);
        let pictures = if source == Source::Corners { corners() } else { Vec::new() };
        let all = (0..(POINTS / size).max(24)).map(|_| match source {
            Source::Frame => random.points(size, 640 * SUBPIXEL, 480 * SUBPIXEL),
            Source::Square => random.points(size, 1 << 16, 1 << 16),
            Source::Corners => {
                let picture = &pictures[random.below(pictures.len() as i32) as usize];
                random.mapped(random.clone().chosen(picture, size))
            }
            Source::Windows => {
                let windows = random.windows(size);
                random.chosen(&windows, size)
            }
        });
        Self { source, size, all: all.collect() }
    }
}

/// Corners, 12 px apart at least, and another view of them.
pub struct Views {
    pub first: Vec<ImagePoint>,
    pub second: Vec<ImagePoint>,
    /// The number in the second view of each corner of the first.
    pub partner: Vec<u16>,
}

impl Views {
    /// `count` pairs of views of `size` corners: turned, stretched and sheared, in another order, with noise of
    /// `sigma` px on each coordinate.
    pub fn pairs(count: usize, size: usize, sigma: f64) -> Vec<Self> {
        let mut random = Random(11);
        let mut pair = || {
            let first = random.apart(size);
            let order = random.chosen(&(0..size as u16).collect::<Vec<_>>(), size);
            let shuffled = order.iter().map(|&number| first[usize::from(number)]).collect();
            let second = random.mapped(shuffled).into_iter().map(|p| random.moved(p, sigma)).collect();
            let mut partner = vec![0; size];
            for (number, &of) in (0..).zip(&order) {
                partner[usize::from(of)] = number;
            }
            Self { first, second, partner }
        };
        (0..count).map(|_| pair()).collect()
    }
}

/// SplitMix64.
#[derive(Clone)]
struct Random(u64);

impl Random {
    fn below(&mut self, end: i32) -> i32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) % end as u64) as i32
    }

    fn points(&mut self, count: usize, width: i32, height: i32) -> Vec<ImagePoint> {
        (0..count).map(|_| ImagePoint::new(self.below(width), self.below(height))).collect()
    }

    /// In a frame of 640 x 480 px.
    fn apart(&mut self, count: usize) -> Vec<ImagePoint> {
        let mut points: Vec<ImagePoint> = Vec::new();
        while points.len() < count {
            let point = ImagePoint::new(self.below(640 * SUBPIXEL), self.below(480 * SUBPIXEL));
            if points.iter().all(|other| (other.x - point.x).abs() + (other.y - point.y).abs() > 12 * SUBPIXEL) {
                points.push(point);
            }
        }
        points
    }

    /// By twelve uniform numbers added up, for each coordinate.
    fn moved(&mut self, point: ImagePoint, sigma: f64) -> ImagePoint {
        const STEPS: i32 = 1 << 20;
        let mut noise = || {
            let normal = (0..12).map(|_| f64::from(self.below(STEPS)) / f64::from(STEPS)).sum::<f64>() - 6.0;
            (sigma * f64::from(SUBPIXEL) * normal).round() as i32
        };
        ImagePoint::new(point.x + noise(), point.y + noise())
    }

    fn chosen<T: Copy>(&mut self, points: &[T], count: usize) -> Vec<T> {
        let mut points = points.to_vec();
        for at in 0..count {
            let other = at + self.below((points.len() - at) as i32) as usize;
            points.swap(at, other);
        }
        points.truncate(count);
        points
    }

    /// A tenth more points than asked for, of windows as wide as their distance.
    fn windows(&mut self, count: usize) -> Vec<ImagePoint> {
        let windows = (count as i32 * 11 / 40) + 1;
        let columns = windows.isqrt() + self.below(3);
        let [width, height] = [20, 30].map(|least| least + self.below(200));
        let corner = |window: i32| (window % columns * 2 * width, window / columns * 2 * height);
        (0..windows)
            .map(corner)
            .flat_map(|(x, y)| [(x, y), (x + width, y), (x, y + height), (x + width, y + height)])
            .map(|(x, y)| ImagePoint::new(x, y))
            .collect()
    }

    /// Turned, stretched and sheared by up to a quarter.
    fn mapped(&mut self, points: Vec<ImagePoint>) -> Vec<ImagePoint> {
        let [a, b, c, d] = [1_024, 0, 0, 1_024].map(|unit| unit + self.below(512) - 256);
        let map = |p: ImagePoint| ImagePoint::new((a * p.x + b * p.y) >> 10, (c * p.x + d * p.y) >> 10);
        points.into_iter().map(map).collect()
    }
}

/// The corners of each committed picture.
fn corners() -> Vec<Vec<ImagePoint>> {
    const FRONT_END: FrontEnd = FrontEnd { features: 300, cell_share_tenths: 12 };
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/files");
    let names = (1..=8).flat_map(|tower| ["left", "right"].map(|side| format!("tower-{tower}-{side}.pgm")));
    names
        .map(|name| {
            let file = std::fs::read(files.join(name)).expect("a committed picture");
            let frame = GrayView::new(&file[file.len() - 320 * 240..], 320, 240, 320).expect("a frame");
            let (mut toned, mut levels) = (vec![0; 320 * 240], vec![0; level_bytes(320, 240)]);
            let toned = TonedFrame::write(&Portable, frame, &mut toned).expect("enough memory");
            let mut features = FeatureSet::<300>::new();
            let mut extractor = Box::new(Extractor::<48, { FRONT_END.slots() }>::new());
            extractor.extract(&Portable, toned, FRONT_END, &mut levels, &mut features).expect("enough memory");
            features.view().positions.to_vec()
        })
        .collect()
}
