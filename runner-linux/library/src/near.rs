//! What is known before the frame: a last position and a compass. They narrow the search of the table, and a position that
//! contradicts them is not told.

use daymark_core::fix::ellipse::DEVIATIONS_95;
use daymark_core::fix::prior::{Contradiction, Near};
use daymark_core::fix::{Fix, LocalFrame, Measured, Prior, Wgs84};
use daymark_core::table::{LandmarkTable, TableError};

use crate::enroll::position::parse_degrees;

/// How well a compass tells a heading, degrees: phones' are worse near steel.
const COMPASS_ERROR_DEGREES: f64 = 10.0;

/// What is known beforehand.
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
pub struct PriorArgs {
    /// You are within this many metres of a place (with 95 %): only buildings that can be seen from there are compared, and a
    /// position elsewhere is refused
    #[arg(long, value_name = "LAT,LON,RADIUS", allow_hyphen_values = true, value_parser = near)]
    pub near: Option<Around>,
    /// A compass says that the camera points there, degrees from north over east, and how well it knows that [default: 10]
    #[arg(long, value_name = "DEGREES[,ERROR]", value_parser = heading)]
    pub heading: Option<Heading>,
}

/// A circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Around {
    at: Wgs84,
    radius_m: f64,
}

/// A heading and its deviation, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading([f64; 2]);

fn near(text: &str) -> Result<Around, String> {
    let form = || format!("{text:?} is not LAT,LON,RADIUS: write degrees and metres, as in 48.85837,2.29448,500");
    let (place, radius) = text.rsplit_once(',').ok_or_else(form)?;
    let [latitude_deg, longitude_deg] = parse_degrees(place).map_err(|error| error.to_string())?;
    let radius_m: f64 = radius.trim().parse().map_err(|_| form())?;
    if !(radius_m > 0.0 && radius_m <= 2e7) {
        return Err(format!("a radius of {radius_m} m: give metres above 0"));
    }
    Ok(Around { at: Wgs84 { latitude_deg, longitude_deg, altitude_m: 0.0 }, radius_m })
}

fn heading(text: &str) -> Result<Heading, String> {
    let (degrees, error) = text.split_once(',').unwrap_or((text, ""));
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let error = if error.is_empty() { Some(COMPASS_ERROR_DEGREES) } else { number(error) };
    match (number(degrees), error) {
        (Some(degrees), Some(error)) if (0.0..=360.0).contains(&degrees) && error > 0.0 && error <= 180.0 => {
            Ok(Heading([degrees, error]))
        }
        _ => Err("give 0 to 360 degrees from north over east, and an error of up to 180".to_owned()),
    }
}

impl PriorArgs {
    /// The views of landmarks that can be seen from the circle, recognized from `reach_m` metres at most; `None` for all. A
    /// landmark whose place nobody knows may stand there.
    ///
    /// # Errors
    /// A damaged record; not of a verified table.
    pub fn views(&self, table: &LandmarkTable<'_>, reach_m: f64) -> Result<Option<Vec<u32>>, TableError> {
        let Some(Around { at, radius_m }) = self.near else { return Ok(None) };
        let frame = LocalFrame::new(at);
        let mut views = Vec::new();
        for number in 0..table.landmark_count() {
            let landmark = table.landmark(number)?;
            let in_reach = landmark.position.is_none_or(|place| {
                let [east, north, _] = frame.local_from_wgs84(place.wgs84());
                libm::hypot(east, north) <= radius_m + reach_m + place.error_m()
            });
            if in_reach {
                views.extend(landmark.views);
            }
        }
        Ok(Some(views))
    }

    /// Why a fix cannot be, if it contradicts what is known.
    pub fn contradiction(&self, fix: &Fix) -> Option<String> {
        let prior = Prior {
            near: self.near.map(|Around { at, radius_m }| Near { position: at, radius_m }),
            heading_deg: self.heading.map(|Heading([value, deviation])| Measured { value, deviation }),
        };
        match prior.check(fix).err()? {
            Contradiction::Position { apart_m } => Some(format!(
                "the position would be {apart_m:.0} m from where --near says, {:.0} m off by its own error: one of them is wrong",
                fix.ellipse().semi_major_m / DEVIATIONS_95
            )),
            Contradiction::Heading { apart_deg } => Some(format!(
                "the camera would point {apart_deg:.0} degrees away from what --heading says: one of them is wrong"
            )),
            _ => Some("the position contradicts what was known before".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_read_or_refused() {
        let around = near("-33.8568, 151.2153, 500").expect("a circle");
        assert_eq!((around.at.latitude_deg, around.at.longitude_deg, around.radius_m), (-33.8568, 151.2153, 500.0));
        for wrong in ["48.1,11.5", "48.1,11.5,x", "48.1,11.5,0", "91,0,5", ""] {
            assert!(near(wrong).is_err(), "{wrong}");
        }
        assert_eq!(heading("270"), Ok(Heading([270.0, 10.0])));
        assert_eq!(heading("90, 5"), Ok(Heading([90.0, 5.0])));
        for wrong in ["400", "x", "10,0", "10,x"] {
            assert!(heading(wrong).is_err(), "{wrong}");
        }
    }
}
