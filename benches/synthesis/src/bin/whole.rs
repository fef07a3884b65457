//! The whole of synthesis without files: two pictures in memory become a model and its dense cloud.
//!
//!     whole                              the fixtures' towers, 640 x 480
//!     whole A.jpg B.jpg FOCAL [WIDTH]    photographs, scaled down to a width; the focal length is that of the files
//!     whole --turns ...                  one run for each line of the input, its milliseconds on the output: for a script
//!                                        that lets a peer take its turns
//!
//! One thread. Printed are the least and the median of the times, of the clock on the wall and of the processor (on a busy
//! machine the second says more), and what was found.

use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

use daymark::camera_file::lens::Lens;
use daymark::picture::{GrayImage, read_colour, scaled_colours};
use daymark::synthesize::reconstruct::{Cameras, Corners, Reconstruction, reconstruct};
use daymark::synthesize::triangulate::Rules;
use daymark::synthesize::view::View;
use daymark_core::mesh::SubdivisionLevel;
use rustix::time::{ClockId, clock_gettime};

use daymark_fixtures::{Camera, Light, Scene, Sensor, Site, Tower, render, view};

const ROUNDS: usize = 21;
const LEVEL: SubdivisionLevel = SubdivisionLevel::FOUR;

fn tower(number: usize) -> Vec<View> {
    let tower = &Tower::eight()[number - 1];
    let scene = Scene::alone(tower.clone(), 40 + number as u64).lit(Light::morning());
    [-8.0, 10.0]
        .into_iter()
        .zip(1..)
        .map(|(angle, seed)| {
            let camera = Camera::before(Site::ORIGIN, view::stand(tower, angle), daymark_fixtures::Lens::VGA);
            let frame = render(&scene, &camera, &Sensor::daylight(seed));
            View {
                name: format!("tower {number} at {angle}"),
                lens: Lens::of_focal(camera.width, camera.height, camera.focal),
                gray: GrayImage { pixels: frame.gray, width: frame.width as usize, height: frame.height as usize },
                rgb: frame.rgb,
            }
        })
        .collect()
}

fn photographs(paths: [&str; 2], focal: f64, width: usize) -> Vec<View> {
    let read = |path: &str| {
        let (gray, rgb) = read_colour(Path::new(path)).expect("a picture");
        let lens = Lens::of_focal(gray.width as u32, gray.height as u32, focal);
        let side = width.min(gray.width.max(gray.height));
        let rgb = scaled_colours(&rgb, gray.width, gray.height, side);
        let gray = gray.scaled_to(side);
        let lens = lens.scaled_to(gray.width as u32, gray.height as u32);
        View { name: path.to_owned(), gray, rgb, lens }
    };
    paths.map(read).into()
}

/// Seconds that all threads of the program have computed.
fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Returns the seconds on the wall and of the processor, and what came out.
fn once(views: &[View]) -> ([f64; 2], Result<(Reconstruction, usize), String>) {
    // A caller hands its pictures over: copying them is not part of the work.
    let views = views.to_vec();
    let (begin, computed) = (Instant::now(), processor_seconds());
    let made = reconstruct(views, &Cameras::Unknown { free_lens: false }, &Corners::Automatic, &Rules::default());
    let result = made.map_err(|why| why.to_string()).and_then(|made| {
        let dense = made.model.dense(LEVEL, &made.views, &made.stations).map_err(|why| why.to_string())?;
        Ok((made, dense.positions.len()))
    });
    ([begin.elapsed().as_secs_f64(), processor_seconds() - computed], result)
}

fn said(result: &Result<(Reconstruction, usize), String>) -> String {
    match result {
        Err(why) => why.clone(),
        Ok((made, points)) => {
            let vertices = &made.model.surface.vertices;
            let squares: f64 = vertices.iter().map(|v| v.reprojection_px * v.reprojection_px).sum();
            format!(
                "{} look-alikes, {} matches, {} points ({:.3} px), {} triangles, {points} dense points",
                made.pairs[0].alike,
                made.pairs[0].matches,
                vertices.len(),
                (squares / vertices.len().max(1) as f64).sqrt(),
                made.model.surface.triangles.len(),
            )
        }
    }
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("one thread");
    let all: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = all.iter().map(String::as_str).filter(|word| *word != "--turns").collect();
    let pairs: Vec<Vec<View>> = match words.as_slice() {
        [] => [1, 3, 8].map(tower).into(),
        [a, b, focal, rest @ ..] => {
            let width = rest.first().map_or(640, |width| width.parse().expect("a width"));
            vec![photographs([a, b], focal.parse().expect("a focal length"), width)]
        }
        _ => panic!("give two pictures and a focal length, or nothing"),
    };
    if words.len() < all.len() {
        for _ in std::io::stdin().lock().lines() {
            let (seconds, result) = once(&pairs[0]);
            println!("{:.3} {:.3} {}", seconds[0] * 1e3, seconds[1] * 1e3, said(&result));
            std::io::stdout().flush().expect("an output");
        }
        return;
    }
    for pair in &pairs {
        let mut times = [Vec::new(), Vec::new()];
        let mut last = None;
        for _ in 0..ROUNDS {
            let (seconds, result) = once(pair);
            for (times, seconds) in times.iter_mut().zip(seconds) {
                times.push(seconds * 1e3);
            }
            last = Some(result);
        }
        println!("{} and {}", pair[0].name, pair[1].name);
        for (times, what) in times.iter_mut().zip(["wall", "processor"]) {
            times.sort_unstable_by(f64::total_cmp);
            println!("    {what:9} least {:6.1} ms, median {:6.1} ms", times[0], times[ROUNDS / 2]);
        }
        if let Some(result) = &last {
            println!("    {}", said(result));
        }
    }
}
