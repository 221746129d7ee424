//! Two estimators at the same false invisible rate, on their trade-off curves.
//!
//! # Model
//! Estimator A works at its own (FIR, FVR). B is given every threshold, and every mixture of its
//! settings ([`super::curve::Envelope`], which favours B), and read at A's FIR. The interval is
//! paired: each draw moves both.

use serde::Serialize;

use super::bootstrap::{Draws, Interval};
use super::cells::CellCounts;
use super::counts::Counts;
use super::curve::{Envelope, Grades, trade_off};
use super::samples::FrameSamples;
use super::score::Score;
use super::units::Units;

/// FVR of one estimator beside the best of some others at its own FIR.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// `objects` or `cells`.
    pub of: &'static str,
    pub estimator: String,
    pub against: Vec<String>,
    /// The estimator's own FIR, where both are read.
    pub at_fir: f64,
    pub fvr: f64,
    pub fvr_against: f64,
    /// Difference of the two FVR in points; below 0 the estimator is better.
    pub difference_points: f64,
    pub difference_interval: Option<Interval>,
}

/// An estimator's bits and grades, by unit of the bootstrap.
struct Tallies {
    /// What the bits say. Objects are entered as cells: detected as clear, undetected as blocked.
    bits: Vec<CellCounts>,
    grades: Vec<Vec<(u16, u64)>>,
}

impl Tallies {
    fn of_objects(score: &Score, samples: &[FrameSamples], units: &Units) -> Self {
        let both = units.by_object(|(counts, grades): &mut (Counts, Grades), frame, object| {
            let (verdict, sample) = (score.verdicts[frame][object], &samples[frame].objects[object]);
            counts.add(verdict.visible, sample.detected);
            grades.add(sample.detected, verdict.grade);
        });
        let bits = |c: &Counts| CellCounts {
            blocked: c.fv + c.ti,
            blocked_visible: c.fv,
            clear: c.tv + c.fi,
            clear_not_visible: c.fi,
        };
        Self {
            bits: both.iter().map(|(c, _)| bits(c)).collect(),
            grades: both.iter().map(|(_, g)| g.sparse()).collect(),
        }
    }

    fn of_cells(score: &Score, units: &Units) -> Self {
        let both = units.by_block(|(counts, grades): &mut (CellCounts, Grades), frame| {
            let Some(tally) = score.cells.get(frame) else { return };
            *counts += tally.counts;
            grades.add_times(&tally.grades, 1);
        });
        Self { bits: both.iter().map(|(c, _)| *c).collect(), grades: both.iter().map(|(_, g)| g.sparse()).collect() }
    }

    /// (FIR, FVR) of the bits when each unit comes `times` often.
    fn point(&self, times: &[u32]) -> Option<(f64, f64)> {
        let mut total = CellCounts::default();
        self.bits.iter().zip(times).for_each(|(&unit, &n)| total += unit * u64::from(n));
        total.fir().zip(total.fvr())
    }

    /// Every setting of the threshold, and the bits themselves.
    fn settings(&self, times: &[u32]) -> Vec<(f64, f64)> {
        let mut grades = Grades::default();
        self.grades.iter().zip(times).for_each(|(unit, &n)| grades.add_sparse(unit, u64::from(n)));
        trade_off(&grades).iter().map(|p| (p.fir, p.fvr)).chain(self.point(times)).collect()
    }
}

/// Compares `estimator` with the lower envelope of `against`, over objects and over cells. Missing
/// estimators and rates without a denominator give no comparison.
pub fn compare(
    estimator: &str,
    against: &[&str],
    scores: &[Score],
    samples: &[FrameSamples],
    units: &Units,
    draws: [&Draws; 2],
) -> Vec<Comparison> {
    let find = |name: &str| scores.iter().find(|s| s.name == name);
    let others: Vec<&Score> = against.iter().filter_map(|name| find(name)).collect();
    let Some(own) = find(estimator).filter(|_| others.len() == against.len()) else { return Vec::new() };
    let objects = |s: &Score| Tallies::of_objects(s, samples, units);
    let cells = |s: &Score| Tallies::of_cells(s, units);
    let both = [
        ("objects", objects(own), others.iter().map(|s| objects(s)).collect::<Vec<_>>(), units.object_units),
        ("cells", cells(own), others.iter().map(|s| cells(s)).collect(), units.block_units),
    ];
    both.into_iter()
        .zip(draws)
        .filter_map(|((of, own, others, count), draws)| {
            let once = vec![1; count];
            let (at_fir, fvr, fvr_against) = read(&own, &others, &once)?;
            let differences = draws.iter().map(|times| read(&own, &others, times).map(|(_, a, b)| 100.0 * (a - b)));
            Some(Comparison {
                of,
                estimator: estimator.to_owned(),
                against: against.iter().map(|&name| name.to_owned()).collect(),
                at_fir,
                fvr,
                fvr_against,
                difference_points: 100.0 * (fvr - fvr_against),
                difference_interval: draws.interval(differences),
            })
        })
        .collect()
}

/// Own FIR and FVR, and the others' FVR at that FIR.
fn read(own: &Tallies, others: &[Tallies], times: &[u32]) -> Option<(f64, f64, f64)> {
    let (fir, fvr) = own.point(times)?;
    let envelope = Envelope::new(others.iter().flat_map(|o| o.settings(times)));
    Some((fir, fvr, envelope.fvr_at(fir)))
}
