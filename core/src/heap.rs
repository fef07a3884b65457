//! The largest of many: a heap in an array, with the smallest that is kept on top.

/// Lets the last element rise to its place.
pub(crate) fn sift_up<T: Copy + Ord>(heap: &mut [T]) {
    let mut child = heap.len().saturating_sub(1);
    while child > 0 {
        let parent = (child - 1) / 2;
        if !swap_if(heap, parent, child, |parent, child| parent > child) {
            return;
        }
        child = parent;
    }
}

/// Restores the heap below its top within the first `end` elements.
pub(crate) fn sift_down<T: Copy + Ord>(heap: &mut [T], end: usize) {
    let mut parent = 0;
    loop {
        let (left, right) = (2 * parent + 1, 2 * parent + 2);
        let at = |i: usize| if i < end { heap.get(i).copied() } else { None };
        let child = match (at(left), at(right)) {
            (Some(l), Some(r)) if r < l => right,
            (Some(_), _) => left,
            (None, _) => return,
        };
        if !swap_if(heap, parent, child, |parent, child| parent > child) {
            return;
        }
        parent = child;
    }
}

/// Turns the heap into a list, largest first.
pub(crate) fn sort<T: Copy + Ord>(heap: &mut [T]) {
    for end in (1..heap.len()).rev() {
        swap_if(heap, 0, end, |_, _| true);
        sift_down(heap, end);
    }
}

fn swap_if<T: Copy>(heap: &mut [T], a: usize, b: usize, wanted: impl Fn(T, T) -> bool) -> bool {
    let (Some(&at_a), Some(&at_b)) = (heap.get(a), heap.get(b)) else { return false };
    if !wanted(at_a, at_b) {
        return false;
    }
    if let Some(slot) = heap.get_mut(a) {
        *slot = at_b;
    }
    if let Some(slot) = heap.get_mut(b) {
        *slot = at_a;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_smallest_on_top_and_sorts() {
        let mut state = 3_u32;
        for count in 0..40 {
            let mut heap = heapless::Vec::<u32, 40>::new();
            for _ in 0..count {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                heap.push(state >> 27).unwrap();
                sift_up(&mut heap);
                assert_eq!(heap.first(), heap.iter().min());
            }
            if let Some(top) = heap.first_mut() {
                *top = 17;
            }
            sift_down(&mut heap, count);
            assert_eq!(heap.first(), heap.iter().min());
            let mut sorted = heap.clone();
            sort(&mut sorted);
            heap.sort_unstable_by(|a, b| b.cmp(a));
            assert_eq!(sorted, heap);
        }
    }
}
