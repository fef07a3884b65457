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
        let bits = (usize::BITS - keys.len().leading_zeros()).clamp(1, DIGIT_BITS);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 900 keys of a generator, with these spans, in the order of their numbers.
    fn keys(width: u64, height: u64) -> [Key; 900] {
        let mut state = width ^ height << 24;
        let mut next = |span: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % (span + 1)
        };
        let mut keys = core::array::from_fn(|number| Key(Key::at(next(width), next(height)).0 | number as u64));
        keys[0] = Key::at(width, height);
        keys
    }

    #[test]
    fn sorted_whatever_the_span_and_the_number() {
        const WIDEST: u64 = (1 << 24) - 2;
        let mut scratch = [Key::NONE; 900];
        for width in [0, 1, 255, 256, 10_239, WIDEST] {
            for height in [0, 1, 7, 255, 256, 7_679, WIDEST] {
                for count in [0, 1, 2, 3, 15, 16, 17, 47, 64, 65, 200, 255, 256, 511, FEW, FEW + 1, 900] {
                    let mut sorted = keys(width, height);
                    let sorted = &mut sorted[..count];
                    let mut expected = keys(width, height);
                    let expected = &mut expected[..count];
                    expected.sort_unstable();
                    sort(sorted, &mut scratch, width, height);
                    assert_eq!(sorted, expected, "{width} x {height}");
                }
            }
        }
    }
}
