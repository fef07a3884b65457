//! Places of all cameras from matches alone: a first pair, then one view after the other, adjusted each time.

use std::fmt;

use daymark_core::camera::triangulate::{Sighting, triangulate};
use daymark_numerics::bundle::{Adjusted, Bundle, Common, Free, Observation};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::correspond::{MIN_INLIERS, MIN_SHARE, PairMatches};
use super::view::{Station, Track, View};
use crate::camera_file::distortion::Distortion;
use crate::camera_file::lens::{Lens, Pose};
use crate::order;

/// Why there is no motion. Each has the figure that decided.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoMotion {
    /// No pair of views shares enough.
    TooFewMatches {
        /// Look-alikes of the best pair.
        alike: usize,
        /// How many of them agree with one geometry.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The best pair is explained by a turn of the camera.
    OnlyRotation {
        /// The share of matches that the turn explains.
        share: f64,
    },
    /// The best pair is explained by one plane.
    Plane {
        /// The share of matches that the plane explains.
        share: f64,
    },
    /// The rays of all pairs are nearly parallel.
    SmallParallax {
        /// The largest median angle of a pair, degrees.
        degree: f64,
    },
}

impl fmt::Display for NoMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewMatches { alike, found, needed } => write!(
                f,
                "no two pictures share one geometry: of {alike} look-alikes of the best pair {found} agree, {needed} are \
                 needed; do they show the same building, from not too far apart?"
            ),
            Self::OnlyRotation { share } => write!(
                f,
                "the camera only turned: a rotation alone explains {:.0} % of the matches; step aside between pictures",
                share * 100.0
            ),
            Self::Plane { share } => write!(
                f,
                "everything matched lies in one plane ({:.0} % of the matches): the motion is not certain from that; \
                 take pictures that show two sides of the building, or give --cameras",
                share * 100.0
            ),
            Self::SmallParallax { degree } => write!(
                f,
                "the pictures were taken from nearly one place: the rays meet at {degree:.2} degrees, 1.5 are needed"
            ),
        }
    }
}

/// A turn that explains this share of the matches leaves no motion to be known.
const MAX_ROTATION: f64 = 0.85;
/// A plane that explains this share of the matches leaves the motion in doubt.
const MAX_PLANE: f64 = 0.92;
/// Least median parallax of the first pair, degrees.
const MIN_PARALLAX: f64 = 1.5;
/// Observations farther off are taken out, pixels.
const OUTLIER_PX: f64 = 4.0;
/// The same in the end.
const FINAL_OUTLIER_PX: f64 = 2.5;

/// An adjustment that is followed by another one ends with a step that lowers the cost by a smaller share.
const ROUGH: f64 = 1e-4;
/// The same for the last.
const FINE: f64 = 1e-7;

/// What was found.
#[derive(Debug, Clone)]
pub struct Motion {
    /// The lens of each view, adjusted if that was asked for.
    pub lenses: Vec<Lens>,
    /// Where each view was taken; `None` for those that could not be joined.
    pub stations: Vec<Option<Station>>,
    /// The tracks without the sightings that were taken out.
    pub tracks: Vec<Track>,
    /// Root mean square reprojection error, pixels.
    pub rms_px: f64,
    /// Observations that entered it.
    pub observations: usize,
    /// The first pair.
    pub first_pair: [usize; 2],
}

/// The pair to begin with: the most matches, times the parallax up to ten degrees.
///
/// # Errors
/// [`NoMotion`] if none is good enough: what the one with the most matches lacks.
fn first_pair(pairs: &[PairMatches]) -> Result<&PairMatches, NoMotion> {
    let certain = pairs.iter().filter(|pair| pair.share() >= MIN_SHARE);
    let usable = || certain.clone().filter_map(|pair| Some((pair, pair.estimate.as_ref()?)));
    let score = |pair: &PairMatches, parallax: f64| pair.matches.len() as f64 * parallax.min(10.0);
    let good = usable().filter(|(_, estimate)| {
        estimate.rotation_share < MAX_ROTATION
            && estimate.plane_share < MAX_PLANE
            && estimate.parallax_degree >= MIN_PARALLAX
    });
    let best = good.max_by(|a, b| score(a.0, a.1.parallax_degree).total_cmp(&score(b.0, b.1.parallax_degree)));
    if let Some((pair, _)) = best {
        return Ok(pair);
    }
    let Some((_, most)) = usable().max_by_key(|(pair, _)| pair.matches.len()) else {
        let best = pairs.iter().max_by_key(|pair| pair.agreeing);
        let (alike, found) = best.map_or((0, 0), |best| (best.alike, best.agreeing));
        let needed = MIN_INLIERS.max(libm::ceil(alike as f64 * MIN_SHARE) as usize);
        return Err(NoMotion::TooFewMatches { alike, found, needed });
    };
    Err(if most.rotation_share >= MAX_ROTATION {
        NoMotion::OnlyRotation { share: most.rotation_share }
    } else if most.plane_share >= MAX_PLANE {
        // Before the parallax: a plane makes that doubtful, too.
        NoMotion::Plane { share: most.plane_share }
    } else {
        NoMotion::SmallParallax { degree: most.parallax_degree }
    })
}

/// The places of the views. `free_lens` also adjusts one factor on all focal lengths and one radial distortion (three or
/// more views; lenses without distortion so far).
///
/// # Errors
/// [`NoMotion`].
pub fn motion(views: &[View], pairs: &[PairMatches], tracks: &[Track], free_lens: bool) -> Result<Motion, NoMotion> {
    let first = first_pair(pairs)?;
    let mut growth = Growth::new(views, pairs, tracks);
    growth.poses[first.views[0]] = Some(Pose::identity());
    let pose = first
        .estimate
        .as_ref()
        .map_or(Pose::identity(), |estimate| Pose::from_translation(estimate.pose.rotation, estimate.pose.direction));
    growth.poses[first.views[1]] = Some(pose);
    growth.order = first.views.to_vec();
    growth.triangulate();
    growth.adjust(Free::Motion, 15, ROUGH);
    while let Some(view) = growth.next_view() {
        if !growth.join(view) {
            growth.given_up[view] = true;
            continue;
        }
        growth.triangulate();
        growth.adjust(Free::Motion, 8, ROUGH);
        growth.remove_outliers(OUTLIER_PX);
    }
    let free = if free_lens && growth.order.len() > 2 { Free::MotionAndLens } else { Free::Motion };
    growth.adjust(free, 30, ROUGH);
    let mut result = Adjusted::default();
    for (limit, least_gain) in [(OUTLIER_PX, ROUGH), (FINAL_OUTLIER_PX, ROUGH), (FINAL_OUTLIER_PX, FINE)] {
        growth.remove_outliers(limit);
        growth.triangulate();
        growth.remove_outliers(limit);
        result = growth.adjust(free, 30, least_gain);
    }
    Ok(growth.finish(first.views, result))
}

/// The state while views join.
struct Growth<'a> {
    views: &'a [View],
    pairs: &'a [PairMatches],
    /// Sightings as pixels from the principal point, with the assumed lens, and whether they still count.
    tracks: Vec<Vec<(usize, [f64; 2], bool)>>,
    numbers: Vec<u32>,
    points: Vec<Option<Vector3<f64>>>,
    poses: Vec<Option<Pose>>,
    given_up: Vec<bool>,
    order: Vec<usize>,
    common: Common,
}

impl<'a> Growth<'a> {
    fn new(views: &'a [View], pairs: &'a [PairMatches], tracks: &[Track]) -> Self {
        let centred = |view: usize, at: [f64; 2]| {
            let [x, y] = views[view].lens.normalized_from_ideal(at);
            [x * focal(&views[view].lens), y * focal(&views[view].lens)]
        };
        Self {
            views,
            pairs,
            tracks: tracks
                .iter()
                .map(|track| track.sightings.iter().map(|&(view, at)| (view, centred(view, at), true)).collect())
                .collect(),
            numbers: tracks.iter().map(|track| track.number).collect(),
            points: vec![None; tracks.len()],
            poses: vec![None; views.len()],
            given_up: vec![false; views.len()],
            order: Vec::new(),
            common: Common { log_focal: 0.0, k1: 0.0 },
        }
    }

    /// The direction of a sighting with the lens as it is known now.
    fn direction(&self, view: usize, at: [f64; 2]) -> Option<[f64; 2]> {
        let focal = focal(&self.views[view].lens) * libm::exp(self.common.log_focal);
        Distortion::radial(self.common.k1, 0.0).simplified().undo(at.map(|c| c / focal))
    }

    /// Triangulates every track anew that two joined views see.
    fn triangulate(&mut self) {
        let stations: Vec<Option<Station>> = self
            .poses
            .iter()
            .map(|pose| {
                let unit = Lens { centre: [0.0; 2], ..Lens::of_focal(1, 1, 1.0) };
                Station::new(&unit, (*pose)?)
            })
            .collect();
        for (number, track) in self.tracks.iter().enumerate() {
            let seen: Vec<_> = track
                .iter()
                .filter(|sighting| sighting.2)
                .filter_map(|&(view, at, _)| {
                    Some(Sighting { camera: &stations[view].as_ref()?.pinhole, at: self.direction(view, at)? })
                })
                .collect();
            let found = triangulate(&seen, 1.0).ok().filter(|found| found.parallax_sine > 0.015);
            self.points[number] = found.map(|found| Vector3::from(found.position));
        }
    }

    /// Tracks with a point, their numbers, as a bundle of the joined views.
    fn bundle(&self) -> (Bundle, Vec<usize>) {
        let place = |view: usize| self.order.iter().position(|&joined| joined == view);
        let numbers: Vec<usize> = (0..self.tracks.len()).filter(|&number| self.points[number].is_some()).collect();
        let bundle = Bundle {
            poses: self.order.iter().map(|&view| self.poses[view].unwrap_or(Pose::identity())).collect(),
            points: numbers.iter().filter_map(|&number| self.points[number]).collect(),
            observations: numbers
                .iter()
                .map(|&number| {
                    let mut seen: Vec<Observation> = self.tracks[number]
                        .iter()
                        .filter(|sighting| sighting.2)
                        .filter_map(|&(view, at, _)| Some(Observation { camera: place(view)?, at }))
                        .collect();
                    order::sort_by_key(&mut seen, |observation| observation.camera);
                    seen
                })
                .collect(),
            focal: self.order.iter().map(|&view| focal(&self.views[view].lens)).collect(),
            common: self.common,
        };
        (bundle, numbers)
    }

    fn adjust(&mut self, free: Free, steps: usize, least_gain: f64) -> Adjusted {
        let (mut bundle, numbers) = self.bundle();
        let adjusted = bundle.adjust(free, steps, least_gain);
        for (&view, pose) in self.order.iter().zip(&bundle.poses) {
            self.poses[view] = Some(*pose);
        }
        for (&number, point) in numbers.iter().zip(&bundle.points) {
            self.points[number] = Some(*point);
        }
        self.common = bundle.common;
        adjusted
    }

    /// Takes out sightings that are off, and points that are left with fewer than two.
    fn remove_outliers(&mut self, limit: f64) {
        let (bundle, numbers) = self.bundle();
        for (at, &number) in numbers.iter().enumerate() {
            let off: Vec<(usize, f64)> = bundle.observations[at]
                .iter()
                .zip(bundle.distances(at))
                .map(|(observation, distance)| (self.order[observation.camera], distance))
                .collect();
            for sighting in &mut self.tracks[number] {
                if off.iter().any(|&(view, distance)| view == sighting.0 && distance > limit) {
                    sighting.2 = false;
                }
            }
            let left = self.tracks[number].iter().filter(|s| s.2 && self.poses[s.0].is_some()).count();
            if left < 2 {
                self.points[number] = None;
            }
        }
    }

    /// The view that sees the most points among those not joined yet.
    fn next_view(&self) -> Option<usize> {
        let sees = |view: usize| {
            let points = self.tracks.iter().zip(&self.points).filter(|(_, point)| point.is_some());
            points.filter(|(track, _)| track.iter().any(|sighting| sighting.0 == view)).count()
        };
        (0..self.views.len())
            .filter(|&view| self.poses[view].is_none() && !self.given_up[view])
            .map(|view| (sees(view), view))
            .filter(|(seen, _)| *seen >= 12)
            .max_by_key(|&(seen, view)| (seen, usize::MAX - view))
            .map(|(_, view)| view)
    }

    /// Finds a view's place from its pairs with joined views: their turn and direction, with the length that fits the
    /// points; then the best of them, adjusted.
    fn join(&mut self, view: usize) -> bool {
        let mut best: Option<(usize, Pose)> = None;
        for pair in self.pairs {
            let Some(estimate) = &pair.estimate else { continue };
            let [a, b] = pair.views;
            let (neighbour, rotation, shift) = if b == view {
                (a, estimate.pose.rotation, estimate.pose.direction)
            } else if a == view {
                let back = estimate.pose.rotation.transpose();
                (b, back, -(back * estimate.pose.direction))
            } else {
                continue;
            };
            let Some(base) = self.poses[neighbour] else { continue };
            let Some(pose) = self.with_length(view, &base, &rotation, &shift) else { continue };
            let agreeing = self.agreeing(view, &pose, 8.0);
            if best.as_ref().is_none_or(|best| agreeing > best.0) {
                best = Some((agreeing, pose));
            }
        }
        let Some((agreeing, pose)) = best.filter(|best| best.0 >= 10) else { return false };
        self.poses[view] = Some(pose);
        self.order.push(view);
        self.adjust(Free::Camera(self.order.len() - 1), 40, ROUGH);
        let now = self.poses[view].map_or(0, |pose| self.agreeing(view, &pose, OUTLIER_PX));
        if now < 10 || now * 3 < agreeing {
            self.poses[view] = None;
            self.order.pop();
            return false;
        }
        true
    }

    /// `x = R y + s t` for points y of the neighbour's frame: each gives an `s`, the median counts.
    fn with_length(&self, view: usize, base: &Pose, rotation: &Matrix3<f64>, shift: &Vector3<f64>) -> Option<Pose> {
        let mut lengths = Vec::new();
        for (track, point) in self.tracks.iter().zip(&self.points) {
            let (Some(point), Some(&(_, at, _))) = (point, track.iter().find(|sighting| sighting.0 == view)) else {
                continue;
            };
            let Some([x, y]) = self.direction(view, at) else { continue };
            let ray = Vector3::new(x, y, 1.0);
            // ray x (R p + s t) = 0, by least squares over its three rows.
            let (a, b) = (ray.cross(shift), ray.cross(&(rotation * base.to_view(point))));
            let length = -a.dot(&b) / a.norm_squared();
            if length.is_finite() && a.norm_squared() > 1e-12 {
                lengths.push(length);
            }
        }
        if lengths.len() < 8 {
            return None;
        }
        order::ascending(&mut lengths);
        let length = lengths[lengths.len() / 2];
        let turned = rotation * base.view_from_model;
        let translation = rotation * base.translation() + shift * length;
        Some(Pose::from_translation(turned, translation))
    }

    fn agreeing(&self, view: usize, pose: &Pose, limit: f64) -> usize {
        let focal = focal(&self.views[view].lens);
        let near = |track: &Vec<(usize, [f64; 2], bool)>, point: &Option<Vector3<f64>>| {
            let (Some(point), Some(&(_, at, _))) = (point, track.iter().find(|sighting| sighting.0 == view)) else {
                return false;
            };
            let Some([x, y]) = self.direction(view, at) else { return false };
            let seen = pose.to_view(point);
            let (dx, dy) = (seen.x / seen.z - x, seen.y / seen.z - y);
            seen.z > 0.0 && (dx * dx + dy * dy) * focal * focal < limit * limit
        };
        self.tracks.iter().zip(&self.points).filter(|(track, point)| near(track, point)).count()
    }

    fn finish(self, first_pair: [usize; 2], adjusted: Adjusted) -> Motion {
        let lenses: Vec<Lens> = self
            .views
            .iter()
            .map(|view| {
                let factor = libm::exp(self.common.log_focal);
                let distortion = match self.common.k1 {
                    0.0 => view.lens.distortion,
                    k1 => Distortion::radial(k1, 0.0),
                };
                Lens { focal: view.lens.focal.map(|focal| focal * factor), distortion, ..view.lens }
            })
            .collect();
        let stations = self.poses.iter().zip(&lenses).map(|(pose, lens)| Station::new(lens, (*pose)?)).collect();
        let mut tracks = Vec::new();
        for ((track, point), &number) in self.tracks.iter().zip(&self.points).zip(&self.numbers) {
            if point.is_none() {
                continue;
            }
            let sightings: Vec<(usize, [f64; 2])> = track
                .iter()
                .filter(|sighting| sighting.2 && self.poses[sighting.0].is_some())
                .filter_map(|&(view, at, _)| {
                    Some((view, lenses[view].ideal_from_normalized(self.direction(view, at)?)))
                })
                .collect();
            if sightings.len() > 1 {
                tracks.push(Track { number, sightings });
            }
        }
        Motion { lenses, stations, tracks, rms_px: adjusted.rms_px, observations: adjusted.observations, first_pair }
    }
}

fn focal(lens: &Lens) -> f64 {
    f64::midpoint(lens.focal[0], lens.focal[1])
}
