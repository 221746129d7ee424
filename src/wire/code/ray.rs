//! One azimuth of a map as it travels: which cells are known, and a bit for each of them.

use super::edges::Edges;
pub use super::known::Known;
use crate::fixed::bits::Bits;
use crate::map::bitmap::Row;

/// An azimuth of one plane, in a row of at most `32 * W` cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ray<const W: usize> {
    /// Cells there is evidence for.
    pub known: Known,
    /// A bit for each of them: visible, say. No bit is set outside.
    bits: Bits<W>,
}

impl<const W: usize> Ray<W> {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self { known: Known::NONE, bits: Bits::NONE };

    /// From bits; those outside the known cells are dropped.
    pub fn new(known: Known, bits: Bits<W>) -> Self {
        Self { known, bits: bits.and(&Bits::span(known.near(), known.end())) }
    }

    /// All known cells set.
    pub fn clear(known: Known) -> Self {
        Self { known, bits: Bits::span(known.near(), known.end()) }
    }

    /// Of a bitmap's row. Unknown cells between known ones count as known and not visible, which is
    /// the safe side; the number of them comes with it.
    pub fn of(row: &Row) -> (Self, u32) {
        let known = match (row.known.next(0), row.known.last()) {
            (Some(near), Some(last)) => Known::new(near, last + 1),
            _ => return (Self::UNKNOWN, 0),
        };
        let cells = known.end() - known.near();
        let holes = u32::try_from(cells).unwrap_or(0).saturating_sub(row.known.count());
        (Self::new(known, row.visible.and(&row.known).resized()), holes)
    }

    /// As a row of a bitmap.
    pub fn row(&self) -> Row {
        Row { known: Bits::span(self.known.near(), self.known.end()), visible: self.bits.resized() }
    }

    /// The bit of a cell.
    pub fn get(&self, cell: usize) -> bool {
        self.bits.get(cell)
    }

    /// The bits.
    pub fn bits(&self) -> &Bits<W> {
        &self.bits
    }

    /// The bit of the first known cell.
    pub fn first(&self) -> bool {
        self.bits.get(self.known.near())
    }

    /// Cells whose bit differs from the one before, within the known cells.
    pub fn edges(&self) -> Edges<'_, W> {
        Edges::new(self.bits.words(), self.known, 0)
    }

    /// From bits none of which is set outside the known cells.
    pub(crate) const fn within(known: Known, bits: Bits<W>) -> Self {
        Self { known, bits }
    }

    /// What this ray of the refresh will probably be by now: where the neighbour changed since the
    /// same refresh, what the neighbour is now; elsewhere as it was.
    pub fn expected(&self, neighbour: &Self, neighbour_was: &Self) -> Self {
        let mut words = *self.bits.words();
        let neighbours = neighbour.bits.words().iter().zip(neighbour_was.bits.words());
        for (word, (now, was)) in words.iter_mut().zip(neighbours) {
            let changed = now ^ was;
            *word = (*word & !changed) | (now & changed);
        }
        let same_cells = neighbour.known == self.known && neighbour_was.known == self.known;
        let bits = Bits::from_words(words);
        if same_cells { Self::within(self.known, bits) } else { Self::new(self.known, bits) }
    }

    /// How many cells from the first known one on are set without a gap: the end of that run.
    pub fn clear_to(&self) -> usize {
        if self.known.is_empty() || !self.first() {
            return 0;
        }
        self.edges().next().unwrap_or(self.known.end())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;
    use std::vec;
    use std::vec::Vec;

    /// `.` visible, `#` not, blanks unknown.
    fn ray(picture: &str) -> Ray<1> {
        let cells: Vec<char> = picture.chars().collect();
        let near = cells.iter().position(|c| *c != ' ').unwrap_or(0);
        let end = cells.iter().rposition(|c| *c != ' ').map_or(0, |e| e + 1);
        let mut bits = Bits::NONE;
        cells.iter().enumerate().filter(|(_, c)| **c == '.').for_each(|(i, _)| bits.set(i));
        Ray::new(Known::new(near, end), bits)
    }

    fn draw(ray: &Ray<1>) -> String {
        (0..ray.known.end().max(1))
            .map(|i| {
                if !ray.known.contains(i) {
                    ' '
                } else if ray.get(i) {
                    '.'
                } else {
                    '#'
                }
            })
            .collect()
    }

    #[test]
    fn edges_lie_within_the_known_cells() {
        let edges = |p: &str| ray(p).edges().collect::<Vec<_>>();
        assert_eq!(edges("  ..##.  "), [4, 6]);
        assert_eq!((edges("####"), edges("  .  "), edges("")), (vec![], vec![], vec![]));
        let whole = Ray::<7>::new(Known::new(0, 224), Bits::span(31, 33));
        assert_eq!(whole.edges().collect::<Vec<_>>(), [31, 33]);
        assert_eq!(Edges::new(whole.bits().words(), whole.known, 32).collect::<Vec<_>>(), [33]);
        assert!(
            !whole.edges().any(|edge| edge == 0) && Edges::new(whole.bits().words(), whole.known, 224).next().is_none()
        );
        let last = Ray::<7>::new(Known::new(3, 224), Bits::span(3, 223));
        assert_eq!(last.edges().collect::<Vec<_>>(), vec![223]);
    }

    #[test]
    fn where_the_neighbour_moved_it_leads() {
        let (was, now) = (ray("....##...."), ray("..##......"));
        assert_eq!(draw(&ray("....##....").expected(&now, &was)), "..##......");
        assert_eq!(draw(&ray("......##..").expected(&now, &was)), "..##..##..", "elsewhere as it was");
        assert_eq!(draw(&ray("....##....").expected(&was, &was)), "....##....");
    }

    #[test]
    fn holes_of_unknown_become_invisible_and_are_counted() {
        let mut row = Row::default();
        for (cell, state) in "  ..?.#".chars().enumerate() {
            match state {
                '.' => row.set(cell, crate::map::Visibility::Visible),
                '#' => row.set(cell, crate::map::Visibility::Invisible),
                _ => {}
            }
        }
        let (ray, holes) = Ray::<1>::of(&row);
        assert_eq!((draw(&ray).as_str(), holes), ("  ..#.#", 1));
        assert_eq!(ray.row().cell(4), crate::map::Visibility::Invisible);
        assert_eq!(Ray::<1>::of(&Row::default()), (Ray::UNKNOWN, 0));
    }

    #[test]
    fn the_first_run_is_what_is_guaranteed() {
        assert_eq!(ray("  ..##..").clear_to(), 4);
        assert_eq!(ray("  ......").clear_to(), 8);
        assert_eq!((ray("  #....").clear_to(), Ray::<1>::UNKNOWN.clear_to()), (0, 0));
    }
}
