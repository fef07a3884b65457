//! Stanford PLY, binary little-endian: points with colour and standard deviation, faces with the mean colour of their
//! points (the thesis, 6.2).

use std::fmt::Write as _;

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
