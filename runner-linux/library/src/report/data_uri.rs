//! Pictures inside documents: `data:` addresses (RFC 2397) with base64 (RFC 4648).

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::picture::GrayImage;

/// The picture as a PNG in a `data:` address; empty if it cannot be encoded, which a picture in memory always can.
pub fn png(image: &GrayImage) -> String {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    let encoded = encoder.write_image(&image.pixels, image.width as u32, image.height as u32, ExtendedColorType::L8);
    if encoded.is_ok() { format!("data:image/png;base64,{}", base64(&bytes)) } else { String::new() }
}

/// A PNG file in a `data:` address.
pub fn png_bytes(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(bytes))
}

/// The picture as a JPEG of medium quality in a `data:` address; about a tenth of the PNG.
pub fn jpeg(image: &GrayImage) -> String {
    let mut bytes = Vec::new();
    let encoded = JpegEncoder::new_with_quality(&mut bytes, 72).encode(
        &image.pixels,
        image.width as u32,
        image.height as u32,
        ExtendedColorType::L8,
    );
    if encoded.is_ok() { format!("data:image/jpeg;base64,{}", base64(&bytes)) } else { String::new() }
}

fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let group = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            let digit = (group >> (18 - 6 * place) & 63) as usize;
            text.push(if place <= chunk.len() { char::from(ALPHABET[digit]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_gives_the_vectors_of_rfc_4648() {
        let cases =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("fooba", "Zm9vYmE=")];
        for (bytes, text) in cases {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn a_picture_becomes_an_address() {
        let image = GrayImage { pixels: vec![9; 64], width: 8, height: 8 };
        // The signature of a PNG file, and of a JPEG file, in base64.
        assert!(png(&image).starts_with("data:image/png;base64,iVBORw0KGgo"));
        assert!(jpeg(&image).starts_with("data:image/jpeg;base64,/9j/"));
    }
}
