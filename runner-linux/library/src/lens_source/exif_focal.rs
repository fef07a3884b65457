//! The focal length in a picture's EXIF data.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exif::{Exif, In, Tag, Value};

/// Relative error by EXIF: whole millimetres, nominal focal lengths, focus.
pub const EXIF_ERROR: f64 = 0.03;
/// The same for a picture with other sides than EXIF says: a part of it is cut away, and nobody says how much.
pub const CUT_ERROR: f64 = 0.15;
/// Diagonal of a picture on 35 mm film, millimetres: equivalent focal lengths compare diagonals (CIPA DCG-001).
const FILM_DIAGONAL_MM: f64 = 43.267;

/// What a picture's EXIF data say about its focal length.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ExifFocal {
    /// The focal length that has this diagonal angle of view on 35 mm film, millimetres.
    film_mm: Option<f64>,
    /// The focal length in pixels of the sensor as it was read out.
    sensor_px: Option<f64>,
    /// The sides of the picture when it was taken, the longer first.
    sides: Option<[f64; 2]>,
}

impl ExifFocal {
    /// An equivalent focal length and no more.
    #[cfg(test)]
    pub(super) const fn film(film_mm: f64) -> Self {
        Self { film_mm: Some(film_mm), sensor_px: None, sides: None }
    }

    /// What a picture's EXIF data say; `None` if there is no focal length in them.
    pub fn of_picture(picture: &Path) -> Option<Self> {
        let file = File::open(picture).ok()?;
        Self::from_exif(&exif::Reader::new().read_from_container(&mut BufReader::new(file)).ok()?)
    }

    fn from_exif(exif: &Exif) -> Option<Self> {
        let number = |tag| {
            let value = match &exif.get_field(tag, In::PRIMARY)?.value {
                Value::Rational(values) => values.first().filter(|value| value.denom != 0)?.to_f64(),
                value => f64::from(value.get_uint(0)?),
            };
            (value > 0.0 && value.is_finite()).then_some(value)
        };
        let sides = number(Tag::PixelXDimension).zip(number(Tag::PixelYDimension));
        // Pixels in an inch by default, or in a centimetre.
        let unit_mm = match number(Tag::FocalPlaneResolutionUnit) {
            Some(3.0) => 10.0,
            Some(4.0) => 1.0,
            Some(5.0) => 0.001,
            _ => 25.4,
        };
        let sensor_px = || {
            let resolution = number(Tag::FocalPlaneXResolution)? / unit_mm;
            // A sensor has between 2 and 60 mm. Whatever has not was scaled without saying so.
            let (x, _) = sides.filter(|(x, _)| (2.0..60.0).contains(&(x / resolution)))?;
            let focal = number(Tag::FocalLength)? * resolution;
            (0.1 * x..100.0 * x).contains(&focal).then_some(focal)
        };
        let found = Self {
            film_mm: number(Tag::FocalLengthIn35mmFilm).filter(|film| (4.0..4_000.0).contains(film)),
            sensor_px: sensor_px(),
            sides: sides.map(|(x, y)| [x.max(y), x.min(y)]),
        };
        (found.film_mm.is_some() || found.sensor_px.is_some()).then_some(found)
    }

    /// The focal length in pixels of a picture of this size, and its relative error; turned pictures too.
    ///
    /// A picture that was only scaled has the sides' ratio of the one that was taken. If it has one of its sides, it was
    /// cut; otherwise it was cut no more than necessary, as far as anybody can tell, and [`CUT_ERROR`] says so.
    pub fn in_pixels(&self, width: u32, height: u32) -> Option<(f64, f64)> {
        let here = [width.max(height), width.min(height)].map(f64::from);
        let taken = self.sides.unwrap_or(here);
        let [longer, shorter] = [here[0] / taken[0], here[1] / taken[1]];
        let (scale, error) = match longer / shorter {
            // A few rows are rounded away by scaling or by the encoder.
            ratio if (ratio - 1.0).abs() < 0.01 => (longer, EXIF_ERROR),
            _ if here[0] == taken[0] || here[1] == taken[1] => (1.0, EXIF_ERROR),
            _ => (longer.max(shorter), CUT_ERROR),
        };
        let as_taken = match (self.film_mm, self.sensor_px) {
            (Some(film), _) => film / FILM_DIAGONAL_MM * libm::hypot(taken[0], taken[1]),
            (None, Some(pixels)) => pixels,
            (None, None) => return None,
        };
        Some((as_taken * scale, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exif::experimental::Writer;
    use exif::{Field, Rational};
    use std::io::Cursor;

    fn read(fields: &[(Tag, Value)]) -> Option<ExifFocal> {
        let fields: Vec<_> =
            fields.iter().map(|(tag, value)| Field { tag: *tag, ifd_num: In::PRIMARY, value: value.clone() }).collect();
        let mut writer = Writer::new();
        for field in &fields {
            writer.push_field(field);
        }
        let mut bytes = Cursor::new(Vec::new());
        writer.write(&mut bytes, false).expect("written");
        ExifFocal::from_exif(&exif::Reader::new().read_raw(bytes.into_inner()).expect("read"))
    }

    fn short(tag: Tag, value: u16) -> (Tag, Value) {
        (tag, Value::Short(vec![value]))
    }

    fn ratio(tag: Tag, num: u32, denom: u32) -> (Tag, Value) {
        (tag, Value::Rational(vec![Rational { num, denom }]))
    }

    #[test]
    fn a_phones_equivalent_focal_length_compares_diagonals() {
        // A phone of 28 mm with pixels of 1.22 um and 3.99 mm of focal length has 3,270 px.
        let said = read(&[
            short(Tag::FocalLengthIn35mmFilm, 28),
            short(Tag::PixelXDimension, 4032),
            short(Tag::PixelYDimension, 3024),
        ]);
        let (focal, error) = said.and_then(|said| said.in_pixels(4032, 3024)).expect("a focal length");
        assert!((focal - 3_270.0).abs() < 0.01 * focal && error == EXIF_ERROR, "{focal}");
        let at = |width, height| said.and_then(|said| said.in_pixels(width, height)).expect("a focal length");
        // Scaled; turned; cut at the top; cut and scaled.
        assert!((at(1008, 756).0 - focal / 4.0).abs() < 1e-9 && at(1008, 756).1 == EXIF_ERROR);
        assert_eq!(at(3024, 4032), at(4032, 3024));
        assert_eq!(at(4032, 2268), at(4032, 3024));
        assert!((at(2016, 1134).0 - focal / 2.0).abs() < 1e-9 && at(2016, 1134).1 == CUT_ERROR);
    }

    #[test]
    fn a_cameras_sensor_gives_pixels_if_its_size_is_possible() {
        // 23.4 mm in 6,000 pixels, a lens of 35 mm: 8,974 px.
        let sensor = |resolution, unit| {
            read(&[
                ratio(Tag::FocalLength, 350, 10),
                ratio(Tag::FocalPlaneXResolution, resolution, 1_000),
                short(Tag::FocalPlaneResolutionUnit, unit),
                short(Tag::PixelXDimension, 6_000),
                short(Tag::PixelYDimension, 4_000),
            ])
        };
        for (resolution, unit) in [(6_512_820, 2), (2_564_103, 3), (256_410, 4)] {
            let (focal, _) =
                sensor(resolution, unit).and_then(|said| said.in_pixels(3_000, 2_000)).expect("a focal length");
            assert!((focal - 4_487.2).abs() < 0.5, "{focal}");
        }
        assert_eq!(sensor(256_410, 3), None, "a sensor of 234 mm");
        assert_eq!(sensor(0, 2), None);
    }

    #[test]
    fn what_is_no_focal_length_is_none() {
        assert_eq!(read(&[ratio(Tag::FocalLength, 399, 100)]), None, "millimetres alone say nothing");
        assert_eq!(read(&[short(Tag::FocalLengthIn35mmFilm, 0)]), None);
        assert_eq!(read(&[ratio(Tag::FocalLengthIn35mmFilm, 28, 0)]), None);
        let film = read(&[short(Tag::FocalLengthIn35mmFilm, 36)]).and_then(|said| said.in_pixels(3_000, 2_000));
        assert!((film.expect("film").0 - 3_000.0).abs() < 1.0, "36 mm see as wide as film is");
    }
}
