//! The pose step of daymark.
//!
//!     cargo run --release                 times of poses from 60 correspondences, by how many of them are wrong
//!     cargo run --release -- solve        reads problems from standard input, writes poses
//!
//! A problem is a line `fx fy cx cy width height deviation count` (pixels) and `count` lines `X Y Z u v` (metres, pixels). Its answer is one
//! line: nine numbers of the rotation camera_from_model, row by row, three of the centre, the inliers, and microseconds; or `none` and the
//! reason.

use std::hint::black_box;
use std::io::{self, BufRead, Write};
use std::time::Instant;

use daymark_core::camera::Intrinsics;
use daymark_core::camera::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::{Camera, Lens, Scene, Site, Stand, Tower, corners_of};

/// Correspondences of the times.
const COUNT: usize = 60;
/// Each case is solved so often; the least time counts, because other programs run as well.
const ROUNDS: usize = 500;
const CASES: usize = 40;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match std::env::args().nth(1).as_deref() {
        None => Ok(times()?),
        Some("solve") => Ok(filter()?),
        Some(other) => Err(format!("{other:?}: nothing for the times, or \"solve\"").into()),
    }
}

fn times() -> io::Result<()> {
    let lens = Intrinsics::centred(Lens::VGA.focal, 640, 480).expect("a lens");
    let settings = PoseSettings::of_frame(640, 480);
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "{COUNT} correspondences, 0.5 px noise; the least of {ROUNDS} rounds for each of {CASES} views of towers"
    )?;
    writeln!(out, "{:>8} {:>10} {:>10} {:>10} {:>8}", "wrong, %", "least, us", "median, us", "most, us", "poses")?;
    for wrong in [0, 6, 12, 18, 24] {
        let mut solver = PoseSolver::<64>::new();
        let (mut least, mut poses) = (Vec::new(), 0);
        for points in cases(wrong) {
            let mut best = f64::INFINITY;
            let mut answer = Err(NoPose::NotFinite);
            for _ in 0..ROUNDS {
                let start = Instant::now();
                answer = black_box(solver.solve(black_box(&points), &lens, &settings));
                best = best.min(start.elapsed().as_secs_f64() * 1e6);
            }
            poses += usize::from(answer.is_ok());
            least.push(best);
        }
        least.sort_by(f64::total_cmp);
        let share = 100 * wrong / COUNT;
        let [low, middle, high] = [0, least.len() / 2, least.len() - 1].map(|place| least[place]);
        writeln!(out, "{share:>8} {low:>10.1} {middle:>10.1} {high:>10.1} {poses:>5}/{}", least.len())?;
    }
    Ok(())
}

/// Views of the towers with at least so many visible corners, some of them wrong.
fn cases(wrong: usize) -> Vec<Vec<PointInView>> {
    let mut random = Distortion::new(5);
    let towers = Tower::eight();
    let mut cases = Vec::new();
    for tower in towers.iter().cycle() {
        let height = tower.height();
        let angle = 60.0 * random.unit() - 30.0;
        let stand = Stand { angle, distance: height * 1.06 + 10.0, eye: 1.7, aim: height * 0.47 };
        let camera = Camera::before(Site::ORIGIN, stand, Lens::VGA);
        let seen = corners_of(&Scene::alone(tower.clone(), 1), &camera);
        let seen: Vec<_> = seen.into_iter().filter(|corner| corner.visible).collect();
        let mut points: Vec<_> = seen
            .iter()
            .step_by((seen.len() / COUNT).max(1))
            .take(COUNT)
            .map(|corner| PointInView {
                model: [corner.model.x, corner.model.y, corner.model.z],
                image: [corner.image.x, corner.image.y].map(|x| x + 0.5 * random.normal()),
            })
            .collect();
        if points.len() < COUNT {
            continue;
        }
        for number in 0..wrong {
            points[(number * 7 + 3) % COUNT].image = [640.0 * random.unit(), 480.0 * random.unit()];
        }
        cases.push(points);
        if cases.len() == CASES {
            return cases;
        }
    }
    cases
}

fn filter() -> Result<(), Box<dyn std::error::Error>> {
    let mut lines = io::stdin().lock().lines();
    let mut out = io::stdout().lock();
    let mut solver = Box::new(PoseSolver::<2_048>::new());
    while let Some(line) = lines.next() {
        let [fx, fy, cx, cy, width, height, deviation_px, count] = numbers(&line?)?;
        let mut points = Vec::new();
        for _ in 0..count as usize {
            let [x, y, z, u, v] = numbers(&lines.next().ok_or("fewer lines than said")??)?;
            points.push(PointInView { model: [x, y, z], image: [u, v] });
        }
        let lens = Intrinsics::new([fx, fy], [cx, cy])?;
        let settings = PoseSettings { deviation_px, ..PoseSettings::of_frame(width as u32, height as u32) };
        let start = Instant::now();
        let answer = solver.solve(&points, &lens, &settings);
        let micros = start.elapsed().as_secs_f64() * 1e6;
        match answer {
            Ok(pose) => writeln!(out, "{} {} {micros:.1}", row(&pose), pose.inliers)?,
            Err(no) => writeln!(out, "none {no}")?,
        }
    }
    Ok(())
}

fn row(pose: &Pose) -> String {
    let camera = pose.camera_from_model;
    let all = camera.rotation().as_flattened().iter().copied().chain(camera.centre());
    all.map(|number| format!("{number:.12e}")).collect::<Vec<_>>().join(" ")
}

fn numbers<const COUNT: usize>(line: &str) -> Result<[f64; COUNT], String> {
    let found: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
    let found = found.map_err(|error| format!("{line:?}: {error}"))?;
    found.try_into().map_err(|_| format!("{line:?}: {COUNT} numbers are expected"))
}
