//! An observer who walks a loop in the town of the eight towers, and what their camera gives: right corners with noise, wrong
//! ones, missing ones.

use daymark_core::camera::pose::PointInView;
use daymark_core::fix::{LocalFrame, Site, Wgs84};
use daymark_core::geometry::hull::{ConvexHull, Hull};
use daymark_core::point::{ImagePoint, SUBPIXEL};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::scene::TOWN;
use daymark_fixtures::site::ORIGIN;
use daymark_fixtures::{Camera, Corner, Lens, Scene, SeenCorner, Tower, Vec3, corners_of};

/// The lens of the camera.
pub(super) const LENS: Lens = Lens::VGA;
/// Share of the visible corners that the camera's corners hold.
const FOUND: f64 = 0.8;
/// Half axes of the loop, metres: east and north.
const LOOP: [f64; 2] = [30.0, 24.0];
/// Roll of the camera, degrees: one deviation.
const ROLL: f64 = 2.0;
/// How far the axis misses the tower's middle, metres: at most, sideways and up.
const MISS: f64 = 5.0;

/// A pose of the observer.
pub(super) struct Stop {
    /// In truth.
    pub(super) camera: Camera,
    /// Index of the tower that is looked at.
    pub(super) tower: usize,
    /// Visible corners of all towers.
    pub(super) seen: Vec<SeenCorner>,
    /// Share of the frame that the tower's outline takes, hidden parts too.
    pub(super) share: f64,
}

/// A position of the town's plane.
pub(super) fn town() -> LocalFrame {
    LocalFrame::new(Wgs84 { latitude_deg: ORIGIN.latitude, longitude_deg: ORIGIN.longitude, altitude_m: ORIGIN.height })
}

/// Where a tower's model stands.
pub(super) fn site(tower: usize) -> Site {
    let site = TOWN[tower];
    Site::exact(town().wgs84_from_local([site.east, site.north, 0.0]), site.azimuth)
}

/// A pose of the loop. The observer looks at one tower after the other, hand-held.
pub(super) fn stop(scene: &Scene, number: usize, stops: usize, seed: u64) -> Stop {
    let mut random = Distortion::new(seed ^ (number as u64) << 32);
    let (sin, cos) = daymark_fixtures::math::sin_cos_degrees(360.0 * number as f64 / stops as f64);
    let eye = 1.7 + 0.1 * random.normal();
    let position = Vec3::new(LOOP[0] * sin, LOOP[1] * cos, eye);
    // Five towers on: every tower from every side of the loop.
    let tower = number * 5 % scene.towers.len();
    let building = &scene.towers[tower];
    let mut miss = || MISS * (2.0 * random.unit() - 1.0);
    let middle = Vec3::new(miss(), miss(), building.height() * 0.47 + 0.5 * miss());
    let camera = Camera::look_at(position, building.site.world_from_model(middle), LENS).rolled(ROLL * random.normal());
    let all = corners_of(scene, &camera);
    let share = outline_share(building, &camera);
    Stop { camera, tower, seen: all.into_iter().filter(|corner| corner.visible).collect(), share }
}

fn to_image([x, y]: [f64; 2]) -> ImagePoint {
    let round = |x: f64| libm::round(x * f64::from(SUBPIXEL)) as i32;
    ImagePoint::new(round(x), round(y))
}

/// The vertices of the convex hull of points.
pub(super) fn hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let places: Vec<_> = points.iter().map(|point| to_image(*point)).collect();
    let mut hull = Box::new(ConvexHull::<4_096>::new());
    match hull.enclose(&places) {
        Ok(Hull::Polygon(numbers)) => numbers.iter().map(|number| points[usize::from(*number)]).collect(),
        _ => Vec::new(),
    }
}

/// Share of the frame within the outline of a tower: the hull of its corners' images, cut at the frame's border.
fn outline_share(tower: &Tower, camera: &Camera) -> f64 {
    let images = tower.corners().into_iter().filter_map(|corner| {
        let seen = camera.project(tower.site.world_from_model(corner.model))?;
        Some([seen.x, seen.y])
    });
    let mut outline = hull(&images.collect::<Vec<_>>());
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    for (axis, limit, side) in [(0, 0.0, 1.0), (0, width, -1.0), (1, 0.0, 1.0), (1, height, -1.0)] {
        outline = cut(&outline, |point| side * (point[axis] - limit));
    }
    let pairs = outline.iter().zip(outline.iter().cycle().skip(1));
    let twice: f64 = pairs.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    twice.abs() / 2.0 / (width * height)
}

/// The part of a convex polygon where a linear function is not negative.
fn cut(polygon: &[[f64; 2]], inside: impl Fn(&[f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
        let (at_a, at_b) = (inside(a), inside(b));
        if at_a >= 0.0 {
            kept.push(*a);
        }
        if (at_a >= 0.0) != (at_b >= 0.0) {
            let way = at_a / (at_a - at_b);
            kept.push([a[0] + way * (b[0] - a[0]), a[1] + way * (b[1] - a[1])]);
        }
    }
    kept
}

/// How the camera's corners are spoilt.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spoil {
    /// Noise of a coordinate, px.
    pub(super) noise_px: f64,
    /// Share of wrong correspondences.
    pub(super) wrong: f64,
    /// Correspondences, at most.
    pub(super) most: usize,
}

/// Correspondences of a tower's corners. Of the wrong ones every second lies on another corner of the towers, as similar
/// windows are taken for each other, and the others anywhere in the frame, as clutter is.
pub(super) fn correspondences(stop: &Stop, tower: usize, spoil: Spoil, random: &mut Distortion) -> Vec<PointInView> {
    let own = stop.seen.iter().filter(|corner| corner.tower == tower);
    let mut found: Vec<&SeenCorner> = own.filter(|_| random.unit() < FOUND).collect();
    // A random choice of the most that are taken, without order.
    for place in 0..found.len().min(spoil.most) {
        let other = place + (random.unit() * (found.len() - place) as f64) as usize;
        found.swap(place, other);
    }
    found.truncate(spoil.most);
    let wrong = libm::round(spoil.wrong * found.len() as f64) as usize;
    let mut spoilt = Vec::with_capacity(found.len());
    for (place, corner) in found.iter().enumerate() {
        let image = if place >= wrong {
            [corner.image.x, corner.image.y]
        } else if place % 2 == 0 {
            let other = &stop.seen[(random.unit() * stop.seen.len() as f64) as usize];
            [other.image.x, other.image.y]
        } else {
            [random.unit() * f64::from(LENS.width), random.unit() * f64::from(LENS.height)]
        };
        let image = image.map(|x| x + spoil.noise_px * random.normal());
        spoilt.push(PointInView { model: [corner.model.x, corner.model.y, corner.model.z], image });
    }
    spoilt
}

/// What a matcher would give that takes the tower for another: corners of the other model with corners of the frame by chance.
pub(super) fn by_chance(stop: &Stop, other: &[Corner], most: usize, random: &mut Distortion) -> Vec<PointInView> {
    let any = |random: &mut Distortion, count: usize| (random.unit() * count as f64) as usize;
    let pair = |_| {
        let (corner, seen) = (&other[any(random, other.len())], &stop.seen[any(random, stop.seen.len())]);
        let model = corner.model;
        PointInView { model: [model.x, model.y, model.z], image: [seen.image.x, seen.image.y] }
    };
    if stop.seen.is_empty() { Vec::new() } else { (0..most).map(pair).collect() }
}

/// The worst that a matcher could give that goes by places: the other model set up in the tower's place, each corner of it with
/// the corner of the frame that is nearest to where it would be seen, within `reach_px`.
pub(super) fn by_place(stop: &Stop, scene: &Scene, other: &[Corner], reach_px: f64, most: usize) -> Vec<PointInView> {
    let site = scene.towers[stop.tower].site;
    let step = (other.len() / most).max(1);
    let pair = |corner: &Corner| {
        let expected = stop.camera.project(site.world_from_model(corner.model))?;
        let square = |seen: &&SeenCorner| {
            let (x, y) = (seen.image.x - expected.x, seen.image.y - expected.y);
            x * x + y * y
        };
        let nearest = stop.seen.iter().min_by(|a, b| square(a).total_cmp(&square(b)))?;
        let model = corner.model;
        (square(&nearest) < reach_px * reach_px)
            .then_some(PointInView { model: [model.x, model.y, model.z], image: [nearest.image.x, nearest.image.y] })
    };
    other.iter().step_by(step).filter_map(pair).take(most).collect()
}
