//! Where the observer stands, from an answer and the landmark's model.
//!
//! ```text
//!  answer ── matched corners of every modelled view ─┐
//!  table ─── places of the corners ──────────────────┼─ pose in the model ── site ── fix
//!  lens ──── rays of the frame's corners ────────────┘  or direction, or only: near the landmark
//! ```

use daymark_core::camera::Intrinsics;
use daymark_core::camera::direction::Direction;
use daymark_core::camera::locate::{FrameCorner, Located, Locator, ModelCorner};
use daymark_core::camera::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use daymark_core::fix::site::reach_of_size;
use daymark_core::fix::{Fix, Site};
use daymark_core::table::{GeoPosition, Kind, LandmarkTable, StoredModel, TableError};
use daymark_core::verdict::Answer;

use crate::engine::Engine;
use crate::lens_source::{KnownLens, LensSource};
use crate::near::PriorArgs;
use crate::order;

/// Corners of a model that are looked for, at most.
const POINTS: usize = 1_024;
/// Deviation of a corner's coordinate: of the frame's, of the stored one, and of the surface between corners, pixels.
const DEVIATION_PX: f64 = 1.0;
/// Of the corners that recognition matched at least this share is right; the others lie on another plane, or are mistaken.
const LEAST_SHARE: f64 = 0.35;
/// A view with less evidence than this matched by accident.
const LEAST_BITS: f64 = 12.0;
/// A focal length that is known worse than this is not used as if it were known.
const WORST_LENS: f64 = 0.1;
/// A camera's focal length over the longer side of its frame, at most, where nothing is known.
const LONGEST_FOCAL: f64 = 3.0;

/// Where the observer stands, as far as the frame tells.
#[derive(Debug, Clone)]
pub struct Observer {
    /// In the model's frame.
    pub place: Place,
    /// On Earth; `None` if the table does not know where the landmark stands.
    pub fix: Option<Sighted>,
    /// What keeps the fix from being better, each with what to do.
    pub lacking: Vec<String>,
}

impl Observer {
    /// Leaves a fix out that contradicts what was known before, and names it.
    pub fn check(&mut self, prior: &PriorArgs) {
        if let Some(why) = self.fix.and_then(|sighted| prior.contradiction(&sighted.fix)) {
            self.fix = None;
            self.lacking.push(why);
        }
    }
}

/// A fix, and how much of its error is noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighted {
    /// With everything that it may be wrong by.
    pub fix: Fix,
    /// The same with the noise of the frame's corners alone, as if lens, model and map were exact: what differs from frame to
    /// frame.
    pub noise: Fix,
}

impl Sighted {
    const fn all_noise(fix: Fix) -> Self {
        Self { fix, noise: fix }
    }
}

/// In the model's frame.
#[derive(Debug, Clone)]
pub enum Place {
    /// The camera's pose.
    Pose {
        /// The pose, with the error of lens and scale in its covariance.
        located: Box<Located>,
        /// The pose with the noise of the corners alone.
        noise: Box<Pose>,
        /// Whether its lengths are metres.
        metric: bool,
    },
    /// The side, and an interval of distances.
    Direction(Box<Direction>),
    /// There is a model, and no pose.
    NoPose(NoPose),
    /// There is no model.
    NoModel,
}

/// Finds observers. Holds working memory.
#[derive(Debug)]
pub struct Locating {
    locator: Box<Locator<POINTS>>,
    solver: Box<PoseSolver<POINTS>>,
}

impl Default for Locating {
    fn default() -> Self {
        Self::new()
    }
}

impl Locating {
    /// Working memory.
    pub fn new() -> Self {
        Self { locator: Box::default(), solver: Box::default() }
    }

    /// Where the observer of the engine's latest frame stands, who sees the landmark of `answer` through `lens` (of the frame's
    /// size). `reach_m` is from how far a landmark is recognized at most.
    ///
    /// # Errors
    /// A damaged record; not of a verified table.
    pub fn observer(
        &mut self,
        engine: &mut Engine,
        table: &LandmarkTable<'_>,
        answer: &Answer,
        lens: &KnownLens,
        reach_m: f64,
    ) -> Result<Observer, TableError> {
        let landmark = table.landmark(answer.landmark)?;
        let Some(model) = table.model(answer.landmark)? else {
            let size = seen_size(engine, table, answer)?;
            let mut observer = Observer { place: Place::NoModel, fix: None, lacking: Vec::new() };
            observer
                .lacking
                .push("the table has no model of it: enroll two or more pictures from different places".to_owned());
            let reach = near(landmark.kind, size, lens).map_or(reach_m, |reach| reach.min(reach_m));
            observer.fix = landmark.position.map(|at| Sighted::all_noise(site(at, None).near(reach)));
            return Ok(observer);
        };
        let matched = Matched::new(engine, table, landmark.views.start, &model, lens)?;
        let place = self.place(engine, &matched, &model, lens);
        let facts = model.facts();
        let mut lacking = Vec::new();
        if facts.scale_error.is_none() {
            lacking.push("its model has no scale: enroll it with --height-m or --distance-m".to_owned());
        }
        if facts.azimuth.is_none() {
            lacking.push("nobody said which way its front looks: enroll it with --facing".to_owned());
        }
        if landmark.position.is_none() {
            lacking.push("nobody said where it stands: enroll it with --at".to_owned());
        }
        match &place {
            Place::Direction(_) => {
                lacking.push(format!("{}: calibrate the camera, or give --focal-px", lens.source));
            }
            Place::NoPose(why) => lacking.push(why.to_string()),
            _ => {}
        }
        let fix = landmark.position.map(|at| {
            let site = site(at, Some(&model));
            let known = facts.azimuth.is_some();
            match &place {
                Place::Pose { located, noise, metric: true } if known && located.pose.rival.is_none() => Sighted {
                    fix: site.fix(&located.pose),
                    noise: Site::exact(site.position, site.azimuth_deg).fix(noise),
                },
                // On one of two sides, or on a circle: no farther than this.
                Place::Pose { located, metric: true, .. } => {
                    let range = located.pose.range() + 2.0 * located.pose.deviation();
                    Sighted::all_noise(site.near(range.min(reach_m)))
                }
                Place::Direction(direction) if known && facts.scale_error.is_some() => {
                    Sighted::all_noise(site.fix_without_lens(direction))
                }
                _ => {
                    let reach = near(landmark.kind, matched.size_px, lens).map_or(reach_m, |reach| reach.min(reach_m));
                    Sighted::all_noise(site.near(reach))
                }
            }
        });
        Ok(Observer { place, fix, lacking })
    }

    fn place(&mut self, engine: &Engine, matched: &Matched, model: &StoredModel<'_>, lens: &KnownLens) -> Place {
        let frame = engine.features();
        let settings = PoseSettings {
            deviation_px: DEVIATION_PX,
            least_share: LEAST_SHARE,
            front: front(model),
            ..PoseSettings::of_frame(u32::from(frame.width), u32::from(frame.height))
        };
        let known = &lens.lens;
        let Ok(intrinsics) = Intrinsics::new(known.focal, known.centre) else {
            return Place::NoPose(NoPose::NotFinite);
        };
        let scale_error = model.facts().scale_error.map(|error| f64::from(error) / 1e4);
        if lens.relative_error > WORST_LENS {
            let points: Vec<PointInView> = matched
                .pairs
                .iter()
                .map(|&[corner, seen]| PointInView {
                    model: matched.model[usize::from(corner)].position,
                    image: matched.frame[usize::from(seen)].image,
                })
                .take(POINTS)
                .collect();
            let spread = 1.0 + 2.0 * lens.relative_error;
            let focal = known.focal[0].max(known.focal[1]);
            return match self.solver.direction(&points, [focal / spread, focal * spread], &settings) {
                Ok(direction) => Place::Direction(Box::new(direction)),
                Err(why) => Place::NoPose(why),
            };
        }
        match self.locator.locate(&matched.model, &matched.frame, &matched.pairs, &intrinsics, &settings) {
            Ok(located) => {
                let share = libm::hypot(lens.relative_error, scale_error.unwrap_or(0.0));
                let pose = located.pose.with_range_error(share);
                Place::Pose {
                    located: Box::new(Located { pose, ..located }),
                    noise: Box::new(located.pose),
                    metric: scale_error.is_some(),
                }
            }
            Err(why) => Place::NoPose(why),
        }
    }
}

/// The corners of a model and of a frame, and which recognition matched.
struct Matched {
    model: Vec<ModelCorner>,
    frame: Vec<FrameCorner>,
    pairs: Vec<[u16; 2]>,
    /// The longer side of what was matched in the frame.
    size_px: f64,
}

impl Matched {
    fn new(
        engine: &mut Engine,
        table: &LandmarkTable<'_>,
        first_view: u32,
        model: &StoredModel<'_>,
        lens: &KnownLens,
    ) -> Result<Self, TableError> {
        let features = engine.features();
        let frame: Vec<FrameCorner> = (0..features.len())
            .filter_map(|number| features.get(number))
            .map(|feature| {
                let at = feature.position.to_pixels().map(f64::from);
                // No ray comes from there: never near anything.
                let image = lens.lens.ideal_from_picture(at).unwrap_or([f64::INFINITY; 2]);
                FrameCorner { image, signature: feature.signature }
            })
            .collect();
        let mut corners = Vec::new();
        // Evidence, the model's corner, the frame's corner.
        let mut found: Vec<(i32, u16, u16)> = Vec::new();
        for (view, range) in model.views() {
            let view = table.view(first_view + u32::from(view))?;
            let explained = engine.explain(&view);
            let counts = explained
                .filter(|(matched, _)| crate::report::finding::bits(matched.evidence) >= LEAST_BITS)
                .map_or(&[][..], |(_, corners)| corners);
            for number in range {
                let Some(point) = model.get(number) else { continue };
                let Some(feature) = view.get(usize::from(point.corner)) else { continue };
                let place = corners.len() as u16;
                corners.push(ModelCorner { position: point.position, signature: feature.signature });
                let said = counts.iter().find(|said| said.stored == point.corner);
                if let Some((said, query)) = said.and_then(|said| Some((said, said.query?)))
                    && said.evidence > 0
                    && frame.get(usize::from(query)).is_some_and(|corner| corner.image[0].is_finite())
                {
                    found.push((said.evidence, place, query));
                }
            }
        }
        // A corner of the frame is one corner of the building: the one with the most evidence.
        order::sort_by_key(&mut found, |&(evidence, corner, seen)| (-evidence, corner, seen));
        let mut used = vec![false; frame.len()];
        found.retain(|&(_, _, seen)| !std::mem::replace(&mut used[usize::from(seen)], true));
        let seen = found.iter().map(|&(_, _, seen)| frame[usize::from(seen)].image);
        let size_px = longer_side(seen);
        let pairs = found.into_iter().map(|(_, corner, seen)| [corner, seen]).collect();
        Ok(Self { model: corners, frame, pairs, size_px })
    }
}

/// The longer side of what one view matched in the frame.
fn seen_size(engine: &mut Engine, table: &LandmarkTable<'_>, answer: &Answer) -> Result<f64, TableError> {
    let view = table.view(answer.view)?;
    let seen: Vec<u16> = engine.explain(&view).map_or_else(Vec::new, |(_, corners)| {
        corners.iter().filter(|said| said.evidence > 0).filter_map(|said| said.query).collect()
    });
    let features = engine.features();
    let at = |number: &u16| Some(features.get(usize::from(*number))?.position.to_pixels().map(f64::from));
    Ok(longer_side(seen.iter().filter_map(at)))
}

fn longer_side(points: impl Iterator<Item = [f64; 2]>) -> f64 {
    let ends = points.fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], [x, y]| {
        [[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]]
    });
    (ends[1][0] - ends[0][0]).max(ends[1][1] - ends[0][1])
}

/// From how far a building of this kind shows a part of itself as large as that, at most.
fn near(kind: Kind, size_px: f64, lens: &KnownLens) -> Option<f64> {
    // The longest side that is usual for the kind, metres. What was matched may be all of it.
    let size = match kind {
        Kind::House => 30.0,
        Kind::Monument => 50.0,
        Kind::Lighthouse => 70.0,
        Kind::Church => 110.0,
        Kind::Tower => 150.0,
        Kind::Castle => 250.0,
        Kind::Bridge => 500.0,
        _ => 120.0,
    };
    let longer = f64::from(lens.lens.width.max(lens.lens.height));
    let focal = match lens.source {
        LensSource::Assumed => LONGEST_FOCAL * longer,
        _ => lens.lens.focal[0].max(lens.lens.focal[1]) * (1.0 + 2.0 * lens.relative_error),
    };
    reach_of_size(size, size_px, focal)
}

/// The outside of a building that is modelled from one side: the mean of its surface's normals, if they hold together.
fn front(model: &StoredModel<'_>) -> Option<[f64; 3]> {
    let (mut sum, mut area) = ([0.0; 3], 0.0);
    for triangle in model.triangles() {
        let [a, b, c] = triangle.map(|point| model.get(usize::from(point)).map(|point| point.position));
        let (a, b, c) = (a?, b?, c?);
        let (p, q) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        area += length(normal);
        sum = [sum[0] + normal[0], sum[1] + normal[1], sum[2] + normal[2]];
    }
    (length(sum) > 0.5 * area).then_some(sum)
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    libm::sqrt(x * x + y * y + z * z)
}

/// The model's place on Earth. Heights count from its foot, which the table does not know above the sea.
pub fn site(at: GeoPosition, model: Option<&StoredModel<'_>>) -> Site {
    let azimuth = model.and_then(|model| model.facts().azimuth);
    Site {
        position: at.wgs84(),
        azimuth_deg: azimuth.map_or(0.0, |azimuth| f64::from(azimuth.centidegrees) / 100.0),
        // "Within" is taken as two deviations of each coordinate.
        deviation_m: at.error_m() / 2.0,
        azimuth_deviation_deg: azimuth.map_or(180.0, |azimuth| f64::from(azimuth.deviation) / 100.0),
    }
}
