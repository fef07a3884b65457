//! `daymark table model`: the model of a landmark as a file, its dense cloud made again from what the table stores.

use std::path::Path;

use daymark_core::mesh::SubdivisionLevel;
use daymark_core::table::StoredModel;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::inspect::no_such_landmark;
use super::{facts::SCHEMA_VERSION, print};
use crate::command::CommandError;
use crate::model_file::{Format, gltf, ply};
use crate::report::phrase::{count, grouped};
use crate::synthesize::dense::dense;
use crate::synthesize::view::{Surface, Track, Vertex};
use crate::table_file::{open_table, read_table, replace_file};

pub(super) fn model(path: &Path, name: &str, out: &Path, levels: u8, json: bool) -> Result<(), CommandError> {
    #[derive(Serialize)]
    struct Document<'a> {
        schema_version: u32,
        landmark: &'a str,
        file: String,
        level: u8,
        points_stored: usize,
        points: usize,
        triangles: usize,
        /// Whether lengths are metres.
        metric: bool,
    }
    let format = Format::of_path(out)?;
    let level = SubdivisionLevel::new(levels).ok_or("levels go from 0 to 7")?;
    let bytes = read_table(path)?;
    let table = open_table(path, &bytes)?;
    let landmarks = (0..table.landmark_count()).map(|number| table.landmark(number)).collect::<Result<Vec<_>, _>>()?;
    let Some(number) = (0..).zip(&landmarks).find_map(|(number, landmark)| (landmark.name == name).then_some(number))
    else {
        return Err(no_such_landmark(path, name, landmarks.iter().map(|landmark| landmark.name)));
    };
    let Some(model) = table.model(number)? else {
        let says = "the table has no model of it: enroll two or more pictures from different places";
        return Err(format!("{name:?}: {says}").into());
    };
    let cloud = dense(&surface(&model), level, &[], &[], &[])?;
    let metric = model.facts().scale_error.is_some();
    let file = match format {
        Format::Ply => ply::file(&cloud, &[format!("{name}, {}", if metric { "metres" } else { "without a scale" })]),
        Format::Gltf => gltf::patches(&cloud, &serde_json::json!({ "landmark": name, "metric": metric })),
        Format::Obj => return Err("a table keeps no texture, which an .obj is for: give .ply or .glb".into()),
    };
    replace_file(out, &file)?;
    let document = Document {
        schema_version: SCHEMA_VERSION,
        landmark: name,
        file: out.to_string_lossy().into_owned(),
        level: levels,
        points_stored: model.len(),
        points: cloud.positions.len(),
        triangles: cloud.triangles.len(),
        metric,
    };
    print(json, &document, || {
        format!(
            "{}: {} made of {} in the table, {} triangles\n",
            document.file,
            count(document.points, "point"),
            grouped(document.points_stored as u64),
            grouped(document.triangles as u64)
        )
    })
}

/// The stored surface. Of its points one deviation is known, in all directions.
fn surface(model: &StoredModel<'_>) -> Surface {
    let variance = model.deviation_m() * model.deviation_m();
    let vertex = |position: [f64; 3]| Vertex {
        position: Vector3::from(position),
        covariance: Matrix3::identity() * variance,
        track: Track { number: 0, sightings: Vec::new() },
        reprojection_px: 0.0,
        parallax_degree: 0.0,
    };
    Surface {
        vertices: model.points().map(|point| vertex(point.position)).collect(),
        triangles: model.triangles().map(|triangle| triangle.map(u32::from)).collect(),
    }
}
