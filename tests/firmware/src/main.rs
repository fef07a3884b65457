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
mod outcome;
mod recognize;
#[cfg_attr(target_os = "none", path = "start_bare.rs")]
#[cfg_attr(not(target_os = "none"), path = "start_host.rs")]
mod start;

use daymark_core::capacity::{HANDHELD_FRONT_END, HandheldExtractor, HandheldFeatures, HandheldMemory};
use daymark_core::image::GrayView;
use daymark_core::kernel::Portable;

use device::Device;
use outcome::{Failure, Outcome};

/// The memory of this device for a 320 x 240 frame, all told: 64 KB with the stack of the calls.
const MEMORY: HandheldMemory = HandheldMemory::of_frame(WIDTH, HEIGHT);
const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// What the stack of the calls may take of the 64 KB.
const CALLS: usize = 0;
const _: () = assert!(MEMORY.peak() + CALLS <= 64 * 1_024);

/// One round: see, enroll, recognize.
#[inline(never)]
fn run(device: &Device) -> Result<Outcome, Failure> {
    let mut features = HandheldFeatures::new();
    see(device, &mut features)?;
    enroll::enroll(features.view(), device.table())?;
    recognize::recognize(features.view(), device)
}

/// The frame's features. The levels and the extractor live during this call only.
#[inline(never)]
fn see(device: &Device, features: &mut HandheldFeatures) -> Result<(), Failure> {
    let mut levels = [0; MEMORY.levels];
    let mut extractor = const { HandheldExtractor::new() };
    let (pixels, [width, height, stride]) = device.frame();
    let frame = GrayView::new(pixels, width, height, stride)?;
    extractor.count_corners(&Portable, frame, HANDHELD_FRONT_END, &mut levels)?;
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
