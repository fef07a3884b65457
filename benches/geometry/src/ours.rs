//! daymark's own, sized for the task.

use daymark_core::geometry::{ConvexHull, Hull, HullLayers};
use daymark_core::point::ImagePoint;

use crate::measure::{Found, Program};

struct OurHull<const POINTS: usize> {
    sets: Vec<Vec<ImagePoint>>,
    hull: Box<ConvexHull<POINTS>>,
}

impl<const POINTS: usize> Program for OurHull<POINTS> {
    fn name(&self) -> String {
        "daymark ConvexHull".into()
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn prepare(&mut self, sets: &[Vec<ImagePoint>]) {
        self.sets = sets.to_vec();
    }

    fn run(&mut self, number: usize) -> Found {
        let vertices = match self.hull.enclose(&self.sets[number]) {
            Ok(Hull::Polygon(vertices)) => vertices.len(),
            _ => 0,
        };
        Found { layers: 1, vertices }
    }
}

struct OurLayers<const POINTS: usize, const LAYERS: usize> {
    sets: Vec<Vec<ImagePoint>>,
    layers: Box<HullLayers<POINTS, LAYERS>>,
}

impl<const POINTS: usize, const LAYERS: usize> Program for OurLayers<POINTS, LAYERS> {
    fn name(&self) -> String {
        "daymark HullLayers".into()
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn prepare(&mut self, sets: &[Vec<ImagePoint>]) {
        self.sets = sets.to_vec();
    }

    fn run(&mut self, number: usize) -> Found {
        self.layers.peel(&self.sets[number]).expect("room for all");
        Found { layers: self.layers.len(), vertices: self.layers.layers().map(<[u16]>::len).sum() }
    }
}

fn hull_of<const POINTS: usize>() -> Box<dyn Program> {
    Box::new(OurHull::<POINTS> { sets: Vec::new(), hull: Box::new(ConvexHull::new()) })
}

fn layers_of<const POINTS: usize, const LAYERS: usize>() -> Box<dyn Program> {
    Box::new(OurLayers::<POINTS, LAYERS> { sets: Vec::new(), layers: Box::new(HullLayers::new()) })
}

/// The convex hull with the storage for `size` points.
pub fn hull(size: usize) -> Box<dyn Program> {
    match size {
        ..=47 => hull_of::<47>(),
        ..=200 => hull_of::<200>(),
        ..=1_000 => hull_of::<1_000>(),
        _ => hull_of::<10_000>(),
    }
}

/// Nested hulls with the storage for `size` points.
pub fn layers(size: usize) -> Box<dyn Program> {
    match size {
        ..=47 => layers_of::<47, 15>(),
        ..=200 => layers_of::<200, 66>(),
        ..=1_000 => layers_of::<1_000, 333>(),
        _ => layers_of::<10_000, 3_333>(),
    }
}
