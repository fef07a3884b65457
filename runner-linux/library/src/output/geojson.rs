//! GeoJSON (RFC 7946), one feature a line: the observer with the landmark that is seen. Maps read such files as GeoJSONSeq
//! (`ogr2ogr map.gpkg GeoJSONSeq:answers.geojsonl`).

use serde_json::json;

use super::Form;
use super::record::Record;

/// Newline-delimited GeoJSON. Answers without a position are left out.
#[derive(Debug, Clone, Copy)]
pub struct Geojson;

impl Form for Geojson {
    fn write(&mut self, record: &Record, out: &mut Vec<u8>) {
        let Record::Answer(answer) = record else { return };
        let (Some(landmark), Some(fix)) = (&answer.position, &answer.fix) else { return };
        // Longitude first; an altitude only if there is one.
        let mut observer = vec![fix.longitude_deg, fix.latitude_deg];
        observer.extend(fix.altitude_m);
        let feature = json!({
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": observer},
            "properties": {
                "landmark": answer.landmark,
                "kind": answer.kind,
                "landmark_latitude_deg": landmark.latitude_deg,
                "landmark_longitude_deg": landmark.longitude_deg,
                "landmark_error_m": landmark.error_m,
                "probability_false_answer": answer.probability_false_answer,
                "frame": answer.at.frame,
                "time_s": answer.at.time_s,
                "utc_s": answer.at.utc_s,
                "method": fix.method,
                "error_semi_major_m": fix.error.semi_major_m,
                "error_semi_minor_m": fix.error.semi_minor_m,
                "error_orientation_deg": fix.error.orientation_deg,
                "bearing_deg": fix.bearing_deg,
                "range_m": fix.range_m,
                "heading_deg": fix.heading_deg,
            },
        });
        out.extend_from_slice(feature.to_string().as_bytes());
        out.push(b'\n');
    }
}
