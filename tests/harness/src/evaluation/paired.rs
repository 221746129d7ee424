//! Two runs over the same samples: is one better, or is the difference chance?
//!
//! # Model
//! Both runs' counts are drawn again together, the same tracks (for cells: the same runs of seconds) of each, and the
//! rates' difference is taken in every draw. What both have in common drops out, so the intervals are far narrower than
//! those of the rates themselves. Both are of one recording: what another drive of the same traffic, another noise would
//! give is not in them.

use serde::Serialize;

use super::bootstrap::{Draws, Interval};
use super::cells::CellCounts;
use super::counts::Counts;
use super::units::RUN_BLOCKS;

/// What one estimator of one run counted, by unit and by block.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Counted {
    pub by_unit: Vec<Counts>,
    pub by_block: Vec<CellCounts>,
}

/// A rate of two runs. Shares; the difference is the second's less the first's, in points, below 0 better.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    pub rate: &'static str,
    pub before: Option<f64>,
    pub after: Option<f64>,
    pub points: Option<f64>,
    pub interval: Option<Interval>,
}

impl Difference {
    /// What can be said of it; nothing where a run lacks the rate.
    pub fn verdict(&self) -> &'static str {
        match self.interval {
            Some(Interval(_, high)) if high < 0.0 => "better",
            Some(Interval(low, _)) if low > 0.0 => "worse",
            Some(_) => "not distinct",
            None if self.points.is_some() => "n/a",
            None => "",
        }
    }
}

/// FVR, FIR, those of cells, and the sum of all that both runs have.
const RATES: [&str; 5] = ["FVR", "FIR", "cell FVR", "cell FIR", "sum"];
/// The first rate that runs of blocks are drawn for.
const OF_CELLS: usize = 2;
const SUM: usize = 4;

type Rates = [Option<f64>; 5];

fn rates(objects: &Counts, cells: &CellCounts) -> Rates {
    let own = [objects.fvr(), objects.fir(), cells.fvr(), cells.fir()];
    let sum = own.iter().flatten().sum();
    let [fvr, fir, cell_fvr, cell_fir] = own;
    [fvr, fir, cell_fvr, cell_fir, own.iter().any(Option::is_some).then_some(sum)]
}

/// Every rate of two runs of the same units and blocks; the caller has made sure that they are.
pub fn differences(before: &Counted, after: &Counted, repetitions: u32, seed: u64) -> Vec<Difference> {
    let units = Draws::new(before.by_unit.len(), repetitions, seed);
    let blocks = Draws::in_runs(before.by_block.len(), RUN_BLOCKS, repetitions, seed.wrapping_add(1));
    let once = |run: &Counted| {
        let (mut objects, mut cells) = (Counts::default(), CellCounts::default());
        run.by_unit.iter().for_each(|&c| objects += c);
        run.by_block.iter().for_each(|&c| cells += c);
        rates(&objects, &cells)
    };
    let drawn = |run: &Counted, once: &Rates| -> Vec<Rates> {
        let mut objects = units.totals(&run.by_unit);
        let mut cells = blocks.totals(&run.by_block);
        // what is not drawn has no rates, and neither has the sum of a run that has them
        cells.resize(objects.len().max(cells.len()), CellCounts::default());
        objects.resize(cells.len(), Counts::default());
        let whole = |mut draw: Rates| {
            let lacks = once.iter().zip(&draw).any(|(once, drawn)| once.is_some() && drawn.is_none());
            draw[SUM] = draw[SUM].filter(|_| !lacks);
            draw
        };
        objects.iter().zip(&cells).map(|(o, c)| whole(rates(o, c))).collect()
    };
    let [a, b] = [once(before), once(after)];
    let (drawn_a, drawn_b) = (drawn(before, &a), drawn(after, &b));
    let points = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| 100.0 * (b - a));
    (0..RATES.len())
        .map(|k| Difference {
            rate: RATES[k],
            before: a[k],
            after: b[k],
            points: points(a[k], b[k]),
            interval: {
                let drawn = drawn_a.iter().zip(&drawn_b).map(|(a, b)| points(a[k], b[k]));
                if k < OF_CELLS { Interval::of(drawn) } else { blocks.interval(drawn) }
            },
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;

    /// 40 tracks that differ much among each other; the second run misses `more` more of each.
    fn run(more: u64) -> Counted {
        let unit = |k: u64| Counts { tv: 50, fi: 10 + k, fv: k % 7 * 5 + more, ti: 60 - k % 7 * 5 - more };
        let block = |k: u64| CellCounts { blocked: 100, blocked_visible: k % 9 * 8, clear: 900, clear_not_visible: 9 };
        Counted { by_unit: (0..40).map(unit).collect(), by_block: (0..90).map(block).collect() }
    }

    fn of<'a>(all: &'a [Difference], rate: &str) -> &'a Difference {
        all.iter().find(|d| d.rate == rate).unwrap()
    }

    #[test]
    fn a_small_difference_of_every_track_is_found_beneath_a_large_spread() {
        let all = differences(&run(0), &run(2), 500, 1);
        let fvr = of(&all, "FVR");
        assert!((fvr.points.unwrap() - 100.0 * 2.0 / 60.0).abs() < 1e-9, "second less first: {fvr:?}");
        let Interval(low, high) = fvr.interval.unwrap();
        assert!(low > 3.3 && high < 3.4, "all units have the same total: {low} {high}");
        assert_eq!((fvr.verdict(), of(&all, "FIR").verdict()), ("worse", "not distinct"));
        assert_eq!(of(&all, "sum").verdict(), "worse");
        assert_eq!(of(&differences(&run(2), &run(0), 500, 1), "FVR").verdict(), "better");
    }

    #[test]
    fn a_difference_in_one_track_alone_is_not_distinct() {
        let mut one = run(0);
        one.by_unit[3].fv += 9;
        one.by_unit[3].ti -= 9;
        let fvr = of(&differences(&run(0), &one, 500, 1), "FVR").clone();
        assert!(fvr.points.unwrap() > 0.3 && fvr.verdict() == "not distinct", "{fvr:?}");
    }

    /// Blocks whose share of wrong cells stays the same for 8 s and is then another, begun anywhere in the first.
    fn stretches(blocks: usize, random: &mut Pcg64) -> Vec<CellCounts> {
        let mut any = |below: u64| ((u128::from(random.next_u64()) * u128::from(below)) >> 64) as u64;
        let begun = any(8) as usize;
        let wrong: Vec<u64> = (0..=blocks / 8 + 1).map(|_| any(400)).collect();
        (0..blocks)
            .map(|k| CellCounts { blocked: 1000, blocked_visible: wrong[(k + begun) / 8], ..CellCounts::default() })
            .collect()
    }

    #[test]
    fn runs_whose_errors_last_for_seconds_are_not_told_apart_where_their_means_are_the_same() {
        const PAIRS: usize = 300;
        let mut random = Pcg64::seed_from_u64(8);
        let mut distinct = 0;
        let mut by_seconds = 0;
        for seed in 0..PAIRS as u64 {
            let mut run = || Counted { by_unit: Vec::new(), by_block: stretches(100, &mut random) };
            let [a, b] = [run(), run()];
            let found = of(&differences(&a, &b, 300, seed), "cell FVR").verdict();
            distinct += usize::from(found != "not distinct");
            // every second by itself
            let alone = Draws::new(100, 300, seed);
            let [a, b] = [a, b].map(|run| alone.totals(&run.by_block));
            let Interval(low, high) = Interval::of(a.iter().zip(&b).map(|(a, b)| Some(b.fvr()? - a.fvr()?))).unwrap();
            by_seconds += usize::from(low > 0.0 || high < 0.0);
        }
        assert!(distinct * 100 <= 12 * PAIRS, "{distinct} of {PAIRS}");
        assert!(by_seconds * 100 > 40 * PAIRS, "seconds are no units: {by_seconds} of {PAIRS}");
    }

    #[test]
    fn too_few_seconds_have_no_interval_of_cells_and_none_of_the_sum() {
        let [mut a, mut b] = [run(0), run(2)];
        a.by_block.truncate(79);
        b.by_block.truncate(79);
        let all = differences(&a, &b, 200, 1);
        for rate in ["cell FVR", "sum"] {
            let found = of(&all, rate);
            assert!(found.points.is_some() && found.interval.is_none(), "{found:?}");
            assert_eq!(found.verdict(), "n/a");
        }
        assert_eq!(of(&all, "FVR").verdict(), "worse", "tracks are as many as before");
    }

    #[test]
    fn without_cells_there_are_no_rates_of_cells() {
        let [mut a, mut b] = [run(0), run(2)];
        a.by_block.clear();
        b.by_block.clear();
        let all = differences(&a, &b, 200, 1);
        assert_eq!((of(&all, "cell FVR").points, of(&all, "cell FIR").interval), (None, None));
        assert!(of(&all, "FVR").interval.is_some() && of(&all, "sum").points.is_some());
    }
}
