//! The fused map as it is at a time.

use crate::fixed::time::Time;
use crate::map::query::Footprint;
use crate::map::{CellState, Visibility, VisibilityMap};
use crate::sensor::road::RoadPoint;

use super::{Fusion, Held, Marks, bit, centre};

/// Some of the sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sensors(u8);

impl Sensors {
    /// Whether a sensor is among them.
    pub const fn has(self, sensor: usize) -> bool {
        sensor < 8 && self.0 >> sensor & 1 == 1
    }

    /// How many they are.
    pub const fn count(self) -> u32 {
        self.0.count_ones()
    }

    /// Their numbers, ascending.
    pub fn numbers(self) -> impl Iterator<Item = usize> {
        (0..8).filter(move |sensor| self.has(*sensor))
    }
}

/// What is known of a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FusedCell {
    /// Who sees all of it.
    pub seen_by: Sensors,
    /// From whom some of it is hidden.
    pub hidden_from: Sensors,
    /// Who says that some of it is occupied: those who see that, and where nobody sees the cell those who know of it.
    pub occupied_by: Sensors,
    /// All of them together. The grade is the best of those who see it; where nobody does, the best of the others.
    pub state: CellState,
}

/// Where sensors contradict each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Conflict {
    /// Middle of the cell.
    pub at: RoadPoint,
    /// Who sees it free, and nothing beside it.
    pub free: Sensors,
    /// Who sees it occupied.
    pub occupied: Sensors,
}

/// The fused map.
#[derive(Debug, Clone, Copy)]
pub struct Fused<'f, const S: usize, const NX: usize, const NY: usize> {
    fusion: &'f Fusion<S, NX, NY>,
    now: Time,
    fresh: u8,
}

impl<'f, const S: usize, const NX: usize, const NY: usize> Fused<'f, S, NX, NY> {
    pub(super) fn new(fusion: &'f Fusion<S, NX, NY>, now: Time) -> Self {
        let bits = fusion.held.iter().zip(0_u32..).map(|(held, k)| u8::from(held.fresh(now, fusion.config)) << (k & 7));
        Self { fusion, now, fresh: bits.fold(0, |all, bit| all | bit) }
    }

    /// Sensors whose maps count.
    pub fn fresh(&self) -> Sensors {
        Sensors(self.fresh)
    }

    /// Age of a sensor's newest map, ms; none if it has none. Of the future: 0.
    pub fn age_ms(&self, sensor: usize) -> Option<u64> {
        let Held { measured, .. } = self.fusion.held.get(sensor)?;
        measured.map(|at| self.now.since(at).unwrap_or(0) / 1000)
    }

    /// What is known of a cell, counted from the grid's origin; unknown outside.
    pub fn cell(&self, i: usize, j: usize) -> FusedCell {
        let (visible, marks) = self.bits(i, j);
        let (mut best_seen, mut best) = (0, 0);
        for (sensor, grade) in self.grades(i, j) {
            let bit = bit(sensor);
            if marks.known & bit == 0 {
                continue;
            }
            best = grade.max(best);
            if visible & bit != 0 {
                best_seen = grade.max(best_seen);
            }
        }
        let (visibility, grade) = match (visible, marks.known) {
            (0, 0) => (Visibility::Unknown, 0),
            (0, _) => (Visibility::Invisible, best),
            _ => (Visibility::Visible, best_seen),
        };
        let occupied = match visibility {
            Visibility::Unknown => 0,
            Visibility::Invisible => marks.occupied & marks.known | marks.seen_occupied,
            Visibility::Visible => marks.seen_occupied,
        };
        let is_occupied = occupied != 0;
        let occupancy = if is_occupied { u8::MAX } else { 0 };
        FusedCell {
            seen_by: Sensors(visible),
            hidden_from: Sensors(marks.known & !visible),
            occupied_by: Sensors(occupied),
            state: CellState { visibility, grade, occupancy, occupied: is_occupied },
        }
    }

    fn grades(&self, i: usize, j: usize) -> impl Iterator<Item = (usize, u8)> + '_ {
        let grades =
            self.fusion.grades.iter().map(move |rows| rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0));
        grades.enumerate()
    }

    /// Fresh sensors that see a cell, and what fresh ones say of it.
    fn bits(&self, i: usize, j: usize) -> (u8, Marks) {
        let marks = self.fusion.marks.get(i).and_then(|row| row.get(j)).copied().unwrap_or(Marks::NONE);
        let marks = Marks {
            known: marks.known & self.fresh,
            occupied: marks.occupied & self.fresh,
            seen_occupied: marks.seen_occupied & self.fresh,
        };
        let sees =
            |(held, (sensor, grade)): (&Held, (usize, u8))| if grade >= held.visible_from { bit(sensor) } else { 0 };
        let visible = self.fusion.held.iter().zip(self.grades(i, j)).map(sees).fold(0, |all, bit| all | bit);
        (visible & marks.known, marks)
    }

    /// Where sensors contradict each other. What one sees free counts only if it sees nothing occupied in the eight
    /// cells around either: their times and their edges differ by some.
    pub fn conflicts(&self) -> impl Iterator<Item = Conflict> + '_ {
        let cells = (0..NX).flat_map(|i| (0..NY).map(move |j| (i, j)));
        cells.filter_map(|(i, j)| self.conflict(i, j))
    }

    fn conflict(&self, i: usize, j: usize) -> Option<Conflict> {
        let (visible, marks) = self.bits(i, j);
        let (occupied, mut free) = (marks.seen_occupied, visible & !marks.occupied);
        if occupied == 0 || free == 0 {
            return None;
        }
        for (x, y) in (0..9).map(|k| (i.wrapping_add(k / 3).wrapping_sub(1), j.wrapping_add(k % 3).wrapping_sub(1))) {
            free &= !self.bits(x, y).1.seen_occupied;
        }
        let [x, y] = [i, j].map(|k| i32::try_from(k).unwrap_or(i32::MAX));
        let at = centre(self.fusion.origin, self.fusion.cell_cm, x, y);
        (free != 0).then_some(Conflict { at, free: Sensors(free), occupied: Sensors(occupied) })
    }

    /// What is known of a point of the road.
    pub fn place(&self, point: RoadPoint) -> FusedCell {
        let index = |at: i32, from: i32| {
            let cells = at.checked_sub(from)?.checked_div_euclid(self.fusion.cell_cm)?;
            usize::try_from(cells).ok()
        };
        let origin = self.fusion.origin;
        let outside = (NX, NY);
        let (i, j) = index(point.x_cm, origin.x_cm).zip(index(point.y_cm, origin.y_cm)).unwrap_or(outside);
        self.cell(i, j)
    }
}

impl<const S: usize, const NX: usize, const NY: usize> VisibilityMap for Fused<'_, S, NX, NY> {
    fn at(&self, point: RoadPoint) -> CellState {
        self.place(point).state
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        area.each_square(self.fusion.origin, self.fusion.cell_cm, |i, j| {
            let cell = usize::try_from(i).ok().zip(usize::try_from(j).ok());
            visit(cell.map_or(CellState::UNKNOWN, |(i, j)| self.cell(i, j).state));
        });
    }
}
