//! `daymark enroll`: pictures of buildings go into a landmark table.

mod models;
mod report;

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use daymark_core::profile::Profile;
use daymark_core::table::{Header, Kind, LandmarkTable};
use indicatif::{ProgressBar, ProgressStyle};

use super::{CommandError, Outcome};
use crate::engine::{Engine, STACK_BYTES};
use crate::enroll::lint::{ViewLint, lint};
use crate::enroll::manifest;
use crate::enroll::plan::{FACING_ERROR_DEGREES, Modelling, Plan, check_name, read_pictures};
use crate::enroll::position::{GIVEN_ERROR_METRES, parse_degrees, position};
use crate::enroll::update::{Change, Enrolled, apply};
use crate::parallel;
use crate::table_file::{OwnedTable, TableFileError, open_table, read_table, replace_file};

/// Arguments of `daymark enroll`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag")]
#[command(after_help = "\
A manifest names buildings and their pictures, paths relative to the manifest:

  [[building]]
  name = \"Old gate\"
  kind = \"tower\"             # optional
  at = [52.5163, 13.3777]    # optional
  facing = 184               # optional: azimuth towards which the front looks
  height_m = 26              # optional, or distance_m: what says how long a metre is
  images = [\"gate-1.jpg\", \"gate-2.jpg\"]

All pictures are read before the table is replaced; if one cannot be used, nothing is written.")]
pub struct Args {
    /// The table to add to; it is made if it is not there
    #[arg(long, value_name = "TABLE")]
    table: PathBuf,
    /// What the building is called; a building that the table knows gets these pictures in addition
    #[arg(long, required_unless_present = "manifest")]
    name: Option<String>,
    /// What sort of thing it is, to narrow a search [default: building]
    #[arg(long, value_parser = PossibleValuesParser::new(Kind::ALL.map(Kind::name)).map(|name| Kind::from_name(&name).unwrap_or_default()))]
    kind: Option<Kind>,
    /// Where it stands, in degrees north and east; without it, where a picture's EXIF data say that the camera was
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true, value_parser = parse_degrees_option)]
    at: Option<Degrees>,
    /// How well that is known, in metres
    #[arg(long, value_name = "METRES", requires = "at", default_value_t = GIVEN_ERROR_METRES)]
    position_error: f64,
    /// Azimuth towards which the front looks, degrees from north over east; with it and --at a frame tells where the observer
    /// stands
    #[arg(long, value_name = "DEGREES")]
    facing: Option<f64>,
    /// How well that is known, in degrees
    #[arg(long, value_name = "DEGREES", requires = "facing", default_value_t = FACING_ERROR_DEGREES)]
    facing_error: f64,
    /// Metres between the cameras of the first two pictures, so that the model has a scale
    #[arg(long, value_name = "METRES", conflicts_with = "height_m")]
    distance_m: Option<f64>,
    /// Metres from the lowest to the highest point that the pictures show, so that the model has a scale
    #[arg(long, value_name = "METRES")]
    height_m: Option<f64>,
    /// Focal length in pixels of the pictures as they are, if their EXIF data do not say it
    #[arg(long, value_name = "PIXELS", conflicts_with = "cameras")]
    focal_px: Option<f64>,
    /// Known cameras, as in `daymark synthesize`
    #[arg(long, value_name = "PATHS", num_args = 1..)]
    cameras: Vec<PathBuf>,
    /// Make no model from several pictures: the building is recognized, and gives no position of the observer
    #[arg(long)]
    no_model: bool,
    /// Take many buildings from a TOML file instead
    #[arg(long, value_name = "MANIFEST", conflicts_with_all = ["name", "kind", "at", "position_error", "images", "facing", "distance_m", "height_m", "focal_px", "cameras"])]
    manifest: Option<PathBuf>,
    /// Put the pictures in the place of the views that the building had
    #[arg(long)]
    replace: bool,
    /// The class of device that a new table is for [default: handheld]
    #[arg(long, value_parser = PossibleValuesParser::new(Profile::ALL.map(Profile::name)).map(|name| profile_named(&name)))]
    profile: Option<Profile>,
    /// Threads to work with; the table does not depend on it [default: one for each processor]
    #[arg(long, value_name = "THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Do not measure what the new views are worth
    #[arg(long)]
    no_lint: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Pictures of the building: JPEG, PNG, WebP, TIFF, BMP or PNM
    #[arg(required_unless_present = "manifest", value_name = "IMAGES")]
    images: Vec<PathBuf>,
}

#[derive(Debug, Clone, Copy)]
struct Degrees([f64; 2]);

fn parse_degrees_option(text: &str) -> Result<Degrees, String> {
    parse_degrees(text).map(Degrees).map_err(|error| error.to_string())
}

fn profile_named(name: &str) -> Profile {
    Profile::ALL.into_iter().find(|profile| profile.name() == name).unwrap_or(Profile::Handheld)
}

/// Runs the command.
///
/// # Errors
/// A plan, a picture or a table that cannot be used; the table that was there is unchanged.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let plans = plans(args)?;
    let (mut table, id_before) = open(&args.table, args.profile)?;
    let mut pool = rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES);
    if let Some(jobs) = args.jobs {
        pool = pool.num_threads(usize::from(jobs));
    }
    let pool = pool.build().map_err(|error| format!("cannot start threads: {error}; give a smaller --jobs"))?;

    let profile = table.profile;
    let progress = progress("reading", plans.iter().map(|plan| plan.images.len()).sum());
    let pictures = pool.install(|| read_pictures(&plans, profile, &|| progress.inc(1)))?;
    progress.finish_and_clear();

    let wish = |plan: &Plan| Modelling { unwanted: args.no_model, ..plan.modelling.clone() };
    let wishes: Vec<Modelling> = plans.iter().map(wish).collect();
    let mut changes: Vec<Change> = plans
        .into_iter()
        .zip(pictures)
        .map(|(plan, pictures)| apply(&mut table, plan, pictures, args.replace))
        .collect();
    let progress = progress_of("modelling", "buildings", changes.len());
    let models = pool.install(|| models::add_models(&mut table, &mut changes, &wishes, &|| progress.inc(1)))?;
    progress.finish_and_clear();
    let bytes = table.to_bytes().map_err(TableFileError::Build)?;
    let new = open_table(&args.table, &bytes)?;
    let lints = if args.no_lint { Vec::new() } else { pool.install(|| lint_all(new, &changes))? };

    if id_before != Some(new.header().table_id()) {
        if table_id(&args.table)? != id_before {
            let path = args.table.display();
            return Err(format!("somebody else changed {path} meanwhile, and nothing was written; enroll again").into());
        }
        replace_file(&args.table, &bytes)?;
    }
    report::print(args.json, &args.table, new, &changes, &models, &lints)?;
    Ok(Outcome::Done)
}

/// What is to be enrolled, checked as far as it can be without reading pictures.
fn plans(args: &Args) -> Result<Vec<Plan>, CommandError> {
    if let Some(manifest) = &args.manifest {
        return Ok(manifest::read(manifest)?);
    }
    let name = args.name.clone().unwrap_or_default();
    check_name(&name).map_err(|says| format!("the name {name:?} cannot be used: {says}"))?;
    let at = args.at.map(|Degrees([latitude, longitude])| position(latitude, longitude, args.position_error));
    let modelling = Modelling {
        unwanted: args.no_model,
        cameras: args.cameras.clone(),
        focal_px: args.focal_px,
        distance_m: args.distance_m,
        height_m: args.height_m,
        facing: args.facing.map(|azimuth| [azimuth, args.facing_error]),
    };
    modelling.check()?;
    let plan = Plan {
        name,
        kind: args.kind,
        position: at.transpose()?,
        images: args.images.clone(),
        modelling,
        origin: String::new(),
    };
    Ok(vec![plan])
}

/// The table to add to, and its id if it is there. What would keep it from being written is told before hours of work.
fn open(path: &Path, wanted: Option<Profile>) -> Result<(OwnedTable, Option<u64>), CommandError> {
    if table_id(path)?.is_none() {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            let kind = if folder.exists() { ErrorKind::NotADirectory } else { ErrorKind::NotFound };
            return Err(TableFileError::Write(path.to_owned(), kind.into()).into());
        }
        return Ok((OwnedTable::new(wanted.unwrap_or(Profile::Handheld)), None));
    }
    let bytes = read_table(path)?;
    let table = open_table(path, &bytes)?;
    if let Some(wanted) = wanted.filter(|&wanted| wanted != table.profile()) {
        let (path, found, wanted) = (path.display(), table.profile().name(), wanted.name());
        return Err(format!(
            "{path} is of profile {found}, and a table holds views of one profile: leave out --profile {wanted}, or \
             give another --table"
        )
        .into());
    }
    let owned = OwnedTable::from_table(&table).map_err(|error| TableFileError::Table(path.to_owned(), error))?;
    Ok((owned, Some(table.header().table_id())))
}

/// The id of the table at `path`; `None` if nothing is there.
fn table_id(path: &Path) -> Result<Option<u64>, TableFileError> {
    match read_table(path) {
        Ok(bytes) => match Header::decode(&bytes) {
            Ok(header) => Ok(Some(header.table_id())),
            Err(error) => Err(TableFileError::Table(path.to_owned(), error)),
        },
        Err(TableFileError::Read(_, error)) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Measures every new view. Threads share the work; the order and the numbers are the same for any number of them.
fn lint_all(table: LandmarkTable<'_>, changes: &[Change]) -> Result<Vec<Vec<Option<ViewLint>>>, CommandError> {
    let landmarks = (0..table.landmark_count()).map(|number| table.landmark(number)).collect::<Result<Vec<_>, _>>()?;
    let mut work = Vec::new();
    for change in changes {
        // The table's landmarks are in the order of their names.
        let found = landmarks.binary_search_by(|landmark| landmark.name.as_bytes().cmp(change.name.as_bytes()));
        let first = found.ok().map(|found| landmarks[found].views.start);
        for picture in &change.pictures {
            let number = first.filter(|_| !picture.known).map(|first| first + picture.place as u32);
            work.push((number, picture));
        }
    }
    let progress = progress("measuring", work.len());
    let measure = |engine: &mut Engine, (number, picture): &(Option<u32>, &Enrolled)| {
        let measured = number.map(|number| lint(engine, table, number, &picture.gray)).transpose();
        progress.inc(1);
        measured
    };
    let results = parallel::try_map_with(&work, || Engine::new(table.profile()), measure);
    progress.finish_and_clear();
    let mut lints = results?.into_iter();
    Ok(changes.iter().map(|change| lints.by_ref().take(change.pictures.len()).collect()).collect())
}

/// A bar on standard error, if that is a terminal; nothing otherwise.
fn progress(doing: &'static str, pictures: usize) -> ProgressBar {
    progress_of(doing, "pictures", pictures)
}

fn progress_of(doing: &'static str, what: &str, count: usize) -> ProgressBar {
    if count < 2 {
        return ProgressBar::hidden();
    }
    let style =
        ProgressStyle::with_template(&format!("{{prefix}} {{pos}} of {{len}} {what} [{{bar:30}}] {{eta}} left"));
    let bar = ProgressBar::new(count as u64).with_prefix(doing);
    match style {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}

/// One line to standard error. If that is closed there is nobody to tell.
fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}
