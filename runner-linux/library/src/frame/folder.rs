//! Files and folders of pictures as a source of frames: in order, at a given rate.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use super::{Delivery, Fault, Frame, FrameSource, Opener};
use crate::order;
use crate::picture::read_gray;

const ENDINGS: [&str; 10] = ["jpg", "jpeg", "png", "pgm", "ppm", "pnm", "bmp", "webp", "tif", "tiff"];

/// The pictures of a folder, by the bytes of their names; or a single picture.
///
/// # Errors
/// What is wrong with the path.
pub fn pictures(path: &Path) -> Result<Vec<PathBuf>, String> {
    let cannot = |error: io::Error| format!("cannot read the frames in {}: {error}", path.display());
    if !std::fs::metadata(path).map_err(cannot)?.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(cannot)? {
        let file = entry.map_err(cannot)?.path();
        let ending = file.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        if ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) {
            files.push(file);
        }
    }
    order::sort(&mut files);
    if files.is_empty() {
        return Err(format!("no pictures in {}; their names end in {}", path.display(), ENDINGS.join(", ")));
    }
    Ok(files)
}

/// Pictures that are a video.
#[derive(Debug, Clone)]
pub struct Folder {
    name: String,
    rate_hz: f64,
    real_time: bool,
    /// What is left outlives a source that is closed and opened again.
    left: Arc<Mutex<Left>>,
}

#[derive(Debug)]
struct Left {
    files: VecDeque<PathBuf>,
    number: u64,
}

impl Folder {
    /// The pictures at `path`, `rate_hz` a second. In real time they come when they are due, as from a camera, and one
    /// that comes too early for whoever looks at them is lost; else each is looked at, as fast as that goes.
    ///
    /// # Errors
    /// What is wrong with the path.
    pub fn new(path: &Path, rate_hz: f64, real_time: bool) -> Result<Self, String> {
        let left = Left { files: pictures(path)?.into(), number: 0 };
        Ok(Self { name: path.display().to_string(), rate_hz, real_time, left: Arc::new(Mutex::new(left)) })
    }

    fn left(&self) -> MutexGuard<'_, Left> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Opener for Folder {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn open(&mut self) -> Result<Box<dyn FrameSource>, Fault> {
        let passed = Duration::from_secs_f64(self.left().number as f64 / self.rate_hz);
        let now = Instant::now();
        Ok(Box::new(OpenFolder { folder: self.clone(), begin: now.checked_sub(passed).unwrap_or(now) }))
    }

    fn delivery(&self) -> Delivery {
        if self.real_time { Delivery::Newest } else { Delivery::Every }
    }

    fn clock_may_jump(&self) -> bool {
        false
    }
}

struct OpenFolder {
    folder: Folder,
    begin: Instant,
}

impl FrameSource for OpenFolder {
    fn describe(&self) -> String {
        let Folder { name, rate_hz, real_time, .. } = &self.folder;
        let pace = if *real_time { ", in real time" } else { "" };
        format!("{name}: {} pictures, {rate_hz} a second{pace}", self.folder.left().files.len())
    }

    fn next(&mut self, frame: &mut Frame, patience: Duration) -> Result<(), Fault> {
        let Folder { rate_hz, real_time, .. } = self.folder;
        let mut left = self.folder.left();
        let Some(file) = left.files.front() else { return Err(Fault::End) };
        let due = Duration::from_secs_f64(left.number as f64 / rate_hz);
        if real_time {
            let early = (self.begin + due).saturating_duration_since(Instant::now());
            if early > patience {
                std::thread::sleep(patience);
                return Err(Fault::Again);
            }
            std::thread::sleep(early);
        }
        let begin = Instant::now();
        let read = read_gray(file).map_err(|error| Fault::Corrupt(error.to_string()));
        frame.file = file.file_name().map(|name| name.to_string_lossy().into_owned());
        left.files.pop_front();
        frame.number = left.number;
        left.number += 1;
        frame.time = due;
        frame.utc = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok().filter(|_| real_time);
        frame.gray = read?;
        frame.decode = begin.elapsed();
        Ok(())
    }
}
