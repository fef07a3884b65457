//! Which features of which views are the same point: look-alikes, checked by epipolar geometry, joined to tracks.

use daymark_numerics::align::{Aligner, smoothed};
use daymark_numerics::epipolar::{Estimate, Pair, RelativePose, relative_pose};
use daymark_numerics::look_alike::{ViewFeatures, guided_matches, mutual_matches};
use serde::Serialize;

use super::explain::{Explained, LeftOut, Reason};
use super::factorize::affine_inliers;
use super::view::{Station, Track, View};
use crate::camera_file::lens::Lens;
use crate::parallel;

/// Distance from the epipolar line within which a match is right, pixels of the working size.
pub const INLIER_PX: f64 = 1.5;
/// Fewer agreeing matches may be chance: a pair of views with fewer is not used.
pub const MIN_INLIERS: usize = 24;
/// Look-alikes of different buildings agree by chance and by their horizontal rows of windows: a quarter of them did. The pair
/// that a model begins with, or that shows that cameras are right, must have more.
pub const MIN_SHARE: f64 = 0.4;
/// The same for pairs that join what is certain already.
const MIN_JOINING_SHARE: f64 = 0.15;

/// What became of the matches of a pair of views.
#[derive(Debug, Clone)]
pub struct PairMatches {
    /// The views.
    pub views: [usize; 2],
    /// Look-alikes before any geometry.
    pub alike: usize,
    /// How many of them agree with the pair's geometry.
    pub agreeing: usize,
    /// Numbers of the features that match, one of each view: those that agree, and those found with the geometry's help.
    pub matches: Vec<[u32; 2]>,
    /// The relative pose; `None` if the views do not share enough.
    pub estimate: Option<Estimate>,
    /// Look-alikes that were removed, and why.
    pub left_out: Vec<([u32; 2], Reason)>,
}

impl PairMatches {
    /// The share of the look-alikes that agree.
    pub fn share(&self) -> f64 {
        self.agreeing as f64 / self.alike.max(1) as f64
    }
}

/// Why matches were removed, over all pairs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct RemovedMatches {
    /// Look-alikes of pairs of views without a common geometry.
    pub pair_without_geometry: usize,
    /// Off the epipolar line, or behind a camera.
    pub off_epipolar_line: usize,
    /// Tracks that hold two features of one view: some match in them is wrong.
    pub contradicting_tracks: usize,
}

/// Which geometry checks matches.
#[derive(Debug, Clone, Copy)]
pub enum Geometry<'a> {
    /// Known cameras, one a view.
    Known(&'a [Option<Station>]),
    /// Known lenses: the essential matrix of each pair.
    Lenses,
    /// Nothing: the affine epipolar geometry of each pair, good where the building is far away for its depth.
    Affine,
}

/// Distance from the affine epipolar line within which a match is right, pixels: perspective bends the lines.
const AFFINE_INLIER_PX: f64 = 4.0;

/// Matches of every pair of views, checked by `geometry`. The seed of each pair's samples depends on the pair only.
pub fn pairs(views: &[View], features: &[ViewFeatures], geometry: Geometry<'_>) -> Vec<PairMatches> {
    let all: Vec<[usize; 2]> = (0..views.len()).flat_map(|a| (a + 1..views.len()).map(move |b| [a, b])).collect();
    parallel::map(&all, |&pair| matched(pair, views, features, geometry))
}

fn matched([a, b]: [usize; 2], views: &[View], features: &[ViewFeatures], geometry: Geometry<'_>) -> PairMatches {
    let (one, other) = (&features[a], &features[b]);
    let mut alike = mutual_matches(one, other);
    alike.retain(|&[i, j]| one.ideal[i as usize][0].is_finite() && other.ideal[j as usize][0].is_finite());
    let (left, right) = (&views[a].lens, &views[b].lens);
    let direction = |[i, j]: [u32; 2]| -> Pair {
        [left.normalized_from_ideal(one.ideal[i as usize]), right.normalized_from_ideal(other.ideal[j as usize])]
    };
    let directions: Vec<Pair> = alike.iter().map(|&pair| direction(pair)).collect();
    let threshold = 2.0 * INLIER_PX / (left.focal[0] + right.focal[0]);
    let none = |agreeing| {
        let left_out = alike.iter().map(|&pair| (pair, Reason::PairWithoutGeometry)).collect();
        PairMatches { views: [a, b], alike: alike.len(), agreeing, matches: Vec::new(), estimate: None, left_out }
    };
    let seed = (a * 65_536 + b) as u64;
    let estimate = match geometry {
        Geometry::Known(stations) => match (stations[a], stations[b]) {
            (Some(one), Some(other)) => known(&one, &other, &directions, threshold),
            _ => None,
        },
        Geometry::Lenses => relative_pose(&directions, threshold, seed),
        Geometry::Affine => {
            let at = |[i, j]: [u32; 2]| [one.ideal[i as usize], other.ideal[j as usize]];
            let images: Vec<_> = alike.iter().map(|&pair| at(pair)).collect();
            let inliers = affine_inliers(&images, AFFINE_INLIER_PX, seed);
            if inliers.len() < MIN_INLIERS {
                return none(inliers.len());
            }
            let matches: Vec<[u32; 2]> = inliers.iter().map(|&number| alike[number]).collect();
            let left_out = others(alike.len(), &inliers)
                .map(|number| (alike[number], Reason::OffEpipolarLine { distance_px: None }))
                .collect();
            let (alike, agreeing) = (alike.len(), inliers.len());
            return PairMatches { views: [a, b], alike, agreeing, matches, estimate: None, left_out };
        }
    };
    let agreeing = estimate.as_ref().map_or(0, |estimate| estimate.inliers.len());
    let enough = agreeing >= MIN_INLIERS && agreeing as f64 >= MIN_JOINING_SHARE * alike.len() as f64;
    let Some(mut estimate) = estimate.filter(|_| enough) else { return none(agreeing) };
    let mut matches: Vec<[u32; 2]> = estimate.inliers.iter().map(|&number| alike[number]).collect();
    let left_out = others(alike.len(), &estimate.inliers)
        .map(|number| {
            let off = libm::sqrt(estimate.pose.squared_distance(&directions[number]));
            let distance_px = Some(off * INLIER_PX / threshold);
            (
                alike[number],
                if off < threshold { Reason::BehindCamera } else { Reason::OffEpipolarLine { distance_px } },
            )
        })
        .collect();
    // With the geometry known, look-alikes that were not clear before may be now.
    let limit = threshold * threshold;
    let all = |lens: &Lens, ideal: &[[f64; 2]]| -> Vec<[f64; 2]> {
        ideal.iter().map(|&at| lens.normalized_from_ideal(at)).collect()
    };
    let lines = estimate.pose.lines(&all(left, &one.ideal), &all(right, &other.ideal));
    for pair in guided_matches(one, other, &matches, &lines, limit) {
        if estimate.pose.depths(&direction(pair)).is_some_and(|[a, b]| a > 0.0 && b > 0.0) {
            matches.push(pair);
        }
    }
    let refined: Vec<Pair> = matches.iter().map(|&pair| direction(pair)).collect();
    if matches!(geometry, Geometry::Lenses) {
        estimate.pose = estimate.pose.refined(&refined, threshold / 2.0, 10);
    }
    PairMatches { views: [a, b], alike: alike.len(), agreeing, matches, estimate: Some(estimate), left_out }
}

/// The numbers below `count` that are not among these ascending ones.
fn others(count: usize, numbers: &[usize]) -> impl Iterator<Item = usize> + '_ {
    (0..count).filter(|number| numbers.binary_search(number).is_err())
}

/// The same with a geometry that is known.
fn known(one: &Station, other: &Station, directions: &[Pair], threshold: f64) -> Option<Estimate> {
    let rotation = other.pose.view_from_model * one.pose.view_from_model.transpose();
    let shift = other.pose.to_view(&one.pose.position);
    if !(shift.norm() > 0.0) {
        return None;
    }
    let pose = RelativePose { rotation, direction: shift.normalize() };
    let inliers: Vec<usize> = (0..directions.len())
        .filter(|&number| {
            let pair = &directions[number];
            pose.squared_distance(pair) < threshold * threshold
                && pose.depths(pair).is_some_and(|[a, b]| a > 0.0 && b > 0.0)
        })
        .collect();
    Some(Estimate { pose, inliers, parallax_degree: 0.0, rotation_share: 0.0, plane_share: 0.0 })
}

/// Joins matches to tracks: one feature a view and track; the others are wrong somewhere and go.
pub fn tracks(features: &[ViewFeatures], pairs: &[PairMatches]) -> (Vec<Track>, RemovedMatches) {
    let (tracks, removed, _) = tracks_explained(features, pairs);
    (tracks, removed)
}

/// The same, with what was left out one by one.
pub fn tracks_explained(features: &[ViewFeatures], pairs: &[PairMatches]) -> (Vec<Track>, RemovedMatches, Explained) {
    let mut removed = RemovedMatches::default();
    let mut explained = Explained::default();
    for pair in pairs {
        let [a, b] = pair.views;
        let told = pair.left_out.iter().map(|&([i, j], reason)| {
            LeftOut::new(&[(a, features[a].ideal[i as usize]), (b, features[b].ideal[j as usize])], reason)
        });
        explained.extend(pair.left_out.len(), told);
    }
    let mut first = vec![0_usize];
    for view in features {
        first.push(first[first.len() - 1] + view.points.len());
    }
    let mut parent: Vec<usize> = (0..first[features.len()]).collect();
    for pair in pairs {
        if pair.matches.is_empty() {
            removed.pair_without_geometry += pair.alike;
            continue;
        }
        removed.off_epipolar_line += pair.alike - pair.agreeing;
        for &[i, j] in &pair.matches {
            let a = root(&mut parent, first[pair.views[0]] + i as usize);
            let b = root(&mut parent, first[pair.views[1]] + j as usize);
            // The least number is the root, whatever the order of the matches.
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut groups: std::collections::BTreeMap<usize, Vec<(usize, [f64; 2])>> = std::collections::BTreeMap::new();
    for (view, found) in features.iter().enumerate() {
        for (number, at) in found.ideal.iter().enumerate() {
            let node = root(&mut parent, first[view] + number);
            groups.entry(node).or_default().push((view, *at));
        }
    }
    let mut tracks = Vec::new();
    let mut contradicting = Vec::new();
    for sightings in groups.into_values().filter(|sightings| sightings.len() > 1) {
        // Ascending by view, because nodes are.
        if sightings.windows(2).any(|two| two[0].0 == two[1].0) {
            contradicting.push(LeftOut::new(&sightings, Reason::Contradiction));
        } else {
            tracks.push(Track { number: tracks.len() as u32 + 1, sightings });
        }
    }
    removed.contradicting_tracks = contradicting.len();
    explained.extend(contradicting.len(), contradicting.into_iter());
    (tracks, removed, explained)
}

/// Moves the sightings of each track to where their pictures show what the first one does, as far as that can be told.
pub fn align(views: &[View], tracks: &mut [Track]) {
    let aligner = Aligner::default();
    let smooth = parallel::map(views, |view| smoothed(&view.gray));
    let aligned = parallel::map(tracks, |track| {
        let mut sightings = track.sightings.clone();
        let Some((&mut (first, at), others)) = sightings.split_first_mut() else { return sightings };
        let Some(patch) = aligner.patch(&smooth[first], views[first].lens.picture_from_ideal(at)) else {
            return sightings;
        };
        for (number, at) in others {
            let view = &views[*number];
            let found = patch.found_in(&smooth[*number], view.lens.picture_from_ideal(*at));
            *at = found.and_then(|found| view.lens.ideal_from_picture(found)).unwrap_or(*at);
        }
        sightings
    });
    for (track, sightings) in tracks.iter_mut().zip(aligned) {
        track.sightings = sightings;
    }
}

fn root(parent: &mut [usize], mut node: usize) -> usize {
    while parent[node] != node {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::towers::{Conditions, TowerViews, TrueSurface};
    use crate::synthesize::features::features;
    use crate::synthesize::triangulate::{Rules, points};
    use daymark_fixtures::{Light, Tower};

    #[test]
    fn aligned_corners_lie_nearer_to_the_surface() {
        let tower = &Tower::eight()[0];
        let conditions = Conditions { light: Light::morning(), seed: 301, farther: 1.0 };
        let seen = TowerViews::new(tower, &[-8.0, 10.0], &conditions, false);
        let surface = TrueSurface::new(tower);
        let found: Vec<_> = seen.views().iter().map(|view| features(view).unwrap()).collect();
        let matches = pairs(seen.views(), &found, Geometry::Known(seen.stations()));
        let (mut tracks, _) = tracks(&found, &matches);
        let median = |tracks: &[Track]| {
            let (vertices, _) = points(tracks, seen.stations(), &Rules::default());
            surface.distances(vertices.into_iter().map(|vertex| vertex.position))[0]
        };
        let before = median(&tracks);
        align(seen.views(), &mut tracks);
        let after = median(&tracks);
        assert!(after < 0.6 * before, "{before} m, then {after} m");
    }
}
