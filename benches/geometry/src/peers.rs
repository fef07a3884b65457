//! What a reader would otherwise take: monotone chains by hand, and the `geo` crate.

use daymark_core::point::ImagePoint;
use geo::Coord;
use geo::algorithm::convex_hull::{graham_hull, quick_hull};

use crate::measure::{Found, Program};

/// A point and its number.
type Numbered = (i32, i32, u32);

fn twice_area(a: Numbered, b: Numbered, c: Numbered) -> i64 {
    let d = |to: i32, from: i32| i64::from(to - from);
    d(b.0, a.0) * d(c.1, a.1) - d(b.1, a.1) * d(c.0, a.0)
}

/// Andrew's monotone chain over sorted, distinct points, as the textbooks have it.
fn chain(points: &[Numbered], hull: &mut Vec<Numbered>) {
    hull.clear();
    for &point in points {
        while hull.len() >= 2 && twice_area(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0 {
            hull.pop();
        }
        hull.push(point);
    }
    let upper = hull.len() + 1;
    for &point in points.iter().rev().skip(1) {
        while hull.len() >= upper && twice_area(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0 {
            hull.pop();
        }
        hull.push(point);
    }
    hull.pop();
}

fn sort(points: &[ImagePoint], sorted: &mut Vec<Numbered>) {
    sorted.clear();
    sorted.extend(points.iter().zip(0..).map(|(p, number)| (p.x, p.y, number)));
    sorted.sort_unstable();
    sorted.dedup_by_key(|p| (p.0, p.1));
}

/// Sort, then two chains.
#[derive(Default)]
pub struct ChainHull {
    sets: Vec<Vec<ImagePoint>>,
    sorted: Vec<Numbered>,
    hull: Vec<Numbered>,
}

impl Program for ChainHull {
    fn name(&self) -> String {
        "monotone chain".into()
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn prepare(&mut self, sets: &[Vec<ImagePoint>]) {
        self.sets = sets.to_vec();
    }

    fn run(&mut self, number: usize) -> Found {
        sort(&self.sets[number], &mut self.sorted);
        chain(&self.sorted, &mut self.hull);
        Found { layers: 1, vertices: self.hull.len() }
    }
}

/// Sort once, then two chains for each layer over the points that are left.
#[derive(Default)]
pub struct ChainLayers {
    sets: Vec<Vec<ImagePoint>>,
    sorted: Vec<Numbered>,
    hull: Vec<Numbered>,
    layer_of: Vec<u32>,
}

impl Program for ChainLayers {
    fn name(&self) -> String {
        "monotone chains, sorted once".into()
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn prepare(&mut self, sets: &[Vec<ImagePoint>]) {
        self.sets = sets.to_vec();
    }

    fn run(&mut self, number: usize) -> Found {
        sort(&self.sets[number], &mut self.sorted);
        self.layer_of.clear();
        self.layer_of.resize(self.sets[number].len(), u32::MAX);
        let mut found = Found::default();
        while self.sorted.len() >= 3 {
            chain(&self.sorted, &mut self.hull);
            if self.hull.len() < 3 {
                break;
            }
            for vertex in &self.hull {
                self.layer_of[vertex.2 as usize] = found.layers as u32;
            }
            found += Found { layers: 1, vertices: self.hull.len() };
            let layer_of = &self.layer_of;
            self.sorted.retain(|point| layer_of[point.2 as usize] == u32::MAX);
        }
        found
    }
}

type GeoHull = fn(&mut [Coord<f64>]) -> Vec<Coord<f64>>;

/// `geo`, on its usual type of coordinates; for layers again and again on what is left.
pub struct Geo {
    name: &'static str,
    hull: GeoHull,
    layers: bool,
    sets: Vec<Vec<Coord<f64>>>,
    left: Vec<Coord<f64>>,
}

impl Geo {
    fn new(name: &'static str, hull: GeoHull, layers: bool) -> Self {
        Self { name, hull, layers, sets: Vec::new(), left: Vec::new() }
    }

    /// What `geo`'s trait `ConvexHull` does.
    pub fn quick_hull(layers: bool) -> Self {
        Self::new("geo quick_hull", |points| quick_hull(points).0, layers)
    }

    pub fn graham_hull(layers: bool) -> Self {
        Self::new("geo graham_hull", |points| graham_hull(points, false).0, layers)
    }
}

impl Program for Geo {
    fn name(&self) -> String {
        self.name.into()
    }

    /// It may keep vertices on a line with their neighbours.
    fn is_exact(&self) -> bool {
        false
    }

    fn prepare(&mut self, sets: &[Vec<ImagePoint>]) {
        let coordinates = |p: &ImagePoint| Coord { x: f64::from(p.x), y: f64::from(p.y) };
        self.sets = sets.iter().map(|set| set.iter().map(coordinates).collect()).collect();
    }

    fn run(&mut self, number: usize) -> Found {
        self.left.clear();
        self.left.extend_from_slice(&self.sets[number]);
        if !self.layers {
            return Found { layers: 1, vertices: (self.hull)(&mut self.left).len() - 1 };
        }
        let mut found = Found::default();
        while self.left.len() >= 3 {
            let mut hull = (self.hull)(&mut self.left);
            hull.pop();
            if hull.len() < 3 {
                break;
            }
            found += Found { layers: 1, vertices: hull.len() };
            let order = |a: &Coord<f64>, b: &Coord<f64>| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
            hull.sort_unstable_by(order);
            self.left.retain(|point| hull.binary_search_by(|vertex| order(vertex, point)).is_err());
        }
        found
    }
}
