//! A number that differs when any cell of a map does.

use crate::camera::map::CameraMap;
use crate::map::polar::PolarMap;

/// A map as rows of cells: what is compared, and sent cell by cell where it differs.
pub trait Rows {
    /// Cells of a row, and rows.
    const SHAPE: [usize; 2];
    /// Grades and occupancy of a row.
    fn row(&self, row: usize) -> Option<(&[u8], &[u8])>;
    /// Least grade that counts as visible.
    fn visible_from(&self) -> u8;
}

impl<const R: usize, const A: usize> Rows for PolarMap<R, A> {
    const SHAPE: [usize; 2] = [R, A];

    fn row(&self, azimuth: usize) -> Option<(&[u8], &[u8])> {
        Some((self.grades(azimuth)?, self.occupancy(azimuth)?))
    }

    fn visible_from(&self) -> u8 {
        Self::visible_from(self)
    }
}

impl<const NX: usize, const NY: usize> Rows for CameraMap<NX, NY> {
    const SHAPE: [usize; 2] = [NY, NX];

    fn row(&self, row: usize) -> Option<(&[u8], &[u8])> {
        let (grades, occupancy) = Self::row(self, row)?;
        Some((grades, occupancy))
    }

    fn visible_from(&self) -> u8 {
        self.thresholds()[0]
    }
}

/// FNV-1a in 64 bits, fed with words of four bytes.
///
/// # References
/// Fowler, Noll, Vo: draft-eastlake-fnv.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint(u64);

const OFFSET_BASIS: u64 = 0xCBF2_9CE4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01B3;

impl Default for Fingerprint {
    fn default() -> Self {
        Self(OFFSET_BASIS)
    }
}

impl Fingerprint {
    /// Of all grades, occupancies and bits of a map.
    pub fn of_map<M: Rows>(map: &M) -> Self {
        let mut fingerprint = Self::default();
        let [_, rows] = M::SHAPE;
        for row in 0..rows {
            if let Some((grades, occupancy)) = map.row(row) {
                fingerprint.bytes(grades);
                fingerprint.bytes(occupancy);
                fingerprint.bits(grades, map.visible_from());
            }
        }
        fingerprint
    }

    /// Takes in bytes; a last word that is not full is filled with zeros.
    pub fn bytes(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks::<4>();
        for word in words {
            self.word(u32::from_le_bytes(*word));
        }
        if !rest.is_empty() {
            self.word(rest.iter().rev().fold(0, |w, b| (w << 8) | u32::from(*b)));
        }
    }

    fn bits(&mut self, grades: &[u8], visible_from: u8) {
        for group in grades.chunks(32) {
            self.word(group.iter().fold(0, |w, grade| (w << 1) | u32::from(*grade >= visible_from)));
        }
    }

    /// Takes in a word.
    #[inline]
    pub fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ u64::from(word)).wrapping_mul(PRIME);
    }

    /// The number.
    pub const fn value(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::axes::Axes;
    use crate::sensor::field_of_view::tests::VIEW;
    use crate::sensor::mount::Mount;

    fn map(visible_from: u8) -> PolarMap<50, 3> {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let levelling = mount.levelling().unwrap();
        let axes = Axes::<50, 3, 4>::new(&levelling, &VIEW, 1.0).unwrap();
        PolarMap::unknown(axes.polar(&levelling), visible_from, 128)
    }

    #[test]
    fn every_cell_counts() {
        let empty = Fingerprint::of_map(&map(128));
        for a in 0..3 {
            for r in 0..50 {
                let mut m = map(128);
                m.rows_mut(a).unwrap().0[r] = 1;
                let graded = Fingerprint::of_map(&m);
                let mut m = map(128);
                m.rows_mut(a).unwrap().1[r] = 1;
                assert_ne!(graded, empty);
                assert_ne!(Fingerprint::of_map(&m), empty);
                assert_ne!(Fingerprint::of_map(&m), graded);
            }
        }
    }

    #[test]
    fn the_threshold_counts_where_it_changes_a_bit() {
        let of = |threshold| {
            let mut m = map(threshold);
            m.rows_mut(1).unwrap().0[7] = 100;
            Fingerprint::of_map(&m)
        };
        assert_ne!(of(100), of(101));
        assert_eq!(of(101), of(102));
    }
}
