//! How probable it is that the sensor would detect a vehicle at a place, read from a table.
//!
//! A grade says how clear the line of sight is. It does not say how often a radar misses what is in sight, nor how
//! often it detects what is hidden all the same, by a bounce under a truck: those depend on range and azimuth and
//! are counted on labelled recordings. The table is fitted there, on a PC, and looked up here in integers.
//!
//! # Model
//! p = P(a vehicle there is detected | grade, range, azimuth), of all kinds of vehicles together. The table has steps:
//! [`GRADES`] of the grade, in each of [`AZIMUTHS`] x [`RANGES`] bins of place, and p never falls as the grade rises.
//! An unknown cell has no probability.
//!
//! [`Threshold`] makes a bit of it, so that an accepted risk is kept. [`Quantiser`] makes two bits of a map's cells for
//! the wire, and [`Levels`] is what these say to a receiver.
//!
//! # Limits
//! [`BLOCK_LEN`] bytes stored, no more in memory than twice that. A look-up takes at most 25 comparisons.

mod block;
mod levels;
mod quantiser;
mod threshold;

pub use block::BLOCK_LEN;
pub use levels::Levels;
pub use quantiser::Quantiser;
pub use threshold::{Counted, Threshold};

use crate::estimator::ESTIMATOR_VERSION;
use crate::fixed::angle::Angle;
use crate::fixed::bytes;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::query::Footprint;
use crate::map::{UNKNOWN, VisibilityMap};
use crate::sensor::road::RoadPoint;

/// Steps of the grade.
pub const GRADES: usize = 12;
/// Bins of range.
pub const RANGES: usize = 8;
/// Bins of azimuth.
pub const AZIMUTHS: usize = 8;

/// Where steps and bins begin. The first of each begins before all values, so each has one edge less than bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edges {
    /// Least grade of every step but the first.
    pub grades: [u8; GRADES - 1],
    /// Least range of every bin but the nearest, centimetres along the ground.
    pub ranges_cm: [u16; RANGES - 1],
    /// Right edge of every bin but the rightmost, from the boresight's heading, 2^-16 turn.
    pub azimuths: [i16; AZIMUTHS - 1],
}

impl Edges {
    /// The step and the bins (azimuth, range, grade) of a grade at a place.
    pub fn locate(&self, grade: u8, range_cm: i32, azimuth: Angle) -> (usize, usize, usize) {
        let passed = |n: usize, most: usize| n.min(most - 1);
        (
            passed(self.azimuths.iter().filter(|edge| azimuth.raw() >= **edge).count(), AZIMUTHS),
            passed(self.ranges_cm.iter().filter(|edge| range_cm >= i32::from(**edge)).count(), RANGES),
            passed(self.grades.iter().filter(|edge| grade >= **edge).count(), GRADES),
        )
    }

    /// The first kind of edges that do not rise.
    fn unordered(&self) -> Option<&'static str> {
        fn rises<T: PartialOrd>(edges: &[T]) -> bool {
            edges.is_sorted_by(|a, b| a < b)
        }
        let kinds =
            [("grades", rises(&self.grades)), ("ranges", rises(&self.ranges_cm)), ("azimuths", rises(&self.azimuths))];
        kinds.into_iter().find(|(_, rises)| !rises).map(|(kind, _)| kind)
    }
}

/// Probabilities by azimuth, range and step of the grade, each in 1/255.
pub type Values = [[[u8; GRADES]; RANGES]; AZIMUTHS];

/// A probability.
///
/// # Units
/// 1/255.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Probability(u8);

impl Probability {
    /// From 1/255.
    pub const fn from_raw(raw: u8) -> Self {
        Self(raw)
    }

    /// In 1/255.
    pub const fn raw(self) -> u8 {
        self.0
    }
}

/// Why a table is not used. The unit goes on with grades.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TableError {
    /// No table was ever written here, or something else.
    Empty,
    /// Cut off.
    Short,
    /// Of another version, or with other numbers of steps and bins.
    Layout,
    /// The check sum does not hold.
    CheckSum,
    /// Edges of this kind do not rise.
    Edges(&'static str),
    /// The probability falls as the grade rises, in this bin.
    NotMonotone {
        /// Counted from the right.
        azimuth: usize,
        /// Counted from the nearest.
        range: usize,
    },
    /// Fitted with another mount, configuration or [version of the estimator](ESTIMATOR_VERSION).
    Configuration {
        /// The table's fingerprint.
        table: u32,
        /// That of a table of this unit.
        unit: u32,
    },
}

impl core::fmt::Display for TableError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "no probability table"),
            Self::Short => write!(f, "the probability table is cut off"),
            Self::Layout => write!(f, "the probability table has another version or size"),
            Self::CheckSum => write!(f, "the probability table's check sum does not hold"),
            Self::Edges(kind) => write!(f, "the probability table's edges of {kind} do not rise"),
            Self::NotMonotone { azimuth, range } => {
                write!(f, "the probability table falls with the grade, in azimuth {azimuth}, range {range}")
            }
            Self::Configuration { table, unit } => write!(
                f,
                "the probability table was fitted with configuration {table:08x}, this is {unit:08x}; fit one for this mount, these settings and version {ESTIMATOR_VERSION} of the estimator"
            ),
        }
    }
}

impl core::error::Error for TableError {}

/// Fingerprint of a table that is fitted to the maps of a unit: that of the unit's configuration (`Settings::fingerprint`)
/// together with [`ESTIMATOR_VERSION`], low bytes first.
pub fn fitted_with(unit: u32) -> u32 {
    let ([a, b, c, d], [low, high]) = (unit.to_le_bytes(), ESTIMATOR_VERSION.to_le_bytes());
    bytes::fingerprint(&[a, b, c, d, low, high])
}

/// Probabilities of one unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProbabilityTable {
    edges: Edges,
    values: Values,
    fingerprint: u32,
}

impl ProbabilityTable {
    /// A table with this fingerprint, see [`fitted_with`].
    ///
    /// # Errors
    /// Edges that do not rise, and a bin in which the probability falls as the grade rises.
    pub fn new(edges: Edges, values: Values, fingerprint: u32) -> Result<Self, TableError> {
        if let Some(kind) = edges.unordered() {
            return Err(TableError::Edges(kind));
        }
        for (azimuth, ranges) in values.iter().enumerate() {
            for (range, steps) in ranges.iter().enumerate() {
                if !steps.is_sorted() {
                    return Err(TableError::NotMonotone { azimuth, range });
                }
            }
        }
        Ok(Self { edges, values, fingerprint })
    }

    /// The table, if it was fitted to the maps of a unit with this fingerprint (`Settings::fingerprint`) by this version of the
    /// estimator.
    ///
    /// # Errors
    /// It is of another.
    pub fn of_unit(self, unit: u32) -> Result<Self, TableError> {
        let (table, unit) = (self.fingerprint, fitted_with(unit));
        if table == unit { Ok(self) } else { Err(TableError::Configuration { table, unit }) }
    }

    /// Where its steps and bins begin.
    pub fn edges(&self) -> &Edges {
        &self.edges
    }

    /// All of it.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// What it was fitted with, see [`fitted_with`].
    pub fn fingerprint(&self) -> u32 {
        self.fingerprint
    }

    /// Probability at a grade, a ground range and an azimuth from the boresight's heading (+ left); unknown has none.
    pub fn look_up(&self, grade: u8, range_cm: i32, azimuth: Angle) -> Option<Probability> {
        if grade == UNKNOWN {
            return None;
        }
        let (a, r, g) = self.edges.locate(grade, range_cm, azimuth);
        self.values.get(a)?.get(r)?.get(g).copied().map(Probability)
    }

    /// Probability at a point of a map of the unit, that of the cell it lies in; unknown has none.
    pub fn at<const R: usize, const A: usize>(&self, map: &PolarMap<R, A>, point: RoadPoint) -> Option<Probability> {
        self.of_point(map.geometry(), [R, A], map.at(point).grade, point)
    }

    /// The same at a grade that a map on this grid of ranges by azimuths has at a point: p at the middle of its cell.
    pub(crate) fn of_point(
        &self,
        geometry: &PolarGeometry,
        [ranges, azimuths]: [usize; 2],
        grade: u8,
        point: RoadPoint,
    ) -> Option<Probability> {
        let (x, y) = geometry.levelling.place(point);
        let (azimuth, range) = geometry.locate(x, y, ranges, azimuths)?;
        self.in_cell(geometry, azimuths, grade, [azimuth, range])
    }

    /// The same of a cell by its numbers, of a map of so many azimuths.
    pub fn in_cell(
        &self,
        geometry: &PolarGeometry,
        azimuths: usize,
        grade: u8,
        [azimuth, range]: [usize; 2],
    ) -> Option<Probability> {
        let middle_cm = i32::try_from(range).ok()? * geometry.cell_cm + geometry.cell_cm / 2;
        self.look_up(grade, middle_cm, geometry.middle_of(azimuth, azimuths))
    }

    /// Of vehicles that are somewhere in an area, the share that is expected to be missed, mean(1 - p) over its cells,
    /// rounded up. Unknown cells count as missed. `None` for an area larger than queries look at.
    ///
    /// This is not the FVR: it is of all vehicles, the FVR of those that were missed.
    pub fn expected_missed<const R: usize, const A: usize>(
        &self,
        map: &PolarMap<R, A>,
        area: &Footprint,
    ) -> Option<Probability> {
        expected_missed(area, |cell| self.at(map, cell))
    }
}

/// mean(1 - p) over an area's cells, rounded up; what has no probability counts as missed. `None` for an area larger
/// than queries look at.
pub(crate) fn expected_missed(area: &Footprint, at: impl Fn(RoadPoint) -> Option<Probability>) -> Option<Probability> {
    let (mut cells, mut missed) = (0_u32, 0_u32);
    let complete = area.each_cell(|cell| {
        cells = cells.saturating_add(1);
        missed = missed.saturating_add(u32::from(u8::MAX - at(cell).map_or(0, Probability::raw)));
    });
    let mean = missed.div_ceil(cells.max(1));
    u8::try_from(mean).ok().filter(|_| complete && cells > 0).map(Probability)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::trig::Direction;
    use crate::map::polar::PolarGeometry;
    use crate::sensor::mount::Mount;

    pub(super) fn edges() -> Edges {
        Edges {
            grades: [2, 26, 51, 76, 102, 128, 153, 179, 204, 230, 255],
            ranges_cm: [1000, 2000, 3000, 4000, 5000, 6000, 7000],
            azimuths: [-3000, -2000, -1000, 0, 1000, 2000, 3000],
        }
    }

    /// Rises with the grade, falls with range, and is a little more on the left.
    pub(super) fn values() -> Values {
        core::array::from_fn(|a| {
            core::array::from_fn(|r| core::array::from_fn(|g| (70 + 14 * g + a).saturating_sub(8 * r) as u8))
        })
    }

    fn table() -> ProbabilityTable {
        ProbabilityTable::new(edges(), values(), 7).unwrap()
    }

    fn map() -> PolarMap<20, 10> {
        let mount = Mount { x_m: 5.0, y_m: -3.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let geometry = PolarGeometry {
            levelling: mount.levelling().unwrap(),
            cell_cm: 400,
            azimuth_origin: Angle::from_degrees(-45.0),
            azimuth_span: Angle::QUARTER.raw().unsigned_abs(),
            narrow: crate::map::azimuths::Narrow::NONE,
        };
        let mut map = PolarMap::unknown(geometry, 128, 128);
        for a in 0..10 {
            *map.rows_mut(a).unwrap().0 = [255; 20];
        }
        map
    }

    #[test]
    fn a_value_belongs_to_the_bin_it_lies_in_and_an_edge_to_the_bin_it_begins() {
        let t = table();
        let p = |g, cm, a| t.look_up(g, cm, Angle::from_raw(a)).unwrap().raw();
        assert_eq!(p(1, 0, -9000), 70);
        assert_eq!((p(254, 0, -9000), p(255, 0, -9000)), (70 + 140, 70 + 154));
        assert_eq!((p(1, 999, -9000), p(1, 1000, -9000), p(1, 90_000, -9000)), (70, 62, 14));
        assert_eq!((p(1, 0, -3001), p(1, 0, -3000), p(1, 0, 9000)), (70, 71, 77), "azimuths count from the right");
        assert_eq!(t.look_up(0, 100, Angle::ZERO), None, "unknown");
    }

    #[test]
    fn a_higher_grade_never_has_a_lower_probability_and_a_table_that_says_so_is_refused_by_its_bin() {
        let mut wrong = values();
        wrong[3][5][6] = wrong[3][5][7] + 1;
        let refused = ProbabilityTable::new(edges(), wrong, 0).unwrap_err();
        assert_eq!(refused, TableError::NotMonotone { azimuth: 3, range: 5 });
        let mut unordered = edges();
        unordered.ranges_cm[2] = unordered.ranges_cm[1];
        assert_eq!(ProbabilityTable::new(unordered, values(), 0).unwrap_err(), TableError::Edges("ranges"));
        let t = table();
        for cm in (0..9000).step_by(700) {
            for a in (-4000..4000).step_by(900) {
                let p = |g| t.look_up(g, cm, Angle::from_raw(a)).unwrap();
                assert!((2..=255).all(|g| p(g) >= p(g - 1)));
            }
        }
    }

    #[test]
    fn a_table_of_another_unit_is_refused() {
        let table = |fingerprint| ProbabilityTable::new(edges(), values(), fingerprint).unwrap();
        let [of_7, of_8] = [7, 8].map(fitted_with);
        assert_eq!(table(of_7).of_unit(8), Err(TableError::Configuration { table: of_7, unit: of_8 }));
        assert!(table(of_7).of_unit(7).is_ok());
    }

    #[test]
    fn a_table_of_another_version_of_the_estimator_is_refused() {
        let of = |version: u16| {
            let bytes = [&7_u32.to_le_bytes()[..], &version.to_le_bytes()].concat();
            ProbabilityTable::new(edges(), values(), bytes::fingerprint(&bytes)).unwrap()
        };
        assert!(of(ESTIMATOR_VERSION).of_unit(7).is_ok());
        for version in [0, ESTIMATOR_VERSION - 1, ESTIMATOR_VERSION + 1] {
            let refused = of(version).of_unit(7).unwrap_err();
            assert!(matches!(refused, TableError::Configuration { .. }));
            assert!(std::format!("{refused}").ends_with("of the estimator"));
        }
        // those of before versions, of a configuration alone
        assert!(ProbabilityTable::new(edges(), values(), 7).unwrap().of_unit(7).is_err());
    }

    #[test]
    fn a_point_is_looked_up_by_where_it_lies_from_the_sensor() {
        let (t, mut m) = (table(), map());
        // the sensor looks along the road's y axis: its left is the road's -x
        let at = |m: &PolarMap<20, 10>, ahead_cm: i32, left_cm: i32| {
            t.at(m, RoadPoint::new(500 - left_cm, -300 + ahead_cm)).map(Probability::raw)
        };
        let expected = |a: usize, r: usize| Some(values()[a][r][GRADES - 1]);
        assert_eq!(at(&m, 1500, 0), expected(4, 1));
        assert_eq!(at(&m, 3000, 600), expected(6, 3), "11 degrees to the left, 30.6 m away");
        assert_eq!(at(&m, 3000, -600), expected(1, 3));
        assert_eq!(at(&m, -3000, 0), None, "behind the sensor");
        m.forget();
        assert_eq!(at(&m, 1500, 0), None);
    }

    #[test]
    fn an_area_misses_the_mean_of_its_cells_and_all_of_what_is_unknown() {
        let (t, mut m) = (table(), map());
        let area = |ahead_cm: i32, half_length_cm: i32| Footprint {
            centre: RoadPoint::new(500, -300 + ahead_cm),
            heading: Direction::AHEAD,
            half_length_cm,
            half_width_cm: 50,
        };
        let missed = |m: &PolarMap<20, 10>, area: &Footprint| t.expected_missed(m, area).map(Probability::raw);
        // two cells across the boresight, one in azimuth bin 3 and one in 4
        let two = (0..2).map(|k| 255 - u32::from(values()[3 + k][2][GRADES - 1])).sum::<u32>();
        assert_eq!(missed(&m, &area(2550, 90)).map(u32::from), Some(two.div_ceil(2)));
        assert_eq!(missed(&m, &area(2550, 20_000)), None, "larger than queries look at");
        m.forget();
        assert_eq!(missed(&m, &area(2550, 90)), Some(255));
    }
}
