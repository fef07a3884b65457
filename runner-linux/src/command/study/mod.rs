//! `daymark study`: experiments that anybody can repeat, on made scenes with known truth; one a file.

pub mod correspondence;
pub mod fix;
pub mod repeatability;

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
    }
}
