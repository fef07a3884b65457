//! Poses from 60 correspondences on a Cortex-M4F, with the instructions that each takes.
//!
//! QEMU with `-icount shift=0` lets one nanosecond pass with each instruction, so its timer counts them: SysTick runs at 25 MHz on
//! this board, one tick for 40 instructions.

#![no_std]
#![no_main]

use core::arch::asm;
use core::fmt::{self, Write};
use core::hint::black_box;
use core::ptr;

use daymark_core::camera::Intrinsics;
use daymark_core::camera::pose::{PointInView, PoseSettings, PoseSolver};

/// Correspondences.
const POINTS: usize = 60;
/// Views for each share of wrong correspondences.
const VIEWS: u32 = 10;
/// Instructions in a tick.
const PER_TICK: u64 = 40;

unsafe extern "C" {
    static stack_top: u8;
}

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
    const CPACR: *mut u32 = 0xE000_ED88 as *mut u32;
    const SYST_CSR: *mut u32 = 0xE000_E010 as *mut u32;
    const SYST_RVR: *mut u32 = 0xE000_E014 as *mut u32;
    const SYST_CVR: *mut u32 = 0xE000_E018 as *mut u32;
    // SAFETY: registers that every such core has: the floating-point unit on, the timer over its whole range.
    unsafe {
        ptr::write_volatile(CPACR, ptr::read_volatile(CPACR) | 0xF << 20);
        ptr::write_volatile(SYST_RVR, 0xFF_FFFF);
        ptr::write_volatile(SYST_CVR, 0);
        ptr::write_volatile(SYST_CSR, 0b101);
    }
    count();
    semihosting(0x18, 0x2_0026)
}

fn semihosting(operation: u32, argument: usize) -> ! {
    call(operation, argument);
    loop {}
}

fn call(operation: u32, argument: usize) {
    // SAFETY: QEMU handles this breakpoint.
    unsafe { asm!("bkpt 0xAB", inout("r0") operation => _, in("r1") argument) };
}

/// Text to QEMU.
struct Host;

impl Write for Host {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for part in text.as_bytes().chunks(63) {
            let mut buffer = [0_u8; 64];
            for (to, from) in buffer.iter_mut().zip(part) {
                *to = *from;
            }
            call(0x04, buffer.as_ptr() as usize);
        }
        Ok(())
    }
}

/// Ticks until the timer is at zero.
fn timer() -> u32 {
    const SYST_CVR: *const u32 = 0xE000_E018 as *const u32;
    // SAFETY: a register that every such core has.
    unsafe { ptr::read_volatile(SYST_CVR) }
}

/// Instructions of a call, to 40 of them.
fn instructions(work: impl FnOnce()) -> u64 {
    let before = timer();
    work();
    u64::from(before.wrapping_sub(timer()) & 0xFF_FFFF) * PER_TICK
}

/// Numbers between 0 and 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / 16_777_216.0
    }

    fn normal(&mut self) -> f64 {
        (0..12).fold(-6.0, |sum, _| sum + self.next())
    }
}

/// Corners of a tower of 12 x 12 x 30 m, of which two walls are seen from 40 m; some of them anywhere.
fn view(random: &mut Random, lens: &Intrinsics, wrong: usize) -> [PointInView; POINTS] {
    let (sine, cosine) = (0.6, 0.8);
    let mut points = [PointInView { model: [0.0; 3], image: [0.0; 2] }; POINTS];
    for (number, point) in points.iter_mut().enumerate() {
        let (along, up) = (12.0 * random.next() - 6.0, 30.0 * random.next());
        point.model = if number % 2 == 0 { [along, -6.0, up] } else { [6.0, along, up] };
        let [x, y, z] = point.model;
        let seen = lens.project([cosine * x + sine * y, 12.0 - z, 45.0 - sine * x + cosine * y]);
        point.image = seen.unwrap_or_default().map(|at| at + 0.5 * random.normal());
        if number < wrong {
            point.image = [640.0 * random.next(), 480.0 * random.next()];
        }
    }
    points
}

fn count() {
    let mut out = Host;
    let Ok(lens) = Intrinsics::centred(560.0, 640, 480) else { return };
    let settings = PoseSettings::of_frame(640, 480);
    let mut solver = PoseSolver::<64>::new();
    let _ = writeln!(out, "{POINTS} correspondences, 0.5 px noise, {VIEWS} views: instructions of a pose on a Cortex-M4F");
    let _ = writeln!(out, "wrong, %       least        mean        most  poses");
    for wrong in [0, 6, 12, 18] {
        let mut random = Random(11);
        let (mut least, mut sum, mut most, mut poses) = (u64::MAX, 0, 0, 0);
        for _ in 0..VIEWS {
            let points = view(&mut random, &lens, wrong);
            let mut good = false;
            let taken = instructions(|| good = solver.solve(black_box(&points), black_box(&lens), &settings).is_ok());
            poses += u32::from(good);
            least = least.min(taken);
            most = most.max(taken);
            sum += taken;
        }
        let mean = sum / u64::from(VIEWS);
        let share = 100 * wrong / POINTS;
        let _ = writeln!(out, "{share:>8} {least:>11} {mean:>11} {most:>11} {poses:>3}/{VIEWS}");
    }
    let empty = instructions(|| ());
    let loop_of_a_million = instructions(|| {
        // SAFETY: two instructions, five hundred thousand times; only the register changes.
        unsafe { asm!("2:", "subs {0}, #1", "bne 2b", inout(reg) 500_000_u32 => _) };
    });
    let _ = writeln!(out, "to compare: nothing {empty}, a loop of 1000000 instructions {loop_of_a_million}");
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    semihosting(0x18, 0x2_0023)
}
