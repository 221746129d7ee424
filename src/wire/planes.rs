//! Maps as rays: what a broadcaster reads.

use super::code::ray::{Known, Ray};
use super::message::Plane;
use crate::camera::map::{CameraMap, Layer};
use crate::fixed::bits::Bits;
use crate::map::bitmap::VisibilityBitmap;
use crate::map::polar::PolarMap;
use crate::probability::Quantiser;

/// A map of one or more planes.
pub trait Planes<const W: usize> {
    /// The ray of an azimuth; unknown where the map has no such plane. Cells between the first and the
    /// last known one count as known.
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W>;
}

impl<const R: usize, const A: usize, const W: usize> Planes<W> for VisibilityBitmap<R, A> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let row = self.rows().get(azimuth).filter(|_| plane == Plane::Visibility);
        row.map_or(Ray::UNKNOWN, |row| Ray::of(row).0)
    }
}

impl<const R: usize, const A: usize, const W: usize> Planes<W> for PolarMap<R, A> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let Some((grades, occupancy)) = self.grades(azimuth).zip(self.occupancy(azimuth)) else { return Ray::UNKNOWN };
        ray_of(plane, grades, self.visible_from(), || at_least(occupancy, self.occupied_from()))
    }
}

/// A polar map whose bits are by a table of probabilities.
#[derive(Debug, Clone, Copy)]
pub struct Quantised<'a, const R: usize, const A: usize> {
    /// The map.
    pub map: &'a PolarMap<R, A>,
    /// The table.
    pub quantiser: &'a Quantiser,
}

impl<const R: usize, const A: usize, const W: usize> Planes<W> for Quantised<'_, R, A> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let clear = match plane {
            Plane::Visibility => false,
            Plane::Grade => true,
            Plane::Occupancy => return self.map.ray(plane, azimuth),
        };
        // what is known has a probability: beyond an unknown cell nothing counts as known
        let known = self.map.grades(azimuth).map_or(Known::NONE, |grades| {
            let known = known_of(grades);
            let hole =
                grades.get(known.near()..known.end()).and_then(|known| known.iter().position(|grade| *grade == 0));
            hole.map_or(known, |hole| Known::new(known.near(), known.near() + hole))
        });
        Ray::new(known, self.quantiser.along(self.map, azimuth, clear))
    }
}

/// The polar map around the camera: each of its cells is what the camera's nearest one is.
impl<const NX: usize, const NY: usize, const W: usize> Planes<W> for CameraMap<NX, NY> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let [visible_from, occupied_from] = self.thresholds();
        let along = |layer| {
            let mut cells = [[0; 32]; W];
            if let Some(cells) = cells.as_flattened_mut().get_mut(..NX) {
                self.along(azimuth, layer, cells);
            }
            cells
        };
        ray_of(plane, along(Layer::Grades).as_flattened(), visible_from, || {
            at_least(along(Layer::Occupancy).as_flattened(), occupied_from)
        })
    }
}

/// The ray of one azimuth's grades and, where it is asked for, its occupied cells.
#[inline]
fn ray_of<const W: usize>(plane: Plane, grades: &[u8], visible: u8, occupied: impl FnOnce() -> Bits<W>) -> Ray<W> {
    let known = known_of(grades);
    if known.is_empty() {
        return Ray::UNKNOWN;
    }
    let bits = match plane {
        // above unknown, so known
        Plane::Visibility => return Ray::within(known, at_least(grades, visible)),
        Plane::Grade => {
            // the upper halves of both classes
            let (clear, nearly) = (visible.midpoint(u8::MAX), visible.midpoint(1));
            let (clear, below) = (at_least::<W>(grades, clear), at_least::<W>(grades, nearly));
            let upper = at_least::<W>(grades, visible);
            let words = clear.words().iter().zip(below.words()).zip(upper.words());
            let mut all = [0; W];
            all.iter_mut().zip(words).for_each(|(to, ((clear, below), upper))| *to = clear | (below & !upper));
            Bits::from_words(all)
        }
        Plane::Occupancy => occupied(),
    };
    Ray::new(known, bits)
}

/// From the first known cell to the last.
#[inline]
fn known_of(grades: &[u8]) -> Known {
    let limits = first_above_0(grades).zip(grades.iter().rposition(|grade| *grade > 0));
    limits.map_or(Known::NONE, |(near, last)| Known::new(near, last + 1))
}

/// The first cell whose value is above 0, eight at a time.
fn first_above_0(cells: &[u8]) -> Option<usize> {
    let (eights, rest) = cells.as_chunks::<8>();
    for (place, eight) in eights.iter().enumerate() {
        let eight = u64::from_le_bytes(*eight);
        if eight != 0 {
            return Some(8 * place + eight.trailing_zeros() as usize / 8);
        }
    }
    rest.iter().position(|cell| *cell > 0).map(|place| 8 * eights.len() + place)
}

/// Cells whose value reaches a threshold.
fn at_least<const W: usize>(cells: &[u8], threshold: u8) -> Bits<W> {
    let mut words = [0; W];
    // most often all are like the one before
    let (mut before, mut all) = (0, if threshold == 0 { u32::MAX } else { 0 });
    let (chunks, rest) = cells.as_chunks::<32>();
    for (word, chunk) in words.iter_mut().zip(chunks) {
        let (eights, _) = chunk.as_chunks();
        if !eights.iter().all(|eight| u64::from_le_bytes(*eight) == before) {
            all = eights.iter().rev().fold(0, |bits, eight| bits << 8 | reached(*eight, threshold));
            before = u64::from(chunk[31]) * EACH;
            *word = all;
            all = if all >> 31 == 1 { u32::MAX } else { 0 };
        } else {
            *word = all;
        }
    }
    if let Some(word) = words.get_mut(chunks.len()) {
        for (place, cells) in rest.chunks(8).enumerate() {
            let mut eight = [0; 8];
            eight.iter_mut().zip(cells).for_each(|(to, from)| *to = *from);
            *word |= reached(eight, threshold) << (8 * place);
        }
    }
    Bits::from_words(words)
}

/// 1 in each of eight bytes.
const EACH: u64 = 0x0101_0101_0101_0101;

/// A bit for each of eight cells.
#[allow(clippy::cast_possible_truncation)] // eight bits are left
#[inline]
fn reached(cells: [u8; 8], threshold: u8) -> u32 {
    const HIGH: u64 = 0x80 * EACH;
    let cells = u64::from_le_bytes(cells);
    // added to a cell's lower seven bits, this carries into the highest where they reach the threshold's
    let low = (cells & !HIGH) + u64::from(128 - (threshold & 0x7F)) * EACH;
    // a threshold of 128 and more takes the cell's highest bit, too, a smaller one is content with it
    let reached = if threshold < 128 { cells | low } else { cells & low };
    // the highest bits of all bytes side by side
    (((reached & HIGH) >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::map::Visibility;
    use crate::map::polar::PolarGeometry;
    use crate::probability::{Edges, ProbabilityTable, Threshold};
    use crate::sensor::mount::Levelling;
    use crate::sensor::road::RoadPoint;

    fn map() -> PolarMap<40, 2> {
        let geometry = PolarGeometry {
            levelling: Levelling::on_road(RoadPoint::new(0, 0), 600, Angle::from_raw(0)),
            cell_cm: 100,
            azimuth_origin: Angle::from_raw(-1000),
            azimuth_span: 2000,
            narrow: crate::map::azimuths::Narrow::NONE,
        };
        let mut map = PolarMap::unknown(geometry, 128, 100);
        let (grades, occupancy) = map.rows_mut(1).unwrap();
        grades[3..8].copy_from_slice(&[1, 64, 65, 128, 255]);
        grades[33] = 192;
        (occupancy[4], occupancy[5]) = (99, 100);
        map
    }

    #[test]
    fn planes_are_the_bits_of_the_cells() {
        let cells = |plane| -> std::vec::Vec<usize> { Planes::<2>::ray(&map(), plane, 1).bits().iter().collect() };
        assert_eq!(cells(Plane::Visibility), [6, 7, 33]);
        assert_eq!(cells(Plane::Grade), [4, 5, 7, 33], "nearly visible, and clear");
        assert_eq!(cells(Plane::Occupancy), [5]);
        assert_eq!(Planes::<2>::ray(&map(), Plane::Visibility, 1).known, Known::new(3, 34));
        assert_eq!(Planes::<2>::ray(&map(), Plane::Visibility, 0), Ray::UNKNOWN);
        assert_eq!(Planes::<2>::ray(&map(), Plane::Visibility, 2), Ray::UNKNOWN);
    }

    #[test]
    fn many_cells_at_a_time_say_what_one_says() {
        for threshold in 1..=255 {
            // all values, and stretches of the same
            let value = |i: u32| if i % 100 < 36 { 40 * (i / 100) } else { 37 * i + u32::from(threshold) };
            let cells: std::vec::Vec<u8> = (0..603_u32).map(|i| value(i) as u8).collect();
            let bits = at_least::<19>(&cells, threshold);
            let expected: std::vec::Vec<usize> = (0..603).filter(|i| cells[*i] >= threshold).collect();
            assert_eq!(bits.iter().collect::<std::vec::Vec<_>>(), expected, "{threshold}");
        }
        for first in 0..20 {
            let cells: std::vec::Vec<u8> = (0..20).map(|i| u8::from(i >= first) * 3).collect();
            assert_eq!(first_above_0(&cells), Some(first));
        }
        assert_eq!((first_above_0(&[0; 20]), first_above_0(&[])), (None, None));
    }

    #[test]
    fn with_a_table_nothing_counts_as_known_beyond_an_unknown_cell() {
        let edges = Edges {
            grades: core::array::from_fn(|k| 60 + k as u8),
            ranges_cm: core::array::from_fn(|k| 30_000 + k as u16),
            azimuths: core::array::from_fn(|k| k as i16 - 7),
        };
        let table = ProbabilityTable::new(edges, [[[10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120]; 8]; 8], 0);
        let quantiser = Quantiser::new(table.unwrap(), Some(Threshold::From(60)), 0);
        let map = map();
        let ray = |plane| Planes::<2>::ray(&Quantised { map: &map, quantiser: &quantiser }, plane, 1);
        // grades 1, 64, 65, 128, 255 from cell 3 on, and 192 in cell 33
        let cells = |plane| -> std::vec::Vec<usize> { ray(plane).bits().iter().collect() };
        assert_eq!(ray(Plane::Visibility).known, Known::new(3, 8));
        assert_eq!((cells(Plane::Visibility), cells(Plane::Grade)), (std::vec![4, 5, 6, 7], std::vec![6, 7]));
    }

    #[test]
    fn a_bitmap_says_the_same_as_its_map() {
        let bitmap = VisibilityBitmap::of(&map());
        for azimuth in 0..2 {
            let (of_bitmap, of_map): (Ray<2>, Ray<2>) =
                (bitmap.ray(Plane::Visibility, azimuth), map().ray(Plane::Visibility, azimuth));
            assert_eq!(of_bitmap, of_map);
        }
        assert_eq!(bitmap.cell(1, 20), Visibility::Unknown, "a hole");
        assert_eq!(Planes::<2>::ray(&bitmap, Plane::Occupancy, 1), Ray::UNKNOWN);
    }
}
