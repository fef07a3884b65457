//! `daymark study`: how well the parts work, measured on made scenes with known truth; one study a file.

pub mod correspondence;
pub mod fix;

use clap::{Args as ClapArgs, Subcommand};

use super::{CommandError, Outcome};

/// Arguments of `daymark study`.
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, Subcommand)]
enum Study {
    /// How many corners are matched, and how many wrongly, by their places alone
    Correspondence(correspondence::Args),
    /// Where an observer stands who walks among the eight towers: errors, and how far the stated ones are true
    Fix(fix::Args),
}

pub(super) fn run(args: &Args) -> Result<Outcome, CommandError> {
    match &args.study {
        Study::Correspondence(args) => correspondence::run(args),
        Study::Fix(args) => fix::run(args),
    }
}
