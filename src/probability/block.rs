//! A probability table as bytes with a check sum.
//!
//! # Model
//! All numbers are little-endian.
//!
//! | bytes | |
//! |---|---|
//! | 4 | `VSPT` |
//! | 4 | layout, 1; steps of the grade, bins of range, bins of azimuth |
//! | 4 | fingerprint of configuration and estimator it was fitted with, see [`fitted_with`](super::fitted_with) |
//! | 11, 2 x 7, 2 x 7 | edges of grades, of ranges (centimetres), of azimuths (2^-16 turn, signed) |
//! | 12 x 8 x 8 | probabilities in 1/255: grades within ranges within azimuths |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it |

use super::{AZIMUTHS, Edges, GRADES, ProbabilityTable, RANGES, TableError};
use crate::fixed::bytes::{Reader, Writer, fingerprint};

const MAGIC: [u8; 4] = *b"VSPT";
#[allow(clippy::cast_possible_truncation)] // 12, 8, 8
const LAYOUT: [u8; 4] = [1, GRADES as u8, RANGES as u8, AZIMUTHS as u8];
const SUM_LEN: usize = 4;

/// Length of a table in bytes.
pub const BLOCK_LEN: usize =
    12 + (GRADES - 1) + 2 * (RANGES - 1) + 2 * (AZIMUTHS - 1) + GRADES * RANGES * AZIMUTHS + SUM_LEN;

const _: () = assert!(BLOCK_LEN <= 1024);

impl ProbabilityTable {
    /// The table as bytes.
    pub fn to_block(&self) -> [u8; BLOCK_LEN] {
        let mut block = [0; BLOCK_LEN];
        let mut w = Writer(&mut block);
        w.put(MAGIC);
        w.put(LAYOUT);
        w.put(self.fingerprint.to_le_bytes());
        w.put(self.edges.grades);
        self.edges.ranges_cm.iter().for_each(|edge| w.put(edge.to_le_bytes()));
        self.edges.azimuths.iter().for_each(|edge| w.put(edge.to_le_bytes()));
        self.values.as_flattened().iter().for_each(|steps| w.put(*steps));
        if let Some((body, sum)) = block.split_last_chunk_mut::<SUM_LEN>() {
            *sum = fingerprint(body).to_le_bytes();
        }
        block
    }

    /// By which it is known: the check sum of its bytes without the block's own, over which one is the same for
    /// every table.
    pub fn check_sum(&self) -> u32 {
        let block = self.to_block();
        fingerprint(block.split_last_chunk::<SUM_LEN>().map_or(&[], |(body, _)| body))
    }

    /// Reads a table; bytes after it do not matter.
    ///
    /// # Errors
    /// The first thing that does not hold.
    pub fn from_block(bytes: &[u8]) -> Result<Self, TableError> {
        let mut reader = Reader(bytes);
        match reader.take::<4>() {
            Some(MAGIC) => {}
            Some(_) => return Err(TableError::Empty),
            None => return Err(TableError::Short),
        }
        if reader.take().ok_or(TableError::Short)? != LAYOUT {
            return Err(TableError::Layout);
        }
        let block = bytes.get(..BLOCK_LEN).ok_or(TableError::Short)?;
        let (body, sum) = block.split_last_chunk::<SUM_LEN>().ok_or(TableError::Short)?;
        if fingerprint(body) != u32::from_le_bytes(*sum) {
            return Err(TableError::CheckSum);
        }
        Self::read(&mut reader).ok_or(TableError::Short)?
    }

    fn read(reader: &mut Reader) -> Option<Result<Self, TableError>> {
        let unit = reader.u32()?;
        let mut edges = Edges { grades: reader.take()?, ranges_cm: [0; RANGES - 1], azimuths: [0; AZIMUTHS - 1] };
        for edge in &mut edges.ranges_cm {
            *edge = reader.u16()?;
        }
        for edge in &mut edges.azimuths {
            *edge = reader.i16()?;
        }
        let mut values = [[[0; GRADES]; RANGES]; AZIMUTHS];
        for steps in values.as_flattened_mut() {
            *steps = reader.take()?;
        }
        Some(Self::new(edges, values, unit))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{edges, values};
    use super::*;

    #[test]
    fn a_table_comes_back_from_its_bytes_and_fits_a_kilobyte() {
        let table = ProbabilityTable::new(edges(), values(), 0x1234_5678).unwrap();
        let block = table.to_block();
        assert_eq!((block.len(), &block[..12]), (823, &b"VSPT\x01\x0c\x08\x08\x78\x56\x34\x12"[..]));
        assert_eq!(ProbabilityTable::from_block(&block), Ok(table));
    }

    #[test]
    fn bytes_that_are_no_table_are_refused_by_what_is_wrong() {
        let block = ProbabilityTable::new(edges(), values(), 1).unwrap().to_block();
        let refused = |bytes: &[u8]| ProbabilityTable::from_block(bytes).unwrap_err();
        assert_eq!(refused(&[0xFF; BLOCK_LEN]), TableError::Empty);
        for cut in [0, 3, 7, 100, BLOCK_LEN - 1] {
            assert_eq!(refused(&block[..cut]), TableError::Short, "{cut}");
        }
        let mut other = block;
        other[4] = 2;
        assert_eq!(refused(&other), TableError::Layout);
        for at in [9, 20, 60, 500, BLOCK_LEN - 1] {
            let mut damaged = block;
            damaged[at] ^= 1;
            assert_eq!(refused(&damaged), TableError::CheckSum, "{at}");
        }
        // whole, but never made by `new`
        let mut falls = block;
        falls[51 + GRADES] = 255;
        let sum = fingerprint(&falls[..BLOCK_LEN - SUM_LEN]).to_le_bytes();
        falls[BLOCK_LEN - SUM_LEN..].copy_from_slice(&sum);
        assert_eq!(refused(&falls), TableError::NotMonotone { azimuth: 0, range: 1 });
    }
}
