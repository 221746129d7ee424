//! The sensor-centred occupancy grid: range x azimuth x elevation, one byte a cell.
//!
//! # Model
//! A byte is the occupied share of its cell, 0 to 255. Evidence lasts and fades. The `E` cells of one
//! azimuth and range lie together (a *stack*), so a ray over all elevations is a byte-wise running
//! maximum. Empty stacks are skipped by bit rows.

use crate::fixed::bits::Bits;
use crate::grid::stack;

/// Occupancy around one sensor: `R` ranges, `A` azimuths, `E` elevations; `W` words of 32 bits say
/// which of the `R` stacks of an azimuth hold something.
///
/// # Limits
/// `R * A * E` bytes and `4 W` bytes per azimuth; `R` up to `32 W`.
#[derive(Debug, Clone)]
pub struct SphericalGrid<const R: usize, const A: usize, const E: usize, const W: usize = 8> {
    columns: [Column<R, E, W>; A],
    /// What is added before rounding down, 2^-32; another for every change.
    rounding: u32,
}

/// The golden ratio's fraction, 2^-32: its multiples fill a circle more evenly than any other's, so that
/// among any so many of them the right share lies below any bound, to one.
const GOLDEN: u32 = 0x9E37_79B9;

/// All cells of one azimuth.
#[derive(Debug, Clone)]
pub struct Column<const R: usize, const E: usize, const W: usize = 8> {
    stacks: [[u8; E]; R],
    /// Range cells whose stack may hold something.
    used: Bits<W>,
}

impl<const R: usize, const A: usize, const E: usize, const W: usize> Default for SphericalGrid<R, A, E, W> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize> SphericalGrid<R, A, E, W> {
    /// Nothing occupied.
    pub const fn new() -> Self {
        const { assert!(R <= Bits::<W>::CAPACITY) }
        Self { columns: [const { Column::EMPTY }; A], rounding: 0 }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        for c in &mut self.columns {
            c.clear();
        }
        self.rounding = 0;
    }

    /// What is to be added before rounding down so that over the changes nothing is lost or won, 2^-32. A
    /// cell is a byte and what it loses in a frame may be a thousandth of a step: it loses a step in one
    /// frame of a thousand.
    pub fn next_rounding(&mut self) -> u32 {
        self.rounding = self.rounding.wrapping_add(GOLDEN);
        self.rounding
    }

    /// All columns, from right to left.
    pub fn columns(&self) -> impl Iterator<Item = &Column<R, E, W>> {
        self.columns.iter()
    }

    /// All columns, from right to left.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = &mut Column<R, E, W>> {
        self.columns.iter_mut()
    }

    /// One column.
    pub fn column_mut(&mut self, azimuth: usize) -> Option<&mut Column<R, E, W>> {
        self.columns.get_mut(azimuth)
    }
}

impl<const R: usize, const E: usize, const W: usize> Column<R, E, W> {
    const EMPTY: Self = Self { stacks: [[0; E]; R], used: Bits::NONE };

    fn clear(&mut self) {
        for r in self.used.iter() {
            if let Some(s) = self.stacks.get_mut(r) {
                *s = [0; E];
            }
        }
        self.used = Bits::NONE;
    }

    /// Range cells that hold something, nearest first, with their stacks.
    pub fn stacks(&self) -> impl Iterator<Item = (usize, &[u8; E])> {
        self.used.iter().filter_map(|r| self.stacks.get(r).map(|s| (r, s)))
    }

    /// Changes every stack that holds something; one left with less than 8 in every cell is emptied and
    /// skipped from then on.
    pub fn change(&mut self, mut change: impl FnMut(usize, &mut [u8; E])) {
        let used = self.used;
        for r in used.iter() {
            let Some(s) = self.stacks.get_mut(r) else { continue };
            change(r, s);
            if stack::is_faint(s) {
                *s = [0; E];
                self.used.clear(r);
            }
        }
    }

    /// Changes every stack nearer than `end` that holds something.
    pub fn change_before(&mut self, end: usize, mut change: impl FnMut(&mut [u8; E])) {
        for r in self.used.iter().take_while(|r| *r < end) {
            if let Some(s) = self.stacks.get_mut(r) {
                change(s);
            }
        }
    }

    /// The stack of a range cell, to put evidence in.
    pub fn evidence(&mut self, r: usize) -> Option<&mut [u8; E]> {
        let stack = self.stacks.get_mut(r)?;
        self.used.set(r);
        Some(stack)
    }

    /// Empties the stacks of some range cells.
    pub fn empty(&mut self, cells: core::ops::Range<usize>) {
        for r in cells {
            if !self.used.get(r) {
                continue;
            }
            if let Some(s) = self.stacks.get_mut(r) {
                *s = [0; E];
            }
            self.used.clear(r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn stacks_that_are_emptied_or_faint_are_skipped_and_others_stay() {
        let mut g: SphericalGrid<4, 1, 2> = SphericalGrid::new();
        let c = g.column_mut(0).unwrap();
        for r in [1, 2, 3] {
            c.evidence(r).unwrap()[0] = 90;
        }
        c.empty(2..9);
        assert_eq!(c.stacks().collect::<Vec<_>>(), [(1, &[90, 0])]);
        c.change(|_, s| s[0] = 8);
        assert_eq!(c.stacks().count(), 1);
        c.change(|_, s| s[0] = 7);
        assert_eq!(c.stacks().count(), 0);
        assert_eq!(*c.evidence(1).unwrap(), [0, 0], "and nothing of it comes back");
    }

    #[test]
    fn clearing_leaves_nothing_behind() {
        let mut g: SphericalGrid<4, 1, 2> = SphericalGrid::new();
        *g.column_mut(0).unwrap().evidence(3).unwrap() = [255, 255];
        g.clear();
        let c = g.column_mut(0).unwrap();
        *c.evidence(3).unwrap() = [1, 1];
        assert_eq!(c.stacks().collect::<Vec<_>>(), [(3, &[1, 1])]);
    }
}
