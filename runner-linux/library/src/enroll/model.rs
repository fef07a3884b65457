//! Where the corners of a landmark's views are in space: its pictures are reconstructed, and each enrolled corner gets a
//! place.
//!
//! 1. [`reconstruct`] places the cameras, from the pictures as large as they are.
//! 2. The corners of the small frames that recognition compares are matched again between those cameras. A corner that
//!    another view shows as well is triangulated; another one lies where its ray meets the reconstructed surface.
//! 3. The frame of reference: z up ([`upright`](super::upright)), +y into the front, the origin under the middle.

use std::fmt;

use daymark_core::table::{ModelFacts, POINTS_LIMIT, PackedPoint, StoredAzimuth, TRIANGLES_LIMIT, corner_key};
use nalgebra::Vector3;

use super::upright::{Upright, upright};
use crate::classify::cloud::Similarity;
use crate::order;
use crate::picture::GrayImage;
use crate::synthesize::correspond::{Geometry, pairs, tracks};
use crate::synthesize::features::features;
use crate::synthesize::frame::{Scale, moved};
use crate::synthesize::mesh::surface;
use crate::synthesize::reconstruct::{Cameras, Corners, NoModel, Reconstruction, Shape, reconstruct};
use crate::synthesize::triangulate::{Rules, points};
use crate::synthesize::view::{Station, Track, Vertex, View};
use crate::table_file::{ModelEntry, ViewEntry};

/// A picture that was enrolled.
#[derive(Debug)]
pub struct Shot<'a> {
    /// As large as it was read, with its lens.
    pub full: View,
    /// As recognition compares it.
    pub small: &'a GrayImage,
    /// What the table stores of it, and its number among the landmark's views.
    pub stored: (&'a ViewEntry, u16),
    /// Where it was taken, if its file says so: metres east and north of some place.
    pub place: Option<[f64; 2]>,
}

/// What is known beside the pictures.
#[derive(Debug, Clone)]
pub struct Known {
    /// The cameras.
    pub cameras: Cameras,
    /// What says how long a metre is, if the cameras do not.
    pub scale: KnownScale,
    /// Azimuth towards which the front looks, degrees, and its standard deviation.
    pub facing: Option<[f64; 2]>,
}

/// What says how long a metre is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KnownScale {
    /// Only the places in the pictures' files, if they are far enough apart.
    Places,
    /// Metres between the cameras of the first two pictures.
    Distance(f64),
    /// Metres from the lowest to the highest point that the pictures show.
    Height(f64),
}

/// A model, and what there is to say about it.
#[derive(Debug, Clone)]
pub struct Modelled {
    /// What goes into the table.
    pub entry: ModelEntry,
    /// Corners whose place comes from several views.
    pub triangulated: usize,
    /// Corners whose place was read off the surface.
    pub on_surface: usize,
    /// Corners that have no place.
    pub without: usize,
    /// Views that take part.
    pub views: usize,
    /// From the frame of the cameras (their file's, or that of the reconstruction) to the model's.
    pub model_from_cameras: Similarity,
    /// The origin, metres east and north of the place that the pictures' places count from.
    pub origin: Option<[f64; 2]>,
}

/// Why a landmark has no model. Not an error: it is recognized all the same.
#[derive(Debug, Clone, PartialEq)]
pub enum WithoutModel {
    /// One picture has no depth.
    OnePicture,
    /// Without a focal length there is no shape.
    NoFocalLength,
    /// The pictures give none.
    Pictures(NoModel),
    /// The cameras do not say where up is, or how long a metre is.
    NoFrame,
    /// Hardly any enrolled corner has a place.
    TooFewCorners {
        /// Corners with a place.
        found: usize,
    },
}

impl fmt::Display for WithoutModel {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OnePicture => out.write_str("one picture has no depth: give two or more, from different places"),
            Self::NoFocalLength => {
                out.write_str("the pictures do not say their focal length: give --focal-px, or --cameras")
            }
            Self::Pictures(why) => why.fmt(out),
            Self::NoFrame => out.write_str(
                "the cameras do not say where up is, or the first two are not both part of it to measure a length",
            ),
            Self::TooFewCorners { found } => {
                write!(out, "only {found} enrolled corners have a place, and {LEAST_POINTS} are needed")
            }
        }
    }
}

/// Fewer corners with a place are no model: a position needs four that are seen, and most are not.
const LEAST_POINTS: usize = 12;
/// A triangulated point is this corner if it is seen this near, pixels of the small frame.
const SAME_CORNER_PX: f64 = 0.75;
/// A surface between points farther apart in the small frame says little about what lies between, pixels.
const LONGEST_EDGE_PX: f64 = 60.0;
/// What lies farther off than this many times the distance of nine tenths of the points is no part of the building.
const FAR: f64 = 4.0;
/// Deviation of a tape or of a height from a plan, as a share.
const MEASURED_ERROR: f64 = 0.02;
/// Deviation of cameras from a file, as a share.
const FILE_ERROR: f64 = 0.002;
/// Deviation of a place in a picture's file, metres.
const PLACE_ERROR_M: f64 = 6.0;

/// Makes the model of a landmark from the pictures of one enrollment.
///
/// # Errors
/// [`WithoutModel`], with the figure that decided.
pub fn model(shots: Vec<Shot<'_>>, known: &Known) -> Result<Modelled, WithoutModel> {
    if shots.len() < 2 {
        return Err(WithoutModel::OnePicture);
    }
    if matches!(known.cameras, Cameras::Affine) {
        return Err(WithoutModel::NoFocalLength);
    }
    let places: Vec<Option<[f64; 2]>> = shots.iter().map(|shot| shot.place).collect();
    let (full, rest): (Vec<View>, Vec<_>) =
        shots.into_iter().map(|shot| (shot.full, (shot.small, shot.stored))).unzip();
    let mut made =
        reconstruct(full, &known.cameras, &Corners::Automatic, &Rules::default()).map_err(WithoutModel::Pictures)?;
    let Upright { map, scale_error, azimuth, origin } = framed(&made, known, &places).ok_or(WithoutModel::NoFrame)?;
    moved(&mut made, &map);

    let small: Vec<View> = made.views.iter().zip(&rest).map(|(view, (gray, _))| small_view(view, gray)).collect();
    let stations: Vec<Option<Station>> = made
        .stations
        .iter()
        .zip(&small)
        .map(|(station, view)| station.as_ref().and_then(|station| Station::new(&view.lens, station.pose)))
        .collect();
    let vertices = small_points(&small, &stations)?;
    let mut found: Vec<Placed> = Vec::new();
    let mut all = 0;
    for (number, (_, (stored, place))) in rest.iter().enumerate() {
        all += stored.features.len();
        found.extend(place_corners(number, *place, stored, &small, &stations, &vertices, &made));
    }
    without_far(&mut found);
    found.truncate(usize::from(POINTS_LIMIT));
    if found.len() < LEAST_POINTS {
        return Err(WithoutModel::TooFewCorners { found: found.len() });
    }
    let triangles = triangles(&found, &stations);
    let triangulated = found.iter().filter(|placed| placed.triangulated).count();
    let (on_surface, without) = (found.len() - triangulated, all - found.len());
    let entry = packed(&found, triangles, scale_error, azimuth);
    let views = entry.views.len();
    Ok(Modelled { entry, triangulated, on_surface, without, views, model_from_cameras: map, origin })
}

/// The frame of reference, and how well it is known.
fn framed(made: &Reconstruction, known: &Known, places: &[Option<[f64; 2]>]) -> Option<Upright> {
    let scale = match (made.shape, known.scale) {
        (Shape::Metric, _) => (Scale::Factor(1.0), Some(FILE_ERROR)),
        (_, KnownScale::Distance(metres)) => (Scale::Distance(metres), Some(MEASURED_ERROR)),
        (_, KnownScale::Height(metres)) => (Scale::Height(metres), Some(MEASURED_ERROR)),
        (_, KnownScale::Places) => (Scale::None, None),
    };
    upright(made, scale, places, PLACE_ERROR_M, known.facing)
}

fn small_view(view: &View, gray: &GrayImage) -> View {
    View {
        name: view.name.clone(),
        gray: gray.clone(),
        rgb: Vec::new(),
        lens: view.lens.scaled_to(gray.width as u32, gray.height as u32),
    }
}

/// Points that several small frames show.
fn small_points(views: &[View], stations: &[Option<Station>]) -> Result<Vec<Vertex>, WithoutModel> {
    let picture = |error| WithoutModel::Pictures(NoModel::Picture(format!("{error}")));
    let found = views.iter().map(features).collect::<Result<Vec<_>, _>>().map_err(picture)?;
    let (tracks, ..) = tracks(&found, &pairs(views, &found, Geometry::Known(stations)));
    Ok(points(&tracks, stations, &Rules { max_reprojection_px: 2.0, ..Rules::default() }).0)
}

/// An enrolled corner that has a place.
#[derive(Debug, Clone)]
struct Placed {
    /// Its view, as a number of the pictures, and among the landmark's views.
    shot: usize,
    view: u16,
    corner: u16,
    vertex: Vertex,
    triangulated: bool,
}

fn place_corners(
    shot: usize,
    view: u16,
    stored: &ViewEntry,
    views: &[View],
    stations: &[Option<Station>],
    vertices: &[Vertex],
    made: &Reconstruction,
) -> Vec<Placed> {
    let Some(station) = &stations[shot] else { return Vec::new() };
    let seen: Vec<([f64; 2], &Vertex)> =
        vertices.iter().filter_map(|vertex| Some((vertex.track.seen_by(shot)?, vertex))).collect();
    let surface = ProjectedSurface::new(made, station, views, stations);
    // A corner's number is its place in the table's order.
    let mut corners = stored.features.clone();
    order::sort_by_key(&mut corners, |feature| corner_key(feature).unwrap_or(u32::MAX));
    let mut placed = Vec::new();
    for (corner, feature) in (0..).zip(&corners) {
        let at = feature.position.to_pixels().map(f64::from);
        let Some(at) = views[shot].lens.ideal_from_picture(at) else { continue };
        let squared = |[x, y]: [f64; 2]| (x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1]);
        let nearest = seen.iter().min_by(|a, b| squared(a.0).total_cmp(&squared(b.0)));
        let same = nearest.filter(|(sighting, _)| squared(*sighting) <= SAME_CORNER_PX * SAME_CORNER_PX);
        let triangulated = same.is_some();
        let vertex = same.map(|(_, vertex)| (*vertex).clone()).or_else(|| surface.met(at));
        placed.extend(vertex.map(|vertex| Placed { shot, view, corner, vertex, triangulated }));
    }
    placed
}

/// The reconstructed surface as one small frame sees it.
struct ProjectedSurface<'a> {
    /// Pixels and depth of the corners of each triangle that faces the view, and its vertices.
    facing: Vec<([[f64; 3]; 3], [&'a Vertex; 3])>,
    station: &'a Station,
    stations: &'a [Option<Station>],
    views: &'a [View],
}

impl<'a> ProjectedSurface<'a> {
    fn new(made: &'a Reconstruction, station: &'a Station, views: &'a [View], stations: &'a [Option<Station>]) -> Self {
        let all = &made.model.surface;
        let seen: Vec<Option<[f64; 3]>> = all
            .vertices
            .iter()
            .map(|vertex| {
                let [x, y] = station.pinhole.project(vertex.position.into())?;
                Some([x, y, station.pose.to_view(&vertex.position).z])
            })
            .collect();
        let facing = all.triangles.iter().filter_map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| seen[vertex as usize]);
            let corners = [a?, b?, c?];
            let length = |p: [f64; 3], q: [f64; 3]| libm::hypot(p[0] - q[0], p[1] - q[1]);
            let [a, b, c] = corners;
            let longest = length(a, b).max(length(b, c)).max(length(c, a));
            // Counter-clockwise from outside is negative with y down.
            let faces = area([a, b, c]) < 0.0;
            let vertices = triangle.map(|vertex| &all.vertices[vertex as usize]);
            (faces && longest <= LONGEST_EDGE_PX).then_some((corners, vertices))
        });
        Self { facing: facing.collect(), station, stations, views }
    }

    /// What the ray through a pixel meets first.
    fn met(&self, at: [f64; 2]) -> Option<Vertex> {
        let hits = self.facing.iter().filter_map(|(corners, vertices)| {
            let [a, b, c] = *corners;
            let p = [at[0], at[1], 0.0];
            let whole = area([a, b, c]);
            let weights = [area([p, b, c]) / whole, area([a, p, c]) / whole, area([a, b, p]) / whole];
            if !weights.iter().all(|weight| *weight >= 0.0) {
                return None;
            }
            // Along a plane the inverse of the depth is linear in the image.
            let inverse = weights.iter().zip(corners).map(|(weight, corner)| weight / corner[2]).sum::<f64>();
            Some((1.0 / inverse, *vertices))
        });
        let (depth, vertices) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let pinhole = &self.station.pinhole;
        let position = Vector3::from(pinhole.centre()) + Vector3::from(pinhole.direction(at)) * depth;
        // Seen by those views that see all three corners.
        let sightings = (0..self.views.len())
            .filter(|view| vertices.iter().all(|vertex| vertex.track.seen_by(*view).is_some()))
            .filter_map(|view| Some((view, self.stations[view].as_ref()?.pinhole.project(position.into())?)))
            .collect();
        let worst = vertices.iter().max_by(|a, b| a.covariance.trace().total_cmp(&b.covariance.trace()))?;
        Some(Vertex { position, track: Track { number: 0, sightings }, ..(*worst).clone() })
    }
}

fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Takes out what lies far behind the building.
fn without_far(found: &mut Vec<Placed>) {
    let median = |axis: usize| {
        let mut values: Vec<f64> = found.iter().map(|placed| placed.vertex.position[axis]).collect();
        order::ascending(&mut values);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let middle = Vector3::new(median(0), median(1), median(2));
    let mut distances: Vec<f64> = found.iter().map(|placed| (placed.vertex.position - middle).norm()).collect();
    order::ascending(&mut distances);
    let limit = FAR * distances.get(distances.len() * 9 / 10).copied().unwrap_or(0.0);
    found.retain(|placed| (placed.vertex.position - middle).norm() <= limit);
}

/// The surface between the placed corners: of each view with the one that sees the most of it.
fn triangles(found: &[Placed], stations: &[Option<Station>]) -> Vec<[u16; 3]> {
    // A point that two views enrolled is there twice; the surface takes it once.
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut numbers: Vec<u16> = Vec::new();
    for (number, placed) in (0..).zip(found) {
        if !vertices.iter().any(|other| other.position == placed.vertex.position) {
            vertices.push(placed.vertex.clone());
            numbers.push(number);
        }
    }
    let mut order = Vec::new();
    for view in 0..stations.len() {
        let with = |other: usize| {
            let both = |vertex: &&Vertex| vertex.track.seen_by(view).and(vertex.track.seen_by(other)).is_some();
            if other == view { 0 } else { vertices.iter().filter(both).count() }
        };
        let partner = (0..stations.len()).max_by_key(|&other| (with(other), usize::MAX - other));
        order.extend(partner.filter(|&other| with(other) >= 3).map(|other| (with(other), [view, other])));
    }
    order::sort_by_key(&mut order, |&(count, pair)| (usize::MAX - count, pair));
    let order: Vec<[usize; 2]> = order.into_iter().map(|(_, pair)| pair).collect();
    let (surface, _) = surface(vertices, stations, &order, 0.0);
    let mut triangles: Vec<[u16; 3]> =
        surface.triangles.iter().map(|triangle| least_first(triangle.map(|vertex| numbers[vertex as usize]))).collect();
    triangles.sort_unstable();
    triangles.truncate(usize::from(TRIANGLES_LIMIT));
    triangles
}

/// The same triangle, the same way around, from its least number on.
fn least_first([a, b, c]: [u16; 3]) -> [u16; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// A unit is a millimetre, or coarser where a millimetre would not reach; where lengths mean nothing, a fraction of the model.
fn packed(
    found: &[Placed],
    triangles: Vec<[u16; 3]>,
    scale_error: Option<f64>,
    azimuth: Option<[f64; 2]>,
) -> ModelEntry {
    let extent =
        found.iter().flat_map(|placed| placed.vertex.position.iter()).fold(0.0_f64, |most, x| most.max(x.abs()));
    let fitting = libm::ceil(extent * 1e6 / f64::from(i16::MAX));
    let unit_um = if scale_error.is_some() { fitting.max(1_000.0) } else { fitting.max(1.0) };
    let units = |metres: f64| libm::round(metres * 1e6 / unit_um);
    let mut deviations: Vec<f64> = found
        .iter()
        .map(|placed| libm::sqrt(placed.vertex.covariance.symmetric_eigenvalues().max().max(0.0)))
        .collect();
    order::ascending(&mut deviations);
    let mut views: Vec<(u16, Vec<PackedPoint>)> = Vec::new();
    // Pictures come in the order of their views, and corners in the view's order, unless a view was known before.
    let mut order: Vec<usize> = (0..found.len()).collect();
    order::sort_by_key(&mut order, |&number| (found[number].view, found[number].corner, found[number].shot));
    order.dedup_by_key(|number| (found[*number].view, found[*number].corner));
    let mut renumbered = vec![u16::MAX; found.len()];
    for (new, &old) in (0..).zip(&order) {
        renumbered[old] = new;
        let placed = &found[old];
        let position = placed.vertex.position;
        let units = [position.x, position.y, position.z].map(|x| units(x) as i16);
        let point = PackedPoint { corner: placed.corner, units };
        match views.last_mut() {
            Some((view, points)) if *view == placed.view => points.push(point),
            _ => views.push((placed.view, vec![point])),
        }
    }
    let mut triangles: Vec<[u16; 3]> = triangles
        .into_iter()
        .map(|triangle| triangle.map(|point| renumbered[usize::from(point)]))
        .filter(|triangle| triangle.iter().all(|point| *point != u16::MAX))
        .map(least_first)
        .collect();
    triangles.sort_unstable();
    let centidegrees = |degrees: f64| libm::round(degrees.rem_euclid(360.0) * 100.0) as u32 % 36_000;
    let facts = ModelFacts {
        unit_um: unit_um as u32,
        scale_error: scale_error.map(|share| libm::round(share * 10_000.0).clamp(0.0, 10_000.0) as u16),
        azimuth: azimuth.map(|[degrees, deviation]| StoredAzimuth {
            centidegrees: centidegrees(degrees) as u16,
            deviation: libm::round(deviation * 100.0).clamp(0.0, 18_000.0) as u16,
        }),
        deviation: units(deviations[deviations.len() / 2]).clamp(0.0, f64::from(u16::MAX)) as u16,
    };
    ModelEntry { facts, views, triangles }
}
