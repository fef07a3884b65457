//! Files and texts about a model.

use std::fmt::Write as _;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::command::CommandError;
use crate::model_file::sheet::sheets;
use crate::model_file::{Format, gltf, obj, ply};
use crate::report::{data_uri, page as html};
use crate::synthesize::dense::DenseCloud;
use crate::synthesize::reconstruct::{Reconstruction, Shape};
use crate::synthesize::report::Facts;
use crate::table_file::replace_file;
use daymark_numerics::depth::DepthBuffer;

/// What colours a glTF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Texture {
    /// The pictures, by texture coordinates
    Pictures,
    /// The mean of each triangle's points
    Mean,
}

/// Writes bytes to a file that is there whole or not at all.
pub(super) fn save(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    replace_file(path, bytes).map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

/// Writes the model.
pub(super) fn write(
    path: &Path,
    format: Format,
    texture: Texture,
    made: &Reconstruction,
    dense: &DenseCloud,
    facts: &Facts,
) -> Result<(), CommandError> {
    let comments = [
        format!("daymark {}", facts.program_version),
        format!("length unit {}", facts.length_unit),
        format!("reprojection {:.3} px", facts.reprojection_rms_px),
    ];
    let extras = serde_json::json!({
        "length_unit": facts.length_unit,
        "reprojection_rms_px": facts.reprojection_rms_px,
        "median_deviation": facts.median_deviation,
    });
    let sheets = || sheets(dense, &made.model.shown, &made.views, &made.stations);
    match (format, texture) {
        (Format::Gltf, Texture::Pictures) => save(path, &gltf::textured(dense, &sheets(), &extras)),
        (Format::Gltf, Texture::Mean) => save(path, &gltf::patches(dense, &extras)),
        (Format::Ply, _) => save(path, &ply::file(dense, &comments)),
        (Format::Obj, _) => {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            for (name, bytes) in obj::files(dense, &sheets(), &stem, &comments) {
                save(&path.with_file_name(name), &bytes)?;
            }
            Ok(())
        }
    }
}

/// Pixels of the longer side of a preview.
const PREVIEW_SIDE: f64 = 800.0;

/// The model as the first joined view's camera sees it, as a PNG.
pub(super) fn preview(made: &Reconstruction, dense: &DenseCloud) -> Vec<u8> {
    let Some((view, station)) = made.views.iter().zip(&made.stations).find_map(|(v, s)| Some((v, s.as_ref()?))) else {
        return Vec::new();
    };
    let longer = view.gray.width.max(view.gray.height) as f64;
    let scale = (PREVIEW_SIDE / longer).min(1.0);
    let size = [view.gray.width, view.gray.height].map(|side| ((side as f64 * scale) as usize).max(1));
    let positions: Vec<[f64; 3]> = dense.positions.iter().map(|p| p.map(f64::from)).collect();
    let buffer = DepthBuffer::new(&station.pinhole, size, scale, &positions, &dense.triangles);
    let colours: Vec<[u8; 3]> = dense.patch_colours().collect();
    let pixels: Vec<u8> = buffer
        .triangles
        .iter()
        .flat_map(|&triangle| colours.get(triangle as usize).copied().unwrap_or([236; 3]))
        .collect();
    let mut bytes = Vec::new();
    // A picture in memory can be encoded.
    let _ = PngEncoder::new(&mut bytes).write_image(&pixels, size[0] as u32, size[1] as u32, ExtendedColorType::Rgb8);
    bytes
}

/// The report as text. Writing to a string cannot fail.
pub(super) fn text(facts: &Facts, path: &Path, explain: bool) -> String {
    let mut text = String::new();
    let unit = match facts.length_unit {
        "metre" => "m",
        "camera_file_unit" => "units of the camera file",
        "model_height" => "times its own height (up to scale: give --height-m)",
        "affine" => "without meaning: two pictures and no focal length give the shape up to an affine map only",
        _ => "times the distance of the first two cameras (up to scale: give --distance-m or --height-m)",
    };
    let _ = writeln!(text, "{}", path.display());
    let _ = writeln!(
        text,
        "  {} points, {} triangles; level {}: {} points, {} triangles, {:.1} MB in memory",
        facts.points,
        facts.triangles,
        facts.level,
        facts.dense_points,
        facts.dense_triangles,
        facts.dense_bytes as f64 / 1e6
    );
    let _ = writeln!(
        text,
        "  reprojection {:.3} px rms, parallax {:.1} degrees (median), deviation of a point {:.4} (median)",
        facts.reprojection_rms_px, facts.median_parallax_degree, facts.median_deviation
    );
    let [x, y, z] = facts.extent;
    let _ = writeln!(text, "  {x:.2} x {y:.2} x {z:.2} {unit}");
    if facts.shape == Shape::UpToMirror {
        let _ =
            writeln!(text, "  no focal length: affine cameras; the model may be mirrored in depth (give --focal-px)");
    }
    for (number, view) in (1..).zip(&facts.views) {
        if view.position.is_some() {
            let _ = writeln!(
                text,
                "  view {number} {}: {} points ({} by it alone with one other), {:.2} px, covers {:.0} %, textures {} triangles",
                view.file,
                view.points,
                view.points_lost_without,
                view.reprojection_rms_px,
                view.coverage * 100.0,
                view.textures
            );
        } else {
            let _ = writeln!(text, "  view {number} {}: could not be joined", view.file);
        }
    }
    if explain {
        for pair in &facts.pairs {
            let [a, b] = pair.views;
            let _ = writeln!(
                text,
                "  pair {a} {b}: {} look-alikes, {} agree, {} matches with the geometry's help, parallax {:.1} degrees, {:.0} % in one plane",
                pair.alike,
                pair.agreeing,
                pair.matches,
                pair.parallax_degree,
                pair.plane_share * 100.0
            );
        }
        let (removed, refused, dropped) = (facts.removed_matches, facts.refused_points, facts.dropped_triangles);
        let _ = writeln!(
            text,
            "  removed matches: {} off the epipolar line, {} of pairs without a geometry, {} contradicting tracks",
            removed.off_epipolar_line, removed.pair_without_geometry, removed.contradicting_tracks
        );
        let _ = writeln!(
            text,
            "  refused points: {} small parallax, {} large error, {} behind a camera, {} seen once",
            refused.small_parallax, refused.large_error, refused.behind_camera, refused.single_view
        );
        let _ = writeln!(
            text,
            "  dropped triangles: {} turned over in the other view, {} grazing, {} would hide a point, {} covered, \
             {} third at an edge; {} seen by no view",
            dropped.flipped, dropped.grazing, dropped.hiding, dropped.covered, dropped.crossing, facts.unseen_triangles
        );
        if let Some(explained) = &facts.explained {
            let _ = writeln!(text, "  left out (view and pixels of the size used, without distortion):");
            for left_out in &explained.left_out {
                let _ = writeln!(text, "    {left_out}");
            }
            if explained.not_told > 0 {
                let _ = writeln!(text, "    and {} more", explained.not_told);
            }
        }
    }
    text
}

/// The report as a page.
pub(super) fn page(made: &Reconstruction, dense: &DenseCloud, facts: &Facts) -> String {
    let mut body = "<h1>Model</h1>\n<div class=\"tiles\">\n".to_owned();
    for (value, what) in [
        (format!("{:.2} px", facts.reprojection_rms_px), "reprojection error (rms)"),
        (format!("{:.1}°", facts.median_parallax_degree), "parallax (median)"),
        (facts.points.to_string(), "points"),
        (facts.dense_triangles.to_string(), "triangles of the dense model"),
        (facts.length_unit.replace('_', " "), "unit of length"),
    ] {
        body.push_str(&html::tile(&value, what));
    }
    body.push_str("</div>\n");
    let picture = data_uri::png_bytes(&preview(made, dense));
    let _ = writeln!(body, "<figure class=\"wide\"><img src=\"{picture}\" alt=\"the model\"></figure>\n<h2>Views</h2>");
    let rows: Vec<Vec<String>> = facts
        .views
        .iter()
        .map(|view| {
            vec![
                view.file.clone(),
                view.points.to_string(),
                view.points_lost_without.to_string(),
                format!("{:.2}", view.reprojection_rms_px),
                format!("{:.0} %", view.coverage * 100.0),
                view.textures.to_string(),
            ]
        })
        .collect();
    body.push_str(&html::table(&["view", "points", "lost without it", "error, px", "covered", "triangles"], &rows));
    body.push_str("<h2>Pairs</h2>\n");
    let rows: Vec<Vec<String>> = facts
        .pairs
        .iter()
        .map(|pair| {
            vec![
                format!("{} – {}", pair.views[0], pair.views[1]),
                pair.alike.to_string(),
                pair.matches.to_string(),
                format!("{:.1}°", pair.parallax_degree),
                format!("{:.0} %", pair.plane_share * 100.0),
            ]
        })
        .collect();
    body.push_str(&html::table(&["pair", "look-alikes", "matches", "parallax", "in one plane"], &rows));
    html::page("daymark: model", &body)
}
