//! How far automatic corners' points lie from the true surface of the fixtures' towers, before and after alignment.
//!
//! Cameras are the true ones, so that the corners alone decide. Points farther away than three metres are on the ground or
//! behind: there is no surface to compare them with.

use std::time::{Duration, Instant};

use daymark::classify::towers::{Conditions, TowerViews, TrueSurface};
use daymark::synthesize::correspond::{Geometry, align, pairs, tracks};
use daymark::synthesize::features::features;
use daymark::synthesize::triangulate::{Rules, points};
use daymark::synthesize::view::Track;
use daymark_fixtures::{Light, Tower};

const FAR: f64 = 3.0;

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("one thread");
    for angles in [&[-8.0, 10.0][..], &[-24.0, 6.0], &[-20.0, -10.0, 0.0, 10.0, 20.0]] {
        let mut distances = [Vec::new(), Vec::new()];
        let (mut count, mut moved, mut time) = (0, 0, Duration::ZERO);
        for tower in Tower::eight() {
            let conditions = Conditions { light: Light::morning(), seed: 300 + u64::from(tower.number), farther: 1.0 };
            let seen = TowerViews::new(&tower, angles, &conditions, false);
            let surface = TrueSurface::new(&tower);
            let found: Vec<_> = seen.views().iter().map(|view| features(view).expect("a picture")).collect();
            let matches = pairs(seen.views(), &found, Geometry::Known(seen.stations()));
            let (before, _) = tracks(&found, &matches);
            let mut after: Vec<Track> = before.clone();
            let begin = Instant::now();
            align(seen.views(), &mut after);
            time += begin.elapsed();
            count += after.len();
            moved += after.iter().zip(&before).filter(|(after, before)| after != before).count();
            for (tracks, distances) in [&before, &after].into_iter().zip(&mut distances) {
                let (vertices, _) = points(tracks, seen.stations(), &Rules::default());
                let off = vertices.iter().map(|vertex| surface.distance(&vertex.position));
                distances.extend(off.filter(|off| *off < FAR));
            }
        }
        let each = time.as_secs_f64() * 1e6 / f64::from(count.max(1) as u32);
        println!("views at {angles:?} degrees: {moved} of {count} tracks aligned, {each:.1} us each");
        for (name, distances) in ["as found", "aligned"].into_iter().zip(&mut distances) {
            distances.sort_unstable_by(f64::total_cmp);
            let at = |share: usize| 1e3 * distances.get(distances.len() * share / 100).copied().unwrap_or(f64::NAN);
            let [median, most] = [50, 75].map(at);
            println!(
                "    {name:8}  median {median:4.0} mm, three quarters within {most:4.0} mm, {} points",
                distances.len()
            );
        }
    }
}
