//! The subcommands, one file each.
//!
//! Standard output carries the result, standard error progress and warnings. Exit codes: 0 recognized or done, 1 no
//! answer, 2 error.

pub mod bench;
pub mod calibrate;
pub mod correspond;
pub mod classify;
pub mod demo;
pub mod enroll;
pub mod evaluate;
pub mod recognize;
pub mod study;
pub mod synthesize;
pub mod table;
pub mod watch;

use std::error::Error;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// A star tracker for buildings: which building does this picture show, and how sure is that?
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 recognized or done, 1 no answer, 2 error. New here? Try `daymark demo`.")]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show what daymark does, on a scene that it makes itself: no camera, no network, no downloads
    Demo(demo::Args),
    /// Add buildings to a landmark table, from pictures of them
    Enroll(enroll::Args),
    /// Say which building of a table each picture shows, and how sure that is
    Recognize(recognize::Args),
    /// Match the corners of two pictures, by their places alone
    Correspond(correspond::Args),
    /// Make a textured 3D model of a building from two or more pictures
    Synthesize(synthesize::Args),
    /// Say which of several models a model is, by shape and appearance
    Classify(classify::Args),
    /// Find out what a camera's lens does, from pictures of a chessboard, so that positions are exact
    Calibrate(calibrate::Args),
    /// Look into, check, merge and change landmark tables
    Table(table::Args),
    /// Measure recall, false answers and time on a folder of pictures with a manifest
    Evaluate(evaluate::Args),
    /// Repeat the experiments that the documents quote
    Study(study::Args),
    /// Time the stages of recognition on this machine
    Bench(bench::Args),
    /// Watch a camera, a pipe or a folder, and say what is seen for as long as it is seen
    Watch(watch::Args),
}

/// How a command ended, if not by an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Recognized, or done.
    Done,
    /// Everything was read, and there is no answer.
    NoAnswer,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Done => Self::from(0),
            Outcome::NoAnswer => Self::from(1),
        }
    }
}

/// An error as a command reports it: one text that says what is wrong, whose fault it is and what to do.
pub type CommandError = Box<dyn Error + Send + Sync>;

impl Cli {
    /// Runs the command that was asked for.
    ///
    /// # Errors
    /// Whatever kept the command from doing its work; nothing was lost.
    pub fn run(self) -> Result<Outcome, CommandError> {
        match self.command {
            Command::Demo(args) => demo::run(&args),
            Command::Enroll(args) => enroll::run(&args),
            Command::Recognize(args) => recognize::run(&args),
            Command::Correspond(args) => correspond::run(&args),
            Command::Synthesize(args) => synthesize::run(&args),
            Command::Classify(args) => classify::run(&args),
            Command::Calibrate(args) => calibrate::run(&args),
            Command::Table(args) => table::run(&args),
            Command::Evaluate(args) => evaluate::run(&args),
            Command::Bench(args) => bench::run(&args),
            Command::Study(args) => study::run(&args),
            Command::Watch(args) => watch::run(&args),
        }
    }
}

/// Prints an error and gives the exit code 2. A closed pipe behind us is not an error: the reader had enough.
pub fn report_error(error: &(dyn Error + Send + Sync + 'static)) -> ExitCode {
    if error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe) {
        return ExitCode::from(0);
    }
    let _ = writeln!(io::stderr(), "error: {error}");
    ExitCode::from(2)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn every_flag_is_well_formed() {
        super::Cli::command().debug_assert();
    }
}
