//! A map's cells by a table: which are visible, and four levels of probability in two bits, rounded down.
//!
//! # Model
//! A cell may lie in several bins of the table; it has the least of their probabilities, so that no point of it has
//! less. Visible is what reaches the threshold of an accepted risk, or without one what reaches the map's grade. The
//! finer bit says whether p reaches the level of the cell's class ([`Levels`]).
//!
//! *Levels.* Most cells of a map are clear or blocked. Of the table's probabilities for these two, each class has the
//! level at which the least is lost by rounding down: the greatest (level - what the class has anyway) times the
//! number of those that reach it.
//!
//! p rises with the grade, so along a ray only the least grade that reaches a level is looked up, once for each bin.

use super::{AZIMUTHS, GRADES, Levels, Probability, ProbabilityTable, Threshold};
use crate::fixed::bits::Bits;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::{CellState, UNKNOWN, Visibility};
use crate::sensor::road::RoadPoint;

/// How far the edges of a map's azimuths may lie from even ones, 2^-16 turn: the span is divided by 4, rounded down,
/// and places between azimuths are rounded.
const ROUNDING: i32 = 4;

/// No grade reaches a level.
const NO_GRADE: u16 = 256;

/// What is visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    /// What has this grade.
    Grade(u8),
    /// What has this probability.
    Probability(u8),
    /// Nothing.
    Never,
}

/// A unit's table, and what of it becomes bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantiser {
    table: ProbabilityTable,
    rule: Rule,
    levels: Levels,
}

/// Bins that a cell or a row of them touches, the first and the last.
type Touched = [usize; 2];

impl Quantiser {
    /// With the threshold of an accepted risk; without one, what has the map's least visible grade is visible.
    pub fn new(table: ProbabilityTable, threshold: Option<Threshold>, visible_from: u8) -> Self {
        let rule = match threshold {
            None => Rule::Grade(visible_from),
            Some(Threshold::Everything) => Rule::Probability(0),
            Some(Threshold::From(least)) => Rule::Probability(least),
            Some(Threshold::Nothing) => Rule::Never,
        };
        let levels = levels(&table, rule);
        Self { table, rule, levels }
    }

    /// What the bits say of p.
    pub fn levels(&self) -> Levels {
        self.levels
    }

    /// The table.
    pub fn table(&self) -> &ProbabilityTable {
        &self.table
    }

    /// The least probability of all points of a cell at a grade; unknown has none.
    fn of_cell(&self, azimuths: Touched, ranges: Touched, grade: u8) -> Option<Probability> {
        let step = self.step(grade)?;
        let rows = within(&self.table.values, azimuths).iter().flat_map(|rows| within(rows, ranges));
        rows.filter_map(|steps| steps.get(step).copied()).min().map(Probability::from_raw)
    }

    fn step(&self, grade: u8) -> Option<usize> {
        (grade != UNKNOWN).then(|| self.table.edges.grades.iter().filter(|edge| grade >= **edge).count())
    }

    /// Whether a known cell is visible.
    fn visible(&self, grade: u8, p: Probability) -> bool {
        match self.rule {
            Rule::Grade(least) => grade >= least,
            Rule::Probability(least) => p.raw() >= least,
            Rule::Never => false,
        }
    }

    /// What any map on this grid of ranges by azimuths says of a point, with the bit as it is sent; and its
    /// probability.
    pub fn of_point(
        &self,
        geometry: &PolarGeometry,
        [ranges, azimuths]: [usize; 2],
        state: CellState,
        point: RoadPoint,
    ) -> (CellState, Option<Probability>) {
        let (x, y) = geometry.levelling.place(point);
        let p = geometry.locate(x, y, ranges, azimuths).and_then(|(azimuth, range)| {
            let range = i32::try_from(range).ok()?;
            let far = (range + 1) * geometry.cell_cm - 1;
            let bins = [self.range_bin(range * geometry.cell_cm), self.range_bin(far)];
            self.of_cell(self.azimuth_bins(geometry, azimuth, azimuths), bins, state.grade)
        });
        let Some(known) = p.filter(|_| state.visibility != Visibility::Unknown) else {
            return (CellState::UNKNOWN, None);
        };
        let visible = self.visible(state.grade, known);
        let visibility = if visible { Visibility::Visible } else { Visibility::Invisible };
        (CellState { visibility, ..state }, p)
    }

    fn range_bin(&self, cm: i32) -> usize {
        self.table.edges.ranges_cm.iter().filter(|edge| cm >= i32::from(**edge)).count()
    }

    /// Bins that an azimuth of so many touches.
    fn azimuth_bins(&self, geometry: &PolarGeometry, azimuth: usize, azimuths: usize) -> Touched {
        let place = |azimuth: usize| {
            let part = i64::from(geometry.azimuth_span) * azimuth as i64 / azimuths.max(1) as i64;
            i64::from(geometry.azimuth_origin.raw()) + part
        };
        let (right, left) = (place(azimuth) - i64::from(ROUNDING), place(azimuth + 1) + i64::from(ROUNDING));
        let beyond = |at: i64| at < i64::from(i16::MIN) || at > i64::from(i16::MAX);
        if beyond(right) || beyond(left) {
            // behind the sensor, where angles begin again
            return [0, AZIMUTHS - 1];
        }
        [right, left].map(|at| self.table.edges.azimuths.iter().filter(|edge| at >= i64::from(**edge)).count())
    }

    /// Bits of an azimuth's cells: visible, or with `finer` the finer bit.
    pub(crate) fn along<const R: usize, const A: usize, const W: usize>(
        &self,
        map: &PolarMap<R, A>,
        azimuth: usize,
        finer: bool,
    ) -> Bits<W> {
        let geometry = map.geometry();
        let azimuths = self.azimuth_bins(geometry, azimuth, A);
        let (mut bits, mut bins, mut least) = (Bits::NONE, [usize::MAX; 2], [NO_GRADE; 3]);
        let mut near_cm = 0;
        for (cell, grade) in map.grades(azimuth).map_or(&[][..], |row| row).iter().enumerate() {
            let far_cm = near_cm + geometry.cell_cm;
            if *grade != UNKNOWN {
                let touched = [self.range_bin(near_cm), self.range_bin(far_cm - 1)];
                if touched != bins {
                    (bins, least) = (touched, self.least_grades(azimuths, touched));
                }
                let [visible, clear, hidden] = least;
                let seen = u16::from(*grade) >= visible;
                let reached = u16::from(*grade) >= if seen { clear } else { hidden };
                if if finer { reached } else { seen } {
                    bits.set(cell);
                }
            }
            near_cm = far_cm;
        }
        bits
    }

    /// The least grades in these bins for visible, and for the finer bit where visible and where not.
    fn least_grades(&self, azimuths: Touched, ranges: Touched) -> [u16; 3] {
        // the least grade of each step
        let firsts = [1].into_iter().chain(self.table.edges.grades);
        let reaching = |least: u8| {
            let found = firsts.clone().find(|grade| self.of_cell(azimuths, ranges, *grade) >= Some(Probability(least)));
            found.map_or(NO_GRADE, u16::from)
        };
        let visible = match self.rule {
            Rule::Grade(grade) => u16::from(grade),
            Rule::Probability(least) => reaching(least),
            Rule::Never => NO_GRADE,
        };
        [visible, reaching(self.levels.finer(true)), reaching(self.levels.finer(false))]
    }
}

fn within<T>(all: &[T], [first, last]: Touched) -> &[T] {
    all.get(first..=last).unwrap_or(&[])
}

/// Levels of a table for a rule.
fn levels(table: &ProbabilityTable, rule: Rule) -> Levels {
    let all = || table.values.as_flattened();
    let at = |step: usize| all().iter().filter_map(move |steps| steps.get(step).copied());
    let everywhere = at(0).chain(at(GRADES - 1));
    let (hidden, visible, clear) = match rule {
        Rule::Grade(grade) => {
            let step = table.edges.grades.iter().filter(|edge| grade >= **edge).count();
            let visible = at(step).min().unwrap_or(0);
            (least_lost(at(0), 0), visible, least_lost(at(GRADES - 1), visible))
        }
        Rule::Probability(least) => {
            let visible = all().as_flattened().iter().copied().filter(|p| *p >= least).min().unwrap_or(least);
            let hidden = least_lost(everywhere.clone().filter(|p| *p < least), 0);
            (hidden, visible, least_lost(everywhere.filter(|p| *p >= least), visible))
        }
        Rule::Never => {
            let hidden = least_lost(everywhere, 0);
            (hidden, hidden, hidden)
        }
    };
    let [a, b, _, _] = table.check_sum().to_le_bytes();
    Levels::new(hidden, visible, clear, u16::from_le_bytes([a, b]))
}

/// The level at which least is lost of these probabilities by rounding down to it or to what they have anyway.
fn least_lost(of: impl Iterator<Item = u8> + Clone, anyway: u8) -> u8 {
    let gain = |level: u8| {
        let reached = of.clone().filter(|p| *p >= level).count();
        reached * usize::from(level.saturating_sub(anyway))
    };
    of.clone().max_by_key(|level| gain(*level)).unwrap_or(anyway).max(anyway)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{edges, values};
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::map::polar::column;
    use crate::sensor::mount::Levelling;

    fn geometry(azimuth_origin: i16, azimuth_span: u16) -> PolarGeometry {
        let (azimuth_origin, levelling) = (Angle::from_raw(azimuth_origin), Levelling::NOWHERE);
        PolarGeometry { levelling, cell_cm: 250, azimuth_origin, azimuth_span }
    }

    fn quantiser(threshold: Option<Threshold>) -> Quantiser {
        Quantiser::new(ProbabilityTable::new(edges(), values(), 7).unwrap(), threshold, 128)
    }

    #[test]
    fn an_azimuth_touches_the_bins_of_all_bearings_in_it() {
        let quantiser = quantiser(None);
        for (origin, span, azimuths) in
            [(-10_000, 20_000, 40), (-10_967, 21_935, 120), (-3001, 6002, 7), (-4000, 9997, 128), (20_000, 30_000, 30)]
        {
            let (geometry, mut seen) = (geometry(origin, span), 0);
            for raw in i16::MIN..=i16::MAX {
                let bearing = Angle::from_raw(raw);
                let Some(azimuth) = column(bearing - geometry.azimuth_origin, span, azimuths) else { continue };
                let [first, last] = quantiser.azimuth_bins(&geometry, azimuth, azimuths);
                let (bin, _, _) = quantiser.table.edges().locate(1, 0, bearing);
                assert!((first..=last).contains(&bin), "{raw} in azimuth {azimuth} of {azimuths}, bin {bin}");
                seen += 1;
            }
            assert!(seen > usize::from(span.min(30_000) / 2), "{seen} bearings of {span}");
        }
    }

    #[test]
    fn a_cell_has_the_least_probability_of_the_bins_it_touches() {
        let quantiser = quantiser(None);
        // rises with the grade and the azimuth, falls with range
        let p = |azimuths, ranges, grade| quantiser.of_cell(azimuths, ranges, grade).map(Probability::raw);
        assert_eq!(p([3, 3], [2, 2], 255), Some(values()[3][2][GRADES - 1]));
        assert_eq!(p([3, 4], [2, 3], 255), Some(values()[3][3][GRADES - 1]));
        assert_eq!(p([3, 4], [2, 3], 1), Some(values()[3][3][0]));
        assert_eq!(p([0, 7], [0, 7], UNKNOWN), None);
    }

    #[test]
    fn a_level_is_where_least_is_lost_by_rounding_down() {
        // 4 * 50, 2 * 120, 1 * 200 above 0; above 100 only the last gains much
        assert_eq!(least_lost([50, 60, 120, 200].into_iter(), 0), 120);
        assert_eq!(least_lost([50, 60, 120, 200].into_iter(), 100), 200);
        assert_eq!(least_lost([50, 60].into_iter(), 100), 100, "all have more anyway");
        assert_eq!(least_lost([].into_iter(), 3), 3);
    }

    #[test]
    fn with_a_risk_the_classes_lie_on_both_sides_of_its_threshold() {
        let all = || values().into_iter().flatten().flatten();
        let of = |threshold| {
            let [hidden, visible, clear, ..] = quantiser(Some(threshold)).levels().to_bytes();
            [hidden, visible, clear]
        };
        let [hidden, visible, clear] = of(Threshold::From(180));
        assert!(hidden < 180 && hidden > 0, "{hidden}");
        assert_eq!(visible, all().filter(|p| *p >= 180).min().unwrap());
        assert!(clear > visible, "{clear} {visible}");
        assert_eq!(of(Threshold::Everything)[1], all().min().unwrap());
        let [hidden, visible, clear] = of(Threshold::Nothing);
        assert!(hidden == clear && visible == clear && clear > 0);
    }

    #[test]
    fn without_a_risk_visible_is_what_the_grade_says() {
        let quantiser = quantiser(None);
        // 128 begins a step
        let least = values().iter().flatten().map(|steps| steps[6]).min().unwrap();
        assert_eq!(quantiser.levels().to_bytes()[1], least);
        assert_eq!(quantiser.least_grades([0, 0], [0, 0])[0], 128);
        let [a, b, _, _] = quantiser.table().check_sum().to_be_bytes();
        assert_ne!([a, b], [0, 0]);
        assert_eq!(u32::from(quantiser.levels().table()), quantiser.table().check_sum() & 0xFFFF);
    }
}
