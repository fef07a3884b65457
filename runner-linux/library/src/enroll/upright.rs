//! The frame of a landmark's model: z up, +y into the front, the origin under the middle; in metres and turned to north as
//! far as anything says so.
//!
//! **Up** is not the mean of the cameras' up, because people tilt cameras to get a tower's top in. But they hold them level:
//! each camera's x axis is horizontal, and so are the normals of walls. Up is the direction that is most nearly at right
//! angles to all of these: the eigenvector of the least eigenvalue of `sum x x^T / cameras + sum w n n^T / sum w`, where a
//! wall's weight `w` is its area as the cameras see it: what bridges a step in depth is large and seen edge-on.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use crate::classify::cloud::Similarity;
use crate::order;
use crate::synthesize::frame::{Scale, upright as roughly_upright};
use crate::synthesize::reconstruct::Reconstruction;

/// The map into the frame, and how well it is known.
#[derive(Debug, Clone)]
pub struct Upright {
    /// From the frame of the cameras.
    pub map: Similarity,
    /// Standard deviation of the scale, as a share; `None` if lengths mean nothing.
    pub scale_error: Option<f64>,
    /// Azimuth of the +y axis and its standard deviation, degrees.
    pub azimuth: Option<[f64; 2]>,
    /// The origin as the pictures' places have it, metres east and north.
    pub origin: Option<[f64; 2]>,
}

/// A wall's normal is level within this, as the sine of its slope to the first guess of up.
const LEVEL_SINE: f64 = 0.35;
/// Walls that slope by this count half, round by round.
const SLOPES: [f64; 6] = [0.35, 0.2, 0.1, 0.05, 0.03, 0.03];
/// A front has at least this share of all walls.
const LEAST_FRONT: f64 = 0.2;
/// Walls within this of one another's direction are one front, degrees.
const SAME_FRONT_DEGREES: f64 = 10.0;
/// Places that are less apart say neither a scale nor a direction, metres: receivers err by several.
const LEAST_SPREAD_M: f64 = 25.0;

/// The frame of a reconstruction. `places` are the pictures' own, metres east and north, `place_error` the deviation of one;
/// `facing` is the azimuth towards which the front looks, with its deviation, degrees. `None` if the cameras do not say
/// where up is, or the scale cannot be had from what it is asked from.
pub fn upright(
    made: &Reconstruction,
    (scale, scale_error): (Scale, Option<f64>),
    places: &[Option<[f64; 2]>],
    place_error: f64,
    facing: Option<[f64; 2]>,
) -> Option<Upright> {
    // A height is measured along what is up in the end.
    let first = if matches!(scale, Scale::Height(_)) { &Scale::None } else { &scale };
    let rough = roughly_upright(made, first)?;
    let walls = Walls::new(made, &rough);
    let level = walls.levelling(made, &rough)?;
    let towards = walls.front(&level);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), towards).into_inner() * level;
    let rotated =
        Similarity { scale: rough.scale, rotation: turn * rough.rotation, translation: turn * rough.translation };
    let rotated = match scale {
        Scale::Height(metres) => taller(made, &rotated, metres)?,
        _ => rotated,
    };
    let map = grounded(made, &rotated);
    let azimuth = facing.map(|[degrees, deviation]| [degrees + 180.0, deviation]);
    let mut upright = Upright { map, scale_error, azimuth, origin: None };
    if let Some(fit) = PlaceFit::new(made, &upright.map, places) {
        let along = place_error / fit.spread;
        if upright.scale_error.is_none() {
            let Similarity { rotation, translation, scale } = upright.map;
            upright.map = Similarity { scale: scale * fit.scale, rotation, translation: translation * fit.scale };
            upright.scale_error = Some(along);
        }
        if upright.azimuth.is_none() {
            upright.azimuth = Some([fit.azimuth_degrees, along.to_degrees()]);
        }
        upright.origin = Some(fit.origin);
    }
    Some(upright)
}

/// Normals of length one of the triangles that stand upright and face the cameras, in the rough frame, and their areas as the
/// cameras see them.
struct Walls {
    normals: Vec<(Vector3<f64>, f64)>,
}

impl Walls {
    fn new(made: &Reconstruction, rough: &Similarity) -> Self {
        let surface = &made.model.surface;
        let normals = surface.triangles.iter().filter_map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| rough.apply(&surface.vertices[vertex as usize].position));
            let normal = (b - a).cross(&(c - a));
            let area = normal.norm();
            // The cameras look along +y on the whole.
            let seen = -normal.y;
            (seen > 0.0 && normal.z.abs() <= LEVEL_SINE * area).then(|| (normal / area, seen))
        });
        Self { normals: normals.collect() }
    }

    /// The rotation that makes up of what is up.
    fn levelling(&self, made: &Reconstruction, rough: &Similarity) -> Option<Matrix3<f64>> {
        let stations: Vec<_> = made.stations.iter().flatten().collect();
        let mut level = Matrix3::zeros();
        for station in &stations {
            let across = rough.rotation * station.pose.view_from_model.row(0).transpose();
            level += across * across.transpose() / stations.len() as f64;
        }
        let mut up = Vector3::z();
        for slope in SLOPES {
            // Roofs and ledges lean all to one side: what slopes by more counts little.
            let weighed = self.normals.iter().map(|(normal, seen)| {
                let off = normal.dot(&up) / slope;
                (normal, seen / (1.0 + off * off))
            });
            let whole: f64 = weighed.clone().map(|(_, weight)| weight).sum();
            let walls: Matrix3<f64> =
                weighed.map(|(normal, weight)| normal * normal.transpose() * (weight / whole)).sum();
            let eigen = (level + walls).symmetric_eigen();
            let least = eigen.eigenvalues.imin();
            // One straight row of cameras before nothing upright leaves it open: the guess before stands.
            let others = (0..3).filter(|&axis| axis != least).map(|axis| eigen.eigenvalues[axis]);
            let certain = others.fold(f64::INFINITY, f64::min) > 4.0 * eigen.eigenvalues[least].max(1e-4);
            let found = eigen.eigenvectors.column(least).into_owned();
            let found = if found.z < 0.0 { -found } else { found };
            if !certain || found.z < 0.8 {
                break;
            }
            up = found;
        }
        Rotation3::rotation_between(&up, &Vector3::z()).map(Rotation3::into_inner)
    }

    /// The turn about z, radians, that lets the largest front face -y.
    fn front(&self, level: &Matrix3<f64>) -> f64 {
        // Azimuths of the outward normals, as angles from -y, and how much wall there is.
        let seen: Vec<(f64, f64)> = self
            .normals
            .iter()
            .map(|(normal, seen)| {
                let normal = level * normal;
                (libm::atan2(normal.x, -normal.y), *seen)
            })
            .collect();
        let whole: f64 = seen.iter().map(|(_, area)| area).sum();
        let window = SAME_FRONT_DEGREES.to_radians();
        let apart = |a: f64, b: f64| libm::remainder(a - b, std::f64::consts::TAU);
        let around = |angle: f64| seen.iter().filter(move |(other, _)| apart(*other, angle).abs() <= window);
        let candidates = (-75..=75).map(|degree| f64::from(degree).to_radians());
        let area = |angle: f64| around(angle).map(|(_, area)| area).sum::<f64>();
        let best = candidates.map(|angle| (area(angle), angle)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((share, angle)) = best.filter(|(share, _)| *share >= LEAST_FRONT * whole && whole > 0.0) else {
            return 0.0;
        };
        let mean = around(angle).map(|(other, area)| apart(*other, angle) * area).sum::<f64>() / share;
        // An outward normal at this angle from -y, counted from -y towards +x: turned back by it.
        -(angle + mean)
    }
}

/// The same map with a height of `metres` from the lowest to the highest point, but for one in a hundred.
fn taller(made: &Reconstruction, map: &Similarity, metres: f64) -> Option<Similarity> {
    let mut heights: Vec<f64> =
        made.model.surface.vertices.iter().map(|vertex| map.apply(&vertex.position).z).collect();
    order::ascending(&mut heights);
    let at = |share: f64| heights.get((heights.len() as f64 * share) as usize).copied().unwrap_or(0.0);
    let factor = metres / (at(0.99) - at(0.01));
    let Similarity { scale, rotation, translation } = *map;
    (factor.is_finite() && factor > 0.0).then(|| Similarity {
        scale: scale * factor,
        rotation,
        translation: translation * factor,
    })
}

/// The same map with the origin under the middle of the points, at their lowest but for one in a hundred.
fn grounded(made: &Reconstruction, map: &Similarity) -> Similarity {
    let points: Vec<Vector3<f64>> =
        made.model.surface.vertices.iter().map(|vertex| map.apply(&vertex.position)).collect();
    let at = |axis: usize, share: f64| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        order::ascending(&mut values);
        values.get((values.len() as f64 * share) as usize).copied().unwrap_or(0.0)
    };
    let middle = |axis: usize| f64::midpoint(at(axis, 0.01), at(axis, 0.99));
    let origin = Vector3::new(middle(0), middle(1), at(2, 0.01));
    Similarity { translation: map.translation - origin, ..*map }
}

/// How the cameras' places in the model fit those that the pictures say.
struct PlaceFit {
    /// Metres of the pictures' places per unit of the model.
    scale: f64,
    azimuth_degrees: f64,
    origin: [f64; 2],
    /// Root of the summed squared distances of the places from their middle, metres.
    spread: f64,
}

impl PlaceFit {
    /// The similarity of the plane with the least squares; `None` for places that say nothing.
    fn new(made: &Reconstruction, map: &Similarity, places: &[Option<[f64; 2]>]) -> Option<Self> {
        let pairs: Vec<(Vector2<f64>, Vector2<f64>)> = made
            .stations
            .iter()
            .zip(places)
            .filter_map(|(station, place)| {
                let model = map.apply(&station.as_ref()?.pose.position);
                Some((Vector2::new(model.x, model.y), Vector2::from((*place)?)))
            })
            .collect();
        let count = pairs.len() as f64;
        let middle = |sum: Vector2<f64>| sum / count;
        let model_middle = middle(pairs.iter().map(|pair| pair.0).sum());
        let place_middle = middle(pairs.iter().map(|pair| pair.1).sum());
        let (mut along, mut across, mut model_spread, mut spread) = (0.0, 0.0, 0.0, 0.0);
        for (model, place) in &pairs {
            let (m, p) = (model - model_middle, place - place_middle);
            along += m.dot(&p);
            across += m.x * p.y - m.y * p.x;
            model_spread += m.norm_squared();
            spread += p.norm_squared();
        }
        let spread = libm::sqrt(spread);
        if pairs.len() < 2 || spread < LEAST_SPREAD_M || !(model_spread > 0.0) {
            return None;
        }
        // The turn, counter-clockwise, from model to places.
        let turn = libm::atan2(across, along);
        let scale = libm::hypot(along, across) / model_spread;
        let (sin, cos) = (libm::sin(turn), libm::cos(turn));
        let shifted =
            Vector2::new(cos * model_middle.x - sin * model_middle.y, sin * model_middle.x + cos * model_middle.y)
                * scale;
        let origin = place_middle - shifted;
        // +y turned by it points to (-sin, cos): east, north.
        let azimuth_degrees = libm::atan2(-sin, cos).to_degrees().rem_euclid(360.0);
        Some(Self { scale, azimuth_degrees, origin: origin.into(), spread })
    }
}
