//! The surface between points: Delaunay in one view, what cannot be seen like that dropped, views merged.
//!
//! A pair of views gives the Delaunay triangulation (of the first view's picture) of the points that both see. A triangle
//! is dropped if it is turned over in the second view: then its corners are no surface, or one of them is a wrong match. It
//! is dropped if it is seen at a grazing angle by both (it bridges a step in depth), and if it would hide a point that
//! some view sees. Pairs join in the order given: a triangle enters where nothing lies yet.

use std::collections::{BTreeMap, BTreeSet};

use daymark_numerics::cells::{Cells, bounds};
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
/// A point is hidden if a triangle stands before it by more than this share of its distance, and more than three standard
/// deviations.
const HIDING_SHARE: f64 = 0.004;

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
    let sights: Vec<Option<Sights>> =
        parallel::numbers(stations.len(), |view| Some(Sights::new(view, stations[view].as_ref()?, &vertices)));
    let candidates: Vec<(Vec<[u32; 3]>, Dropped)> =
        parallel::map(pairs, |&pair| pair_triangles(&vertices, stations, &sights, pair, spacing_px));
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
        let covering = Covering::new(&vertices, &triangles, station);
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
        } else if sights.iter().flatten().any(|sights| sights.has_hidden(vertices, corners, &places)) {
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

/// Twice the signed area; positive from +x towards +y.
pub(super) fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Sine of the angle between a triangle's plane and the line of sight to its middle.
fn sine_of_sight(places: &[Vector3<f64>; 3], eye: &Vector3<f64>) -> f64 {
    let normal = (places[1] - places[0]).cross(&(places[2] - places[0]));
    let sight = (places[0] + places[1] + places[2]) / 3.0 - eye;
    let length = normal.norm() * sight.norm();
    if length > 0.0 { normal.dot(&sight).abs() / length } else { 0.0 }
}

/// What one view sees: its points' images by cells, so that a triangle is compared with what it may hide only.
struct Sights {
    station: Station,
    cells: Cells,
    /// For each vertex a bound of how far it is from where it seems to be.
    deviations: Vec<f64>,
}

impl Sights {
    fn new(view: usize, station: &Station, vertices: &[Vertex]) -> Self {
        let images: Vec<(u32, [[f64; 2]; 2])> = (0_u32..)
            .zip(vertices)
            .filter(|(_, vertex)| vertex.track.seen_by(view).is_some())
            .filter_map(|(number, vertex)| {
                let at = station.pinhole.project(vertex.position.into())?;
                Some((number, [at, at]))
            })
            .collect();
        let deviations = vertices.iter().map(|vertex| libm::sqrt(vertex.covariance.trace().max(0.0))).collect();
        Self { station: *station, cells: Cells::new(&images), deviations }
    }

    /// Whether the view sees a point through this triangle.
    fn has_hidden(&self, vertices: &[Vertex], corners: [u32; 3], places: &[Vector3<f64>; 3]) -> bool {
        let eye = self.station.pose.position;
        let normal = (places[1] - places[0]).cross(&(places[2] - places[0]));
        let hides = |number: u32| {
            if corners.contains(&number) {
                return false;
            }
            let (vertex, deviation) = (&vertices[number as usize], self.deviations[number as usize]);
            let sight = vertex.position - eye;
            let slope = normal.dot(&sight);
            if slope == 0.0 {
                return false;
            }
            let way = normal.dot(&(places[0] - eye)) / slope;
            let length = sight.norm();
            if !(way > 0.0 && (1.0 - way) * length > (HIDING_SHARE * length).max(3.0 * deviation)) {
                return false;
            }
            let met = eye + sight * way;
            // Well inside: away from the edges by a hundredth of the triangle.
            barycentric(places, &normal, &met).iter().all(|&weight| weight > 0.01)
        };
        let images = places.map(|place| self.station.pinhole.project(place.into()));
        match images {
            // In front of the camera the image of a triangle is a triangle: only what lies in it can be hidden by it.
            [Some(a), Some(b), Some(c)] => self.cells.within(bounds([a, b, c])).any(hides),
            _ => self.cells.all().any(hides),
        }
    }
}

fn barycentric(places: &[Vector3<f64>; 3], normal: &Vector3<f64>, at: &Vector3<f64>) -> [f64; 3] {
    let squared = normal.norm_squared();
    let part = |a: usize, b: usize| (places[b] - places[a]).cross(&(at - places[a])).dot(normal) / squared;
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// What lies in one view's picture already.
struct Covering {
    /// Pixels and depth of each vertex that lies in front.
    images: Vec<Option<[f64; 3]>>,
    /// Triangles that face the view.
    facing: Vec<[[f64; 3]; 3]>,
    cells: Cells,
}

impl Covering {
    fn new(vertices: &[Vertex], triangles: &[[u32; 3]], station: &Station) -> Self {
        let images: Vec<Option<[f64; 3]>> = vertices.iter().map(|vertex| image(vertex, station)).collect();
        let facing: Vec<[[f64; 3]; 3]> = triangles
            .iter()
            .filter_map(|triangle| {
                let corners = triangle.map(|vertex| images[vertex as usize]);
                let [Some(a), Some(b), Some(c)] = corners else { return None };
                // Counter-clockwise from outside is negative with y down.
                let facing = area([[a[0], a[1]], [b[0], b[1]], [c[0], c[1]]]) < 0.0;
                facing.then_some([a, b, c])
            })
            .collect();
        let rectangles: Vec<_> =
            (0..).zip(&facing).map(|(number, corners)| (number, bounds(corners.map(|[x, y, _]| [x, y])))).collect();
        Self { images, cells: Cells::new(&rectangles), facing }
    }

    /// Whether a triangle's middle lies on another one at about the same depth, or behind one.
    fn covers(&self, triangle: [u32; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = triangle.map(|vertex| self.images[vertex as usize]) else { return true };
        // In perspective depth is linear in its inverse.
        let middle = [0, 1].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
        let depth = 3.0 / (1.0 / a[2] + 1.0 / b[2] + 1.0 / c[2]);
        self.cells.within([middle; 2]).any(|number| {
            let [p, q, r] = &self.facing[number as usize];
            let whole = area([[p[0], p[1]], [q[0], q[1]], [r[0], r[1]]]);
            let weight = |s: &[f64; 3], t: &[f64; 3]| area([[s[0], s[1]], [t[0], t[1]], middle]) / whole;
            let (u, v, w) = (weight(q, r), weight(r, p), weight(p, q));
            // A shared edge is no cover.
            if u < 1e-6 || v < 1e-6 || w < 1e-6 {
                return false;
            }
            let there = 1.0 / (u / p[2] + v / q[2] + w / r[2]);
            there < depth * 1.03
        })
    }
}

fn image(vertex: &Vertex, station: &Station) -> Option<[f64; 3]> {
    let position: [f64; 3] = vertex.position.into();
    let [x, y] = station.pinhole.project(position)?;
    Some([x, y, station.pinhole.depth(position)])
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
