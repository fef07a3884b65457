//! glTF 2.0, binary form (Khronos, "glTF 2.0 Specification", chapter 4).
//!
//! glTF has y up and the front towards +z: a point `(x, y, z)` of the model (z up, front towards -y) is written as
//! `(x, z, -y)`. Lengths stay in the model's unit; glTF reads them as metres.

use serde_json::{Value, json};

use super::sheet::Sheet;
use crate::synthesize::dense::DenseCloud;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY: u32 = 34_962;
const ELEMENTS: u32 = 34_963;

/// The parts of a glTF file while it grows.
#[derive(Default)]
struct Parts {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Parts {
    /// Puts bytes into the buffer; returns the number of their view.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.binary.extend_from_slice(bytes);
        // Every view begins at a multiple of four.
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], target: u32, component: u32, count: usize, kind: &str) -> usize {
        let view = self.view(bytes, Some(target));
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let bytes: Vec<u8> = positions.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let number = self.accessor(&bytes, ARRAY, FLOAT, positions.len(), "VEC3");
        let bound = |pick: fn(f32, f32) -> f32| {
            let first = positions.first().copied().unwrap_or_default();
            positions.iter().fold(first, |a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])])
        };
        self.accessors[number]["min"] = json!(bound(f32::min));
        self.accessors[number]["max"] = json!(bound(f32::max));
        number
    }
}

fn y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, z, -y]
}

/// A binary glTF file with the pictures as textures; `extras` says what the model's numbers mean.
pub fn textured(cloud: &DenseCloud, sheets: &[Sheet], extras: &Value) -> Vec<u8> {
    let mut parts = Parts::default();
    let (mut images, mut materials, mut primitives) = (Vec::new(), Vec::new(), Vec::new());
    for sheet in sheets {
        let positions: Vec<[f32; 3]> = sheet.points.iter().map(|&p| y_up(cloud.positions[p as usize])).collect();
        let position = parts.positions(&positions);
        let indices: Vec<u8> = sheet.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let indices = parts.accessor(&indices, ELEMENTS, UNSIGNED_INT, 3 * sheet.triangles.len(), "SCALAR");
        let mut surface = json!({ "metallicFactor": 0.0, "roughnessFactor": 1.0 });
        let mut attributes = json!({ "POSITION": position });
        if sheet.jpeg.is_empty() {
            surface["baseColorFactor"] = json!([0.5, 0.5, 0.5, 1.0]);
        } else {
            let uv: Vec<u8> = sheet.uv.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
            attributes["TEXCOORD_0"] = parts.accessor(&uv, ARRAY, FLOAT, sheet.uv.len(), "VEC2").into();
            let view = parts.view(&sheet.jpeg, None);
            surface["baseColorTexture"] = json!({ "index": images.len() });
            images.push(json!({ "bufferView": view, "mimeType": "image/jpeg" }));
        }
        primitives.push(json!({
            "attributes": attributes,
            "indices": indices,
            "material": materials.len(),
        }));
        materials.push(json!({ "pbrMetallicRoughness": surface, "doubleSided": true, "extensions": { "KHR_materials_unlit": {} } }));
    }
    let textures: Vec<Value> = (0..images.len()).map(|image| json!({ "source": image, "sampler": 0 })).collect();
    let mut document = document(&parts, &primitives, &materials, extras);
    if !images.is_empty() {
        document["images"] = images.into();
        document["textures"] = textures.into();
        // Linear, with mipmaps, clamped to the edge.
        document["samplers"] = json!([{ "magFilter": 9729, "minFilter": 9987, "wrapS": 33_071, "wrapT": 33_071 }]);
    }
    file(document, &parts.binary)
}

/// A binary glTF file in which each triangle has one colour: the mean of its three points (the thesis, 6.2).
pub fn patches(cloud: &DenseCloud, extras: &Value) -> Vec<u8> {
    let mut parts = Parts::default();
    let mut positions = Vec::with_capacity(3 * cloud.triangles.len());
    let mut colours = Vec::with_capacity(24 * cloud.triangles.len());
    for (triangle, colour) in cloud.triangles.iter().zip(cloud.patch_colours()) {
        // Vertex colours are linear light in glTF, and pictures are not.
        let [r, g, b] = colour.map(linear);
        for &point in triangle {
            positions.push(y_up(cloud.positions[point as usize]));
            colours.extend([r, g, b, u16::MAX].into_iter().flat_map(u16::to_le_bytes));
        }
    }
    let position = parts.positions(&positions);
    let colour = parts.accessor(&colours, ARRAY, UNSIGNED_SHORT, positions.len(), "VEC4");
    parts.accessors[colour]["normalized"] = true.into();
    let material = json!({
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        "doubleSided": true,
        "extensions": { "KHR_materials_unlit": {} },
    });
    let primitive = json!({ "attributes": { "POSITION": position, "COLOR_0": colour }, "material": 0 });
    file(document(&parts, &[primitive], &[material], extras), &parts.binary)
}

/// An sRGB level as linear light, 0 to 65,535 (IEC 61966-2-1).
fn linear(level: u8) -> u16 {
    let c = f64::from(level) / 255.0;
    let light = if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) };
    (light * 65_535.0 + 0.5) as u16
}

fn document(parts: &Parts, primitives: &[Value], materials: &[Value], extras: &Value) -> Value {
    json!({
        "asset": { "version": "2.0", "generator": concat!("daymark ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "building", "extras": extras }],
        "meshes": [{ "primitives": primitives }],
        "materials": materials,
        "accessors": parts.accessors,
        "bufferViews": parts.views,
        "extensionsUsed": ["KHR_materials_unlit"],
    })
}

fn file(mut document: Value, binary: &[u8]) -> Vec<u8> {
    document["buffers"] = json!([{ "byteLength": binary.len() }]);
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(length);
    bytes.extend(b"glTF");
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_slice()), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_and_black_stay_what_they_are() {
        assert_eq!((linear(0), linear(255)), (0, u16::MAX));
        // Half the light is level 188.
        assert!(linear(188).abs_diff(32_768) < 400, "{}", linear(188));
    }

    #[test]
    fn the_front_faces_plus_z() {
        assert_eq!(y_up([1.0, -2.0, 3.0]), [1.0, 3.0, 2.0]);
    }
}
