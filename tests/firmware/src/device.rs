//! The device's memory: a frame that a camera wrote, flash pages with a table, and a place for the outcome.

use core::cell::UnsafeCell;
use core::convert::Infallible;
use core::hint::black_box;
use core::mem::MaybeUninit;
use core::ptr;
use core::slice;

use daymark_core::verdict::Recognition;
use embedded_io::{ErrorType, Read, Seek, SeekFrom};

use crate::outcome::{Failure, Outcome};
use crate::{HEIGHT, WIDTH};

/// Bytes that the hardware writes, or the program at another time.
#[repr(C, align(8))]
struct Region<const BYTES: usize>(UnsafeCell<[u8; BYTES]>);

// SAFETY: there is one thread, and `Device` is taken once.
unsafe impl<const BYTES: usize> Sync for Region<BYTES> {}

const TABLE_BYTES: usize = 4_096;

#[cfg_attr(target_os = "none", unsafe(link_section = ".camera"))]
static CAMERA: Region<{ WIDTH * HEIGHT }> = Region(UnsafeCell::new([0; WIDTH * HEIGHT]));
#[cfg_attr(target_os = "none", unsafe(link_section = ".table"))]
static TABLE: Region<TABLE_BYTES> = Region(UnsafeCell::new([0; TABLE_BYTES]));

/// What the linker knows and the compiler does not: where each region is, how long, and the shape of the frame.
#[repr(C)]
struct Layout {
    camera: *const Region<{ WIDTH * HEIGHT }>,
    camera_bytes: usize,
    table: *const Region<TABLE_BYTES>,
    table_bytes: usize,
    frame: [usize; 3],
}

// SAFETY: it is never written.
unsafe impl Sync for Layout {}

static LAYOUT: Layout = Layout {
    camera: &raw const CAMERA,
    camera_bytes: WIDTH * HEIGHT,
    table: &raw const TABLE,
    table_bytes: TABLE_BYTES,
    frame: [WIDTH, HEIGHT, WIDTH],
};

/// Where the outside looks for the answers and the outcome.
#[repr(C)]
struct Display {
    answers: UnsafeCell<MaybeUninit<[Option<Recognition>; 2]>>,
    outcome: UnsafeCell<MaybeUninit<Result<Outcome, Failure>>>,
}

// SAFETY: as for `Region`.
unsafe impl Sync for Display {}

static DISPLAY: Display =
    Display { answers: UnsafeCell::new(MaybeUninit::uninit()), outcome: UnsafeCell::new(MaybeUninit::uninit()) };

/// The only access to the regions.
pub struct Device {
    display: &'static Display,
}

impl Device {
    /// # Safety
    /// Once in the program.
    pub unsafe fn take() -> Self {
        // SAFETY: nobody else holds the display.
        unsafe { (*DISPLAY.answers.get()).write([None; 2]) };
        Self { display: black_box(&DISPLAY) }
    }

    /// What the camera wrote, and width, height and stride as a setting says.
    pub fn frame(&mut self) -> (&mut [u8], [usize; 3]) {
        // SAFETY: volatile reads of a static; the region lives as long as the program, and the device lends it once at
        // a time.
        unsafe {
            let layout = &raw const LAYOUT;
            let pixels = ptr::read_volatile(&raw const (*layout).camera).cast::<u8>().cast_mut();
            let bytes = ptr::read_volatile(&raw const (*layout).camera_bytes);
            (slice::from_raw_parts_mut(pixels, bytes), ptr::read_volatile(&raw const (*layout).frame))
        }
    }

    /// The flash pages of the table.
    pub fn table(&self) -> Flash {
        // SAFETY: volatile reads of a static.
        unsafe {
            let layout = &raw const LAYOUT;
            let bytes = ptr::read_volatile(&raw const (*layout).table).cast::<u8>().cast_mut();
            Flash { bytes, length: ptr::read_volatile(&raw const (*layout).table_bytes) }
        }
    }

    /// The camera takes a picture: blocks of 8 x 8 px, each of a gray value by chance.
    pub fn expose(&mut self) {
        let pixels = (&raw const CAMERA).cast::<u8>().cast_mut();
        let mut state = 1_u32;
        let mut row_of_blocks = [0_u8; WIDTH.div_ceil(8)];
        let mut at = 0_usize;
        for y in 0..HEIGHT {
            for (x, gray) in row_of_blocks.iter_mut().enumerate() {
                if y % 8 == 0 {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    *gray = (state >> 24) as u8;
                }
                for _ in 8 * x..(8 * x + 8).min(WIDTH) {
                    // SAFETY: `at` counts the region's bytes.
                    unsafe { ptr::write_volatile(pixels.add(at), *gray) };
                    at += 1;
                }
            }
        }
    }

    /// Where the answer of one of the two readers is shown.
    pub fn answer(&mut self, number: usize) -> &mut Option<Recognition> {
        // SAFETY: written in `take`; the device lends it once at a time.
        let [in_place, streamed] = unsafe { (*self.display.answers.get()).assume_init_mut() };
        if number == 0 { in_place } else { streamed }
    }

    /// Whether both answers are there and the same.
    pub fn answers_agree(&self) -> bool {
        // SAFETY: written in `take`; nobody writes them now.
        let [in_place, streamed] = unsafe { (*self.display.answers.get()).assume_init_ref() };
        in_place.is_some() && in_place == streamed
    }

    /// Shows the outcome.
    pub fn report(&mut self, outcome: Result<Outcome, Failure>) {
        // SAFETY: nobody else holds the display.
        unsafe { ptr::write_volatile(self.display.outcome.get(), MaybeUninit::new(outcome)) };
    }
}

/// Flash pages: read in place, read as a stream, and written byte by byte.
#[derive(Clone, Copy)]
pub struct Flash {
    bytes: *mut u8,
    length: usize,
}

impl Flash {
    /// The first `length` bytes in place, or as many as there are.
    ///
    /// # Safety
    /// Not written while they are lent.
    pub unsafe fn in_place<'a>(self, length: usize) -> &'a [u8] {
        // SAFETY: within the region; the caller does not write.
        unsafe { slice::from_raw_parts(self.bytes, length.min(self.length)) }
    }

    /// Writes bytes from byte `at` on.
    pub fn write(self, at: usize, bytes: &[u8]) -> Result<usize, Failure> {
        let end = at.checked_add(bytes.len()).filter(|&end| end <= self.length).ok_or(Failure::Full)?;
        for (place, &byte) in (at..end).zip(bytes) {
            // SAFETY: `place` is within the region.
            unsafe { ptr::write_volatile(self.bytes.add(place), byte) };
        }
        Ok(end)
    }

    /// As a stream of the first `length` bytes.
    pub fn stream(self, length: usize) -> FlashStream {
        FlashStream { flash: self, length: length.min(self.length), at: 0 }
    }
}

/// Flash behind a serial bus, a few bytes at a time.
pub struct FlashStream {
    flash: Flash,
    length: usize,
    at: usize,
}

impl ErrorType for FlashStream {
    type Error = Infallible;
}

impl Read for FlashStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        for byte in buffer.iter_mut().take(64) {
            if self.at >= self.length {
                break;
            }
            // SAFETY: `at` is within the region.
            *byte = unsafe { ptr::read_volatile(self.flash.bytes.add(self.at)) };
            self.at += 1;
            count += 1;
        }
        Ok(count)
    }
}

impl Seek for FlashStream {
    fn seek(&mut self, to: SeekFrom) -> Result<u64, Infallible> {
        let from = |start: usize, offset: i64| (start as u64).saturating_add_signed(offset);
        let at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::End(offset) => from(self.length, offset),
            SeekFrom::Current(offset) => from(self.at, offset),
        };
        self.at = usize::try_from(at).unwrap_or(usize::MAX);
        Ok(at)
    }
}
