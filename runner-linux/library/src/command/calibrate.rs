//! `daymark calibrate`: pictures of a board in, a lens out.

mod output;

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;

use indicatif::ProgressBar;

use super::{CommandError, Outcome};
use crate::calibrate::board::{Board, Corners};
use crate::calibrate::solve::solve;
use crate::calibrate::{FoundBoard, NoBoard, find};
use crate::parallel;
use crate::picture::read_gray;
use output::{Facts, save};

/// Arguments of `daymark calibrate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 the lens is calibrated, 1 the pictures give no lens (the reason has a figure), 2 an error. No \
                  lens is written unless it is calibrated.\n\n\
                  1. daymark calibrate --print-pattern board.svg, printed and glued to something flat; or board.png on a \
                  screen.\n\
                  2. 10 to 20 pictures at the focus and zoom that will be used: tilted by 20 to 45 degrees about both axes, \
                  near enough to fill the frame, and at each border and corner of it.\n\
                  3. daymark calibrate *.jpg -o camera.yaml, then --lens camera.yaml wherever a position is wanted."
)]
pub struct Args {
    /// Pictures of the board by one camera, all of one size
    #[arg(required_unless_present = "print_pattern", value_name = "PICTURES")]
    pictures: Vec<PathBuf>,
    /// Inner corners of the board, where four squares meet, in a row and in a column: one fewer than squares
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "9x6")]
    board: Corners,
    /// Side of a square, measured on the paper or the screen. It changes distances and not the lens
    #[arg(long, value_name = "MM", default_value_t = 25.0, value_parser = millimetres)]
    square_mm: f64,
    /// Where the lens goes, as OpenCV writes it (YAML)
    #[arg(short, long, value_name = "CAMERA.yaml")]
    output: Option<PathBuf>,
    /// Where the lens goes as ROS wants it (`camera_info` YAML)
    #[arg(long, value_name = "CAMERA.yaml")]
    ros: Option<PathBuf>,
    /// Name of the camera in the ROS file
    #[arg(long, value_name = "NAME", default_value = "camera", value_parser = camera_name)]
    camera_name: String,
    /// Also find the third radial coefficient: for lenses of more than about 90 degrees
    #[arg(long)]
    k3: bool,
    /// Write the board to be printed (.svg) or shown on a screen (.png) and do nothing else. Its white squares hold the eight
    /// towers, so that pictures may show a part of it; any other chessboard must be in the picture as a whole
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pictures", "output", "ros"])]
    print_pattern: Option<PathBuf>,
    /// Write a page that shows where corners were and what is left of them
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=10_000.0).contains(&value) => Ok(value),
        _ => Err("give the side of a square in millimetres, between 0.1 and 10000".to_owned()),
    }
}

/// What both YAML and ROS take without quotes.
fn camera_name(text: &str) -> Result<String, String> {
    let sound =
        text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && text.starts_with(|c: char| c.is_alphabetic());
    if sound { Ok(text.to_owned()) } else { Err("give letters, digits and _, a letter first".to_owned()) }
}

/// Runs the command.
///
/// # Errors
/// Pictures that cannot be read or differ in size, files that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let Corners { columns, rows } = args.board;
    let board = Board { columns, rows, square_mm: args.square_mm };
    if let Some(path) = &args.print_pattern {
        save(path, &output::pattern(path, &board)?)?;
        writeln!(io::stdout(), "{}", output::pattern_text(path, &board))?;
        return Ok(Outcome::Done);
    }
    if args.output.is_some() && args.output == args.ros {
        return Err("-o and --ros name the same file: give each form a file of its own".into());
    }
    let (size, found) = boards(args, &board)?;
    let (solved, fates) = solve(&found, &board, size, args.k3);
    let facts = Facts::new(args, &board, size, &solved, &fates);
    if let Ok(calibration) = &solved {
        for (path, bytes) in output::files(args, calibration)? {
            save(path, &bytes)?;
        }
    }
    if let Some(path) = &args.report {
        save(path, output::page(&facts, &found, &solved).as_bytes())?;
    }
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&facts)?)?;
    } else {
        out.write_all(facts.text().as_bytes())?;
    }
    match solved {
        Ok(_) => Ok(Outcome::Done),
        Err(reason) => {
            writeln!(io::stderr(), "no lens: {reason}")?;
            Ok(Outcome::NoAnswer)
        }
    }
}

type Found = Vec<Result<FoundBoard, NoBoard>>;

/// The size of the pictures, and the board in each.
fn boards(args: &Args, board: &Board) -> Result<([u32; 2], Found), CommandError> {
    let bar =
        if io::stderr().is_terminal() { ProgressBar::new(args.pictures.len() as u64) } else { ProgressBar::hidden() };
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    let all: Vec<([u32; 2], Result<FoundBoard, NoBoard>)> = parallel::try_map(&args.pictures, |path| {
        let gray = read_gray(path)?;
        let found = find(&gray, board);
        bar.inc(1);
        Ok::<_, CommandError>(([gray.width as u32, gray.height as u32], found))
    })?;
    bar.finish_and_clear();
    let size = all.first().map_or([0; 2], |(size, _)| *size);
    for ((other, _), path) in all.iter().zip(&args.pictures) {
        if *other != size {
            return Err(format!(
                "{} has {} x {} pixels, and {} has {} x {}: a lens is calibrated with pictures of one size, held one way; leave \
                 the others out",
                path.display(),
                other[0],
                other[1],
                args.pictures[0].display(),
                size[0],
                size[1]
            )
            .into());
        }
    }
    Ok((size, all.into_iter().map(|(_, found)| found).collect()))
}
