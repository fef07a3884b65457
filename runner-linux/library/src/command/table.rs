//! `daymark table`: look into, check, merge and change landmark tables.

mod change;
pub(super) mod facts;
mod inspect;
mod model;
mod near;

use std::io::{self, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::{CommandError, Outcome};

/// Arguments of `daymark table`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Print the landmarks of a table with their views, bytes and positions
    List {
        /// The table
        table: PathBuf,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
    /// Print the views of one landmark: size, corners, corners on each level
    Show {
        /// The table
        table: PathBuf,
        /// The landmark
        name: String,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
    /// Write the model of a landmark as a file, with the dense cloud made again from what the table stores
    Model {
        /// The table
        table: PathBuf,
        /// The landmark
        name: String,
        /// Where the model goes: .ply or .glb
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// How often every triangle is divided in four
        #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=7))]
        levels: u8,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
    /// Check every checksum and every record; exit 0 if the table is sound, 2 if not
    Verify {
        /// The table
        table: PathBuf,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
    /// Make one table of several
    Merge {
        /// The table to write; it may be one of those to merge
        out: PathBuf,
        /// The tables to merge, all of one profile
        #[arg(required = true, value_name = "TABLES")]
        tables: Vec<PathBuf>,
        /// What to do with a landmark that stands in several tables
        #[arg(long, value_enum, default_value_t = OnDuplicate::Error)]
        on_duplicate: OnDuplicate,
        /// Replace OUT if it is there and not one of the tables to merge
        #[arg(long)]
        force: bool,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
    /// Take landmarks out of a table
    Remove {
        /// The table
        table: PathBuf,
        /// The landmarks
        #[arg(required = true, value_name = "NAMES")]
        names: Vec<String>,
        /// Print one JSON document instead of text
        #[arg(long)]
        json: bool,
    },
}

/// What a merge does with a landmark that stands in several tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum OnDuplicate {
    /// Refuse, and name it
    Error,
    /// Keep the one of the first table
    KeepFirst,
    /// Keep the views of all
    Join,
}

/// Runs the command.
///
/// # Errors
/// A table that cannot be read or written, or does not have what was asked for; no table was changed.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match &args.action {
        Action::List { table, json } => inspect::list(table, *json),
        Action::Show { table, name, json } => inspect::show(table, name, *json),
        Action::Model { table, name, output, levels, json } => model::model(table, name, output, *levels, *json),
        Action::Verify { table, json } => inspect::verify(table, *json),
        Action::Merge { out, tables, on_duplicate, force, json } => {
            let merge = change::Merge { out, tables, on_duplicate: *on_duplicate, force: *force };
            change::merge(&merge, *json)
        }
        Action::Remove { table, names, json } => change::remove(table, names, *json),
    }?;
    Ok(Outcome::Done)
}

/// Prints a result: the document as JSON, or its text.
pub(super) fn print(json: bool, document: &impl Serialize, text: impl FnOnce() -> String) -> Result<(), CommandError> {
    let result = if json { serde_json::to_string_pretty(document)? + "\n" } else { text() };
    let mut out = io::stdout().lock();
    out.write_all(result.as_bytes())?;
    out.flush()?;
    Ok(())
}
