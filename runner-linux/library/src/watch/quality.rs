//! Whether a picture is good for anything: dark, blown out, empty and blurred frames are named as such.

use serde::Serialize;

use crate::picture::GrayImage;

/// What a picture is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Good enough to look at.
    Good,
    /// Nearly black.
    Dark,
    /// Nearly all of it white.
    BlownOut,
    /// Without any structure: sky, fog, a covered lens.
    Empty,
    /// Structure, but no edges.
    Blurred,
}

impl Quality {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Good, Self::Dark, Self::BlownOut, Self::Empty, Self::Blurred];

    /// Its name, as in the JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Dark => "dark",
            Self::BlownOut => "blown_out",
            Self::Empty => "empty",
            Self::Blurred => "blurred",
        }
    }

    /// What a person says.
    pub const fn phrase(self) -> &'static str {
        match self {
            Self::Good => "the picture is good",
            Self::Dark => "the picture is too dark",
            Self::BlownOut => "the picture is blown out",
            Self::Empty => "the picture is empty",
            Self::Blurred => "the picture is blurred",
        }
    }

    /// What helps.
    pub const fn advice(self) -> &'static str {
        match self {
            Self::Good => "nothing to do",
            Self::Dark => "more light, a longer exposure or more gain",
            Self::BlownOut => "a shorter exposure or less gain",
            Self::Empty => "see that nothing covers the lens",
            Self::Blurred => "clean and focus the lens, or shorten the exposure if the camera moves",
        }
    }
}

/// A gray level below this is black.
const BLACK: u8 = 24;
/// A gray level from this on is white.
const WHITE: u8 = 250;
/// Mean distance from the mean, in gray levels, below which there is nothing to see.
const EMPTY: u64 = 3;
/// Pixels between the ends of a long step; a short one is 1 px.
const LONG: usize = 6;
/// A long step of so many gray levels is an edge, if the picture has that much contrast.
const EDGE: u64 = 24;
/// The least that is an edge: noise is not.
const LEAST_EDGE: u64 = 12;
/// Mean distance from the mean of a picture that should have edges somewhere.
const CONTRAST: u64 = 20;

/// An eighth of the edges that is less than this says nothing.
const FEW: u32 = 16;
/// Edges sharper than this, in 1/64, are those of a good picture.
const SHARP: u64 = 24;

/// Judges a frame of about 640 px, from every other row.
///
/// *Blurred* is measured on edges (`sharpness`); a picture of high contrast without edges is blurred, too.
pub fn quality(frame: &GrayImage) -> Quality {
    let rows = || frame.pixels.chunks_exact(frame.width.max(1)).step_by(2);
    let count = rows().map(|row| row.len() as u64).sum::<u64>().max(1);
    let total = |value: &dyn Fn(u8) -> u64| rows().flatten().map(|&gray| value(gray)).sum::<u64>();
    let white = total(&|gray| u64::from(gray >= WHITE));
    let black = total(&|gray| u64::from(gray < BLACK));
    let mean = total(&u64::from) / count;
    let spread = total(&|gray| u64::from(gray).abs_diff(mean)) / count;
    if black * 20 >= count * 19 {
        return Quality::Dark;
    }
    if white * 4 >= count * 3 {
        return Quality::BlownOut;
    }
    if spread < EMPTY {
        return Quality::Empty;
    }
    match sharpness(frame, spread.clamp(LEAST_EDGE, EDGE) as u8) {
        None if spread >= CONTRAST => Quality::Blurred,
        None => Quality::Empty,
        Some(sharpness) if sharpness < SHARP => Quality::Blurred,
        Some(_) => Quality::Good,
    }
}

/// How sharp the sharpest eighth of the edges is, in 1/64; none if there are hardly any edges.
///
/// An edge is where the gray level changes by `edge` or more within [`LONG`] px. How much of that does the steepest single
/// step take? All of it at a sharp edge, a sixth on a ramp; flat parts have no say. On the towers at 640 x 480 px (the test
/// prints it) that is 1.0 without blur and about a half with a blur of 2 px of standard deviation; beyond 4 px it falls below
/// the limit.
fn sharpness(frame: &GrayImage, edge: u8) -> Option<u64> {
    let mut histogram = [0_u32; 65];
    for row in frame.pixels.chunks_exact(frame.width.max(1)).step_by(2) {
        for window in row.windows(LONG + 1).step_by(2) {
            let long = window[0].abs_diff(window[LONG]);
            if long >= edge {
                let steepest = window.windows(2).map(|pair| pair[0].abs_diff(pair[1])).max().unwrap_or(0);
                histogram[usize::from(u16::from(steepest.min(long)) * 64 / u16::from(long))] += 1;
            }
        }
    }
    let sharpest = histogram.iter().sum::<u32>() / 8;
    if sharpest < FEW {
        return None;
    }
    let (mut left, mut sum) = (sharpest, 0_u64);
    for (value, &here) in histogram.iter().enumerate().rev() {
        let taken = here.min(left);
        left -= taken;
        sum += value as u64 * u64::from(taken);
    }
    Some(sum / u64::from(sharpest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_fixtures::{Lens, Sensor, Tower, Trial, View};

    fn picture(view: &View) -> GrayImage {
        let frame = view.render();
        GrayImage { pixels: frame.gray, width: frame.width as usize, height: frame.height as usize }
    }

    #[test]
    fn pictures_in_all_light_and_noise_are_good() {
        for tower in &Tower::eight()[..4] {
            for trial in [Trial::Between, Trial::Far, Trial::Evening, Trial::Overcast, Trial::Noisy] {
                let found = quality(&picture(&View::trial(tower, trial, Lens::VGA)));
                assert_eq!(found, Quality::Good, "tower {}, {}", tower.number, trial.name());
            }
        }
    }

    #[test]
    fn what_spoils_a_picture_is_named() {
        for tower in &Tower::eight()[..4] {
            let mut view = View::trial(tower, Trial::Between, Lens::VGA);
            let mut with = |sensor: Sensor| {
                view.sensor = sensor;
                let picture = picture(&view);
                (quality(&picture), sharpness(&picture, EDGE as u8))
            };
            let sensor = Sensor::daylight(1);
            let (good, blurred) = (Quality::Good, Quality::Blurred);
            for (deviation, expected) in [(0, good), (1, good), (2, good), (6, blurred), (8, blurred)] {
                // A blur of the sensor has a variance of half a pixel.
                let (found, sharpness) = with(Sensor { blur: deviation * deviation * 2, ..sensor });
                let share = sharpness.map(|sharpness| sharpness as f64 / 64.0);
                println!("tower {}, a blur of {deviation} px: {share:?}", tower.number);
                assert_eq!(found, expected, "tower {}, {deviation} px, {share:?}", tower.number);
            }
            assert_eq!(with(Sensor { gain: 16, ..sensor }).0, Quality::Dark);
            assert_eq!(with(Sensor { gain: 4_000, ..sensor }).0, Quality::BlownOut);
        }
    }

    #[test]
    fn nothing_is_named_too() {
        let flat = |gray| GrayImage { pixels: vec![gray; 640 * 480], width: 640, height: 480 };
        let found = [0, 23, 24, 128, 249, 250, 255].map(|gray| quality(&flat(gray)));
        let (dark, empty, white) = (Quality::Dark, Quality::Empty, Quality::BlownOut);
        assert_eq!(found, [dark, dark, empty, empty, empty, white, white]);
        assert_eq!(quality(&GrayImage { pixels: Vec::new(), width: 0, height: 0 }), Quality::Empty);
    }
}
