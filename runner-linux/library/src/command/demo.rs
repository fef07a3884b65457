//! `daymark demo`: the whole path on a scene that the program draws itself.

mod gallery;
mod scene;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use daymark_core::profile::Profile;
use daymark_core::table::LandmarkTable;
use daymark_core::verdict::FalseAnswer;
use daymark_fixtures::{Lens, Tower, View};
use image::ExtendedColorType::Rgb8;
use image::ImageEncoder;
use image::codecs::png::PngEncoder;

use super::evaluate::measure::workers;
use super::{CommandError, Outcome};
use crate::engine::{Engine, FRAME_SIDE};
use crate::enroll;
use crate::parallel;
use crate::picture::{GrayImage, read_gray};
use crate::report::explain::ViewExplanation;
use crate::report::finding::{Finding, Times};
use crate::report::overlay::Overlay;
use crate::report::phrase;
use crate::table_file::{LandmarkEntry, OwnedTable, ViewEntry, open_table, read_table};
use scene::{KINDS, Lesson, Shot};

/// Arguments of `daymark demo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder for the pictures, the table and the page to look at; it is made if need be
    #[arg(long, value_name = "DIR", default_value = "daymark-demo")]
    out: PathBuf,
}

/// A picture that was enrolled.
struct Enrolled {
    building: String,
    file: String,
    picture: GrayImage,
    view: ViewEntry,
}

/// A frame that was recognized.
struct Seen {
    shot: Shot,
    frame_file: String,
    overlay_file: String,
    finding: Finding,
}

/// Runs the command.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let lens = Lens::VGA;
    let towers = Tower::eight();
    for folder in ["enrolled", "frames", "overlays"] {
        let folder = args.out.join(folder);
        fs::create_dir_all(&folder).map_err(|error| refused("make the folder", &folder, &error))?;
    }
    say("daymark: eight buildings that this program draws itself. No camera, no network, nothing downloaded.\n")?;

    let workers = workers(0)?;
    let begin = Instant::now();
    let enrolled = workers.install(|| enroll_towers(&args.out, &towers, lens))?;
    let table_file = args.out.join("town.daymark");
    save_table(&table_file, &towers, &enrolled)?;
    let bytes = read_table(&table_file)?;
    let table = open_table(&table_file, &bytes)?;
    tell_enrollment(&towers, &table_file, &table, bytes.len(), begin.elapsed())?;

    let shots = scene::shots(&towers, lens);
    workers.install(|| draw_frames(&args.out, &shots, lens))?;
    let seen = recognize_all(&args.out, table, &enrolled, shots)?;
    tell_lesson(&seen, Lesson::Known, "2. Recognize: frames that differ from everything that was enrolled.")?;
    tell_lesson(
        &seen,
        Lesson::Twin,
        "3. Tell apart: Exchange and Hotel are the same solid; only their facades differ.",
    )?;
    tell_lesson(&seen, Lesson::Unknown, "4. Say no: what was not enrolled gets no name, and a reason.")?;

    let page = gallery::page(&enrolled, &seen, &table_file, bytes.len());
    write(&args.out.join("index.html"), page.as_bytes())?;
    tell_ending(args, &seen)?;
    Ok(Outcome::Done)
}

fn say(text: &str) -> io::Result<()> {
    writeln!(io::stdout(), "{text}")
}

fn refused(doing: &str, path: &Path, error: &io::Error) -> String {
    format!("cannot {doing} {}: {error}; give --out a folder that is yours, with some MB free", path.display())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    fs::write(path, bytes).map_err(|error| refused("write", path, &error).into())
}

fn write_png(path: &Path, rgb: &[u8], lens: Lens) -> Result<(), CommandError> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(rgb, lens.width, lens.height, Rgb8)
        .map_err(|error| refused("write", path, &io::Error::other(error)))?;
    write(path, &png)
}

fn enroll_towers(out: &Path, towers: &[Tower; 8], lens: Lens) -> Result<Vec<Enrolled>, CommandError> {
    let views: Vec<(&Tower, View)> =
        towers.iter().flat_map(|tower| View::enrollment(tower, lens).map(|view| (tower, view))).collect();
    let enroll = |(tower, view): &(&Tower, View)| {
        let file = format!("enrolled/{}.png", view.name);
        let path = out.join(&file);
        write_png(&path, &view.render().rgb, lens)?;
        let picture = read_gray(&path)?.scaled_to(FRAME_SIDE);
        let view = enroll::view(&picture, Profile::Handheld)?;
        Ok(Enrolled { building: tower.name.clone(), file, picture, view })
    };
    parallel::try_map(&views, enroll)
}

fn save_table(path: &Path, towers: &[Tower; 8], enrolled: &[Enrolled]) -> Result<(), CommandError> {
    let landmark = |(index, tower): (usize, &Tower)| LandmarkEntry {
        name: tower.name.clone(),
        kind: KINDS[index],
        position: scene::position(index),
        views: enrolled.iter().filter(|view| view.building == tower.name).map(|view| view.view.clone()).collect(),
        model: None,
    };
    let landmarks = towers.iter().enumerate().map(landmark).collect();
    OwnedTable { profile: Profile::Handheld, landmarks }.save(path)?;
    Ok(())
}

fn frame_file(shot: &Shot) -> String {
    format!("frames/{}.png", shot.name)
}

fn draw_frames(out: &Path, shots: &[Shot], lens: Lens) -> Result<(), CommandError> {
    let draw = |shot: &Shot| write_png(&out.join(frame_file(shot)), &scene::render(shot, lens), lens);
    parallel::try_map(shots, draw).map(|_| ())
}

fn recognize_all(
    out: &Path,
    mut table: LandmarkTable<'_>,
    enrolled: &[Enrolled],
    shots: Vec<Shot>,
) -> Result<Vec<Seen>, CommandError> {
    let mut engine = Engine::new(table.profile());
    let mut seen = Vec::new();
    for shot in shots {
        let frame_file = frame_file(&shot);
        let begin = Instant::now();
        let path = out.join(&frame_file);
        let frame = read_gray(&path)?.scaled_to(FRAME_SIDE);
        let read = Instant::now();
        engine.extract(&frame)?;
        let extracted = Instant::now();
        let recognition = engine.recognize(&mut table, FalseAnswer::ONE_PERCENT)?;
        let matched = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        let mut finding = Finding::new(Path::new(&frame_file), &frame, &recognition, &table)?;
        finding.times = Some(Times {
            read_ms: ms(begin, read),
            features_ms: ms(read, extracted),
            matching_ms: ms(extracted, matched),
            position_ms: 0.0,
        });
        let best = match &recognition.best {
            Some(best) => ViewExplanation::new(&mut engine, &table, best)?,
            None => None,
        };
        let stored_picture = best.as_ref().and_then(|best| picture_of(&table, enrolled, best));
        let overlay_file = format!("overlays/{}.svg", shot.name);
        let svg = Overlay { frame: &frame, finding: &finding, best: best.as_ref(), stored_picture }.to_svg();
        write(&out.join(&overlay_file), svg.as_bytes())?;
        seen.push(Seen { shot, frame_file, overlay_file, finding });
    }
    Ok(seen)
}

/// The picture of which a view was made.
fn picture_of<'a>(
    table: &LandmarkTable<'_>,
    enrolled: &'a [Enrolled],
    best: &ViewExplanation,
) -> Option<&'a GrayImage> {
    let stored = table.view(best.view).ok()?;
    let landmark = table.landmark(stored.landmark()).ok()?;
    let place = best.view.checked_sub(landmark.views.start)? as usize;
    let views = enrolled.iter().filter(|view| view.building == landmark.name);
    views.map(|view| &view.picture).nth(place)
}

fn tell_enrollment(
    towers: &[Tower; 8],
    file: &Path,
    table: &LandmarkTable<'_>,
    bytes: usize,
    took: Duration,
) -> io::Result<()> {
    let names = towers.iter().map(|tower| tower.name.as_str()).collect::<Vec<_>>().join(", ");
    let views = table.view_count() as usize;
    say(&format!(
        "1. Enroll: two pictures of each building become two stored views.\n   {names}\n   \
         {}: {} in {}, {} a view. It holds corners, not pictures.\n   \
         Drawn and enrolled in {:.1} s.\n",
        file.display(),
        phrase::count(views, "view"),
        phrase::count(bytes, "byte"),
        phrase::grouped((bytes / views.max(1)) as u64),
        took.as_secs_f64(),
    ))
}

fn tell_lesson(seen: &[Seen], lesson: Lesson, title: &str) -> io::Result<()> {
    say(title)?;
    for seen in seen.iter().filter(|seen| seen.shot.lesson == lesson) {
        let asked = seen.shot.shows.as_deref().unwrap_or("not enrolled");
        say(&format!("   shown: {asked}, {}", seen.shot.remark))?;
        say(&format!("      {}", answer(&seen.finding)))?;
    }
    say("")
}

/// What came out and how sure that is, in a line.
fn answer(finding: &Finding) -> String {
    let time = finding.times.map_or(String::new(), |times| phrase::milliseconds(times.features_ms + times.matching_ms));
    match (&finding.landmark, &finding.best, &finding.reason) {
        (Some(name), Some(best), _) => {
            let p = phrase::probability(best.probability_false_answer);
            format!(
                "-> {name}; probability that this is false: {p} ({:.0} bits of evidence); {time}",
                best.evidence_bits
            )
        }
        (_, _, Some(reason)) => format!("-> {}: {}; {time}", finding.verdict.label().to_lowercase(), reason.message),
        _ => format!("-> {}, {time}", finding.verdict.label().to_lowercase()),
    }
}

/// Whether the building was named, or rightly none was.
fn is_right(seen: &Seen) -> bool {
    seen.shot.shows == seen.finding.landmark
}

fn tell_ending(args: &Args, seen: &[Seen]) -> io::Result<()> {
    let right = seen.iter().filter(|seen| is_right(seen)).count();
    let page = args.out.join("index.html");
    // As it was called: `cargo run` calls it by its place, which nobody has seen yet.
    let program = std::env::args_os().next().map_or_else(|| "daymark".into(), PathBuf::from);
    let frame = args.out.join(seen.first().map_or("", |seen| seen.frame_file.as_str()));
    say(&format!(
        "{right} of {} as it should be. What to notice:\n   \
         - Every name comes with the probability that it is false, which counts how many views were compared.\n   \
         - \"Unknown\" is an answer: above 1 % there is no name (--max-false-answer changes that).\n   \
         - No training, no network: a building is known from two pictures on.\n   \
         - Look at {} to see which corners decided.\n   \
         - This program is {}: put it into your path, or write that for `daymark` below.\n",
        seen.len(),
        page.display(),
        program.display(),
    ))?;
    say("Now you:")?;
    say(&format!(
        "   daymark recognize --table {} --explain {}",
        args.out.join("town.daymark").display(),
        frame.display()
    ))?;
    say("   daymark enroll --table my.daymark --name \"Town hall\" hall-left.jpg hall-right.jpg")?;
    say("   daymark recognize --table my.daymark --overlay why.svg another-picture.jpg")
}
