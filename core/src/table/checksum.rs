//! The two checksums of a table, and the bytes of its fixed parts.

use core::fmt;
use crc::{CRC_32_ISO_HDLC, CRC_64_XZ, Crc, Digest};

static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
static CRC64: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// CRC-32/ISO-HDLC of the parts, one after the other: "123456789" gives `cbf43926`.
pub(super) fn crc32(parts: &[&[u8]]) -> u32 {
    let mut digest = CRC32.digest();
    for part in parts {
        digest.update(part);
    }
    digest.finalize()
}

/// The table id in the making: CRC-64/XZ of the index, then of the header's first 28 bytes. "123456789" gives
/// `995dc9bbdf1939fa`.
#[derive(Clone)]
pub(super) struct TableId(Digest<'static, u64>);

impl TableId {
    pub(super) fn new() -> Self {
        Self(CRC64.digest())
    }

    pub(super) fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    pub(super) fn finish(self) -> u64 {
        self.0.finalize()
    }
}

impl fmt::Debug for TableId {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("TableId(..)")
    }
}

/// The parts one after the other; what is missing at the end stays zero, what is too much is left out. The callers'
/// parts add up to `BYTES`.
pub(super) fn joined<const BYTES: usize>(parts: &[&[u8]]) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    for (slot, byte) in bytes.iter_mut().zip(parts.iter().copied().flatten()) {
        *slot = *byte;
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::{TableId, crc32};

    #[test]
    fn checksums_are_the_catalogued_ones() {
        assert_eq!(crc32(&[b"1234", b"56789"]), 0xCBF4_3926);
        let mut id = TableId::new();
        id.update(b"1234");
        id.update(b"56789");
        assert_eq!(id.finish(), 0x995D_C9BB_DF19_39FA);
    }
}
