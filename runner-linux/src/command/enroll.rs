//! `daymark enroll`.

use super::{CommandError, Outcome};

/// Arguments of `daymark enroll`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs the command.
///
/// # Errors
/// Not yet.
pub fn run(_args: &Args) -> Result<Outcome, CommandError> {
    Err("not written yet".into())
}
