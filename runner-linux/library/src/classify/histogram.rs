//! How the distances of a test's points are distributed (the thesis, Fig. 23).

use std::fmt::Write as _;

use serde::Serialize;

/// Bins of a histogram; the last one also has what is beyond.
const BINS: usize = 12;

/// Counts of distances in bins of equal width.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Histogram {
    /// Width of a bin, in the unit of the model.
    pub bin: f64,
    /// Points in each bin; the last one has all beyond.
    pub counts: Vec<usize>,
    /// Median, 90th and 99th percentile of the distances.
    pub percentiles_50_90_99: [f64; 3],
}

impl Histogram {
    /// Of these distances: bins up to the 99th percentile.
    pub fn new(distances: &[f32]) -> Self {
        let mut sorted: Vec<f32> = distances.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let at = |share: f64| f64::from(sorted.get((sorted.len() as f64 * share) as usize).copied().unwrap_or(0.0));
        let percentiles = [at(0.5), at(0.9), at(0.99)];
        let bin = (percentiles[2] / (BINS - 1) as f64).max(f64::MIN_POSITIVE);
        let mut counts = vec![0; BINS];
        for &distance in distances {
            counts[((f64::from(distance) / bin) as usize).min(BINS - 1)] += 1;
        }
        Self { bin, counts, percentiles_50_90_99: percentiles }
    }

    /// One line a bin.
    pub fn to_text(&self) -> String {
        let most = self.counts.iter().copied().max().unwrap_or(1).max(1);
        let mut text = String::new();
        for (number, &count) in self.counts.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ =
                writeln!(text, "  {:>10.4} {:>8} {}", self.bin * number as f64, count, "#".repeat(count * 50 / most));
        }
        text
    }
}

/// A PLY file of points coloured by their distance: blue at 0, green at the median, red from the 99th percentile on.
pub fn coloured(positions: &[[f32; 3]], distances: &[f32]) -> Vec<u8> {
    let [middle, _, far] = Histogram::new(distances).percentiles_50_90_99;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment distance from the nearest base, 0 to {far}\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float distance\nend_header\n",
        positions.len()
    )
    .into_bytes();
    for (position, &distance) in positions.iter().zip(distances) {
        let d = f64::from(distance);
        let [red, green, blue] = if d <= middle {
            let share = if middle > 0.0 { d / middle } else { 0.0 };
            [0.0, share, 1.0 - share]
        } else {
            let share = if far > middle { ((d - middle) / (far - middle)).min(1.0) } else { 1.0 };
            [share, 1.0 - share, 0.0]
        };
        bytes.extend(position.iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend([red, green, blue].map(|share| (share * 255.0 + 0.5) as u8));
        bytes.extend(distance.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_points_are_counted() {
        let distances: Vec<f32> = (0..1_000).map(|i| i as f32 / 100.0).collect();
        let histogram = Histogram::new(&distances);
        assert_eq!(histogram.counts.iter().sum::<usize>(), 1_000);
        assert_eq!(histogram.percentiles_50_90_99, [5.0, 9.0, f64::from(9.9_f32)]);
        assert_eq!(histogram.counts.last(), Some(&10));
        let ply = coloured(&[[0.0; 3], [1.0; 3]], &[0.0, 5.0]);
        assert!(ply.ends_with(&5.0_f32.to_le_bytes()));
    }

    #[test]
    fn nothing_and_zeros_are_no_trouble() {
        assert_eq!(Histogram::new(&[]).counts.iter().sum::<usize>(), 0);
        assert_eq!(Histogram::new(&[0.0; 5]).counts[0], 5);
    }
}
