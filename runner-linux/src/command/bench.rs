//! `daymark bench`.

use super::{CommandError, Outcome};

/// Arguments of `daymark bench`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs the command.
///
/// # Errors
/// Not yet.
pub fn run(_args: &Args) -> Result<Outcome, CommandError> {
    Err("not written yet".into())
}
