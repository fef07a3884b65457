//! NMEA 0183 for chart plotters and gpsd: GGA, RMC and GST for where the observer is, TLL for the landmark that is seen.
//!
//! The talker is `IN` (integrated navigation). The position is an estimate and says so: quality 6 in GGA, mode `E` in RMC,
//! and never quality 1, which would be a satellite fix. When an answer is withdrawn one GGA of quality 0 and one RMC of
//! status `V` follow, so that nobody goes on steering by it, and a TLL with status `L`, lost.

use std::fmt::Write as _;

use super::Form;
use super::fix::Fix;
use super::record::{Answer, Record, Withdrawn};
use crate::calendar::{civil, clock};
use crate::report::finding::Position;

/// TLL has two digits for a target.
const TARGETS: usize = 100;
/// Letters of a name in TLL: a sentence has 82 characters at most.
const NAME: usize = 16;

/// NMEA 0183 sentences.
#[derive(Debug, Clone, Default)]
pub struct Nmea {
    /// Names by target number, in the order in which they were seen first.
    targets: Vec<String>,
}

impl Form for Nmea {
    fn write(&mut self, record: &Record, out: &mut Vec<u8>) {
        match record {
            Record::Answer(answer) => self.answer(answer, out),
            Record::Withdrawn(withdrawn) => self.withdrawn(withdrawn, out),
            _ => {}
        }
    }
}

impl Nmea {
    fn answer(&mut self, answer: &Answer, out: &mut Vec<u8>) {
        let (Some(landmark), Some(fix)) = (&answer.position, &answer.fix) else { return };
        let time = Time::of(answer.at.utc_s);
        gga(Some(fix), &time, out);
        rmc(Some(fix), &time, out);
        gst(fix, &time, out);
        let target = self.target(&answer.landmark);
        tll(target, landmark, &answer.landmark, &time, 'T', out);
    }

    fn withdrawn(&mut self, withdrawn: &Withdrawn, out: &mut Vec<u8>) {
        let Some(landmark) = &withdrawn.position else { return };
        let time = Time::of(withdrawn.at.utc_s);
        gga(None, &time, out);
        rmc(None, &time, out);
        let target = self.target(&withdrawn.landmark);
        tll(target, landmark, &withdrawn.landmark, &time, 'L', out);
    }

    /// The number of a landmark. After a hundred landmarks the numbers begin anew.
    fn target(&mut self, name: &str) -> usize {
        if let Some(at) = self.targets.iter().position(|known| known == name) {
            return at;
        }
        if self.targets.len() == TARGETS {
            self.targets.clear();
        }
        self.targets.push(name.to_owned());
        self.targets.len() - 1
    }
}

/// Appends `$body*checksum`.
fn sentence(body: &str, out: &mut Vec<u8>) {
    let checksum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    out.extend_from_slice(format!("${body}*{checksum:02X}\r\n").as_bytes());
}

/// Time of day and date, empty if they are not known.
struct Time {
    hhmmss: String,
    ddmmyy: String,
}

impl Time {
    fn of(utc_s: Option<f64>) -> Self {
        let Some(utc_s) = utc_s else { return Self { hhmmss: String::new(), ddmmyy: String::new() } };
        let hundredths = (utc_s * 100.0) as u64;
        let (seconds, rest) = (hundredths / 100, hundredths % 100);
        let (hour, minute, second) = clock(seconds);
        let (year, month, date) = civil(seconds / 86_400);
        Self {
            hhmmss: format!("{hour:02}{minute:02}{second:02}.{rest:02}"),
            ddmmyy: format!("{date:02}{month:02}{:02}", year % 100),
        }
    }
}

/// `ddmm.mmmmmm,N`; exact, because 1e-7 degrees are six millionths of a minute.
fn angle(degrees: f64, digits: usize, [positive, negative]: [char; 2]) -> String {
    let e7 = libm::round(degrees * 1e7) as i64;
    let (whole, rest) = (e7.unsigned_abs() / 10_000_000, e7.unsigned_abs() % 10_000_000 * 6);
    let side = if e7 < 0 { negative } else { positive };
    format!("{whole:0digits$}{:02}.{:06},{side}", rest / 1_000_000, rest % 1_000_000)
}

fn place(latitude_deg: f64, longitude_deg: f64) -> String {
    format!("{},{}", angle(latitude_deg, 2, ['N', 'S']), angle(longitude_deg, 3, ['E', 'W']))
}

fn gga(fix: Option<&Fix>, time: &Time, out: &mut Vec<u8>) {
    let body = match fix {
        Some(fix) => {
            let altitude = fix.altitude_m.map_or(",".to_owned(), |metres| format!("{metres:.1},M"));
            format!("INGGA,{},{},6,00,,{altitude},,,,", time.hhmmss, place(fix.latitude_deg, fix.longitude_deg))
        }
        None => format!("INGGA,{},,,,,0,00,,,,,,,", time.hhmmss),
    };
    sentence(&body, out);
}

fn rmc(fix: Option<&Fix>, time: &Time, out: &mut Vec<u8>) {
    let (status, mode) = if fix.is_some() { ('A', 'E') } else { ('V', 'N') };
    let place = fix.map_or_else(|| ",,,".to_owned(), |fix| place(fix.latitude_deg, fix.longitude_deg));
    sentence(&format!("INRMC,{},{status},{place},,,{},,,{mode}", time.hhmmss, time.ddmmyy), out);
}

fn gst(fix: &Fix, time: &Time, out: &mut Vec<u8>) {
    let error = fix.error;
    let (major, minor) = (error.semi_major_m, error.semi_minor_m);
    let radians = error.orientation_deg * core::f64::consts::PI / 180.0;
    let (sin, cos) = (libm::sin(radians), libm::cos(radians));
    let along = |a: f64, b: f64| libm::sqrt(a * a * major * major + b * b * minor * minor);
    let (north, east) = (along(cos, sin), along(sin, cos));
    let mut body = format!("INGST,{},,{major:.1},{minor:.1},{:.1}", time.hhmmss, error.orientation_deg);
    let _ = write!(body, ",{north:.1},{east:.1},");
    sentence(&body, out);
}

fn tll(target: usize, landmark: &Position, name: &str, time: &Time, status: char, out: &mut Vec<u8>) {
    // What NMEA has no place for: its own signs, and letters beyond ASCII.
    let plain = |letter: char| match letter {
        ',' | '*' | '$' | '!' | '\\' | '^' | '~' => ' ',
        letter if letter.is_ascii_graphic() || letter == ' ' => letter,
        _ => '_',
    };
    let name: String = name.chars().map(plain).take(NAME).collect();
    let place = place(landmark.latitude_deg, landmark.longitude_deg);
    sentence(&format!("INTLL,{target:02},{place},{name},{},{status},", time.hhmmss), out);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minutes_are_exact_and_never_sixty() {
        assert_eq!(angle(52.0, 2, ['N', 'S']), "5200.000000,N");
        assert_eq!(angle(-0.000_000_1, 3, ['E', 'W']), "00000.000006,W");
        assert_eq!(angle(12.999_999_9, 3, ['E', 'W']), "01259.999994,E");
        assert_eq!(angle(-179.999_999_99, 3, ['E', 'W']), "18000.000000,W");
    }

    #[test]
    fn time_is_cut_to_hundredths_and_years_to_two_digits() {
        let time = Time::of(Some(1_709_251_199.999));
        assert_eq!((time.hhmmss.as_str(), time.ddmmyy.as_str()), ("235959.99", "290224"));
    }

    #[test]
    fn a_checksum_is_the_xor_of_what_stands_between() {
        let mut out = Vec::new();
        sentence("GPGLL,5300.97914,N,00259.98174,E,125926,A", &mut out);
        assert!(out.ends_with(b"*28\r\n"), "{}", String::from_utf8_lossy(&out));
    }
}
