//! The landmark table of a run, which may be exchanged while running.

use std::fmt;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

use daymark_core::table::LandmarkTable;
use self_cell::self_cell;

use crate::output::record::TableFacts;
use crate::report::finding::Position;
use crate::table_file::{TableFileError, open_table, read_table};

self_cell!(
    struct Cell {
        owner: Vec<u8>,
        #[covariant]
        dependent: LandmarkTable,
    }
);

/// A verified table with its bytes.
pub struct LiveTable {
    path: PathBuf,
    cell: Cell,
}

impl fmt::Debug for LiveTable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("LiveTable").finish_non_exhaustive()
    }
}

/// What a table says of a landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmark {
    /// Its name.
    pub name: String,
    /// What sort of thing it is.
    pub kind: &'static str,
    /// Where it stands.
    pub position: Option<Position>,
}

impl LiveTable {
    /// Reads and verifies a table.
    ///
    /// # Errors
    /// As [`read_table`] and [`open_table`].
    pub fn load(path: &Path) -> Result<Self, TableFileError> {
        let cell = Cell::try_new(read_table(path)?, |bytes| open_table(path, bytes))?;
        Ok(Self { path: path.to_owned(), cell })
    }

    /// The table.
    pub fn table(&self) -> LandmarkTable<'_> {
        *self.cell.borrow_dependent()
    }

    /// What is told about it.
    pub fn facts(&self) -> TableFacts {
        let table = self.table();
        let header = table.header();
        TableFacts {
            file: self.path.to_string_lossy().into_owned(),
            table_id: format!("{:016x}", header.table_id()),
            profile: header.profile().name(),
            landmarks: header.landmark_count(),
            views: header.view_count(),
        }
    }

    /// A landmark by its number.
    pub fn landmark(&self, number: u32) -> Option<Landmark> {
        let landmark = self.table().landmark(number).ok()?;
        Some(Landmark {
            name: landmark.name.to_owned(),
            kind: landmark.kind.name(),
            position: landmark.position.map(Position::from),
        })
    }

    /// The number of the landmark of this name.
    pub fn number(&self, name: &str) -> Option<u32> {
        let table = self.table();
        // Landmarks are sorted by their names' bytes.
        let (mut low, mut high) = (0, table.landmark_count());
        while low < high {
            let middle = low + (high - low) / 2;
            match table.landmark(middle).ok()?.name.as_bytes().cmp(name.as_bytes()) {
                std::cmp::Ordering::Equal => return Some(middle),
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Greater => high = middle,
            }
        }
        None
    }
}

/// How often the file is looked at.
const GLANCE: Duration = Duration::from_secs(1);

/// Watches a table's file, and reads and verifies a new one in a thread, while the old one stays in use.
pub struct Reloader {
    path: PathBuf,
    seen: Option<Stamp>,
    next_glance: Instant,
    loading: Option<Receiver<Result<LiveTable, String>>>,
}

impl fmt::Debug for Reloader {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Reloader").finish_non_exhaustive()
    }
}

/// What changes when a file is replaced or rewritten.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stamp(u64, u64, i64, i64);

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let stamp = |file: Metadata| Self(file.ino(), file.len(), file.mtime(), file.mtime_nsec());
        std::fs::metadata(path).ok().map(stamp)
    }
}

impl Reloader {
    /// For a table that was just loaded.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), seen: Stamp::of(path), next_glance: Instant::now() + GLANCE, loading: None }
    }

    /// A table that has become ready, or why the new one cannot be used. Starts to read one if the file has changed or
    /// `asked`. Takes microseconds.
    pub fn poll(&mut self, asked: bool) -> Option<Result<LiveTable, String>> {
        if let Some(loading) = &self.loading {
            let ready = loading.try_recv().ok()?;
            self.loading = None;
            return Some(ready);
        }
        let now = Instant::now();
        if !asked && now < self.next_glance {
            return None;
        }
        self.next_glance = now + GLANCE;
        let stamp = Stamp::of(&self.path);
        // A file that is away for a moment is about to be replaced.
        if !asked && (stamp.is_none() || stamp == self.seen) {
            return None;
        }
        self.seen = stamp;
        let (ready, loading) = sync_channel(1);
        let path = self.path.clone();
        let load = move || {
            // The run may have ended meanwhile.
            let _ = ready.send(LiveTable::load(&path).map_err(|error| error.to_string()));
        };
        match std::thread::Builder::new().name("table".to_owned()).spawn(load) {
            Ok(_) => {
                self.loading = Some(loading);
                None
            }
            Err(error) => Some(Err(format!("cannot start a thread to read the new table: {error}"))),
        }
    }
}
