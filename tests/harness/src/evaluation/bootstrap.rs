//! 95 % intervals by drawing correlated units again.
//!
//! # Model
//! Units (tracks or frames) are drawn with replacement, as many as there are; the statistic is
//! computed of each draw; the interval is from the 2.5th to the 97.5th percentile. All estimators
//! share the draws, so the differences between them are paired.
//!
//! Blocks in the order of time are correlated with their neighbours, so runs of consecutive ones are
//! drawn, from any block on and from the last on to the first (circular block bootstrap). Several
//! recordings in a row are one circle: a few runs reach from one into the next. Runs are few, and the
//! spread of few is underestimated, so their percentiles lie farther out, as Student's t does for a mean of so
//! many. Fewer than [`LEAST_RUNS`] are too few for an interval.
//!
//! # References
//! B. Efron, R. Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 13.
//! H. R. Künsch, "The Jackknife and the Bootstrap for General Stationary Observations", Annals of Statistics 17(3), 1989.
//! D. N. Politis, J. P. Romano, "A Circular Block-Resampling Procedure for Stationary Data", in "Exploring the Limits of
//! Bootstrap", 1992.
//! T. C. Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69(4), 2015: expanded
//! percentiles.

use std::ops::{AddAssign, Mul};

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// Share of draws that must give a value at all for an interval to be stated.
const DEFINED: f64 = 0.9;
/// Share of the draws below an interval, and above it.
const TAIL: f64 = 0.025;
/// Runs of blocks below which nothing is drawn.
pub const LEAST_RUNS: usize = 8;

/// Two percentiles of the draws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval(pub f64, pub f64);

impl Interval {
    /// The interval of what draws of independent units gave, from the 2.5th percentile to the 97.5th. `None` for fewer
    /// than two draws, and where more than a tenth of them had nothing to divide by: the rest would be a biased choice.
    pub fn of(draws: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        Self::within(TAIL, draws)
    }

    fn within(tail: f64, draws: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        let mut total = 0;
        let mut values: Vec<f64> = draws.into_iter().inspect(|_| total += 1).flatten().collect();
        if values.len() < 2 || (values.len() as f64) < DEFINED * f64::from(total) {
            return None;
        }
        values.sort_by(f64::total_cmp);
        Some(Self(percentile(&values, tail), percentile(&values, 1.0 - tail)))
    }
}

/// Percentile of sorted values, linear between neighbours.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// Share of the draws of so many runs that lies beyond each end of an interval of 95 %.
fn tail(runs: usize) -> f64 {
    const Z: f64 = 1.959_963_985;
    let degrees = runs as f64 - 1.0;
    // Student's t by its expansion in 1 / degrees, right to 0.001 from 7 degrees on (Abramowitz, Stegun, 26.7.5)
    let first = Z.powi(3) + Z;
    let second = 5.0 * Z.powi(5) + 16.0 * Z.powi(3) + 3.0 * Z;
    let third = 3.0 * Z.powi(7) + 19.0 * Z.powi(5) + 17.0 * Z.powi(3) - 15.0 * Z;
    let t = Z + first / (4.0 * degrees) + second / (96.0 * degrees.powi(2)) + third / (384.0 * degrees.powi(3));
    normal(-t * (runs as f64 / degrees).sqrt())
}

/// Share of the standard normal distribution below `z` (Abramowitz, Stegun, 26.2.17: right to 1e-7).
pub fn normal(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let polynomial =
        t * (0.319_381_530 + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt() * polynomial;
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// How often each unit came in each draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws {
    times: Vec<Vec<u32>>,
    /// Share of the draws below an interval, and above it.
    tail: f64,
}

impl Draws {
    /// `repetitions` draws of `units` units. A single unit says nothing of its spread: no draws.
    pub fn new(units: usize, repetitions: u32, seed: u64) -> Self {
        if units < 2 { Self::none() } else { Self::drawn(units, 1, TAIL, repetitions, seed) }
    }

    /// `repetitions` draws of `blocks` blocks in the order of time, in runs of `length`. Fewer than [`LEAST_RUNS`] say
    /// too little of their spread: no draws.
    pub fn in_runs(blocks: usize, length: usize, repetitions: u32, seed: u64) -> Self {
        let runs = blocks / length.max(1);
        if runs < LEAST_RUNS { Self::none() } else { Self::drawn(blocks, length, tail(runs), repetitions, seed) }
    }

    fn none() -> Self {
        Self { times: Vec::new(), tail: TAIL }
    }

    fn drawn(units: usize, length: usize, tail: f64, repetitions: u32, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let draw = |_| {
            let mut times = vec![0; units];
            for done in (0..units).step_by(length) {
                // multiply-shift: the bias is below units / 2^64
                let first = (u128::from(random.next_u64()) * units as u128) >> 64;
                // the last run is cut, so that every draw has as many units
                for k in 0..length.min(units - done) {
                    times[(first as usize + k) % units] += 1;
                }
            }
            times
        };
        Self { times: (0..repetitions).map(draw).collect(), tail }
    }

    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.times.iter().map(Vec::as_slice)
    }

    /// The interval of what these draws gave; `None` as in [`Interval::of`].
    pub fn interval(&self, draws: impl IntoIterator<Item = Option<f64>>) -> Option<Interval> {
        Interval::within(self.tail, draws)
    }

    /// The total of every draw.
    pub fn totals<T>(&self, by_unit: &[T]) -> Vec<T>
    where
        T: Copy + Default + AddAssign + Mul<u64, Output = T>,
    {
        self.iter()
            .map(|times| {
                let mut total = T::default();
                by_unit.iter().zip(times).for_each(|(&unit, &n)| total += unit * u64::from(n));
                total
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::counts::Counts;
    use super::*;

    #[test]
    fn the_interval_agrees_with_all_possible_draws() {
        // three tracks: by hand there are 27 equally likely draws
        let tracks = [
            Counts { tv: 9, fi: 1, ..Counts::default() },
            Counts { tv: 2, fi: 8, ..Counts::default() },
            Counts { tv: 30, fi: 10, ..Counts::default() },
        ];
        let mut exact = Vec::new();
        for k in 0..27 {
            let mut c = Counts::default();
            for pick in [k % 3, k / 3 % 3, k / 9] {
                c += tracks[pick];
            }
            exact.push(c.fir().unwrap());
        }
        exact.sort_by(f64::total_cmp);
        let drawn: Vec<f64> = Draws::new(3, 40_000, 7).totals(&tracks).iter().map(|c| c.fir().unwrap()).collect();
        // the share of draws at or below every value that can come
        for value in &exact {
            let share = |of: &[f64]| of.iter().filter(|v| *v <= value).count() as f64 / of.len() as f64;
            assert!((share(&exact) - share(&drawn)).abs() < 0.01, "at {value}");
        }
        let interval = Interval::of(drawn.into_iter().map(Some)).unwrap();
        // the lowest and highest value have 1/27 each, more than 2.5 %
        assert_eq!(interval, Interval(exact[0], exact[26]));
    }

    #[test]
    fn percentiles_lie_between_neighbours() {
        let values: Vec<_> = (0..=100).map(|v| Some(f64::from(v))).collect();
        assert_eq!(Interval::of(values), Some(Interval(2.5, 97.5)));
    }

    #[test]
    fn draws_without_a_value_leave_no_interval() {
        assert_eq!(Interval::of([None, None, None]), None);
        assert_eq!(Interval::of([Some(1.0), None, Some(2.0)]), None);
        assert_eq!(Interval::of([]), None);
        let many = (0..100).map(|k| (k > 4).then_some(0.5));
        assert_eq!(Interval::of(many), Some(Interval(0.5, 0.5)));
    }

    #[test]
    fn every_draw_has_as_many_units_as_there_are_and_the_seed_decides() {
        let draws = Draws::new(17, 50, 3);
        assert!(draws.iter().all(|times| times.iter().sum::<u32>() == 17));
        assert_eq!(draws, Draws::new(17, 50, 3));
        assert_ne!(draws, Draws::new(17, 50, 4));
        assert_eq!(Draws::new(1, 50, 3).iter().count(), 0);
    }

    #[test]
    fn runs_are_consecutive_blocks_and_every_block_comes_as_often() {
        let draws = Draws::in_runs(83, 10, 2000, 3);
        assert!(draws.iter().all(|times| times.iter().sum::<u32>() == 83));
        let of_block = |k: usize| draws.iter().map(|times| times[k]).sum::<u32>();
        let (least, most) = (0..83).map(of_block).fold((u32::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
        assert!(least > 1800 && most < 2200, "the first and the last, too: {least} {most}");
        // a draw of 9 runs changes at their 18 ends at most, where one of single blocks changes nearly everywhere
        let changes = |times: &[u32]| (0..83).filter(|&k| times[k] != times[(k + 1) % 83]).count();
        assert!(draws.iter().all(|times| changes(times) <= 18));
        assert_eq!(draws, Draws::in_runs(83, 10, 2000, 3));
        assert_eq!(Draws::in_runs(79, 10, 50, 3).iter().count(), 0, "7 runs are too few");
    }

    #[test]
    fn percentiles_of_few_runs_lie_farther_out() {
        // Student's t of tables, for 7, 8 and 49 degrees
        for (runs, t) in [(8, 2.3646), (9, 2.3060), (50, 2.0096)] {
            let expected = normal(-t * (runs as f64 / (runs as f64 - 1.0)).sqrt());
            assert!((tail(runs) - expected).abs() < 2e-5, "{runs}: {} for {expected}", tail(runs));
        }
        assert!(tail(8) < 0.006 && (tail(100_000) - TAIL).abs() < 1e-5);
    }

    #[test]
    fn the_normal_distribution_is_that_of_tables() {
        for (z, share) in [(0.0, 0.5), (1.0, 0.841_344_7), (-1.96, 0.024_997_9), (3.0, 0.998_650_1)] {
            assert!((normal(z) - share).abs() < 2e-7, "{z}");
        }
    }
}
