//! The thesis' correspondence and what follows it, of two views of the same corners.
//!
//! There is no peer: robust estimators (RANSAC and its like) begin with pairs, and which corner belongs to which is the
//! question here. The thesis took 0.193 s for the layers and 0.211 s for their correspondence of 47 corners.

use std::hint::black_box;

use cpu_time::ThreadTime;
use daymark_core::geometry::HullLayers;
use daymark_core::geometry::arrangement::{Arrangement, scratch_length};
use daymark_core::geometry::correspond::{Correspond, Settings, Sources};
use daymark_core::geometry::proposal::{Invariance, Pairing, Terms};
use daymark_core::geometry::quad::Tolerance;
use daymark_core::geometry::shift::{LayerQuad, plain_shift, quads_of};

use crate::sets::Views;

/// Corners of a view, at most.
const POINTS: usize = 160;
const LAYERS: usize = POINTS / 3;
/// Noise of each coordinate, px.
const NOISE_PX: f64 = 0.5;
/// Corners timed for each task, over all pairs of views.
const CORNERS: usize = 20_000;

/// Everything that the tasks need, allocated once.
struct Matcher {
    layers: [HullLayers<POINTS, LAYERS>; 2],
    workspace: Correspond<POINTS, LAYERS, 512, 2_600>,
    arrangements: Vec<Arrangement>,
    quads: Vec<LayerQuad>,
}

type Task = (&'static str, fn(&mut Matcher, &Views) -> Vec<Pairing>);

const TASKS: [Task; 8] = [
    ("layers", |matcher, views| {
        matcher.peel(views);
        Vec::new()
    }),
    ("layers, plain circular shift", Matcher::plain),
    ("layers, tolerant shift, vote", |matcher, views| matcher.vote(views, Sources::Layers)),
    ("local arrangements, vote", |matcher, views| matcher.vote(views, Sources::Arrangements)),
    ("correspond, layers alone", |m, views| m.correspond(views, Sources::Layers, Invariance::Affine)),
    ("correspond, arrangements alone", |m, views| m.correspond(views, Sources::Arrangements, Invariance::Affine)),
    ("correspond", |matcher, views| matcher.correspond(views, Sources::Both, Invariance::Affine)),
    ("correspond, perspective", |m, views| m.correspond(views, Sources::Both, Invariance::Perspective)),
];

impl Matcher {
    fn new() -> Box<Self> {
        Box::new(Self {
            layers: [const { HullLayers::new() }; 2],
            workspace: Correspond::new(),
            arrangements: vec![Arrangement::default(); scratch_length(POINTS)],
            quads: vec![LayerQuad::default(); quads_of(2 * POINTS)],
        })
    }

    fn peel(&mut self, views: &Views) {
        self.layers[0].peel(&views.first).expect("room for all");
        self.layers[1].peel(&views.second).expect("room for all");
    }

    /// Each layer with that of the same number.
    fn plain(&mut self, views: &Views) -> Vec<Pairing> {
        self.peel(views);
        let [first, second] = &self.layers;
        let shift =
            |(one, two)| plain_shift::<POINTS>((&views.first, one), (&views.second, two), Tolerance::FIVE_PERCENT);
        first.layers().zip(second.layers()).filter_map(shift).flat_map(|shift| shift.pairs).collect()
    }

    fn vote(&mut self, views: &Views, sources: Sources) -> Vec<Pairing> {
        let settings = Settings { sources, ..Settings::of_picture(640, 480) };
        let (scratch, quads) = (&mut self.arrangements, &mut self.quads);
        let pairs = self.workspace.vote(&views.first, &views.second, settings, scratch, quads).expect("room for all");
        pairs.iter().map(|supported| supported.pair).collect()
    }

    fn correspond(&mut self, views: &Views, sources: Sources, invariance: Invariance) -> Vec<Pairing> {
        let settings = Settings::of_picture(640, 480);
        let settings = Settings { sources, terms: Terms { invariance, ..settings.terms } };
        let (scratch, quads) = (&mut self.arrangements, &mut self.quads);
        let answer = self.workspace.correspond(&views.first, &views.second, settings, scratch, quads);
        let _ = black_box(answer.expect("room for all"));
        self.workspace.found().iter().map(|found| found.pair).collect()
    }
}

/// Prints the median time of each task, and how many of the corners it pairs rightly and wrongly, per cent. Each task sees
/// each pair of views once; the tasks take turns, and another begins each time.
pub fn measure() {
    println!(
        "{:<32} {:>8} {:>6} {:>14} {:>8} {:>8}",
        "correspondence, 0.5 px noise", "corners", "pairs", "us, two views", "right %", "wrong %"
    );
    let mut matcher = Matcher::new();
    for size in [47, 150] {
        let all = Views::pairs(CORNERS / size, size, NOISE_PX);
        let mut samples = vec![Vec::new(); TASKS.len()];
        let mut counts = [[0_usize; 2]; TASKS.len()];
        for (turn, views) in all.iter().enumerate() {
            for place in 0..TASKS.len() {
                let which = (place + turn) % TASKS.len();
                let start = ThreadTime::now();
                let pairs = black_box(TASKS[which].1(&mut matcher, black_box(views)));
                samples[which].push(start.elapsed().as_secs_f64() * 1e6);
                let right = pairs.iter().filter(|pair| views.partner[usize::from(pair.first)] == pair.second).count();
                counts[which][0] += right;
                counts[which][1] += pairs.len() - right;
            }
        }
        for (((name, _), samples), counts) in TASKS.iter().zip(&mut samples).zip(counts) {
            samples.sort_by(f64::total_cmp);
            let share = |count: usize| 100.0 * count as f64 / (all.len() * size) as f64;
            println!(
                "{name:<32} {size:>8} {:>6} {:>14.1} {:>8.1} {:>8.2}",
                all.len(),
                samples[samples.len() / 2],
                share(counts[0]),
                share(counts[1])
            );
        }
    }
}
