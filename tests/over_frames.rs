//! Answers over the frames of a camera: when they are given, withdrawn, replaced, and what copies of a frame are worth.

use daymark_core::evidence::EVIDENCE_UNIT;
use daymark_core::matcher::ViewMatch;
use daymark_core::over_frames::{Change, EvidenceOverFrames, UNUSABLE_LIMIT, WINDOW, Withdrawal};
use daymark_core::transform::{Homography, Shape};
use daymark_core::verdict::{Answer, FalseAnswer, NoAnswer, Recognition, Verdict};

type Watched = EvidenceOverFrames<3>;

/// A landmark that one frame takes for false with this probability. Its evidence follows the probability.
fn answer(landmark: u32, probability: f64) -> Answer {
    let false_answer = FalseAnswer::at_most(probability);
    let evidence = 40 * EVIDENCE_UNIT + 4 * false_answer.surprise();
    let frame_from_view = Homography([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let shape = Shape { scale: 1.0, ratio: 1.0, shear: [0.0; 2] };
    let matched =
        ViewMatch { evidence, corner_evidence: evidence, support: 0, shape, frame_from_view, supporting_corners: 30 };
    Answer { landmark, view: landmark, matched, false_answer }
}

fn seen(best: Option<Answer>, runner_up: Option<Answer>) -> Recognition {
    let verdict = match best {
        Some(best) if best.false_answer <= FalseAnswer::ONE_PERCENT => Verdict::Known(best),
        Some(best) => Verdict::Unknown(NoAnswer::NotSure(best)),
        None => Verdict::Unknown(NoAnswer::NothingFits),
    };
    Recognition { verdict, best, runner_up, views: 20, corners: 400 }
}

fn one(landmark: u32, probability: f64) -> Recognition {
    seen(Some(answer(landmark, probability)), None)
}

fn nothing() -> Recognition {
    seen(None, None)
}

fn watched() -> Watched {
    Watched::new(FalseAnswer::ONE_PERCENT)
}

fn given(change: Change) -> Option<u32> {
    change.given.map(|belief| belief.landmark)
}

#[test]
fn surprise_and_probability_are_two_ways_to_say_the_same() {
    for (probability, bits) in [(1.0, 0.0), (0.5, 1.0), (0.01, 6.643_9), (1e-6, 19.931_6), (1e-30, 99.657_8)] {
        let surprise = f64::from(FalseAnswer::at_most(probability).surprise()) / f64::from(EVIDENCE_UNIT);
        assert!((surprise - bits).abs() < 0.01, "{probability}: {surprise}");
        let back = FalseAnswer::of_surprise(FalseAnswer::at_most(probability).surprise()).probability();
        assert!((back / probability - 1.0).abs() < 0.01, "{probability}: {back}");
    }
    assert_eq!(FalseAnswer::of_surprise(-5), FalseAnswer::CERTAIN);
    assert_eq!(FalseAnswer::of_surprise(i32::MAX), FalseAnswer::at_most(0.0));
}

#[test]
fn a_clear_frame_is_enough_and_one_percent_in_one_frame_is_not() {
    assert_eq!(given(watched().frame(&one(7, 1e-6))), Some(7));
    assert_eq!(given(watched().frame(&one(7, 0.01))), None, "every frame is a look, and looks are many");
}

#[test]
fn weak_frames_add_up_and_copies_add_little() {
    // 1 in 300 a frame: 4.2 bits, of which no number of frames makes more than 7.5.
    let mut watched = watched();
    let answers: Vec<_> = (0..WINDOW).map(|_| given(watched.frame(&one(3, 1.0 / 300.0)))).collect();
    let first = answers.iter().position(Option::is_some).expect("an answer");
    assert!((2..WINDOW).contains(&first), "{answers:?}");
    // 1 in 150 a frame is never enough for 1 in 100, however long the same picture stays before the lens.
    let mut watched = self::watched();
    assert!((0..10_000).all(|_| given(watched.frame(&one(3, 1.0 / 150.0))).is_none()));
    let belief = watched.belief(3).expect("followed");
    assert_eq!(usize::from(belief.frames), WINDOW);
    assert!(belief.false_answer() > FalseAnswer::ONE_PERCENT, "{belief:?}");
}

#[test]
fn copies_of_a_frame_never_make_the_promise_false_down_to_one_in_770() {
    for limit in [0.3, 0.1, 0.03, 0.01, 0.003, 1.0 / 770.0] {
        let mut watched = Watched::new(FalseAnswer::at_most(limit));
        // A wrong landmark that reaches the limit in exactly that share of scenes.
        assert!((0..100).all(|_| given(watched.frame(&one(1, limit * 1.01))).is_none()), "{limit}");
    }
}

#[test]
fn what_is_gone_is_withdrawn_at_the_third_frame() {
    let mut watched = watched();
    for _ in 0..20 {
        watched.frame(&one(7, 1e-12));
    }
    let changes: Vec<_> = (0..4).map(|_| watched.frame(&nothing()).withdrawn).collect();
    assert_eq!(changes, [None, None, Some((7, Withdrawal::Gone)), None]);
    assert_eq!((watched.standing(), watched.best()), (None, None), "and forgotten");
    // A frame that was missed on the way does not count for long.
    watched.frame(&one(7, 1e-6));
    for _ in 0..10 {
        assert_eq!(watched.frame(&nothing()), Change::default());
        assert_eq!(watched.frame(&nothing()), Change::default());
        assert_eq!(watched.frame(&one(7, 1e-6)), Change::default());
    }
}

#[test]
fn another_landmark_replaces_the_first_at_once() {
    let mut watched = watched();
    for _ in 0..8 {
        watched.frame(&one(7, 1e-4));
    }
    let change = watched.frame(&one(8, 1e-9));
    assert_eq!((change.withdrawn, given(change)), (Some((7, Withdrawal::Replaced)), Some(8)));
}

#[test]
fn two_that_fit_alike_are_no_answer() {
    let mut watched = watched();
    let both = seen(Some(answer(1, 1e-6)), Some(answer(2, 1.2e-6)));
    assert!((0..20).all(|_| given(watched.frame(&both)).is_none()));
    // One that stands is withdrawn when the other catches up.
    let mut watched = self::watched();
    watched.frame(&one(1, 1e-6));
    let withdrawn: Vec<_> = (0..20).filter_map(|_| watched.frame(&both).withdrawn).collect();
    assert_eq!(withdrawn, [(1, Withdrawal::Ambiguous)]);
    // Only a frame's choice counts: 10 bits ahead speaks against the other.
    let mut watched = self::watched();
    assert_eq!(given(watched.frame(&seen(Some(answer(1, 1e-9)), Some(answer(2, 1e-4))))), Some(1));
    assert_eq!(watched.belief(2), None);
}

#[test]
fn unusable_frames_say_nothing_until_there_are_five() {
    let mut watched = watched();
    watched.frame(&one(7, 1e-6));
    let mut withdrawn = || watched.unusable().withdrawn;
    assert!((1..UNUSABLE_LIMIT).all(|_| withdrawn().is_none()));
    assert_eq!(withdrawn(), Some((7, Withdrawal::Unusable)));
    assert_eq!(withdrawn(), None, "once");
}

#[test]
fn a_new_scene_keeps_only_what_it_shows() {
    let mut watched = watched();
    for _ in 0..8 {
        watched.frame(&one(7, 1e-9));
    }
    watched.new_scene();
    assert_eq!(watched.frame(&one(7, 1e-9)), Change::default(), "it is still there");
    watched.new_scene();
    assert_eq!(watched.frame(&nothing()).withdrawn, Some((7, Withdrawal::Gone)));
}

#[test]
fn an_exchanged_table_keeps_the_answer_under_its_new_number() {
    let mut watched = watched();
    watched.frame(&one(7, 1e-9));
    assert_eq!(watched.renumber(|old| (old == 7).then_some(2)), Change::default());
    assert_eq!(watched.frame(&one(2, 1e-9)), Change::default());
    assert_eq!(watched.standing(), Some(2));
    assert_eq!(watched.renumber(|_| None).withdrawn, Some((2, Withdrawal::Ended)));
    assert_eq!(watched.best(), None);
}

#[test]
fn when_all_places_are_taken_the_weakest_goes_but_never_the_answer() {
    let mut watched = Watched::new(FalseAnswer::at_most(1e-5));
    for landmark in [1, 2, 3, 4] {
        watched.frame(&one(landmark, 1e-3 / f64::from(landmark)));
    }
    assert_eq!(watched.best().map(|belief| belief.landmark), Some(4), "the latest has the most evidence");
    assert_eq!(watched.belief(1), None, "the oldest has lost its evidence");
    // The answer keeps its place, however many others come by.
    let mut watched = EvidenceOverFrames::<1>::new(FalseAnswer::ONE_PERCENT);
    watched.frame(&one(9, 1e-6));
    watched.frame(&one(1, 1e-6));
    assert_eq!(watched.standing(), Some(9));
    assert!(watched.belief(9).is_some() && watched.belief(1).is_none());
}
