//! An obstacle's shape, from its reflections: a fading histogram along it, and proven height.

use viewshed::obstacles::profile::{BIN_CM, BINS};
use viewshed::obstacles::size::SizeConfig;

/// Length of a bin, metres.
pub const BIN_M: f64 = BIN_CM as f64 / 100.0;
/// Hits in one bin from which the whole histogram is halved.
const FULL: f64 = 512.0;
/// Bins that hold one end of a vehicle.
const END_BINS: usize = 5;
/// Shortest and longest outline of a car, and narrowest and widest gap between cars taken for one vehicle.
const CAR: [f64; 2] = [2.5, 6.0];
const GAP: [f64; 2] = [1.5, 7.0];
/// Share of a young histogram that makes an end of it.
const YOUNG_SHARE: f64 = 0.4;

/// Rear and front end relative to the anchor, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    pub rear: f64,
    pub front: f64,
}

impl Extent {
    pub fn length(&self) -> f64 {
        self.front - self.rear
    }

    pub fn middle(&self) -> f64 {
        (self.front + self.rear) / 2.0
    }

    /// How far a place lies beyond either end.
    pub fn beyond(&self, along: f64) -> f64 {
        (along - self.front).max(self.rear - along).max(0.0)
    }
}

/// Hits along the heading, centred on the anchor.
#[derive(Debug, Clone)]
pub struct Profile([f64; BINS]);

impl Profile {
    pub const EMPTY: Self = Self([0.0; BINS]);

    fn rear_of(bin: usize) -> f64 {
        (bin as f64 - BINS as f64 / 2.0) * BIN_M
    }

    /// Counts hits; outside the histogram nothing happens.
    pub fn add(&mut self, along: f64, hits: f64) {
        let bin = (along / BIN_M).floor() + BINS as f64 / 2.0;
        if bin < 0.0 || bin >= BINS as f64 {
            return;
        }
        self.0[bin as usize] += hits;
        if self.0[bin as usize] >= FULL {
            self.fade(0.5);
        }
    }

    /// Where the hits have their centre.
    pub fn mean(&self) -> Option<f64> {
        let total: f64 = self.0.iter().sum();
        let moment: f64 = self.0.iter().enumerate().map(|(i, hits)| hits * (Self::rear_of(i) + BIN_M / 2.0)).sum();
        (total > 0.0).then(|| moment / total)
    }

    pub fn fade(&mut self, factor: f64) {
        self.0.iter_mut().for_each(|b| *b *= factor);
    }

    /// The outermost groups of bins with enough support, and in each the outermost pair with half of it, at
    /// its centre of gravity.
    pub fn extent(&self, min_hits: f64, share: f64) -> Option<Extent> {
        let total: f64 = self.0.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let needed = min_hits.min(YOUNG_SHARE * total).max(share * total);
        let group = |g: &[f64]| g.iter().sum::<f64>() >= needed;
        let pair = |p: &[f64]| p[0] + p[1] >= needed / 2.0;
        let first = self.0.windows(END_BINS).position(group)?;
        let last = self.0.windows(END_BINS).rposition(group)?;
        let first = first + self.0[first..first + END_BINS].windows(2).position(pair)?;
        let last = last + self.0[last..last + END_BINS].windows(2).rposition(pair)?;
        let gravity = |i: usize| Self::rear_of(i) + BIN_M / 2.0 + BIN_M * self.0[i + 1] / (self.0[i] + self.0[i + 1]);
        Some(Extent { rear: gravity(first), front: gravity(last) })
    }

    /// Whether an outline falls into parts that are all as long as a car, with gaps between them as cars leave; bins
    /// with less than a tenth of the mean are empty, and a part ends before what is too far from its begin.
    pub fn is_a_row_of_cars(&self, extent: &Extent) -> bool {
        let bin = |along: f64| ((along / BIN_M).floor() + BINS as f64 / 2.0).clamp(0.0, BINS as f64 - 1.0) as usize;
        let held = &self.0[bin(extent.rear)..=bin(extent.front)];
        let mean = held.iter().sum::<f64>() / held.len() as f64;
        let mut parts: Vec<(usize, usize)> = Vec::new();
        for i in (0..held.len()).filter(|&i| held[i] >= mean / 10.0) {
            match parts.last_mut() {
                Some((begin, end)) if ((i - *begin) as f64) < CAR[1] / BIN_M => *end = i,
                _ => parts.push((i, i)),
            }
        }
        let gap = |a: usize, b: usize| (b - a - 1) as f64 * BIN_M;
        parts.len() > 1
            && parts.iter().all(|(begin, end)| (end - begin + 1) as f64 * BIN_M >= CAR[0])
            && parts.windows(2).all(|p| (GAP[0]..=GAP[1]).contains(&gap(p[0].1, p[1].0)))
    }

    /// Moves the anchor forward by whole bins.
    pub fn shift(&mut self, bins: i32) {
        let from = |i: usize| usize::try_from(i as i32 + bins).ok().and_then(|f| self.0.get(f));
        self.0 = std::array::from_fn(|i| from(i).copied().unwrap_or(0.0));
    }

    /// Adds another profile whose anchor lies `offset` ahead of this one's.
    pub fn merge(&mut self, other: &Self, offset: f64) {
        for (i, hits) in other.0.iter().enumerate().filter(|(_, hits)| **hits > 0.0) {
            self.add(Self::rear_of(i) + BIN_M / 2.0 + offset, *hits);
        }
    }
}

/// Heights that are distinguished, metres.
const LEVELS: [f64; 5] = [1.8, 2.2, 2.6, 3.1, 3.6];
/// Standard deviations a reflection must lie above a level.
const SIGMAS: f64 = 2.0;
/// Reflections, and share of all, that prove a level.
const PROOF: (f64, f64) = (3.0, 1.0 / 20.0);

/// Evidence from which something is tall or low, and the most that is kept, nats.
const SURE: f64 = 6.0;
const MOST: f64 = 16.0;
/// Heights of what is tall and of what is low.
pub const TALL: f64 = 2.6;
const LOW: f64 = 1.6;

/// Reflections counted by the levels they prove.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tallness {
    measured: f64,
    above: [f64; LEVELS.len()],
    /// How much likelier all heights are of something tall than of a car, nats.
    tall: f64,
    /// What the radar cross section adds to that, nats.
    pub reflected: f64,
}

/// Mean of the greatest radar cross section of each of the last frames, dBsm.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reflectivity {
    mean: f64,
    frames: f64,
}

impl Reflectivity {
    pub fn add(&mut self, greatest: f64) {
        self.frames = (self.frames + 1.0).min(16.0);
        self.mean += (greatest.clamp(-100.0, 100.0) - self.mean) / self.frames;
    }

    pub fn join(&mut self, other: &Self) {
        if other.frames > 0.0 && (self.frames == 0.0 || other.mean > self.mean) {
            self.mean = other.mean;
        }
        self.frames = self.frames.max(other.frames);
    }

    /// The mean, once four frames tell it.
    pub fn known(&self) -> Option<f64> {
        (self.frames >= 4.0).then_some(self.mean)
    }

    /// How much likelier something tall is than a car: Gaussians 8 dB apart with 4.8 dB either, against it only.
    pub fn evidence(&self, half_way: f64) -> f64 {
        self.known().map_or(0.0, |mean| ((mean - half_way) * 8.0 / 4.8_f64.powi(2)).clamp(-4.0, 0.0))
    }
}

impl Tallness {
    pub fn add(&mut self, height: f64, sigma: f64) {
        self.measured += 1.0;
        for (n, level) in self.above.iter_mut().zip(LEVELS) {
            *n += f64::from(height - SIGMAS * sigma > level);
        }
        // Gaussians around where a car reflects and around where a twelfth of something tall does
        let [car, high, spread, share] = [0.7, 2.6, 0.35_f64, 0.08];
        let x = (height - (car + high) / 2.0) * (high - car) / (spread.powi(2) + sigma.powi(2));
        self.tall = (self.tall + (1.0 - share + share * x.clamp(-4.0, 4.0).exp()).ln()).clamp(-MOST, MOST);
    }

    /// The height it does not exceed, if it is short.
    pub fn ceiling(&self) -> f64 {
        if self.tall + self.reflected <= -SURE { LOW } else { f64::INFINITY }
    }

    pub fn join(&mut self, other: &Self) {
        self.measured += other.measured;
        self.tall = (self.tall + other.tall).clamp(-MOST, MOST);
        self.above.iter_mut().zip(other.above).for_each(|(n, m)| *n += m);
    }

    /// The height that is proven; 0 while nothing is.
    pub fn floor(&self) -> f64 {
        let tall = if self.tall + self.reflected >= SURE { TALL } else { 0.0 };
        let proven = |n: f64| n >= PROOF.0 && n >= PROOF.1 * self.measured;
        self.above.iter().zip(LEVELS).rfind(|(n, _)| proven(**n)).map_or(0.0, |(_, level)| level).max(tall)
    }
}

/// Length, width and height of a vehicle of a measured length: linear between the points of the
/// table, constant beyond them.
pub fn size(sizes: &SizeConfig, length: f64) -> [f64; 3] {
    let points = sizes.points.map(|p| [p.length_m, p.width_m, p.height_m].map(f64::from));
    let above = points.partition_point(|p| p[0] <= length);
    let [_, width, height] = match (above.checked_sub(1).map(|i| points[i]), points.get(above)) {
        (Some(a), Some(b)) => {
            let part = (length - a[0]) / (b[0] - a[0]);
            [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]))
        }
        (Some(p), None) | (None, Some(&p)) => p,
        (None, None) => [0.0; 3],
    };
    [length.max(f64::from(sizes.min_length_m)), width, height]
}

/// Shortest length whose usual height reaches this one; 0 for what is lower than all.
pub fn least_length(sizes: &SizeConfig, height: f64) -> f64 {
    let points = sizes.points.map(|p| [p.length_m, p.height_m].map(f64::from));
    let Some(k) = points.iter().position(|p| p[1] >= height) else { return points[points.len() - 1][0] };
    match k.checked_sub(1).map(|i| points[i]) {
        None => 0.0,
        Some(a) => a[0] + (points[k][0] - a[0]) * (height - a[1]) / (points[k][1] - a[1]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Random, raise, within};
    use viewshed::fixed::time::Step;
    use viewshed::obstacles::profile::{HIT, Profile as IntegerProfile};
    use viewshed::obstacles::tallness::Tallness as IntegerTallness;

    /// A frame of reflections somewhere along a vehicle, centimetres.
    fn hits(length: f64, random: &mut Random) -> Vec<i32> {
        let axle = |random: &mut Random| (f64::from(random.whole(0, 4)) / 4.0 - 0.5) * length;
        let n = random.whole(0, 5);
        (0..n).map(|_| (axle(random) * 100.0 + random.normal(25.0)).round() as i32).collect()
    }

    #[test]
    fn an_outline_ends_at_the_same_places() {
        let mut random = Random::new(20);
        let [mut ends, mut differ, mut small] = [0.0; 3];
        for _ in 0..400 {
            let (mut integer, mut exact) = (IntegerProfile::EMPTY, Profile::EMPTY);
            let length = random.between(2.0, 17.0);
            for _ in 0..30 {
                for cm in hits(length, &mut random) {
                    integer.add(cm);
                    exact.add(f64::from(cm) / 100.0, 1.0);
                }
                integer.fade(Step::from_micros(66_972).keep(2 << 16));
                exact.fade((-0.066_972_f64 / 2.0).exp());
                let (got, exact) = (integer.extent(HIT * 3 / 2, 13), exact.extent(1.5, 0.05));
                assert_eq!(got.is_some(), exact.is_some());
                let (Some(got), Some(exact)) = (got, exact) else { continue };
                for (got, exact) in [(got.rear_cm, exact.rear), (got.front_cm, exact.front)] {
                    let off = (f64::from(got) / 100.0 - exact).abs();
                    ends += 1.0;
                    differ += f64::from(u8::from(off > 0.05));
                    raise(&mut small, if off > 0.05 { 0.0 } else { off });
                }
            }
        }
        within("ends, m", small, 0.03);
        // a pair of bins just above or below its support
        within("ends in another bin, %", 100.0 * differ / ends, 2.5);
    }

    #[test]
    fn the_same_heights_are_proven() {
        let mut random = Random::new(21);
        for _ in 0..300 {
            let (mut integer, mut exact) = (IntegerTallness::default(), Tallness::default());
            let top = random.between(1.0, 4.0);
            for _ in 0..60 {
                let (height, sigma) = ((random.between(0.2, top) * 100.0) as i32, random.whole(10, 80));
                integer.add(height, sigma);
                // no reflection lies on a level
                exact.add(f64::from(height) / 100.0 - 1e-9, f64::from(sigma) / 100.0);
                // a sum of logarithms from a table passes the bound a reflection earlier or later
                if (exact.tall.abs() - SURE).abs() < 1.0 {
                    continue;
                }
                assert!((f64::from(integer.floor_cm()) / 100.0 - exact.floor()).abs() < 1e-9);
                assert_eq!(integer.ceiling_cm() == i32::MAX, exact.ceiling() == f64::INFINITY);
            }
        }
    }

    #[test]
    fn heights_imply_the_same_lengths() {
        let config = SizeConfig::default();
        let integer = config.sizes().unwrap();
        for cm in 0..450 {
            let exact = least_length(&config, f64::from(cm) / 100.0);
            assert!((f64::from(integer.least_length_cm(cm)) / 100.0 - exact).abs() < 0.02, "{cm} cm: not {exact}");
        }
    }

    #[test]
    fn sizes_are_interpolated_within_2_cm() {
        let config = SizeConfig::default();
        let integer = config.sizes().unwrap();
        for cm in 50..2000 {
            let (got, exact) = (integer.of(cm), size(&config, f64::from(cm) / 100.0));
            for (got, exact) in [got.length_cm, got.width_cm, got.height_cm].into_iter().zip(exact) {
                assert!((f64::from(got) / 100.0 - exact).abs() < 0.02, "{cm}: {got} for {exact}");
            }
        }
    }
}
