//! What the demo looks at: eight buildings, and frames of them and of others.

use daymark_core::table::{GeoPosition, Kind};
use daymark_fixtures::{Camera, Clutter, Frame, Lens, Light, Site, Stand, Tower, Trial, Vec3, View, Wgs84, scene};

/// What a frame of the demo is there to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lesson {
    /// An enrolled building under other conditions.
    Known,
    /// One of two buildings of the same shape.
    Twin,
    /// Something that is not in the table.
    Unknown,
}

/// A frame of the demo.
#[derive(Debug)]
pub(super) struct Shot {
    /// Good for a file's name.
    pub name: String,
    /// The enrolled building that it shows, if it shows one.
    pub shows: Option<String>,
    /// What a person would say about it.
    pub remark: &'static str,
    /// What it is there to show.
    pub lesson: Lesson,
    /// How it is taken; none for a covered lens.
    pub view: Option<View>,
}

/// What the enrolled buildings are, in the order of their numbers.
pub(super) const KINDS: [Kind; 8] =
    [Kind::Tower, Kind::Building, Kind::Tower, Kind::House, Kind::Building, Kind::Building, Kind::Castle, Kind::Church];

/// Where a tower stands in the town; within a metre.
pub(super) fn position(index: usize) -> Option<GeoPosition> {
    let at = Wgs84::from_world(scene::TOWN.get(index)?.world_from_model(Vec3::new(0.0, 0.0, 0.0)));
    let e7 = |degrees: f64| libm::round(degrees * 1e7) as i32;
    Some(GeoPosition { latitude_e7: e7(at.latitude), longitude_e7: e7(at.longitude), error_dm: 10 })
}

/// The frames, in the order in which they are told.
pub(super) fn shots(towers: &[Tower; 8], lens: Lens) -> Vec<Shot> {
    let of = |index: usize, trial: Trial, lesson, remark| {
        let tower = &towers[index];
        let view = View::trial(tower, trial, lens);
        Shot { name: view.name.clone(), shows: Some(tower.name.clone()), remark, lesson, view: Some(view) }
    };
    let other = |seed: u64, remark| {
        let view = from_elsewhere(View::unknown(seed, lens), lens);
        Shot { name: view.name.clone(), shows: None, remark, lesson: Lesson::Unknown, view: Some(view) }
    };
    vec![
        of(0, Trial::Between, Lesson::Known, "from between the two enrolled places"),
        of(2, Trial::Evening, Lesson::Known, "in low evening sun from the other side"),
        of(3, Trial::Noisy, Lesson::Known, "through a cheap, noisy camera"),
        of(5, Trial::Cluttered, Lesson::Known, "half hidden behind trees and vans"),
        of(6, Trial::Rolled, Lesson::Known, "with the camera tilted by 12 degrees"),
        of(7, Trial::Far, Lesson::Known, "from one and a half times as far"),
        of(1, Trial::Overcast, Lesson::Twin, "one of two buildings of the same shape, under a grey sky"),
        of(4, Trial::Overcast, Lesson::Twin, "the other one, from the same place"),
        other(1, "a building that nobody enrolled"),
        other(15, "another one"),
        Shot {
            name: "covered-lens".to_owned(),
            shows: None,
            remark: "a hand over the lens",
            lesson: Lesson::Unknown,
            view: None,
        },
    ]
}

/// The view as a passer-by takes it: nearer, from another side, under a grey sky. All towers stand on the same paving,
/// which would otherwise be recognized, and rightly so.
fn from_elsewhere(mut view: View, lens: Lens) -> View {
    let height = view.scene.towers.iter().map(Tower::height).fold(0.0, f64::max);
    let stand = Stand { angle: -30.0, distance: height * 0.45 + 8.0, eye: 9.0, aim: height * 0.6 };
    view.camera = Camera::before(Site::ORIGIN, stand, lens);
    view.scene.light = Light::overcast();
    view.scene.clutter = Clutter::none(view.scene.clutter.seed);
    view
}

/// The frame's colours: red, green, blue, row by row.
pub(super) fn render(shot: &Shot, lens: Lens) -> Vec<u8> {
    match &shot.view {
        Some(view) => {
            let Frame { rgb, .. } = view.render();
            rgb
        }
        None => vec![12; (lens.width * lens.height * 3) as usize],
    }
}
