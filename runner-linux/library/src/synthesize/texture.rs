//! Which view shows each triangle best, and the intensities that it gives.

use daymark_numerics::depth::DepthBuffer;
use daymark_numerics::sights::area;

use super::view::{Station, Surface, View};
use crate::parallel;

/// Longer side of the buffer in which occlusion is tested, in pixels.
const BUFFER_SIDE: f64 = 480.0;
/// A point is hidden if something lies before it by more than this share of its depth.
const BEHIND: f64 = 0.015;
/// Where a triangle is tested: barycentric coordinates.
const PROBES: [[f64; 3]; 7] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.8, 0.1, 0.1],
    [0.1, 0.8, 0.1],
    [0.1, 0.1, 0.8],
    [0.45, 0.45, 0.1],
    [0.1, 0.45, 0.45],
    [0.45, 0.1, 0.45],
];

/// For each triangle the view that shows it with the most pixels among those in which nothing stands before it.
///
/// A triangle that no view shows whole takes the largest of the views that see its three corners; `None` if none does.
pub fn best_views(surface: &Surface, views: &[View], stations: &[Option<Station>]) -> Vec<Option<u32>> {
    let positions: Vec<[f64; 3]> = surface.vertices.iter().map(|vertex| vertex.position.into()).collect();
    let shown: Vec<(&View, &Option<Station>)> = views.iter().zip(stations).collect();
    let scores = parallel::numbers(shown.len(), |number| {
        let (view, Some(station)) = shown[number] else { return vec![[0.0; 2]; surface.triangles.len()] };
        let longer = view.gray.width.max(view.gray.height).max(1) as f64;
        let scale = (BUFFER_SIDE / longer).min(1.0);
        let size = [view.gray.width, view.gray.height].map(|side| ((side as f64 * scale) as usize).max(1));
        let buffer = DepthBuffer::new(&station.pinhole, size, scale, &positions, &surface.triangles);
        let score = |triangle: &[u32; 3]| score(surface, view, station, number, &buffer, scale, *triangle);
        surface.triangles.iter().map(score).collect::<Vec<[f64; 2]>>()
    });
    (0..surface.triangles.len())
        .map(|triangle| {
            let best = |kind: usize| {
                (0_u32..).zip(&scores).fold((None, 0.0), |best: (Option<u32>, f64), (view, scores)| {
                    if scores[triangle][kind] > best.1 { (Some(view), scores[triangle][kind]) } else { best }
                })
            };
            best(0).0.or(best(1).0)
        })
        .collect()
}

/// Pixels of a triangle in a view: if it is seen whole, and if the view sees its three corners.
fn score(
    surface: &Surface,
    view: &View,
    station: &Station,
    number: usize,
    buffer: &DepthBuffer,
    scale: f64,
    triangle: [u32; 3],
) -> [f64; 2] {
    let corners = triangle.map(|vertex| &surface.vertices[vertex as usize]);
    let images = corners.map(|vertex| station.pinhole.project(vertex.position.into()));
    let [Some(a), Some(b), Some(c)] = images else { return [0.0; 2] };
    // Counter-clockwise from outside is negative with y down.
    let pixels = -0.5 * area([a, b, c]);
    if !(pixels > 0.0) {
        return [0.0; 2];
    }
    let matched = corners.iter().all(|vertex| vertex.track.seen_by(number).is_some());
    let inside = [a, b, c].iter().all(|&corner| view.lens.holds(view.lens.picture_from_ideal(corner)));
    let shown = |weights: &[f64; 3]| {
        let at = corners[0].position * weights[0] + corners[1].position * weights[1] + corners[2].position * weights[2];
        let Some([x, y]) = station.pinhole.project(at.into()) else { return false };
        let before = f64::from(buffer.depth_at((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5));
        before >= station.pinhole.depth(at.into()) * (1.0 - BEHIND)
    };
    let whole = inside && PROBES.iter().filter(|weights| shown(weights)).count() >= PROBES.len() - 1;
    [if whole { pixels } else { 0.0 }, if matched && inside { pixels } else { 0.0 }]
}
