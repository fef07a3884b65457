//! What the fixes of the walk are worth.

use daymark_core::camera::Intrinsics;
use daymark_core::camera::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use daymark_core::fix::track::{Track as Filter, Update};
use daymark_core::fix::{Fix, Site};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::{Corner, Scene};
use serde::Serialize;

use super::walk::{LENS, Spoil, Stop, by_chance, by_place, correspondences, site, town};
use crate::order;
use crate::parallel;

/// Correspondences of all towers of a frame.
const POINTS: usize = 512;
/// Chi-square with two degrees of freedom, 95 %.
const CHI_SQUARE_95: f64 = 5.991_464_547_107_979;
/// A tower is used beside others from so many corners on.
const LEAST_CORNERS: usize = 8;
/// Corners of a wrong model are matched with corners of the frame this near.
const REACH_PX: f64 = 15.0;
/// Speed of the observer, metres a second; a frame a second.
const SPEED_M_S: f64 = 1.5;

/// A pose of the walk with its fix.
pub(super) struct Case {
    /// Share of the frame that the tower takes.
    pub(super) share: f64,
    /// The fix, or none.
    pub(super) answer: Option<Answer>,
}

/// A fix beside the truth.
pub(super) struct Answer {
    pub(super) fix: Fix,
    /// In truth: to the tower along the ground.
    pub(super) range_m: f64,
    /// On the ground.
    pub(super) error_m: f64,
    altitude_error_m: f64,
    bearing_error_deg: f64,
    heading_error_deg: f64,
    inside: bool,
    radius_m: f64,
    /// The frame leaves two sides open.
    open: bool,
}

/// Figures of many poses.
#[derive(Debug, Serialize)]
pub(super) struct Figures {
    pub(super) poses: usize,
    pub(super) fix_share: f64,
    pub(super) error_median_m: f64,
    pub(super) error_95_m: f64,
    pub(super) error_median_share_of_range: f64,
    pub(super) error_95_share_of_range: f64,
    pub(super) altitude_error_median_m: f64,
    pub(super) bearing_error_median_deg: f64,
    pub(super) bearing_error_95_deg: f64,
    pub(super) heading_error_median_deg: f64,
    pub(super) truth_in_ellipse_share: f64,
    pub(super) radius_median_m: f64,
}

/// The walk, filtered.
#[derive(Debug, Serialize)]
pub(super) struct Track {
    pub(super) error_median_m: f64,
    pub(super) error_95_m: f64,
    pub(super) left_out: usize,
    pub(super) truth_in_ellipse_share: f64,
}

/// Poses of wrong buildings.
#[derive(Debug, Serialize)]
pub(super) struct Wrong {
    pub(super) matched: &'static str,
    pub(super) attempts: usize,
    pub(super) fixes: usize,
}

fn intrinsics() -> Intrinsics {
    // The constant is a lens.
    Intrinsics::centred(LENS.focal, LENS.width, LENS.height).expect("a lens with a focal length")
}

fn settings(noise_px: f64) -> PoseSettings {
    PoseSettings { deviation_px: noise_px, ..PoseSettings::of_frame(LENS.width, LENS.height) }
}

fn solve(points: &[PointInView], noise_px: f64) -> Result<Pose, NoPose> {
    PoseSolver::<POINTS>::new().solve(points, &intrinsics(), &settings(noise_px))
}

fn random(seed: u64, purpose: u64, number: usize) -> Distortion {
    Distortion::new(seed.wrapping_mul(1_000_003) ^ purpose << 48 ^ number as u64)
}

/// Every pose with the tower that is looked at.
pub(super) fn cases(stops: &[Stop], spoil: Spoil, seed: u64) -> Vec<Case> {
    let case = |number| {
        let stop: &Stop = &stops[number];
        let points = correspondences(stop, stop.tower, spoil, &mut random(seed, 1, number));
        let pose = solve(&points, spoil.noise_px).ok();
        let answer = pose.map(|pose| Answer::of(site(stop.tower).fix(&pose), pose.rival.is_some(), stop));
        Case { share: stop.share, answer }
    };
    parallel::numbers(stops.len(), case)
}

/// Every pose with all towers in the frame, solved as one.
pub(super) fn together(stops: &[Stop], spoil: Spoil, seed: u64) -> Vec<Case> {
    let frame = town();
    let case = |number| {
        let stop: &Stop = &stops[number];
        let mut random = random(seed, 2, number);
        let mut points = Vec::new();
        for tower in 0..8 {
            let own = correspondences(stop, tower, Spoil { most: 60, ..spoil }, &mut random);
            if own.len() >= LEAST_CORNERS {
                let site = site(tower);
                points.extend(own.iter().map(|one| PointInView { model: site.point_in(&frame, one.model), ..*one }));
            }
        }
        let town = Site::exact(frame.origin(), 0.0);
        let pose = solve(&points, spoil.noise_px).ok();
        let answer = pose.map(|pose| Answer::of(town.fix(&pose), pose.rival.is_some(), stop));
        Case { share: stop.share, answer }
    };
    parallel::numbers(stops.len(), case)
}

fn turn(one: f64, two: f64) -> f64 {
    let difference = (one - two).rem_euclid(360.0);
    difference.min(360.0 - difference)
}

fn azimuth(east: f64, north: f64) -> f64 {
    libm::atan2(east, north).to_degrees()
}

impl Answer {
    fn of(fix: Fix, open: bool, stop: &Stop) -> Self {
        let truth = stop.camera.position;
        let [east, north, up] = town().local_from_wgs84(fix.position);
        let tower = town().local_from_wgs84(site(stop.tower).position);
        let (e, n) = (east - truth.x, north - truth.y);
        let (to_east, to_north) = (tower[0] - truth.x, tower[1] - truth.y);
        let forward = stop.camera.view_from_world[2];
        // The bearing that the fix gives to the tower, whatever the pose was solved from.
        let bearing = azimuth(tower[0] - east, tower[1] - north);
        let [[ee, en, _], [_, nn, _], _] = fix.covariance;
        let square = (nn * e * e - 2.0 * en * e * n + ee * n * n) / (ee * nn - en * en);
        Self {
            range_m: libm::hypot(to_east, to_north),
            error_m: libm::hypot(e, n),
            altitude_error_m: (up - truth.z).abs(),
            bearing_error_deg: turn(bearing, azimuth(to_east, to_north)),
            heading_error_deg: fix
                .heading_deg
                .map_or(180.0, |heading| turn(heading.value, azimuth(forward.x, forward.y))),
            inside: square <= CHI_SQUARE_95,
            radius_m: fix.ellipse().radius(),
            fix,
            open,
        }
    }
}

/// The value below which a share of sorted numbers lies; 0 without numbers.
fn quantile(mut numbers: Vec<f64>, share: f64) -> f64 {
    order::ascending(&mut numbers);
    let last = numbers.len().saturating_sub(1);
    numbers.get(libm::round(share * last as f64) as usize).copied().unwrap_or(0.0)
}

impl Figures {
    pub(super) fn of<'a>(cases: impl Iterator<Item = &'a Case>) -> Self {
        let cases: Vec<_> = cases.collect();
        // A fix that leaves two sides open is none.
        let answers: Vec<_> =
            cases.iter().filter_map(|case| case.answer.as_ref()).filter(|answer| !answer.open).collect();
        let all = |of: fn(&Answer) -> f64, share| quantile(answers.iter().map(|answer| of(answer)).collect(), share);
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        Self {
            poses: cases.len(),
            fix_share: share(answers.len(), cases.len()),
            error_median_m: all(|answer| answer.error_m, 0.5),
            error_95_m: all(|answer| answer.error_m, 0.95),
            error_median_share_of_range: all(|answer| answer.error_m / answer.range_m, 0.5),
            error_95_share_of_range: all(|answer| answer.error_m / answer.range_m, 0.95),
            altitude_error_median_m: all(|answer| answer.altitude_error_m, 0.5),
            bearing_error_median_deg: all(|answer| answer.bearing_error_deg, 0.5),
            bearing_error_95_deg: all(|answer| answer.bearing_error_deg, 0.95),
            heading_error_median_deg: all(|answer| answer.heading_error_deg, 0.5),
            truth_in_ellipse_share: share(answers.iter().filter(|answer| answer.inside).count(), answers.len()),
            radius_median_m: all(|answer| answer.radius_m, 0.5),
        }
    }
}

impl Track {
    /// A frame a second along the loop.
    pub(super) fn of(cases: &[Case], stops: &[Stop]) -> Self {
        let mut filter = Filter::new(SPEED_M_S);
        let (mut errors, mut left_out, mut inside) = (Vec::new(), 0, 0);
        for (second, (case, stop)) in cases.iter().zip(stops).enumerate() {
            let now = second as f64;
            if let Some(answer) = case.answer.as_ref().filter(|answer| !answer.open) {
                let update = filter.update(&answer.fix, now);
                left_out += usize::from(matches!(update, Update::LeftOut { .. }));
            }
            if let Some(fix) = filter.fix(now) {
                let answer = Answer::of(fix, false, stop);
                errors.push(answer.error_m);
                inside += usize::from(answer.inside);
            }
        }
        let share = inside as f64 / errors.len().max(1) as f64;
        Self {
            error_median_m: quantile(errors.clone(), 0.5),
            error_95_m: quantile(errors, 0.95),
            left_out,
            truth_in_ellipse_share: share,
        }
    }
}

/// Every pose with the models of the seven towers that it does not show.
pub(super) fn wrong_buildings(stops: &[Stop], scene: &Scene, spoil: Spoil, seed: u64) -> Vec<Wrong> {
    let corners: Vec<Vec<Corner>> = scene.towers.iter().map(daymark_fixtures::Tower::corners).collect();
    let same_shape = |one: usize, two: usize| scene.towers[one].solids == scene.towers[two].solids;
    let attempt = |number| {
        let stop: &Stop = &stops[number];
        let mut random = random(seed, 3, number);
        let mut counts = [[0_usize; 2]; 3];
        for other in (0..corners.len()).filter(|other| *other != stop.tower) {
            let chance = by_chance(stop, &corners[other], spoil.most, &mut random);
            let place = by_place(stop, scene, &corners[other], REACH_PX, spoil.most);
            let twin = same_shape(other, stop.tower);
            for (kind, points) in [(0, chance), (if twin { 2 } else { 1 }, place)] {
                counts[kind][0] += 1;
                counts[kind][1] += usize::from(solve(&points, spoil.noise_px).is_ok());
            }
        }
        counts
    };
    let add = |one: [[usize; 2]; 3], two: [[usize; 2]; 3]| {
        std::array::from_fn(|kind| std::array::from_fn(|column| one[kind][column] + two[kind][column]))
    };
    let counts = parallel::numbers(stops.len(), attempt).into_iter().fold([[0; 2]; 3], add);
    let titles = ["corners matched by chance", "corners matched by place", "by place, same shape (towers 2 and 5)"];
    let wrong = |(matched, [attempts, fixes]): (&'static str, [usize; 2])| Wrong { matched, attempts, fixes };
    titles.into_iter().zip(counts).map(wrong).collect()
}
