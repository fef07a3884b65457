//! The log: a line an event on standard error, with names for its values.
//!
//! `2026-11-22T13:32:28Z WARN the source is lost; it will be opened again fault="stream_error" count=1`
//!
//! Under systemd the journal keeps the time, and the level goes before the line as it expects it (`<4>`, sd-daemon(3)).
//! `tracing`'s own subscriber does much more and takes 200 KB of the program.

use std::fmt::{self, Write as _};
use std::io::{self, Write as _};
use std::time::SystemTime;

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

use crate::calendar::{civil, clock};

/// Sends events from INFO on to standard error. Called again, it changes nothing.
pub(crate) fn to_stderr() {
    let journal = std::env::var_os("JOURNAL_STREAM").is_some();
    // Another log is there already, as in tests.
    let _ = tracing::subscriber::set_global_default(Log { journal });
}

struct Log {
    journal: bool,
}

#[derive(Default)]
struct Line {
    message: String,
    values: String,
}

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.values, " {name}={value:?}"),
        };
    }
}

impl Subscriber for Log {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_event() && *metadata.level() <= Level::INFO
    }

    fn event(&self, event: &Event<'_>) {
        let mut line = Line::default();
        event.record(&mut line);
        let level = *event.metadata().level();
        let begin = if self.journal {
            let priority = match level {
                Level::ERROR => 3,
                Level::WARN => 4,
                _ => 6,
            };
            format!("<{priority}>")
        } else {
            format!("{} {level} ", now())
        };
        // A line in one piece; there is nobody to tell that the log cannot be written.
        let _ = io::stderr().write_all(format!("{begin}{}{}\n", line.message, line.values).as_bytes());
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

fn now() -> String {
    let seconds = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let ((year, month, day), (hour, minute, second)) = (civil(seconds / 86_400), clock(seconds));
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}
