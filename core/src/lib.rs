//! Recognizes enrolled buildings in a gray frame, and says how likely the answer is false.
//!
//! No heap, no operating system, no unsafe code, no panic; the same bits on every target. The modules stand in the
//! order of the data, and each uses only those above it (and the foundations):
//!
//! ```text
//!  frame ── image ─ tone ─ pyramid ─ response ─ corner ─ signature ─── extract ──┐ features
//!                                                                                │
//!  table ── one stored view after the other ─────────────────────────────────────┤
//!                                                                                ▼
//!     query       features by place            candidate   signatures that are alike
//!     hypothesis  where the view may lie       shortlist   look-alikes of each stored corner
//!     refine      guided rounds, homography    evidence    bits for and against
//!                                                                                │
//!                                                        matcher ── recognizer ── verdict
//! ```
//!
//! Foundations: [`math`] (the only caller of `libm`), [`point`] (frames of reference), [`profile`], [`kernel`] (the inner
//! loops, which a caller may compile for wider instructions), [`transform`] and [`linear`]. [`capacity`] sizes it all for
//! a small device. [`mesh`] makes many corresponding points of few, [`family`] and [`camera`] are the geometry of
//! views.
//!
//! A frame against a table in memory or flash:
//!
//! ```
//! use daymark_core::capacity::{
//!     HANDHELD_FRONT_END, HandheldExtractor, HandheldFeatures, HandheldMemory, HandheldRecognizer,
//! };
//! use daymark_core::kernel::Portable;
//! use daymark_core::table::LandmarkTable;
//! use daymark_core::tone::TonedFrame;
//! use daymark_core::verdict::{FalseAnswer, Verdict};
//!
//! fn which_building(
//!     frame: &mut [u8; 320 * 240],
//!     table: &[u8],
//! ) -> Result<Option<u32>, Box<dyn core::error::Error>> {
//!     const MEMORY: HandheldMemory = HandheldMemory::of_frame(320, 240);
//!     let mut features = HandheldFeatures::new();
//!     let frame = TonedFrame::in_place(frame, 320, 240, 320)?;
//!     let mut levels = [0; MEMORY.levels];
//!     HandheldExtractor::new().extract(&Portable, frame, HANDHELD_FRONT_END, &mut levels, &mut features)?;
//!
//!     let mut table = LandmarkTable::open(table)?;
//!     let mut distances = [0; MEMORY.distances];
//!     let limit = FalseAnswer::ONE_PERCENT;
//!     let recognition = HandheldRecognizer::new().recognize(
//!         &Portable, features.view(), &mut table, &mut distances, &mut [], limit,
//!     )?;
//!     Ok(match recognition.verdict {
//!         Verdict::Known(answer) => Some(answer.landmark),
//!         _ => None,
//!     })
//! }
//! # // An empty table knows nothing; a damaged one is an error.
//! # let empty = daymark_core::table::TableEncoder::new(daymark_core::profile::Profile::Handheld, 100, 0, 0);
//! # let empty = empty.and_then(|encoder| encoder.finish()).unwrap();
//! # assert_eq!(which_building(&mut [7; 320 * 240], &empty).unwrap(), None);
//! # assert!(which_building(&mut [7; 320 * 240], &empty[1..]).is_err());
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod math;
pub mod point;
pub mod profile;
pub mod feature;
pub mod kernel;
mod model;
pub mod linear;
pub mod transform;
pub mod mesh;
pub mod family;
pub mod camera;

pub mod image;
pub mod tone;
pub mod pyramid;
pub mod response;
pub mod corner;
pub mod signature;
pub mod extract;

pub mod query;
pub mod candidate;
pub mod hypothesis;
pub mod shortlist;
pub mod refine;
pub mod evidence;
pub mod matcher;

pub mod table;

pub mod verdict;
pub mod recognizer;
pub mod capacity;
