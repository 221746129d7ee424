//! A Gaussian process over the unit cube, and where to look next: expected improvement.
//!
//! # Model
//! Matérn kernel of smoothness 5/2 with a length for each parameter, and noise. Lengths and noise are those of the
//! greatest marginal likelihood among random draws; values are standardised. The next point has the greatest expected
//! improvement among random points and steps from the best one. Everything is drawn from one seed, so the same
//! evaluations give the same next point: a search goes on after a stop as if there had been none.
//!
//! # References
//! D. R. Jones, M. Schonlau, W. J. Welch, "Efficient Global Optimization of Expensive Black-Box Functions", 1998;
//! C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning", 2006, chapters 2 and 5.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

use crate::evaluation::bootstrap::normal;

/// Draws of lengths and noise.
const FITS: usize = 120;
/// Random points looked at, and as many steps from the best.
const CANDIDATES: usize = 1500;
/// Shortest and longest length, in widths of the cube.
const LENGTHS: [f64; 2] = [0.15, 8.0];
/// Least and greatest standard deviation of noise, in those of the values.
const NOISE: [f64; 2] = [0.01, 0.5];

/// Uniform in [0, 1).
pub fn uniform(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// The generator of evaluation number `number` of a search.
pub fn generator(seed: u64, number: usize) -> Pcg64 {
    Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(number as u64))
}

/// A random point.
pub fn anywhere(dimensions: usize, random: &mut Pcg64) -> Vec<f64> {
    (0..dimensions).map(|_| uniform(random)).collect()
}

/// Values at points, and what they say of other points.
pub struct Process<'a> {
    points: &'a [Vec<f64>],
    lengths: Vec<f64>,
    /// Lower triangle.
    cholesky: Vec<Vec<f64>>,
    /// Inverse covariance times values.
    weights: Vec<f64>,
    mean: f64,
    deviation: f64,
    best: f64,
}

impl<'a> Process<'a> {
    /// `None` for fewer than two points.
    pub fn fit(points: &'a [Vec<f64>], values: &[f64], random: &mut Pcg64) -> Option<Self> {
        let (n, dimensions) = (values.len() as f64, points.first()?.len());
        if values.len() < 2 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt().max(1e-9);
        let standard: Vec<f64> = values.iter().map(|v| (v - mean) / deviation).collect();
        let logarithmic = |[low, high]: [f64; 2], u: f64| low * (high / low).powf(u);
        let (mut greatest, mut found) = (f64::NEG_INFINITY, None);
        for _ in 0..FITS {
            let lengths: Vec<f64> = (0..dimensions).map(|_| logarithmic(LENGTHS, uniform(random))).collect();
            let noise = logarithmic(NOISE, uniform(random));
            let covariance = |i: usize, k: usize| {
                kernel(&points[i], &points[k], &lengths) + if i == k { noise * noise } else { 0.0 }
            };
            let Some(lower) = cholesky(points.len(), covariance) else { continue };
            let half = forward(&lower, &standard);
            let fit = half.iter().map(|v| v * v).sum::<f64>() / 2.0;
            let likelihood = -fit - lower.iter().enumerate().map(|(i, row)| row[i].ln()).sum::<f64>();
            if likelihood > greatest {
                let weights = backward(&lower, &half);
                greatest = likelihood;
                found = Some((lengths, lower, weights));
            }
        }
        let (lengths, cholesky, weights) = found?;
        let best = standard.iter().copied().fold(f64::INFINITY, f64::min);
        Some(Self { points, lengths, cholesky, weights, mean, deviation, best })
    }

    /// Mean and standard deviation at a point.
    pub fn at(&self, point: &[f64]) -> (f64, f64) {
        let (mean, deviation) = self.standard(point);
        (self.mean + self.deviation * mean, self.deviation * deviation)
    }

    fn standard(&self, point: &[f64]) -> (f64, f64) {
        let near: Vec<f64> = self.points.iter().map(|p| kernel(p, point, &self.lengths)).collect();
        let mean = near.iter().zip(&self.weights).map(|(a, b)| a * b).sum();
        let explained: f64 = forward(&self.cholesky, &near).iter().map(|v| v * v).sum();
        (mean, (1.0 - explained).max(1e-12).sqrt())
    }

    /// By how much a point is expected to be below the best value, in deviations of the values.
    fn improvement(&self, point: &[f64]) -> f64 {
        let (mean, deviation) = self.standard(point);
        let z = (self.best - mean) / deviation;
        let density = (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt();
        deviation * (z * normal(z) + density)
    }

    /// Where to look next.
    pub fn next(&self, random: &mut Pcg64) -> Vec<f64> {
        let dimensions = self.lengths.len();
        let values = self.points.iter().map(|p| (self.standard(p).0, p));
        let best = values.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, p)| p.clone()).unwrap_or_default();
        let mut found = (f64::NEG_INFINITY, best.clone());
        for k in 0..2 * CANDIDATES {
            let mut point = anywhere(dimensions, random);
            if k % 2 == 1 {
                // a few parameters of the best, moved by up to a fifth
                let share = 0.5 * uniform(random) + 1.0 / dimensions as f64;
                for (v, of_best) in point.iter_mut().zip(&best) {
                    let step = (*v - 0.5) * 0.4;
                    *v = if uniform(random) < share { (of_best + step).clamp(0.0, 1.0) } else { *of_best };
                }
            }
            let improvement = self.improvement(&point);
            if improvement > found.0 {
                found = (improvement, point);
            }
        }
        found.1
    }

    /// Share of each parameter in how fast the values change: the inverse squares of the lengths.
    pub fn importance(&self) -> Vec<f64> {
        let all: Vec<f64> = self.lengths.iter().map(|l| 1.0 / (l * l)).collect();
        let total: f64 = all.iter().sum();
        all.iter().map(|v| v / total).collect()
    }
}

fn kernel(a: &[f64], b: &[f64], lengths: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).zip(lengths).map(|((a, b), l)| ((a - b) / l).powi(2)).sum();
    let r = (5.0 * square).sqrt();
    (1.0 + r + r * r / 3.0) * (-r).exp()
}

/// Lower triangle of a symmetric matrix; `None` where it is not positive definite.
fn cholesky(n: usize, of: impl Fn(usize, usize) -> f64) -> Option<Vec<Vec<f64>>> {
    let mut lower: Vec<Vec<f64>> = Vec::with_capacity(n);
    for i in 0..n {
        let mut row = Vec::with_capacity(i + 1);
        for (k, above) in lower.iter().enumerate() {
            let sum: f64 = above.iter().zip(&row).map(|(a, b): (&f64, &f64)| a * b).sum();
            row.push((of(i, k) - sum) / above[k]);
        }
        let rest = of(i, i) - row.iter().map(|v| v * v).sum::<f64>();
        if rest <= 1e-12 {
            return None;
        }
        row.push(rest.sqrt());
        lower.push(row);
    }
    Some(lower)
}

fn forward(lower: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
    let mut solved: Vec<f64> = Vec::with_capacity(values.len());
    for (row, v) in lower.iter().zip(values) {
        let sum: f64 = row.iter().zip(&solved).map(|(a, b)| a * b).sum();
        solved.push((v - sum) / row[solved.len()]);
    }
    solved
}

fn backward(lower: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
    let mut solved = values.to_vec();
    for i in (0..solved.len()).rev() {
        solved[i] /= lower[i][i];
        for k in 0..i {
            solved[k] -= lower[i][k] * solved[i];
        }
    }
    solved
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Best value of a search over 8 parameters, of which three matter, in so many evaluations.
    fn search(seed: u64, evaluations: usize, bayes: bool) -> f64 {
        let loss = |x: &[f64]| (x[0] - 0.7).powi(2) + 2.0 * (x[1] - 0.2).powi(2) + (x[2] - 0.45 - 0.3 * x[0]).powi(2);
        let (mut points, mut values): (Vec<Vec<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
        for number in 0..evaluations {
            let mut random = generator(seed, number);
            let next = if bayes && number >= 12 {
                Process::fit(&points, &values, &mut random).unwrap().next(&mut random)
            } else {
                anywhere(8, &mut random)
            };
            values.push(loss(&next));
            points.push(next);
        }
        values.into_iter().fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn it_beats_random_search_with_as_many_evaluations() {
        let won = (1..=10).filter(|&seed| search(seed, 30, true) < search(seed, 30, false)).count();
        assert!(won >= 8, "{won} of 10");
    }

    #[test]
    fn a_process_goes_through_its_points_and_knows_what_it_does_not_know() {
        let points: Vec<Vec<f64>> = (0..9).map(|k| vec![f64::from(k) / 16.0, 0.5]).collect();
        let values: Vec<f64> = points.iter().map(|p| 3.0 + (6.0 * p[0]).sin()).collect();
        let process = Process::fit(&points, &values, &mut generator(1, 1)).unwrap();
        let (mean, deviation) = process.at(&points[4]);
        assert!((mean - values[4]).abs() < 0.1, "{mean} {}", values[4]);
        assert!(process.at(&[1.0, 0.5]).1 > 2.0 * deviation, "far from all points");
        let importance = process.importance();
        assert!(importance[0] > importance[1] && (importance.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{importance:?}");
    }

    #[test]
    fn the_same_evaluations_lead_to_the_same_next_point() {
        let points: Vec<Vec<f64>> = (0..6).map(|k| anywhere(3, &mut generator(5, k))).collect();
        let values: Vec<f64> = points.iter().map(|p| p[0] + p[1]).collect();
        let next = |seed| {
            let mut random = generator(seed, 6);
            Process::fit(&points, &values, &mut random).unwrap().next(&mut random)
        };
        assert_eq!(next(1), next(1));
        assert_ne!(next(1), next(2));
    }
}
