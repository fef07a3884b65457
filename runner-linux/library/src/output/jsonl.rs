//! JSON Lines: every record is a line, with the version of their form.

use serde::Serialize;

use super::Form;
use super::record::Record;

/// Version of `docs/watch.schema.json`.
pub const SCHEMA_VERSION: u32 = 1;

/// JSON Lines.
#[derive(Debug, Clone, Copy)]
pub struct Jsonl;

#[derive(Serialize)]
struct Line<'a> {
    schema_version: u32,
    #[serde(flatten)]
    record: &'a Record,
}

impl Form for Jsonl {
    fn write(&mut self, record: &Record, out: &mut Vec<u8>) {
        let before = out.len();
        match serde_json::to_writer(&mut *out, &Line { schema_version: SCHEMA_VERSION, record }) {
            Ok(()) => out.push(b'\n'),
            // Memory takes every write, and records have no keys that are not text.
            Err(_) => out.truncate(before),
        }
    }
}
