//! Times midpoint subdivision on many different meshes of the size that the thesis times (6.3). See README.md.
//!
//!     daymark-subdivision-bench [--json | --meshes]
//!
//! `--json` prints seconds for a program, `--meshes` the meshes themselves, one JSON object a line, for `peers.py`.

mod meshes;

use std::hint::black_box;
use std::process::ExitCode;
use std::time::Instant;

use daymark_core::mesh::{FinePoint, Subdivision, SubdivisionLevel, TriangleMesh, storage_words};
use meshes::{COUNTS, Mesh, POINTS, mesh};

/// Meshes that small tasks are timed on.
const MESHES: u64 = 501;
/// Meshes that level 7 is timed on.
const DEEP_MESHES: u64 = 31;

fn main() -> ExitCode {
    match std::env::args().skip(1).collect::<Vec<_>>().as_slice() {
        [] => table(&measure()),
        [json] if json == "--json" => json_object(&measure()),
        [meshes] if meshes == "--meshes" => (0..MESHES).for_each(|number| print_mesh(&mesh(number))),
        _ => {
            eprintln!("usage: daymark-subdivision-bench [--json | --meshes]");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

/// A task and the median of its times, one for each mesh.
struct Task {
    key: &'static str,
    what: &'static str,
    seconds: f64,
    /// What the time is divided by in the last column.
    points: u64,
}

fn measure() -> Vec<Task> {
    let meshes: Vec<_> = (0..MESHES).map(mesh).collect();
    let deep: Vec<_> = meshes.iter().take(DEEP_MESHES as usize).collect();
    let shallow: Vec<_> = meshes.iter().collect();
    let (one, seven) = (SubdivisionLevel::ONE, SubdivisionLevel::SEVEN);
    let finest = COUNTS.at(seven);

    let mut storage = [0; storage_words(POINTS, COUNTS.triangles as usize)];
    let mut points = vec![FinePoint::default(); finest.vertices as usize];
    let mut space = vec![[0.0_f32; 3]; finest.vertices as usize];
    let mut triangles = vec![[0; 3]; finest.triangles as usize];

    let check = median(&shallow, 20, |mesh| {
        black_box(checked(mesh, &mut storage).counts());
    });
    let once = median(&shallow, 20, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(one);
        black_box(fine.write_values(&mesh.points, &mut points).expect("room"));
        black_box(fine.write_triangles(&mut triangles).expect("room"));
    });
    let indexed = median(&deep, 1, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(seven);
        black_box(fine.write_values(&mesh.points, &mut points).expect("room"));
        black_box(fine.write_triangles(&mut triangles).expect("room"));
    });
    let in_space = |mesh: &Mesh| -> Vec<[f32; 3]> {
        mesh.points.iter().map(|p| [p.x as f32, p.y as f32, (p.x ^ p.y) as f32]).collect()
    };
    let indexed_space = median(&deep, 1, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(seven);
        black_box(fine.write_values(&in_space(mesh), &mut space).expect("room"));
        black_box(fine.write_triangles(&mut triangles).expect("room"));
    });
    let streamed = median(&deep, 1, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(seven);
        black_box(stream(fine, mesh));
    });
    let streamed_space = median(&deep, 1, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(seven);
        let sums = fine
            .values(&in_space(mesh))
            .expect("in range")
            .fold([0.0_f32; 3], |sum, p| [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]]);
        black_box(sums);
    });
    let streamed_weights = median(&deep, 1, |mesh| {
        let fine = checked(mesh, &mut storage).subdivided(seven);
        black_box(fine.points().fold(0_u64, |sum, point| sum + u64::from(point.weights[1] ^ point.corners[2])));
    });
    let task = |key, what, seconds, points| Task { key, what, seconds, points };
    let (first, all) = (COUNTS.at(one).vertices, finest.vertices);
    vec![
        task("check_seconds", "mesh checked, edges numbered", check, POINTS as u64),
        task("level_1_seconds", "the same, and level 1 indexed", once, first),
        task("level_7_indexed_seconds", "the same, and level 7 indexed, image points", indexed, all),
        task("level_7_indexed_space_seconds", "the same, and level 7 indexed, points of space", indexed_space, all),
        task("level_7_streamed_seconds", "level 7 streamed, image points summed up", streamed, all),
        task("level_7_streamed_space_seconds", "level 7 streamed, points of space summed up", streamed_space, all),
        task("level_7_streamed_weights_seconds", "level 7 streamed, weights and corners", streamed_weights, all),
    ]
}

fn checked<'a>(mesh: &'a Mesh, storage: &'a mut [u32]) -> TriangleMesh<'a> {
    TriangleMesh::new(POINTS, &mesh.triangles, storage).expect("a valid mesh")
}

/// A consumer that needs every coordinate.
fn stream(fine: Subdivision<'_>, mesh: &Mesh) -> (i64, i64) {
    let values = fine.values(&mesh.points).expect("in range");
    values.fold((0, 0), |(x, y), point| (x + i64::from(point.x), y + i64::from(point.y)))
}

/// Median over the meshes of the best of three rounds of `times` calls.
fn median(meshes: &[&Mesh], times: u32, mut task: impl FnMut(&Mesh)) -> f64 {
    let mut seconds: Vec<f64> = meshes
        .iter()
        .map(|mesh| {
            let round = |task: &mut dyn FnMut(&Mesh)| {
                let start = Instant::now();
                (0..times).for_each(|_| task(black_box(mesh)));
                start.elapsed().as_secs_f64() / f64::from(times)
            };
            (0..3).map(|_| round(&mut task)).fold(f64::INFINITY, f64::min)
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

fn table(tasks: &[Task]) {
    let finest = COUNTS.at(SubdivisionLevel::SEVEN);
    println!("{POINTS} points, {} edges, {} triangles", COUNTS.edges, COUNTS.triangles);
    println!("level 7: {} points, {} triangles", finest.vertices, finest.triangles);
    for task in tasks {
        let nanoseconds = task.seconds * 1e9;
        println!("{:48} {:12.2} us {:8.2} ns a point", task.what, nanoseconds / 1e3, nanoseconds / task.points as f64);
    }
}

fn json_object(tasks: &[Task]) {
    let fields: Vec<_> = tasks.iter().map(|task| format!("\"{}\": {:e}", task.key, task.seconds)).collect();
    println!("{{\"schema_version\": 1, {}}}", fields.join(", "));
}

fn print_mesh(mesh: &Mesh) {
    let points: Vec<_> = mesh.points.iter().map(|p| [p.x, p.y]).collect();
    println!("{{\"points\": {points:?}, \"triangles\": {:?}}}", mesh.triangles);
}
