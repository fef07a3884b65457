//! What a view sees of a surface: points that a triangle would hide, and places that are covered already.

use daymark_core::camera::triangulate::Pinhole;
use nalgebra::Vector3;

use crate::cells::{Cells, bounds};

/// A point is hidden if a triangle stands before it by more than this share of its distance, and more than three standard
/// deviations.
const HIDING_SHARE: f64 = 0.004;
/// Rounding of images, pixels.
const MARGIN: f64 = 1e-3;

/// The points of a model and a bound of how far each is from where it seems to be.
#[derive(Debug, Clone, Default)]
pub struct Places {
    /// Where they are.
    pub positions: Vec<Vector3<f64>>,
    /// Roots of the traces of their covariances.
    pub deviations: Vec<f64>,
}

/// Twice the signed area; positive from +x towards +y.
#[inline]
pub fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// What one view sees: its points' images by cells, so that a triangle is compared with what it may hide only.
#[derive(Debug)]
pub struct Sights {
    pinhole: Pinhole,
    /// The image of each point that the view sees.
    images: Vec<[f64; 2]>,
    cells: Cells,
}

impl Sights {
    /// A view that sees the points with these numbers.
    pub fn new(pinhole: &Pinhole, places: &Places, seen: impl Iterator<Item = u32>) -> Self {
        let mut images = vec![[f64::NAN; 2]; places.positions.len()];
        let entries: Vec<(u32, [[f64; 2]; 2])> = seen
            .filter_map(|number| {
                let at = pinhole.project((*places.positions.get(number as usize)?).into())?;
                images[number as usize] = at;
                Some((number, [at, at]))
            })
            .collect();
        Self { pinhole: *pinhole, images, cells: Cells::new(&entries) }
    }

    /// Whether the view sees a point through this triangle.
    pub fn has_hidden(&self, places: &Places, corners: [u32; 3]) -> bool {
        let [a, b, c] = corners.map(|corner| places.positions[corner as usize]);
        let eye = Vector3::from(self.pinhole.centre());
        let normal = (b - a).cross(&(c - a));
        let hides = |number: u32| {
            if corners.contains(&number) {
                return false;
            }
            let sight = places.positions[number as usize] - eye;
            let slope = normal.dot(&sight);
            if slope == 0.0 {
                return false;
            }
            let way = normal.dot(&(a - eye)) / slope;
            let length = sight.norm();
            let deviation = places.deviations[number as usize];
            if !(way > 0.0 && (1.0 - way) * length > (HIDING_SHARE * length).max(3.0 * deviation)) {
                return false;
            }
            let met = eye + sight * way;
            // Well inside: away from the edges by a hundredth of the triangle.
            barycentric(&[a, b, c], &normal, &met).iter().all(|&weight| weight > 0.01)
        };
        match [a, b, c].map(|place| self.pinhole.project(place.into())) {
            // In front of the camera the image of a triangle is a triangle: only what lies in it can be hidden by it.
            [Some(p), Some(q), Some(r)] => {
                let rectangle = bounds([p, q, r]);
                let [low, high] = rectangle;
                let inside = |number: u32| {
                    let [x, y] = self.images[number as usize];
                    (x > low[0] - MARGIN) & (x < high[0] + MARGIN) & (y > low[1] - MARGIN) & (y < high[1] + MARGIN)
                };
                self.cells
                    .within(rectangle)
                    .any(|numbers| numbers.iter().any(|&number| inside(number) && hides(number)))
            }
            _ => self.cells.all().iter().any(|&number| hides(number)),
        }
    }
}

fn barycentric(places: &[Vector3<f64>; 3], normal: &Vector3<f64>, at: &Vector3<f64>) -> [f64; 3] {
    let squared = normal.norm_squared();
    let part = |a: usize, b: usize| (places[b] - places[a]).cross(&(at - places[a])).dot(normal) / squared;
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// What lies in one view's picture already.
#[derive(Debug)]
pub struct Covering {
    /// Pixels and depth of each point that lies in front.
    images: Vec<Option<[f64; 3]>>,
    /// Triangles that face the view.
    facing: Vec<[[f64; 3]; 3]>,
    cells: Cells,
}

impl Covering {
    /// These triangles as a view sees them.
    pub fn new(pinhole: &Pinhole, places: &Places, triangles: &[[u32; 3]]) -> Self {
        let image = |position: &Vector3<f64>| {
            let [x, y] = pinhole.project((*position).into())?;
            Some([x, y, pinhole.depth((*position).into())])
        };
        let images: Vec<Option<[f64; 3]>> = places.positions.iter().map(image).collect();
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
    pub fn covers(&self, triangle: [u32; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = triangle.map(|vertex| self.images[vertex as usize]) else { return true };
        // In perspective depth is linear in its inverse.
        let middle = [0, 1].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
        let depth = 3.0 / (1.0 / a[2] + 1.0 / b[2] + 1.0 / c[2]);
        let covered = |&number: &u32| {
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
        };
        self.cells.within([middle; 2]).any(|numbers| numbers.iter().any(covered))
    }
}
