//! `daymark table merge` and `remove`.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::facts::{SCHEMA_VERSION, TableFacts};
use super::inspect::no_such_landmark;
use super::{OnDuplicate, print};
use crate::command::CommandError;
use crate::enroll::update::is_same;
use crate::order;
use crate::report::phrase::{count, printable};
use crate::table_file::{LandmarkEntry, OwnedTable, open_table};

/// What to merge, and how.
#[derive(Debug)]
pub(super) struct Merge<'a> {
    pub(super) out: &'a Path,
    pub(super) tables: &'a [PathBuf],
    pub(super) on_duplicate: OnDuplicate,
    pub(super) force: bool,
}

pub(super) fn merge(args: &Merge<'_>, json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Document {
        schema_version: u32,
        table: TableFacts,
        /// Landmarks that stood in several tables.
        duplicates: Vec<String>,
    }
    let out = args.out.display();
    if args.out.exists() && !args.force && !args.tables.iter().any(|table| is_same_file(table, args.out)) {
        return Err(format!(
            "{out} is there already and would be lost: name it among the tables to merge, or say --force"
        )
        .into());
    }
    let mut merged: Option<(&Path, OwnedTable)> = None;
    let mut duplicates = Vec::new();
    for path in args.tables {
        let table = OwnedTable::load(path)?;
        let Some((first, merged)) = &mut merged else {
            merged = Some((path, table));
            continue;
        };
        if table.profile != merged.profile {
            return Err(format!(
                "{} is of profile {} and {} of profile {}: a table holds views of one profile; merge those of each, \
                 or enroll the pictures again with one --profile",
                first.display(),
                merged.profile.name(),
                path.display(),
                table.profile.name()
            )
            .into());
        }
        for landmark in table.landmarks {
            let Some(known) = merged.landmarks.iter_mut().find(|known| known.name == landmark.name) else {
                merged.landmarks.push(landmark);
                continue;
            };
            duplicates.push(landmark.name.clone());
            if args.on_duplicate == OnDuplicate::Join {
                join(known, landmark);
            }
        }
    }
    order::sort(&mut duplicates);
    duplicates.dedup();
    if !duplicates.is_empty() && args.on_duplicate == OnDuplicate::Error {
        let names: Vec<String> = duplicates.iter().take(5).map(|name| format!("{name:?}")).collect();
        let more = if duplicates.len() > 5 { ", ..." } else { "" };
        return Err(format!(
            "{} in several of the tables: {}{more}. Say --on-duplicate join to keep the views of all, or keep-first to \
             keep those of the first table; nothing was written",
            if duplicates.len() == 1 {
                "this landmark is".to_owned()
            } else {
                format!("{} landmarks are", duplicates.len())
            },
            names.join(", ")
        )
        .into());
    }
    let Some((_, merged)) = merged else { return Err("name at least one table to merge".into()) };
    let bytes = merged.save(args.out)?;
    let table = TableFacts::new(args.out, open_table(args.out, &bytes)?.header());
    let document = Document { schema_version: SCHEMA_VERSION, table, duplicates };
    print(json, &document, || {
        let mut text = format!("merged {}\n", count(args.tables.len(), "table"));
        let what = if args.on_duplicate == OnDuplicate::Join { "views joined" } else { "the first kept" };
        for name in &document.duplicates {
            let _ = writeln!(text, "  {}: in several tables, {what}", printable(name));
        }
        text + &document.table.line() + "\n"
    })
}

fn is_same_file(a: &Path, b: &Path) -> bool {
    match (fs::canonicalize(a), fs::canonicalize(b)) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// Adds the views that are not there yet. Of kind and position, the first table's stand, unless it knows none.
fn join(known: &mut LandmarkEntry, other: LandmarkEntry) {
    known.position = known.position.or(other.position);
    for view in other.views {
        if !known.views.iter().any(|known| is_same(known, &view)) {
            known.views.push(view);
        }
    }
}

pub(super) fn remove(path: &Path, names: &[String], json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Removed {
        landmark: String,
        views: usize,
    }
    #[derive(Serialize)]
    struct Document {
        schema_version: u32,
        removed: Vec<Removed>,
        table: TableFacts,
    }
    let mut table = OwnedTable::load(path)?;
    let mut removed = Vec::new();
    for name in names {
        let Some(index) = table.landmarks.iter().position(|landmark| landmark.name == *name) else {
            if removed.iter().any(|removed: &Removed| removed.landmark == *name) {
                continue;
            }
            return Err(no_such_landmark(path, name, table.landmarks.iter().map(|landmark| landmark.name.as_str())));
        };
        let landmark = table.landmarks.remove(index);
        removed.push(Removed { landmark: landmark.name, views: landmark.views.len() });
    }
    let bytes = table.save(path)?;
    let table = TableFacts::new(path, open_table(path, &bytes)?.header());
    let document = Document { schema_version: SCHEMA_VERSION, removed, table };
    print(json, &document, || {
        let mut text = String::new();
        for Removed { landmark, views } in &document.removed {
            let _ = writeln!(text, "removed {}: {}", printable(landmark), count(*views, "view"));
        }
        text + &document.table.line() + "\n"
    })
}
