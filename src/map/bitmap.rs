//! The compact visibility bitmap: three states a cell in two bits.

use crate::fixed::bits::RangeBits;
use crate::map::Visibility;
use crate::map::polar::PolarMap;

/// Visibility of `A` azimuths by `R` ranges.
///
/// # Limits
/// 64 bytes per azimuth, whatever `R` up to 256.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisibilityBitmap<const R: usize, const A: usize> {
    rows: [Row; A],
}

/// One azimuth, from near to far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Row {
    /// Cells there is evidence for.
    pub known: RangeBits,
    /// Cells that are visible; a subset of the known.
    pub visible: RangeBits,
}

impl Row {
    /// State of a range cell.
    pub fn cell(&self, range: usize) -> Visibility {
        match (self.known.get(range), self.visible.get(range)) {
            (false, _) => Visibility::Unknown,
            (true, false) => Visibility::Invisible,
            (true, true) => Visibility::Visible,
        }
    }

    /// Sets the state of a range cell.
    pub fn set(&mut self, range: usize, state: Visibility) {
        self.known.clear(range);
        self.visible.clear(range);
        if state != Visibility::Unknown {
            self.known.set(range);
        }
        if state == Visibility::Visible {
            self.visible.set(range);
        }
    }
}

impl<const R: usize, const A: usize> VisibilityBitmap<R, A> {
    /// Everything unknown.
    pub const UNKNOWN: Self = Self { rows: [Row { known: RangeBits::NONE, visible: RangeBits::NONE }; A] };

    /// The bits of a map.
    pub fn of(map: &PolarMap<R, A>) -> Self {
        let mut bitmap = Self::UNKNOWN;
        for (a, row) in bitmap.rows.iter_mut().enumerate() {
            for (r, &grade) in map.grades(a).into_iter().flatten().enumerate() {
                if grade > 0 {
                    row.known.set(r);
                    if grade >= map.visible_from() {
                        row.visible.set(r);
                    }
                }
            }
        }
        bitmap
    }

    /// All azimuths, from right to left.
    pub fn rows(&self) -> &[Row; A] {
        &self.rows
    }

    /// One azimuth.
    pub fn row_mut(&mut self, azimuth: usize) -> Option<&mut Row> {
        self.rows.get_mut(azimuth)
    }

    /// State of a cell; unknown outside.
    pub fn cell(&self, azimuth: usize, range: usize) -> Visibility {
        self.rows.get(azimuth).filter(|_| range < R).map_or(Visibility::Unknown, |row| row.cell(range))
    }

    /// A coarser bitmap: a cell is the worst of those it covers, so that it is never better known
    /// nor more visible than any of them. Cells of the finer one are dealt out evenly.
    pub fn coarsen<const R2: usize, const A2: usize>(&self) -> VisibilityBitmap<R2, A2> {
        const { assert!(R2 > 0 && A2 > 0 && R2 <= R && A2 <= A) }
        let mut coarse = VisibilityBitmap::UNKNOWN;
        for (a2, row) in coarse.rows.iter_mut().enumerate() {
            for r2 in 0..R2 {
                let mut worst = Visibility::Visible;
                for a in covered(a2, A2, A) {
                    for r in covered(r2, R2, R) {
                        worst = worst.min(self.cell(a, r));
                    }
                }
                row.set(r2, worst);
            }
        }
        coarse
    }
}

/// Fine cells that share any part of coarse cell `i` of `coarse` over `fine`.
fn covered(i: usize, coarse: usize, fine: usize) -> core::ops::Range<usize> {
    i * fine / coarse..((i + 1) * fine).div_ceil(coarse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    fn parse<const R: usize, const A: usize>(picture: &str) -> VisibilityBitmap<R, A> {
        let mut b = VisibilityBitmap::UNKNOWN;
        for (row, line) in b.rows.iter_mut().zip(picture.split_whitespace()) {
            for (r, c) in line.chars().enumerate() {
                row.set(
                    r,
                    match c {
                        '.' => Visibility::Visible,
                        '#' => Visibility::Invisible,
                        _ => Visibility::Unknown,
                    },
                );
            }
        }
        b
    }

    fn draw<const R: usize, const A: usize>(b: &VisibilityBitmap<R, A>) -> String {
        let rows = (0..A).map(|a| {
            (0..R)
                .map(|r| match b.cell(a, r) {
                    Visibility::Visible => '.',
                    Visibility::Invisible => '#',
                    Visibility::Unknown => '?',
                })
                .collect::<String>()
        });
        rows.collect::<std::vec::Vec<_>>().join(" ")
    }

    #[test]
    fn coarsening_takes_the_worst() {
        let fine: VisibilityBitmap<8, 2> = parse("?...##.. ?.....?.");
        let coarse: VisibilityBitmap<4, 1> = fine.coarsen();
        assert_eq!(draw(&coarse), "?.#?");
    }

    #[test]
    fn uneven_coarsening_counts_every_cell_it_touches() {
        let fine: VisibilityBitmap<5, 1> = parse("..#..");
        let coarse: VisibilityBitmap<2, 1> = fine.coarsen();
        assert_eq!(draw(&coarse), "##", "the middle cell lies in both");
    }

    #[test]
    fn a_state_can_be_set_and_taken_back() {
        let mut row = Row::default();
        row.set(7, Visibility::Visible);
        row.set(7, Visibility::Unknown);
        assert_eq!((row.cell(7), row.visible.get(7)), (Visibility::Unknown, false));
    }
}
