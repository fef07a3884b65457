//! The figures of an evaluation, counted from its frames.

use serde::Serialize;

use super::{Judged, Outcome};
use crate::order;

/// Lower ends of the bins of the reliability table; a bin reaches up to the next, the last to 1 and includes it.
const BINS: [f64; 7] = [0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0];

/// What is answered if the answer may be false with at most a stated probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stated {
    /// The probability.
    pub stated: f64,
    /// Negatives that were taken for a building.
    pub false_accepts_on_negatives: usize,
    /// The same as a share of the negatives.
    pub false_accept_rate: f64,
    /// Negatives for which two buildings fitted and none was named.
    pub ambiguous_on_negatives: usize,
    /// Queries whose building was named.
    pub right: usize,
    /// Queries for which another building was named.
    pub wrong: usize,
    /// Queries for which two buildings fitted and none was named.
    pub ambiguous: usize,
    /// Queries for which no building was named.
    pub unknown: usize,
}

/// A row of the reliability table: frames by the stated probability that their best building is false.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// The stated probability is at least this.
    pub stated_from: f64,
    /// And below this, or 1.
    pub stated_to: f64,
    /// The mean of the stated probabilities.
    pub mean_stated: f64,
    /// Queries whose best building is right.
    pub right: usize,
    /// Queries whose best building is wrong.
    pub wrong: usize,
    /// Negatives.
    pub negatives: usize,
    /// The share of wrong queries and negatives.
    pub observed_false: f64,
    /// The share of the negatives that have this or a smaller stated probability: what the stated probability is about.
    pub negatives_up_to_here: f64,
}

/// The figures of the pictures of one source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Source {
    /// The folder.
    pub source: String,
    /// Queries from there.
    pub queries: usize,
    /// Of these, with the right building in the first place.
    pub right_at_1: usize,
    /// Of these, with more evidence than any false one of all sources.
    pub right_at_zero_false_accepts: usize,
    /// Of these, answered right at the probability that was asked for.
    pub right: usize,
    /// Of these, answered wrong at the probability that was asked for.
    pub wrong: usize,
    /// Negatives from there.
    pub negatives: usize,
    /// Of these, taken for a building at the probability that was asked for.
    pub false_accepts: usize,
}

/// The figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scores {
    /// Queries.
    pub queries: usize,
    /// Negatives.
    pub negatives: usize,
    /// The share of queries whose building has the most evidence.
    pub recall_at_1: f64,
    /// The share of queries whose building has more evidence than any building for any negative, and any wrong
    /// building for any query.
    pub recall_at_zero_false_accepts: f64,
    /// The evidence that these must exceed.
    pub most_false_evidence_bits: Option<f64>,
    /// What is answered at each stated probability.
    pub at_stated_probability: Vec<Stated>,
    /// Stated against observed.
    pub reliability: Vec<Bin>,
    /// The figures by source.
    pub sources: Vec<Source>,
}

impl Scores {
    /// Counts. `stated` are the probabilities of [`Judged::at_stated`].
    pub fn new(frames: &[Judged], stated: &[f64]) -> Self {
        let queries = frames.iter().filter(|frame| frame.shows.is_some()).count();
        let threshold = most_false_evidence(frames);
        let right_at_1 = frames.iter().filter(|frame| frame.right_at_1).count();
        let at_zero = frames.iter().filter(|frame| above(frame, threshold)).count();
        Self {
            queries,
            negatives: frames.len() - queries,
            recall_at_1: share(right_at_1, queries),
            recall_at_zero_false_accepts: share(at_zero, queries),
            most_false_evidence_bits: threshold,
            at_stated_probability: (0..).zip(stated).map(|(place, &p)| Stated::new(frames, place, p)).collect(),
            reliability: reliability(frames),
            sources: sources(frames, threshold),
        }
    }
}

/// The part of the whole; 0 of nothing.
pub fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// Whether the frame's best building is false: it is a negative, or the building is another.
fn is_false(frame: &Judged) -> bool {
    frame.best.is_some() && !frame.right_at_1
}

fn most_false_evidence(frames: &[Judged]) -> Option<f64> {
    let evidence = |frame: &Judged| frame.best.as_ref().map(|best| best.evidence_bits);
    frames.iter().filter(|frame| is_false(frame)).filter_map(evidence).max_by(f64::total_cmp)
}

fn above(frame: &Judged, threshold: Option<f64>) -> bool {
    let evidence = frame.best.as_ref().map(|best| best.evidence_bits);
    frame.right_at_1 && evidence.is_some_and(|evidence| threshold.is_none_or(|threshold| evidence > threshold))
}

impl Stated {
    fn new(frames: &[Judged], place: usize, stated: f64) -> Self {
        let count = |query: bool, outcome: Outcome| {
            let there =
                |frame: &&Judged| frame.shows.is_some() == query && frame.at_stated.get(place) == Some(&outcome);
            frames.iter().filter(there).count()
        };
        let negatives = frames.iter().filter(|frame| frame.shows.is_none()).count();
        let false_accepts = count(false, Outcome::Wrong);
        Self {
            stated,
            false_accepts_on_negatives: false_accepts,
            false_accept_rate: share(false_accepts, negatives),
            ambiguous_on_negatives: count(false, Outcome::Ambiguous),
            right: count(true, Outcome::Right),
            wrong: count(true, Outcome::Wrong),
            ambiguous: count(true, Outcome::Ambiguous),
            unknown: count(true, Outcome::Unknown),
        }
    }
}

/// A frame for which nothing fits states 1.
fn stated(frame: &Judged) -> f64 {
    frame.best.as_ref().map_or(1.0, |best| best.probability_false_answer)
}

fn reliability(frames: &[Judged]) -> Vec<Bin> {
    let negatives = frames.iter().filter(|frame| frame.shows.is_none()).count();
    let mut so_far = 0;
    let mut bins = Vec::new();
    for (place, ends) in BINS.windows(2).enumerate() {
        let (from, to) = (ends[0], ends[1]);
        let last = place + 2 == BINS.len();
        let inside = |frame: &&Judged| stated(frame) >= from && (stated(frame) < to || last);
        let members: Vec<&Judged> = frames.iter().filter(inside).collect();
        let right = members.iter().filter(|frame| frame.right_at_1).count();
        let here = members.iter().filter(|frame| frame.shows.is_none()).count();
        so_far += here;
        bins.push(Bin {
            stated_from: from,
            stated_to: to,
            mean_stated: members.iter().map(|frame| stated(frame)).sum::<f64>() / members.len().max(1) as f64,
            right,
            wrong: members.len() - right - here,
            negatives: here,
            observed_false: share(members.len() - right, members.len()),
            negatives_up_to_here: share(so_far, negatives),
        });
    }
    bins
}

fn sources(frames: &[Judged], threshold: Option<f64>) -> Vec<Source> {
    let mut names: Vec<&str> = frames.iter().map(|frame| frame.source.as_str()).collect();
    order::sort(&mut names);
    names.dedup();
    let of = |name: &str| {
        let count = |query: bool, keep: &dyn Fn(&Judged) -> bool| {
            let from_there = frames.iter().filter(|frame| frame.source == name && frame.shows.is_some() == query);
            from_there.filter(|frame| keep(frame)).count()
        };
        Source {
            source: name.to_owned(),
            queries: count(true, &|_| true),
            right_at_1: count(true, &|frame| frame.right_at_1),
            right_at_zero_false_accepts: count(true, &|frame| above(frame, threshold)),
            right: count(true, &|frame| frame.outcome == Outcome::Right),
            wrong: count(true, &|frame| frame.outcome == Outcome::Wrong),
            negatives: count(false, &|_| true),
            false_accepts: count(false, &|frame| frame.outcome == Outcome::Wrong),
        }
    };
    names.into_iter().map(of).collect()
}

/// The 95 % interval of a share of which `part` of `whole` was observed (Wilson 1927); from 0 to 1 of nothing.
pub fn interval(part: usize, whole: usize) -> [f64; 2] {
    const Z: f64 = 1.96;
    if whole == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (whole as f64, share(part, whole));
    let centre = p + Z * Z / (2.0 * n);
    let reach = Z * libm::sqrt(p * (1.0 - p) / n + Z * Z / (4.0 * n * n));
    let scale = 1.0 + Z * Z / n;
    [((centre - reach) / scale).max(0.0), ((centre + reach) / scale).min(1.0)]
}

/// How many queries are right against how many frames are falsely accepted, while the evidence that is asked for falls.
pub fn recall_curve(frames: &[Judged]) -> Vec<(usize, usize)> {
    let mut ranked: Vec<(f64, bool)> = frames
        .iter()
        .filter_map(|frame| frame.best.as_ref().map(|best| (best.evidence_bits, frame.right_at_1)))
        .collect();
    // Of equal evidence the false ones first: a limit lets in all or none.
    order::sort_by(&mut ranked, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut curve = vec![(0, 0)];
    let (mut false_accepts, mut right) = (0, 0);
    for (_, is_right) in ranked {
        *(if is_right { &mut right } else { &mut false_accepts }) += 1;
        curve.push((false_accepts, right));
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::super::Guess;
    use super::*;

    fn frame(shows: Option<&str>, taken_for: Option<&str>, evidence_bits: f64, p: f64) -> Judged {
        let right_at_1 = shows.is_some() && shows == taken_for;
        let outcome = |limit: f64| match taken_for {
            Some(_) if p <= limit && right_at_1 => Outcome::Right,
            Some(_) if p <= limit => Outcome::Wrong,
            _ => Outcome::Unknown,
        };
        Judged {
            file: String::new(),
            shows: shows.map(str::to_owned),
            source: shows.unwrap_or("sky").to_owned(),
            best: taken_for.map(|name| Guess {
                building: name.to_owned(),
                gallery_file: String::new(),
                evidence_bits,
                probability_false_answer: p,
                frame_from_view: [[0.0; 3]; 3],
            }),
            runner_up: None,
            right_at_1,
            outcome: outcome(0.01),
            corners: 500,
            at_stated: vec![outcome(0.1), outcome(0.01)],
        }
    }

    fn frames() -> Vec<Judged> {
        vec![
            frame(Some("a"), Some("a"), 50.0, 1e-5),
            frame(Some("a"), Some("a"), 20.0, 0.005),
            frame(Some("b"), Some("b"), 12.0, 0.05),
            frame(Some("b"), Some("a"), 14.0, 0.02),
            frame(Some("b"), None, 0.0, 1.0),
            frame(None, Some("a"), 20.0, 0.005),
            frame(None, Some("b"), 3.0, 1.0),
        ]
    }

    #[test]
    fn figures_are_counted() {
        let scores = Scores::new(&frames(), &[0.1, 0.01]);
        assert_eq!((scores.queries, scores.negatives), (5, 2));
        assert_eq!((scores.recall_at_1, scores.recall_at_zero_false_accepts), (0.6, 0.2), "strictly above 20 bits");
        assert_eq!(scores.most_false_evidence_bits, Some(20.0));
        let counts = |stated: &Stated| (stated.false_accepts_on_negatives, stated.right, stated.wrong, stated.unknown);
        assert_eq!(scores.at_stated_probability.iter().map(counts).collect::<Vec<_>>(), [(1, 3, 1, 1), (1, 2, 0, 3)]);
        let source = |place: usize| (scores.sources[place].queries, scores.sources[place].right_at_1);
        assert_eq!([source(0), source(1), source(2)], [(2, 2), (3, 1), (0, 0)]);
        assert_eq!((scores.sources[2].negatives, scores.sources[2].false_accepts), (2, 1));
    }

    #[test]
    fn every_frame_is_in_one_bin() {
        let bins = reliability(&frames());
        let counts: Vec<_> = bins.iter().map(|bin| [bin.right, bin.wrong, bin.negatives]).collect();
        assert_eq!(counts, [[1, 0, 0], [0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 0, 0], [0, 1, 1]]);
        assert_eq!(bins[2].negatives_up_to_here, 0.5);
        assert_eq!(bins[2].observed_false, 0.5);
        assert_eq!(bins[5].negatives_up_to_here, 1.0);
    }

    #[test]
    fn nothing_divides_by_zero() {
        let scores = Scores::new(&[], &[0.1]);
        assert_eq!((scores.recall_at_1, scores.at_stated_probability[0].false_accept_rate), (0.0, 0.0));
        assert_eq!(interval(0, 0), [0.0, 1.0]);
        let [low, high] = interval(1, 100);
        assert!((low - 0.001_77).abs() < 1e-4 && (high - 0.054_5).abs() < 1e-4, "{low} {high}");
    }

    #[test]
    fn the_curve_lets_in_false_ones_of_equal_evidence_first() {
        assert_eq!(recall_curve(&frames()), [(0, 0), (0, 1), (1, 1), (1, 2), (2, 2), (2, 3), (3, 3)]);
    }
}
