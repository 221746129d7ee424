//! Any map onto the Cartesian 1 m grid of the road: each cell is the worst of what the map says anywhere in it.

use crate::map::query::Footprint;
use crate::map::{CellState, Visibility, VisibilityMap, worst_in};
use crate::sensor::road::RoadPoint;

/// Side of a cell.
const CELL_CM: i32 = 100;

/// `NX` by `NY` cells of one metre; the first covers [x, x + 1) by [y, y + 1) metres.
///
/// # Limits
/// `3 * NX * NY` bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RoadGrid<const NX: usize, const NY: usize> {
    /// First cell along and across the road.
    origin: (i32, i32),
    cells: [[Packed; NY]; NX],
}

/// A cell state in three bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Packed {
    grade: u8,
    occupancy: u8,
    /// Bit 0 known, 1 visible, 2 occupied.
    flags: u8,
}

impl Packed {
    const UNKNOWN: Self = Self { grade: 0, occupancy: 0, flags: 0 };

    fn of(s: CellState) -> Self {
        let known = s.visibility != Visibility::Unknown;
        Self {
            grade: s.grade,
            occupancy: s.occupancy,
            flags: u8::from(known) | u8::from(s.visible()) << 1 | u8::from(s.occupied) << 2,
        }
    }

    fn state(self) -> CellState {
        let visibility = match self.flags & 3 {
            3 => Visibility::Visible,
            1 => Visibility::Invisible,
            _ => return CellState::UNKNOWN,
        };
        CellState { visibility, grade: self.grade, occupancy: self.occupancy, occupied: self.flags & 4 != 0 }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // cell indices
impl<const NX: usize, const NY: usize> RoadGrid<NX, NY> {
    /// Everything unknown; `x` and `y` name the first cell, metres.
    pub const fn unknown(x: i32, y: i32) -> Self {
        Self { origin: (x, y), cells: [[Packed::UNKNOWN; NY]; NX] }
    }

    /// Takes over the worst of what a map says anywhere in each cell: visible is what is visible as a whole, and it is
    /// occupied if any of it is. What only touches an edge may count as well.
    pub fn resample(&mut self, map: &(impl VisibilityMap + ?Sized)) {
        let (x, y) = self.origin;
        for (i, row) in self.cells.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                let (i, j) = (x.saturating_add(i as i32), y.saturating_add(j as i32));
                *cell = Packed::of(worst_in(map, &Footprint::square(RoadPoint::cell_centre(i, j), CELL_CM)));
            }
        }
    }

    /// State of the cell [i, i + 1) by [j, j + 1) metres; unknown outside.
    pub fn cell(&self, i: i32, j: i32) -> CellState {
        let row = usize::try_from(i.wrapping_sub(self.origin.0)).ok().and_then(|i| self.cells.get(i));
        let cell = row.and_then(|row| row.get(usize::try_from(j.wrapping_sub(self.origin.1)).ok()?));
        cell.map_or(CellState::UNKNOWN, |c| c.state())
    }
}

impl<const NX: usize, const NY: usize> VisibilityMap for RoadGrid<NX, NY> {
    fn at(&self, point: RoadPoint) -> CellState {
        self.cell(point.x_cm.div_euclid(CELL_CM), point.y_cm.div_euclid(CELL_CM))
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        area.each_square(RoadPoint::new(0, 0), CELL_CM, |i, j| visit(self.cell(i, j)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Visible to the left of the road's x axis, invisible to the right, unknown behind.
    struct LeftOnly;

    impl VisibilityMap for LeftOnly {
        fn at(&self, p: RoadPoint) -> CellState {
            if p.x_cm < 0 {
                return CellState::UNKNOWN;
            }
            let visibility = if p.y_cm > 0 { Visibility::Visible } else { Visibility::Invisible };
            CellState { visibility, grade: 77, occupancy: 5, occupied: p.x_cm > 200 }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    #[test]
    fn cells_keep_their_place_and_side() {
        let mut grid = RoadGrid::<5, 4>::unknown(-1, -2);
        grid.resample(&LeftOnly);
        let row = |i: i32| [-2, -1, 0, 1].map(|j| grid.cell(i, j).visibility);
        assert_eq!(row(-1), [Visibility::Unknown; 4]);
        use Visibility::{Invisible, Visible};
        assert_eq!(row(0), [Invisible, Invisible, Visible, Visible]);
        assert_eq!(grid.at(RoadPoint::new(250, 150)), LeftOnly.at(RoadPoint::new(250, 150)));
        assert!(!grid.cell(1, 0).occupied && grid.cell(2, 0).occupied);
        assert_eq!(grid.cell(4, 0), CellState::UNKNOWN, "outside the grid");
        assert_eq!(grid.cell(i32::MIN, i32::MAX), CellState::UNKNOWN);
    }
}
