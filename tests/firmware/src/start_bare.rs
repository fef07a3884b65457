//! The start on a Cortex-M with a floating-point unit.

use core::ptr;

use crate::device::Device;

unsafe extern "C" {
    static stack_top: u8;
}

/// The first words of flash: where the stack begins, where the program does.
#[repr(C)]
struct Vectors {
    stack: *const u8,
    reset: unsafe extern "C" fn() -> !,
}

// SAFETY: it is never written.
unsafe impl Sync for Vectors {}

#[used]
#[unsafe(link_section = ".vectors")]
static VECTORS: Vectors = Vectors { stack: &raw const stack_top, reset };

/// The program begins here.
#[unsafe(no_mangle)]
unsafe extern "C" fn reset() -> ! {
    /// Coprocessor access control: full access to coprocessors 10 and 11, the floating-point unit.
    const CPACR: *mut u32 = 0xE000_ED88 as *mut u32;
    // SAFETY: a register that every core with such a unit has.
    unsafe { ptr::write_volatile(CPACR, ptr::read_volatile(CPACR) | 0xF << 20) };
    start()
}

#[inline(never)]
fn start() -> ! {
    // SAFETY: once.
    let mut device = unsafe { Device::take() };
    loop {
        device.expose();
        let outcome = crate::run(&mut device);
        device.report(outcome);
    }
}
