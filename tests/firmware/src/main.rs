//! A device's program in small: it sees a frame, enrolls it, and recognizes it again, from a table in place and from a
//! streamed one.
//!
//! It links only if no panic path is left: the panic handler calls a function that nobody has. That is the proof that
//! no input, however malformed, makes `daymark-core` panic; `check.sh` runs it. On a host the program runs as well and
//! measures its stack, on which everything but the frame and the table lives.
//!
//! The frame's pixels, its size and the table come from memory that the compiler cannot see through, so that nothing
//! is computed, or proved harmless, at compile time.

#![no_std]
#![no_main]

mod device;
mod enroll;
mod nest;
mod outcome;
mod pairs;
mod recognize;
#[cfg_attr(target_os = "none", path = "start_bare.rs")]
#[cfg_attr(not(target_os = "none"), path = "start_host.rs")]
mod start;
mod position;
mod views;

use daymark_core::capacity::{
    HANDHELD_CORRESPOND_BYTES, HANDHELD_FRONT_END, HandheldExtractor, HandheldFeatures, HandheldMemory,
};
use daymark_core::image::GrayView;
use daymark_core::kernel::Portable;
use daymark_core::tone::TonedFrame;

use device::Device;
use outcome::{Failure, Outcome};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// What this device needs for such frames.
const MEMORY: HandheldMemory = HandheldMemory::of_frame(WIDTH, HEIGHT);
/// The stack, on which everything lives but the frame, the table and the answers; `memory.x` has the same number.
const STACK: usize = 64 * 1_024;
/// What is left of it for the calls, at least: the host's round measures that they need no more.
const CALLS: usize = 2 * 1_024;
const _: () = assert!(MEMORY.peak() + CALLS <= STACK);

/// [`MEMORY`] where `check.sh` finds it: levels, extractor, features, distances, record, recognizer, and matching
/// by nested hulls.
#[used]
#[unsafe(link_section = ".memory_table")]
static MEMORY_TABLE: [u32; 7] = [
    MEMORY.levels as u32,
    MEMORY.extractor as u32,
    MEMORY.features as u32,
    MEMORY.distances as u32,
    MEMORY.record as u32,
    MEMORY.recognizer as u32,
    HANDHELD_CORRESPOND_BYTES as u32,
];

/// One round: the geometry of views, then see, nest and match corners, enroll, recognize.
#[inline(never)]
fn run(device: &mut Device) -> Result<Outcome, Failure> {
    let mut features = HandheldFeatures::new();
    if !views::check(device) || !position::check(device) {
        return Err(Failure::Views);
    }
    see(device, &mut features)?;
    if !nest::nest(features.view())? {
        return Err(Failure::Nesting);
    }
    if !pairs::check(features.view())? {
        return Err(Failure::Pairs);
    }
    enroll::enroll(features.view(), device.table())?;
    #[cfg(feature = "control")]
    assert!(features.view().len() < 300, "the control has a panic path");
    recognize::recognize(features.view(), device)
}

/// The frame's features. The levels and the extractor live during this call only.
#[inline(never)]
fn see(device: &mut Device, features: &mut HandheldFeatures) -> Result<(), Failure> {
    let mut levels = [0; MEMORY.levels];
    let mut extractor = const { HandheldExtractor::new() };
    let (pixels, [width, height, stride]) = device.frame();
    // A quarter of it in other memory first, as a device does that shows its frames: the way that the PC goes.
    let quarter = GrayView::new(pixels, width / 2, height / 2, stride)?;
    let quarter = TonedFrame::write(&Portable, quarter, &mut levels)?.view();
    let quarter_is_empty = quarter.row(0).is_empty();
    let frame = TonedFrame::in_place(pixels, width, height, stride)?;
    let counts = extractor.count_corners(&Portable, frame, HANDHELD_FRONT_END, &mut levels)?;
    if quarter_is_empty || counts.iter().sum::<usize>() == 0 {
        return Err(Failure::Blank);
    }
    Ok(extractor.extract(&Portable, frame, HANDHELD_FRONT_END, &mut levels, features)?)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(not(feature = "locate"))]
    {
        unsafe extern "C" {
            fn a_panic_path_is_left() -> !;
        }
        // SAFETY: nobody has this function: a program that can come here does not link.
        unsafe { a_panic_path_is_left() }
    }
    #[cfg(feature = "locate")]
    loop {
        core::hint::spin_loop();
    }
}
