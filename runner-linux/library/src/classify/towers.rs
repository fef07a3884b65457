//! Models of the eight towers of `daymark-fixtures`, made as the thesis makes them: corners picked by hand and numbered,
//! known cameras.

use std::error::Error;

use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::random::SplitMix64;
use daymark_fixtures::{Camera, Lens as FixtureLens, Light, Scene, Sensor, Site, Tower, render, view};
use nalgebra::{Matrix3, Vector3};

use super::cloud::Cloud;
use crate::camera_file::lens::{Lens, Pose};
use crate::order;
use crate::parallel;
use crate::picture::GrayImage;
use crate::synthesize::model::Model;
use crate::synthesize::triangulate::Rules;
use crate::synthesize::view::{Station, Track, View};

/// Views of a base: all around, one every 30 degrees, away from the angles of enrollment and test.
pub const BASE_ANGLES: [f64; 12] = [0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0, 210.0, 240.0, 270.0, 300.0, 330.0];
/// The two views of a test: neither those of the enrollment (-8 and 22 degrees) nor those of a base.
pub const TEST_ANGLES: [f64; 2] = [-24.0, 6.0];

/// Rendered views of a tower with its true corners.
#[derive(Debug, Clone)]
pub struct TowerViews {
    views: Vec<View>,
    stations: Vec<Option<Station>>,
    /// Number and exact image of the visible corners of each view.
    corners: Vec<Vec<(u32, [f64; 2])>>,
    around: bool,
}

/// What differs between the pictures of bases and those of tests.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// The light.
    pub light: Light,
    /// Seed of clutter and sensor noise.
    pub seed: u64,
    /// How much farther than where the whole tower just fits.
    pub farther: f64,
}

impl TowerViews {
    /// Renders a tower from these angles; `around` if the last view's neighbour is the first.
    pub fn new(tower: &Tower, angles: &[f64], conditions: &Conditions, around: bool) -> Self {
        let scene = Scene::alone(tower.clone(), conditions.seed).lit(conditions.light);
        let shots = parallel::numbers(angles.len(), |number| {
            let angle = angles[number];
            let mut stand = view::stand(tower, angle);
            stand.distance *= conditions.farther;
            let camera = Camera::before(Site::ORIGIN, stand, FixtureLens::VGA);
            let sensor = Sensor::daylight(conditions.seed * 64 + number as u64);
            let frame = render(&scene, &camera, &sensor);
            let corners = frame.truth.visible(0).map(|corner| (corner.number, [corner.image.x, corner.image.y]));
            let lens = Lens::of_focal(camera.width, camera.height, camera.focal);
            let [right, down, forward] = camera.view_from_world.map(|axis| [axis.x, axis.y, axis.z]);
            let at = camera.position;
            let pose = Pose {
                view_from_model: Matrix3::from_rows(&[right, down, forward].map(|row| Vector3::from(row).transpose())),
                position: Vector3::new(at.x, at.y, at.z),
            };
            let corners: Vec<_> = corners.collect();
            let gray = GrayImage { pixels: frame.gray, width: frame.width as usize, height: frame.height as usize };
            let view = View { name: format!("tower {} at {angle} degrees", tower.number), gray, rgb: frame.rgb, lens };
            (view, Station::new(&lens, pose), corners)
        });
        let mut made = Self { views: Vec::new(), stations: Vec::new(), corners: Vec::new(), around };
        for (view, station, corners) in shots {
            made.views.push(view);
            made.stations.push(station);
            made.corners.push(corners);
        }
        made
    }

    /// The pictures.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Where they were taken.
    pub fn stations(&self) -> &[Option<Station>] {
        &self.stations
    }

    /// The same views with Gaussian noise on every gray level.
    #[must_use]
    pub fn with_gray_noise(mut self, deviation: f64, seed: u64) -> Self {
        let mut noise = Gauss::new(seed ^ 0x6A09_E667_F3BC_C908);
        for view in &mut self.views {
            for level in &mut view.gray.pixels {
                *level = (f64::from(*level) + deviation * noise.draw() + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
        self
    }

    /// The corners with Gaussian noise on each coordinate, joined by their numbers.
    pub fn tracks(&self, deviation_px: f64, seed: u64) -> Vec<Track> {
        let mut noise = Gauss::new(seed);
        let mut tracks = std::collections::BTreeMap::new();
        for (view, corners) in self.corners.iter().enumerate() {
            for &(number, [x, y]) in corners {
                let at = [x + deviation_px * noise.draw(), y + deviation_px * noise.draw()];
                let track = tracks.entry(number).or_insert_with(|| Track { number, sightings: Vec::new() });
                track.sightings.push((view, at));
            }
        }
        tracks.into_values().collect()
    }

    /// The model from corners with this noise.
    pub fn model(&self, deviation_px: f64, seed: u64) -> Model {
        let count = self.views.len();
        let last = if self.around { count } else { count - 1 };
        let pairs: Vec<[usize; 2]> = (0..last).map(|view| [view, (view + 1) % count]).collect();
        let rules = Rules {
            corner_deviation_px: deviation_px.max(0.05),
            max_reprojection_px: (5.0 * deviation_px).max(0.5),
            ..Rules::default()
        };
        Model::new(&self.views, &self.stations, &self.tracks(deviation_px, seed), &pairs, &rules, 0.0)
    }

    /// The dense cloud of that model.
    ///
    /// # Errors
    /// What keeps the surface from being subdivided.
    pub fn cloud(
        &self,
        deviation_px: f64,
        seed: u64,
        level: SubdivisionLevel,
    ) -> Result<Cloud, Box<dyn Error + Send + Sync>> {
        let dense = self.model(deviation_px, seed).dense(level, &self.views, &self.stations)?;
        Ok(Cloud::of_dense(&dense))
    }
}

/// The true surface of a tower: the faces of its solids, in the model frame.
#[derive(Debug, Clone)]
pub struct TrueSurface {
    /// Outlines, counter-clockwise seen from outside, and normals of length one.
    faces: Vec<(Vec<Vector3<f64>>, Vector3<f64>)>,
}

impl TrueSurface {
    /// The surface of a tower at the origin. Faces inside of other solids are part of it: nothing that is seen is near them.
    pub fn new(tower: &Tower) -> Self {
        let vector = |point: daymark_fixtures::Vec3| Vector3::new(point.x, point.y, point.z);
        let faces = tower.solids.iter().flat_map(daymark_fixtures::solid::Solid::faces).map(|face| {
            let normal = vector(daymark_fixtures::solid::normal(&face.outline));
            (face.outline.into_iter().map(vector).collect(), normal)
        });
        Self { faces: faces.collect() }
    }

    /// Distance of a point from the nearest face, metres.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        let squared = |(outline, normal): &(Vec<Vector3<f64>>, Vector3<f64>)| {
            let edges = || outline.iter().zip(outline.iter().cycle().skip(1));
            let inside = edges().all(|(a, b)| (b - a).cross(&(point - a)).dot(normal) >= 0.0);
            if inside {
                let off = outline.first().map_or(f64::INFINITY, |corner| (point - corner).dot(normal));
                return off * off;
            }
            edges().fold(f64::INFINITY, |least, (a, b)| {
                let edge = b - a;
                let along = ((point - a).dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
                least.min((a + edge * along - point).norm_squared())
            })
        };
        libm::sqrt(self.faces.iter().map(squared).fold(f64::INFINITY, f64::min))
    }

    /// The median and the 95th percentile of the distances of points; NaN without any.
    pub fn distances(&self, points: impl Iterator<Item = Vector3<f64>>) -> [f64; 2] {
        let mut distances: Vec<f64> = points.map(|point| self.distance(&point)).collect();
        order::ascending(&mut distances);
        [0.5, 0.95].map(|share| distances.get((distances.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN))
    }
}

/// Normal numbers from a seed: the sum of twelve uniform ones, which needs no function that differs between machines.
#[derive(Debug)]
pub struct Gauss(SplitMix64);

impl Gauss {
    /// A stream.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// The next number: mean 0, variance 1, within 6.
    pub fn draw(&mut self) -> f64 {
        // Four words give twelve numbers of 21 bits.
        let mut sum = 0;
        for _ in 0..4 {
            let word = self.0.next_u64();
            sum += (word & 0x1F_FFFF) + (word >> 21 & 0x1F_FFFF) + (word >> 42 & 0x1F_FFFF);
        }
        (sum as f64 + 6.0) / f64::from(1 << 21) - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_normal() {
        let mut noise = Gauss::new(3);
        let numbers: Vec<f64> = (0..20_000).map(|_| noise.draw()).collect();
        let mean = numbers.iter().sum::<f64>() / 20_000.0;
        let variance = numbers.iter().map(|x| x * x).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.04, "{mean} {variance}");
    }

    #[test]
    fn the_true_surface_of_a_prism_is_as_far_as_it_looks() {
        // The Bell Tower stands on a rectangle; its corners lie on the surface.
        let tower = &Tower::eight()[0];
        let surface = TrueSurface::new(tower);
        for corner in tower.corners() {
            let off = surface.distance(&Vector3::new(corner.model.x, corner.model.y, corner.model.z));
            assert!(off < 1e-9, "{corner:?} {off}");
        }
        let above = Vector3::new(0.0, 0.0, tower.height() + 3.0);
        assert!((surface.distance(&above) - 3.0).abs() < 1e-9);
        let before = Vector3::new(0.0, -100.0, 1.0);
        let front = tower.solids.iter().flat_map(|solid| &solid.bottom).map(|(_, y)| *y).fold(0.0, f64::min);
        assert!((surface.distance(&before) - (100.0 + front)).abs() < 0.5, "{front}");
        let line = (0..100).map(|i| above + Vector3::new(0.0, 0.0, f64::from(i)));
        assert_eq!(surface.distances(line).map(|d| libm::round(d) as i32), [53, 98]);
    }
}
