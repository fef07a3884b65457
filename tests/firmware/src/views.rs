//! Geometry of views on a device: a mesh and its subdivision, maps of every family, weak perspective. The numbers come from
//! the frame, whatever they mean.

use core::hint::black_box;

use daymark_core::camera::weak_perspective::{Extent, WeakPerspective};
use daymark_core::family::{Affine, Correspondence, Family, Invariant, Perspective, Rigid, Similarity};
use daymark_core::mesh::{FinePoint, MeshError, SubdivisionLevel, TriangleMesh, storage_words};
use daymark_core::point::ImagePoint;

use crate::device::Device;

/// Vertices of the meshes.
const VERTICES: usize = 12;
/// Triangles of the meshes.
const TRIANGLES: usize = 10;

/// Whether a strip of triangles is subdivided as it should be, and chance is no mesh.
#[inline(never)]
pub fn check(device: &mut Device) -> bool {
    let (pixels, _) = device.frame();
    let mut points = [ImagePoint::default(); VERTICES];
    for (number, (point, at)) in points.iter_mut().zip(pixels.chunks_exact(64)).enumerate() {
        let by = |byte: Option<&u8>| i32::from(byte.copied().unwrap_or(0));
        *point = ImagePoint::new(320 * number as i32 + by(at.first()), 1_280 * (number as i32 % 2) + by(at.get(9)));
    }
    let mut by_chance = [[0; 3]; TRIANGLES];
    for (triangle, at) in by_chance.iter_mut().zip(pixels.as_chunks::<24>().0) {
        let [a, .., b, _, _, _, _, _, _, _, c] = *at;
        *triangle = [a, b, c].map(|byte| u16::from(byte % VERTICES as u8));
    }
    maps(&points);
    let mut strip = [[0; 3]; TRIANGLES];
    for (number, triangle) in (0..).zip(&mut strip) {
        *triangle = if number % 2 == 0 { [number, number + 1, number + 2] } else { [number + 1, number, number + 2] };
    }
    let level = SubdivisionLevel::new(black_box(2)).unwrap_or_default();
    subdivide(&points, black_box(&strip), level).is_ok() && subdivide(&points, black_box(&by_chance), level).is_err()
}

fn subdivide(points: &[ImagePoint], triangles: &[[u16; 3]], level: SubdivisionLevel) -> Result<(), MeshError> {
    let mut storage = [0; storage_words(VERTICES, TRIANGLES)];
    let mesh = TriangleMesh::new(points.len(), triangles, &mut storage)?;
    mesh.check_areas(points)?;
    let fine = mesh.subdivided(level);
    let mut written = [FinePoint::default(); 128];
    black_box(fine.write_values(points, &mut written)?);
    let mut children = [[0; 3]; 256];
    black_box(fine.write_triangles(&mut children)?);
    let mut sum = FinePoint::default();
    for point in fine.values(points)? {
        sum = FinePoint { x: sum.x ^ point.x, y: sum.y ^ point.y };
    }
    black_box((sum, sum.to_pixels(level), sum.to_image_point(level)));
    black_box(fine.points().fold(0, |sum, point| sum ^ point.weights[0] ^ point.corners[1]));
    for edge in mesh.edges() {
        black_box(edge);
    }
    Ok(())
}

fn maps(points: &[ImagePoint; VERTICES]) {
    let mut pairs = [Correspondence { from: [0.0; 2], to: [0.0; 2] }; VERTICES];
    for (pair, point) in pairs.iter_mut().zip(points) {
        let (x, y) = (f64::from(point.x), f64::from(point.y));
        *pair = Correspondence { from: [x, y], to: [0.5 * y - x, y + 3.0] };
    }
    map::<Rigid>(&pairs);
    map::<Similarity>(&pairs);
    map::<Affine>(&pairs);
    map::<Perspective>(&pairs);
    black_box(Affine::fit(&pairs).map(|map| (map.narrowed(), Affine::widened(map.narrowed()))));
    black_box(Perspective::fit(&pairs).and_then(|map| map.narrowed()).and_then(Perspective::widened));
    let object = Extent::of_points(pairs.iter().map(|pair| [pair.from[0], pair.from[1], pair.to[1]]));
    if let Some(object) = object
        && let Some(model) = WeakPerspective::balanced(black_box(700.0), object)
    {
        black_box((model.check(object, 2.0), model.error([1.0, 2.0, object.farthest()])));
    }
}

fn map<F: Family>(pairs: &[Correspondence]) {
    let Some(fitted) = F::fit(pairs) else { return };
    let corners = [[0.0, 0.0], [9.0, 1.0], [8.0, 7.0], [2.0, 9.0], [4.0, 5.0]];
    for invariant in Invariant::ALL {
        black_box((invariant.measure(corners), fitted.factor(invariant)));
    }
    black_box(fitted.inverse().map(|back| fitted.then(&back).image([1.0, 2.0])));
}
