//! Whether a frame shows another scene than the one before it: a cut, a turn, a hand over the lens.

use crate::picture::GrayImage;

const COLUMNS: usize = 16;
const ROWS: usize = 12;
/// A correlation below this, in 1/100, is another scene.
const SAME: i64 = 30;

/// The scene of the latest frame, as 16 x 12 means.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    means: Option<[i32; COLUMNS * ROWS]>,
}

impl Scene {
    /// Takes the next frame; true if it correlates with the one before by less than 0.3. Changes of light do not
    /// matter, and neither does the first frame.
    pub fn enter(&mut self, frame: &GrayImage) -> bool {
        let means = means(frame);
        let before = self.means.replace(means);
        before.is_some_and(|before| !alike(&before, &means))
    }

    /// Forgets the scene: the next frame is the first.
    pub fn forget(&mut self) {
        self.means = None;
    }
}

fn means(frame: &GrayImage) -> [i32; COLUMNS * ROWS] {
    let mut sums = [(0_u32, 0_u32); COLUMNS * ROWS];
    for (y, row) in frame.pixels.chunks_exact(frame.width.max(1)).enumerate().step_by(4) {
        let cells = y * ROWS / frame.height.max(1) * COLUMNS;
        for (x, gray) in row.iter().enumerate().step_by(4) {
            if let Some((sum, count)) = sums.get_mut(cells + x * COLUMNS / frame.width) {
                *sum += u32::from(*gray);
                *count += 1;
            }
        }
    }
    // In sixteenths of a gray level.
    sums.map(|(sum, count)| (sum * 16).checked_div(count).unwrap_or(0) as i32)
}

/// Correlation of at least 0.3, in integers. Two flat pictures are alike.
fn alike(a: &[i32], b: &[i32]) -> bool {
    let mean = |values: &[i32]| values.iter().sum::<i32>() / values.len().max(1) as i32;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |x: &[i32], mx: i32, y: &[i32], my: i32| {
        x.iter().zip(y).map(|(x, y)| i64::from(x - mx) * i64::from(y - my)).sum::<i64>()
    };
    let (ab, aa, bb) = (product(a, mean_a, b, mean_b), product(a, mean_a, a, mean_a), product(b, mean_b, b, mean_b));
    // Spread of less than 2 gray levels: nothing to compare.
    let flat = 32 * 32 * a.len() as i64;
    if aa < flat || bb < flat {
        return aa < flat && bb < flat;
    }
    // ab / sqrt(aa bb) >= 0.3, without the root.
    ab > 0 && (i128::from(ab) * i128::from(ab)) * 10_000 >= i128::from(SAME * SAME) * i128::from(aa) * i128::from(bb)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(level: impl Fn(usize, usize) -> usize) -> GrayImage {
        let pixels = (0..64 * 48).map(|at| level(at % 64, at / 64).min(255) as u8).collect();
        GrayImage { pixels, width: 64, height: 48 }
    }

    #[test]
    fn light_and_small_motion_are_the_same_scene_and_a_cut_is_not() {
        let stripes = |shift: usize| picture(move |x, y| 40 + (x + shift) / 16 % 2 * 100 + y);
        let mut scene = Scene::default();
        assert!(!scene.enter(&stripes(0)), "the first");
        assert!(!scene.enter(&stripes(3)), "a little aside");
        assert!(!scene.enter(&picture(|x, y| 20 + ((x + 3) / 16 % 2 * 100 + y) / 3)), "darker");
        assert!(scene.enter(&picture(|x, y| 40 + y / 12 % 2 * 100 + x)), "a cut");
        assert!(scene.enter(&picture(|_, _| 5)), "a covered lens");
        assert!(!scene.enter(&picture(|_, _| 9)), "still covered");
        scene.forget();
        assert!(!scene.enter(&stripes(0)));
    }
}
