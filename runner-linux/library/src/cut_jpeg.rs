//! Whether a JPEG file ends before its picture does. The decoder fills what is missing with gray and says nothing.

/// Start of image.
const SOI: u8 = 0xD8;
/// End of image.
const EOI: u8 = 0xD9;

/// True for a JPEG file without the marker that ends its picture (ITU-T T.81, annex B). What follows the picture, and
/// a thumbnail in a segment before it, do not matter. False for files of other kinds.
pub(crate) fn is_cut_jpeg(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.strip_prefix(&[0xFF, SOI]) else { return false };
    loop {
        // To the next marker: over entropy-coded data with its stuffed zeros, restart markers, and fill bytes.
        let Some(at) = rest.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xD0..=0xD7 | 0xFF))
        else {
            return true;
        };
        let marker = rest[at + 1];
        rest = &rest[at + 2..];
        if marker == EOI {
            return false;
        }
        let Some((&length, _)) = rest.split_first_chunk() else { return true };
        // The length counts itself.
        let Some(after) = rest.get(usize::from(u16::from_be_bytes(length))..) else { return true };
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_marker_that_ends_the_picture_counts() {
        let thumbnail = [0xFF, 0xE1, 0, 6, 0xFF, SOI, 0xFF, EOI];
        let scan = [0xFF, 0xDA, 0, 3, 9, 1, 0xFF, 0, 2, 0xFF, 0xD3, 3];
        let whole = [&[0xFF, SOI], thumbnail.as_slice(), &scan, &[0xFF, EOI]].concat();
        assert!(!is_cut_jpeg(&whole));
        assert!(!is_cut_jpeg(&[&whole, b"more".as_slice()].concat()));
        for length in 2..whole.len() {
            assert!(is_cut_jpeg(&whole[..length]), "{length}");
        }
        assert!(!is_cut_jpeg(b"P5 1 1 255 "));
    }
}
