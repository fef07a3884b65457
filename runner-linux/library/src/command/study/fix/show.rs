//! The study as text, as a plot and as a map.

use std::fmt::Write as _;

use daymark_core::fix::Wgs84;
use daymark_fixtures::Scene;

use super::score::{Case, Figures};
use super::walk::{Stop, hull, site, town};
use super::{LARGE, Report};
use crate::order;
use crate::report::map::{Building, Observer, Plan};
use crate::report::plot::{Axis, Curve, Plot};

/// Every so many of the fixes is drawn.
const DRAWN: usize = 5;
/// The plot ends here, as a share of the range.
const PLOT_END: f64 = 0.02;

pub(super) fn table(report: &Report) -> String {
    let Report { frame_px: [width, height], focal_length_px, poses, corners_at_most, noise_px, wrong_share, .. } =
        report;
    let mut text = format!(
        "{poses} poses on a loop among the eight towers; {width} x {height} px, focal length {focal_length_px} px; up to \
         {corners_at_most} corners, {noise_px} px noise, {:.0} % wrong\n\n",
        100.0 * wrong_share
    );
    heading(&mut text, "");
    row(&mut text, &format!("tower over {:.0} % of frame", 100.0 * LARGE), &report.large);
    row(&mut text, "every tower", &report.all);
    row(&mut text, "all towers of the frame", &report.together);
    let track = &report.track;
    let _ = writeln!(
        text,
        "\nFiltered along the walk: {:.2} m median, {:.2} m at 95 %, truth in the ellipse {:.1} %, {} fixes left out",
        track.error_median_m,
        track.error_95_m,
        100.0 * track.truth_in_ellipse_share,
        track.left_out
    );
    text.push('\n');
    heading(&mut text, "every tower");
    for line in &report.by_noise {
        row(&mut text, &format!("{:.2} px noise", line.noise_px), &line.figures);
    }
    for line in &report.by_wrong {
        row(&mut text, &format!("{:.0} % wrong", 100.0 * line.wrong_share), &line.figures);
    }
    text.push_str("\nModels of buildings that are not in the middle of the frame      attempts   fixes\n");
    for wrong in &report.wrong_buildings {
        let _ = writeln!(text, "{:62} {:>10} {:>7}", wrong.matched, wrong.attempts, wrong.fixes);
    }
    text
}

fn heading(text: &mut String, left: &str) {
    let _ = writeln!(
        text,
        "{left:24} poses  fix, %  error, m: median  95 %  of range, %: median  95 %  bearing, deg: median  95 %  heading  \
         in ellipse, %  radius, m"
    );
}

fn row(text: &mut String, title: &str, figures: &Figures) {
    let _ = writeln!(
        text,
        "{title:24} {:5}  {:6.1}  {:16.3}  {:4.2}  {:19.3}  {:4.2}  {:20.3}  {:4.2}  {:7.3}  {:13.1}  {:9.2}",
        figures.poses,
        100.0 * figures.fix_share,
        figures.error_median_m,
        figures.error_95_m,
        100.0 * figures.error_median_share_of_range,
        100.0 * figures.error_95_share_of_range,
        figures.bearing_error_median_deg,
        figures.bearing_error_95_deg,
        figures.heading_error_median_deg,
        100.0 * figures.truth_in_ellipse_share,
        figures.radius_median_m
    );
}

/// The share of poses whose error is below a share of the range.
pub(super) fn plot(cases: &[Case], report: &Report) -> String {
    let curve = |least: f64, colour| {
        let chosen: Vec<_> = cases.iter().filter(|case| case.share >= least).collect();
        let mut errors: Vec<_> = chosen.iter().filter_map(|case| case.relative()).collect();
        order::ascending(&mut errors);
        let count = chosen.len().max(1) as f64;
        let steps = errors.iter().zip(1..).map(|(error, number)| [*error, f64::from(number) / count]);
        Curve { points: std::iter::once([0.0, 0.0]).chain(steps).collect(), colour, dashed: false }
    };
    let ticks = |values: &[f64]| values.iter().map(|value| (*value, format!("{} %", 100.0 * value))).collect();
    Plot {
        title: format!("Poses within an error (green: towers over {:.0} % of the frame)", 100.0 * LARGE),
        x: Axis {
            label: format!("error, share of the range ({} px noise)", report.noise_px),
            from: 0.0,
            to: PLOT_END,
            logarithmic: false,
            ticks: ticks(&[0.0, 0.005, 0.01, 0.015, 0.02]),
        },
        y: Axis {
            label: "share of poses".to_owned(),
            from: 0.0,
            to: 1.0,
            logarithmic: false,
            ticks: ticks(&[0.0, 0.25, 0.5, 0.75, 1.0]),
        },
        curves: vec![curve(0.0, "#2f6fdb"), curve(LARGE, "#0f8a55")],
        marks: Vec::new(),
    }
    .to_svg()
}

/// The town with the loop and some of the fixes.
pub(super) fn map(scene: &Scene, stops: &[Stop], cases: &[Case]) -> String {
    let frame = town();
    let place = |[east, north]: [f64; 2]| -> Wgs84 { frame.wgs84_from_local([east, north, 0.0]) };
    let building = |(number, tower): (usize, &daymark_fixtures::Tower)| {
        let ground = tower.corners().into_iter().map(|corner| {
            let world = tower.site.world_from_model(corner.model);
            [world.x, world.y]
        });
        let outline = hull(&ground.collect::<Vec<_>>()).into_iter().map(place).collect();
        Building { name: tower.name.clone(), position: site(number).position, outline }
    };
    let answers = stops.iter().zip(cases).step_by(DRAWN);
    let observers = answers.filter_map(|(stop, case)| {
        case.answer.as_ref().map(|answer| Observer { fix: answer.fix, sees: Some(stop.tower) })
    });
    let way = stops.iter().chain(stops.first());
    let plan = Plan {
        title: format!("A walk among the eight towers: every {DRAWN}th fix"),
        buildings: scene.towers.iter().enumerate().map(building).collect(),
        observers: observers.collect(),
        way: way.map(|stop| place([stop.camera.position.x, stop.camera.position.y])).collect(),
    };
    // There are eight buildings.
    plan.to_svg().unwrap_or_default()
}
