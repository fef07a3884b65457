//! A matching as it is told: plain values, which serialized are the JSON of `daymark correspond`.

use std::collections::BTreeMap;

use daymark_core::geometry::agreement::{LEAST_BITS, NoAgreement};
use daymark_core::geometry::correspond::{Explanation, NoCorrespondence, Sources};
use serde::Serialize;

use super::Corners;
use super::fate::{Counts, Judge};
use super::matching::{Answer, FoundBy, Matching, Rule};

/// Version of the form of `--json`.
pub const SCHEMA_VERSION: u32 = 1;

/// The JSON document. Pixels are those of the files, from the centre of the top-left pixel; residuals are pixels of the
/// second file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Which program wrote it.
    pub program_version: &'static str,
    /// What was asked for.
    pub settings: SettingsFound,
    /// The first and the second picture.
    pub pictures: [PictureFound; 2],
    /// "map", "relief", "plain" or "none".
    pub answer: &'static str,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<Reason>,
    /// The map, where one explains all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<MapFound>,
    /// Median distance from the epipolar constraint where relief explains them, px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median_epipolar_distance_px: Option<f64>,
    /// Quads of layers that agree, by the plain rule.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agreeing_quads: Option<usize>,
    /// The correspondences, in the order of the first picture's corners.
    pub correspondences: Vec<CorrespondenceFound>,
    /// How many join corners of the same number, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checked: Option<Checked>,
    /// What became of the proposals of each source.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proposals: Option<ProposalsFound>,
    /// How many quads of the first picture's layers were matched, or not and why; names of [`super::fate::QuadFate`].
    pub layer_quads: BTreeMap<&'static str, usize>,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SettingsFound {
    /// "tolerant" or "plain".
    pub rule: &'static str,
    /// "layers", "arrangements" or "both"; the plain rule has layers only.
    pub source: &'static str,
    /// Noise of a corner's coordinate, px of the working frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_px: Option<f32>,
    /// The plain rule's tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PictureFound {
    /// Where its corners come from.
    pub file: String,
    /// Width of the working frame.
    pub width_px: u32,
    /// Height of the working frame.
    pub height_px: u32,
    /// Pixels of the file for one of the working frame.
    pub file_px_per_px: f64,
    /// Corners.
    pub corners: usize,
    /// The numbers of each layer's vertices, clockwise.
    pub layers: Vec<Vec<u32>>,
    /// The numbers of the corners within the innermost layer.
    pub remainder: Vec<u32>,
}

/// Why there are no correspondences.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reason {
    /// `nothing_proposed`, `chance`, `ambiguous` or `no_quad_agrees`.
    pub kind: &'static str,
    /// For people.
    pub message: String,
}

/// An affine or perspective map of the files' pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapFound {
    /// The homography's rows: `(x', y', 1) ~ H (x, y, 1)`, its last entry 1. The last row of an affine map is 0, 0, 1.
    pub second_from_first_px: [[f64; 3]; 3],
    /// Bits beyond chance.
    pub bits: f32,
    /// Bits of the best different map.
    pub rival_bits: f32,
    /// Noise at which it explains most, px of the working frame.
    pub noise_px: f32,
}

/// Two corners that are the same.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrespondenceFound {
    /// Number in the first file.
    pub first: u32,
    /// Number in the second file.
    pub second: u32,
    /// Where, in the first file.
    pub first_px: [f64; 2],
    /// Where, in the second file.
    pub second_px: [f64; 2],
    /// Its layers, 0 the outermost; null within the innermost.
    pub layers: [Option<u16>; 2],
    /// Vertices by which the second layer is shifted, where layers gave the pair.
    pub shift: Option<u16>,
    /// "layers", "arrangements", "both" or "map".
    pub found_by: &'static str,
    /// Distance from where the map expects it, or from the epipolar constraint.
    pub residual_px: Option<f64>,
}

/// How many correspondences join corners of the same number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Numbers that both files have.
    pub common: usize,
    /// Correspondences of the same number.
    pub right: usize,
    /// Of different numbers.
    pub wrong: usize,
}

/// What became of the proposals of each source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ProposalsFound {
    /// Nested hulls.
    pub layers: CountsFound,
    /// Local arrangements.
    pub arrangements: CountsFound,
}

/// [`Counts`] as JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "they are those of Counts")]
pub struct CountsFound {
    pub seen: usize,
    pub crowded_out: usize,
    pub accepted: usize,
    pub contradicts: usize,
    pub off: usize,
    pub undecided: usize,
    pub unverified: usize,
}

impl From<Counts> for CountsFound {
    fn from(counts: Counts) -> Self {
        let Counts { seen, crowded_out, accepted, contradicts, off, undecided, unverified } = counts;
        Self { seen, crowded_out, accepted, contradicts, off, undecided, unverified }
    }
}

impl Finding {
    /// Says what a matching of these pictures gave. `same_numbers`: the same number is the same corner in both.
    pub fn new(matching: &Matching, corners: [&Corners; 2], judge: &Judge<'_>, same_numbers: bool) -> Self {
        let correspondences = matching.pairs.iter().map(|matched| CorrespondenceFound {
            first: corners[0].number(matched.pair.first),
            second: corners[1].number(matched.pair.second),
            first_px: corners[0].in_file_px(matched.pair.first).map(thousandths),
            second_px: corners[1].in_file_px(matched.pair.second).map(thousandths),
            layers: matched.layers,
            shift: matched.shift,
            found_by: found_by(matched.found_by),
            residual_px: matched.residual_px.map(|px| thousandths(f64::from(px) * corners[1].file_from_working)),
        });
        let correspondences: Vec<_> = correspondences.collect();
        let mut layer_quads = BTreeMap::new();
        for quad in judge.quads() {
            *layer_quads.entry(quad.fate.name()).or_insert(0) += 1;
        }
        let mut finding = Self {
            schema_version: SCHEMA_VERSION,
            program_version: env!("CARGO_PKG_VERSION"),
            settings: settings(matching.rule),
            pictures: [0, 1].map(|side| picture(matching, corners, side)),
            answer: "none",
            reason: None,
            map: None,
            median_epipolar_distance_px: None,
            agreeing_quads: None,
            checked: same_numbers.then(|| check(corners, &correspondences)),
            correspondences,
            proposals: matches!(matching.rule, Rule::Tolerant { .. }).then(|| ProposalsFound {
                layers: judge.counts(&matching.from_layers).into(),
                arrangements: judge.counts(&matching.from_arrangements).into(),
            }),
            layer_quads,
        };
        match matching.answer {
            Answer::Explained(Explanation::Map(best)) => {
                finding.answer = "map";
                // x_working = (x_file + 1/2) / s - 1/2 and x_file = (x_working + 1/2) t - 1/2.
                let [s, t] = [corners[0].file_from_working, corners[1].file_from_working];
                let working_from_file = affine(1.0 / s, 0.5 / s - 0.5);
                let file_from_working = affine(t, 0.5 * t - 0.5);
                let map = best.second_from_first.0.map(|row| row.map(f64::from));
                let map = product(&file_from_working, &product(&map, &working_from_file));
                finding.map = Some(MapFound {
                    second_from_first_px: map.map(|row| row.map(|entry| entry / map[2][2])),
                    bits: best.bits,
                    rival_bits: best.rival_bits,
                    noise_px: best.sigma,
                });
            }
            Answer::Explained(Explanation::Relief { median, .. }) => {
                finding.answer = "relief";
                finding.median_epipolar_distance_px = Some(median * corners[1].file_from_working);
            }
            Answer::Plain { quads } => {
                finding.answer = "plain";
                finding.agreeing_quads = Some(quads);
            }
            Answer::Nothing(none) => finding.reason = Some(reason(none, &finding.pictures)),
            Answer::NothingPlain => {
                finding.reason = Some(Reason {
                    kind: "no_quad_agrees",
                    message: "no four vertices in a row of any layer have the area ratio of four others in the other \
                              picture's layer"
                        .to_owned(),
                });
            }
        }
        finding
    }
}

fn thousandths(px: f64) -> f64 {
    (px * 1_000.0).round_ties_even() / 1_000.0
}

fn settings(rule: Rule) -> SettingsFound {
    match rule {
        Rule::Tolerant { sources, noise_px } => {
            let source = match sources {
                Sources::Layers => "layers",
                Sources::Arrangements => "arrangements",
                Sources::Both => "both",
            };
            SettingsFound { rule: "tolerant", source, noise_px: Some(noise_px), epsilon: None }
        }
        Rule::Plain { epsilon } => SettingsFound {
            rule: "plain",
            source: "layers",
            noise_px: None,
            epsilon: Some(f64::from(epsilon.part) / f64::from(epsilon.whole)),
        },
    }
}

fn picture(matching: &Matching, corners: [&Corners; 2], side: usize) -> PictureFound {
    let (corners, nested) = (corners[side], &matching.nested[side]);
    let named = |vertices: &Vec<u16>| vertices.iter().map(|&vertex| corners.number(vertex)).collect();
    PictureFound {
        file: corners.name.clone(),
        width_px: corners.size_px[0],
        height_px: corners.size_px[1],
        file_px_per_px: corners.file_from_working,
        corners: corners.places.len(),
        layers: nested.layers.iter().map(named).collect(),
        remainder: named(&nested.remainder),
    }
}

fn check(corners: [&Corners; 2], correspondences: &[CorrespondenceFound]) -> Checked {
    let right = correspondences.iter().filter(|found| found.first == found.second).count();
    let common = corners[0].numbers.iter().filter(|number| corners[1].numbers.contains(number)).count();
    Checked { common, right, wrong: correspondences.len() - right }
}

/// `x' = scale x + offset` in both directions.
const fn affine(scale: f64, offset: f64) -> [[f64; 3]; 3] {
    [[scale, 0.0, offset], [0.0, scale, offset], [0.0, 0.0, 1.0]]
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) const fn found_by(source: FoundBy) -> &'static str {
    match source {
        FoundBy::Layers => "layers",
        FoundBy::Arrangements => "arrangements",
        FoundBy::Both => "both",
        FoundBy::Map => "map",
    }
}

fn reason(none: NoCorrespondence, pictures: &[PictureFound; 2]) -> Reason {
    let NoCorrespondence::Map(none) = none;
    match none {
        NoAgreement::NothingProposed => {
            let few = pictures.iter().map(|picture| picture.corners).min().unwrap_or(0);
            let message = if few < 5 {
                format!("{few} corners are too few: four have an affine invariant, and it takes more to verify")
            } else {
                "no quad and no arrangement of one picture is an affine image of one in the other; mirror images are not \
                 taken for the same"
                    .to_owned()
            };
            Reason { kind: "nothing_proposed", message }
        }
        NoAgreement::Chance { bits } => Reason {
            kind: "chance",
            message: format!(
                "the best map explains no more than chance would ({bits:+.1} bits, {LEAST_BITS} are needed): other places, \
                 too few common corners, or too far apart"
            ),
        },
        NoAgreement::Ambiguous { bits, rival_bits } => Reason {
            kind: "ambiguous",
            message: format!(
                "two different maps explain about as much ({bits:.1} and {rival_bits:.1} bits): a facade that repeats itself"
            ),
        },
    }
}
