//! Meshes that are refused, and subdivision: counts, every point once, both forms alike, and what the slow way gives.

use std::collections::{BTreeSet, HashMap, HashSet};

use daymark_core::mesh::{
    FinePoint, MAX_TRIANGLES, MAX_VERTICES, MeshCounts, MeshError, SubdivisionLevel, TriangleMesh, storage_words,
};
use daymark_core::point::ImagePoint;
use proptest::prelude::*;

/// A mesh of the tests with its positions.
#[derive(Debug, Clone)]
struct Shape {
    triangles: Vec<[u16; 3]>,
    points: Vec<ImagePoint>,
}

impl Shape {
    fn with<R>(&self, use_mesh: impl FnOnce(TriangleMesh<'_>) -> R) -> R {
        let mut storage = vec![0; storage_words(self.points.len(), self.triangles.len())];
        use_mesh(TriangleMesh::new(self.points.len(), &self.triangles, &mut storage).expect("a valid mesh"))
    }
}

/// A grid whose points are shaken by less than they would have to be to turn a triangle over: planar, no two points of any
/// level coincide. Corners and order of the triangles are shuffled by `seed`, `extra` vertices have no triangle.
fn shaken_grid(columns: usize, rows: usize, extra: usize, seed: u64) -> Shape {
    let mut number = numbers(seed);
    let mut points = Vec::new();
    for row in 0..=rows {
        for column in 0..=columns {
            let mut at = |cell: usize| (cell * 1_000) as i32 + number(401) as i32 - 200;
            points.push(ImagePoint::new(at(column), at(row)));
        }
    }
    let vertex = |column: usize, row: usize| (row * (columns + 1) + column) as u16;
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let quad = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| vertex(column + x, row + y));
            let [a, b, c, d] = quad;
            triangles.extend(if number(2) == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    for triangle in &mut triangles {
        triangle.rotate_left(number(3) as usize);
    }
    for end in (1..triangles.len()).rev() {
        triangles.swap(end, number(end as u64 + 1) as usize);
    }
    points.extend((0..extra).map(|lone| ImagePoint::new(-5_000 - lone as i32, -5_000)));
    Shape { triangles, points }
}

/// Numbers below a bound by a linear congruence.
fn numbers(mut state: u64) -> impl FnMut(u64) -> u64 {
    move |bound| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % bound
    }
}

fn shapes() -> impl Strategy<Value = Shape> {
    (1_usize..5, 1_usize..5, 0_usize..3, any::<u64>()).prop_map(|(w, h, extra, seed)| shaken_grid(w, h, extra, seed))
}

fn levels(deepest: u8) -> impl Strategy<Value = SubdivisionLevel> {
    (0..=deepest).prop_map(|level| SubdivisionLevel::new(level).expect("0..=7"))
}

fn doubled_area([a, b, c]: [FinePoint; 3]) -> i64 {
    let from_a = |p: FinePoint| (i64::from(p.x) - i64::from(a.x), i64::from(p.y) - i64::from(a.y));
    let ((bx, by), (cx, cy)) = (from_a(b), from_a(c));
    bx * cy - by * cx
}

/// The slow way: level by level, every triangle in four, midpoints found again in a map.
fn by_midpoints(shape: &Shape, level: SubdivisionLevel) -> (Vec<FinePoint>, Vec<[usize; 3]>) {
    let n = level.steps() as i32;
    let mut points: Vec<_> = shape.points.iter().map(|p| FinePoint { x: p.x * n, y: p.y * n }).collect();
    let mut triangles: Vec<_> = shape.triangles.iter().map(|triangle| triangle.map(usize::from)).collect();
    for _ in 0..level.number() {
        let mut midpoints = HashMap::new();
        let mut midpoint = |a: usize, b: usize| {
            *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (sum_x, sum_y) = (points[a].x + points[b].x, points[a].y + points[b].y);
                assert_eq!((sum_x % 2, sum_y % 2), (0, 0), "the oracle is exact");
                points.push(FinePoint { x: sum_x / 2, y: sum_y / 2 });
                points.len() - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (midpoint(a, b), midpoint(b, c), midpoint(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (points, triangles)
}

/// Three points, the least first, turned as they were.
fn rotated(mut corners: [FinePoint; 3]) -> [FinePoint; 3] {
    let first = (0..3).min_by_key(|&corner| corners[corner]).expect("three corners");
    corners.rotate_left(first);
    corners
}

fn written(shape: &Shape, level: SubdivisionLevel) -> (Vec<FinePoint>, Vec<[u32; 3]>) {
    shape.with(|mesh| {
        let fine = mesh.subdivided(level);
        let mut points = vec![FinePoint::default(); fine.counts().vertices as usize];
        let mut triangles = vec![[u32::MAX; 3]; fine.counts().triangles as usize];
        assert_eq!(fine.write_values(&shape.points, &mut points).expect("room").len(), points.len());
        assert_eq!(fine.write_triangles(&mut triangles).expect("room").len(), triangles.len());
        (points, triangles)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn it_is_what_repeated_midpoints_give(shape in shapes(), level in levels(4)) {
        let (points, triangles) = written(&shape, level);
        let (slow_points, slow_triangles) = by_midpoints(&shape, level);
        let unique: HashSet<_> = points.iter().copied().collect();
        prop_assert_eq!(unique.len(), points.len(), "a point twice");
        prop_assert_eq!(slow_points.len(), points.len());
        prop_assert_eq!(unique, slow_points.iter().copied().collect::<HashSet<_>>());

        let found: BTreeSet<_> = triangles.iter().map(|t| rotated(t.map(|p| points[p as usize]))).collect();
        let slow: BTreeSet<_> = slow_triangles.iter().map(|t| rotated(t.map(|p| slow_points[p]))).collect();
        prop_assert_eq!(triangles.len(), slow_triangles.len());
        prop_assert_eq!(found.len(), triangles.len(), "a triangle twice");
        prop_assert!(found == slow, "other triangles");
    }

    #[test]
    fn triangles_tile_their_parent_and_turn_as_it_does(shape in shapes(), level in levels(5)) {
        let (points, triangles) = written(&shape, level);
        let each = 1_usize << (2 * level.number());
        for (children, parent) in triangles.chunks_exact(each).zip(&shape.triangles) {
            let n = level.steps() as i32;
            let corners = parent.map(|v| shape.points[usize::from(v)]).map(|p| FinePoint { x: p.x * n, y: p.y * n });
            let area = doubled_area(corners);
            prop_assert!(area > 0);
            for child in children {
                prop_assert_eq!(doubled_area(child.map(|p| points[p as usize])) * each as i64, area);
            }
        }
    }

    #[test]
    fn streams_yield_what_is_written(shape in shapes(), level in levels(5), cut in 0_usize..400) {
        let (points, _) = written(&shape, level);
        shape.with(|mesh| {
            let fine = mesh.subdivided(level);
            let values = fine.values(&shape.points).expect("valid values");
            prop_assert_eq!(values.len(), points.len());
            prop_assert!(values.clone().eq(points.iter().copied()), "one by one");
            // `fold` from the start, and from anywhere.
            let mut values = values;
            let mut folded: Vec<_> = values.by_ref().take(cut).collect();
            prop_assert_eq!(values.len(), points.len().saturating_sub(cut));
            values.for_each(|point| folded.push(point));
            prop_assert!(folded == points, "folded");

            let weighted = fine.points();
            prop_assert_eq!(weighted.len(), points.len());
            let mut folded: Vec<_> = weighted.clone().take(cut).collect();
            weighted.clone().skip(cut).for_each(|point| folded.push(point));
            prop_assert!(weighted.clone().eq(folded), "weights: folded");
            for (place, point) in weighted.zip(&points) {
                prop_assert_eq!(place.weights.map(u32::from).iter().sum::<u32>(), level.steps());
                match place.triangle {
                    Some(triangle) => prop_assert_eq!(place.corners, shape.triangles[triangle as usize]),
                    None => prop_assert!(place.corners.iter().all(|&v| usize::from(v) >= shape.points.len() - 2)),
                }
                let sum = |coordinate: fn(ImagePoint) -> i32| -> i32 {
                    place.corners.iter().zip(place.weights)
                        .map(|(&v, w)| coordinate(shape.points[usize::from(v)]) * i32::from(w)).sum()
                };
                prop_assert_eq!([sum(|p| p.x), sum(|p| p.y)], [point.x, point.y]);
            }
            Ok(())
        })?;
    }

    /// Of all triangles that have a point, the stream names the first.
    #[test]
    fn the_first_triangle_is_named(shape in shapes(), level in levels(2)) {
        shape.with(|mesh| {
            for place in mesh.subdivided(level).points() {
                let used: Vec<_> =
                    place.corners.iter().zip(place.weights).filter(|&(_, w)| w > 0).map(|(v, _)| *v).collect();
                let first = shape.triangles.iter().position(|t| used.iter().all(|vertex| t.contains(vertex)));
                prop_assert_eq!(place.triangle, first.map(|triangle| triangle as u32));
            }
            Ok(())
        })?;
    }

    /// Midpoints are affine invariants (thesis 3.2): the map of the fine points is the subdivision of the mapped ones.
    #[test]
    fn subdivision_and_affine_maps_commute(
        shape in shapes(), level in levels(5), linear in [-40_i32..40, -40..40, -40..40, -40..40], shift in [-9_999_i32..9_999, -9_999..9_999],
    ) {
        let [a, b, c, d] = linear;
        let n = level.steps() as i32;
        let mapped = Shape {
            points: shape.points.iter()
                .map(|p| ImagePoint::new(a * p.x + b * p.y + shift[0], c * p.x + d * p.y + shift[1])).collect(),
            ..shape.clone()
        };
        let after = written(&shape, level).0.into_iter()
            .map(|p| FinePoint { x: a * p.x + b * p.y + n * shift[0], y: c * p.x + d * p.y + n * shift[1] });
        prop_assert!(after.eq(written(&mapped, level).0));
    }

    #[test]
    fn numbers_are_carried_along_within_their_error(shape in shapes(), level in levels(4), seed in any::<u64>()) {
        let mut number = numbers(seed);
        let mut random = || (number(2_000_001) as f32 - 1e6) * 0.001_3;
        let values: Vec<[f32; 4]> = shape.points.iter().map(|_| [random(), random(), random(), 0.1]).collect();
        shape.with(|mesh| {
            let fine = mesh.subdivided(level);
            let mut written = vec![[0.0; 4]; fine.counts().vertices as usize];
            fine.write_values(&values, &mut written).expect("room");
            prop_assert!(fine.values(&values).expect("valid values").eq(written.iter().copied()), "the forms differ");
            prop_assert_eq!(&written[..values.len()], &values[..], "vertices stay as they are");
            for (place, value) in fine.points().zip(&written) {
                prop_assert_eq!(value[3], 0.1);
                for component in 0..3 {
                    let corner = |k: usize| f64::from(values[usize::from(place.corners[k])][component]);
                    let weight = |k: usize| f64::from(place.weights[k]) / f64::from(level.steps());
                    let exact: f64 = (0..3).map(|k| corner(k) * weight(k)).sum();
                    let largest = (0..3).map(|k| corner(k).abs()).fold(0.0, f64::max);
                    prop_assert!((f64::from(value[component]) - exact).abs() <= largest / f64::from(1 << 20));
                }
            }
            Ok(())
        })?;
    }

    /// Whatever is done to a mesh, it obeys its rules or is refused; never a panic.
    #[test]
    fn damaged_meshes_are_told_from_sound_ones(
        shape in shapes(), damage in prop::collection::vec((any::<u8>(), any::<u64>()), 0..3), level in levels(3),
    ) {
        let (mut triangles, vertices) = (shape.triangles, shape.points.len());
        for (kind, seed) in damage {
            let mut number = numbers(seed);
            let place = number(triangles.len() as u64) as usize;
            let vertex = number(vertices as u64 + 1) as u16;
            let triangle = &mut triangles[place];
            match kind % 6 {
                0 => triangle[number(3) as usize] = vertex,
                1 => triangle.swap(0, 1),
                2 => triangle.rotate_left(1),
                3 => drop(triangles.swap_remove(place)),
                4 => { let again = *triangle; triangles.push(again) }
                _ => { let [a, b, _] = *triangle; triangles.push([b, a, vertex]) }
            }
            if triangles.is_empty() { break; }
        }
        let mut storage = vec![0; storage_words(vertices, triangles.len())];
        let mut directed = HashMap::<_, u32>::new();
        for [a, b, c] in triangles.iter().copied() {
            for side in [[a, b], [b, c], [c, a]] {
                *directed.entry(side).or_default() += 1;
            }
        }
        let mut same = triangles.iter().map(|t| t.iter().copied().collect::<BTreeSet<_>>()).collect::<Vec<_>>();
        same.sort();
        let valid = triangles.iter().flatten().all(|&v| usize::from(v) < vertices)
            && same.iter().all(|t| t.len() == 3)
            && same.windows(2).all(|pair| pair[0] != pair[1])
            && directed.values().all(|&times| times == 1);
        match TriangleMesh::new(vertices, &triangles, &mut storage) {
            Ok(mesh) => {
                prop_assert!(valid);
                let undirected: BTreeSet<_> = directed.keys().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
                prop_assert!(mesh.edges().eq(undirected));
                for (number, &[a, b, c]) in triangles.iter().enumerate() {
                    let edges = mesh.edges_of(number as u32).expect("a triangle");
                    let ends = edges.map(|edge| mesh.edge(edge).expect("an edge"));
                    prop_assert_eq!(ends, [[a, b], [b, c], [c, a]].map(|[from, to]| [from.min(to), from.max(to)]));
                }
                let fine = mesh.subdivided(level);
                prop_assert_eq!(fine.points().count() as u64, fine.counts().vertices);
            }
            Err(_) => prop_assert!(!valid),
        }
    }
}

/// 47 points of which 10 lie on the hull: a fan, then one point after the other into a triangle.
fn thesis_mesh() -> Shape {
    let mut number = numbers(47);
    let mut triangles: Vec<_> = (2..10).map(|corner| [0, corner - 1, corner]).collect();
    for vertex in 10..47 {
        let place = number(triangles.len() as u64) as usize;
        let [a, b, c] = triangles[place];
        triangles[place] = [a, b, vertex];
        triangles.extend([[b, c, vertex], [c, a, vertex]]);
    }
    let points = (0..47).map(|_| ImagePoint::new(number(8_000) as i32, number(8_000) as i32)).collect();
    Shape { triangles, points }
}

#[test]
fn the_thesis_mesh_has_the_counts_of_the_formula() {
    let shape = thesis_mesh();
    let formula = MeshCounts::of_triangulation(47, 10);
    assert_eq!(formula, MeshCounts { vertices: 47, edges: 128, triangles: 82 });
    for level in SubdivisionLevel::ALL {
        shape.with(|mesh| {
            assert_eq!(mesh.counts(), formula);
            let fine = mesh.subdivided(level);
            assert_eq!(fine.counts(), formula.at(level));
            let streamed = fine.values(&shape.points).expect("valid").fold(0_u64, |count, _| count + 1);
            assert_eq!(streamed, fine.counts().vertices);
        });
        let used: BTreeSet<_> = written(&shape, level).1.into_iter().flatten().collect();
        assert!(used.into_iter().eq(0..formula.at(level).vertices as u32), "every point is a corner");
    }
    let finest = written(&shape, SubdivisionLevel::SEVEN);
    assert_eq!((finest.0.len(), finest.1.len()), (672_385, 1_343_488));
}

/// Edges of the level by hand: one square of two triangles, level 1 and 2.
#[test]
fn the_written_order() {
    let shape = Shape {
        triangles: vec![[2, 1, 3], [2, 0, 1]],
        points: [[0, 0], [40, 0], [0, 40], [40, 40]].map(|[x, y]| ImagePoint::new(x, y)).to_vec(),
    };
    let (points, triangles) = written(&shape, SubdivisionLevel::ONE);
    let expected = [[0, 0], [80, 0], [0, 80], [80, 80], [40, 0], [0, 40], [40, 40], [80, 40], [40, 80]];
    assert_eq!(points, expected.map(|[x, y]| FinePoint { x, y }));
    // Edges 0-1 (4), 0-2 (5), 1-2 (6), 1-3 (7), 2-3 (8).
    let expected = [[2, 6, 8], [6, 7, 8], [8, 7, 3], [6, 1, 7], [2, 5, 6], [5, 4, 6], [6, 4, 1], [5, 0, 4]];
    let order = [0, 1, 2, 3, 4, 5, 6, 7].map(|number: usize| triangles[number]);
    assert_eq!(order, expected);
    let (points, _) = written(&shape, SubdivisionLevel::TWO);
    let on_last_edge = [[40, 160], [80, 160], [120, 160]];
    let inside_first = [[80, 120], [120, 120], [120, 80]];
    assert_eq!(
        points[16..22],
        [on_last_edge, inside_first].concat().into_iter().map(|[x, y]| FinePoint { x, y }).collect::<Vec<_>>()
    );
}

#[test]
fn refusals_name_the_numbers() {
    let refused = |vertices: usize, triangles: &[[u16; 3]]| {
        let mut storage = vec![0; storage_words(vertices, triangles.len())];
        TriangleMesh::new(vertices, triangles, &mut storage).map(|mesh| mesh.counts()).expect_err("no mesh")
    };
    let bad = MeshError::NoSuchVertex { triangle: 1, vertex: 4, vertices: 4 };
    assert_eq!(refused(4, &[[0, 1, 2], [2, 1, 4]]), bad);
    assert_eq!(bad.to_string(), "triangle 1 has vertex 4, but there are 4 vertices, counted from 0");
    for corners in [[3, 1, 3], [3, 3, 1], [1, 3, 3]] {
        assert_eq!(refused(4, &[[0, 1, 2], corners]), MeshError::RepeatedVertex { triangle: 1, vertex: 3 });
    }
    for again in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0], [1, 0, 2], [0, 2, 1]] {
        let expected = MeshError::DoubledTriangle { triangles: [1, 2] };
        assert_eq!(refused(4, &[[2, 1, 3], [0, 1, 2], again]), expected, "{again:?}");
    }
    let fan = [[0, 1, 2], [1, 0, 3], [1, 0, 4], [0, 1, 5]];
    assert_eq!(refused(6, &fan[..3]), MeshError::NonManifoldEdge { ends: [0, 1], triangles: 3 });
    assert_eq!(refused(6, &fan), MeshError::NonManifoldEdge { ends: [0, 1], triangles: 4 });
    let turned = MeshError::InconsistentOrientation { directed: [2, 1], triangles: [0, 1] };
    assert_eq!(refused(4, &[[0, 2, 1], [3, 2, 1]]), turned);
    let limit = MAX_VERTICES;
    assert_eq!(refused(limit + 1, &[]), MeshError::TooManyVertices { found: limit + 1, limit });
    let (found, limit) = (MAX_TRIANGLES + 1, MAX_TRIANGLES);
    assert_eq!(refused(3, &vec![[0, 1, 2]; found]), MeshError::TooManyTriangles { found, limit });
}

#[test]
fn flat_triangles_are_refused_exactly() {
    let mut storage = [0; storage_words(4, 2)];
    let triangles = [[0, 1, 2], [2, 1, 3]];
    let mesh = TriangleMesh::new(4, &triangles, &mut storage).expect("a mesh");
    let far = i32::MAX;
    let points = |last: [i32; 2]| [[0, 0], [far, -far], [-far, far - 1], last].map(|[x, y]| ImagePoint::new(x, y));
    assert_eq!(mesh.check_areas(&points([far, far])), Ok(()));
    let flat = MeshError::CollinearTriangle { triangle: 1, vertices: [2, 1, 3] };
    assert_eq!(mesh.check_areas(&points([far, -far])), Err(flat));
    // One part in 2^31 from a line.
    let near = |x: i32| [[0, 0], [(1 << 30) - 1, 3], [x, 6], [5, 9]].map(|[x, y]| ImagePoint::new(x, y));
    assert_eq!(mesh.check_areas(&near(far - 2)), Ok(()));
    let exactly = MeshError::CollinearTriangle { triangle: 0, vertices: [0, 1, 2] };
    assert_eq!(mesh.check_areas(&near(far - 1)), Err(exactly));
    let line = [[0, 0], [3, 7], [0, 9], [6, -5]].map(|[x, y]| ImagePoint::new(x, y));
    assert_eq!(mesh.check_areas(&line), Ok(()));
    let line = [[0, 0], [3, 7], [0, 9], [6, 5]].map(|[x, y]| ImagePoint::new(x, y));
    assert_eq!(mesh.check_areas(&line), Err(flat));
    assert_eq!(mesh.check_areas(&line[..3]), Err(MeshError::ValueCount { found: 3, expected: 4 }));
}

#[test]
fn small_buffers_and_bad_values_are_refused() {
    let triangles = [[0, 1, 2]];
    let needed = storage_words(3, 1);
    let small = TriangleMesh::new(3, &triangles, &mut vec![0; needed - 1]).map(|mesh| mesh.counts());
    assert_eq!(small, Err(MeshError::StorageTooSmall { found: needed - 1, needed }));

    let mut storage = vec![0; needed];
    let fine = TriangleMesh::new(3, &triangles, &mut storage).expect("a mesh").subdivided(SubdivisionLevel::TWO);
    let mut points = [[7.0_f32; 2]; 16];
    let values = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let too_small = MeshError::BufferTooSmall { found: 14, needed: 15 };
    assert_eq!(fine.write_values(&values, &mut points[..14]), Err(too_small));
    assert_eq!(fine.write_triangles(&mut [[0; 3]; 15]), Err(MeshError::BufferTooSmall { found: 15, needed: 16 }));
    let nan = [[0.0, 0.0], [1.0, 0.0], [0.0, f32::NAN]];
    assert_eq!(fine.write_values(&nan, &mut points), Err(MeshError::ValueOutOfRange { vertex: 2 }));
    assert_eq!(fine.values(&nan).map(|_| ()), Err(MeshError::ValueOutOfRange { vertex: 2 }));
    assert_eq!(fine.values(&values[..2]).map(|_| ()), Err(MeshError::ValueCount { found: 2, expected: 3 }));
    assert!(points.iter().all(|point| *point == [7.0; 2]), "a refused buffer was written");
    assert_eq!(fine.write_values(&values, &mut points).map(|written| written.len()), Ok(15));
    assert_eq!(points[15], [7.0; 2]);
}

/// The largest mesh: 65,536 vertices in 130,050 triangles.
#[test]
fn a_full_mesh() {
    let shape = shaken_grid(255, 255, 0, 11);
    assert_eq!(shape.points.len(), MAX_VERTICES);
    let level = SubdivisionLevel::ONE;
    let (points, triangles) = written(&shape, level);
    let counts = MeshCounts::of_triangulation(65_536, 1_020).at(level);
    assert_eq!((points.len() as u64, triangles.len() as u64), (counts.vertices, counts.triangles));
    assert_eq!(points.iter().collect::<HashSet<_>>().len(), points.len());
}
