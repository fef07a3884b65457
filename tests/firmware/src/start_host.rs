//! The start on a host: the C library calls `main`. It measures the stack and says how the round went.

use core::ffi::{c_char, c_int};
use core::hint::black_box;
use core::ptr;

use crate::STACK;
use crate::device::Device;

#[link(name = "c")]
unsafe extern "C" {
    fn printf(format: *const c_char, ...) -> c_int;
}

/// Bytes of stack that are watched.
const WATCHED: usize = 256 * 1_024;
/// What an untouched byte of the stack holds.
const PAINT: u8 = 0xA5;

/// 0 if the program recognizes what it enrolled.
#[unsafe(no_mangle)]
extern "C" fn main(_: c_int, _: *const *const c_char) -> c_int {
    // SAFETY: once.
    let mut device = unsafe { Device::take() };
    device.expose();
    let bottom = paint();
    let outcome = crate::run(&mut device);
    let stack = used(bottom);
    device.report(outcome);
    let Ok(outcome) = outcome else {
        // SAFETY: a string without arguments.
        unsafe { printf(c"the round failed\n".as_ptr()) };
        return 1;
    };
    // SAFETY: the format has two numbers and three integers.
    unsafe {
        printf(
            c"the round: known %d, both readers agree %d, corners in the frame %d, explained %d, stack %zu bytes\n"
                .as_ptr(),
            c_int::from(outcome.known),
            c_int::from(outcome.same),
            outcome.corners as c_int,
            outcome.explained as c_int,
            stack,
        );
    }
    let right = outcome.known && outcome.same && outcome.explained > 0 && outcome.name_bytes > 0;
    c_int::from(!(right && stack <= STACK))
}

/// Paints the stack below this call, and returns the address of its lowest painted byte.
#[inline(never)]
fn paint() -> usize {
    let here = 0_u8;
    let top = black_box((&raw const here).expose_provenance());
    // From above down, so that the system extends the stack as it goes; 256 bytes are left to this very call.
    for address in (top - WATCHED..top - 256).rev() {
        // SAFETY: below the stack pointer, in the thread's own stack of megabytes, where nothing lives.
        unsafe { ptr::write_volatile(ptr::with_exposed_provenance_mut(address), PAINT) };
    }
    top - WATCHED
}

/// Bytes from the deepest that was touched up to the caller.
#[inline(never)]
fn used(bottom: usize) -> usize {
    let mut untouched = 0;
    // SAFETY: painted bytes.
    while untouched < WATCHED
        && unsafe { ptr::read_volatile(ptr::with_exposed_provenance::<u8>(bottom + untouched)) } == PAINT
    {
        untouched += 1;
    }
    WATCHED - untouched
}
