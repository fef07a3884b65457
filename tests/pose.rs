//! The camera's pose from corners with known places: exact ones, noisy ones, wrong ones, and too little of them.

use daymark_core::camera::Intrinsics;
use daymark_core::camera::pose::{NoPose, PointInView, Pose, PoseSettings, PoseSolver};
use daymark_fixtures::distort::Distortion;
use daymark_fixtures::{Camera, Clutter, Lens, Scene, SeenCorner, Site, Stand, Tower, corners_of};

const SETTINGS: PoseSettings = PoseSettings::of_frame(640, 480);
const POINTS: usize = 128;

fn lens() -> Intrinsics {
    Intrinsics::centred(Lens::VGA.focal, 640, 480).expect("a lens")
}

fn solve(points: &[PointInView]) -> Result<Pose, NoPose> {
    PoseSolver::<POINTS>::new().solve(points, &lens(), &SETTINGS)
}

/// What a camera sees of a tower, every so many corners of it.
fn view(tower: usize, angle: f64, far: f64, count: usize) -> (Camera, Vec<PointInView>) {
    let tower = Tower::eight()[tower].clone();
    let height = tower.height();
    let stand = Stand { angle, distance: far * (height * 1.06 + 10.0), eye: 1.7, aim: height * 0.47 };
    let camera = Camera::before(Site::ORIGIN, stand, Lens::VGA);
    let scene = Scene::alone(tower, 1);
    let clutter = Clutter { trees: 0, poles: 0, boxes: 0, ..scene.clutter };
    let seen: Vec<SeenCorner> = corners_of(&scene.with_clutter(clutter), &camera);
    let seen: Vec<_> = seen.into_iter().filter(|corner| corner.visible).collect();
    let step = (seen.len() / count).max(1);
    let points = seen.iter().step_by(step).take(count).map(|corner| PointInView {
        model: [corner.model.x, corner.model.y, corner.model.z],
        image: [corner.image.x, corner.image.y],
    });
    (camera, points.collect())
}

fn spoil(points: &mut [PointInView], noise: f64, wrong: usize, random: &mut Distortion) {
    for point in points.iter_mut() {
        point.image = point.image.map(|x| x + noise * random.normal());
    }
    let count = points.len();
    for number in 0..wrong {
        points[(number * 7 + 3) % count].image = [640.0 * random.unit(), 480.0 * random.unit()];
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn truth(camera: &Camera) -> [f64; 3] {
    [camera.position.x, camera.position.y, camera.position.z]
}

/// `v^T C^-1 v` of the first three by Cramer's rule.
fn mahalanobis(covariance: &[[f64; 6]; 6], v: [f64; 3]) -> f64 {
    let m = [0, 1, 2].map(|i| [0, 1, 2].map(|j| covariance[i][j]));
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let all = determinant(m);
    (0..3)
        .map(|column| {
            let mut replaced = m;
            for (row, value) in replaced.iter_mut().zip(v) {
                row[column] = value;
            }
            v[column] * determinant(replaced) / all
        })
        .sum()
}

#[test]
fn exact_corners_give_the_exact_pose() {
    for tower in 0..8 {
        for angle in [-35.0, -8.0, 0.0, 22.0, 60.0] {
            for far in [0.7, 1.0, 3.0] {
                let (camera, points) = view(tower, angle, far, 60);
                let pose = solve(&points).unwrap_or_else(|no| panic!("tower {tower}, {angle} degrees: {no}"));
                let off = distance(pose.camera_from_model.centre(), truth(&camera));
                assert!(off < 1e-6 * pose.range(), "tower {tower}, {angle} degrees, {far} times: {off} m");
                assert_eq!(pose.inliers, points.len());
                let forward = camera.view_from_world[2];
                assert!(distance(pose.camera_from_model.axis(), [forward.x, forward.y, forward.z]) < 1e-6);
            }
        }
    }
}

#[test]
fn wrong_correspondences_are_left_out_and_the_covariance_is_true() {
    let mut random = Distortion::new(11);
    let (mut answers, mut inside, mut errors) = (0, 0, Vec::new());
    for case in 0..400 {
        let (camera, mut points) = view(case % 8, 70.0 * random.unit() - 35.0, 0.8 + random.unit(), 60);
        let wrong = points.len() * 3 / 10;
        spoil(&mut points, 0.5, wrong, &mut random);
        let Ok(pose) = solve(&points) else { continue };
        answers += 1;
        let off: Vec<f64> = pose.camera_from_model.centre().iter().zip(truth(&camera)).map(|(a, b)| a - b).collect();
        let square = mahalanobis(&pose.covariance, [off[0], off[1], off[2]]);
        inside += usize::from(square < 7.814_73);
        errors.push(distance([off[0], off[1], off[2]], [0.0; 3]) / pose.range());
    }
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    let share = f64::from(inside as u32) / f64::from(answers);
    println!("{answers} answers, median {median:.5}, worst {:.5}, inside {share:.3}", errors[errors.len() - 1]);
    assert!(answers >= 392, "{answers} of 400 have a pose");
    assert!(median < 0.005, "median error {median} of the range");
    assert!((0.90..0.985).contains(&share), "{share} of the truths in the 95 % ellipsoid");
}

/// The same bits on every machine: a pose that was drawn, with its covariance, as one number.
#[test]
fn these_are_the_bits() {
    let (_, mut points) = view(5, 17.0, 1.1, 60);
    spoil(&mut points, 0.5, 18, &mut Distortion::new(4));
    let pose = solve(&points).expect("a pose");
    let numbers = pose.camera_from_model.rotation().as_flattened().iter().chain(pose.covariance.as_flattened());
    let hash = numbers.fold(0xcbf2_9ce4_8422_2325_u64, |hash, number| {
        (hash ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
    });
    assert_eq!((pose.inliers, format!("{hash:016x}")), (42, String::from("8094d3adbc9fd654")));
}
