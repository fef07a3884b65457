//! The surface between points: Delaunay in one view, what cannot be seen like that dropped, views merged.
//!
//! A pair of views gives the Delaunay triangulation (of the first view's picture) of the points that both see. A triangle
//! is dropped if it is turned over in the second view: then its corners are no surface, or one of them is a wrong match. It
//! is dropped if it is seen at a grazing angle by both (it bridges a step in depth), and if it would hide a point that
//! some view sees. Pairs join in the order given: a triangle enters where nothing lies yet.

use std::collections::{BTreeMap, BTreeSet};

use daymark_numerics::sights::{Covering, Places, Sights, area};
use nalgebra::Vector3;
use serde::Serialize;
use spade::handles::FixedVertexHandle;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::view::{Station, Surface, Vertex};
use crate::order;
use crate::parallel;

/// What was dropped, and why.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// Turned over in the other view.
    pub flipped: usize,
    /// Seen at a grazing angle by both views.
    pub grazing: usize,
    /// Would hide a point that some view sees.
    pub hiding: usize,
    /// Another pair of views has a surface there already.
    pub covered: usize,
    /// Would be the third at an edge.
    pub crossing: usize,
}

/// Triangles that both views of a pair see flatter than this are dropped: the sine of the angle between the surface and
/// the line of sight.
const GRAZING_SINE: f64 = 0.10;

struct Site {
    position: Point2<f64>,
    vertex: u32,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// The Delaunay triangulation of points, as numbers of the points; clockwise as seen with y down, that is,
/// counter-clockwise with y up.
///
/// Points that lie on one another count once (the first). Degenerate input (fewer than three points, or all on a line)
/// has no triangles.
pub fn delaunay(points: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let sites: Vec<Site> = (0..)
        .zip(points)
        .filter(|(_, [x, y])| x.is_finite() && y.is_finite() && x.abs() < 1e9 && y.abs() < 1e9)
        // Spade refuses numbers so small that their squares vanish.
        .map(|(vertex, &[x, y])| Site { position: Point2::new(tidy(x), tidy(y)), vertex })
        .collect();
    let Ok(triangulation) = DelaunayTriangulation::<Site>::bulk_load(sites) else { return Vec::new() };
    let number = |handle: FixedVertexHandle| triangulation.vertex(handle).data().vertex;
    let mut triangles: Vec<[u32; 3]> = triangulation
        .inner_faces()
        .map(|face| {
            let [a, b, c] = face.vertices().map(|vertex| number(vertex.fix()));
            // The least number first: a form of its own for each triangle.
            let first = a.min(b).min(c);
            if first == a {
                [a, b, c]
            } else if first == b {
                [b, c, a]
            } else {
                [c, a, b]
            }
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

fn tidy(value: f64) -> f64 {
    if value.abs() < 1e-6 { 0.0 } else { value }
}

/// The surface that these pairs of views give.
///
/// `stations` has one entry a view. Triangles come out counter-clockwise seen from the views that see them.
pub fn surface(
    vertices: Vec<Vertex>,
    stations: &[Option<Station>],
    pairs: &[[usize; 2]],
    spacing_px: f64,
) -> (Surface, Dropped) {
    let places = Places {
        positions: vertices.iter().map(|vertex| vertex.position).collect(),
        deviations: vertices.iter().map(|vertex| libm::sqrt(vertex.covariance.trace().max(0.0))).collect(),
    };
    let sights: Vec<Option<Sights>> = parallel::numbers(stations.len(), |view| {
        let seen = (0_u32..).zip(&vertices).filter(|(_, vertex)| vertex.track.seen_by(view).is_some());
        Some(Sights::new(&stations[view].as_ref()?.pinhole, &places, seen.map(|(number, _)| number)))
    });
    let candidates: Vec<(Vec<[u32; 3]>, Dropped)> =
        parallel::map(pairs, |&pair| pair_triangles(&vertices, &places, stations, &sights, pair, spacing_px));
    let mut dropped = Dropped::default();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    // Directed edges: each belongs to one triangle, so that the surface is one that core's mesh accepts.
    let mut edges = BTreeSet::new();
    // The same corners turned around are the same piece of surface seen from behind.
    let mut known = BTreeSet::new();
    for (&[first, _], (found, lost)) in pairs.iter().zip(candidates) {
        dropped.flipped += lost.flipped;
        dropped.grazing += lost.grazing;
        dropped.hiding += lost.hiding;
        let Some(station) = stations.get(first).and_then(Option::as_ref) else { continue };
        let covering = Covering::new(&station.pinhole, &places, &triangles);
        for triangle in found {
            let [a, b, c] = triangle;
            let around = [[a, b], [b, c], [c, a]];
            if covering.covers(triangle) {
                dropped.covered += 1;
            } else if around.iter().any(|edge| edges.contains(edge)) || known.contains(&sorted(triangle)) {
                dropped.crossing += 1;
            } else {
                edges.extend(around);
                known.insert(sorted(triangle));
                triangles.push(triangle);
            }
        }
    }
    (Surface { vertices, triangles }, dropped)
}

fn sorted(mut triangle: [u32; 3]) -> [u32; 3] {
    triangle.sort_unstable();
    triangle
}

fn pair_triangles(
    vertices: &[Vertex],
    all_places: &Places,
    stations: &[Option<Station>],
    sights: &[Option<Sights>],
    [first, second]: [usize; 2],
    spacing_px: f64,
) -> (Vec<[u32; 3]>, Dropped) {
    let mut dropped = Dropped::default();
    let (Some(Some(one)), Some(Some(other))) = (stations.get(first), stations.get(second)) else {
        return (Vec::new(), dropped);
    };
    let mut both: Vec<(u32, [f64; 2], [f64; 2])> = (0_u32..)
        .zip(vertices)
        .filter_map(|(number, vertex)| Some((number, vertex.track.seen_by(first)?, vertex.track.seen_by(second)?)))
        .collect();
    if spacing_px > 0.0 {
        both = spaced(vertices, both, spacing_px);
    }
    let shared: Vec<u32> = both.iter().map(|point| point.0).collect();
    let left: Vec<[f64; 2]> = both.iter().map(|point| point.1).collect();
    let right: Vec<[f64; 2]> = both.iter().map(|point| point.2).collect();
    let mut kept = Vec::new();
    for triangle in delaunay(&left) {
        let [a, b, c] = triangle.map(|index| index as usize);
        // Positive as spade gives it in the first view.
        if area([right[a], right[b], right[c]]) <= 0.0 {
            dropped.flipped += 1;
            continue;
        }
        let corners = triangle.map(|index| shared[index as usize]);
        let places = corners.map(|vertex| vertices[vertex as usize].position);
        if [one, other].iter().all(|station| sine_of_sight(&places, &station.pose.position) < GRAZING_SINE) {
            dropped.grazing += 1;
        } else if sights.iter().flatten().any(|sights| sights.has_hidden(all_places, corners)) {
            dropped.hiding += 1;
        } else {
            // With y down, positive is clockwise as seen: turned, it is counter-clockwise from outside.
            kept.push([corners[0], corners[2], corners[1]]);
        }
    }
    (kept, dropped)
}

/// Of points that lie close together in the first view only the best: seen by the most views, with the least error.
fn spaced(
    vertices: &[Vertex],
    mut points: Vec<(u32, [f64; 2], [f64; 2])>,
    spacing_px: f64,
) -> Vec<(u32, [f64; 2], [f64; 2])> {
    order::sort_by(&mut points, |a, b| {
        let (p, q) = (&vertices[a.0 as usize], &vertices[b.0 as usize]);
        let views = q.track.sightings.len().cmp(&p.track.sightings.len());
        views.then(p.reprojection_px.total_cmp(&q.reprojection_px)).then(a.0.cmp(&b.0))
    });
    let cell = |at: [f64; 2]| at.map(|c| libm::floor(c / spacing_px) as i64);
    let mut kept: BTreeMap<[i64; 2], Vec<[f64; 2]>> = BTreeMap::new();
    points.retain(|&(_, at, _)| {
        let [x, y] = cell(at);
        let near = |other: &[f64; 2]| {
            let (dx, dy) = (other[0] - at[0], other[1] - at[1]);
            dx * dx + dy * dy < spacing_px * spacing_px
        };
        let around = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| [x, y]));
        if around.filter_map(|cell| kept.get(&cell)).flatten().any(near) {
            return false;
        }
        kept.entry([x, y]).or_default().push(at);
        true
    });
    order::sort_by_key(&mut points, |point| point.0);
    points
}

/// Sine of the angle between a triangle's plane and the line of sight to its middle.
fn sine_of_sight(places: &[Vector3<f64>; 3], eye: &Vector3<f64>) -> f64 {
    let normal = (places[1] - places[0]).cross(&(places[2] - places[0]));
    let sight = (places[0] + places[1] + places[2]) / 3.0 - eye;
    let length = normal.norm() * sight.norm();
    if length > 0.0 { normal.dot(&sight).abs() / length } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_its_middle_has_four_triangles() {
        let points = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [5.0, 5.0]];
        let triangles = delaunay(&points);
        assert_eq!(triangles.len(), 4);
        for triangle in triangles {
            assert!(triangle.contains(&4));
            assert!(area(triangle.map(|index| points[index as usize])) > 0.0);
        }
    }

    #[test]
    fn what_has_no_triangles_gives_none() {
        assert!(delaunay(&[]).is_empty());
        assert!(delaunay(&[[0.0, 0.0], [1.0, 1.0]]).is_empty());
        assert!(delaunay(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [1.0, 1.0]]).is_empty());
        assert!(delaunay(&[[f64::NAN, 0.0], [1.0, 1.0], [2.0, 0.0]]).is_empty());
    }
}
