//! Places in the frame: the corner that fits a search best, and which correspondences agree with a seed.

/// Corners of the frame that look like one stored corner, side by side.
pub const LANES: usize = 16;

/// A block of corners of the frame that look like one stored corner; what fills it up has no gain.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct LookAlikes {
    /// x in the frame, px.
    pub x: [f32; LANES],
    /// y in the frame, px.
    pub y: [f32; LANES],
    /// Gain in 1/64 bit.
    pub gain: [i32; LANES],
    /// The corner's level, as the bit of that number.
    pub level: [i32; LANES],
    /// The corner's number.
    pub number: [i32; LANES],
}

/// A place to search around, in the frame.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// The place, px.
    pub at: [f32; 2],
    /// Square of the radius, px².
    pub radius_squared: f32,
    /// The levels that fit, a bit each.
    pub levels: i32,
}

/// Weight of a corner at a squared distance of `squared` px² from where it is searched: gain times closeness,
/// `gain * round(1024 (1 - squared / (1.2 radius²)))`, and below it the corner's number, the lower the larger. At most
/// 768 * 1,024 * 2^11 < 2^31.
///
/// The larger key wins, whatever the order in which corners are looked at. `0` stands for none.
#[inline(always)]
pub fn search_key(search: Search, squared: f32, gain: i32, level: i32, number: i32) -> i32 {
    /// Adding 2^23 leaves the rounded integer in the low bits of an `f32`: a cast that vectorizes.
    const TO_INTEGER: f32 = 8_388_608.0;
    let closeness = 1_024.0 * (1.0 - squared / (1.2 * search.radius_squared));
    let closeness = ((closeness + TO_INTEGER).to_bits() & 0x7ff) as i32;
    let fits = (squared <= search.radius_squared) & (level & search.levels != 0) & (gain > 0);
    let key = gain.wrapping_mul(closeness) << NUMBER_BITS | (NUMBER_LIMIT - number);
    if fits { key } else { 0 }
}

/// Bits of a corner's number in a [`search_key`].
pub const NUMBER_BITS: u32 = 11;
/// Corners of a frame have numbers up to this.
pub const NUMBER_LIMIT: i32 = (1 << NUMBER_BITS) - 1;

/// The largest [`search_key`] of the corners.
#[inline(always)]
pub fn closest(blocks: &[LookAlikes], search: Search) -> i32 {
    let mut best = [0; LANES];
    let mut found = false;
    for block in blocks {
        let mut squared = [0.0; LANES];
        let mut near = false;
        for (lane, squared) in squared.iter_mut().enumerate() {
            let [dx, dy] = [block.x[lane] - search.at[0], block.y[lane] - search.at[1]];
            *squared = dx * dx + dy * dy;
            near |= *squared <= search.radius_squared;
        }
        // Few blocks have a corner within the radius; the division is for them.
        if !near {
            continue;
        }
        found = true;
        for (lane, best) in best.iter_mut().enumerate() {
            let (gain, level, number) = (block.gain[lane], block.level[lane], block.number[lane]);
            let key = search_key(search, squared[lane], gain, level, number);
            *best = if key > *best { key } else { *best };
        }
    }
    if found { best.into_iter().fold(0, |best, key| if key > best { key } else { best }) } else { 0 }
}

/// Candidate correspondences as columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct VoteColumns<'a> {
    /// x in the stored view, px.
    pub from_x: &'a [f32],
    /// y in the stored view, px.
    pub from_y: &'a [f32],
    /// x in the frame, px.
    pub to_x: &'a [f32],
    /// y in the frame, px.
    pub to_y: &'a [f32],
    /// Level in the frame minus level in the view.
    pub step: &'a [f32],
    /// Weight of the vote.
    pub gain: &'a [i32],
}

/// A map that one correspondence proposes: upright, scaled by its levels, through its two points.
#[derive(Debug, Clone, Copy)]
pub struct Seed {
    /// The point in the stored view, px.
    pub from: [f32; 2],
    /// The point in the frame, px.
    pub to: [f32; 2],
    /// Scale of the map.
    pub scale: f32,
    /// Level in the frame minus level in the view.
    pub step: f32,
}

/// Position error that a seed allows at its own place, in pixels.
pub const SLACK: f32 = 10.0;
/// Position error that a seed allows for each pixel of distance from its place: roll to about 12 degrees,
/// foreshortening and relief.
pub const SLACK_PER_PIXEL: f32 = 0.22;

/// Which correspondences agree with a seed, and the sum of their gains.
///
/// Agreement: error `r < SLACK + SLACK_PER_PIXEL e` with `e` the predicted distance from the seed, and a level step
/// that differs by at most one. The root is avoided: with `D = r² - SLACK² - SLACK_PER_PIXEL² e²` the condition is
/// `D < 0` or `D² < (2 SLACK SLACK_PER_PIXEL)² e²`.
#[inline(always)]
pub fn votes(seed: Seed, columns: VoteColumns<'_>, agrees: &mut [u8]) -> i32 {
    let VoteColumns { from_x, from_y, to_x, to_y, step, gain } = columns;
    let n = from_x.len();
    let (Some(from_y), Some(to_x), Some(to_y), Some(step), Some(gain), Some(agrees)) =
        (from_y.get(..n), to_x.get(..n), to_y.get(..n), step.get(..n), gain.get(..n), agrees.get_mut(..n))
    else {
        return 0;
    };
    let mut sum = 0;
    for i in 0..n {
        let (ex, ey) = ((from_x[i] - seed.from[0]) * seed.scale, (from_y[i] - seed.from[1]) * seed.scale);
        let (rx, ry) = (seed.to[0] + ex - to_x[i], seed.to[1] + ey - to_y[i]);
        let (e, r) = (ex * ex + ey * ey, rx * rx + ry * ry);
        let excess = r - (SLACK * SLACK) - (SLACK_PER_PIXEL * SLACK_PER_PIXEL) * e;
        let cross = 2.0 * SLACK * SLACK_PER_PIXEL;
        let near = (excess < 0.0) | (excess * excess < (cross * cross) * e);
        let turn = step[i] - seed.step;
        let agree = near & (turn.abs() <= 1.0);
        agrees[i] = u8::from(agree);
        sum += if agree { gain[i] } else { 0 };
    }
    sum
}
