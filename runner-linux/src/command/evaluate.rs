//! `daymark evaluate`.

use super::{CommandError, Outcome};

/// Arguments of `daymark evaluate`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs the command.
///
/// # Errors
/// Not yet.
pub fn run(_args: &Args) -> Result<Outcome, CommandError> {
    Err("not written yet".into())
}
