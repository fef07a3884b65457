//! A folder with pictures, and the real binary run in it.

#![allow(dead_code, reason = "each test uses a part of it")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use image::{GrayImage, Luma};
use serde_json::Value;
use tempfile::TempDir;

/// A folder of its own for one test; every command runs in it, so that paths in messages are short and alike.
pub(crate) struct Town {
    folder: TempDir,
}

/// What the binary said.
#[derive(Debug)]
pub(crate) struct Ran {
    /// The exit code; `None` if a signal ended it.
    pub(crate) code: Option<i32>,
    /// The result.
    pub(crate) stdout: String,
    /// Progress, warnings, errors.
    pub(crate) stderr: String,
}

impl Town {
    /// An empty folder.
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a folder") }
    }

    /// A folder with `town.daymark`, in which stand the Gate and the Mill, each with one view.
    pub(crate) fn with_table() -> Self {
        let town = Self::new();
        town.tower(1, "left", "gate.pgm");
        town.tower(2, "left", "mill.pgm");
        town.enroll("Gate", "gate.pgm");
        town.enroll("Mill", "mill.pgm");
        town
    }

    fn enroll(&self, name: &str, picture: &str) {
        self.run(&["enroll", "--table", "town.daymark", "--name", name, "--no-lint", picture]).succeeded();
    }

    /// Runs `daymark` with these arguments.
    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        Ran::of(self.command().args(arguments).output())
    }

    /// The binary, to be run in this folder.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_daymark"));
        command.current_dir(self.folder.path()).env_remove("DAYMARK_KERNELS");
        command
    }

    /// Puts the committed picture of a tower of the fixtures here: 320 x 240, `part` is left or right.
    pub(crate) fn tower(&self, number: u32, part: &str, name: &str) {
        let source = fixture(&format!("tower-{number}-{part}.pgm"));
        fs::copy(source, self.path(name)).expect("a fixture");
    }

    /// Puts a picture here that this function draws.
    pub(crate) fn draw(&self, name: &str, width: u32, height: u32, gray: impl Fn(u32, u32) -> u8) {
        let picture = GrayImage::from_fn(width, height, |x, y| Luma([gray(x, y)]));
        picture.save(self.path(name)).expect("a picture");
    }

    /// Puts a file here.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).expect("a file");
    }

    /// The bytes of a file.
    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("a file")
    }

    /// Where a file is.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The names of all files, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// A committed file of the fixtures.
pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/files").join(name)
}

/// A gray level that looks like noise, the same for the same place and seed.
pub(crate) fn speckle(x: u32, y: u32, seed: u32) -> u8 {
    let mut hash = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ seed.wrapping_mul(0xC2B2_AE3D);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
    (hash ^ (hash >> 15)).to_le_bytes()[0]
}

impl Ran {
    /// What a command gave that was run by other means.
    pub(crate) fn of(output: std::io::Result<Output>) -> Self {
        let output = output.expect("the binary runs");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Exit 0.
    #[track_caller]
    pub(crate) fn succeeded(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:#?}");
        self
    }

    /// Exit 2, nothing on standard output, and an error that says each of these.
    #[track_caller]
    pub(crate) fn refused(self, expected: &[&str]) -> Self {
        assert_eq!(self.code, Some(2), "{self:#?}");
        assert_eq!(self.stdout, "", "{self:#?}");
        assert!(self.stderr.starts_with("error: "), "{self:#?}");
        for expected in expected {
            assert!(self.stderr.contains(expected), "lacks {expected:?}: {self:#?}");
        }
        self
    }

    /// Exit 2 with the usage, because the arguments do not go together.
    #[track_caller]
    pub(crate) fn refused_by_the_parser(self, expected: &str) {
        assert_eq!(self.code, Some(2), "{self:#?}");
        assert!(self.stderr.contains(expected), "lacks {expected:?}: {self:#?}");
    }

    /// Standard output as one JSON document.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:#?}"))
    }
}
