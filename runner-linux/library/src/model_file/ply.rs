//! Stanford PLY, binary little-endian: points with colour and standard deviation, faces with the mean colour of their
//! points (the thesis, 6.2).

use std::fmt::Write as _;

use super::points::{Points, gray_of};
use crate::synthesize::dense::DenseCloud;

/// The file; each of `comments` is one line of its header.
pub fn file(cloud: &DenseCloud, comments: &[String]) -> Vec<u8> {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    for comment in comments {
        // Writing to a string cannot fail.
        let _ = writeln!(header, "comment {}", comment.replace(|c: char| c.is_control(), " "));
    }
    let _ = write!(
        header,
        "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float deviation\n\
         element face {}\nproperty list uchar uint vertex_indices\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        cloud.positions.len(),
        cloud.triangles.len(),
    );
    let mut bytes = header.into_bytes();
    bytes.reserve(cloud.positions.len() * 19 + cloud.triangles.len() * 16);
    for ((position, rgb), deviation) in cloud.positions.iter().zip(&cloud.rgb).zip(&cloud.deviations) {
        bytes.extend(position.iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend(rgb);
        bytes.extend(deviation.to_le_bytes());
    }
    for (triangle, rgb) in cloud.triangles.iter().zip(cloud.patch_colours()) {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|point| point.to_le_bytes()));
        bytes.extend(rgb);
    }
    bytes
}

/// Points of a file, at most.
const MAX_POINTS: usize = 100_000_000;

/// Reads the points of a PLY file, binary little-endian or ASCII, whatever else it holds. If it has faces (lists of
/// corners), points that no face has are left out.
///
/// # Errors
/// What is wrong with the file.
pub fn read(bytes: &[u8]) -> Result<Points, String> {
    let (header, mut body) = header(bytes)?;
    let mut points = Points::default();
    let mut used: Option<Vec<bool>> = None;
    for element in &header.elements {
        let place = |name: &str| element.properties.iter().position(|property| property.name == name);
        let vertices = element.name == "vertex";
        let xyz = [place("x"), place("y"), place("z")];
        let rgb = [place("red"), place("green"), place("blue")];
        let deviation = place("deviation");
        let corners = place("vertex_indices").or(place("vertex_index")).filter(|_| element.name == "face");
        let mut values = vec![0.0; element.properties.len()];
        for _ in 0..element.count {
            for (number, property) in element.properties.iter().enumerate() {
                if let Some(count_kind) = property.list {
                    let count = body.next(count_kind)?;
                    for _ in 0..count as usize {
                        let value = body.next(property.kind)?;
                        if corners == Some(number) {
                            let marks = used.get_or_insert_with(|| vec![false; points.positions.len()]);
                            let mark = marks.get_mut(value as usize).ok_or("a face has a corner that is no point")?;
                            *mark = true;
                        }
                    }
                } else {
                    values[number] = body.next(property.kind)?;
                }
            }
            if vertices {
                let [Some(x), Some(y), Some(z)] = xyz else { return Err("its points have no x, y and z".to_owned()) };
                points.positions.push([values[x] as f32, values[y] as f32, values[z] as f32]);
                points.gray.push(match rgb {
                    [Some(r), Some(g), Some(b)] => (gray_of([values[r], values[g], values[b]]) / 255.0) as f32,
                    _ => f32::NAN,
                });
                points.deviations.push(deviation.map_or(0.0, |at| values[at] as f32));
            }
        }
    }
    if let Some(used) = used {
        let mut marks = used.iter();
        points.positions.retain(|_| *marks.next().unwrap_or(&true));
        let mut marks = used.iter();
        points.gray.retain(|_| *marks.next().unwrap_or(&true));
        let mut marks = used.iter();
        points.deviations.retain(|_| *marks.next().unwrap_or(&true));
    }
    if points.positions.is_empty() {
        return Err("it has no points".to_owned());
    }
    Ok(points)
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            other => return Err(format!("the type {other:?} is not known")),
        })
    }
}

struct Property {
    name: String,
    kind: Kind,
    list: Option<Kind>,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Header {
    elements: Vec<Element>,
}

enum Body<'b> {
    Binary(&'b [u8]),
    Text(std::str::SplitAsciiWhitespace<'b>),
}

impl Body<'_> {
    fn next(&mut self, kind: Kind) -> Result<f64, String> {
        match self {
            Self::Text(words) => {
                words.next().ok_or("it ends too early")?.parse().map_err(|_| "a value is no number".to_owned())
            }
            Self::Binary(bytes) => {
                fn take<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N], String> {
                    let (first, rest) = bytes.split_first_chunk::<N>().ok_or("it ends too early")?;
                    *bytes = rest;
                    Ok(*first)
                }
                Ok(match kind {
                    Kind::I8 => f64::from(i8::from_le_bytes(take(bytes)?)),
                    Kind::U8 => f64::from(u8::from_le_bytes(take(bytes)?)),
                    Kind::I16 => f64::from(i16::from_le_bytes(take(bytes)?)),
                    Kind::U16 => f64::from(u16::from_le_bytes(take(bytes)?)),
                    Kind::I32 => f64::from(i32::from_le_bytes(take(bytes)?)),
                    Kind::U32 => f64::from(u32::from_le_bytes(take(bytes)?)),
                    Kind::F32 => f64::from(f32::from_le_bytes(take(bytes)?)),
                    Kind::F64 => f64::from_le_bytes(take(bytes)?),
                })
            }
        }
    }
}

fn header(bytes: &[u8]) -> Result<(Header, Body<'_>), String> {
    const END: &[u8] = b"end_header";
    if !bytes.starts_with(b"ply") {
        return Err("it is no PLY file".to_owned());
    }
    let end = bytes.windows(END.len()).position(|window| window == END).ok_or("its header has no end")?;
    let text = std::str::from_utf8(&bytes[..end]).map_err(|_| "its header is no text".to_owned())?;
    let rest = bytes.get(end + END.len()..).unwrap_or_default();
    let line = rest.iter().position(|&byte| byte == b'\n').ok_or("its header has no end")?;
    let rest = &rest[line + 1..];
    let mut header = Header { elements: Vec::new() };
    let mut text_body = false;
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["format", "ascii", _] => text_body = true,
            ["format", "binary_little_endian", _] => text_body = false,
            ["format", other, ..] => {
                return Err(format!("the format {other} is not read here; use binary_little_endian"));
            }
            ["element", name, count] => {
                let count = count.parse().ok().filter(|count| *count <= MAX_POINTS).ok_or("a count is none")?;
                header.elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", count, kind, name] => {
                let element = header.elements.last_mut().ok_or("a property has no element")?;
                let (kind, list) = (Kind::of(kind)?, Some(Kind::of(count)?));
                element.properties.push(Property { name: (*name).to_owned(), kind, list });
            }
            ["property", kind, name] => {
                let element = header.elements.last_mut().ok_or("a property has no element")?;
                element.properties.push(Property { name: (*name).to_owned(), kind: Kind::of(kind)?, list: None });
            }
            _ => {}
        }
    }
    let body = if text_body {
        Body::Text(std::str::from_utf8(rest).map_err(|_| "it is not text".to_owned())?.split_ascii_whitespace())
    } else {
        Body::Binary(rest)
    };
    Ok((header, body))
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_core::mesh::SubdivisionLevel;

    fn cloud() -> DenseCloud {
        DenseCloud {
            level: SubdivisionLevel::ZERO,
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 2.0, 0.0], [9.0, 9.0, 9.0]],
            deviations: vec![0.1, 0.2, 0.3, 0.4],
            gray: vec![0.0; 4],
            rgb: vec![[0, 0, 0], [255, 255, 255], [255, 0, 0], [1, 2, 3]],
            triangles: vec![[0, 1, 2]],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let points = read(&file(&cloud(), &["one\nline".to_owned()])).unwrap();
        // The fourth point belongs to no face.
        assert_eq!(points.positions, cloud().positions[..3]);
        assert_eq!(points.deviations, [0.1, 0.2, 0.3]);
        assert_eq!((points.gray[0], points.gray[1]), (0.0, 1.0));
        assert!((points.gray[2] - 0.299).abs() < 1e-6);
    }

    #[test]
    fn cut_anywhere_it_is_an_error() {
        let bytes = file(&cloud(), &[]);
        for cut in 0..bytes.len() - 3 {
            assert!(read(&bytes[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn text_files_too() {
        let text = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\nend_header\n\
                    1 2 3\n4 5 6\n";
        let points = read(text.as_bytes()).unwrap();
        assert_eq!(points.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert!(points.gray[0].is_nan());
        assert!(read(text.replace("ascii", "binary_big_endian").as_bytes()).unwrap_err().contains("big_endian"));
        assert!(read(b"solid").is_err());
    }
}
