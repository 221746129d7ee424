//! 95 % intervals by drawing correlated units again.
//!
//! # Model
//! Units (tracks, frames or blocks of frames) are drawn with replacement, as many as there are; the
//! statistic is computed of each draw; the interval is from the 2.5th to the 97.5th percentile. All
//! estimators share the draws, so the differences between them are paired.
//!
//! # References
//! B. Efron, R. Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 13.

use std::ops::{AddAssign, Mul};

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// Share of draws that must give a value at all for an interval to be stated.
const DEFINED: f64 = 0.9;

/// From the 2.5th to the 97.5th percentile of the draws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval(pub f64, pub f64);

impl Interval {
    /// The interval of what the draws gave. `None` for fewer than two draws, and where more than a
    /// tenth of them had nothing to divide by: the rest would be a biased choice.
    pub fn of(draws: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        let mut total = 0;
        let mut values: Vec<f64> = draws.into_iter().inspect(|_| total += 1).flatten().collect();
        if values.len() < 2 || (values.len() as f64) < DEFINED * f64::from(total) {
            return None;
        }
        values.sort_by(f64::total_cmp);
        Some(Self(percentile(&values, 0.025), percentile(&values, 0.975)))
    }
}

/// Percentile of sorted values, linear between neighbours.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// How often each unit came in each draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws(Vec<Vec<u32>>);

impl Draws {
    /// `repetitions` draws of `units` units. A single unit says nothing of its spread: no draws.
    pub fn new(units: usize, repetitions: u32, seed: u64) -> Self {
        if units < 2 {
            return Self(Vec::new());
        }
        let mut random = Pcg64::seed_from_u64(seed);
        let draw = |_| {
            let mut times = vec![0; units];
            for _ in 0..units {
                // multiply-shift: the bias is below units / 2^64
                let unit = (u128::from(random.next_u64()) * units as u128) >> 64;
                times[unit as usize] += 1;
            }
            times
        };
        Self((0..repetitions).map(draw).collect())
    }

    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.0.iter().map(Vec::as_slice)
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
}
