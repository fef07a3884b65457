//! The landmark table: what was enrolled, in one file that is read in place.
//!
//! ```text
//! header 40 B | landmark index 12 B each | view index 16 B each | model index 12 B each | records of each, in this order
//! ```
//!
//! `core/FORMAT.md` specifies every byte. A **landmark** has a name, a [`Kind`] and, where known, a position; its
//! **views** are the corners of one enrolled frame each, numbered through the whole table in the order of the
//! landmarks. Its **model**, if it has one, says where corners of its views are in space, and the surface between them.
//!
//! Two readers give the same results and the same errors: [`LandmarkTable`] reads in place from flash or a memory map,
//! [`TableStream`] reads one record at a time from an [`embedded_io`] source into the caller's buffer. The recognizer
//! takes either as a [`ViewSource`]. [`TableEncoder`] is the one definition of how a table is written.
//!
//! What is checked when:
//!
//! | step | checks |
//! |---|---|
//! | `open` | the header, the whole index, every landmark's record, the order of the names; nothing of the views |
//! | `view`, `model` | the record's checksum, its form, every corner, point and triangle |
//! | `verify`, `verified` | all views and models; [`LandmarkTable::verified`] gives a table whose later reads skip what cannot change |
//!
//! A table in place, from its bytes to its first corner:
//!
//! ```
//! use daymark_core::table::{LandmarkTable, TableError};
//!
//! fn corners_of_first_view(bytes: &[u8]) -> Result<usize, TableError> {
//!     let table = LandmarkTable::open(bytes)?;
//!     let view = table.view(0)?;
//!     Ok(view.features().filter(|corner| corner.level == 0).count())
//! }
//! assert_eq!(corners_of_first_view(&[]), Err(TableError::Empty));
//! ```

mod checksum;
mod encode;
mod error;
mod fault;
mod header;
mod in_place;
mod index;
mod kind;
mod landmark;
mod model;
mod selected;
mod stream;
mod view;

pub use encode::{EncodeError, TableEncoder, encode_landmark, encode_model, encode_view};
pub use error::{RecordKind, StreamError, TableError, TableLimit};
pub use fault::{CornerFault, HeaderFault, IndexFault, RecordFault};
pub use header::{FORMAT_VERSION, HEADER_BYTES, Header, MAGIC, VERSION_WITHOUT_MODELS};
pub use in_place::LandmarkTable;
pub use index::{LANDMARK_ENTRY_BYTES, MODEL_ENTRY_BYTES, VIEW_ENTRY_BYTES};
pub use kind::Kind;
pub use landmark::{
    ERROR_LIMIT_DM, GeoPosition, LANDMARK_BYTES, LATITUDE_LIMIT_E7, LONGITUDE_LIMIT_E7, Landmark, NAME_BYTES,
};
pub use model::{
    ModelFacts, ModelFault, ModelPoint, ModelledView, POINT_BYTES, POINTS_LIMIT, PackedPoint, StoredAzimuth,
    StoredModel, TRIANGLE_BYTES, TRIANGLES_LIMIT, UNIT_LIMIT_UM,
};
pub use selected::SelectedViews;
pub use stream::TableStream;
pub use view::{CORNER_BYTES, LEVELS, SIDE_LIMIT, StoredView, VIEW_HEADER_BYTES, corner_key, on_grid};

use crate::profile::Profile;

/// Views in one table, at most. With it every offset of a table without models fits 32 bits, whatever the views hold; one
/// with models may come to that end earlier, and says so when it is written.
pub const VIEWS_LIMIT: u32 = 250_000;

// Every landmark has a view, so there are at most as many landmarks; view_bytes() counts a view's index entry.
const _: () = assert!(
    HEADER_BYTES as u64
        + VIEWS_LIMIT as u64 * (Profile::Board.view_bytes() as u64 + (LANDMARK_ENTRY_BYTES + LANDMARK_BYTES) as u64)
        <= u32::MAX as u64
);
const _: () = assert!(view_bytes(Profile::Handheld) <= Profile::Handheld.view_bytes());
const _: () = assert!(view_bytes(Profile::Board) <= Profile::Board.view_bytes());

/// Corners that one view of a table of `profile` may hold.
///
/// Enrollment keeps [`Profile::corners_per_view`], at most this.
pub const fn corners_limit(profile: Profile) -> u16 {
    match profile {
        Profile::Handheld => 100,
        Profile::Board => 800,
    }
}

/// Bytes of the largest view of `profile`, with its entry in the index.
const fn view_bytes(profile: Profile) -> usize {
    VIEW_ENTRY_BYTES + VIEW_HEADER_BYTES + corners_limit(profile) as usize * CORNER_BYTES
}

/// Where the recognizer gets its views from: both readers implement it and give the same results.
///
/// Walk `0..view_count()` in order; that is what both are built for.
pub trait ViewSource {
    /// What can go wrong with a record.
    type Error: core::error::Error;

    /// The counts, limits and identity of the table.
    fn header(&self) -> &Header;

    /// Bytes that the buffer of [`view`](Self::view) and [`landmark`](Self::landmark) must have, for any record of
    /// this table; 0 for a reader in place.
    fn buffer_bytes(&self) -> usize;

    /// View `number`, in `0..view_count()`. A reader in place ignores `buffer`.
    ///
    /// # Errors
    ///
    /// The record is damaged or cannot be read, `buffer` is too small, or there is no such view.
    fn view<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<StoredView<'s>, Self::Error>;

    /// Landmark `number`, in `0..landmark_count()`. A reader in place ignores `buffer`.
    ///
    /// # Errors
    ///
    /// The record is damaged or cannot be read, `buffer` is too small, or there is no such landmark.
    fn landmark<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Landmark<'s>, Self::Error>;

    /// Bytes that the buffer of [`model`](Self::model) must have, for any model of this table; 0 for a reader in place.
    fn model_bytes(&self) -> usize;

    /// The model of landmark `number`, in `0..landmark_count()`, if it has one. A reader in place ignores `buffer`.
    ///
    /// # Errors
    ///
    /// The record is damaged or cannot be read, `buffer` is too small, or there is no such landmark.
    fn model<'s>(&'s mut self, number: u32, buffer: &'s mut [u8]) -> Result<Option<StoredModel<'s>>, Self::Error>;

    /// The class of device whose views the table holds.
    fn profile(&self) -> Profile {
        self.header().profile()
    }

    /// How many views the table holds.
    fn view_count(&self) -> u32 {
        self.header().view_count()
    }

    /// How many landmarks the table holds.
    fn landmark_count(&self) -> u32 {
        self.header().landmark_count()
    }

    /// No view of the table holds more corners than this.
    fn corners_limit(&self) -> u16 {
        self.header().corners_limit()
    }
}
