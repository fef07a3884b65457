//! The strict hull of points that are sorted already.

use super::key::{Key, Line};

/// Lists that are no longer than this are not thinned: a chain over them costs less.
const SHORT: usize = 8;
/// How often a list is thinned at most; what is left then is for the chain, so that the cost stays linear.
const THINNINGS: u32 = 6;

/// A hull as it lies in the caller's buffer: clockwise from the least key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Outline {
    /// Vertices; two if the points are on one line.
    pub(super) vertices: usize,
    /// The place of the greatest key: the upper chain ends there, and the lower one begins.
    pub(super) turn: usize,
}

/// Writes the strict vertices of sorted, distinct keys to `buffer`, which needs room for as many as there are keys.
///
/// The line from the first key to the last parts those above from those below. Of each part the farthest point is a
/// vertex (or lies on an edge), and what is not beyond the two lines to it is dropped, without a branch; so again on
/// both sides of it (quickhull). Monotone chains (Andrew 1979) through the few that are left find the strict vertices.
/// O(n) for n keys.
pub(super) fn strict_hull(keys: &[Key], buffer: &mut [Key]) -> Outline {
    let (&[first, ref between @ .., last], Some(buffer)) = (keys, buffer.get_mut(..keys.len())) else {
        if let ([only], [place, ..]) = (keys, buffer) {
            *place = *only;
        }
        return Outline { vertices: keys.len().min(1), turn: 0 };
    };
    // Those above follow each other from the front, those below from the back, so that both go clockwise. Each key is
    // written to both and counted in one; at least two places are free until the last.
    let line = Line::through(first, last);
    let (mut above, mut below) = (1, buffer.len());
    let (mut highest, mut lowest) = (Farthest::none(), Farthest::none());
    for &key in between {
        let side = line.side(key);
        highest.try_candidate(side, above);
        lowest.try_candidate(-side, below.wrapping_sub(1));
        if let Some(place) = buffer.get_mut(above) {
            *place = key;
        }
        above += usize::from(side < 0);
        if let Some(place) = buffer.get_mut(below.wrapping_sub(1)) {
            *place = key;
        }
        below -= usize::from(side > 0);
    }
    let kept_above = match buffer.get_mut(1..above) {
        Some(list) => thin(list, first, last, highest.place.wrapping_sub(1), THINNINGS),
        None => 0,
    };
    let kept_below = match buffer.get_mut(below..) {
        Some(list) => thin(list, last, first, lowest.place.wrapping_sub(below), THINNINGS),
        None => 0,
    };
    if let Some(place) = buffer.first_mut() {
        *place = first;
    }
    let top = (1..=kept_above).fold(0, |top, at| push(buffer, 0, top, at));
    let turn = push_key(buffer, 0, top, last);
    let top = (below..below + kept_below).fold(turn, |top, at| push(buffer, turn, top, at));
    // The first key closes the polygon; it is not repeated.
    Outline { vertices: push_key(buffer, turn, top, first), turn }
}

/// The point farthest to the left of a line, so far.
#[derive(Clone, Copy)]
struct Farthest {
    side: i64,
    place: usize,
}

impl Farthest {
    fn none() -> Self {
        Self { side: 0, place: 0 }
    }

    #[inline(always)]
    fn try_candidate(&mut self, side: i64, place: usize) {
        let farther = side < self.side;
        self.side = if farther { side } else { self.side };
        self.place = if farther { place } else { self.place };
    }
}

/// Moves to the front what may be a vertex of the chain from `a` to `b`, and returns how many those are. The keys are
/// in the order of the chain and lie to the left of the line `a b`; `farthest` is the place of the farthest.
fn thin(list: &mut [Key], a: Key, b: Key, farthest: usize, times: u32) -> usize {
    if list.len() <= SHORT || times == 0 {
        return list.len();
    }
    let Some((before, [top, after @ ..])) = list.split_at_mut_checked(farthest) else { return list.len() };
    let top = *top;
    let (kept, next) = keep_beyond(before, a, top);
    let first = before.get_mut(..kept).map_or(0, |list| thin(list, a, top, next, times - 1));
    let (kept, next) = keep_beyond(after, top, b);
    let second = after.get_mut(..kept).map_or(0, |list| thin(list, top, b, next, times - 1));
    if first < farthest {
        if let Some(place) = list.get_mut(first) {
            *place = top;
        }
        for at in 0..second {
            let Some(&key) = list.get(farthest + 1 + at) else { break };
            if let Some(place) = list.get_mut(first + 1 + at) {
                *place = key;
            }
        }
    }
    first + 1 + second
}

/// Moves the keys to the left of the line `a b` to the front; their number, and the place of the farthest.
fn keep_beyond(list: &mut [Key], a: Key, b: Key) -> (usize, usize) {
    let line = Line::through(a, b);
    let (mut kept, mut farthest) = (0, Farthest::none());
    for at in 0..list.len() {
        let Some(&key) = list.get(at) else { break };
        let side = line.side(key);
        farthest.try_candidate(side, kept);
        if let Some(place) = list.get_mut(kept) {
            *place = key;
        }
        kept += usize::from(side < 0);
    }
    (kept, farthest.place)
}

/// Continues the chain `bottom..=top` by the key that lies at `at`, beyond it; returns the new top.
#[inline(always)]
fn push(buffer: &mut [Key], bottom: usize, top: usize, at: usize) -> usize {
    match buffer.get(at) {
        Some(&key) => push_key(buffer, bottom, top, key),
        None => top,
    }
}

/// Continues the chain `bottom..=top` by a key; returns the new top.
#[inline(always)]
fn push_key(buffer: &mut [Key], bottom: usize, mut top: usize, key: Key) -> usize {
    while top > bottom
        && let Some(&[before, latest]) = buffer.get(top - 1..=top)
        && Line::through(before, latest).side(key) <= 0
    {
        top -= 1;
    }
    top += 1;
    if let Some(place) = buffer.get_mut(top) {
        *place = key;
    }
    top
}
