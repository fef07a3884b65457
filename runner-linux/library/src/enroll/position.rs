//! Where a building stands: as somebody says, or as a picture's EXIF data say where the camera was.

use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use daymark_core::table::{ERROR_LIMIT_DM, GeoPosition, LATITUDE_LIMIT_E7, LONGITUDE_LIMIT_E7};
use exif::{Exif, In, Rational, Tag, Value};

/// How well a given position is known if nobody says: the building itself is about that large.
pub const GIVEN_ERROR_METRES: f64 = 20.0;
/// How far a camera stands from the building at most, as a rule. Added to the error of its receiver.
pub const CAMERA_ERROR_METRES: f64 = 100.0;

/// A position in degrees with an error in metres.
///
/// # Errors
/// [`PositionError`] for what is not on Earth.
pub fn position(latitude: f64, longitude: f64, error_metres: f64) -> Result<GeoPosition, PositionError> {
    let within = |value: f64, scale: f64, limit: i32| {
        let scaled = libm::round(value * scale);
        (scaled.abs() <= f64::from(limit)).then_some(scaled as i32)
    };
    Ok(GeoPosition {
        latitude_e7: within(latitude, 1e7, LATITUDE_LIMIT_E7).ok_or(PositionError::Latitude(latitude))?,
        longitude_e7: within(longitude, 1e7, LONGITUDE_LIMIT_E7).ok_or(PositionError::Longitude(longitude))?,
        error_dm: within(error_metres, 10.0, ERROR_LIMIT_DM as i32)
            .and_then(|error| u32::try_from(error).ok())
            .ok_or(PositionError::Radius(error_metres))?,
    })
}

/// Reads `LAT,LON` in degrees, north and east positive.
///
/// # Errors
/// [`PositionError`], which says how it is written.
pub fn parse_degrees(text: &str) -> Result<[f64; 2], PositionError> {
    let form = || PositionError::Form(text.to_owned());
    let (latitude, longitude) = text.split_once(',').ok_or_else(form)?;
    let degrees = |text: &str| text.trim().parse::<f64>().map_err(|_| form());
    let [latitude, longitude] = [degrees(latitude)?, degrees(longitude)?];
    position(latitude, longitude, 0.0).map(|_| [latitude, longitude])
}

/// Where the camera stood, if the picture's EXIF data say so; the error covers the way to the building.
pub fn of_camera(picture: &Path) -> Option<GeoPosition> {
    let file = File::open(picture).ok()?;
    let exif = exif::Reader::new().read_from_container(&mut BufReader::new(file)).ok()?;
    from_exif(&exif)
}

fn from_exif(exif: &Exif) -> Option<GeoPosition> {
    let rationals = |tag| match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(values) if values.iter().all(|value| value.denom != 0) => Some(values.as_slice()),
        _ => None,
    };
    let side = |tag| match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(texts) => texts.first()?.first().copied(),
        _ => None,
    };
    let degrees = |tag, side_tag, negative: u8| {
        let parts: &[Rational; 3] = rationals(tag)?.first_chunk()?;
        let [degrees, minutes, seconds] = parts.each_ref().map(Rational::to_f64);
        let size = degrees + minutes / 60.0 + seconds / 3_600.0;
        Some(if side(side_tag)? == negative { -size } else { size })
    };
    let latitude = degrees(Tag::GPSLatitude, Tag::GPSLatitudeRef, b'S')?;
    let longitude = degrees(Tag::GPSLongitude, Tag::GPSLongitudeRef, b'W')?;
    // Cameras without a fix write zeros.
    if latitude == 0.0 && longitude == 0.0 {
        return None;
    }
    let receiver = rationals(Tag::GPSHPositioningError).and_then(|values| values.first()).map_or(0.0, Rational::to_f64);
    position(latitude, longitude, CAMERA_ERROR_METRES + receiver).ok()
}

/// A position as people read it: degrees north and east, and the error.
#[derive(Debug, Clone, Copy)]
pub struct Shown(pub GeoPosition);

impl fmt::Display for Shown {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [latitude, longitude] = [self.0.latitude_e7, self.0.longitude_e7].map(|e7| f64::from(e7) / 1e7);
        write!(out, "{latitude:.6}, {longitude:.6}, within {:.0} m", f64::from(self.0.error_dm) / 10.0)
    }
}

/// A position that is not on Earth, or not written as one.
#[derive(Debug, Clone, PartialEq)]
pub enum PositionError {
    /// Not two numbers with a comma between.
    Form(String),
    /// Beyond a pole.
    Latitude(f64),
    /// More than half the way round.
    Longitude(f64),
    /// Negative, or half the Earth away.
    Radius(f64),
}

impl fmt::Display for PositionError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Form(text) => {
                write!(out, "{text:?} is not a position: write degrees north and east, as in 48.85837,2.29448")
            }
            Self::Latitude(found) => {
                write!(out, "the latitude {found} is not within -90 and 90 degrees: latitude comes first")
            }
            Self::Longitude(found) => write!(out, "the longitude {found} is not within -180 and 180 degrees"),
            Self::Radius(found) => {
                write!(out, "the position error {found} is not a number of metres between 0 and 20,000,000")
            }
        }
    }
}

impl std::error::Error for PositionError {}

#[cfg(test)]
mod tests {
    use super::*;
    use exif::Field;
    use exif::experimental::Writer;
    use std::io::Cursor;

    #[test]
    fn degrees_are_latitude_then_longitude() {
        assert_eq!(parse_degrees("-33.8568, 151.2153"), Ok([-33.8568, 151.2153]));
        assert_eq!(parse_degrees("48"), Err(PositionError::Form("48".into())));
        assert_eq!(parse_degrees("48,2,3"), Err(PositionError::Form("48,2,3".into())));
        assert_eq!(parse_degrees("151.2153,-33.8568"), Err(PositionError::Latitude(151.2153)));
        assert_eq!(parse_degrees("0,180.1"), Err(PositionError::Longitude(180.1)));
        assert!(matches!(parse_degrees("NaN,0"), Err(PositionError::Latitude(_))));
        assert_eq!(position(0.0, 0.0, -1.0), Err(PositionError::Radius(-1.0)));
        let at = position(-33.8568, 151.2153, 20.0).expect("a position");
        assert_eq!((at.latitude_e7, at.longitude_e7, at.error_dm), (-338_568_000, 1_512_153_000, 200));
        assert_eq!(Shown(at).to_string(), "-33.856800, 151.215300, within 20 m");
    }

    fn with_gps(latitude: [u32; 3], side: &str, receiver: Option<u32>) -> Option<GeoPosition> {
        let rational = |num| Rational { num, denom: 1 };
        let field = |tag, value| Field { tag, ifd_num: In::PRIMARY, value };
        let mut fields = vec![
            field(Tag::GPSLatitude, Value::Rational(latitude.map(rational).to_vec())),
            field(Tag::GPSLatitudeRef, Value::Ascii(vec![side.into()])),
            field(Tag::GPSLongitude, Value::Rational([2, 18, 0].map(rational).to_vec())),
            field(Tag::GPSLongitudeRef, Value::Ascii(vec!["W".into()])),
        ];
        fields.extend(receiver.map(|m| field(Tag::GPSHPositioningError, Value::Rational(vec![rational(m)]))));
        let mut writer = Writer::new();
        for field in &fields {
            writer.push_field(field);
        }
        let mut bytes = Cursor::new(Vec::new());
        writer.write(&mut bytes, false).expect("written");
        from_exif(&exif::Reader::new().read_raw(bytes.into_inner()).expect("read"))
    }

    #[test]
    fn the_cameras_place_is_read_from_exif_with_room_for_the_way_to_the_building() {
        let at = with_gps([48, 30, 36], "N", None).expect("a position");
        assert_eq!((at.latitude_e7, at.longitude_e7, at.error_dm), (485_100_000, -23_000_000, 1_000));
        let at = with_gps([48, 30, 36], "S", Some(12)).expect("a position");
        assert_eq!((at.latitude_e7, at.error_dm), (-485_100_000, 1_120));
        assert_eq!(with_gps([99, 0, 0], "N", None), None, "no such latitude");
    }
}
