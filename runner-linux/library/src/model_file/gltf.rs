//! glTF 2.0, binary form (Khronos, "glTF 2.0 Specification", chapter 4).
//!
//! glTF has y up and the front towards +z: a point `(x, y, z)` of the model (z up, front towards -y) is written as
//! `(x, z, -y)`. Lengths stay in the model's unit; glTF reads them as metres.

use serde_json::{Value, json};

use super::points::{Points, Texture, gray_of};
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

/// Reads the points of a binary glTF file, as this program writes it: meshes without transforms, with a texture or colours
/// at their points, everything in the file's own buffer.
///
/// # Errors
/// What is wrong with the file, or beyond that.
pub fn read(bytes: &[u8]) -> Result<Points, String> {
    let file = Read::new(bytes)?;
    let moved = |node: &Value| ["matrix", "translation", "rotation", "scale"].iter().any(|key| node.get(key).is_some());
    if list(&file.document["nodes"]).any(moved) {
        return Err("its nodes have transforms, which are not read here: apply them first".to_owned());
    }
    let mut points = Points::default();
    for primitive in list(&file.document["meshes"]).flat_map(|mesh| list(&mesh["primitives"])) {
        let attributes = &primitive["attributes"];
        let positions = file.accessor(&attributes["POSITION"], FLOAT, "VEC3")?;
        let gray = file.gray_levels(primitive, positions.len() / 12)?;
        let number = |bytes: &[u8]| bytes.first_chunk::<4>().map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes));
        for (position, gray) in positions.chunks_exact(12).zip(gray) {
            let [x, y, z] = [0, 4, 8].map(|at| position.get(at..).map_or(f32::NAN, number));
            points.positions.push([x, -z, y]);
            points.gray.push(gray);
            points.deviations.push(0.0);
        }
    }
    let points = points.joined();
    if points.positions.is_empty() { Err("it has no points".to_owned()) } else { Ok(points) }
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// A file while it is read.
struct Read<'b> {
    document: Value,
    binary: &'b [u8],
}

impl<'b> Read<'b> {
    fn new(bytes: &'b [u8]) -> Result<Self, String> {
        let rest = bytes.strip_prefix(b"glTF").ok_or("it is no binary glTF file")?;
        let word = |at: usize| Some(u32::from_le_bytes(*rest.get(at..)?.first_chunk::<4>()?) as usize);
        if word(0) != Some(2) {
            return Err("it is no glTF of version 2".to_owned());
        }
        let chunk = |at: usize| -> Option<(&'b [u8], usize)> {
            let (length, begin) = (word(at)?, at + 8);
            Some((rest.get(begin..begin.checked_add(length)?)?, begin + length))
        };
        let (text, next) = chunk(8).ok_or("it ends too early")?;
        let document = serde_json::from_slice(text).map_err(|error| format!("its JSON: {error}"))?;
        let binary = if rest.len() > next { chunk(next).ok_or("it ends too early")?.0 } else { &[] };
        Ok(Self { document, binary })
    }

    fn view(&self, number: &Value) -> Result<&'b [u8], String> {
        let view = number.as_u64().and_then(|number| self.document["bufferViews"].get(number as usize));
        let view = view.ok_or("a part of its buffer is not described")?;
        let place = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        if place("buffer") != 0 || place("byteStride") != 0 {
            return Err("its points are in other files or between other values, which is not read here".to_owned());
        }
        let (begin, length) = (place("byteOffset"), place("byteLength"));
        begin
            .checked_add(length)
            .and_then(|end| self.binary.get(begin..end))
            .ok_or_else(|| "it ends too early".to_owned())
    }

    /// The bytes of an accessor of this kind.
    fn accessor(&self, number: &Value, component: u32, kind: &str) -> Result<&'b [u8], String> {
        let accessor = number.as_u64().and_then(|number| self.document["accessors"].get(number as usize));
        let accessor = accessor.ok_or("its points are not described")?;
        if accessor["componentType"] != component || accessor["type"] != kind || accessor.get("sparse").is_some() {
            return Err(format!("its values are not {kind} of the type {component}"));
        }
        let size = if component == FLOAT { 4 } else { 2 };
        let parts = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let begin = accessor["byteOffset"].as_u64().unwrap_or(0) as usize;
        let length = (accessor["count"].as_u64().unwrap_or(0) as usize).saturating_mul(size * parts);
        let view = self.view(&accessor["bufferView"])?;
        view.get(begin..)
            .and_then(|rest| rest.get(..length))
            .ok_or_else(|| "it has more points than bytes for them".to_owned())
    }

    /// The gray levels of a primitive's points: of its texture or its colours, NaN without either.
    fn gray_levels(&self, primitive: &Value, count: usize) -> Result<Vec<f32>, String> {
        let attributes = &primitive["attributes"];
        if attributes.get("COLOR_0").is_some() {
            let colours = self.accessor(&attributes["COLOR_0"], UNSIGNED_SHORT, "VEC4")?;
            let channel = |bytes: &[u8]| bytes.first_chunk::<2>().map_or(0, |bytes| u16::from_le_bytes(*bytes));
            let gray = |colour: &[u8]| gray_of([0, 2, 4].map(|at| level(colour.get(at..).map_or(0, channel)))) as f32;
            return Ok(colours.chunks_exact(8).map(gray).collect());
        }
        let material = primitive["material"].as_u64().and_then(|at| self.document["materials"].get(at as usize));
        let texture = material.map(|material| &material["pbrMetallicRoughness"]["baseColorTexture"]["index"]);
        let Some(texture) = texture.and_then(Value::as_u64) else { return Ok(vec![f32::NAN; count]) };
        let source = &self.document["textures"][texture as usize]["source"];
        let image = source.as_u64().map(|at| &self.document["images"][at as usize]["bufferView"]);
        let texture = Texture::decode(self.view(image.unwrap_or(&Value::Null))?)?;
        let uv = self.accessor(&attributes["TEXCOORD_0"], FLOAT, "VEC2")?;
        let number = |bytes: &[u8]| bytes.first_chunk::<4>().map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes));
        let gray = |uv: &[u8]| texture.gray_at([0, 4].map(|at| uv.get(at..).map_or(f32::NAN, number)));
        Ok(uv.chunks_exact(8).map(gray).collect())
    }
}

/// Linear light, 0 to 65,535, as an sRGB level, 0 to 1: the inverse of [`linear`].
fn level(light: u16) -> f64 {
    let c = f64::from(light) / 65_535.0;
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 }
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

    fn cloud() -> DenseCloud {
        DenseCloud {
            level: daymark_core::mesh::SubdivisionLevel::ZERO,
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]],
            deviations: vec![0.1; 4],
            gray: vec![0.0; 4],
            rgb: vec![[30, 30, 30], [60, 60, 60], [90, 90, 90], [150, 150, 150]],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let points = read(&patches(&cloud(), &Value::Null)).unwrap();
        assert_eq!(points.positions, cloud().positions);
        // The triangles are 60 and 100 of 255; points of both are in between.
        for (gray, level) in points.gray.iter().zip([60.0, 80.0, 80.0, 100.0]) {
            assert!((gray * 255.0 - level).abs() < 0.1, "{gray} {level}");
        }
        let mut jpeg = Vec::new();
        let picture = image::GrayImage::from_fn(32, 32, |x, _| image::Luma([if x < 16 { 64 } else { 192 }]));
        picture.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).unwrap();
        let sheet = Sheet {
            view: Some(0),
            points: vec![0, 1, 2, 3],
            uv: vec![[0.1, 0.5], [0.9, 0.5], [0.1, 0.9], [0.9, 0.1]],
            triangles: cloud().triangles,
            jpeg,
        };
        let file = textured(&cloud(), &[sheet], &Value::Null);
        let points = read(&file).unwrap();
        assert_eq!(points.positions, cloud().positions);
        for (gray, level) in points.gray.iter().zip([64.0, 192.0, 64.0, 192.0]) {
            assert!((gray * 255.0 - level).abs() < 4.0, "{gray} {level}");
        }
        for cut in (0..file.len() - 4).step_by(7) {
            assert!(read(&file[..cut]).is_err(), "{cut}");
        }
    }
}
