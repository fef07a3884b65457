//! What of a model each view shows, with texture coordinates into a cut of its picture.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use crate::synthesize::dense::DenseCloud;
use crate::synthesize::view::{Station, View};

/// Quality of textures.
const JPEG_QUALITY: u8 = 88;
/// Pixels around a cut, so that interpolation at its border sees the picture.
const MARGIN: f64 = 2.0;

/// The triangles that one view shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// The view; `None` for triangles that no view shows.
    pub view: Option<usize>,
    /// Points of the cloud, in the order in which triangles number them.
    pub points: Vec<u32>,
    /// Texture coordinates of each point: 0 to 1, right and down from the texture's top-left corner.
    pub uv: Vec<[f32; 2]>,
    /// Triangles as indices of `points`.
    pub triangles: Vec<[u32; 3]>,
    /// The texture; empty without a view.
    pub jpeg: Vec<u8>,
}

/// The sheets of a dense cloud, by view; `shown` names the view of each triangle of the surface.
pub fn sheets(cloud: &DenseCloud, shown: &[Option<u32>], views: &[View], stations: &[Option<Station>]) -> Vec<Sheet> {
    let fine = 1_usize << (2 * cloud.level.number());
    let mut sheets = Vec::new();
    for view in (0..views.len()).map(Some).chain([None]) {
        let mut index = vec![u32::MAX; cloud.positions.len()];
        let mut sheet = Sheet { view, points: Vec::new(), uv: Vec::new(), triangles: Vec::new(), jpeg: Vec::new() };
        let own = cloud.triangles.chunks_exact(fine).zip(shown).filter(|(_, by)| by.map(|by| by as usize) == view);
        for triangle in own.flat_map(|(triangles, _)| triangles) {
            sheet.triangles.push(triangle.map(|point| {
                let slot = &mut index[point as usize];
                if *slot == u32::MAX {
                    *slot = sheet.points.len() as u32;
                    sheet.points.push(point);
                }
                *slot
            }));
        }
        if sheet.triangles.is_empty() {
            continue;
        }
        if let Some((view, Some(station))) =
            view.and_then(|view| Some((views.get(view)?, stations.get(view)?.as_ref())))
        {
            texture(&mut sheet, cloud, view, station);
        } else {
            sheet.uv = vec![[0.0; 2]; sheet.points.len()];
        }
        sheets.push(sheet);
    }
    sheets
}

fn texture(sheet: &mut Sheet, cloud: &DenseCloud, view: &View, station: &Station) {
    let (width, height) = (view.gray.width as f64, view.gray.height as f64);
    let pixels: Vec<[f64; 2]> = sheet
        .points
        .iter()
        .map(|&point| {
            let position = cloud.positions[point as usize].map(f64::from);
            let [x, y] = station.pinhole.project(position).map_or([0.0; 2], |at| view.lens.picture_from_ideal(at));
            [x.clamp(0.0, width - 1.0), y.clamp(0.0, height - 1.0)]
        })
        .collect();
    let range = |axis: usize, length: f64| {
        let low = pixels.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let high = pixels.iter().map(|p| p[axis]).fold(0.0, f64::max);
        let first = libm::floor(low - MARGIN).max(0.0);
        (first, libm::ceil(high + MARGIN).min(length - 1.0) - first + 1.0)
    };
    let ((left, across), (top, down)) = (range(0, width), range(1, height));
    // The texture's corner is half a pixel before the centre of its first pixel.
    sheet.uv =
        pixels.iter().map(|[x, y]| [((x - left + 0.5) / across) as f32, ((y - top + 0.5) / down) as f32]).collect();
    let (left, top, across, down) = (left as usize, top as usize, across as usize, down as usize);
    let channels = if view.rgb.is_empty() { 1 } else { 3 };
    let source = if channels == 1 { &view.gray.pixels } else { &view.rgb };
    let mut cut = Vec::with_capacity(across * down * channels);
    for row in source.chunks_exact(view.gray.width * channels).skip(top).take(down) {
        cut.extend_from_slice(&row[left * channels..(left + across) * channels]);
    }
    let kind = if channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
    // A picture in memory can be encoded; without its texture the sheet would be drawn white.
    let _ = JpegEncoder::new_with_quality(&mut sheet.jpeg, JPEG_QUALITY).encode(&cut, across as u32, down as u32, kind);
}
