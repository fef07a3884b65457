//! Heap sort for core: no panic path, no memory, and the order is the caller's.

/// Sorts by `less`, which must be a strict total order for a written result. `O(n log n)`, in place, not stable.
pub(super) fn sort_by<T: Copy>(list: &mut [T], less: impl Fn(&T, &T) -> bool + Copy) {
    for at in (0..list.len() / 2).rev() {
        sink(list, at, less);
    }
    let mut heap = list;
    while let Some((last, rest)) = heap.split_last_mut() {
        let Some(top) = rest.first_mut() else { return };
        core::mem::swap(top, last);
        sink(rest, 0, less);
        heap = rest;
    }
}

fn sink<T: Copy>(heap: &mut [T], mut at: usize, less: impl Fn(&T, &T) -> bool) {
    let Some(&sinking) = heap.get(at) else { return };
    loop {
        let mut child = 2 * at + 1;
        let Some(left) = heap.get(child) else { break };
        if heap.get(child + 1).is_some_and(|right| less(left, right)) {
            child += 1;
        }
        let Some(&larger) = heap.get(child) else { break };
        if !less(&sinking, &larger) {
            break;
        }
        if let Some(place) = heap.get_mut(at) {
            *place = larger;
        }
        at = child;
    }
    if let Some(place) = heap.get_mut(at) {
        *place = sinking;
    }
}

#[cfg(test)]
mod tests {
    use super::sort_by;

    #[test]
    fn sorts_like_the_library() {
        let mut state = 1_u32;
        for length in 0..70 {
            let mut list = [0_u32; 70];
            for value in &mut list {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value = state >> 27;
            }
            let mut expected = list;
            expected[..length].sort_unstable();
            sort_by(&mut list[..length], |a, b| a < b);
            assert_eq!(list, expected);
        }
    }
}
