//! Does a probability mean what it says? Reliability, resolution, sharpness of p against what was detected.
//!
//! # Model
//! Samples of equal p are alike, so everything is computed from how often each value of p (in 1/255) was said of a
//! detected object and of one that was not: [`Grades`]. With n samples of value p, of which a share o was detected,
//! N in all and a share b of those detected:
//!
//! - Brier score = mean (p - d)^2 = reliability - resolution + uncertainty: Σ n (p - o)^2 / N, Σ n (o - b)^2 / N and
//!   b (1 - b). A constant b has the score b (1 - b).
//! - Expected calibration error (ECE): samples sorted by p in 15 bins of equal count, Σ |Σ (p - d)| / N over the bins.
//!   Samples of one value that falls on the border of two bins are shared out in proportion.
//! - Kolmogorov-Smirnov distance: max over k of |Σ (p - d)| / N over the k lowest p, steps only between different values.
//! - Area under the ROC curve: chance that p is higher for a detected object than for one that was not, ties half.
//!
//! Unknown has no probability; it is counted apart.
//!
//! # References
//! A. H. Murphy, "A New Vector Partition of the Probability Score", J. Appl. Meteorology 12 (1973);
//! K. Gupta et al., "Calibration of Neural Networks using Splines", ICLR 2021 (the distance).

use serde::Serialize;

use super::bootstrap::{Draws, Interval};
use super::curve::{GRADE_SLOTS, Grades};

/// Bins of the reliability diagram and of the expected calibration error.
pub const BINS: usize = 15;

/// What 255 stands for.
const ONE: f64 = 255.0;

/// Samples of one value of p.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Group {
    p: f64,
    samples: f64,
    detected: f64,
}

/// Values in use, rising.
fn groups(grades: &Grades) -> Vec<Group> {
    (0..GRADE_SLOTS - 1)
        .map(|slot| {
            let (detected, missed) = (grades.positive[slot], grades.negative[slot]);
            Group { p: slot as f64 / ONE, samples: (detected + missed) as f64, detected: detected as f64 }
        })
        .filter(|g| g.samples > 0.0)
        .collect()
}

/// How good probabilities are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Metrics {
    /// With a probability.
    pub samples: u64,
    /// Of those, the share that was detected.
    pub base_rate: f64,
    pub brier: f64,
    pub reliability: f64,
    pub resolution: f64,
    pub uncertainty: f64,
    pub ece: f64,
    pub ks: f64,
    /// `None` where everything or nothing was detected.
    pub auc: Option<f64>,
}

impl Metrics {
    /// `None` where there is no sample.
    pub fn of(grades: &Grades) -> Option<Self> {
        let groups = groups(grades);
        let samples: f64 = groups.iter().map(|g| g.samples).sum();
        let detected: f64 = groups.iter().map(|g| g.detected).sum();
        if samples == 0.0 {
            return None;
        }
        let base_rate = detected / samples;
        let mean = |term: &dyn Fn(&Group) -> f64| groups.iter().map(term).sum::<f64>() / samples;
        let share = |g: &Group| g.detected / g.samples;
        let (mut sum, mut ks) = (0.0, 0.0_f64);
        for g in &groups {
            sum += g.samples * g.p - g.detected;
            ks = ks.max(f64::abs(sum) / samples);
        }
        let bins = bins(&groups);
        Some(Self {
            samples: samples as u64,
            base_rate,
            brier: mean(&|g| g.detected * (1.0 - g.p).powi(2) + (g.samples - g.detected) * g.p.powi(2)),
            reliability: mean(&|g| g.samples * (g.p - share(g)).powi(2)),
            resolution: mean(&|g| g.samples * (share(g) - base_rate).powi(2)),
            uncertainty: base_rate * (1.0 - base_rate),
            ece: bins.iter().map(|b| b.samples * (b.said - b.detected).abs()).sum::<f64>() / samples,
            ks,
            auc: auc(&groups, detected, samples - detected),
        })
    }

    /// Brier score less that of always saying the base rate; below 0 the probabilities say more than it.
    pub fn against_base_rate(&self) -> f64 {
        self.brier - self.uncertainty
    }
}

fn auc(groups: &[Group], detected: f64, missed: f64) -> Option<f64> {
    let (mut below, mut pairs) = (0.0, 0.0);
    for g in groups {
        let missed = g.samples - g.detected;
        pairs += g.detected * (below + missed / 2.0);
        below += missed;
    }
    (detected > 0.0 && missed > 0.0).then(|| pairs / (detected * missed))
}

/// A bin of the reliability diagram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Mean p of its samples.
    pub said: f64,
    /// The share of them that was detected.
    pub detected: f64,
    /// How many; a value on the border is shared out.
    pub samples: f64,
}

/// The reliability diagram: [`BINS`] bins of equal count, from low to high p.
pub fn diagram(grades: &Grades) -> Vec<Bin> {
    bins(&groups(grades))
}

fn bins(groups: &[Group]) -> Vec<Bin> {
    let size = groups.iter().map(|g| g.samples).sum::<f64>() / BINS as f64;
    let (mut bins, mut said, mut detected, mut filled) = (Vec::new(), 0.0, 0.0, 0.0);
    for g in groups {
        let mut left = g.samples;
        // a rest of rounding is no bin
        while left > 1e-9 * size {
            let taken = left.min(size - filled);
            said += taken * g.p;
            detected += taken * g.detected / g.samples;
            filled += taken;
            left -= taken;
            if filled >= size * (1.0 - 1e-9) {
                bins.push(Bin { said: said / filled, detected: detected / filled, samples: filled });
                (said, detected, filled) = (0.0, 0.0, 0.0);
            }
        }
    }
    bins
}

/// Distance of two distributions: the greatest difference of the shares at or below a value. `None` where one is empty.
pub fn two_sample_ks(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let below = |of: &[f64], value: f64| of.iter().filter(|v| **v <= value).count() as f64 / of.len() as f64;
    a.iter().chain(b).map(|&v| (below(a, v) - below(b, v)).abs()).max_by(f64::total_cmp)
}

/// What one predictor said of every track.
#[derive(Debug, Clone, Default)]
pub struct ByTrack(Vec<Vec<(u16, u64)>>);

impl ByTrack {
    pub fn new(tracks: &[Grades]) -> Self {
        Self(tracks.iter().map(Grades::sparse).collect())
    }

    pub fn tracks(&self) -> usize {
        self.0.len()
    }

    /// All tracks together.
    pub fn total(&self) -> Grades {
        self.drawn(&vec![1; self.0.len()])
    }

    /// All tracks, each so many times.
    pub fn drawn(&self, times: &[u32]) -> Grades {
        let mut total = Grades::default();
        for (track, &n) in self.0.iter().zip(times).filter(|(_, n)| **n > 0) {
            total.add_sparse(track, u64::from(n));
        }
        total
    }

    /// The paper's two-sample form: mean p against the share of detections, over tracks. Even a perfect predictor is
    /// not 0 here: a track's few detections spread wider than their probability.
    pub fn two_sample_ks(&self) -> Option<f64> {
        let mean = |track: &Vec<(u16, u64)>| {
            let mut grades = Grades::default();
            grades.add_sparse(track, 1);
            let groups = groups(&grades);
            let sum = |of: &dyn Fn(&Group) -> f64| groups.iter().map(of).sum::<f64>();
            let samples = sum(&|g| g.samples);
            (samples > 0.0).then(|| (sum(&|g| g.samples * g.p) / samples, sum(&|g| g.detected) / samples))
        };
        let (said, detected): (Vec<f64>, Vec<f64>) = self.0.iter().filter_map(mean).unzip();
        two_sample_ks(&said, &detected)
    }

    /// 95 % interval by tracks of anything computed of the metrics.
    pub fn interval(&self, draws: &Draws, value: impl Fn(&Metrics) -> Option<f64>) -> Option<Interval> {
        Interval::of(draws.iter().map(|times| Metrics::of(&self.drawn(times)).and_then(|m| value(&m))))
    }

    /// The same of two predictors of the same tracks, paired.
    pub fn interval_with(
        &self,
        other: &Self,
        draws: &Draws,
        value: impl Fn(&Metrics, &Metrics) -> Option<f64>,
    ) -> Option<Interval> {
        Interval::of(draws.iter().map(|times| {
            let [own, theirs] = [self, other].map(|s| Metrics::of(&s.drawn(times)));
            own.zip(theirs).and_then(|(a, b)| value(&a, &b))
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (p in 1/255, detected, missed)
    fn grades(said: &[(u8, u64, u64)]) -> Grades {
        let mut grades = Grades::default();
        for &(p, detected, missed) in said {
            (0..detected).for_each(|_| grades.add(true, Some(p)));
            (0..missed).for_each(|_| grades.add(false, Some(p)));
        }
        grades
    }

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-12, "{a} is not {b}");
    }

    #[test]
    fn the_score_and_its_parts_are_those_computed_by_hand() {
        // p = 0.2 said 10 times, 4 detected; p = 0.8 said 30 times, 24 detected: b = 28/40 = 0.7
        let m = Metrics::of(&grades(&[(51, 4, 6), (204, 24, 6)])).unwrap();
        assert_eq!((m.samples, m.base_rate), (40, 0.7));
        near(m.brier, (4.0 * 0.64 + 6.0 * 0.04 + 24.0 * 0.04 + 6.0 * 0.64) / 40.0);
        near(m.reliability, 10.0 * 0.04 / 40.0);
        near(m.resolution, (10.0 * 0.09 + 30.0 * 0.01) / 40.0);
        near(m.uncertainty, 0.21);
        near(m.brier, m.reliability - m.resolution + m.uncertainty);
        near(m.against_base_rate(), m.reliability - m.resolution);
        // 24 x 6 pairs won against the low value, 4 x 6 + 24 x 6 ties: (4 * 3 + 24 * (6 + 3)) / (28 * 12)
        near(m.auc.unwrap(), 228.0 / 336.0);
        // the lower value says 2 too few, the upper is right
        near(m.ks, 2.0 / 40.0);
        near(m.ece, 2.0 / 40.0);
    }

    #[test]
    fn swapping_detected_and_missed_turns_the_curve_over() {
        let m = |swap: bool| {
            let said = [(26, 1, 9), (128, 5, 5), (230, 9, 1)].map(|(p, d, n)| if swap { (p, n, d) } else { (p, d, n) });
            Metrics::of(&grades(&said)).unwrap()
        };
        near(m(false).auc.unwrap() + m(true).auc.unwrap(), 1.0);
        assert!(m(false).auc.unwrap() > 0.8 && m(true).brier > m(false).brier + 0.2);
        assert!(m(false).against_base_rate() < -0.1 && m(true).against_base_rate() > 0.1);
    }

    #[test]
    fn errors_of_opposite_sign_do_not_cancel_in_the_distance() {
        // 10 too few at the low end, 10 too many at the high end: the sum is 0 at the end, its greatest value 10
        let m = Metrics::of(&grades(&[(0, 10, 90), (255, 90, 10)])).unwrap();
        near(m.ks, 0.05);
        // the bin in the middle holds as many of both
        near(m.ece, 0.1 * 14.0 / 15.0);
    }

    #[test]
    fn a_step_lies_between_values_and_never_within_one() {
        // one value, right on average: sorted sample by sample a sum would leave 0 between detected and missed
        let m = Metrics::of(&grades(&[(51, 20, 80)])).unwrap();
        assert!(m.ks < 1e-12 && m.ece < 1e-12 && m.resolution < 1e-12, "{m:?}");
        assert_eq!(m.auc, Some(0.5));
    }

    #[test]
    fn bins_hold_equal_counts_and_share_out_what_lies_on_a_border() {
        // 30 samples, 2 a bin: three of 0, one and a half bins, then 27 of 1
        let all = diagram(&grades(&[(0, 0, 3), (255, 27, 0)]));
        assert_eq!(all.len(), BINS);
        assert!(all.iter().all(|b| (b.samples - 2.0).abs() < 1e-9));
        near(all[0].said, 0.0);
        near(all[1].said, 0.5);
        near(all[1].detected, 0.5);
        near(all[2].said, 1.0);
        // rising p, so the diagram reads from left to right
        assert!(diagram(&grades(&[(9, 3, 50), (99, 20, 20), (199, 30, 4)])).windows(2).all(|b| b[0].said <= b[1].said));
    }

    #[test]
    fn the_two_sample_distance_is_between_distributions_not_pairs() {
        near(two_sample_ks(&[0.1, 0.2, 0.3], &[0.3, 0.2, 0.1]).unwrap(), 0.0);
        near(two_sample_ks(&[0.1, 0.2], &[0.8, 0.9]).unwrap(), 1.0);
        near(two_sample_ks(&[0.0, 1.0, 1.0, 1.0], &[0.5]).unwrap(), 0.75);
        assert_eq!(two_sample_ks(&[], &[1.0]), None);
        // 0.6 is right for both tracks on average, and neither has it
        let tracks = ByTrack::new(&[grades(&[(153, 10, 0)]), grades(&[(153, 2, 8)])]);
        near(tracks.two_sample_ks().unwrap(), 0.5);
        assert!(Metrics::of(&tracks.total()).unwrap().ks < 1e-12);
    }

    #[test]
    fn unknown_is_no_probability_and_nothing_has_no_metrics() {
        let mut unknown = Grades::default();
        unknown.add(true, None);
        assert_eq!(Metrics::of(&unknown), None);
        let mut some = grades(&[(255, 1, 0)]);
        some.add(false, None);
        let m = Metrics::of(&some).unwrap();
        assert_eq!((m.samples, m.brier, m.auc), (1, 0.0, None));
    }

    #[test]
    fn intervals_come_from_whole_tracks_and_are_paired() {
        let tracks: Vec<Grades> =
            (0..30).map(|k| if k % 3 == 0 { grades(&[(200, 0, 50)]) } else { grades(&[(200, 50, 0)]) }).collect();
        let by_track = ByTrack::new(&tracks);
        let draws = Draws::new(by_track.tracks(), 400, 1);
        let Interval(low, high) = by_track.interval(&draws, |m| Some(m.base_rate)).unwrap();
        // 1500 samples of 30 tracks: a standard error of 8.6 points, not of 1.2
        assert!((0.25..0.42).contains(&(high - low)), "{low} {high}");
        let same = by_track.interval_with(&by_track, &draws, |a, b| Some(a.brier - b.brier));
        assert_eq!(same, Some(Interval(0.0, 0.0)));
    }
}
