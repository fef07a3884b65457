//! Corners of one pyramid level: peaks of the response, spread evenly, refined to 1/16 px.
//!
//! A pixel is a peak if no response within 3 px (7 x 7) is larger; of equal ones the first in raster order wins. The
//! level is divided in 8 x 6 cells. Each cell keeps its strongest peaks, three times its share; the share is what a
//! cell may contribute before every cell had its turn, so that one tree does not take all corners. No absolute
//! threshold: dark frames work.

use crate::heap;
use crate::image::GrayView;
use crate::kernel::{Kernels, each_marked};
use crate::point::SUBPIXEL;
use crate::response::{REACH, RESPONSE_ROWS, ResponseRows};

/// Cells across a level.
const CELLS_X: usize = 8;
/// Cells down a level.
const CELLS_Y: usize = 6;
/// Cells of a level.
pub const CELLS: usize = CELLS_X * CELLS_Y;
/// Peaks that a cell keeps for each corner of its share.
pub const KEPT_PER_SHARE: usize = 3;
/// Distance of a corner from the border, in pixels: the suppression and the response must fit.
pub const BORDER: usize = PEAK_REACH + REACH;
/// The suppression looks this far, in pixels.
const PEAK_REACH: usize = RESPONSE_ROWS / 2;
/// A level smaller than this on either side has no corners.
pub const MIN_LEVEL_SIDE: usize = 24;

/// A corner in the frame of its level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LevelCorner {
    /// Column of the peak's pixel.
    pub column: u16,
    /// Row of the peak's pixel.
    pub row: u16,
    /// Right of the pixel's centre, in 1/16 px: −8..=7.
    pub dx: i8,
    /// Below the pixel's centre, in 1/16 px: −8..=7.
    pub dy: i8,
}

impl LevelCorner {
    /// Position in the level, in 1/16 px.
    pub fn subpixel(self) -> (i32, i32) {
        let at = |pixel: u16, offset: i8| i32::from(pixel) * SUBPIXEL + i32::from(offset);
        (at(self.column, self.dx), at(self.row, self.dy))
    }
}

/// A peak as one number: response, then (first in raster order is larger) row and column, then the refinement.
///
/// A positive `f32` orders like its bits, so the whole order of peaks is the order of `u64`, and no two are equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Peak(u64);

impl Peak {
    const NONE: Self = Self(0);

    fn new(response: f32, column: usize, row: usize, [dx, dy]: [u8; 2]) -> Self {
        let flipped = |p: usize| 0xfff - (p as u64 & 0xfff);
        let place = flipped(row) << 20 | flipped(column) << 8 | u64::from(dx & 15) << 4 | u64::from(dy & 15);
        Self(u64::from(response.to_bits()) << 32 | place)
    }

    const fn response_bits(self) -> u32 {
        (self.0 >> 32) as u32
    }

    fn corner(self) -> LevelCorner {
        let flipped = |shift: u32| 0xfff - (self.0 >> shift & 0xfff) as u16;
        let offset = |shift: u32| (self.0 >> shift & 15) as i8 - 8;
        LevelCorner { row: flipped(20), column: flipped(8), dx: offset(4), dy: offset(0) }
    }
}

/// Detects corners with a strip of responses of width `STRIP` and `SLOTS` kept peaks.
///
/// The result does not depend on `STRIP`; `SLOTS` must be at least [`slots`] of the largest share.
#[derive(Debug, Clone)]
pub struct CornerDetector<const STRIP: usize, const SLOTS: usize> {
    rows: ResponseRows<STRIP>,
    flags: [u8; STRIP],
    spread: Spread<SLOTS>,
}

/// Peaks kept for a share of `share` corners a cell.
pub const fn slots(share: usize) -> usize {
    CELLS * KEPT_PER_SHARE * share
}

impl<const STRIP: usize, const SLOTS: usize> CornerDetector<STRIP, SLOTS> {
    /// A detector without an image yet.
    pub const fn new() -> Self {
        const { assert!(ResponseRows::<STRIP>::MAX_COLUMNS > 2 * PEAK_REACH, "no column is left between the halos") };
        Self { rows: ResponseRows::new(), flags: [0; STRIP], spread: Spread::new() }
    }

    /// Calls `emit` with at most `count` corners of the level: at most `share` of each cell first, then the strongest
    /// of those that are left. They come cell by cell, the strongest first.
    pub fn detect<K: Kernels + ?Sized>(
        &mut self,
        kernels: &K,
        level: GrayView<'_>,
        count: usize,
        share: usize,
        emit: impl FnMut(LevelCorner),
    ) {
        let (width, height) = (level.width(), level.height());
        if width < MIN_LEVEL_SIDE || height < MIN_LEVEL_SIDE {
            return;
        }
        self.spread.start(width, height, share);
        let step = ResponseRows::<STRIP>::MAX_COLUMNS - 2 * PEAK_REACH;
        let mut first = BORDER;
        while first < width - BORDER {
            let end = (first + step).min(width - BORDER);
            self.sweep(kernels, level, first, end);
            first = end;
        }
        self.spread.select(count, share, emit);
    }

    /// Finds the peaks of the columns `first..end` in one pass down the level.
    fn sweep<K: Kernels + ?Sized>(&mut self, kernels: &K, level: GrayView<'_>, first: usize, end: usize) {
        let columns = end - first + 2 * PEAK_REACH;
        self.rows.start(columns);
        let pixels = |y: usize| level.row(y).get(first - BORDER..end + BORDER).unwrap_or(&[]);
        for latest in 2..level.height() {
            if !self.rows.push(kernels, [pixels(latest - 2), pixels(latest - 1), pixels(latest)]) {
                continue;
            }
            let Some(near) = self.rows.neighbourhood() else { continue };
            let row = latest - BORDER;
            // The outer columns belong to the neighbouring strips; the kernel leaves out one on either side.
            let outer = PEAK_REACH - 1;
            let [up, middle, down] =
                [near[2], near[3], near[4]].map(|row| row.get(outer..columns - outer).unwrap_or(&[]));
            let Some(flags) = self.flags.get_mut(..middle.len()) else { continue };
            let spread = &mut self.spread;
            spread.start_row(row);
            kernels.peak_flags([up, middle, down], spread.least(first, end), flags);
            each_marked(flags, |at| {
                let at = at + outer;
                let Some(&response) = near[3].get(at) else { return };
                let column = first + at - PEAK_REACH;
                let cell = spread.cell(column);
                if spread.rejects(cell, response) || !is_peak(&near, at, response) {
                    return;
                }
                spread.push(cell, Peak::new(response, column, row, refine(&near, at)));
            });
        }
    }
}

impl<const STRIP: usize, const SLOTS: usize> Default for CornerDetector<STRIP, SLOTS> {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether no response within 3 px is larger, of a place that is larger than its four neighbours; equal ones count if
/// they come earlier in raster order.
fn is_peak(near: &[&[f32]; RESPONSE_ROWS], at: usize, response: f32) -> bool {
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    // Seven columns are four and four, the middle one in both: side by side, and without a branch for each.
    let largest_of = |rows: &[&[f32]]| {
        let mut largest = [f32::MIN; 4];
        for row in rows {
            let Some(window) = row.get(at - PEAK_REACH..).and_then(|row| row.first_chunk::<WINDOW>()) else { continue };
            let &[a, b, c, d, e, f, g] = window;
            for (largest, (left, right)) in largest.iter_mut().zip([(a, d), (b, e), (c, f), (d, g)]) {
                *largest = larger(*largest, larger(left, right));
            }
        }
        largest.into_iter().fold(f32::MIN, larger)
    };
    let [above @ .., _, _, _, _] = near;
    let [_, _, _, middle, below @ ..] = near;
    let Some(&[a, b, _, _, _, f, g]) = middle.get(at - PEAK_REACH..).and_then(|row| row.first_chunk::<WINDOW>()) else {
        return false;
    };
    (a < response)
        & (b < response)
        & (f <= response)
        & (g <= response)
        & (largest_of(above) < response)
        & (largest_of(below) <= response)
}

/// Columns that the suppression looks at.
const WINDOW: usize = 2 * PEAK_REACH + 1;

/// The vertex of the parabola through three responses, along each axis, as `offset + 8` in 1/16 px.
///
/// With `l, m, r` the vertex lies at `(r - l) / (2 (2 m - l - r))`, within half a pixel because `m` is the largest. A
/// flat top has its vertex at the pixel's centre.
fn refine(near: &[&[f32]; RESPONSE_ROWS], at: usize) -> [u8; 2] {
    let get = |y: usize, x: usize| near.get(y).and_then(|row| row.get(x)).copied().unwrap_or(0.0);
    let vertex = |before: f32, middle: f32, after: f32| {
        let curvature = 2.0 * middle - before - after;
        if curvature <= 0.0 {
            return 8;
        }
        let offset = 8.0 * (after - before) / curvature;
        ((offset + 8.5) as u8).min(15)
    };
    let middle = get(PEAK_REACH, at);
    [
        vertex(get(PEAK_REACH, at.wrapping_sub(1)), middle, get(PEAK_REACH, at + 1)),
        vertex(get(PEAK_REACH - 1, at), middle, get(PEAK_REACH + 1, at)),
    ]
}

/// The strongest peaks of each cell, each a heap with the weakest on top until they are selected.
#[derive(Debug, Clone)]
struct Spread<const SLOTS: usize> {
    slots: [Peak; SLOTS],
    counts: [usize; CELLS],
    /// The response of the weakest kept peak of a full cell, as bits; nothing below it is looked at.
    floors: [u32; CELLS],
    per_cell: usize,
    /// `CELLS_X / width` and `CELLS_Y / height` in Q16.
    per_column: usize,
    per_row: usize,
    cell_row: usize,
}

impl<const SLOTS: usize> Spread<SLOTS> {
    const fn new() -> Self {
        Self {
            slots: [Peak::NONE; SLOTS],
            counts: [0; CELLS],
            floors: [0; CELLS],
            per_cell: 0,
            per_column: 0,
            per_row: 0,
            cell_row: 0,
        }
    }

    fn start(&mut self, width: usize, height: usize, share: usize) {
        self.counts = [0; CELLS];
        self.floors = [0; CELLS];
        self.per_cell = (KEPT_PER_SHARE * share).min(SLOTS / CELLS);
        self.per_column = (CELLS_X << 16) / width;
        self.per_row = (CELLS_Y << 16) / height;
    }

    fn start_row(&mut self, row: usize) {
        self.cell_row = ((row * self.per_row) >> 16).min(CELLS_Y - 1) * CELLS_X;
    }

    #[inline]
    fn cell(&self, column: usize) -> usize {
        self.cell_row + ((column * self.per_column) >> 16).min(CELLS_X - 1)
    }

    /// Peaks of less than this are certain to be dropped in the columns `first..end`; positive.
    fn least(&self, first: usize, end: usize) -> f32 {
        let cells = self.floors.get(self.cell(first)..=self.cell(end - 1)).unwrap_or(&[]);
        let floor = cells.iter().fold(u32::MAX, |least, &floor| least.min(floor));
        // The least positive number where a cell has room.
        f32::from_bits(floor.max(1))
    }

    /// Whether a peak of this response is certain to be dropped.
    #[inline]
    fn rejects(&self, cell: usize, response: f32) -> bool {
        self.floors.get(cell).is_some_and(|&floor| response.to_bits() < floor)
    }

    fn push(&mut self, cell: usize, peak: Peak) {
        let kept = self.per_cell;
        let (Some(slots), Some(count), Some(floor)) =
            (self.slots.get_mut(cell * kept..(cell + 1) * kept), self.counts.get_mut(cell), self.floors.get_mut(cell))
        else {
            return;
        };
        if let Some(slot) = slots.get_mut(*count) {
            *slot = peak;
            *count += 1;
            heap::sift_up(slots.get_mut(..*count).unwrap_or_default());
            if *count < kept {
                return;
            }
        } else if let Some(weakest) = slots.first_mut()
            && *weakest < peak
        {
            *weakest = peak;
            heap::sift_down(slots, kept);
        }
        *floor = slots.first().map_or(u32::MAX, |weakest| weakest.response_bits());
    }

    fn select(&mut self, count: usize, share: usize, mut emit: impl FnMut(LevelCorner)) {
        let kept = self.per_cell;
        if kept == 0 {
            return;
        }
        for (cell, &count) in self.slots.chunks_exact_mut(kept).zip(&self.counts) {
            heap::sort(cell.get_mut(..count).unwrap_or_default());
        }
        let cells = || self.slots.chunks_exact(kept).zip(&self.counts).map(|(cell, &n)| cell.get(..n).unwrap_or(&[]));
        let first = |cell: &'_ [Peak]| cell.len().min(share);
        let in_first: usize = cells().map(first).sum();
        // Of the first pass the strongest `count`; or all, and of the rest the strongest that fill up.
        let strongest_first = threshold(&cells().map(|cell| cell.get(..first(cell)).unwrap_or(&[])), count);
        let fill = count.saturating_sub(in_first);
        let strongest_rest = threshold(&cells().map(|cell| cell.get(first(cell)..).unwrap_or(&[])), fill);
        for cell in cells() {
            let split = first(cell);
            for (rank, &peak) in cell.iter().enumerate() {
                if peak >= (if rank < split { strongest_first } else { strongest_rest }) {
                    emit(peak.corner());
                }
            }
        }
    }
}

/// A bound that `count` peaks reach, by bisection; the lists are sorted, strongest first. With fewer peaks every one
/// reaches it; with `count = 0` none does.
fn threshold<'a>(lists: &(impl Iterator<Item = &'a [Peak]> + Clone), count: usize) -> Peak {
    if count == 0 {
        return Peak(u64::MAX);
    }
    if lists.clone().map(<[Peak]>::len).sum::<usize>() <= count {
        return Peak::NONE;
    }
    let strongest = lists.clone().filter_map(<[Peak]>::first).fold(Peak::NONE, |a, &b| a.max(b));
    let mut bound = 0;
    for bit in (0..u64::BITS - strongest.0.leading_zeros()).rev() {
        let higher = bound | 1 << bit;
        let reached: usize = lists.clone().map(|list| list.partition_point(|peak| peak.0 >= higher)).sum();
        if reached == count {
            return Peak(higher);
        }
        if reached > count {
            bound = higher;
        }
    }
    Peak(bound)
}
