//! Why: what each stored corner of a view said about a frame.

use daymark_core::evidence::CornerEvidence;
use daymark_core::table::{LandmarkTable, TableError};
use daymark_core::transform::Homography;
use daymark_core::verdict::Answer;
use serde::Serialize;

use super::finding::bits;
use crate::engine::Engine;
use crate::order;

/// A corner with this much evidence is strong.
pub const STRONG_BITS: f64 = 4.0;
/// A corner with this much evidence is fair; with less it is weak.
pub const FAIR_BITS: f64 = 1.5;

/// What a stored corner said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Said {
    /// It was found, and hardly anything else in the frame looks like it.
    Strong,
    /// It was found, and looks about as it should.
    Fair,
    /// It was found, with little to tell it from others.
    Weak,
    /// Its place is in the frame, and it says nothing either way.
    Silent,
    /// Another corner is at its place.
    Unlike,
    /// Nothing is at its place, or what is there supports another stored corner.
    Missing,
}

impl Said {
    /// All of them, the best first.
    pub const ALL: [Self; 6] = [Self::Strong, Self::Fair, Self::Weak, Self::Silent, Self::Unlike, Self::Missing];

    /// How it is called in a report.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Strong => "strong",
            Self::Fair => "fair",
            Self::Weak => "weak",
            Self::Silent => "silent",
            Self::Unlike => "unlike",
            Self::Missing => "missing",
        }
    }

    fn of(corner: &CornerEvidence) -> Self {
        match (corner.query, bits(corner.evidence)) {
            (Some(_), bits) if bits >= STRONG_BITS => Self::Strong,
            (Some(_), bits) if bits >= FAIR_BITS => Self::Fair,
            (_, bits) if bits > 0.0 => Self::Weak,
            (_, 0.0) => Self::Silent,
            (Some(_), _) => Self::Unlike,
            (None, _) => Self::Missing,
        }
    }
}

/// A stored corner and what it said.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExplainedCorner {
    /// Its number in the view.
    pub corner: u16,
    /// Its pyramid level.
    pub level: u8,
    /// What it said.
    pub said: Said,
    /// Its evidence; negative if it speaks against the view.
    pub evidence_bits: f64,
    /// Where it is in the stored view.
    pub in_view_px: [f32; 2],
    /// Where the map puts it in the frame.
    pub expected_px: [f32; 2],
    /// Where the frame's corner is.
    pub found_px: Option<[f32; 2]>,
    /// From where it is expected to where it was found.
    pub residual_px: Option<f32>,
    /// Tests of the signature that came out differently.
    pub signature_distance_bits: Option<u32>,
}

/// The map of the stored view to the frame, as one sees it at the middle of the view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SeenMap {
    /// Size in the frame over size in the view.
    pub scale: f32,
    /// How far the view's vertical is turned, positive clockwise.
    pub lean_deg: f32,
    /// Longest over shortest scale: 1 seen from the same side.
    pub stretch: f32,
}

/// The corners that said the same, together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Group {
    /// What they said.
    pub said: Said,
    /// How many.
    pub corners: usize,
    /// Their evidence.
    pub evidence_bits: f64,
    /// The median of their residuals.
    pub median_residual_px: Option<f32>,
}

/// What one view said about a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewExplanation {
    /// The landmark.
    pub landmark: String,
    /// The number of the view in the table.
    pub view: u32,
    /// Columns of the stored view.
    pub view_width_px: u16,
    /// Rows of the stored view.
    pub view_height_px: u16,
    /// Evidence as it counts: the corners', limited for each region of the view, with how plausible the map is.
    pub evidence_bits: f64,
    /// The plain sum of the corners' evidence.
    pub corners_sum_bits: f64,
    /// How the view appears in the frame.
    pub map: SeenMap,
    /// The same, row by row, pixels to pixels.
    pub frame_from_view_px: [[f32; 3]; 3],
    /// The corners by what they said.
    pub groups: Vec<Group>,
    /// Every corner that had something to say, the strongest first.
    pub corners: Vec<ExplainedCorner>,
}

/// Why the answer is what it is, and why the runner-up is not it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explained {
    /// What the best view said.
    pub best: Option<ViewExplanation>,
    /// What the best view of the runner-up said.
    pub runner_up: Option<ViewExplanation>,
    /// The difference in one sentence.
    pub why_the_runner_up_lost: Option<String>,
}

impl Explained {
    /// Asks the best and the runner-up's view again about the engine's latest frame.
    ///
    /// # Errors
    /// A record that cannot be read; not after the table was verified.
    pub fn new(
        engine: &mut Engine,
        table: &LandmarkTable<'_>,
        best: Option<&Answer>,
        runner_up: Option<&Answer>,
    ) -> Result<Self, TableError> {
        let mut explain = |answer: Option<&Answer>| match answer {
            Some(answer) => ViewExplanation::new(engine, table, answer),
            None => Ok(None),
        };
        let (best, runner_up) = (explain(best)?, explain(runner_up)?);
        let why = best.as_ref().zip(runner_up.as_ref()).map(|(best, runner_up)| why_lost(best, runner_up));
        Ok(Self { best, runner_up, why_the_runner_up_lost: why })
    }
}

impl ViewExplanation {
    /// Asks one view again about the engine's latest frame; `None` if it does not fit after all.
    ///
    /// # Errors
    /// A record that cannot be read; not after the table was verified.
    pub fn new(engine: &mut Engine, table: &LandmarkTable<'_>, answer: &Answer) -> Result<Option<Self>, TableError> {
        let view = table.view(answer.view)?;
        let landmark = table.landmark(answer.landmark)?.name.to_owned();
        let Some((matched, said)) = engine.explain(&view) else { return Ok(None) };
        let said = said.to_vec();
        let frame = engine.features();
        let map = matched.frame_from_view;
        let explained = |said: &CornerEvidence| {
            let stored = view.get(usize::from(said.stored))?;
            let in_view = stored.position.to_pixels();
            let expected = map.apply(in_view);
            let found = said.query.map(usize::from);
            let found_px = found.and_then(|query| frame.positions.get(query)).map(|position| position.to_pixels());
            let other = found.and_then(|query| frame.signatures.get(query));
            Some(ExplainedCorner {
                corner: said.stored,
                level: stored.level,
                said: Said::of(said),
                evidence_bits: bits(said.evidence),
                in_view_px: in_view,
                expected_px: expected,
                found_px,
                residual_px: found_px.map(|[x, y]| libm::hypotf(x - expected[0], y - expected[1])),
                signature_distance_bits: other.map(|other| stored.signature.distance(*other)),
            })
        };
        let mut corners: Vec<ExplainedCorner> = said.iter().filter_map(explained).collect();
        order::sort_by(&mut corners, |a, b| b.evidence_bits.total_cmp(&a.evidence_bits).then(a.corner.cmp(&b.corner)));
        Ok(Some(Self {
            landmark,
            view: answer.view,
            view_width_px: view.width(),
            view_height_px: view.height(),
            evidence_bits: bits(matched.evidence),
            corners_sum_bits: corners.iter().map(|corner| corner.evidence_bits).sum(),
            map: SeenMap::new(&map, [f32::from(view.width()) / 2.0, f32::from(view.height()) / 2.0]),
            frame_from_view_px: map.0,
            groups: Said::ALL.into_iter().filter_map(|said| Group::new(said, &corners)).collect(),
            corners,
        }))
    }

    /// How many corners speak for the view, and their bits; and how many against it, and theirs.
    pub fn for_and_against(&self) -> [(usize, f64); 2] {
        let side = |positive: bool| {
            let corners = self.corners.iter().map(|corner| corner.evidence_bits);
            let side = corners.filter(|bits| if positive { *bits > 0.0 } else { *bits < 0.0 });
            side.fold((0, 0.0), |(count, sum), bits| (count + 1, sum + bits))
        };
        [side(true), side(false)]
    }
}

impl SeenMap {
    fn new(map: &Homography, at: [f32; 2]) -> Self {
        let ([[a, b], [c, d]], _) = map.jacobian(at);
        let area = a * d - b * c;
        // Singular values s1 >= s2 from their squares' sum and their product.
        let (squares, area) = (a * a + b * b + c * c + d * d, area.abs().max(f32::MIN_POSITIVE));
        let root = libm::sqrtf((squares * squares - 4.0 * area * area).max(0.0));
        Self {
            scale: libm::sqrtf(area),
            lean_deg: libm::atan2f(-b, d).to_degrees(),
            stretch: (squares + root) / (2.0 * area),
        }
    }
}

impl Group {
    fn new(said: Said, corners: &[ExplainedCorner]) -> Option<Self> {
        let members: Vec<&ExplainedCorner> = corners.iter().filter(|corner| corner.said == said).collect();
        let mut residuals: Vec<f32> = members.iter().filter_map(|corner| corner.residual_px).collect();
        order::sort_by(&mut residuals, f32::total_cmp);
        (!members.is_empty()).then(|| Self {
            said,
            corners: members.len(),
            evidence_bits: members.iter().map(|corner| corner.evidence_bits).sum(),
            median_residual_px: residuals.get(residuals.len() / 2).copied(),
        })
    }
}

fn why_lost(best: &ViewExplanation, runner_up: &ViewExplanation) -> String {
    let strong = |view: &ViewExplanation| view.corners.iter().filter(|corner| corner.said <= Said::Fair).count();
    let [[(won, won_bits), _], [(lost, lost_bits), (against, against_bits)]] =
        [best.for_and_against(), runner_up.for_and_against()];
    let name = &runner_up.landmark;
    let gap = best.evidence_bits - runner_up.evidence_bits;
    format!(
        "{name} has {gap:.1} bits less: {lost} of its corners speak for it ({lost_bits:+.1} bits, {} of them strong or \
         fair) against {won} ({won_bits:+.1} bits, {}), and {against} speak against it ({against_bits:+.1} bits)",
        strong(runner_up),
        strong(best),
    )
}
