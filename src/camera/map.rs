//! A camera's map: 1 m cells ahead of it, and the same as a polar map for the wire.

use crate::camera::voxels::{CELL_CM, middle_of};
use crate::fixed::angle::Angle;
use crate::fixed::trig;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::{CellState, UNKNOWN, VisibilityMap};
use crate::sensor::mount::Levelling;
use crate::sensor::road::RoadPoint;

/// `NX` rows of 1 m from the camera away, in each `NY` cells of 1 m from right to left, in the levelled frame.
///
/// # Limits
/// `2 * NX * NY` bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraMap<const NX: usize, const NY: usize> {
    /// Mean visibility of the voxels above a cell, 1 (none) to 255 (all); 0 = unknown.
    grades: [[u8; NY]; NX],
    occupancy: [[u8; NY]; NX],
    levelling: Levelling,
    /// Right and left end of the view, from the boresight's heading.
    azimuth: [Angle; 2],
    visible_from: u8,
    occupied_from: u8,
}

impl<const NX: usize, const NY: usize> CameraMap<NX, NY> {
    pub(crate) fn new(levelling: Levelling, azimuth: [Angle; 2], visible_from: u8, occupied_from: u8) -> Self {
        let none = [[0; NY]; NX];
        Self { grades: none, occupancy: none, levelling, azimuth, visible_from, occupied_from }
    }

    /// Makes everything unknown.
    pub fn forget(&mut self) {
        self.grades = [[UNKNOWN; NY]; NX];
        self.occupancy = [[0; NY]; NX];
    }

    /// Grades (1 to 255, 0 = unknown) and occupancy, to be written by the ray caster.
    pub(crate) fn rows_mut(&mut self) -> (&mut [[u8; NY]; NX], &mut [[u8; NY]; NX]) {
        (&mut self.grades, &mut self.occupancy)
    }

    /// What is known of a cell: metres ahead, and the column from right to left; unknown outside of the map.
    pub fn cell(&self, row: usize, column: usize) -> CellState {
        let pick = |rows: &[[u8; NY]; NX]| rows.get(row).and_then(|row| row.get(column)).copied();
        match (pick(&self.grades), pick(&self.occupancy)) {
            (Some(grade), Some(occupancy)) => {
                CellState::judged(grade, occupancy, self.visible_from, self.occupied_from)
            }
            _ => CellState::UNKNOWN,
        }
    }

    /// The cell a place of the levelled frame lies in.
    fn locate(x_cm: i32, y_cm: i32) -> Option<(usize, usize)> {
        let row = usize::try_from(x_cm.div_euclid(CELL_CM)).ok()?;
        let column = usize::try_from((y_cm - middle_of(0, NY) + CELL_CM / 2).div_euclid(CELL_CM)).ok()?;
        (row < NX && column < NY).then_some((row, column))
    }

    /// A polar map around the camera on which everything is unknown: cells of 1 m, all azimuths of the view.
    #[allow(clippy::cast_sign_loss)] // the left end lies to the left
    pub fn polar<const R: usize, const A: usize>(&self) -> PolarMap<R, A> {
        let [right, left] = self.azimuth;
        let geometry = PolarGeometry {
            levelling: self.levelling,
            cell_cm: CELL_CM,
            azimuth_origin: right,
            azimuth_span: (left - right).raw().max(0) as u16,
        };
        PolarMap::unknown(geometry, self.visible_from, self.occupied_from)
    }

    /// Takes the map over into a polar one made by [`polar`](Self::polar): each of its cells is what the nearest
    /// cell is, the one its middle lies in, never better. One with other cells is made unknown.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // at most 2^16 turn
    pub fn to_polar<const R: usize, const A: usize>(&self, polar: &mut PolarMap<R, A>) {
        let geometry = *polar.geometry();
        polar.forget();
        if geometry.cell_cm != CELL_CM {
            return;
        }
        let span = u32::from(geometry.azimuth_span);
        for a in 0..A {
            let middle = (span * (2 * a as u32 + 1)) / (2 * A as u32).max(1);
            let ray = trig::direction(geometry.azimuth_origin + Angle::from_raw(middle as i16));
            let Some((grades, occupancy)) = polar.rows_mut(a) else { continue };
            // cells, 2^-15: half a cell and then whole ones along the ray
            let (dx, dy) = (i32::from(ray.x), i32::from(ray.y));
            let (mut x, mut y) = (dx, dy + ((NY as i32) << 14));
            for (grade, occupied) in grades.iter_mut().zip(occupancy) {
                let at = |rows: &[[u8; NY]; NX]| {
                    rows.get(usize::try_from(x >> 15).ok()?)?.get(usize::try_from(y >> 15).ok()?).copied()
                };
                // beyond the cells there are no more of them along the ray
                let Some(own) = at(&self.grades) else { break };
                if own != UNKNOWN {
                    (*grade, *occupied) = (own, at(&self.occupancy).unwrap_or(0));
                }
                x += 2 * dx;
                y += 2 * dy;
            }
        }
    }
}

impl<const NX: usize, const NY: usize> VisibilityMap for CameraMap<NX, NY> {
    fn at(&self, point: RoadPoint) -> CellState {
        let (x, y) = self.levelling.place(point);
        Self::locate(x, y).map_or(CellState::UNKNOWN, |(row, column)| self.cell(row, column))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Visibility;
    use crate::sensor::mount::Mount;

    /// 20 m ahead, 5 m to each side, turned 90 degrees to the left, at (3, 1).
    fn map() -> CameraMap<20, 10> {
        let mount = Mount { x_m: 3.0, y_m: 1.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 5.0, roll_deg: 0.0 };
        let azimuth = [Angle::from_degrees(-30.0), Angle::from_degrees(30.0)];
        CameraMap::new(mount.levelling().unwrap(), azimuth, 128, 128)
    }

    fn set(map: &mut CameraMap<20, 10>, row: usize, column: usize, grade: u8, occupancy: u8) {
        let (grades, occupied) = map.rows_mut();
        (grades[row][column], occupied[row][column]) = (grade, occupancy);
    }

    #[test]
    fn a_cell_lies_ahead_and_to_the_left_of_where_the_camera_hangs() {
        let mut m = map();
        // 12 to 13 m ahead is +y of the road, the second column from the left is 3 to 4 m to -x
        set(&mut m, 12, 8, 200, 255);
        assert!(m.at(RoadPoint::new(300 - 350, 100 + 1250)).visible());
        assert_eq!(m.at(RoadPoint::new(300 + 350, 100 + 1250)), CellState::UNKNOWN);
        assert_eq!(m.at(RoadPoint::new(300 - 350, 100 - 1250)), CellState::UNKNOWN);
        set(&mut m, 12, 8, 127, 127);
        let state = m.at(RoadPoint::new(300 - 350, 100 + 1250));
        assert!(state.visibility == Visibility::Invisible && !state.occupied);
        m.forget();
        assert_eq!(m.cell(12, 8), CellState::UNKNOWN);
    }

    #[test]
    fn the_polar_map_says_at_each_middle_what_the_nearest_cell_says() {
        let mut m = map();
        for row in 0..20 {
            for column in 0..10 {
                set(&mut m, row, column, (1 + row * 10 + column) as u8, column as u8);
            }
        }
        set(&mut m, 9, 4, 0, 0);
        let mut polar = m.polar::<25, 12>();
        m.to_polar(&mut polar);
        let levelling = map().levelling;
        let mut known = 0;
        for a in 0..12 {
            for r in 0..25 {
                let azimuth = Angle::from_degrees(-30.0 + 5.0 * a as f32 + 2.5);
                let (ray, range) = (trig::direction(azimuth), 100 * r as i32 + 50);
                let (x, y) = ((range * i32::from(ray.x)) >> 14, (range * i32::from(ray.y)) >> 14);
                let road = levelling.unplace(x, y);
                assert_eq!(polar.cell(a, r), m.at(road), "{a} {r}");
                assert_eq!(polar.locate(x, y), Some((a, r)));
                known += usize::from(polar.cell(a, r) != CellState::UNKNOWN);
            }
        }
        let mut coarse = PolarMap::<25, 12>::unknown(PolarGeometry { cell_cm: 200, ..*polar.geometry() }, 128, 128);
        m.to_polar(&mut coarse);
        assert_eq!(coarse.cell(6, 5), CellState::UNKNOWN, "of other cells");
        assert!(known > 150 && polar.cell(6, 22) == CellState::UNKNOWN, "{known}");
    }
}
