//! Views against frames: with lists of look-alikes or without, from degenerate input, and what the ranking makes of it.

#[path = "support/frames.rs"]
mod frames;

use daymark_core::evidence::{CornerEvidence, EVIDENCE_UNIT};
use daymark_core::feature::{Feature, Signature};
use daymark_core::kernel::Portable;
use daymark_core::matcher::{Matcher, ViewMatch};
use daymark_core::point::ImagePoint;
use daymark_core::profile::Profile;
use daymark_core::query::QueryIndex;
use daymark_core::transform::{Homography, Shape};
use daymark_core::verdict::{Answer, Calibration, FalseAnswer, NoAnswer, Ranking, Recognition, Verdict};
use frames::{FRAME, Frame, QUERY, STORED, read, recognize, set, stored, table, tower};

fn mirrored(pixels: &[u8]) -> Vec<u8> {
    pixels.chunks_exact(320).flat_map(|row| row.iter().rev().copied()).collect()
}

fn matched<const BLOCKS: usize>(view: &Frame, frame: &Frame) -> (Option<ViewMatch>, Vec<CornerEvidence>) {
    let mut index = Box::new(QueryIndex::<QUERY>::new());
    index.arrange(frame.view());
    let mut matcher = Box::new(Matcher::<STORED, { 2 * STORED }, BLOCKS>::new());
    let mut distances = vec![0; STORED * QUERY];
    let matched = matcher.match_view(&Portable, view.view(), frame.view(), &index, &mut distances);
    (matched, matcher.latest_corners().to_vec())
}

#[test]
fn lists_of_look_alikes_change_nothing() {
    let views: Vec<Frame> = (1..=8).map(|number| stored(&tower(number, "left"))).collect();
    let frames: Vec<Frame> = (1..=8).map(|number| read(&tower(number, "right"), FRAME)).collect();
    let (mut right, mut wrong) = (0, 0);
    for (v, view) in views.iter().enumerate() {
        for (f, frame) in frames.iter().enumerate() {
            let grid = matched::<0>(view, frame);
            assert_eq!(matched::<512>(view, frame), grid, "view {v}, frame {f}: all lists");
            assert_eq!(matched::<40>(view, frame), grid, "view {v}, frame {f}: lists for some corners");
            *(if v == f { &mut right } else { &mut wrong }) += usize::from(grid.0.is_some());
        }
    }
    assert!(right >= 6 && wrong >= 6, "hypotheses stand in right and wrong views: {right}, {wrong}");
}

#[test]
fn a_map_is_never_a_reflection() {
    let positive = |Homography([[a, b, c], [d, e, f], [g, h, i]])| {
        a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0
    };
    let mut maps = 0;
    for number in 1..=8 {
        let pixels = tower(number, "left");
        let view = stored(&pixels);
        // Read from a mirrored picture; and the view's own corners at mirrored places, which all agree on a reflection.
        let from_mirror = read(&mirrored(&pixels), FRAME);
        let flipped = |feature: Feature, [x, y]: [bool; 2]| {
            let flip = |p: i32, wanted, side: i32| if wanted { (side - 1) * 16 - p } else { p };
            let position = ImagePoint::new(flip(feature.position.x, x, 320), flip(feature.position.y, y, 240));
            Feature { position, ..feature }
        };
        let moved = |axes| set(view.view().iter().map(|feature| flipped(feature, axes)));
        for frame in [from_mirror, moved([true, false]), moved([false, true]), moved([true, true])] {
            if let Some(matched) = matched::<512>(&view, &frame).0 {
                assert!(positive(matched.frame_from_view), "tower {number}: {matched:?}");
                maps += 1;
            }
        }
    }
    assert!(maps >= 4, "some frames have a map at all: {maps}");
}

#[test]
fn degenerate_input_gives_no_confident_answer() {
    let view = stored(&tower(1, "left"));
    let all: Vec<Feature> = view.view().iter().collect();
    let at = |x, y| move |feature: &Feature| Feature { position: ImagePoint::new(x, y), ..*feature };
    let same = |feature: &Feature| Feature { signature: Signature([0; 2]), ..*feature };
    let in_line = |feature: &Feature| Feature { position: ImagePoint::new(feature.position.x, 900), ..*feature };
    let frames = [
        ("as it is", all.clone()),
        ("nothing", Vec::new()),
        ("one corner", all[..1].to_vec()),
        ("three corners", all[..3].to_vec()),
        ("all at one place", all.iter().map(at(2_000, 1_500)).collect()),
        ("all at a corner of the frame", all.iter().map(at(0, 0)).collect()),
        ("all far outside", all.iter().map(at(i32::MAX, i32::MIN)).collect()),
        ("one signature", all.iter().map(same).collect()),
        ("one signature at one place", all.iter().map(same).map(|feature| at(640, 640)(&feature)).collect()),
        ("all in a line", all.iter().map(in_line).collect()),
    ];
    let answer = |view: &Frame, frame: &Frame| {
        let mut ranking = Ranking::default();
        let (grid, lists) = (matched::<0>(view, frame), matched::<512>(view, frame));
        assert_eq!(grid, lists);
        if let Some(matched) = grid.0 {
            ranking.enter(0, 0, matched);
        }
        let calibration = Calibration::of(Profile::Handheld);
        ranking.judge(calibration, 1, frame.view().len(), FalseAnswer::ONE_PERCENT).verdict
    };
    // Corners on one spot or line agree on any map, but no enrolled view has them so: such views must not panic.
    let spread = ["as it is", "nothing", "one corner", "three corners", "one signature"];
    for (view_name, view) in &frames {
        for (frame_name, frame) in &frames {
            let verdict = answer(&set(view.iter().copied()), &set(frame.iter().copied()));
            let sound = (*view_name, *frame_name) == ("as it is", "as it is");
            let confident = !matches!(verdict, Verdict::Unknown(_));
            if spread.contains(view_name) {
                assert_eq!(confident, sound, "view {view_name}, frame {frame_name}: {verdict:?}");
            }
        }
    }
}

#[test]
fn less_memory_for_distances_than_a_view_needs_leaves_corners_out() {
    let pixels = tower(4, "left");
    let (view, frame) = (stored(&pixels), read(&pixels, FRAME));
    let mut index = Box::new(QueryIndex::<QUERY>::new());
    index.arrange(frame.view());
    let mut matcher = Box::new(Matcher::<STORED, { 2 * STORED }, 512>::new());
    for bytes in [0, 1, QUERY - 1, QUERY, 10 * QUERY, 50 * QUERY + 1] {
        let matched = matcher.match_view(&Portable, view.view(), frame.view(), &index, &mut vec![0; bytes]);
        let rows = bytes / frame.view().len();
        assert!(matched.is_none_or(|matched| usize::from(matched.supporting_corners) <= rows), "{bytes}: {matched:?}");
    }
}

#[test]
fn the_order_of_the_views_does_not_matter() {
    let views: Vec<Frame> = (1..=8).map(|number| stored(&tower(number, "left"))).collect();
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let slots: Vec<[&Frame; 1]> = views.iter().map(|view| [view]).collect();
    let forwards: Vec<(&str, &[&Frame])> = names.into_iter().zip(slots.iter().map(<[&Frame; 1]>::as_slice)).collect();
    let backwards: Vec<(&str, &[&Frame])> =
        names.into_iter().rev().zip(slots.iter().map(<[&Frame; 1]>::as_slice)).collect();
    let (forwards, backwards) = (table(&forwards), table(&backwards));
    let mut known = 0;
    for part in ["left", "right"] {
        for number in 1..=8 {
            let frame = read(&tower(number, part), FRAME);
            let (one, other) = (recognize(&forwards, &frame), recognize(&backwards, &frame));
            let said = |answer: Option<Answer>| answer.map(|answer| (answer.matched, answer.false_answer));
            assert_eq!(said(one.best), said(other.best), "tower {number} {part}");
            assert_eq!(said(one.runner_up), said(other.runner_up), "tower {number} {part}");
            let landmarks = (one.best.map(|best| best.landmark), other.best.map(|best| 7 - best.landmark));
            assert_eq!(landmarks.0, landmarks.1, "tower {number} {part}");
            if let Verdict::Known(answer) = one.verdict {
                assert_eq!(answer.landmark + 1, number, "{part}: the right tower");
                known += 1;
            }
        }
    }
    assert!(known >= 8, "most towers are known: {known} of 16");
}

#[test]
fn two_landmarks_that_share_a_view_are_ambiguous() {
    let pixels = tower(5, "left");
    let (view, frame) = (stored(&pixels), read(&pixels, FRAME));
    let alone = recognize(&table(&[("Hall", &[&view, &view])]), &frame);
    assert!(matches!(alone.verdict, Verdict::Known(_)), "{alone:?}");
    assert_eq!((alone.best.map(|best| best.view), alone.runner_up), (Some(0), None), "two views of one landmark");
    let shared = recognize(&table(&[("Hall", &[&view]), ("House", &[&view])]), &frame);
    let Verdict::Ambiguous(first, second) = shared.verdict else { panic!("{shared:?}") };
    assert_eq!((first.landmark, second.landmark), (0, 1));
    assert_eq!(first.matched, second.matched);
}

/// A match with this much evidence, in bits.
fn worth(bits: i32) -> ViewMatch {
    ViewMatch {
        evidence: bits * EVIDENCE_UNIT,
        corner_evidence: 0,
        support: 0,
        shape: Shape { scale: 1.0, ratio: 1.0, shear: [0.0; 2] },
        frame_from_view: Homography([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        supporting_corners: 0,
    }
}

/// What becomes of (landmark, bits) that come in this order, each as the next view.
fn ranked(entries: &[(u32, i32)], limit: FalseAnswer) -> Recognition {
    let mut ranking = Ranking::default();
    for (view, &(landmark, bits)) in (0..).zip(entries) {
        ranking.enter(landmark, view, worth(bits));
    }
    ranking.judge(Calibration::of(Profile::Handheld), entries.len() as u32, 300, limit)
}

fn places(recognition: &Recognition) -> [Option<(u32, u32)>; 2] {
    [recognition.best, recognition.runner_up].map(|answer| answer.map(|answer| (answer.landmark, answer.view)))
}

#[test]
fn the_runner_up_is_another_landmark_and_the_first_of_equals_stays() {
    let cases: [(&[(u32, i32)], [Option<(u32, u32)>; 2]); 7] = [
        (&[], [None, None]),
        (&[(0, 50)], [Some((0, 0)), None]),
        (&[(0, 50), (0, 60), (0, 55)], [Some((0, 1)), None]),
        (&[(0, 50), (1, 50), (2, 50)], [Some((0, 0)), Some((1, 1))]),
        (&[(0, 50), (1, 70), (1, 60)], [Some((1, 1)), Some((0, 0))]),
        (&[(0, 50), (1, 60), (0, 70), (1, 65)], [Some((0, 2)), Some((1, 3))]),
        (&[(0, 70), (0, 80), (1, 10), (2, 20)], [Some((0, 1)), Some((2, 3))]),
    ];
    for (entries, expected) in cases {
        assert_eq!(places(&ranked(entries, FalseAnswer::ONE_PERCENT)), expected, "{entries:?}");
    }
}

#[test]
fn an_answer_needs_a_small_probability_and_a_distance_of_ten_bits() {
    let limit = FalseAnswer::ONE_PERCENT;
    let verdict = |entries: &[(u32, i32)]| ranked(entries, limit).verdict;
    assert!(matches!(verdict(&[]), Verdict::Unknown(NoAnswer::EmptyTable)));
    assert!(matches!(verdict(&[(0, 5)]), Verdict::Unknown(NoAnswer::NotSure(_))));
    assert!(matches!(verdict(&[(0, 100), (1, 5)]), Verdict::Known(_)), "the second is not sure itself");
    assert!(matches!(verdict(&[(0, 100), (1, 90)]), Verdict::Known(_)));
    assert!(matches!(verdict(&[(0, 100), (1, 91)]), Verdict::Ambiguous(..)));
    assert!(matches!(verdict(&[(1, 91), (0, 100)]), Verdict::Ambiguous(..)));
    assert!(matches!(verdict(&[(0, 100), (0, 99)]), Verdict::Known(_)), "views of one landmark");
    let few = Ranking::default().judge(Calibration::of(Profile::Handheld), 9, 15, limit).verdict;
    assert!(matches!(few, Verdict::Unknown(NoAnswer::TooFewCorners { found: 15, needed: 16 })), "{few:?}");
}

#[test]
fn a_false_answer_is_likelier_in_a_larger_table_and_with_less_evidence() {
    for profile in Profile::ALL {
        let calibration = Calibration::of(profile);
        for bits in 0..200 {
            let p = |bits: i32, views| calibration.false_answer(bits * EVIDENCE_UNIT, views);
            let sizes = [1, 2, 3, 10, 100, 99_999, 250_000].map(|views| p(bits, views));
            assert!(sizes.is_sorted(), "{profile:?}, {bits} bits");
            assert!(p(bits + 1, 100) <= p(bits, 100), "{profile:?}, {bits} bits");
        }
        let (one, hundred) = (calibration.false_answer(40_000, 1), calibration.false_answer(40_000, 100));
        let ratio = hundred.probability() / one.probability();
        assert!((99.0..101.0).contains(&ratio), "a hundred views are a hundred chances: {ratio}");
    }
}

#[test]
fn a_limit_is_never_exceeded_by_its_representation() {
    let limits: Vec<FalseAnswer> = (0..=1_000).map(|i| FalseAnswer::at_most(f64::from(i) / 1_000.0)).collect();
    assert!(limits.is_sorted());
    for (i, limit) in (0..).zip(&limits) {
        let (asked, kept) = (f64::from(i) / 1_000.0, limit.probability());
        assert!(kept <= asked * (1.0 + 1e-12) && kept >= asked * 0.99, "{asked}: {kept}");
    }
    assert_eq!(FalseAnswer::at_most(0.01), FalseAnswer::ONE_PERCENT);
    for certain in [1.0, 2.0, f64::INFINITY, f64::NAN] {
        assert_eq!(FalseAnswer::at_most(certain), FalseAnswer::CERTAIN);
    }
    assert_eq!(FalseAnswer::at_most(-1.0), FalseAnswer::at_most(0.0));
}
