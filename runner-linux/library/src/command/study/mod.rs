//! `daymark study`: experiments that anybody can repeat, on made scenes with known truth; one a file.

pub mod correspondence;
pub mod fix;
pub mod repeatability;
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
    /// How many hand-picked corners are matched, and how many wrongly, by their places alone
    Correspondence(correspondence::Args),
    /// How many automatic corners are found again, and how many are matched rightly by their places alone
    Repeatability(repeatability::Args),
    /// Where an observer stands who walks among the eight towers: errors, and how far the stated ones are true
    Fix(fix::Args),
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
        Study::Correspondence(args) => correspondence::run(args),
        Study::Repeatability(args) => repeatability::run(args),
        Study::Fix(args) => fix::run(args),
        Study::Towers(args) => towers::run(args),
        Study::Subdivision(args) => subdivision::run(args),
    }
}
