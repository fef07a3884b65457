//! Why single matches and points were left out.

use serde::Serialize;

/// Why a match or a track did not become a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Reason {
    /// Its pair of views has no common geometry.
    PairWithoutGeometry,
    /// It lies off the epipolar line.
    OffEpipolarLine {
        /// By so much; null for affine cameras, whose line is a common one of both views.
        distance_px: Option<f64>,
    },
    /// Its rays meet behind a camera.
    BehindCamera,
    /// Matches join two corners of one view: some of them is wrong.
    Contradiction,
    /// It did not fit where all views were adjusted together.
    NotAdjusted,
    /// Fewer than two views with a place see it.
    SingleView,
    /// Its rays are nearly parallel.
    SmallParallax {
        /// The largest angle between two of them; null if they are parallel as far as numbers tell.
        degree: Option<f64>,
    },
    /// Its images are too far from where it was seen.
    LargeError {
        /// Root mean square of the distances.
        reprojection_px: f64,
    },
}

/// One that was left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// Views that see it, from 1, and where: pixels of the size used, without distortion.
    pub seen: Vec<Seen>,
    /// Why.
    #[serde(flatten)]
    pub reason: Reason,
}

/// A place in a view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Seen {
    /// The view, from 1.
    pub view: usize,
    /// Pixels.
    pub at_px: [f64; 2],
}

impl LeftOut {
    /// From sightings with views counted from 0.
    pub fn new(sightings: &[(usize, [f64; 2])], reason: Reason) -> Self {
        Self { seen: sightings.iter().map(|&(view, at_px)| Seen { view: view + 1, at_px }).collect(), reason }
    }
}

/// All that were left out, but not more of a kind than anybody reads.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Explained {
    /// Those that are told.
    pub left_out: Vec<LeftOut>,
    /// How many more there are.
    pub not_told: usize,
}

/// Of one kind in one pair of views (or of tracks), so many are told.
const TOLD: usize = 50;
/// In all, so many are told.
const TOLD_IN_ALL: usize = 2_000;

impl Explained {
    /// Adds those of one kind.
    pub fn extend(&mut self, count: usize, left_out: impl Iterator<Item = LeftOut>) {
        let before = self.left_out.len();
        self.left_out.extend(left_out.take(TOLD.min(TOLD_IN_ALL.saturating_sub(before))));
        self.not_told += count.saturating_sub(self.left_out.len() - before);
    }
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for Seen { view, at_px: [x, y] } in &self.seen {
            write!(f, "{view} ({x:.1}, {y:.1})  ")?;
        }
        match self.reason {
            Reason::PairWithoutGeometry => f.write_str("the pair has no common geometry"),
            Reason::OffEpipolarLine { distance_px: Some(distance) } => {
                write!(f, "{distance:.1} px off the epipolar line")
            }
            Reason::OffEpipolarLine { distance_px: None } => f.write_str("off the epipolar line"),
            Reason::BehindCamera => f.write_str("behind a camera"),
            Reason::Contradiction => f.write_str("joins two corners of one view"),
            Reason::NotAdjusted => f.write_str("does not fit the adjusted cameras"),
            Reason::SingleView => f.write_str("seen by one view with a place"),
            Reason::SmallParallax { degree: Some(degree) } => write!(f, "parallax {degree:.2} degrees"),
            Reason::SmallParallax { degree: None } => f.write_str("parallel rays"),
            Reason::LargeError { reprojection_px } => write!(f, "reprojection error {reprojection_px:.1} px"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_told_is_counted() {
        let mut explained = Explained::default();
        let one =
            LeftOut::new(&[(0, [1.0, 2.0]), (2, [3.0, 4.5])], Reason::OffEpipolarLine { distance_px: Some(2.25) });
        explained.extend(TOLD + 7, std::iter::repeat_n(one.clone(), TOLD + 7));
        assert_eq!((explained.left_out.len(), explained.not_told), (TOLD, 7));
        explained.extend(1, std::iter::once(one.clone()));
        assert_eq!((explained.left_out.len(), explained.not_told), (TOLD + 1, 7));
        for _ in 0..100 {
            explained.extend(TOLD, std::iter::repeat_n(one.clone(), TOLD));
        }
        assert_eq!(explained.left_out.len(), TOLD_IN_ALL);
        assert_eq!(explained.left_out.len() + explained.not_told, 101 * TOLD + 8);
        assert_eq!(one.to_string(), "1 (1.0, 2.0)  3 (3.0, 4.5)  2.2 px off the epipolar line");
        let text = serde_json::to_string(&one).unwrap();
        assert!(text.ends_with(r#""reason":"off_epipolar_line","distance_px":2.25}"#), "{text}");
    }
}
