//! `daymark evaluate`: how good the answers are on a folder of pictures whose truth is known.

pub(super) mod measure;

use std::io::{self, Write};
use std::path::PathBuf;

use daymark_core::profile::Profile;
use daymark_core::table::LandmarkTable;

use super::recognize::probability;
use super::{CommandError, Outcome};
use crate::dataset::Dataset;
use crate::engine::FRAME_SIDE;
use crate::report::evaluation::score::Scores;
use crate::report::evaluation::{Evaluation, SCHEMA_VERSION, STATED, Settings, TableFacts, html, text};

/// Arguments of `daymark evaluate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The folder holds manifest.json and the pictures that it names:
  {\"recognition\": [{\"building\": \"town hall\", \"gallery\": [\"1.jpg\"], \"queries\": [\"2.jpg\"]}],
   \"negatives\": [\"3.jpg\"], \"equivalent_buildings\": [[\"town hall\", \"city hall\"]]}
The gallery is enrolled into a table, which is read back from its bytes; queries and negatives are compared with it.
Other keys of the manifest are not looked at.

The same pictures give the same output over runs, numbers of jobs and builds, but for the measured times: in the JSON
every one of these is a field whose name ends in _ms, and --reproducible leaves them out.")]
pub struct Args {
    /// The folder with the pictures and their manifest.json
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The class of device that the table is for: handheld (2 KB a view) or board (up to 16 KB)
    #[arg(long, default_value = "handheld", value_parser = profile)]
    profile: Profile,
    /// Pictures worked on at once; more is faster, and the measured times become longer
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: u16,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Leave out the measured times, so that equal inputs give equal bytes
    #[arg(long)]
    reproducible: bool,
    /// Write a page that shows the figures and the pictures of every miss and every false answer
    #[arg(long, value_name = "REPORT.html")]
    html: Option<PathBuf>,
    /// Count a frame as answered if the answer is false with at most this probability, where one limit is needed
    #[arg(long, value_name = "PROBABILITY", default_value_t = 0.01, value_parser = probability)]
    max_false_answer: f64,
}

fn profile(text: &str) -> Result<Profile, String> {
    let names = Profile::ALL.map(Profile::name).join(" or ");
    Profile::ALL.into_iter().find(|profile| profile.name() == text).ok_or_else(|| format!("give {names}"))
}

/// Runs the command.
///
/// # Errors
/// A manifest or picture that cannot be read; a page that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let dataset = Dataset::open(&args.dataset)?;
    let pool = measure::workers(usize::from(args.jobs))?;
    let evaluation = pool.install(|| evaluate(args, &dataset))?;
    if let Some(path) = &args.html {
        let page = html::page(&evaluation, &|file| measure::read(&dataset.folder, file).ok());
        std::fs::write(path, page).map_err(|error| {
            format!(
                "cannot write the page {}: {error}; give a path in a folder that exists and is yours",
                path.display()
            )
        })?;
    }
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&evaluation)?)?;
    } else {
        out.write_all(text::evaluation(&evaluation).as_bytes())?;
    }
    Ok(Outcome::Done)
}

fn evaluate(args: &Args, dataset: &Dataset) -> Result<Evaluation, CommandError> {
    let mut stated = STATED.to_vec();
    if !stated.contains(&args.max_false_answer) {
        stated.push(args.max_false_answer);
    }
    let gallery = measure::enroll(dataset, args.profile)?;
    let table = LandmarkTable::open(&gallery.bytes)?.verified()?;
    let run = measure::recognize(dataset, table, &gallery, args.max_false_answer, &stated)?;
    Ok(Evaluation {
        schema_version: SCHEMA_VERSION,
        profile: args.profile.name(),
        settings: Settings { max_false_answer: args.max_false_answer, longer_side_px: FRAME_SIDE },
        bytes_per_view: gallery.bytes.len().div_ceil(gallery.views.len().max(1)),
        table: TableFacts {
            table_id: format!("{:016x}", table.header().table_id()),
            landmarks: table.landmark_count(),
            views: table.view_count(),
            bytes: gallery.bytes.len(),
            gallery: gallery.views.clone(),
            not_enrolled: gallery.not_enrolled.clone(),
        },
        scores: Scores::new(&run.frames, &stated),
        times: (!args.reproducible).then(|| run.times(&gallery)),
        frames: run.frames,
    })
}
