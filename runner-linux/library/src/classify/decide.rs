//! The rule: shape first, then intensity among those that shape cannot tell apart, then whether it is good enough.

use serde::Serialize;

use super::error::Comparison;

/// Which intensity error decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Intensity {
    /// Free of gain and bias.
    #[default]
    Free,
    /// The plain mean squared difference (7.2).
    Plain,
}

/// When an answer is given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rule {
    /// Bases whose root mean square shape error is at most this many times the least are ambiguous.
    pub ambiguity_ratio: f64,
    /// Largest root mean square shape error of an answer, as a share of the test's size (the diagonal of its extent).
    pub max_shape_share: f64,
    /// Largest intensity error, free of gain and bias, of an answer.
    pub max_intensity: f64,
}

impl Default for Rule {
    fn default() -> Self {
        Self { ambiguity_ratio: 2.5, max_shape_share: 0.02, max_intensity: 0.75 }
    }
}

/// What the rule says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// This base.
    Known {
        /// Its number among the bases.
        base: usize,
        /// Whether intensity had to decide.
        by_appearance: bool,
    },
    /// None of the bases.
    Unknown(Refusal),
}

/// Why no base is it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// There are no bases.
    NoBases,
    /// The best shape is too far off.
    Shape,
    /// The shape fits, the intensities do not.
    Appearance,
    /// Nothing to tell the last ones apart.
    Tie,
}

/// The answer with what led to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Decision {
    /// The answer.
    pub answer: Answer,
    /// The base that is nearest after both stages, whether or not it is good enough.
    pub nearest: Option<usize>,
    /// Bases that shape alone does not tell apart, ascending.
    pub ambiguous: Vec<usize>,
    /// How much worse the next base is than the nearest: the least of the ratios of root mean square shape errors (to
    /// bases outside the ambiguity set) and of intensity errors (inside). Infinite for a single base.
    pub margin: f64,
    /// Root mean square shape error of the nearest base, as a share of the test's size.
    pub shape_share: f64,
    /// Its intensity error; 1 if it could not be measured.
    pub intensity: f64,
}

/// Applies the rule to a test of this size (diagonal of its extent) compared with each base.
pub fn decide(comparisons: &[&Comparison], size: f64, rule: &Rule, intensity: Intensity) -> Decision {
    let shape = |base: usize| libm::sqrt(comparisons[base].shape.one_sided);
    let look = |base: usize| {
        let error = comparisons[base].intensity;
        error.map_or(1.0, |error| if intensity == Intensity::Free { error.free } else { error.plain })
    };
    let bases = 0..comparisons.len();
    let Some(first) = bases.clone().min_by(|&a, &b| shape(a).total_cmp(&shape(b))) else {
        let answer = Answer::Unknown(Refusal::NoBases);
        let (margin, shape_share, intensity) = (f64::INFINITY, f64::INFINITY, 1.0);
        return Decision { answer, nearest: None, ambiguous: Vec::new(), margin, shape_share, intensity };
    };
    let ambiguous: Vec<usize> =
        bases.clone().filter(|&base| shape(base) <= shape(first) * rule.ambiguity_ratio).collect();
    let nearest = ambiguous.iter().copied().min_by(|&a, &b| look(a).total_cmp(&look(b))).unwrap_or(first);
    let outside = bases.filter(|base| !ambiguous.contains(base)).map(|base| shape(base) / shape(nearest));
    let inside = ambiguous.iter().filter(|&&base| base != nearest).map(|&base| look(base) / look(nearest));
    let margin = outside.chain(inside.clone()).fold(f64::INFINITY, f64::min);
    let shape_share = shape(nearest) / size;
    let free = comparisons[nearest].intensity.map_or(1.0, |error| error.free);
    let answer = if !(shape_share <= rule.max_shape_share) {
        Answer::Unknown(Refusal::Shape)
    } else if !(free <= rule.max_intensity) {
        Answer::Unknown(Refusal::Appearance)
    } else if inside.into_iter().any(|ratio| !(ratio > 1.0)) {
        Answer::Unknown(Refusal::Tie)
    } else {
        Answer::Known { base: nearest, by_appearance: ambiguous.len() > 1 }
    };
    Decision { answer, nearest: Some(nearest), ambiguous, margin, shape_share, intensity: free }
}
