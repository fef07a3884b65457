//! Hulls and nested hulls of many different point sets: daymark beside other programs, in turns. Then correspondences of
//! two views.
//!
//!     cargo run --release [-- hull | layers | correspond]

mod correspond;
mod measure;
mod ours;
mod peers;
mod sets;

use measure::{Program, compare};
use sets::{Sets, Source};

fn main() {
    let only = std::env::args().nth(1);
    if only.as_deref() == Some("correspond") {
        return correspond::measure();
    }
    println!(
        "{:<10} {:<8} {:>6} {:>6}  {:<28} {:>10} {:>7}",
        "task", "points", "count", "sets", "program", "us a set", "ratio"
    );
    let mut agreed = true;
    for (source, sizes) in [
        (Source::Frame, [47, 200, 1_000, 10_000].as_slice()),
        (Source::Square, &[47, 200, 1_000, 10_000]),
        (Source::Corners, &[47, 200]),
        (Source::Windows, &[47, 200, 1_000, 10_000]),
    ] {
        for &size in sizes {
            let sets = Sets::new(source, size);
            let tasks: [(&str, Vec<Box<dyn Program>>); 2] = [
                (
                    "hull",
                    vec![
                        ours::hull(size),
                        Box::new(peers::ChainHull::default()),
                        Box::new(peers::Geo::quick_hull(false)),
                        Box::new(peers::Geo::graham_hull(false)),
                    ],
                ),
                (
                    "layers",
                    vec![
                        ours::layers(size),
                        Box::new(peers::ChainLayers::default()),
                        Box::new(peers::Geo::quick_hull(true)),
                    ],
                ),
            ];
            for (task, mut programs) in tasks {
                if only.as_deref().is_none_or(|only| only == task) {
                    agreed &= compare(task, &sets, &mut programs);
                }
            }
        }
    }
    if !agreed {
        eprintln!("programs disagree: see above");
        std::process::exit(1);
    }
    if only.is_none() {
        correspond::measure();
    }
}
