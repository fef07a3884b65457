//! The whole way: pictures and what is known of their cameras become a model.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use daymark_numerics::epipolar::relative_pose;
use daymark_numerics::look_alike::ViewFeatures;
use serde::Serialize;

use super::correspond::{self, Geometry, PairMatches, RemovedMatches};
use super::explain::{Explained, LeftOut, Reason};
use super::factorize::{NoShape, factorize};
use super::features::features;
use super::model::Model;
use super::motion::{NoMotion, motion};
use super::triangulate::Rules;
use super::view::{Station, Track, View};
use crate::camera_file::lens::Pose;
use crate::order;
use crate::parallel;

/// Where correspondences come from.
#[derive(Debug, Clone)]
pub enum Corners {
    /// The project's own corners and signatures.
    Automatic,
    /// Numbered corners of each view, pixels of the working size.
    Picked(Vec<BTreeMap<u32, [f64; 2]>>),
}

/// What is known of the cameras, beside their lenses.
#[derive(Debug, Clone)]
pub enum Cameras {
    /// Their places.
    Known(Vec<Pose>),
    /// Nothing; `free_lens` if focal length and distortion are guesses.
    Unknown {
        /// Whether to adjust them.
        free_lens: bool,
    },
    /// Not even a focal length: affine cameras.
    Affine,
}

/// A model that was made, with what led to it.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    /// The views, with the lenses that were found.
    pub views: Vec<View>,
    /// Where they were taken.
    pub stations: Vec<Option<Station>>,
    /// The model.
    pub model: Model,
    /// What each pair of views shares.
    pub pairs: Vec<PairFacts>,
    /// Why matches were removed.
    pub removed: RemovedMatches,
    /// Tracks that entered.
    pub tracks: usize,
    /// What lengths and angles mean.
    pub shape: Shape,
    /// Matches and tracks that were left out, one by one.
    pub explained: Explained,
}

/// What lengths and angles of a model mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Lengths have the unit of the cameras' file.
    Metric,
    /// Right up to scale.
    UpToScale,
    /// Right up to scale and mirroring in depth: weak perspective.
    UpToMirror,
    /// Right up to an affine map: neither lengths nor angles mean anything.
    Affine,
}

/// What a pair of views shares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairFacts {
    /// The views, from 1.
    pub views: [usize; 2],
    /// Look-alikes.
    pub alike: usize,
    /// How many of them agree with the pair's geometry.
    pub agreeing: usize,
    /// Those, and those found with the geometry's help.
    pub matches: usize,
    /// Median angle between rays, degrees; 0 if cameras were known.
    pub parallax_degree: f64,
    /// Share of the matches that one plane explains; 0 if cameras were known.
    pub plane_share: f64,
}

/// Why there is no model.
#[derive(Debug, Clone, PartialEq)]
pub enum NoModel {
    /// The motion of the camera cannot be known.
    Motion(NoMotion),
    /// Without a focal length there is no shape.
    Shape(NoShape),
    /// Cameras are known, and do not fit the pictures.
    OtherCameras {
        /// Look-alikes of the best pair.
        alike: usize,
        /// How many of them agree with the cameras.
        agreeing: usize,
    },
    /// Fewer than three points, or none that span a triangle.
    TooFewPoints {
        /// Points.
        points: usize,
        /// Tracks that were refused.
        refused: super::triangulate::Refusals,
    },
    /// A picture that core cannot read.
    Picture(String),
}

impl fmt::Display for NoModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Motion(reason) => reason.fmt(f),
            Self::Shape(reason) => reason.fmt(f),
            Self::OtherCameras { alike, agreeing } => write!(
                f,
                "the cameras are not those of these pictures: of {alike} look-alikes of the best pair only {agreeing} agree \
                 with them"
            ),
            Self::TooFewPoints { points, refused } => write!(
                f,
                "only {points} points could be placed, too few for a surface; refused: {} with too small a parallax, {} with \
                 too large a reprojection error, {} behind a camera",
                refused.small_parallax, refused.large_error, refused.behind_camera
            ),
            Self::Picture(what) => f.write_str(what),
        }
    }
}

/// Makes the model.
///
/// # Errors
/// [`NoModel`], with the figure that decided.
pub fn reconstruct(
    views: Vec<View>,
    cameras: &Cameras,
    corners: &Corners,
    rules: &Rules,
) -> Result<Reconstruction, NoModel> {
    let stations: Option<Vec<Option<Station>>> = match cameras {
        Cameras::Known(poses) => {
            Some(views.iter().zip(poses).map(|(view, pose)| Station::new(&view.lens, *pose)).collect())
        }
        Cameras::Unknown { .. } | Cameras::Affine => None,
    };
    let geometry = match (&stations, cameras) {
        (Some(stations), _) => Geometry::Known(stations),
        (None, Cameras::Affine) => Geometry::Affine,
        (None, _) => Geometry::Lenses,
    };
    let (matches, tracks, removed, mut explained) = correspondences(&views, geometry, corners)?;
    let facts = matches
        .iter()
        .map(|pair| PairFacts {
            views: pair.views.map(|view| view + 1),
            alike: pair.alike,
            agreeing: pair.agreeing,
            matches: pair.matches.len(),
            parallax_degree: pair.estimate.as_ref().map_or(0.0, |estimate| estimate.parallax_degree),
            plane_share: pair.estimate.as_ref().map_or(0.0, |estimate| estimate.plane_share),
        })
        .collect();
    let mut shape = Shape::UpToScale;
    let mut rules = *rules;
    let all = tracks;
    let (views, stations, tracks) = match (cameras, stations) {
        (Cameras::Affine, _) => {
            let found = factorize(&all, views.len()).map_err(NoModel::Shape)?;
            shape = if found.metric { Shape::UpToMirror } else { Shape::Affine };
            // Angles mean nothing yet, and perspective is an error here.
            rules.max_reprojection_px = rules.max_reprojection_px.max(3.0 * found.rms_px);
            if !found.metric {
                rules.min_parallax_degree = 0.0;
            }
            (views, found.stations, found.tracks)
        }
        (Cameras::Unknown { free_lens }, _) => {
            let found = motion(&views, &matches, &all, *free_lens).map_err(NoModel::Motion)?;
            let views = views.into_iter().zip(found.lenses).map(|(view, lens)| View { lens, ..view }).collect();
            (views, found.stations, found.tracks)
        }
        (Cameras::Known(_), stations) => {
            shape = Shape::Metric;
            // The pair with the most look-alikes tells whether the cameras are these pictures'.
            if let (Some(best), Corners::Automatic) = (matches.iter().max_by_key(|pair| pair.alike), corners)
                && (best.agreeing < correspond::MIN_INLIERS || best.share() < correspond::MIN_SHARE)
            {
                return Err(NoModel::OtherCameras { alike: best.alike, agreeing: best.agreeing });
            }
            (views, stations.unwrap_or_default(), all.clone())
        }
    };
    let kept: BTreeSet<u32> = tracks.iter().map(|track| track.number).collect();
    let lost = || all.iter().filter(|track| !kept.contains(&track.number));
    explained.extend(lost().count(), lost().map(|track| LeftOut::new(&track.sightings, Reason::NotAdjusted)));
    let order = mesh_pairs(&tracks, views.len());
    let spacing = if matches!(corners, Corners::Automatic) { AUTOMATIC_SPACING_PX } else { 0.0 };
    let model = Model::new(&views, &stations, &tracks, &order, &rules, spacing);
    if model.surface.triangles.is_empty() {
        return Err(NoModel::TooFewPoints { points: model.surface.vertices.len(), refused: model.refused });
    }
    let refused = model.refused_tracks.iter().map(|&(number, why)| LeftOut::new(&tracks[number].sightings, why));
    explained.extend(model.refused_tracks.len(), refused);
    Ok(Reconstruction { views, stations, model, pairs: facts, removed, tracks: tracks.len(), shape, explained })
}

/// Automatic corners closer than this do not both carry the surface, pixels: their noise would fold it.
const AUTOMATIC_SPACING_PX: f64 = 7.0;

type Found = (Vec<PairMatches>, Vec<Track>, RemovedMatches, Explained);

fn correspondences(views: &[View], geometry: Geometry<'_>, corners: &Corners) -> Result<Found, NoModel> {
    match corners {
        Corners::Automatic => {
            let found: Vec<ViewFeatures> = parallel::try_map(views, |view| {
                features(view).map_err(|error| NoModel::Picture(format!("{}: {error}", view.name)))
            })?;
            let pairs = correspond::pairs(views, &found, geometry);
            let (mut tracks, removed, explained) = correspond::tracks_explained(&found, &pairs);
            correspond::align(views, &mut tracks);
            Ok((pairs, tracks, removed, explained))
        }
        Corners::Picked(corners) => {
            let mut tracks: BTreeMap<u32, Track> = BTreeMap::new();
            for (number, (view, corners)) in views.iter().zip(corners).enumerate() {
                for (&corner, &at) in corners {
                    if let Some(ideal) = view.lens.ideal_from_picture(at) {
                        let track =
                            tracks.entry(corner).or_insert_with(|| Track { number: corner, sightings: Vec::new() });
                        track.sightings.push((number, ideal));
                    }
                }
            }
            let tracks: Vec<Track> = tracks.into_values().filter(|track| track.sightings.len() > 1).collect();
            let pairs = picked_pairs(views, &tracks, !matches!(geometry, Geometry::Lenses));
            Ok((pairs, tracks, RemovedMatches::default(), Explained::default()))
        }
    }
}

/// Pairs of views by numbered corners; numbers of "features" are numbers of tracks.
fn picked_pairs(views: &[View], tracks: &[Track], known: bool) -> Vec<PairMatches> {
    let all: Vec<[usize; 2]> = (0..views.len()).flat_map(|a| (a + 1..views.len()).map(move |b| [a, b])).collect();
    parallel::map(&all, |&[a, b]| {
        let shared: Vec<(u32, [[f64; 2]; 2])> = (0..)
            .zip(tracks)
            .filter_map(|(number, track)| Some((number, [track.seen_by(a)?, track.seen_by(b)?])))
            .collect();
        let (left, right) = (&views[a].lens, &views[b].lens);
        let directions: Vec<_> = shared
            .iter()
            .map(|(_, [p, q])| [left.normalized_from_ideal(*p), right.normalized_from_ideal(*q)])
            .collect();
        let threshold = 2.0 * 2.0 * correspond::INLIER_PX / (left.focal[0] + right.focal[0]);
        let estimate = if known { None } else { relative_pose(&directions, threshold, (a * 65_536 + b) as u64) };
        let matches = shared.iter().map(|(number, _)| [*number; 2]).collect();
        let agreeing = estimate.as_ref().map_or(shared.len(), |estimate| estimate.inliers.len());
        PairMatches { views: [a, b], alike: shared.len(), agreeing, matches, estimate, left_out: Vec::new() }
    })
}

/// Pairs of views whose surfaces are joined, those that share the most first: each view with the view that it shares the
/// most with.
fn mesh_pairs(tracks: &[Track], views: usize) -> Vec<[usize; 2]> {
    let mut shared = vec![vec![0_usize; views]; views];
    for track in tracks {
        for &(a, _) in &track.sightings {
            for &(b, _) in &track.sightings {
                shared[a][b] += usize::from(a != b);
            }
        }
    }
    let mut pairs: Vec<(usize, [usize; 2])> = (0..views)
        .filter_map(|view| {
            let partner = (0..views).max_by_key(|&other| (shared[view][other], usize::MAX - other))?;
            (shared[view][partner] >= 3).then_some((shared[view][partner], [view, partner]))
        })
        .collect();
    order::sort_by_key(&mut pairs, |&(count, pair)| (usize::MAX - count, pair));
    pairs.into_iter().map(|(_, pair)| pair).collect()
}
