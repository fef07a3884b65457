//! Sorts the keys of points.

use super::key::Key;

const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Sets of more points are sorted digit by digit.
const FEW: usize = 512;
/// The most keys that one digit may have for an insertion sort to follow.
const CROWD: u16 = 16;

/// Sorts keys, of which those at the same place already have ascending numbers and whose coordinates span `width` and
/// `height`. `scratch` needs room for as many.
///
/// A few keys, spread well: by the highest digit of x, then by insertion. Else by counting, from the lowest digit of y
/// to the highest of x: O(n) for n keys, and two passes for each eight bits that `width` and `height` have.
pub(super) fn sort(keys: &mut [Key], scratch: &mut [Key], width: u64, height: u64) {
    let Some(scratch) = scratch.get_mut(..keys.len()) else { return };
    let (x_bits, y_bits) = (u64::BITS - width.leading_zeros(), u64::BITS - height.leading_zeros());
    if keys.len() <= FEW {
        // About as many digits as keys.
        let bits = (usize::BITS - keys.len().leading_zeros()).min(DIGIT_BITS);
        let shift = Key::X_SHIFT + x_bits.saturating_sub(bits);
        let mut starts = count(keys, shift);
        let used = starts.get_mut(..=(width << Key::X_SHIFT >> shift) as usize % DIGITS).unwrap_or_default();
        if used.iter().all(|&crowd| crowd <= CROWD) {
            accumulate(used);
            distribute(keys, scratch, &mut starts, shift);
            insert(scratch, keys);
            return;
        }
    }
    let (mut from, mut to) = (keys, scratch);
    let mut moved = false;
    for (bottom, bits) in [(Key::Y_SHIFT, y_bits), (Key::X_SHIFT, x_bits)] {
        for shift in (bottom..bottom + bits).step_by(DIGIT_BITS as usize) {
            let mut starts = count(from, shift);
            accumulate(&mut starts);
            distribute(from, to, &mut starts, shift);
            (from, to) = (to, from);
            moved = !moved;
        }
    }
    if moved {
        // `from` holds the result, and is the scratch.
        for (key, sorted) in to.iter_mut().zip(from) {
            *key = *sorted;
        }
    }
}

fn digit(key: Key, shift: u32) -> usize {
    (key.0 >> shift) as usize % DIGITS
}

fn count(keys: &[Key], shift: u32) -> [u16; DIGITS] {
    let mut counts = [0; DIGITS];
    for &key in keys {
        counts[digit(key, shift)] += 1;
    }
    counts
}

/// Counts become the places where each digit starts.
fn accumulate(counts: &mut [u16]) {
    let mut start = 0;
    for count in counts {
        (*count, start) = (start, start + *count);
    }
}

fn distribute(from: &[Key], to: &mut [Key], starts: &mut [u16; DIGITS], shift: u32) {
    for &key in from {
        let start = &mut starts[digit(key, shift)];
        if let Some(place) = to.get_mut(usize::from(*start)) {
            *place = key;
        }
        *start += 1;
    }
}

/// Insertion sort: `from` is nearly sorted.
fn insert(from: &[Key], to: &mut [Key]) {
    for (end, &key) in from.iter().enumerate() {
        let mut at = end;
        while let Some(before) = at.checked_sub(1)
            && let Some(&[other, _]) = to.get(before..=at)
            && other > key
        {
            if let Some(place) = to.get_mut(at) {
                *place = other;
            }
            at = before;
        }
        if let Some(place) = to.get_mut(at) {
            *place = key;
        }
    }
}
