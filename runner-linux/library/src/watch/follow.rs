//! Where the observer is, over the frames that show one landmark.
//!
//! Noise of the corners differs from frame to frame, so fixes are filtered ([`Track`]). What the lens, the model's scale and the
//! landmark's own place are wrong by is the same in every frame: it takes no part in the filter and is added afterwards, so
//! that a thousand frames never claim to know the place better than the map does.

use daymark_core::fix::track::{Track, Update};
use daymark_core::fix::{Evidence, Fix, LocalFrame, Wgs84};

use crate::observer::Sighted;

/// Follows one observer before one landmark.
#[derive(Debug, Clone)]
pub struct Following {
    speed_m_s: f64,
    current: Option<Current>,
}

#[derive(Debug, Clone)]
struct Current {
    landmark: u32,
    track: Track,
    latest: Sighted,
}

impl Following {
    /// An observer who moves with up to about this speed, metres a second; 0 for one who stands.
    pub const fn new(speed_m_s: f64) -> Self {
        Self { speed_m_s, current: None }
    }

    /// A frame showed a landmark from a place.
    pub fn seen(&mut self, landmark: u32, sighted: &Sighted, time_s: f64) {
        let old = self.current.take().filter(|current| current.landmark == landmark);
        let mut track = old.map_or_else(|| Track::new(self.speed_m_s), |current| current.track);
        if is_pose(&sighted.fix) && track.update(&sighted.noise, time_s) == Update::Unusable {
            // A clock that went back: begin again.
            track = Track::new(self.speed_m_s);
            track.update(&sighted.noise, time_s);
        }
        self.current = Some(Current { landmark, track, latest: *sighted });
    }

    /// Another scene, table or camera: nothing holds any more.
    pub fn forget(&mut self) {
        self.current = None;
    }

    /// The numbers of the landmarks changed.
    pub fn renumber(&mut self, new: impl Fn(u32) -> Option<u32>) {
        self.current = self.current.take().and_then(|mut current| {
            current.landmark = new(current.landmark)?;
            Some(current)
        });
    }

    /// Where the observer of a landmark, which stands at `place`, is at a time; `None` if no frame told.
    pub fn fix(&self, landmark: u32, place: Wgs84, time_s: f64) -> Option<Fix> {
        let Current { track, latest, .. } = self.current.as_ref().filter(|current| current.landmark == landmark)?;
        let Some(filtered) = track.fix(time_s).filter(|_| is_pose(&latest.fix)) else { return Some(latest.fix) };
        let mut covariance = filtered.covariance;
        for (row, (all, noise)) in covariance.iter_mut().zip(latest.fix.covariance.iter().zip(latest.noise.covariance))
        {
            for (entry, (all, noise)) in row.iter_mut().zip(all.iter().zip(noise)) {
                *entry += all - noise;
            }
        }
        let [east, north, _] = LocalFrame::new(filtered.position).local_from_wgs84(place);
        let azimuth = libm::atan2(east, north).to_degrees().rem_euclid(360.0);
        let measured = |value, old: Option<daymark_core::fix::Measured>| {
            old.map(|old| daymark_core::fix::Measured { value, deviation: old.deviation })
        };
        Some(Fix {
            position: filtered.position,
            covariance,
            bearing_deg: measured(azimuth, latest.fix.bearing_deg),
            range_m: measured(libm::hypot(east, north), latest.fix.range_m),
            ..latest.fix
        })
    }
}

const fn is_pose(fix: &Fix) -> bool {
    matches!(fix.evidence, Evidence::Corners { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACE: Wgs84 = Wgs84 { latitude_deg: 48.0, longitude_deg: 11.0, altitude_m: 0.0 };

    /// Somebody north of the landmark, known to a metre beside a systematic error of ten.
    fn sighted(east: f64) -> Sighted {
        let corners = Evidence::Corners { inliers: 40, points: 50, residual_px: 0.5, log2_chance: -80.0 };
        let fix = |variance: f64| Fix {
            position: LocalFrame::new(PLACE).wgs84_from_local([east, 30.0, 1.0]),
            covariance: [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, variance]],
            bearing_deg: Some(daymark_core::fix::Measured { value: 180.0, deviation: 1.0 }),
            range_m: Some(daymark_core::fix::Measured { value: 30.0, deviation: 1.0 }),
            heading_deg: None,
            evidence: corners,
        };
        Sighted { fix: fix(101.0), noise: fix(1.0) }
    }

    #[test]
    fn noise_is_averaged_and_what_is_common_stays() {
        let mut following = Following::new(0.0);
        assert_eq!(following.fix(3, PLACE, 0.0), None);
        for frame in 0..100 {
            following.seen(3, &sighted(if frame % 2 == 0 { 1.0 } else { -1.0 }), f64::from(frame) * 0.1);
        }
        let fix = following.fix(3, PLACE, 10.0).expect("a fix");
        let [east, north, _] = LocalFrame::new(PLACE).local_from_wgs84(fix.position);
        assert!(east.abs() < 0.02 && (north - 30.0).abs() < 0.02, "{east} {north}");
        assert!((fix.covariance[0][0] - 100.01).abs() < 1e-3, "{:?}", fix.covariance);
        assert!((fix.bearing_deg.expect("a bearing").value - 180.0).abs() < 0.1);
        assert_eq!(following.fix(4, PLACE, 10.0), None, "another landmark");
        following.renumber(|old| Some(old + 1));
        assert!(following.fix(4, PLACE, 10.0).is_some());
        following.forget();
        assert_eq!(following.fix(4, PLACE, 10.0), None);
    }

    #[test]
    fn a_clock_that_goes_back_begins_again() {
        let mut following = Following::new(1.0);
        following.seen(0, &sighted(5.0), 100.0);
        following.seen(0, &sighted(-5.0), 1.0);
        let fix = following.fix(0, PLACE, 1.0).expect("a fix");
        let [east, ..] = LocalFrame::new(PLACE).local_from_wgs84(fix.position);
        assert!((east + 5.0).abs() < 1e-6, "{east}");
    }
}
