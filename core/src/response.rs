//! The Harris response, row by row as the image arrives.
//!
//! Integer gradients and structure tensor. The three newest rows of pixels are looked at, five of the tensor and seven
//! of the response are kept, so the memory depends on the width of a strip, not on the image.

use crate::kernel::Kernels;

/// Rows of the tensor that one row of the response is smoothed from.
const TENSOR_ROWS: usize = 5;
/// Rows of the response that the suppression of non-maxima looks at: 3 above and 3 below.
pub(crate) const RESPONSE_ROWS: usize = 7;
/// Columns of the pixels beyond those of the response, and of the gradients.
const PIXEL_HALO: usize = 2 * REACH;
const GRADIENT_HALO: usize = 4;
/// Pixels that a response looks at in each direction: 1 for the gradient, 2 for the smoothing.
pub(crate) const REACH: usize = 3;

/// Rolling rows of tensor and response for a strip of at most `STRIP - 6` columns.
///
/// [`ResponseRows::BYTES`] of memory, whatever the height of the image.
// Rows begin with a line of the cache: a vector that lies across two of them takes twice as long.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct ResponseRows<const STRIP: usize> {
    gradients: [[i16; STRIP]; 2],
    tensor: [[[i32; STRIP]; 3]; TENSOR_ROWS],
    response: [[f32; STRIP]; RESPONSE_ROWS],
    /// Columns of the response in the present strip.
    columns: usize,
    /// Rows of the tensor since [`ResponseRows::start`].
    pushed: usize,
}

impl<const STRIP: usize> ResponseRows<STRIP> {
    /// Bytes that the rolling rows take.
    pub const BYTES: usize = size_of::<Self>();

    /// The widest strip of responses that fits.
    pub const MAX_COLUMNS: usize = STRIP - PIXEL_HALO;

    /// Rolling rows without an image yet.
    pub const fn new() -> Self {
        Self {
            gradients: [[0; STRIP]; 2],
            tensor: [[[0; STRIP]; 3]; TENSOR_ROWS],
            response: [[0.0; STRIP]; RESPONSE_ROWS],
            columns: 0,
            pushed: 0,
        }
    }

    /// Begins a strip whose response has `columns` columns, at most [`ResponseRows::MAX_COLUMNS`].
    pub fn start(&mut self, columns: usize) {
        self.columns = columns.min(Self::MAX_COLUMNS);
        self.pushed = 0;
    }

    /// Takes the next image row, given with its neighbours above and below: `columns + 6` pixels each, beginning
    /// three columns before the strip. Returns whether a row of the response became complete; it belongs to the image
    /// row two above the middle one.
    pub fn push<K: Kernels + ?Sized>(&mut self, kernels: &K, rows: [&[u8]; 3]) -> bool {
        let n = self.columns;
        if let Some(tensor) = self.tensor.get_mut(self.pushed % TENSOR_ROWS) {
            let gradients = self.gradients.each_mut().map(|part| part.get_mut(..n + GRADIENT_HALO).unwrap_or_default());
            kernels.gradient_row(rows, gradients);
            let gradients = self.gradients.each_ref().map(|part| part.get(..n + GRADIENT_HALO).unwrap_or(&[]));
            kernels.tensor_row(gradients, tensor.each_mut().map(|part| part.get_mut(..n).unwrap_or_default()));
        }
        self.pushed += 1;
        let Some(number) = self.complete().checked_sub(1) else { return false };
        // Oldest tensor row first.
        let mut five: [[&[i32]; 3]; TENSOR_ROWS] = [[&[]; 3]; TENSOR_ROWS];
        for (age, row) in five.iter_mut().enumerate() {
            if let Some(tensor) = self.tensor.get((number + age) % TENSOR_ROWS) {
                *row = tensor.each_ref().map(|part| part.get(..n).unwrap_or(&[]));
            }
        }
        if let Some(out) = self.response.get_mut(number % RESPONSE_ROWS).and_then(|row| row.get_mut(..n)) {
            kernels.response_row(five, out);
        }
        true
    }

    /// Rows of the response that are complete.
    pub const fn complete(&self) -> usize {
        self.pushed.saturating_sub(TENSOR_ROWS - 1)
    }

    /// The latest seven rows of the response, oldest first; `None` until seven are complete.
    pub(crate) fn neighbourhood(&self) -> Option<[&[f32]; RESPONSE_ROWS]> {
        let first = self.complete().checked_sub(RESPONSE_ROWS)?;
        let mut rows: [&[f32]; RESPONSE_ROWS] = [&[]; RESPONSE_ROWS];
        for (age, row) in rows.iter_mut().enumerate() {
            *row = self.response.get((first + age) % RESPONSE_ROWS)?.get(..self.columns)?;
        }
        Some(rows)
    }
}

impl<const STRIP: usize> Default for ResponseRows<STRIP> {
    fn default() -> Self {
        Self::new()
    }
}
