//! Bit for bit: committed frames in, the bytes of every stage out, the same in debug, release and native builds.
//!
//! The files lie in `fixtures/golden`, written as postcard. One command makes them anew, and its diff is to be read:
//!
//! ```text
//! DAYMARK_WRITE_GOLDENS=1 cargo test -p daymark-core --test golden
//! ```

#[path = "support/frames.rs"]
mod frames;

use std::env;
use std::fmt::Debug;
use std::fs;
use std::path::Path;

use daymark_core::geometry::arrangement::{Arrangement, scratch_length};
use daymark_core::geometry::correspond::{Correspond, Explanation, Settings};
use daymark_core::geometry::quad::Quad;
use daymark_core::geometry::shift::{LayerQuad, quads_of};
use daymark_core::geometry::{HullLayers, Remainder};
use daymark_core::mesh::{SubdivisionLevel, TriangleMesh, storage_words};
use daymark_core::point::ImagePoint;
use daymark_core::verdict::Verdict;
use frames::{FRAME, read, recognize, stored, table, tower};
use serde::Serialize;
use serde::de::DeserializeOwned;

const TOWERS: std::ops::RangeInclusive<u32> = 1..=8;
const PARTS: [&str; 2] = ["left", "right"];
/// Strongest corners of a frame whose layers are nested.
const NESTED: usize = 60;
type Layers = HullLayers<NESTED, 20>;

/// Compares with the golden file, count first, then value by value; or writes it.
fn check<T: Serialize + DeserializeOwned + PartialEq + Debug>(name: &str, values: &[T]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/golden").join(format!("{name}.postcard"));
    let bytes = postcard::to_stdvec(values).expect("values that postcard can write");
    if env::var_os("DAYMARK_WRITE_GOLDENS").is_some() {
        fs::write(&path, &bytes).unwrap();
        return;
    }
    let golden = fs::read(&path).expect("a committed golden file");
    let (expected, rest): (Vec<T>, _) = postcard::take_from_bytes(&golden).expect("a sound golden file");
    assert!(rest.is_empty(), "{name}: {} bytes too many", rest.len());
    assert_eq!(values.len(), expected.len(), "{name}: how many");
    for (number, (value, expected)) in values.iter().zip(&expected).enumerate() {
        assert_eq!(value, expected, "{name}: entry {number}");
    }
    assert!(bytes == golden, "{name}: the same values, but other bytes");
}

fn each_frame() -> impl Iterator<Item = (u32, &'static str)> {
    TOWERS.flat_map(|number| PARTS.map(|part| (number, part)))
}

/// The places of a frame's corners, strongest first.
fn corners(number: u32, part: &str) -> Vec<ImagePoint> {
    read(&tower(number, part), FRAME).view().iter().map(|feature| feature.position).collect()
}

fn nest(points: &[ImagePoint]) -> Box<Layers> {
    let mut layers = Box::new(Layers::new());
    layers.peel(points).expect("few points in a frame");
    layers
}

#[test]
fn corners_and_signatures() {
    let features = each_frame().flat_map(|(number, part)| {
        let features = read(&tower(number, part), FRAME);
        let columns = features.view();
        let rows = columns.iter().map(|feature| {
            (number, feature.position.x, feature.position.y, feature.level, feature.signature.to_bytes())
        });
        rows.collect::<Vec<_>>()
    });
    check("corners", &features.collect::<Vec<(u32, i32, i32, u8, [u8; 16])>>());
}

#[test]
fn layers() {
    let layers = each_frame().map(|(number, part)| {
        let points = &corners(number, part)[..NESTED];
        let layers = nest(points);
        let remainder = match layers.remainder() {
            Remainder::None => Vec::new(),
            Remainder::Point(point) => vec![point],
            Remainder::Line(points) => points.to_vec(),
        };
        (layers.layers().map(<[u16]>::to_vec).collect::<Vec<_>>(), remainder, layers.duplicates().to_vec())
    });
    check("layers", &layers.collect::<Vec<_>>());
}

#[test]
fn invariants() {
    let ratios = each_frame().flat_map(|(number, part)| {
        let points = corners(number, part);
        let points = &points[..NESTED];
        let layers = nest(points);
        let mut ratios = Vec::new();
        for layer in layers.layers().filter(|layer| layer.len() >= 4) {
            for start in 0..layer.len() {
                let quad = Quad::new([0, 1, 2, 3].map(|step| points[usize::from(layer[(start + step) % layer.len()])]));
                let (i, j) = (quad.ratio(), quad.second_ratio());
                ratios.push((i.upper, i.lower, j.upper, j.lower, quad.ratio_uncertainty(0.5).to_bits()));
            }
        }
        ratios
    });
    check("invariants", &ratios.collect::<Vec<(i64, i64, i64, i64, u64)>>());
}

/// The picked corners of a committed list.
fn picked(angle: u32) -> Vec<ImagePoint> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../fixtures/files/tower-1-corners-{angle}.csv"));
    let text = fs::read_to_string(path).expect("a committed list");
    let rows = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit()));
    let sixteenths = |field: &str| libm::round(field.parse::<f64>().expect("a number") * 16.0) as i32;
    rows.map(|row| {
        let fields: Vec<&str> = row.split(',').collect();
        ImagePoint::new(sixteenths(fields[1]), sixteenths(fields[2]))
    })
    .collect()
}

#[test]
fn correspondences() {
    let (first, second) = (picked(30), picked(40));
    let turned: Vec<ImagePoint> = first.iter().map(|p| ImagePoint::new(2 * p.x - p.y, p.x + p.y)).collect();
    let mut workspace = Box::new(const { Correspond::<64, 21, 256, 1_280>::new() });
    let mut scratch = vec![Arrangement::default(); scratch_length(64)];
    let mut quads = vec![LayerQuad::default(); quads_of(64)];
    let mut found = Vec::new();
    for other in [&second, &turned] {
        let answer = workspace.correspond(&first, other, Settings::of_picture(640, 480), &mut scratch, &mut quads);
        let map = match answer.expect("few points in a frame").expect("views of one tower") {
            Explanation::Map(best) => best.second_from_first.0.as_flattened().iter().map(|x| x.to_bits()).collect(),
            Explanation::Relief { median, .. } => vec![(median * 65_536.0) as u32],
        };
        let pairs = workspace.found().iter();
        let pairs = pairs.map(|found| (found.pair.first, found.pair.second, found.residual.to_bits()));
        found.push((map, pairs.collect::<Vec<_>>()));
    }
    check("correspondences", &found);
}

#[test]
fn subdivided_points() {
    let points = corners(1, "left");
    let layers = nest(&points[..NESTED]);
    let hull = layers.layer(0);
    let fan: Vec<[u16; 3]> = hull.windows(2).skip(1).map(|pair| [hull[0], pair[0], pair[1]]).collect();
    let mut storage = vec![0; storage_words(NESTED, fan.len())];
    let mesh = TriangleMesh::new(NESTED, &fan, &mut storage).expect("a fan is a mesh");
    let level = SubdivisionLevel::new(3).expect("a level");
    let fine = mesh.subdivided(level);
    let values = fine.values(&points[..NESTED]).expect("a value for each vertex");
    check("subdivided", &values.map(|point| (point.x, point.y)).collect::<Vec<_>>());
}

#[test]
fn verdicts() {
    let views: Vec<_> = TOWERS.map(|number| stored(&tower(number, "left"))).collect();
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let slots: Vec<[&frames::Frame; 1]> = views.iter().map(|view| [view]).collect();
    let entries: Vec<(&str, &[&frames::Frame])> =
        names.into_iter().zip(slots.iter().map(<[&frames::Frame; 1]>::as_slice)).collect();
    let table = table(&entries);
    let verdicts = each_frame().map(|(number, part)| {
        let recognition = recognize(&table, &read(&tower(number, part), FRAME));
        let known = match recognition.verdict {
            Verdict::Known(answer) => Some(answer.landmark),
            _ => None,
        };
        let best = recognition.best.map(|answer| {
            let map = answer.matched.frame_from_view.0.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            (answer.landmark, answer.matched.evidence, answer.false_answer.surprise(), map)
        });
        (known, best, recognition.runner_up.map(|answer| (answer.landmark, answer.matched.evidence)))
    });
    check("verdicts", &verdicts.collect::<Vec<_>>());
    // The table's own bytes, too.
    check("table", &table);
}
