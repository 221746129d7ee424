//! A camera's map: 1 m cells ahead of it, and the rays that are sent of it.

use crate::camera::voxels::{CELL_CM, middle_of};
use crate::fixed::angle::Angle;
use crate::fixed::trig;
use crate::map::azimuths::Narrow;
use crate::map::polar::PolarGeometry;
use crate::map::query::Footprint;
use crate::map::{CellState, UNKNOWN, VisibilityMap};
use crate::sensor::mount::Levelling;
use crate::sensor::road::RoadPoint;

/// Azimuths of the polar map around a camera as which its map is sent.
pub const AZIMUTHS: usize = 120;

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
    /// A map of no camera, to be placed in static memory; everything is unknown.
    pub const NOWHERE: Self = Self::unknown(Levelling::NOWHERE, [Angle::ZERO; 2], 0, 0);

    pub(crate) const fn unknown(
        levelling: Levelling,
        azimuth: [Angle; 2],
        visible_from: u8,
        occupied_from: u8,
    ) -> Self {
        // places farther away are not told apart
        const { assert!(NX * NX + NY * NY / 4 < 449 * 449) }
        let none = [[0; NY]; NX];
        Self { grades: none, occupancy: none, levelling, azimuth, visible_from, occupied_from }
    }

    /// Makes it a map of a camera, on which everything is unknown.
    pub(crate) fn prepare(&mut self, levelling: Levelling, azimuth: [Angle; 2], visible_from: u8, occupied_from: u8) {
        self.forget();
        self.levelling = levelling;
        self.azimuth = azimuth;
        self.visible_from = visible_from;
        self.occupied_from = occupied_from;
    }

    /// Grades of a row, 0 = unknown, and occupancy.
    pub fn row(&self, row: usize) -> Option<(&[u8; NY], &[u8; NY])> {
        self.grades.get(row).zip(self.occupancy.get(row))
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

    /// Where the cells of the polar map around the camera lie, as which this one is sent: cells of 1 m, all azimuths
    /// of the view.
    pub(crate) fn geometry(&self) -> PolarGeometry {
        geometry(&self.levelling, self.azimuth)
    }

    /// The cells of an azimuth of that polar map, from near to far: each is what the nearest cell of this one is, the
    /// one its middle lies in, never better. Those beyond are left as they are.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // at most 2^16 turn
    pub(crate) fn along(&self, azimuth: usize, layer: Layer, cells: &mut [u8]) {
        let rows = match layer {
            Layer::Grades => &self.grades,
            Layer::Occupancy => &self.occupancy,
        };
        let geometry = self.geometry();
        let ray = trig::direction(geometry.middle_of(azimuth, AZIMUTHS));
        // cells, 2^-15: half a cell and then whole ones along the ray; what lies to the right of the cells wraps to
        // beyond them, and beyond them there are no more along the ray
        let (dx, dy) = (i32::from(ray.x), i32::from(ray.y));
        let (mut x, mut y) = (dx as u32, (dy + ((NY as i32) << 14)) as u32);
        let (step_x, step_y) = ((2 * dx) as u32, (2 * dy) as u32);
        for cell in cells {
            let Some(own) = rows.get((x >> 15) as usize).and_then(|row| row.get((y >> 15) as usize)) else { break };
            *cell = *own;
            x = x.wrapping_add(step_x);
            y = y.wrapping_add(step_y);
        }
    }

    /// Least grade that counts as visible, and least occupancy that counts as occupied.
    pub(crate) fn thresholds(&self) -> [u8; 2] {
        [self.visible_from, self.occupied_from]
    }
}

/// Where the cells of the polar map lie, by the right and left end of the view.
#[allow(clippy::cast_sign_loss)] // the left end lies to the left
pub(crate) fn geometry(levelling: &Levelling, [right, left]: [Angle; 2]) -> PolarGeometry {
    PolarGeometry {
        levelling: *levelling,
        cell_cm: CELL_CM,
        azimuth_origin: right,
        azimuth_span: (left - right).raw().max(0) as u16,
        narrow: Narrow::NONE,
    }
}

/// What is known of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layer {
    Grades,
    Occupancy,
}

impl<const NX: usize, const NY: usize> VisibilityMap for CameraMap<NX, NY> {
    fn at(&self, point: RoadPoint) -> CellState {
        let (x, y) = self.levelling.place(point);
        Self::locate(x, y).map_or(CellState::UNKNOWN, |(row, column)| self.cell(row, column))
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        let Some(area) = area.levelled(&self.levelling) else { return };
        let right = RoadPoint::new(0, middle_of(0, NY) - CELL_CM / 2);
        area.each_square(right, CELL_CM, |row, column| {
            let cell = usize::try_from(row).ok().zip(usize::try_from(column).ok());
            visit(cell.map_or(CellState::UNKNOWN, |(row, column)| self.cell(row, column)));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Visibility, query};
    use crate::sensor::mount::Mount;

    /// 20 m ahead, 5 m to each side, turned 90 degrees to the left, at (3, 1).
    fn map() -> CameraMap<20, 10> {
        let mount = Mount { x_m: 3.0, y_m: 1.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 5.0, roll_deg: 0.0 };
        let azimuth = [Angle::from_degrees(-30.0), Angle::from_degrees(30.0)];
        CameraMap::unknown(mount.levelling().unwrap(), azimuth, 128, 128)
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
    fn a_ray_says_at_each_middle_what_the_nearest_cell_says() {
        let mut m = map();
        for row in 0..20 {
            for column in 0..10 {
                set(&mut m, row, column, (1 + row * 10 + column) as u8, column as u8);
            }
        }
        set(&mut m, 9, 4, 0, 0);
        let (levelling, geometry) = (map().levelling, m.geometry());
        let mut known = 0;
        for a in 0..AZIMUTHS {
            let (mut grades, mut occupancy) = ([0; 25], [0; 25]);
            m.along(a, Layer::Grades, &mut grades);
            m.along(a, Layer::Occupancy, &mut occupancy);
            for r in 0..25 {
                let azimuth = Angle::from_degrees(-30.0 + 0.5 * a as f32 + 0.25);
                let (ray, range) = (trig::direction(azimuth), 100 * r as i32 + 50);
                let (x, y) = ((range * i32::from(ray.x)) >> 14, (range * i32::from(ray.y)) >> 14);
                // a middle within 3 cm of a border may be taken for either side
                let near = [(-3, -3), (-3, 3), (3, -3), (3, 3), (0, 0)];
                let mut states = near.map(|(dx, dy)| m.at(levelling.unplace(x + dx, y + dy))).into_iter();
                assert!(states.any(|s| (s.grade, s.occupancy) == (grades[r], occupancy[r])), "{a} {r}");
                // nearer than this a centimetre is a good part of an azimuth
                assert!(r < 8 || geometry.locate(x, y, 25, AZIMUTHS) == Some((a, r)), "{a} {r}");
                known += usize::from(grades[r] != UNKNOWN);
            }
        }
        assert!(known > 1500, "{known}");
    }

    #[test]
    fn an_area_is_no_better_than_any_of_its_points() {
        let mut seen = 0;
        for k in 0..2000_i32 {
            let mut m = map();
            (0..20).for_each(|row| (0..10).for_each(|column| set(&mut m, row, column, 200, 0)));
            set(&mut m, (k % 19) as usize, (k % 7) as usize + 1, (k % 3) as u8, 0);
            let heading = trig::direction(Angle::from_raw((k * 7919) as u16 as i16));
            let centre = m.levelling.unplace(k * 37 % 2100, k * 53 % 1100 - 550);
            let area = Footprint { centre, heading, half_length_cm: 150, half_width_cm: 60 };
            let answer = query::area(&m, &area);
            for (a, b) in (-10..=10).flat_map(|a| (-5..=5).map(move |b| (a * 15, b * 12))) {
                let (x, y) = (heading.along(a, -b), heading.across(-a, b));
                let here = query::point(&m, RoadPoint::new(centre.x_cm + x, centre.y_cm + y));
                assert!(answer <= here, "{answer:?}, and {here:?} at ({a}, {b}) of {area:?}");
            }
            seen += usize::from(answer == query::Answer::VisibleFree);
        }
        assert!(seen > 300, "{seen}");
    }
}
