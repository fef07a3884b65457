//! Programs in turns over the same sets.

use std::hint::black_box;

use cpu_time::ThreadTime;

use crate::sets::Sets;

/// What a program found, to compare: layers, and vertices in all of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Found {
    pub layers: usize,
    pub vertices: usize,
}

impl std::ops::AddAssign for Found {
    fn add_assign(&mut self, other: Self) {
        self.layers += other.layers;
        self.vertices += other.vertices;
    }
}

/// Something that finds hulls.
pub trait Program {
    fn name(&self) -> String;
    /// Whether it must find the same as ours; a peer may differ where points are collinear.
    fn is_exact(&self) -> bool;
    /// Takes the sets over in its own representation; not timed.
    fn prepare(&mut self, sets: &[Vec<daymark_core::point::ImagePoint>]);
    /// Finds the hull or the layers of set `number`.
    fn run(&mut self, number: usize) -> Found;
}

/// Points timed as one sample, so that the clock costs nothing.
const BATCH: usize = 1_000;

/// Each program runs over each set once; the programs take turns every few sets, and another begins each time. The clock
/// is the thread's own, so other programs on the machine disturb little. Prints the medians of the samples and the ratios
/// to the first program; whether all agree.
pub fn compare(task: &str, sets: &Sets, programs: &mut [Box<dyn Program>]) -> bool {
    let count = programs.len();
    let mut samples = vec![Vec::new(); count];
    let mut found = vec![Found::default(); count];
    for program in &mut *programs {
        program.prepare(&sets.all);
    }
    let batch = (BATCH / sets.size).max(1);
    for (turn, first) in (0..sets.all.len() - batch + 1).step_by(batch).enumerate() {
        for place in 0..count {
            let which = (place + turn) % count;
            let start = ThreadTime::now();
            for number in first..first + batch {
                found[which] += black_box(programs[which].run(black_box(number)));
            }
            samples[which].push(start.elapsed().as_secs_f64() * 1e6 / batch as f64);
        }
    }
    let medians: Vec<f64> = samples
        .iter_mut()
        .map(|samples| {
            samples.sort_by(f64::total_cmp);
            samples[samples.len() / 2]
        })
        .collect();
    let mut agreed = true;
    for ((program, median), found_here) in programs.iter().zip(&medians).zip(&found) {
        let differs = if *found_here == found[0] { "" } else { "  finds something else" };
        agreed &= differs.is_empty() || !program.is_exact();
        println!(
            "{task:<10} {:<8} {:>6} {:>6}  {:<28} {median:>10.3} {:>7.2}{differs}",
            sets.source.name(),
            sets.size,
            sets.all.len(),
            program.name(),
            median / medians[0],
        );
    }
    agreed
}
