//! The command line of daymark: parse, dispatch, exit code.

use std::process::ExitCode;

use clap::Parser;
use daymark::command::{Cli, report_error};

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(outcome) => outcome.into(),
        Err(error) => report_error(error.as_ref()),
    }
}
