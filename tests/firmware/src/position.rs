//! Where a device stands: poses, facades, fixes, tracks and resection. The numbers come from the frame, whatever they mean.

use core::hint::black_box;

use daymark_core::camera::Intrinsics;
use daymark_core::camera::facade::Facade;
use daymark_core::camera::pose::{PointInView, PoseSettings, PoseSolver};
use daymark_core::fix::agreement::combine;
use daymark_core::fix::prior::Near;
use daymark_core::fix::resection::{Sighting, resect};
use daymark_core::fix::site::reach_of_size;
use daymark_core::fix::track::Track;
use daymark_core::fix::{Evidence, Fix, LocalFrame, Measured, Prior, Site, Wgs84};

use crate::device::Device;

/// Correspondences.
const POINTS: usize = 24;

/// Whether a made view of a box gives its pose, and chance none.
#[inline(never)]
pub fn check(device: &mut Device) -> bool {
    let (pixels, _) = device.frame();
    let Ok(lens) = Intrinsics::centred(black_box(280.0), 320, 240) else { return false };
    let settings = PoseSettings::of_frame(320, 240);
    let mut made = [PointInView { model: [0.0; 3], image: [0.0; 2] }; POINTS];
    let mut by_chance = made;
    for (number, ((made, chance), at)) in made.iter_mut().zip(&mut by_chance).zip(pixels.as_chunks::<8>().0).enumerate()
    {
        let [a, b, c, d, e, ..] = at.map(f64::from);
        let column = (number % 4) as f64;
        let row = (number / 4) as f64;
        made.model = [4.0 * column + a / 64.0, 6.0 * (number % 2) as f64 + b / 64.0, 3.0 * row];
        made.image = lens.project([made.model[0] - 6.0, 8.0 - made.model[2], made.model[1] + 30.0]).unwrap_or_default();
        *chance = PointInView { model: [a, b, c], image: [d, e] };
    }
    let mut solver = PoseSolver::<POINTS>::new();
    let refused = solver.solve(black_box(&by_chance), &lens, &settings).is_err();
    let _ = black_box(solver.direction(black_box(&made), [150.0, 600.0], &settings));
    let corners = [made[0].image, made[1].image, made[5].image, made[4].image];
    if let Ok(facade) = Facade::from_width(black_box(corners), 9.0, &lens) {
        let _ = black_box(solver.solve(&facade.points(corners), &lens, &settings));
    }
    let Ok(pose) = solver.solve(black_box(&made), &lens, &settings) else { return false };
    let at = Wgs84 { latitude_deg: black_box(52.0), longitude_deg: 13.0, altitude_m: 50.0 };
    let site = Site { deviation_m: 1.0, ..Site::exact(at, black_box(30.0)) };
    let fix = site.fix(&pose);
    fixes(&site, &fix);
    refused && pose.inliers == POINTS
}

#[inline(never)]
fn fixes(site: &Site, fix: &Fix) {
    let near = site.near(reach_of_size(20.0, black_box(80.0), 600.0).unwrap_or(500.0));
    let _ = black_box(combine(black_box(&[*fix, near, Fix { evidence: Evidence::Fixes { count: 1 }, ..*fix }])));
    let mut track = Track::new(1.5);
    for second in 0..4 {
        black_box(track.update(fix, f64::from(second)));
    }
    black_box((track.fix(5.0), fix.ellipse().radius()));
    let frame = LocalFrame::new(fix.position);
    let seen = |east: f64, from_axis: f64| Sighting {
        position: frame.wgs84_from_local([east, 80.0, 0.0]),
        deviation_m: 1.0,
        from_axis_deg: Measured { value: from_axis, deviation: 0.5 },
        range_m: None,
    };
    let prior = Prior {
        near: Some(Near { position: site.position, radius_m: 200.0 }),
        heading_deg: Some(Measured { value: black_box(10.0), deviation: 5.0 }),
    };
    let _ = black_box((
        prior.check(fix),
        resect(black_box(&[seen(-40.0, -20.0), seen(0.0, 3.0), seen(60.0, 30.0)]), &prior),
    ));
    black_box(site.point_in(&frame, [1.0, 2.0, 3.0]));
}
