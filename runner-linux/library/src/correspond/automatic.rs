//! Corners of a picture, found as `daymark recognize` finds them.

use daymark_core::extract::FrontEnd;
use daymark_core::image::FrameError;
use daymark_core::point::ImagePoint;
use daymark_engine::reader::FrameReader;

use super::MOST_CORNERS;
use crate::order;
use crate::picture::GrayImage;
use crate::simd::Processor;

/// Corners of a picture if nothing else is asked for: of 100, 150 and 200 the number that led to most right matches on
/// neighbouring photographs (`daymark study repeatability --scenes photos --corners-per-image N`).
pub const CORNERS_PER_IMAGE: usize = 150;
/// What a cell of the picture may contribute before every cell had its turn, in tenths of an even share. So much that
/// nearly the strongest of the whole picture are taken: those that fill an empty sky are not found again.
const CELL_SHARE_TENTHS: u16 = 60;
/// The finest pyramid level's share of the features that an extractor is asked for, in 1/10,000.
const FINEST_SHARE: usize = 4_739;
/// Features that are asked for, at most.
const MOST_FEATURES: usize = MOST_CORNERS * 10_000 / FINEST_SHARE + 1;
const FRONT_END: FrontEnd = FrontEnd { features: MOST_FEATURES as u16, cell_share_tenths: CELL_SHARE_TENTHS };

/// The strongest corners of the finest pyramid level, at most `count`, in the order of places (x, then y). Coarser levels
/// find the same corners a second time, a pixel or two away, which places alone cannot tell apart.
///
/// # Errors
/// [`FrameError`] for a picture beyond core's limits.
pub fn corners(image: &GrayImage, count: usize) -> Result<Vec<ImagePoint>, FrameError> {
    let count = count.min(MOST_CORNERS);
    let mut reader = FrameReader::new(Processor::detect());
    let front_end = FrontEnd { features: (count * 10_000 / FINEST_SHARE + 1) as u16, ..FRONT_END };
    let features = reader.read(image, front_end)?;
    let finest = features.iter().filter(|feature| feature.level == 0).take(count);
    let mut corners: Vec<ImagePoint> = finest.map(|feature| feature.position).collect();
    order::sort(&mut corners);
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_as_were_asked_for_are_found_and_all_of_them_differ() {
        let pixels = (0..240_u32 * 320).map(|at| (at.wrapping_mul(0x9E37_79B1) >> 24) as u8).collect();
        let image = GrayImage { pixels, width: 320, height: 240 };
        for count in [4, 50, 150, MOST_CORNERS] {
            let found = corners(&image, count).unwrap();
            assert!(found.len() * 100 >= count * 95 && found.len() <= count, "{} of {count}", found.len());
            assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
