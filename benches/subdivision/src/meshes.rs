//! The meshes that are timed: Delaunay, on 47 points of which 10 lie on the hull, as the thesis' first tower (6.3).

use daymark_core::mesh::MeshCounts;
use daymark_core::point::ImagePoint;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Points of a mesh.
pub const POINTS: usize = 47;
/// Of these on the hull.
pub const ON_HULL: usize = 10;
/// What every mesh has.
pub const COUNTS: MeshCounts = MeshCounts::of_triangulation(POINTS as u32, ON_HULL as u32);

/// A mesh with its positions.
pub struct Mesh {
    /// Positions in a frame of 640 x 480 px.
    pub points: Vec<ImagePoint>,
    /// Triangles, turning from +x to +y.
    pub triangles: Vec<[u16; 3]>,
}

/// The mesh of this number: always the same.
pub fn mesh(number: u64) -> Mesh {
    let mut random = numbers(number);
    // Ten points of an ellipse, shaken along it, and 37 inside.
    let mut points: Vec<ImagePoint> = (0..ON_HULL)
        .map(|corner| {
            let angle = (corner as f64 + 0.6 * random()) * core::f64::consts::TAU / ON_HULL as f64;
            ImagePoint::new((5_120.0 + 4_800.0 * angle.cos()) as i32, (3_840.0 + 3_500.0 * angle.sin()) as i32)
        })
        .collect();
    while points.len() < POINTS {
        let (x, y) = (2.0 * random() - 1.0, 2.0 * random() - 1.0);
        if x * x + y * y < 0.6 {
            points.push(ImagePoint::new((5_120.0 + 4_800.0 * x) as i32, (3_840.0 + 3_500.0 * y) as i32));
        }
    }
    let mut delaunay = DelaunayTriangulation::<Point2<f64>>::new();
    for point in &points {
        delaunay.insert(Point2::new(f64::from(point.x), f64::from(point.y))).expect("a finite point");
    }
    let triangles: Vec<_> = delaunay.inner_faces().map(|face| face.vertices().map(|v| v.index() as u16)).collect();
    assert_eq!(triangles.len() as u64, COUNTS.triangles, "mesh {number} is not what it should be");
    Mesh { points, triangles }
}

/// Numbers in 0..1 by a linear congruence.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    }
}
