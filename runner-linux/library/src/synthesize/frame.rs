//! The frame of a model whose cameras were not known: upright, its front towards the cameras, in metres if anything says
//! how long a metre is.

use nalgebra::{Matrix3, Vector3};

use super::reconstruct::Reconstruction;
use super::view::Station;
use crate::camera_file::lens::Pose;
use crate::classify::cloud::Similarity;
use crate::order;

/// What says how long a metre is.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// Nothing: lengths are multiples of the distance between the first two cameras.
    None,
    /// This many metres are one unit.
    Factor(f64),
    /// The distance between the first two views' cameras, metres.
    Distance(f64),
    /// The height of what the model shows, metres.
    Height(f64),
    /// Where some of the views were taken: east, north in metres.
    Places(Vec<Option<[f64; 2]>>),
}

/// Places closer than this say nothing: receivers err by several metres.
const MIN_PLACES_APART: f64 = 25.0;

/// The similarity to the upright frame: z is the cameras' mean up, the front faces -y, the origin lies under the middle of
/// the points at their lowest (one in a hundred may be lower). `None` if the views that a scale needs were not joined.
pub fn upright(made: &Reconstruction, scale: &Scale) -> Option<Similarity> {
    let poses: Vec<&Pose> = made.stations.iter().flatten().map(|station| &station.pose).collect();
    let mean = |row: usize, sign: f64| {
        poses.iter().fold(Vector3::zeros(), |sum, pose| sum + pose.view_from_model.row(row).transpose() * sign)
    };
    let up = mean(1, -1.0).try_normalize(1e-9)?;
    let forward = mean(2, 1.0);
    let forward = (forward - up * forward.dot(&up)).try_normalize(1e-9)?;
    let right = forward.cross(&up);
    let rotation = Matrix3::from_rows(&[right.transpose(), forward.transpose(), up.transpose()]);
    let turned: Vec<Vector3<f64>> =
        made.model.surface.vertices.iter().map(|vertex| rotation * vertex.position).collect();
    let range = |axis: usize| {
        let mut values: Vec<f64> = turned.iter().map(|point| point[axis]).collect();
        order::ascending(&mut values);
        let at = |share: f64| values.get((values.len() as f64 * share) as usize).copied().unwrap_or(0.0);
        [at(0.01), at(0.99)]
    };
    let centre = |view: usize| made.stations.get(view).copied().flatten().map(|station| station.pose.position);
    let apart = |a: usize, b: usize| Some((centre(a)? - centre(b)?).norm());
    let factor = match scale {
        Scale::None => 1.0 / apart(0, 1).filter(|length| *length > 0.0).unwrap_or(1.0),
        Scale::Factor(factor) => *factor,
        Scale::Distance(metres) => metres / apart(0, 1)?,
        Scale::Height(metres) => metres / (range(2)[1] - range(2)[0]),
        Scale::Places(places) => {
            let mut factors = Vec::new();
            for (a, one) in places.iter().enumerate() {
                for (b, other) in places.iter().enumerate().skip(a + 1) {
                    let (Some(one), Some(other)) = (one, other) else { continue };
                    let metres = libm::hypot(one[0] - other[0], one[1] - other[1]);
                    if let Some(length) = apart(a, b).filter(|length| *length > 0.0 && metres >= MIN_PLACES_APART) {
                        factors.push(metres / length);
                    }
                }
            }
            order::ascending(&mut factors);
            *factors.get(factors.len() / 2)?
        }
    };
    if !(factor.is_finite() && factor > 0.0) {
        return None;
    }
    let middle = |axis: usize| f64::midpoint(range(axis)[0], range(axis)[1]);
    let origin = Vector3::new(middle(0), middle(1), range(2)[0]);
    Some(Similarity { scale: factor, rotation, translation: -origin * factor })
}

/// Takes the whole reconstruction to another frame.
pub fn moved(made: &mut Reconstruction, map: &Similarity) {
    for vertex in &mut made.model.surface.vertices {
        vertex.position = map.apply(&vertex.position);
        vertex.covariance = map.rotation * vertex.covariance * map.rotation.transpose() * (map.scale * map.scale);
    }
    for (station, view) in made.stations.iter_mut().zip(&made.views) {
        if let Some(old) = station {
            let pose = Pose {
                view_from_model: old.pose.view_from_model * map.rotation.transpose(),
                position: map.apply(&old.pose.position),
            };
            *station = Station::new(&view.lens, pose);
        }
    }
}
