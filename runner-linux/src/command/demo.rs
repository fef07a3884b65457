//! `daymark demo`.

use super::{CommandError, Outcome};

/// Arguments of `daymark demo`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs the command.
///
/// # Errors
/// Not yet.
pub fn run(_args: &Args) -> Result<Outcome, CommandError> {
    Err("not written yet".into())
}
