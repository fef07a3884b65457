//! Pictures of the fixtures' towers with their cameras and corners as files.

#![allow(dead_code, reason = "each test uses a part of it")]

use std::fmt::Write as _;

use daymark_fixtures::{Camera, Lens, Light, Scene, Sensor, Site, Tower, Vec3, render, view};

use super::support::Town;

/// A camera before a tower of the fixtures, by its number from 1, at an angle from straight before it.
pub(crate) fn before(number: usize, angle: f64) -> Camera {
    Camera::before(Site::ORIGIN, view::stand(&Tower::eight()[number - 1], angle), Lens::VGA)
}

/// Renders a tower from these angles: `t<tower>-<n>.pgm`, its `.camera` file and its true corners as `.csv`.
pub(crate) fn shoot(town: &Town, number: usize, angles: &[f64]) -> Vec<String> {
    let tower = Tower::eight()[number - 1].clone();
    let scene = Scene::alone(tower, 40 + number as u64).lit(Light::morning());
    let cameras: Vec<Camera> = angles.iter().map(|&angle| before(number, angle)).collect();
    shoot_with(town, &format!("t{number}"), &scene, &cameras)
}

/// The same of a scene with these cameras: `<stem>-<n>.pgm` and so on.
pub(crate) fn shoot_with(town: &Town, stem: &str, scene: &Scene, cameras: &[Camera]) -> Vec<String> {
    let mut names = Vec::new();
    for (number, camera) in (1..).zip(cameras) {
        let frame = render(scene, camera, &Sensor::daylight(number));
        let name = format!("{stem}-{number}");
        town.write(&format!("{name}.pgm"), frame.pgm());
        let (cx, cy) = camera.principal_point();
        let mut text = format!("{} 0 {cx}\n0 {} {cy}\n0 0 1\n0 0 0\n", camera.focal, camera.focal);
        // The columns of camera-to-world are the view's axes.
        let [right, down, forward] = camera.view_from_world;
        for row in [|v: Vec3| v.x, |v: Vec3| v.y, |v: Vec3| v.z] {
            let _ = writeln!(text, "{} {} {}", row(right), row(down), row(forward));
        }
        let _ = writeln!(text, "{} {} {}", camera.position.x, camera.position.y, camera.position.z);
        let _ = writeln!(text, "{} {}", camera.width, camera.height);
        town.write(&format!("{name}.camera"), text);
        let mut corners = "number,x,y\n".to_owned();
        for corner in frame.truth.visible(0) {
            let _ = writeln!(corners, "{},{},{}", corner.number, corner.image.x, corner.image.y);
        }
        town.write(&format!("{name}.csv"), corners);
        names.push(name);
    }
    names
}

/// The files of these pictures with an ending.
pub(crate) fn files(names: &[String], ending: &str) -> Vec<String> {
    names.iter().map(|name| format!("{name}.{ending}")).collect()
}
