//! What a run tells the world: records, the forms they are written in, and where they go.
//!
//! ```text
//!  record ── text     for a person            ┐
//!         ── jsonl    for programs            ├─ target ── stdout, a file, a serial line, UDP
//!         ── nmea     for navigation devices  │            (a thread each, with a bounded queue)
//!         ── geojson  for maps                ┘
//! ```

pub mod record;
pub mod fix;
pub mod text;
pub mod jsonl;
pub mod nmea;
pub mod geojson;
pub mod target;

use std::fmt;
use std::str::FromStr;

use record::Record;
use target::Target;

/// A form in which records are written. A form may leave records out.
pub trait Form: Send {
    /// Appends what is to be written for a record.
    fn write(&mut self, record: &Record, out: &mut Vec<u8>);
}

/// A form and where it goes, as on the command line: `jsonl:answers.jsonl`, `nmea:udp://127.0.0.1:10110`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// The form.
    pub form: FormName,
    /// Where it goes.
    pub target: Target,
}

/// The forms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FormName {
    /// [`text`].
    Text,
    /// [`jsonl`].
    Jsonl,
    /// [`nmea`].
    Nmea,
    /// [`geojson`].
    Geojson,
}

impl FormName {
    const ALL: [(Self, &'static str); 4] =
        [(Self::Text, "text"), (Self::Jsonl, "jsonl"), (Self::Nmea, "nmea"), (Self::Geojson, "geojson")];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(form, _)| *form == self).map_or("", |(_, name)| name)
    }

    /// The form itself.
    pub fn make(self) -> Box<dyn Form> {
        match self {
            Self::Text => Box::new(text::Text::default()),
            Self::Jsonl => Box::new(jsonl::Jsonl),
            Self::Nmea => Box::new(nmea::Nmea::default()),
            Self::Geojson => Box::new(geojson::Geojson),
        }
    }
}

impl FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, target) = text.split_once(':').unwrap_or((text, "-"));
        let form = FormName::ALL.into_iter().find(|(_, known)| *known == name);
        let (form, _) = form.ok_or_else(|| format!("there is no form {name:?}; write text, jsonl, nmea or geojson"))?;
        Ok(Self { form, target: target.parse()? })
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}", self.form.name(), self.target)
    }
}
