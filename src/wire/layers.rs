//! Maps as rays: what a broadcaster reads.

use super::code::ray::{Known, Ray};
use super::message::Plane;
use crate::bitmap::VisibilityBitmap;
use crate::bits::Bits;
use crate::polar::PolarMap;

/// A map of one or more planes.
pub trait Layers<const W: usize> {
    /// The ray of an azimuth; unknown where the map has no such plane. Cells between the first and the
    /// last known one count as known.
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W>;
}

impl<const R: usize, const A: usize, const W: usize> Layers<W> for VisibilityBitmap<R, A> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let row = self.rows().get(azimuth).filter(|_| plane == Plane::Visibility);
        row.map_or(Ray::UNKNOWN, |row| Ray::of(row).0)
    }
}

impl<const R: usize, const A: usize, const W: usize> Layers<W> for PolarMap<R, A> {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let Some((grades, occupancy)) = self.grades(azimuth).zip(self.occupancy(azimuth)) else { return Ray::UNKNOWN };
        let near = grades.iter().position(|grade| *grade > 0);
        let known = match near.zip(grades.iter().rposition(|grade| *grade > 0)) {
            Some((near, last)) => Known::new(near, last + 1),
            None => return Ray::UNKNOWN,
        };
        let visible = self.visible_from();
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
            Plane::Occupancy => at_least(occupancy, self.occupied_from()),
        };
        Ray::new(known, bits)
    }
}

/// Cells whose value reaches a threshold, eight at a time.
#[allow(clippy::cast_possible_truncation)] // eight bits are left
fn at_least<const W: usize>(cells: &[u8], threshold: u8) -> Bits<W> {
    const HIGH: u64 = 0x8080_8080_8080_8080;
    let least = u64::from(threshold) * 0x0101_0101_0101_0101;
    let mut words = [0; W];
    // eight cells are often like the eight before
    let (mut before, mut together) = (0, if threshold == 0 { 0xFF } else { 0 });
    for (word, cells) in words.iter_mut().zip(cells.chunks(32)) {
        for (place, eight) in cells.chunks(8).enumerate() {
            let mut bytes = [0; 8];
            match eight.first_chunk() {
                Some(whole) => bytes = *whole,
                // the last of a row; the threshold is above 0
                None => bytes.iter_mut().zip(eight).for_each(|(to, from)| *to = *from),
            }
            let cells = u64::from_le_bytes(bytes);
            if cells != before {
                before = cells;
                // the highest bit of a byte: whether its lower seven reach the threshold's
                let low = (cells | HIGH) - (least & !HIGH);
                let reached = ((cells & !least) | (!(cells ^ least) & low)) & HIGH;
                // the highest bits of all bytes side by side
                together = (reached >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56;
            }
            *word |= (together as u32) << (8 * place);
        }
    }
    Bits::from_words(words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::map::{RoadPoint, Visibility};
    use crate::mount::Levelling;
    use crate::polar::PolarGeometry;

    fn map() -> PolarMap<40, 2> {
        let geometry = PolarGeometry {
            levelling: Levelling::on_road(RoadPoint::new(0, 0), 600, Angle::from_raw(0)),
            cell_cm: 100,
            azimuth_origin: Angle::from_raw(-1000),
            azimuth_span: 2000,
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
        let cells = |plane| -> std::vec::Vec<usize> { Layers::<2>::ray(&map(), plane, 1).bits().iter().collect() };
        assert_eq!(cells(Plane::Visibility), [6, 7, 33]);
        assert_eq!(cells(Plane::Grade), [4, 5, 7, 33], "nearly visible, and clear");
        assert_eq!(cells(Plane::Occupancy), [5]);
        assert_eq!(Layers::<2>::ray(&map(), Plane::Visibility, 1).known, Known::new(3, 34));
        assert_eq!(Layers::<2>::ray(&map(), Plane::Visibility, 0), Ray::UNKNOWN);
        assert_eq!(Layers::<2>::ray(&map(), Plane::Visibility, 2), Ray::UNKNOWN);
    }

    #[test]
    fn eight_cells_at_a_time_say_what_one_says() {
        for threshold in [1, 2, 100, 127, 128, 129, 200, 255] {
            let cells: std::vec::Vec<u8> = (0..60_u32).map(|i| (i * 37 + u32::from(threshold)) as u8).collect();
            let bits = at_least::<2>(&cells, threshold);
            let expected: std::vec::Vec<usize> = (0..60).filter(|i| cells[*i] >= threshold).collect();
            assert_eq!(bits.iter().collect::<std::vec::Vec<_>>(), expected, "{threshold}");
        }
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
        assert_eq!(Layers::<2>::ray(&bitmap, Plane::Occupancy, 1), Ray::UNKNOWN);
    }
}
