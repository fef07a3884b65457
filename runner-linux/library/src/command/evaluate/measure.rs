//! The work behind `daymark evaluate`: enroll the gallery, recognize the queries and the negatives.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use daymark_core::profile::Profile;
use daymark_core::table::{Kind, LandmarkTable, TableError};
use daymark_core::verdict::{Answer, FalseAnswer, NoAnswer, Recognition, Verdict};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use super::super::CommandError;
use crate::dataset::Dataset;
use crate::engine::{Engine, FRAME_SIDE, STACK_BYTES};
use crate::enroll;
use crate::order;
use crate::parallel;
use crate::picture::{GrayImage, read_gray};
use crate::report::evaluation::{GalleryView, Guess, Judged, Outcome, Times, percentile};
use crate::table_file::{LandmarkEntry, OwnedTable, ViewEntry};

/// The gallery as a table.
#[derive(Debug)]
pub(super) struct Gallery {
    /// The table as it would stand on the disk.
    pub bytes: Vec<u8>,
    /// The picture of each view, by the view's number in the table.
    pub views: Vec<GalleryView>,
    /// Pictures with too few corners for a view.
    pub not_enrolled: Vec<String>,
    enroll_ms: Vec<f64>,
}

/// The frames and what each took.
#[derive(Debug)]
pub(super) struct Run {
    /// The queries, then the negatives, in the order of the manifest.
    pub frames: Vec<Judged>,
    features_ms: Vec<f64>,
    matching_ms: Vec<f64>,
}

/// A frame to recognize.
struct Task<'a> {
    file: &'a str,
    shows: Option<&'a str>,
    source: &'a str,
}

/// Threads to enroll and recognize on; 0 for as many as there are processors.
///
/// # Errors
/// The system has no thread to give.
pub(in super::super) fn workers(count: usize) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new().num_threads(count).stack_size(STACK_BYTES).build()
}

/// Reads a picture as it is enrolled and recognized.
///
/// # Errors
/// A picture that cannot be read.
pub(super) fn read(folder: &Path, file: &str) -> Result<GrayImage, CommandError> {
    Ok(read_gray(&folder.join(file))?.scaled_to(FRAME_SIDE))
}

/// A bar on standard error, if that is a terminal.
fn progress(length: usize, doing: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64).with_message(doing);
    match ProgressStyle::with_template("{msg:<12} {bar:40} {pos}/{len}  {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Enrolls every gallery picture; the table is the same for any number of threads.
///
/// # Errors
/// A picture that cannot be read, a name that cannot be stored, or nothing that can be enrolled.
pub(super) fn enroll(dataset: &Dataset, profile: Profile) -> Result<Gallery, CommandError> {
    let pictures: Vec<(&str, &str)> = dataset
        .buildings
        .iter()
        .flat_map(|building| building.gallery.iter().map(|file| (building.name.as_str(), file.as_str())))
        .collect();
    let bar = progress(pictures.len(), "enrolling");
    let enrolled = parallel::try_map(&pictures, |(_, file)| {
        let image = read(&dataset.folder, file)?;
        let begin = Instant::now();
        let view = enroll::view(&image, profile).ok();
        bar.inc(1);
        Ok::<_, CommandError>((view, begin.elapsed().as_secs_f64() * 1e3))
    })?;
    bar.finish_and_clear();

    // The table sorts its landmarks by the bytes of their names and keeps the order of their views.
    let mut landmarks: BTreeMap<&str, Vec<(ViewEntry, &str)>> = BTreeMap::new();
    let (mut not_enrolled, mut enroll_ms) = (Vec::new(), Vec::new());
    for ((name, file), (view, ms)) in pictures.into_iter().zip(enrolled) {
        enroll_ms.push(ms);
        match view {
            Some(view) => landmarks.entry(name).or_default().push((view, file)),
            None => not_enrolled.push(file.to_owned()),
        }
    }
    if landmarks.is_empty() {
        return Err("no gallery picture has enough corners for a view; take sharp pictures in good light".into());
    }
    let of_building = |(name, views): (&&str, &Vec<(ViewEntry, &str)>)| -> Vec<GalleryView> {
        let view = |file: &str| GalleryView { building: (*name).to_owned(), file: file.to_owned() };
        views.iter().map(|(_, file)| view(file)).collect()
    };
    let views = landmarks.iter().flat_map(of_building).collect();
    let entry = |(name, views): (&str, Vec<(ViewEntry, &str)>)| LandmarkEntry {
        name: name.to_owned(),
        kind: Kind::Building,
        position: None,
        views: views.into_iter().map(|(view, _)| view).collect(),
        model: None,
    };
    let table = OwnedTable { profile, landmarks: landmarks.into_iter().map(entry).collect() };
    Ok(Gallery { bytes: table.to_bytes()?, views, not_enrolled, enroll_ms })
}

/// Recognizes every query and negative; the answers are the same for any number of threads.
///
/// # Errors
/// A picture that cannot be read.
pub(super) fn recognize(
    dataset: &Dataset,
    table: LandmarkTable<'_>,
    gallery: &Gallery,
    asked: f64,
    stated: &[f64],
) -> Result<Run, CommandError> {
    let tasks = tasks(dataset);
    let limits: Vec<FalseAnswer> = stated.iter().map(|&p| FalseAnswer::at_most(p)).collect();
    let asked = FalseAnswer::at_most(asked);
    let bar = progress(tasks.len(), "recognizing");
    let judge = |engine: &mut Engine, task: &Task<'_>| -> Result<(Judged, f64, f64), CommandError> {
        let mut table = table;
        let image = read(&dataset.folder, task.file)?;
        let begin = Instant::now();
        engine.extract(&image).map_err(|error| format!("{}: {error}", task.file))?;
        let extracted = Instant::now();
        let recognition = engine.recognize(&mut table, asked)?;
        let matched = Instant::now();
        let mut at_stated = Vec::with_capacity(limits.len());
        for &limit in &limits {
            let verdict = if has_two_answers(&recognition, &limits) {
                engine.recognize(&mut table, limit)?.verdict
            } else {
                only_answer(&recognition, limit)
            };
            at_stated.push(outcome(dataset, &table, task, &verdict)?);
        }
        let guess = |answer: Option<Answer>| {
            answer.map(|answer| {
                table.landmark(answer.landmark).map(|landmark| Guess {
                    building: landmark.name.to_owned(),
                    gallery_file: gallery
                        .views
                        .get(answer.view as usize)
                        .map_or(String::new(), |view| view.file.clone()),
                    evidence_bits: crate::report::finding::bits(answer.matched.evidence),
                    probability_false_answer: answer.false_answer.probability(),
                    frame_from_view: answer.matched.frame_from_view.0,
                })
            })
        };
        let best = guess(recognition.best).transpose()?;
        bar.inc(1);
        let judged = Judged {
            file: task.file.to_owned(),
            shows: task.shows.map(str::to_owned),
            source: task.source.to_owned(),
            right_at_1: best.as_ref().is_some_and(|best| is_right(dataset, task, &best.building)),
            best,
            runner_up: guess(recognition.runner_up).transpose()?,
            outcome: outcome(dataset, &table, task, &recognition.verdict)?,
            corners: recognition.corners,
            at_stated,
        };
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        Ok((judged, ms(begin, extracted), ms(extracted, matched)))
    };
    let judged = parallel::try_map_with(&tasks, || Engine::new(table.profile()), judge)?;
    bar.finish_and_clear();
    let mut run = Run { frames: Vec::new(), features_ms: Vec::new(), matching_ms: Vec::new() };
    for (frame, features, matching) in judged {
        run.frames.push(frame);
        run.features_ms.push(features);
        run.matching_ms.push(matching);
    }
    Ok(run)
}

fn tasks(dataset: &Dataset) -> Vec<Task<'_>> {
    let queries = dataset.buildings.iter().flat_map(|building| {
        let source = building.gallery.first().map_or("", |file| folder_of(file));
        building.queries.iter().map(move |file| Task { file, shows: Some(&building.name), source })
    });
    let negatives = dataset.negatives.iter().map(|file| Task { file, shows: None, source: folder_of(file) });
    queries.chain(negatives).collect()
}

/// The first folder of a picture's path.
fn folder_of(file: &str) -> &str {
    file.trim_start_matches("./").split_once('/').map_or(".", |(folder, _)| folder)
}

fn is_right(dataset: &Dataset, task: &Task<'_>, name: &str) -> bool {
    task.shows.is_some_and(|shows| dataset.same(shows) == dataset.same(name))
}

/// Whether, at some limit, both the best and the runner-up pass, so that the verdict may be that they look alike.
fn has_two_answers(recognition: &Recognition, limits: &[FalseAnswer]) -> bool {
    recognition.runner_up.is_some_and(|other| limits.iter().any(|&limit| other.false_answer <= limit))
}

/// The verdict at another limit, if the runner-up does not pass it.
fn only_answer(recognition: &Recognition, limit: FalseAnswer) -> Verdict {
    match (recognition.verdict, recognition.best) {
        (Verdict::Known(_) | Verdict::Unknown(NoAnswer::NotSure(_)), Some(best)) if best.false_answer <= limit => {
            Verdict::Known(best)
        }
        (Verdict::Known(_), Some(best)) => Verdict::Unknown(NoAnswer::NotSure(best)),
        (verdict, _) => verdict,
    }
}

/// Two labels of the same building that fit about equally well name that building.
fn outcome(
    dataset: &Dataset,
    table: &LandmarkTable<'_>,
    task: &Task<'_>,
    verdict: &Verdict,
) -> Result<Outcome, TableError> {
    let named = |answer: &Answer| table.landmark(answer.landmark).map(|landmark| landmark.name);
    let answer = match verdict {
        Verdict::Known(answer) => answer,
        Verdict::Ambiguous(best, other) if dataset.same(named(best)?) == dataset.same(named(other)?) => best,
        Verdict::Ambiguous(..) => return Ok(Outcome::Ambiguous),
        Verdict::Unknown(_) => return Ok(Outcome::Unknown),
    };
    Ok(if is_right(dataset, task, named(answer)?) { Outcome::Right } else { Outcome::Wrong })
}

impl Run {
    /// Median and 99th percentile of every stage.
    pub(super) fn times(&self, gallery: &Gallery) -> Times {
        let sorted = |values: &mut dyn Iterator<Item = f64>| {
            let mut values: Vec<f64> = values.collect();
            order::ascending(&mut values);
            values
        };
        let views = gallery.views.len().max(1) as f64;
        let features = sorted(&mut self.features_ms.iter().copied());
        let view = sorted(&mut self.matching_ms.iter().map(|ms| ms / views));
        let whole = sorted(&mut self.features_ms.iter().zip(&self.matching_ms).map(|(a, b)| a + b));
        let enroll = sorted(&mut gallery.enroll_ms.iter().copied());
        Times {
            features_p50_ms: percentile(&features, 50),
            features_p99_ms: percentile(&features, 99),
            one_view_p50_ms: percentile(&view, 50),
            one_view_p99_ms: percentile(&view, 99),
            whole_frame_p50_ms: percentile(&whole, 50),
            whole_frame_p99_ms: percentile(&whole, 99),
            enroll_view_p50_ms: percentile(&enroll, 50),
            enroll_view_p99_ms: percentile(&enroll, 99),
        }
    }
}
