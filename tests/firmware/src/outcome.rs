//! What a round gave.

use daymark_core::geometry::GeometryError;
use daymark_core::image::FrameError;
use daymark_core::table::{EncodeError, StreamError, TableError};

/// A round in short; the answers themselves go to where the device shows them.
#[derive(Clone, Copy)]
#[cfg_attr(target_os = "none", expect(dead_code, reason = "the fields are for whoever looks at the memory"))]
pub struct Outcome {
    /// The frame shows what was enrolled.
    pub known: bool,
    /// Both readers gave the same answer.
    pub same: bool,
    /// Corners of the frame.
    pub corners: usize,
    /// Stored corners that had something to say.
    pub explained: usize,
    /// Bytes of the best landmark's name.
    pub name_bytes: usize,
}

/// Why there is no outcome.
#[derive(Clone, Copy)]
#[expect(dead_code, reason = "the fields are for whoever looks at the memory")]
pub enum Failure {
    /// The frame.
    Frame(FrameError),
    /// The table.
    Table(TableError),
    /// The stream of the table.
    Stream,
    /// Writing the table.
    Encode(EncodeError),
    /// The points for hulls.
    Geometry(GeometryError),
    /// The layers of hulls are not what they should be.
    Nesting,
    /// Corners are not found again in another view.
    Pairs,
    /// The frame shows nothing.
    Blank,
    /// The flash pages are full.
    Full,
    /// The geometry of views, or a position, is wrong.
    Views,
}

impl From<GeometryError> for Failure {
    fn from(error: GeometryError) -> Self {
        Self::Geometry(error)
    }
}

impl From<FrameError> for Failure {
    fn from(error: FrameError) -> Self {
        Self::Frame(error)
    }
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        Self::Table(error)
    }
}

impl<E> From<StreamError<E>> for Failure {
    fn from(error: StreamError<E>) -> Self {
        match error {
            StreamError::Table(error) => Self::Table(error),
            _ => Self::Stream,
        }
    }
}

impl From<EncodeError> for Failure {
    fn from(error: EncodeError) -> Self {
        Self::Encode(error)
    }
}
