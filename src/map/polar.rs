//! The polar result: graded visibility and occupancy at slice height, azimuth by ground range.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig;
use crate::map::azimuths::{Columns, Narrow};
use crate::map::query::Footprint;
use crate::map::{CellState, UNKNOWN, VisibilityMap};
use crate::sensor::mount::Levelling;
use crate::sensor::road::RoadPoint;

/// Places from here on are on no map: [`Levelling::place`] has them at 450 m along an axis, less what rounding takes.
pub(crate) const FARTHEST_CM: i32 = 44_900;

/// Where the cells of a polar map lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PolarGeometry {
    /// The mount.
    pub levelling: Levelling,
    /// Length of a range cell along the ground, centimetres.
    pub cell_cm: i32,
    /// Right edge of the first azimuth, from the boresight's heading.
    pub azimuth_origin: Angle,
    /// Width of all azimuths together, 2^-16 turn.
    pub azimuth_span: u16,
    /// Azimuths that are narrower than the others.
    pub narrow: Narrow,
}

impl PolarGeometry {
    /// Bearing of the middle of one of so many azimuths, from the boresight's heading.
    pub(crate) fn middle_of(&self, azimuth: usize, azimuths: usize) -> Angle {
        self.azimuth_origin + self.columns(azimuths).middle(azimuth)
    }

    /// Its azimuths, so many.
    pub(crate) fn columns(&self, number: usize) -> Columns {
        Columns { span: self.azimuth_span, number, narrow: self.narrow }
    }

    /// The cell (azimuth, range) a place of the levelled frame lies in, on a map of this size; none from 449 m on, where
    /// places are not told apart.
    pub fn locate(&self, x_cm: i32, y_cm: i32, ranges: usize, azimuths: usize) -> Option<(usize, usize)> {
        let from_origin = trig::bearing(x_cm, y_cm) - self.azimuth_origin;
        let azimuth = self.columns(azimuths).column(from_origin)?;
        let length = math::length(x_cm, y_cm);
        let range = usize::try_from(length / self.cell_cm.max(1)).ok()?;
        (range < ranges && length < FARTHEST_CM).then_some((azimuth, range))
    }
}

/// A polar visibility map of `A` azimuths (from right to left) by `R` ranges (from near to far).
///
/// # Limits
/// `2 * A * R` bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PolarMap<const R: usize, const A: usize> {
    /// Graded visibility, 1 (blocked) to 255 (clear); 0 = unknown.
    grades: [[u8; R]; A],
    /// Occupancy at slice height.
    occupancy: [[u8; R]; A],
    geometry: PolarGeometry,
    /// Least grade that counts as visible.
    visible_from: u8,
    /// Least occupancy that counts as occupied.
    occupied_from: u8,
}

impl<const R: usize, const A: usize> PolarMap<R, A> {
    /// A map on which everything is unknown.
    pub const fn unknown(geometry: PolarGeometry, visible_from: u8, occupied_from: u8) -> Self {
        Self { grades: [[UNKNOWN; R]; A], occupancy: [[0; R]; A], geometry, visible_from, occupied_from }
    }

    /// A map of no sensor, to be placed in static memory; everything is unknown.
    pub const NOWHERE: Self = Self::unknown(
        PolarGeometry {
            levelling: Levelling::NOWHERE,
            cell_cm: 0,
            azimuth_origin: Angle::ZERO,
            azimuth_span: 0,
            narrow: Narrow::NONE,
        },
        0,
        0,
    );

    /// Makes it a map of a sensor, on which everything is unknown.
    pub(crate) fn prepare(&mut self, geometry: PolarGeometry, visible_from: u8, occupied_from: u8) {
        self.forget();
        self.geometry = geometry;
        self.visible_from = visible_from;
        self.occupied_from = occupied_from;
    }

    /// Makes everything unknown.
    pub fn forget(&mut self) {
        self.grades = [[UNKNOWN; R]; A];
        self.occupancy = [[0; R]; A];
    }

    /// Makes an azimuth unknown.
    pub(crate) fn forget_azimuth(&mut self, azimuth: usize) {
        if let Some((grades, occupancy)) = self.rows_mut(azimuth) {
            (*grades, *occupancy) = ([UNKNOWN; R], [0; R]);
        }
    }

    /// Makes an azimuth unknown from a range cell on.
    pub(crate) fn forget_from(&mut self, azimuth: usize, range: usize) {
        if let Some((grades, occupancy)) = self.rows_mut(azimuth) {
            grades.iter_mut().skip(range).for_each(|grade| *grade = UNKNOWN);
            occupancy.iter_mut().skip(range).for_each(|occupied| *occupied = 0);
        }
    }

    /// Where the cells lie.
    pub fn geometry(&self) -> &PolarGeometry {
        &self.geometry
    }

    /// What is known of a cell; unknown outside the map.
    pub fn cell(&self, azimuth: usize, range: usize) -> CellState {
        let pick = |rows: &[[u8; R]; A]| rows.get(azimuth).and_then(|row| row.get(range)).copied();
        match (pick(&self.grades), pick(&self.occupancy)) {
            (Some(grade), Some(occupancy)) => {
                CellState::judged(grade, occupancy, self.visible_from, self.occupied_from)
            }
            _ => CellState::UNKNOWN,
        }
    }

    /// Grades (1 to 255, 0 = unknown) and occupancy of an azimuth, to be written by the ray caster.
    pub fn rows_mut(&mut self, azimuth: usize) -> Option<(&mut [u8; R], &mut [u8; R])> {
        self.grades.get_mut(azimuth).zip(self.occupancy.get_mut(azimuth))
    }

    /// Grades of an azimuth, 0 = unknown.
    pub fn grades(&self, azimuth: usize) -> Option<&[u8; R]> {
        self.grades.get(azimuth)
    }

    /// Occupancy of an azimuth.
    pub fn occupancy(&self, azimuth: usize) -> Option<&[u8; R]> {
        self.occupancy.get(azimuth)
    }

    /// All grades and occupancies, azimuth by azimuth.
    pub(crate) fn cells(&self) -> (&[u8], &[u8]) {
        (self.grades.as_flattened(), self.occupancy.as_flattened())
    }

    /// The cell a place of the levelled frame lies in.
    pub fn locate(&self, x_cm: i32, y_cm: i32) -> Option<(usize, usize)> {
        self.geometry.locate(x_cm, y_cm, R, A)
    }

    /// Least grade that counts as visible.
    pub fn visible_from(&self) -> u8 {
        self.visible_from
    }

    /// Least occupancy that counts as occupied.
    pub fn occupied_from(&self) -> u8 {
        self.occupied_from
    }
}

impl<const R: usize, const A: usize> VisibilityMap for PolarMap<R, A> {
    /// The nearest cell's state, never a better neighbour's.
    fn at(&self, point: RoadPoint) -> CellState {
        let (x, y) = self.geometry.levelling.place(point);
        self.locate(x, y).map_or(CellState::UNKNOWN, |(a, r)| self.cell(a, r))
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        let complete = self.geometry.touched(area, R, A, |azimuth, near, far| {
            (near..=far).for_each(|range| visit(self.cell(azimuth, range)));
        });
        if !complete {
            visit(CellState::UNKNOWN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Visibility;
    use crate::sensor::mount::Mount;

    /// 10 azimuths of 9 degrees from 45 degrees to the right on, 20 ranges of 2 m; a sensor at (5, -3) m.
    fn map() -> PolarMap<20, 10> {
        let mount = Mount { x_m: 5.0, y_m: -3.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let levelling = mount.levelling().unwrap();
        let geometry = PolarGeometry {
            levelling,
            cell_cm: 200,
            azimuth_origin: Angle::from_degrees(-45.0),
            azimuth_span: Angle::QUARTER.raw().unsigned_abs(),
            narrow: Narrow::NONE,
        };
        PolarMap::unknown(geometry, 100, 50)
    }

    #[test]
    fn azimuths_run_from_right_to_left_and_ranges_from_near_to_far() {
        let m = map();
        assert_eq!(m.locate(1000, -900), Some((0, 6)), "42 degrees to the right");
        assert_eq!(m.locate(1000, 900), Some((9, 6)), "to the left");
        assert_eq!(m.locate(3000, 100), Some((5, 15)));
        assert_eq!(m.locate(1000, 1100), None, "48 degrees to the left");
        assert_eq!(m.locate(1000, -1100), None);
        assert_eq!(m.locate(3999, 0), Some((5, 19)));
        assert_eq!(m.locate(4000, 0), None, "beyond the last cell");
    }

    #[test]
    fn what_is_farther_than_places_reach_is_unknown_on_the_longest_map() {
        for yaw_deg in 0_u8..120 {
            let yaw_deg = 3.0 * f32::from(yaw_deg);
            let mount = Mount { x_m: 5.0, y_m: -3.0, height_m: 6.0, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
            let geometry = PolarGeometry { levelling: mount.levelling().unwrap(), cell_cm: 3000, ..map().geometry };
            let mut m = PolarMap::<256, 10>::unknown(geometry, 100, 50);
            (0..10).for_each(|azimuth| *m.rows_mut(azimuth).unwrap().0 = [255; 256]);
            let ahead = |x_cm, y_cm| m.at(geometry.levelling.unplace(x_cm, y_cm)).visible();
            for y_cm in [-20_000, 0, 20_000] {
                assert!(ahead(40_000, y_cm), "{yaw_deg} degrees, {y_cm}");
                let far = [45_000, 46_000, 60_000, 100_000, 1_000_000];
                assert!(far.iter().all(|x_cm| !ahead(*x_cm, y_cm)), "{yaw_deg} degrees, {y_cm}");
            }
        }
    }

    #[test]
    fn a_cell_is_what_its_grade_and_its_occupancy_say() {
        let mut m = map();
        let (grades, occupancy) = m.rows_mut(4).unwrap();
        grades[..5].copy_from_slice(&[0, 1, 99, 100, 255]);
        occupancy[..5].copy_from_slice(&[200, 49, 50, 0, 255]);
        let cells: std::vec::Vec<CellState> = (0..5).map(|r| m.cell(4, r)).collect();
        assert_eq!(cells[0], CellState::UNKNOWN, "whatever its occupancy");
        use Visibility::{Invisible, Visible};
        let expected = [(Invisible, false, 1, 49), (Invisible, true, 99, 50), (Visible, false, 100, 0)];
        for (cell, (visibility, occupied, grade, occupancy)) in cells[1..].iter().zip(expected) {
            assert_eq!(*cell, CellState { visibility, grade, occupancy, occupied });
        }
        assert!(cells[4].visible() && cells[4].occupied);
        assert_eq!((m.cell(10, 0), m.cell(0, 20)), (CellState::UNKNOWN, CellState::UNKNOWN));
        m.forget();
        assert_eq!((m.cell(4, 4), m.occupancy(4)), (CellState::UNKNOWN, Some(&[0; 20])));
    }

    #[test]
    fn a_road_point_is_looked_up_from_where_the_sensor_hangs() {
        let mut m = map();
        m.rows_mut(5).unwrap().0[15] = 255;
        assert!(m.at(RoadPoint::new(3500, -200)).visible(), "30 m ahead, 1 m to the left");
        assert!(!m.at(RoadPoint::new(3000, 100)).visible());
    }
}
