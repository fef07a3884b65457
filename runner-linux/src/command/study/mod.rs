//! `daymark study`: experiments that anybody can repeat.

pub mod subdivision;
pub mod towers;

use super::{CommandError, Outcome};

/// Arguments of `daymark study`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, clap::Subcommand)]
enum Study {
    /// Which of eight towers is it? Models from two noisy views against models from all sides
    Towers(towers::Args),
    /// How far should subdivision go? Errors within and between the eight towers, time and memory of each level
    Subdivision(subdivision::Args),
}

/// Runs the study that was asked for.
///
/// # Errors
/// What kept it from being done.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match &args.study {
        Study::Towers(args) => towers::run(args),
        Study::Subdivision(args) => subdivision::run(args),
    }
}
