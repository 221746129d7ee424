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
            Plane::Visibility => at_least(grades, visible),
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

/// Cells whose value reaches a threshold.
fn at_least<const W: usize>(cells: &[u8], threshold: u8) -> Bits<W> {
    let mut words = [0; W];
    for (word, cells) in words.iter_mut().zip(cells.chunks(32)) {
        *word = cells.iter().rev().fold(0, |bits, cell| bits << 1 | u32::from(*cell >= threshold));
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
