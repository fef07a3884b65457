//! Sorting of short lists: the sort of the standard library, compiled once for their places instead of once for each list
//! and order. Long lists that somebody waits for are sorted as they are.

use std::cmp::Ordering;

/// Sorts numbers, as [`f64::total_cmp`] orders them.
pub fn ascending(numbers: &mut [f64]) {
    numbers.sort_unstable_by(f64::total_cmp);
}

/// Sorts in the items' own order.
pub fn sort<T: Ord>(items: &mut [T]) {
    sort_by(items, T::cmp);
}

/// Sorts by keys; items with equal keys keep their order.
pub fn sort_by_key<T, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K) {
    sort_by(items, |a, b| key(a).cmp(&key(b)));
}

/// Sorts by a comparison; equal items keep their order.
pub fn sort_by<T>(items: &mut [T], compare: impl Fn(&T, &T) -> Ordering) {
    let mut sources = sorted_places(items.len(), &|a, b| compare(&items[a], &items[b]));
    // Each cycle of the permutation once: a place that has its item is its own source.
    for start in 0..items.len() {
        let mut place = start;
        loop {
            let source = std::mem::replace(&mut sources[place], place);
            if source == start || source == place {
                break;
            }
            items.swap(place, source);
            place = source;
        }
    }
}

fn sorted_places(count: usize, compare: &dyn Fn(usize, usize) -> Ordering) -> Vec<usize> {
    let mut places: Vec<usize> = (0..count).collect();
    places.sort_by(|&a, &b| compare(a, b));
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 0..20 by a linear congruence.
    fn numbers(count: usize, seed: u64) -> Vec<u64> {
        let next = |state: &u64| Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        std::iter::successors(Some(seed), next).map(|state| (state >> 40) % 20).take(count).collect()
    }

    #[test]
    fn as_the_standard_library_sorts() {
        for count in 0..200 {
            let mut items: Vec<(u64, usize)> = numbers(count, count as u64 + 1).into_iter().zip(0..).collect();
            let (mut expected, mut whole) = (items.clone(), items.clone());
            expected.sort_by_key(|item| item.0);
            sort_by_key(&mut items, |item| item.0);
            assert_eq!(items, expected);
            sort(&mut whole);
            assert_eq!(whole, expected);
        }
    }

    #[test]
    fn numbers_ascend() {
        let mut numbers = [0.5, -0.0, f64::INFINITY, 0.0, -3.0];
        ascending(&mut numbers);
        assert_eq!(numbers.map(f64::to_bits), [-3.0, -0.0, 0.0, 0.5, f64::INFINITY].map(f64::to_bits));
    }
}
