//! A map's cells by a table: which are visible, and three levels of probability in two bits, rounded down.
//!
//! # Model
//! A cell has the probability of its middle. Visible is what reaches the threshold of an accepted risk, or without one
//! what reaches the map's grade. The second bit says whether p reaches the upper level.
//!
//! *Levels.* The lower two are the least that the table has for a known cell and for a visible one. Most of the cells are
//! clear: the upper level is the one at which, of the table's probabilities for those, the least is lost by rounding
//! down: the greatest (level - what is visible has anyway) times the number of those that reach it.
//!
//! p rises with the grade, so along a ray only the least grade that reaches a level is looked up, once for each bin.

use super::{GRADES, Levels, Probability, ProbabilityTable, Threshold};
use crate::fixed::bits::Bits;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::{CellState, UNKNOWN, Visibility};
use crate::sensor::road::RoadPoint;

/// No grade reaches a level.
const NO_GRADE: u16 = 256;

/// What is visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    /// What has this grade.
    Grade(u8),
    /// What has this probability.
    Probability(Probability),
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

impl Quantiser {
    /// With the threshold of an accepted risk; without one, what has the map's least visible grade is visible.
    pub fn new(table: ProbabilityTable, threshold: Option<Threshold>, visible_from: u8) -> Self {
        let rule = match threshold {
            None => Rule::Grade(visible_from),
            Some(Threshold::Everything) => Rule::Probability(Probability(0)),
            Some(Threshold::From(least)) => Rule::Probability(Probability(least)),
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

    /// What any map on this grid of ranges by azimuths says of a point, with the bit as it is sent; and the probability
    /// of its cell.
    pub fn of_point(
        &self,
        geometry: &PolarGeometry,
        grid: [usize; 2],
        state: CellState,
        point: RoadPoint,
    ) -> (CellState, Option<Probability>) {
        let Some(p) = self.table.of_point(geometry, grid, state.grade, point) else {
            return (CellState::UNKNOWN, None);
        };
        let visible = match self.rule {
            Rule::Grade(least) => state.grade >= least,
            Rule::Probability(least) => p >= least,
            Rule::Never => false,
        };
        let visibility = if visible { Visibility::Visible } else { Visibility::Invisible };
        (CellState { visibility, ..state }, Some(p))
    }

    /// Bits of an azimuth's cells: which are visible, or which reach the upper level.
    pub(crate) fn along<const R: usize, const A: usize, const W: usize>(
        &self,
        map: &PolarMap<R, A>,
        azimuth: usize,
        clear: bool,
    ) -> Bits<W> {
        let geometry = map.geometry();
        let bearing = geometry.middle_of(azimuth, A);
        let (mut bits, mut bin, mut least) = (Bits::NONE, None, NO_GRADE);
        let mut middle_cm = geometry.cell_cm / 2;
        for (cell, grade) in map.grades(azimuth).map_or(&[][..], |row| row).iter().enumerate() {
            if *grade != UNKNOWN {
                let (a, r, _) = self.table.edges.locate(*grade, middle_cm, bearing);
                if bin != Some(r) {
                    bin = Some(r);
                    least = self.least_grade(a, r, clear);
                }
                if u16::from(*grade) >= least {
                    bits.set(cell);
                }
            }
            middle_cm += geometry.cell_cm;
        }
        bits
    }

    /// The least grade in a bin that is visible, or that reaches the upper level.
    fn least_grade(&self, azimuth: usize, range: usize, clear: bool) -> u16 {
        let level = match self.rule {
            _ if clear => self.levels.clear(),
            Rule::Grade(grade) => return u16::from(grade),
            Rule::Probability(least) => least,
            Rule::Never => return NO_GRADE,
        };
        let steps = self.table.values.get(azimuth).and_then(|ranges| ranges.get(range)).map_or(&[][..], |steps| steps);
        // the least grade of each step
        let mut firsts = [1].into_iter().chain(self.table.edges.grades).zip(steps);
        firsts.find(|(_, p)| Probability(**p) >= level).map_or(NO_GRADE, |(grade, _)| u16::from(grade))
    }
}

/// Levels of a table for a rule.
fn levels(table: &ProbabilityTable, rule: Rule) -> Levels {
    let every = || table.values.as_flattened().as_flattened().iter().copied();
    let at = |step: usize| table.values.as_flattened().iter().filter_map(move |steps| steps.get(step).copied());
    let known = every().min().unwrap_or(0);
    let visible = match rule {
        Rule::Grade(grade) => at(table.edges.grades.iter().filter(|edge| grade >= **edge).count()).min(),
        Rule::Probability(least) => every().filter(|p| Probability(*p) >= least).min(),
        Rule::Never => None,
    };
    let visible = visible.unwrap_or(known);
    let [a, b, _, _] = table.check_sum().to_le_bytes();
    Levels::new(known, visible, least_lost(at(GRADES - 1), visible), u16::from_le_bytes([a, b]))
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
    use super::super::fitted_with;
    use super::super::tests::{edges, values};
    use super::*;

    fn quantiser(threshold: Option<Threshold>) -> Quantiser {
        Quantiser::new(ProbabilityTable::new(edges(), values(), 7).unwrap(), threshold, 128)
    }

    fn every() -> impl Iterator<Item = u8> {
        values().into_iter().flatten().flatten()
    }

    #[test]
    fn a_level_is_where_least_is_lost_by_rounding_down() {
        // 4 * 50, 3 * 60, 2 * 120, 1 * 200 above 0; above 100 only the last gains much
        assert_eq!(least_lost([50, 60, 120, 200].into_iter(), 0), 120);
        assert_eq!(least_lost([50, 60, 120, 200].into_iter(), 100), 200);
        assert_eq!(least_lost([50, 60].into_iter(), 100), 100, "all have more anyway");
        assert_eq!(least_lost([].into_iter(), 3), 3);
    }

    #[test]
    fn levels_are_the_least_of_what_is_known_and_of_what_is_visible_and_one_above() {
        let of = |threshold| {
            let [known, visible, clear, ..] = quantiser(threshold).levels().to_bytes();
            [known, visible, clear]
        };
        let least = every().min().unwrap();
        let [known, visible, clear] = of(Some(Threshold::From(180)));
        assert_eq!((known, visible), (least, every().filter(|p| *p >= 180).min().unwrap()));
        assert!(clear > visible, "{clear} {visible}");
        assert_eq!(of(Some(Threshold::Everything))[..2], [least; 2]);
        assert_eq!(of(Some(Threshold::Nothing))[..2], [least; 2]);
        // a grade of 128 begins a step
        assert_eq!(of(None)[1], values().iter().flatten().map(|steps| steps[6]).min().unwrap());
    }

    #[test]
    fn the_table_is_known_by_its_check_sum() {
        let quantiser = quantiser(None);
        let sum = quantiser.table().check_sum();
        let of_this_version = ProbabilityTable::new(edges(), values(), fitted_with(7)).unwrap();
        assert_eq!(u32::from(quantiser.levels().table()), sum & 0xFFFF);
        assert_eq!(of_this_version.check_sum(), of_this_version.clone().of_unit(7).unwrap().check_sum());
        assert_ne!(sum, ProbabilityTable::new(edges(), values(), 8).unwrap().check_sum());
    }

    #[test]
    fn the_least_grade_of_a_bin_is_the_first_of_the_step_that_reaches_a_level() {
        let by_180 = quantiser(Some(Threshold::From(180)));
        for (a, r) in [(0, 0), (3, 2), (7, 7)] {
            let first = [1].into_iter().chain(edges().grades).zip(values()[a][r]).find(|(_, p)| *p >= 180);
            assert_eq!(by_180.least_grade(a, r, false), first.map_or(NO_GRADE, |(grade, _)| grade.into()), "{a} {r}");
        }
        assert_eq!(quantiser(Some(Threshold::Nothing)).least_grade(0, 0, false), NO_GRADE);
        assert_eq!(quantiser(None).least_grade(0, 0, false), 128);
    }
}
