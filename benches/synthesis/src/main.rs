//! Times of synthesis' inner parts beside their peers, on one thread, in turns.
//!
//! Every round times each program once; printed are the least times and their ratio (peer / daymark: above 1, daymark is
//! faster). On a busy machine only the ratios say anything.

use std::hint::black_box;
use std::time::Instant;

use daymark::classify::towers::{Conditions, TowerViews};
use daymark::synthesize::correspond::{Geometry, pairs, tracks};
use daymark::synthesize::dense::dense;
use daymark::synthesize::features::features;
use daymark::synthesize::model::Model;
use daymark::synthesize::texture::best_views;
use daymark::synthesize::triangulate::Rules;
use daymark_core::camera::triangulate::{Pinhole, Sighting, StereoPair, triangulate};
use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::{Light, Tower};
use daymark_numerics::nearest::NearestPoints;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use spade::{DelaunayTriangulation, Point2, Triangulation};

const ROUNDS: usize = 15;

/// The least seconds of each of these, taken in turns.
fn least<const N: usize>(rounds: usize, mut programs: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for _ in 0..rounds {
        for (program, least) in programs.iter_mut().zip(&mut least) {
            let begin = Instant::now();
            program();
            *least = least.min(begin.elapsed().as_secs_f64());
        }
    }
    least
}

/// Numbers in 0..1 by a linear congruence.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1_u64 << 24) as f64
    }
}

fn delaunay() {
    let mut numbers = Numbers(3);
    let points: Vec<[f64; 2]> = (0..47).map(|_| [640.0 * numbers.next(), 480.0 * numbers.next()]).collect();
    let spade = &mut || {
        for _ in 0..200 {
            let sites = points.iter().map(|&[x, y]| Point2::new(x, y)).collect();
            let mesh = DelaunayTriangulation::<Point2<f64>>::bulk_load(sites).expect("finite");
            black_box(mesh.num_inner_faces());
        }
    };
    let peer: Vec<delaunator::Point> = points.iter().map(|&[x, y]| delaunator::Point { x, y }).collect();
    let delaunator = &mut || {
        for _ in 0..200 {
            black_box(delaunator::triangulate(&peer).triangles.len());
        }
    };
    let [a, b] = least(ROUNDS, [spade, delaunator]).map(|seconds| seconds / 200.0 * 1e6);
    println!("Delaunay of 47 points          spade {a:9.2} us   delaunator {b:9.2} us   ratio {:.2}", b / a);
}

/// Two cameras 30 degrees apart before a building, and the images of its points.
fn triangulation() {
    let camera = |x: f64, turn: f64| {
        let unit = 1.0 / (1.0 + turn * turn).sqrt();
        let (right, forward) = ([unit, -turn * unit, 0.0], [turn * unit, unit, 0.0]);
        let row = |axis: [f64; 3], centre: f64| [0, 1, 2].map(|i: usize| 560.0 * axis[i] + centre * forward[i]);
        let matrix = [row(right, 319.5), row([0.0, 0.0, -1.0], 239.5), forward];
        Pinhole::new(matrix, [x, -30.0, 2.0]).expect("a camera")
    };
    let (one, other) = (camera(-8.0, 0.27), camera(8.0, -0.27));
    let mut numbers = Numbers(5);
    let points: Vec<[f64; 3]> = (0..100_000)
        .map(|_| [10.0 * numbers.next() - 5.0, 10.0 * numbers.next() - 5.0, 12.0 * numbers.next()])
        .collect();
    let mut image = |camera: &Pinhole| -> Vec<[f64; 2]> {
        points.iter().map(|&point| camera.project(point).expect("in front").map(|c| c + numbers.next() - 0.5)).collect()
    };
    let (left, right) = (image(&one), image(&other));
    let pair = StereoPair::new(&one, &other);
    let mut model = vec![[0.0; 3]; points.len()];
    let mut fast = || {
        pair.points(&left, &right, &mut model);
        black_box(&model);
    };
    let mut exact = || {
        let sum: f64 = left
            .iter()
            .zip(&right)
            .filter_map(|(&a, &b)| {
                let sightings = [Sighting { camera: &one, at: a }, Sighting { camera: &other, at: b }];
                Some(triangulate(&sightings, 0.5).ok()?.deviation())
            })
            .sum();
        black_box(sum);
    };
    let [a, b] = least(ROUNDS, [&mut fast, &mut exact]).map(|seconds| seconds * 1e3);
    println!("Triangulation of 100,000       pair  {a:9.2} ms   least reprojection error with covariance {b:9.2} ms");
}

/// The texture of a surface of 47 corners, as the thesis had (6.3: 0.043 s): which view shows each triangle, then the points
/// of a level of subdivision with their colours, and the mean of each triangle's three (6.2).
fn texture() {
    let tower = &Tower::eight()[0];
    let conditions = Conditions { light: Light::morning(), seed: 51, farther: 1.0 };
    let seen = TowerViews::new(tower, &[-8.0, 10.0], &conditions, false);
    let found: Vec<_> = seen.views().iter().map(|view| features(view).expect("a picture")).collect();
    let matches = pairs(seen.views(), &found, Geometry::Known(seen.stations()));
    let (all, _) = tracks(&found, &matches);
    // Spread over the picture, as people pick them.
    let tracks: Vec<_> = all.iter().step_by(all.len() / 47).take(47).cloned().collect();
    let model = Model::new(seen.views(), seen.stations(), &tracks, &[[0, 1]], &Rules::default(), 0.0);
    let surface = &model.surface;
    println!("Surface for the texture: {} points, {} triangles", surface.vertices.len(), surface.triangles.len());
    for level in [SubdivisionLevel::ONE, SubdivisionLevel::FOUR, SubdivisionLevel::SEVEN] {
        let mut patches = 0;
        let mut own = || {
            let shown = best_views(surface, seen.views(), seen.stations());
            let cloud = dense(surface, level, seen.views(), seen.stations(), &shown).expect("a surface");
            patches = cloud.triangles.len();
            black_box(cloud.patch_colours().fold(0_u32, |sum, [r, ..]| sum.wrapping_add(u32::from(r))));
        };
        let [seconds] = least(5, [&mut own]);
        println!("Texture to level {}             own  {:9.2} ms   {patches} patches", level.number(), seconds * 1e3);
    }
}

fn nearest_points(count: usize, rounds: usize) {
    let mut numbers = Numbers(7);
    let mut cloud = || -> Vec<[f32; 3]> { (0..count).map(|_| [0; 3].map(|_| numbers.next() as f32)).collect() };
    let (base, test) = (cloud(), cloud());
    let (mut ours, mut theirs) = (0.0, 0.0);
    let mut own = || {
        let tree = NearestPoints::new(&base);
        ours = tree.nearest_of_each(&test, &base).iter().flatten().map(|n| f64::from(n.squared)).sum();
    };
    let mut kiddo = || {
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&base).expect("finite");
        let squared = |query| tree.query(query).nearest_one::<SquaredEuclidean<f32>>().execute().distance;
        theirs = test.iter().map(|query| f64::from(squared(query))).sum();
    };
    let [a, b] = least(rounds, [&mut own, &mut kiddo]).map(|seconds| seconds * 1e3);
    assert!((ours - theirs).abs() <= 1e-5 * theirs, "{ours} against {theirs}");
    println!("Nearest of {count:>9}, built too  own  {a:9.2} ms   kiddo      {b:9.2} ms   ratio {:.2}", b / a);
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("one thread");
    delaunay();
    triangulation();
    texture();
    nearest_points(10_000, ROUNDS);
    nearest_points(1_000_000, 5);
}
