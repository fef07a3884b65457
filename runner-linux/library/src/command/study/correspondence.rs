//! `daymark study correspondence`: the hand-picked corners of a tower, matched by their places alone.
//!
//! First under random affine maps, where the thesis' model is exact and only noise and missing corners stand in the way;
//! then between views of the tower itself, where relief breaks the model. Each line is many seeds; each seed picks its own
//! map or pair of views, noise, order and missing corners.

use std::fmt::Write as _;
use std::io::{self, Write};

use daymark_core::geometry::arrangement::{Arrangement, scratch_length};
use daymark_core::geometry::correspond::{Correspond, Settings, Sources};
use daymark_core::geometry::proposal::Pairing;
use daymark_core::geometry::quad::Tolerance;
use daymark_core::geometry::shift::{LayerQuad, plain_shift, quads_of};
use daymark_core::geometry::{GeometryError, HullLayers};
use daymark_core::point::{ImagePoint, SUBPIXEL};
use daymark_fixtures::Tower;
use daymark_fixtures::distort::{Distortion, NumberedPoint};
use daymark_fixtures::pick::{PICKS, REFERENCE_ANGLE};
use serde::Serialize;

use crate::command::{CommandError, Outcome};
use crate::parallel;

/// Version of the form of `--json`.
const SCHEMA_VERSION: u32 = 1;
/// Corners of a view, at most.
const POINTS: usize = 64;
type Workspace = Correspond<POINTS, { POINTS / 3 }, 512, 2_600>;
type Layers = HullLayers<POINTS, { POINTS / 3 }>;

const NOISE_PX: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];
const MISSING: [usize; 4] = [0, 5, 10, 20];
const VIEW_ANGLES: [u32; 8] = [5, 10, 15, 20, 30, 40, 50, 60];
/// Noise of the corners of the rendered pairs, px.
const VIEW_NOISE_PX: f64 = 0.5;
/// The first of two views stands this many degrees around the tower.
const FIRST_VIEW: std::ops::Range<f64> = -20.0..40.0;
/// Seeds of lines are this far apart.
const SEEDS_A_LINE: u64 = 1_000_000;

/// Arguments of `daymark study correspondence`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which of the eight towers
    #[arg(long, value_name = "1..8", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    tower: u32,
    /// Random cases a line: more give steadier figures
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=SEEDS_A_LINE))]
    seeds: u64,
    /// Another set of random cases
    #[arg(long, value_name = "N", default_value_t = 0)]
    first_seed: u64,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

/// Ways of matching, weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    /// The thesis' rule: layer by layer, best circular shift, 5 % of the area ratio.
    Plain,
    /// Hull quads that the noise allows, by mutual support.
    TolerantHulls,
    /// Local arrangements, by mutual support.
    LocalArrangements,
    /// Both, verified.
    Verified,
}

impl Method {
    const EACH: [Self; 4] = [Self::Plain, Self::TolerantHulls, Self::LocalArrangements, Self::Verified];

    const fn title(self) -> &'static str {
        match self {
            Self::Plain => "plain rule",
            Self::TolerantHulls => "tolerant hulls",
            Self::LocalArrangements => "arrangements",
            Self::Verified => "both, verified",
        }
    }
}

/// What a method did in one case or in all of a line.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    common: usize,
    right: usize,
    wrong: usize,
    answers: usize,
}

impl Tally {
    fn add(self, other: Self) -> Self {
        Self {
            common: self.common + other.common,
            right: self.right + other.right,
            wrong: self.wrong + other.wrong,
            answers: self.answers + other.answers,
        }
    }

    fn matched(self) -> f64 {
        self.right as f64 / self.common.max(1) as f64
    }

    fn wrong_share(self) -> f64 {
        self.wrong as f64 / (self.right + self.wrong).max(1) as f64
    }
}

#[derive(Debug, Serialize)]
struct Score {
    method: Method,
    /// Right matches among the corners that both views have.
    matched_share: f64,
    /// Wrong ones among all matches.
    wrong_share: f64,
    wrong_matches: usize,
    /// Cases with any match at all.
    answers: usize,
}

#[derive(Debug, Serialize)]
struct Line {
    #[serde(skip_serializing_if = "Option::is_none")]
    view_angle_degree: Option<u32>,
    noise_px: f64,
    missing_corners: usize,
    common_corners_mean: f64,
    /// Cases without an answer of the verified matcher.
    no_answer: u64,
    scores: Vec<Score>,
}

#[derive(Debug, Serialize)]
struct Report {
    schema_version: u32,
    tower: u32,
    corners: usize,
    seeds: u64,
    first_seed: u64,
    affine: Vec<Line>,
    views: Vec<Line>,
    /// The smallest angle at which the verified matcher gives no answer in most cases.
    no_answer_from_degree: Option<u32>,
}

/// Runs the study.
///
/// # Errors
/// A tower whose corners do not fit, or a closed output.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let tower = &Tower::eight()[args.tower as usize - 1];
    let base = view(tower, REFERENCE_ANGLE);
    let seed = |line: usize, case: u64| args.first_seed.wrapping_add(line as u64 * SEEDS_A_LINE).wrapping_add(case);
    let mut affine = Vec::new();
    for missing in MISSING {
        for noise in NOISE_PX {
            let number = affine.len();
            let line = measure(args.seeds, |case| {
                let mut distortion = Distortion::new(seed(number, case));
                let first = distortion.spoil(&base, noise, missing);
                let second = distortion.affine(&base);
                (first, distortion.spoil(&second, noise, missing))
            })?;
            affine.push(line.into_line(None, noise, missing, args.seeds));
        }
    }
    let mut views = Vec::new();
    for angle in VIEW_ANGLES {
        let number = affine.len() + views.len();
        let line = measure(args.seeds, |case| {
            let mut distortion = Distortion::new(seed(number, case));
            let at = FIRST_VIEW.start + (FIRST_VIEW.end - FIRST_VIEW.start) * distortion.unit();
            let first = distortion.spoil(&view(tower, at), VIEW_NOISE_PX, 0);
            (first, distortion.spoil(&view(tower, at + f64::from(angle)), VIEW_NOISE_PX, 0))
        })?;
        views.push(line.into_line(Some(angle), VIEW_NOISE_PX, 0, args.seeds));
    }
    let silent = |line: &&Line| line.no_answer * 2 > args.seeds;
    let report = Report {
        schema_version: SCHEMA_VERSION,
        tower: args.tower,
        corners: PICKS,
        seeds: args.seeds,
        first_seed: args.first_seed,
        no_answer_from_degree: views.iter().find(silent).and_then(|line| line.view_angle_degree),
        affine,
        views,
    };
    let text = if args.json { serde_json::to_string_pretty(&report)? + "\n" } else { table(&report) };
    io::stdout().write_all(text.as_bytes())?;
    Ok(Outcome::Done)
}

fn view(tower: &Tower, angle: f64) -> Vec<NumberedPoint> {
    let seen = tower.picked_from(angle);
    seen.iter().map(|corner| NumberedPoint { number: corner.number, x: corner.image.x, y: corner.image.y }).collect()
}

/// The tallies of a line, one for each of [`Method::EACH`].
struct Tallies([Tally; 4]);

impl Tallies {
    fn into_line(self, view_angle_degree: Option<u32>, noise_px: f64, missing_corners: usize, seeds: u64) -> Line {
        let score = |(method, tally): (Method, Tally)| Score {
            method,
            matched_share: tally.matched(),
            wrong_share: tally.wrong_share(),
            wrong_matches: tally.wrong,
            answers: tally.answers,
        };
        Line {
            view_angle_degree,
            noise_px,
            missing_corners,
            common_corners_mean: self.0[0].common as f64 / seeds as f64,
            no_answer: seeds - self.0[3].answers as u64,
            scores: Method::EACH.into_iter().zip(self.0).map(score).collect(),
        }
    }
}

/// Runs every method on every case; sums do not depend on the order, so neither on the number of threads.
fn measure(
    cases: u64,
    make: impl Fn(u64) -> (Vec<NumberedPoint>, Vec<NumberedPoint>) + Sync,
) -> Result<Tallies, GeometryError> {
    let tallies = parallel::try_numbers(cases as usize, Matcher::new, |matcher, case| {
        let (first, second) = make(case as u64);
        let mut tallies = [Tally::default(); 4];
        for (tally, method) in tallies.iter_mut().zip(Method::EACH) {
            *tally = matcher.run(method, &first, &second)?;
        }
        Ok(tallies)
    })?;
    let add = |one: [Tally; 4], two: [Tally; 4]| std::array::from_fn(|method| one[method].add(two[method]));
    Ok(Tallies(tallies.into_iter().fold([Tally::default(); 4], add)))
}

/// The memory that one thread matches with.
struct Matcher {
    workspace: Box<Workspace>,
    layers: Box<[Layers; 2]>,
    arrangements: Vec<Arrangement>,
    quads: Vec<LayerQuad>,
}

impl Matcher {
    fn new() -> Self {
        Self {
            workspace: Box::new(const { Workspace::new() }),
            layers: Box::new([const { Layers::new() }; 2]),
            arrangements: vec![Arrangement::default(); scratch_length(POINTS)],
            quads: vec![LayerQuad::default(); quads_of(2 * POINTS)],
        }
    }

    fn run(
        &mut self,
        method: Method,
        first: &[NumberedPoint],
        second: &[NumberedPoint],
    ) -> Result<Tally, GeometryError> {
        let places = |points: &[NumberedPoint]| points.iter().map(sub_pixel).collect::<Vec<_>>();
        let pairs = self.pairs(method, &places(first), &places(second))?;
        let number = |points: &[NumberedPoint], index: u16| points.get(usize::from(index)).map(|point| point.number);
        let right = pairs.iter().filter(|pair| number(first, pair.first) == number(second, pair.second)).count();
        let common = first.iter().filter(|one| second.iter().any(|two| two.number == one.number)).count();
        Ok(Tally { common, right, wrong: pairs.len() - right, answers: usize::from(!pairs.is_empty()) })
    }

    fn pairs(
        &mut self,
        method: Method,
        first: &[ImagePoint],
        second: &[ImagePoint],
    ) -> Result<Vec<Pairing>, GeometryError> {
        let sources = match method {
            Method::Plain => return self.plain(first, second),
            Method::TolerantHulls => Sources::Layers,
            Method::LocalArrangements => Sources::Arrangements,
            Method::Verified => Sources::Both,
        };
        let settings = Settings { sources, ..Settings::of_picture(640, 480) };
        let (scratch, quads) = (&mut self.arrangements, &mut self.quads);
        if method == Method::Verified {
            // Without an answer there are no correspondences; the reason does not matter here.
            let _ = self.workspace.correspond(first, second, settings, scratch, quads)?;
            return Ok(self.workspace.found().iter().map(|found| found.pair).collect());
        }
        let supported = self.workspace.vote(first, second, settings, scratch, quads)?;
        Ok(supported.iter().map(|supported| supported.pair).collect())
    }

    /// Each layer with the layer of the same number.
    fn plain(&mut self, first: &[ImagePoint], second: &[ImagePoint]) -> Result<Vec<Pairing>, GeometryError> {
        let [first_layers, second_layers] = &mut *self.layers;
        first_layers.peel(first)?;
        second_layers.peel(second)?;
        let both = first_layers.layers().zip(second_layers.layers());
        let shifts =
            both.filter_map(|(one, two)| plain_shift::<POINTS>((first, one), (second, two), Tolerance::FIVE_PERCENT));
        Ok(shifts.flat_map(|shift| shift.pairs).collect())
    }
}

/// To the nearest 1/16 px.
fn sub_pixel(point: &NumberedPoint) -> ImagePoint {
    let round = |x: f64| libm::round(x * f64::from(SUBPIXEL)) as i32;
    ImagePoint::new(round(point.x), round(point.y))
}

fn table(report: &Report) -> String {
    let mut text = format!(
        "{} hand-picked corners of tower {}, {} seeds a line, from places alone (corner noise expected: 0.5 px)\n\
         Each column: right matches of the corners in both views / wrong among the matches, per cent\n\n\
         Random affine maps\n",
        report.corners, report.tower, report.seeds
    );
    heading(&mut text, "missing  noise, px");
    for line in &report.affine {
        let _ = write!(text, "{:7}  {:9.2}", line.missing_corners, line.noise_px);
        scores(&mut text, line);
    }
    let _ = write!(text, "\nViews of the tower itself, {VIEW_NOISE_PX} px noise\n");
    heading(&mut text, "degrees    common");
    for line in &report.views {
        let _ = write!(text, "{:7}  {:9.1}", line.view_angle_degree.unwrap_or(0), line.common_corners_mean);
        scores(&mut text, line);
    }
    match report.no_answer_from_degree {
        Some(angle) => {
            let _ = writeln!(text, "\nFrom {angle} degrees on there is no answer in most cases.");
        }
        None => text.push_str("\nAt every angle there is an answer in most cases.\n"),
    }
    text
}

fn heading(text: &mut String, left: &str) {
    text.push_str(left);
    for method in Method::EACH {
        let _ = write!(text, "  {:>15}", method.title());
    }
    text.push_str("   no answer\n");
}

fn scores(text: &mut String, line: &Line) {
    for score in &line.scores {
        let _ = write!(text, "  {:6.1} / {:6.2}", 100.0 * score.matched_share, 100.0 * score.wrong_share);
    }
    let _ = writeln!(text, "  {:>10}", line.no_answer);
}
