//! Rates, intervals, distances and curves of every estimator of one recording.

use rayon::prelude::*;
use serde::Serialize;

use super::bootstrap::{Draws, Interval};
use super::bounds;
use super::breakdown::Breakdown;
use super::cells::CellCounts;
use super::comparison::{Comparison, compare};
use super::counts::Counts;
use super::curve::{CurvePoint, Grades, trade_off};
use super::samples::FrameSamples;
use super::score::{Score, Settled};
use super::units::{RUN_BLOCKS, Units};
use super::{Grid, Options};
use crate::recording::Recording;

/// Added to the seed for the draws of blocks, so that they are not the draws of tracks.
const BLOCK_SEED: u64 = 0x5eed_b10c;

/// One estimator, or one of the two bounds.
#[derive(Debug, Clone)]
pub struct Row {
    pub name: String,
    pub grid: Grid,
    pub counts: Counts,
    /// `None` where cells are not judged.
    pub cells: Option<CellCounts>,
    pub intervals: Intervals,
    pub to_slice: Distance,
    pub to_box: Distance,
    pub breakdown: Breakdown,
    /// Over the threshold on the grade; empty for the bounds.
    pub curve: Vec<CurvePoint>,
    pub cell_curve: Vec<CurvePoint>,
    /// Object-time-steps with no known cell under them.
    pub unknown: u64,
    pub counters: Vec<(String, u64)>,
    /// Azimuth's noise that the estimator worked with at the end, degrees, where it learns that.
    pub azimuth_noise_deg: Option<f64>,
    /// Places at which it has learnt a lane; `None` of several recordings together.
    pub learnt_lanes: Option<usize>,
    /// Without the frames whose map had not settled, where there are any.
    pub settled: Option<Settled>,
    /// Frames in which points came and could not be used, so that all was unknown.
    pub unusable: usize,
    /// Counts of each object unit, and of each block: what is drawn again.
    pub by_unit: Vec<Counts>,
    pub by_block: Vec<CellCounts>,
}

impl Row {
    pub fn cell_fvr(&self) -> Option<f64> {
        self.cells.as_ref().and_then(CellCounts::fvr)
    }

    pub fn cell_fir(&self) -> Option<f64> {
        self.cells.as_ref().and_then(CellCounts::fir)
    }
}

/// 95 % intervals of the rates.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Intervals {
    pub tvr: Option<Interval>,
    pub fvr: Option<Interval>,
    pub tir: Option<Interval>,
    pub fir: Option<Interval>,
    pub cell_fvr: Option<Interval>,
    pub cell_fir: Option<Interval>,
}

/// Signed distance of the object rates to a bound, in points; the intervals are paired.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Distance {
    pub fvr_points: Option<f64>,
    pub fir_points: Option<f64>,
    pub fvr_interval: Option<Interval>,
    pub fir_interval: Option<Interval>,
}

/// What one recording says of every estimator.
#[derive(Debug, Clone)]
pub struct Summary {
    /// Counted frames.
    pub frames: usize,
    /// All that were sampled, and those of them that are not counted. A pool of recordings has seconds here.
    pub sampled: usize,
    pub not_counted: usize,
    /// Distinct tracks counted.
    pub objects: usize,
    pub coverage_rate: Option<f64>,
    pub coverage_interval: Option<Interval>,
    /// What was drawn again for object rates, `tracks` or `frames`, and how many there are.
    pub drawn: &'static str,
    pub drawn_units: usize,
    /// What each of them is called.
    pub unit_names: Vec<String>,
    /// Blocks of about one second, of which runs are drawn again for cell rates.
    pub blocks: usize,
    /// Estimators as delivered, then `geometry-slice` and `geometry-box`.
    pub rows: Vec<Row>,
    pub comparisons: Vec<Comparison>,
}

/// Rates of each draw, shared by all that is paired.
struct Drawn {
    objects: Vec<Counts>,
    cells: Vec<CellCounts>,
    by_unit: Vec<Counts>,
    by_block: Vec<CellCounts>,
}

impl Summary {
    /// `scores` are the estimators' own; the bounds are added here.
    pub fn new(recording: &Recording, samples: &[FrameSamples], scores: &[Score], options: &Options) -> Self {
        Self::beside(recording, samples, scores, &bounds::slice(samples), options)
    }

    /// The same where `geometry-slice` is known already.
    pub fn beside(
        recording: &Recording,
        samples: &[FrameSamples],
        scores: &[Score],
        slice: &Score,
        options: &Options,
    ) -> Self {
        let units = Units::new(recording, samples);
        // without anything judged there is no rate to have an interval
        let judged = samples.iter().any(|frame| !frame.objects.is_empty())
            || scores.iter().any(|s| s.cells.iter().any(|cells| cells.counts != CellCounts::default()));
        let repetitions = if judged { options.bootstrap } else { 0 };
        let object_draws = Draws::new(units.object_units, repetitions, options.seed);
        let block_seed = options.seed.wrapping_add(BLOCK_SEED);
        let block_draws = Draws::in_runs(units.block_units, RUN_BLOCKS, repetitions, block_seed);
        let boxes = bounds::boxes(samples);
        let drawn = |score: &Score| {
            let by_unit = units.by_object(|counts: &mut Counts, frame, object| {
                let detected = samples[frame].objects[object].detected;
                counts.add(score.verdicts[frame][object].visible, detected);
            });
            let by_block = units.by_block(|counts: &mut CellCounts, frame| {
                if let Some(tally) = score.cells.get(frame) {
                    *counts += tally.counts;
                }
            });
            Drawn { objects: object_draws.totals(&by_unit), cells: block_draws.totals(&by_block), by_unit, by_block }
        };
        let (slice_draws, box_draws) = (drawn(slice), drawn(&boxes));
        let row = |score: &Score, drawn: &Drawn| {
            let counts = score.objects(samples);
            let distance = |bound: &Score, theirs: &Drawn| {
                Distance::new(counts, bound.objects(samples), &drawn.objects, &theirs.objects)
            };
            Row {
                name: score.name.clone(),
                grid: score.grid,
                counts,
                cells: (!score.cells.is_empty()).then(|| score.cell_counts()),
                intervals: Intervals::new(drawn, &block_draws),
                to_slice: distance(slice, &slice_draws),
                to_box: distance(&boxes, &box_draws),
                breakdown: Breakdown::new(recording, samples, score),
                curve: if score.graded { trade_off(&object_grades(score, samples)) } else { Vec::new() },
                cell_curve: if score.graded { trade_off(&cell_grades(score)) } else { Vec::new() },
                unknown: if score.graded { unknown(score) } else { 0 },
                counters: score.counters.clone(),
                azimuth_noise_deg: score.azimuth_noise_deg,
                learnt_lanes: score.learnt_lanes,
                settled: score.worth.settled(),
                unusable: score.worth.unusable,
                by_unit: drawn.by_unit.clone(),
                by_block: drawn.by_block.clone(),
            }
        };
        let mut rows: Vec<Row> = scores.par_iter().map(|score| row(score, &drawn(score))).collect();
        rows.extend([row(slice, &slice_draws), row(&boxes, &box_draws)]);
        Self {
            frames: samples.iter().filter(|s| s.counted).count(),
            sampled: samples.len(),
            not_counted: samples.iter().filter(|s| !s.counted).count(),
            objects: distinct_tracks(samples),
            coverage_rate: slice.objects(samples).coverage(),
            coverage_interval: Interval::of(slice_draws.objects.iter().map(Counts::coverage)),
            drawn: units.kind,
            drawn_units: units.object_units,
            unit_names: units.names.clone(),
            blocks: units.block_units,
            rows,
            comparisons: compare(
                "radar-3d",
                &["radar-2d", "radar-2d-first"],
                scores,
                samples,
                &units,
                [&object_draws, &block_draws],
            ),
        }
    }

    pub fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|r| r.name == name)
    }
}

impl Intervals {
    fn new(drawn: &Drawn, blocks: &Draws) -> Self {
        let objects = |rate: fn(&Counts) -> Option<f64>| Interval::of(drawn.objects.iter().map(rate));
        let cells = |rate: fn(&CellCounts) -> Option<f64>| blocks.interval(drawn.cells.iter().map(rate));
        Self {
            tvr: objects(Counts::tvr),
            fvr: objects(Counts::fvr),
            tir: objects(Counts::tir),
            fir: objects(Counts::fir),
            cell_fvr: cells(CellCounts::fvr),
            cell_fir: cells(CellCounts::fir),
        }
    }
}

/// `own - bound` in points; `None` where either has no rate.
pub fn points(own: Option<f64>, bound: Option<f64>) -> Option<f64> {
    own.zip(bound).map(|(a, b)| 100.0 * (a - b))
}

impl Distance {
    fn new(own: Counts, bound: Counts, own_draws: &[Counts], bound_draws: &[Counts]) -> Self {
        let paired = |rate: fn(&Counts) -> Option<f64>| {
            Interval::of(own_draws.iter().zip(bound_draws).map(|(a, b)| points(rate(a), rate(b))))
        };
        Self {
            fvr_points: points(own.fvr(), bound.fvr()),
            fir_points: points(own.fir(), bound.fir()),
            fvr_interval: paired(Counts::fvr),
            fir_interval: paired(Counts::fir),
        }
    }
}

fn object_grades(score: &Score, samples: &[FrameSamples]) -> Grades {
    let mut grades = Grades::default();
    for (frame, verdicts) in samples.iter().zip(&score.verdicts) {
        frame.objects.iter().zip(verdicts).for_each(|(s, v)| grades.add(s.detected, v.grade));
    }
    grades
}

fn cell_grades(score: &Score) -> Grades {
    let mut grades = Grades::default();
    score.cells.iter().for_each(|tally| grades.add_times(&tally.grades, 1));
    grades
}

fn unknown(score: &Score) -> u64 {
    score.verdicts.iter().flatten().filter(|v| v.grade.is_none()).count() as u64
}

fn distinct_tracks(samples: &[FrameSamples]) -> usize {
    let tracks: std::collections::BTreeSet<usize> =
        samples.iter().flat_map(|frame| frame.objects.iter().map(|s| s.track)).collect();
    tracks.len()
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::{frames, recording, sample};
    use super::super::score::made_up::score;
    use super::*;

    /// 20 tracks of 10 frames; every third is hidden, and of the hidden ones few are detected.
    fn scene() -> (Recording, Vec<FrameSamples>) {
        let hidden = |track: usize| track.is_multiple_of(3);
        let detected =
            |track: usize, k: usize| if hidden(track) { track + k == 9 } else { !(track * 7 + k).is_multiple_of(5) };
        let objects = |k| (0..20).map(|t| sample(t, 30.0 + 8.0 * t as f64, detected(t, k), !hidden(t))).collect();
        (recording(10, 20), frames((0..10).map(objects)))
    }

    fn options() -> Options {
        Options { bootstrap: 300, ..Options::default() }
    }

    #[test]
    fn an_estimator_that_is_the_bound_is_at_distance_zero_in_every_draw() {
        let (recording, samples) = scene();
        let same = score("same", &samples, |s| Some(if s.slice_in_sight { 255 } else { 0 }));
        let summary = Summary::new(&recording, &samples, &[same], &options());
        let (same, slice) = (&summary.rows[0], summary.row(bounds::SLICE).unwrap());
        assert_eq!(same.counts, slice.counts);
        assert_eq!(same.to_slice.fvr_points, Some(0.0));
        assert_eq!(same.to_slice.fvr_interval, Some(Interval(0.0, 0.0)), "paired");
        let Interval(low, high) = same.intervals.fvr.unwrap();
        assert!(low < same.counts.fvr().unwrap() && same.counts.fvr().unwrap() < high, "while the rate itself spreads");
        assert_eq!((summary.objects, summary.frames, summary.drawn_units), (20, 10, 20));
    }

    #[test]
    fn rates_without_a_denominator_have_no_distance_and_no_interval() {
        let samples = frames((0..10).map(|_| vec![sample(0, 50.0, true, true), sample(1, 60.0, true, true)]));
        let summary = Summary::new(&recording(10, 2), &samples, &[score("m", &samples, |_| Some(255))], &options());
        let row = &summary.rows[0];
        assert_eq!((row.counts.fvr(), row.intervals.fvr, row.to_slice.fvr_points), (None, None, None));
        assert_eq!((row.counts.tvr(), row.intervals.tvr), (Some(1.0), Some(Interval(1.0, 1.0))));
        assert!(row.curve.is_empty());
        assert_eq!(summary.row(bounds::BOX).unwrap().cells, None);
    }

    #[test]
    fn the_comparison_reads_the_others_at_the_estimators_own_fir() {
        let (recording, samples) = scene();
        // all visible, nothing visible, and the truth with a third of the seen lost
        let last = score("radar-2d", &samples, |_| Some(255));
        let first = score("radar-2d-first", &samples, |_| Some(0));
        let own = score("radar-3d", &samples, |s| Some(if s.slice_in_sight && s.track % 5 > 0 { 255 } else { 0 }));
        let summary = Summary::new(&recording, &samples, &[last, first, own], &options());
        let [objects] = &summary.comparisons[..] else { panic!("cells have no rates here") };
        let counts = summary.row("radar-3d").unwrap().counts;
        assert_eq!((Some(objects.at_fir), Some(objects.fvr)), (counts.fir(), counts.fvr()));
        // between the two ends lies the straight line
        assert!((objects.fvr_against - (1.0 - objects.at_fir)).abs() < 1e-12);
        let Interval(low, high) = objects.difference_interval.unwrap();
        assert!(low < objects.difference_points && objects.difference_points < high && high < 0.0);
    }

    #[test]
    fn without_draws_there_are_rates_and_no_intervals() {
        let (recording, samples) = scene();
        let m = score("m", &samples, |_| None);
        let summary = Summary::new(&recording, &samples, &[m], &Options { bootstrap: 0, ..Options::default() });
        assert_eq!(summary.rows[0].intervals, Intervals::default());
        assert_eq!(summary.rows[0].unknown, 200);
        assert_eq!(summary.rows[0].counts.fvr(), Some(0.0), "unknown is not visible");
    }
}
