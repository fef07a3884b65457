//! Tests against bases: every comparison, the decisions, and what they are when the true base is not there.

use serde::Serialize;

use super::align::{Align, base_from_test};
use super::cloud::Cloud;
use super::decide::{Answer, Decision, Intensity, Rule, decide};
use super::error::{Comparison, compare};
use crate::parallel;

/// How tests and bases are compared and decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// How clouds come together.
    pub align: Align,
    /// Which intensity error decides among shapes that tie.
    pub intensity: Intensity,
    /// When an answer is given.
    pub rule: Rule,
    /// How far corresponding points may be apart for their intensities to be compared, as a share of the test's size.
    pub reach_share: f64,
}

impl Default for Method {
    fn default() -> Self {
        Self { align: Align::default(), intensity: Intensity::default(), rule: Rule::default(), reach_share: 0.015 }
    }
}

/// The diagonal of a cloud's extent.
pub fn size(cloud: &Cloud) -> f64 {
    let [low, high] = cloud.extent();
    let size = (high - low).norm();
    if size.is_finite() { size } else { 0.0 }
}

/// A test compared with every base.
pub fn compare_with_each(test: &Cloud, bases: &[Cloud], method: &Method) -> Vec<Comparison> {
    let reach = method.reach_share * size(test);
    parallel::map(bases, |base| compare(test, base, base_from_test(test, base, method.align, None), reach))
}

/// One test in numbers: a row of the thesis' Table 1 with its decision.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name of the test.
    pub test: String,
    /// Root mean square distance from the test's points to each base, in the unit of the model.
    pub one_sided_rms: Vec<f64>,
    /// The same of both directions together.
    pub symmetric_rms: Vec<f64>,
    /// Intensity error of each base, free of gain and bias; 1 where nothing corresponds.
    pub intensity_free: Vec<f64>,
    /// Plain mean squared intensity error of each base; null where nothing corresponds.
    pub intensity_plain: Vec<Option<f64>>,
    /// What the rule says.
    pub decision: Decision,
}

impl Row {
    /// From the comparisons with all bases.
    pub fn new(test: String, size: f64, comparisons: &[Comparison], method: &Method) -> Self {
        let all: Vec<&Comparison> = comparisons.iter().collect();
        Self {
            test,
            one_sided_rms: comparisons.iter().map(|c| libm::sqrt(c.shape.one_sided)).collect(),
            symmetric_rms: comparisons.iter().map(|c| libm::sqrt(c.shape.symmetric)).collect(),
            intensity_free: comparisons.iter().map(|c| c.intensity.map_or(1.0, |i| i.free)).collect(),
            intensity_plain: comparisons.iter().map(|c| c.intensity.map(|i| i.plain)).collect(),
            decision: decide(&all, size, &method.rule, method.intensity),
        }
    }
}

/// The decision with one base left out.
pub fn without(base: usize, size: f64, comparisons: &[Comparison], method: &Method) -> Answer {
    let rest: Vec<&Comparison> = comparisons
        .iter()
        .enumerate()
        .filter(|(number, _)| *number != base)
        .map(|(_, comparison)| comparison)
        .collect();
    decide(&rest, size, &method.rule, method.intensity).answer
}
