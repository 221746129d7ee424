//! Little-endian numbers off and onto the front of byte slices, and a fingerprint of bytes.

use crc::{Crc, NoTable};

/// Bit by bit: run at starts only, where a table would take a kilobyte of stack or flash.
static CRC_32: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// A fingerprint of a configuration's bytes: CRC-32, to see that two are the same.
pub fn fingerprint(bytes: &[u8]) -> u32 {
    CRC_32.checksum(bytes)
}

/// What is left of a message.
pub(crate) struct Reader<'a>(pub &'a [u8]);

impl Reader<'_> {
    /// The next `N` bytes; `None` past the end.
    pub fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk()?;
        self.0 = tail;
        Some(*head)
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub fn i16(&mut self) -> Option<i16> {
        self.take().map(i16::from_le_bytes)
    }

    /// Three bytes, signed.
    pub fn i24(&mut self) -> Option<i32> {
        // the sign is that of the highest byte
        self.take().map(|[a, b, c]| i32::from_le_bytes([0, a, b, c]) >> 8)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }
}

/// What is left of a buffer; bytes past its end are dropped, so sizes are fixed where it is declared.
pub(crate) struct Writer<'a>(pub &'a mut [u8]);

impl Writer<'_> {
    pub fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        if let Some((head, tail)) = core::mem::take(&mut self.0).split_first_chunk_mut() {
            *head = bytes;
            self.0 = tail;
        }
    }
}
