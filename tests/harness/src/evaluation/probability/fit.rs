//! Fits a table to samples: isotonic in the grade, drawn towards what larger bins say where there are few tracks.
//!
//! # Model
//! Isotonic regression by pooling adjacent violators. All places together give p0(grade); bins of range alone and of
//! azimuth alone, drawn towards p0, give pr and pa; a bin of both is drawn towards pr + pa - p0 (in log-odds). Drawn
//! means (t o + k q) / (t + k), with o the share of its samples detected, q what it is drawn towards, t its tracks
//! (samples of a track are alike, so they count once) and k = [`PRIOR_TRACKS`].
//!
//! # References
//! R. E. Barlow, D. J. Bartholomew, J. M. Bremner, H. D. Brunk, "Statistical Inference under Order Restrictions", 1972.

use std::collections::BTreeSet;

use viewshed::fixed::angle::Angle;
use viewshed::probability::{AZIMUTHS, Edges, GRADES, ProbabilityTable, RANGES, fitted_with};

use super::samples::{Place, Places};
use crate::evaluation::curve::{GRADE_SLOTS, Grades};

/// Tracks that what a bin is drawn towards weighs as much as. Chosen on the days tables are fitted on, each left out
/// in turn.
pub const PRIOR_TRACKS: f64 = 10.0;

/// Edges of bins; each list has one less than there are bins.
#[derive(Debug, Clone, PartialEq)]
pub struct Bins {
    pub grades: Vec<i32>,
    pub ranges_cm: Vec<i32>,
    pub azimuths: Vec<i32>,
}

impl Bins {
    /// Of equal counts, as far as values allow; blocked (1) and clear (255) are steps of their own.
    pub fn new(places: &Places, grades: usize, ranges: usize, azimuths: usize) -> Self {
        let of = |value: &dyn Fn(&Place) -> Option<i32>| {
            let mut all: Vec<i32> = places.all.iter().filter_map(value).collect();
            all.sort_unstable();
            all
        };
        let partly = of(&|p| p.grade.map(i32::from).filter(|g| (2..=254).contains(g)));
        let inner = quantiles(&partly, grades - 2, 3, 254);
        Self {
            grades: [2].into_iter().chain(inner).chain([255]).collect(),
            ranges_cm: quantiles(&of(&|p| Some(p.range_cm)), ranges, 1, i32::from(u16::MAX)),
            azimuths: quantiles(
                &of(&|p| Some(i32::from(p.azimuth.raw()))),
                azimuths,
                i32::from(i16::MIN),
                i32::from(i16::MAX),
            ),
        }
    }

    fn place(&self, p: &Place) -> (usize, usize) {
        let azimuth = i32::from(p.azimuth.raw());
        (self.azimuths.partition_point(|e| *e <= azimuth), self.ranges_cm.partition_point(|e| *e <= p.range_cm))
    }

    fn step(&self, grade: u8) -> usize {
        self.grades.partition_point(|e| *e <= i32::from(grade))
    }

    fn steps(&self) -> usize {
        self.grades.len() + 1
    }
}

/// Edges between `parts` parts of sorted values, strictly rising within `low..=high`.
fn quantiles(sorted: &[i32], parts: usize, low: i32, high: i32) -> Vec<i32> {
    let edges = parts - 1;
    let mut least = low;
    (1..parts)
        .map(|k| {
            let even = low + ((i64::from(high) - i64::from(low)) * k as i64 / parts as i64) as i32;
            let wanted = sorted.get(sorted.len() * k / parts).copied().unwrap_or(even);
            // what is left has to find room above
            let edge = wanted.clamp(least, high - (edges - k) as i32);
            least = edge + 1;
            edge
        })
        .collect()
}

/// Samples of one step of the grade in one bin of place.
#[derive(Debug, Clone, Default)]
struct Count {
    samples: f64,
    detected: f64,
    units: BTreeSet<usize>,
}

impl Count {
    fn add(&mut self, p: &Place) {
        self.samples += 1.0;
        self.detected += f64::from(u8::from(p.detected));
        self.units.insert(p.unit);
    }

    /// Drawn towards `q` by as much as `k` tracks; value and weight.
    fn drawn(&self, q: f64, k: f64) -> (f64, f64) {
        let tracks = self.units.len() as f64;
        let own = if self.samples > 0.0 { self.detected / self.samples } else { q };
        ((tracks * own + k * q) / (tracks + k), tracks + k)
    }
}

/// Probabilities by bin.
#[derive(Debug, Clone)]
pub struct Fit {
    bins: Bins,
    /// By azimuth, range and step of the grade.
    values: Vec<Vec<Vec<f64>>>,
}

impl Fit {
    /// Fits samples; those of unknown grade are left out. `None` where none is left.
    pub fn new(places: &Places, bins: Bins) -> Option<Self> {
        let (ranges, azimuths) = (bins.ranges_cm.len() + 1, bins.azimuths.len() + 1);
        let none = vec![Count::default(); bins.steps()];
        let mut all = none.clone();
        let (mut by_range, mut by_azimuth) = (vec![none.clone(); ranges], vec![none.clone(); azimuths]);
        let mut by_both = vec![vec![none; ranges]; azimuths];
        for p in &places.all {
            let Some(grade) = p.grade else { continue };
            let ((a, r), g) = (bins.place(p), bins.step(grade));
            for count in [&mut all[g], &mut by_range[r][g], &mut by_azimuth[a][g], &mut by_both[a][r][g]] {
                count.add(p);
            }
        }
        let total = |of: &dyn Fn(&Count) -> f64| all.iter().map(of).sum::<f64>();
        let (samples, detected) = (total(&|c| c.samples), total(&|c| c.detected));
        if samples == 0.0 {
            return None;
        }
        // one track's worth of the base rate, so that no step is without a value
        let p0 = fitted(&all, &vec![detected / samples; all.len()], 1.0);
        let towards_all = |bins: &[Vec<Count>]| -> Vec<Vec<f64>> {
            bins.iter().map(|counts| fitted(counts, &p0, PRIOR_TRACKS)).collect()
        };
        let (pr, pa) = (towards_all(&by_range), towards_all(&by_azimuth));
        let value = |a: usize, r: usize| {
            let towards = |g: usize| odds_to_p(log_odds(pr[r][g]) + log_odds(pa[a][g]) - log_odds(p0[g]));
            let towards: Vec<f64> = (0..p0.len()).map(towards).collect();
            fitted(&by_both[a][r], &towards, PRIOR_TRACKS)
        };
        let values = (0..azimuths).map(|a| (0..ranges).map(|r| value(a, r)).collect()).collect();
        Some(Self { bins, values })
    }

    /// In 1/255; unknown has none.
    pub fn p(&self, place: &Place) -> Option<u8> {
        let (a, r) = self.bins.place(place);
        Some(byte(self.values[a][r][self.bins.step(place.grade?)]))
    }
}

/// Steps of one bin, drawn towards others and made to rise.
fn fitted(counts: &[Count], towards: &[f64], k: f64) -> Vec<f64> {
    let (values, weights): (Vec<f64>, Vec<f64>) = counts.iter().zip(towards).map(|(c, &q)| c.drawn(q, k)).unzip();
    isotonic(&values, &weights)
}

/// The rising sequence nearest to the values, by weighted squares.
pub fn isotonic(values: &[f64], weights: &[f64]) -> Vec<f64> {
    // (mean, weight, how many)
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (&v, &w) in values.iter().zip(weights) {
        pools.push((v, w, 1));
        while let [.., a, b] = pools[..] {
            if a.0 <= b.0 {
                break;
            }
            pools.truncate(pools.len() - 2);
            let weight = a.1 + b.1;
            pools.push(((a.0 * a.1 + b.0 * b.1) / weight, weight, a.2 + b.2));
        }
    }
    pools.into_iter().flat_map(|(mean, _, n)| std::iter::repeat_n(mean, n)).collect()
}

/// Farthest a probability may be from 0 and 1 to have log-odds.
const CLAMP: f64 = 1e-4;

fn log_odds(p: f64) -> f64 {
    let p = p.clamp(CLAMP, 1.0 - CLAMP);
    (p / (1.0 - p)).ln()
}

fn odds_to_p(odds: f64) -> f64 {
    1.0 / (1.0 + (-odds).exp())
}

fn byte(p: f64) -> u8 {
    (p * 255.0).round().clamp(0.0, 255.0) as u8
}

/// Fits the library's table. `None` without a sample of known grade.
pub fn table(places: &Places, fingerprint: u32) -> Option<ProbabilityTable> {
    let fit = Fit::new(places, Bins::new(places, GRADES, RANGES, AZIMUTHS))?;
    let edges = Edges {
        grades: std::array::from_fn(|k| fit.bins.grades[k] as u8),
        ranges_cm: std::array::from_fn(|k| fit.bins.ranges_cm[k] as u16),
        azimuths: std::array::from_fn(|k| fit.bins.azimuths[k] as i16),
    };
    let values = std::array::from_fn(|a| std::array::from_fn(|r| std::array::from_fn(|g| byte(fit.values[a][r][g]))));
    ProbabilityTable::new(edges, values, fitted_with(fingerprint)).ok()
}

/// Parts that samples are left out in.
const FOLDS: usize = 4;

/// What tables say of samples they were not fitted on: units in `FOLDS` parts, in their order (days stay together, as
/// far as they are alike long), each left out in turn. A threshold from these is not flattered by the fit. `None` where
/// a part leaves nothing to fit on.
pub fn left_out(places: &Places) -> Option<Grades> {
    let folds = FOLDS.min(places.units.max(1));
    let mut counted = Grades::default();
    for fold in 0..folds {
        let (out, kept): (Vec<Place>, Vec<Place>) =
            places.all.iter().partition(|p| p.unit * folds / places.units.max(1) == fold);
        if folds > 1 && out.is_empty() {
            continue;
        }
        // one unit alone has no others
        let kept = Places { all: if folds > 1 { kept } else { places.all.clone() }, ..*places };
        let table = table(&kept, 0)?;
        out.iter().for_each(|p| counted.add(p.detected, look_up(&table, p)));
    }
    // unknown is not of a table
    let unknown = GRADE_SLOTS - 1;
    (counted.positive[unknown], counted.negative[unknown]) = (0, 0);
    Some(counted)
}

/// Steps and bins of [`offline`].
const OFFLINE_PLACES: usize = 16;

/// The same without the limits of a controller: every grade a step, and four times the bins of place.
pub fn offline(places: &Places) -> Option<Fit> {
    let bins = Bins::new(places, GRADES, OFFLINE_PLACES, OFFLINE_PLACES);
    Fit::new(places, Bins { grades: (2..=255).collect(), ..bins })
}

/// What a table says of a sample.
pub fn look_up(table: &ProbabilityTable, place: &Place) -> Option<u8> {
    table.look_up(place.grade?, place.range_cm, Angle::from_raw(place.azimuth.raw())).map(|p| p.raw())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjacent_violators_are_pooled_by_weight() {
        assert_eq!(isotonic(&[0.1, 0.5, 0.3, 0.9], &[1.0, 1.0, 3.0, 1.0]), [0.1, 0.35, 0.35, 0.9]);
        // back to the first
        assert_eq!(isotonic(&[0.75, 0.5, 0.25], &[1.0, 1.0, 1.0]), [0.5; 3]);
        assert_eq!(isotonic(&[], &[]), [0.0; 0]);
    }

    #[test]
    fn edges_rise_whatever_the_samples() {
        let rises = |edges: &[i32]| edges.windows(2).all(|e| e[0] < e[1]);
        for sorted in [vec![], vec![254; 9], vec![3; 9], (3..254).collect()] {
            let edges = quantiles(&sorted, 10, 3, 254);
            assert!(edges.len() == 9 && rises(&edges) && edges[0] >= 3 && edges[8] <= 254, "{edges:?}");
        }
        assert_eq!(quantiles(&[10, 20, 30, 40], 2, 0, 100), [30], "half of them below");
    }

    /// Tracks of `frames` samples that are detected with a chance of their own.
    fn world(tracks: usize, chance: impl Fn(u8, i32, i16) -> f64) -> Places {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as f64 / (1_u64 << 31) as f64
        };
        let mut all = Vec::new();
        for unit in 0..tracks {
            for _ in 0..20 {
                let grade = [1, 1, 60, 120, 180, 255, 255, 255][(next() * 8.0) as usize];
                let (range_cm, azimuth) = ((next() * 20_000.0) as i32, (next() * 20_000.0 - 10_000.0) as i16);
                let detected = next() < chance(grade, range_cm, azimuth);
                all.push(Place { grade: Some(grade), range_cm, azimuth: Angle::from_raw(azimuth), detected, unit });
            }
        }
        Places { all, units: tracks, kind: "tracks" }
    }

    #[test]
    fn a_table_finds_the_chances_that_samples_were_drawn_with() {
        let chance = |grade: u8, range_cm: i32, azimuth: i16| {
            let grade = f64::from(grade) / 255.0;
            (0.2 + 0.7 * grade) * (1.0 - f64::from(range_cm) / 60_000.0) - if azimuth > 0 { 0.1 } else { 0.0 }
        };
        let table = table(&world(3000, chance), 1).unwrap();
        let mut worst = 0.0_f64;
        for grade in [1, 120, 255] {
            for range_cm in [1000, 6000, 11_000, 19_000] {
                for azimuth in [-6000, 6000] {
                    let p = table.look_up(grade, range_cm, Angle::from_raw(azimuth)).unwrap().raw();
                    worst = worst.max((f64::from(p) / 255.0 - chance(grade, range_cm, azimuth)).abs());
                }
            }
        }
        assert!(worst < 0.08, "{worst}");
    }

    #[test]
    fn a_bin_with_one_track_says_nearly_what_all_others_say() {
        let mut places = world(400, |grade, _, _| if grade > 100 { 0.9 } else { 0.1 });
        // the only one beyond 200 m, clear and never detected
        let far = Place { grade: Some(255), range_cm: 25_000, azimuth: Angle::ZERO, detected: false, unit: 400 };
        places.all.extend([far; 50]);
        places.units += 1;
        let bins = Bins { ranges_cm: vec![20_000], azimuths: vec![], ..Bins::new(&places, GRADES, 2, 1) };
        let p = f64::from(Fit::new(&places, bins).unwrap().p(&far).unwrap()) / 255.0;
        // others say 0.9
        assert!((0.6..0.885).contains(&p), "{p}");
    }

    #[test]
    fn what_was_left_out_is_not_said_by_a_table_that_knows_it() {
        // every track has a place of its own and is always or never detected there: only its own samples tell
        let place = |unit: usize| Place {
            grade: Some(255),
            range_cm: 100 + 200 * unit as i32,
            azimuth: Angle::ZERO,
            detected: unit.is_multiple_of(2),
            unit,
        };
        let all = (0..80).flat_map(|unit| [place(unit); 30]).collect();
        let places = Places { all, units: 80, kind: "tracks" };
        let counted = left_out(&places).unwrap();
        let total: u64 = counted.positive.iter().chain(counted.negative.iter()).sum();
        assert_eq!(total, 2400, "every sample once");
        // a part without its even tracks would be seen here: base rates of the others stay near a half
        assert!((0..60).chain(200..256).all(|p| counted.positive[p] + counted.negative[p] == 0), "{counted:?}");
    }

    #[test]
    fn without_a_known_grade_there_is_no_table() {
        let unknown = Place { grade: None, range_cm: 1, azimuth: Angle::ZERO, detected: true, unit: 0 };
        assert!(table(&Places { all: vec![unknown], units: 1, kind: "tracks" }, 0).is_none());
        let one = Place { grade: Some(9), ..unknown };
        assert!(table(&Places { all: vec![one], units: 1, kind: "tracks" }, 0).is_some());
    }
}
