//! Every random draw of the twin, addressed by what it is for.
//!
//! A generator is made from the scene's seed and the numbers that name its use (the frame, the vehicle),
//! never handed on from one frame to the next. So a frame is the same whether frames are computed in
//! order, in parallel or alone.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// What a generator is for; keeps the uses apart.
#[derive(Debug, Clone, Copy)]
pub enum Use {
    /// What distinguishes one vehicle from another of its kind.
    Vehicle = 1,
    /// Everything drawn within one radar frame.
    RadarFrame = 2,
    /// Everything drawn within one camera frame.
    CameraFrame = 3,
    /// What distinguishes one post of a barrier from the next.
    Structure = 4,
    /// Whether interference meets a radar frame.
    Interference = 5,
    /// In which frames a radar misses a vehicle.
    Misses = 6,
}

/// A stream of draws.
#[derive(Debug, Clone)]
pub struct Dice(Pcg64);

impl Dice {
    pub fn new(seed: u64, purpose: Use, number: u64) -> Self {
        Self(Pcg64::seed_from_u64(mix(mix(mix(seed) ^ purpose as u64) ^ number)))
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Exponential of mean 1.
    pub fn exponential(&mut self) -> f64 {
        -(1.0 - self.uniform()).ln()
    }

    /// Standard normal (Box and Muller; the second value is not kept, so that draws stay in step).
    pub fn normal(&mut self) -> f64 {
        let (sin, _) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        (2.0 * self.exponential()).sqrt() * sin
    }

    /// Number of independent events of a mean.
    pub fn poisson(&mut self, mean: f64) -> u32 {
        // a sum of waiting times; means here are tens at most
        let (mut waited, mut events) = (self.exponential(), 0);
        while waited < mean {
            waited += self.exponential();
            events += 1;
        }
        events
    }
}

/// A name as a number, the same on every machine (FNV-1a).
pub fn name(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Spreads neighbouring numbers (the finaliser of SplitMix64).
fn mix(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(mut draw: impl FnMut() -> f64) -> (f64, f64) {
        const N: u32 = 40_000;
        let values: Vec<f64> = (0..N).map(|_| draw()).collect();
        let mean = values.iter().sum::<f64>() / f64::from(N);
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(N))
    }

    #[test]
    fn draws_have_their_mean_and_variance() {
        let mut dice = Dice::new(1, Use::Vehicle, 2);
        for (draw, mean, variance) in [
            (Dice::normal as fn(&mut Dice) -> f64, 0.0, 1.0),
            (Dice::exponential, 1.0, 1.0),
            (|d| f64::from(d.poisson(3.0)), 3.0, 3.0),
            (|d| d.between(-1.0, 1.0), 0.0, 1.0 / 3.0),
        ] {
            let (m, v) = moments(|| draw(&mut dice));
            assert!((m - mean).abs() < 0.03 && (v - variance).abs() < 0.09, "{m} {v} for {mean} {variance}");
        }
    }

    #[test]
    fn every_use_and_number_has_its_own_stream() {
        let first = |seed, purpose, number| Dice::new(seed, purpose, number).uniform();
        let all = [
            first(1, Use::RadarFrame, 0),
            first(1, Use::RadarFrame, 1),
            first(1, Use::CameraFrame, 0),
            first(2, Use::RadarFrame, 0),
            first(1, Use::Vehicle, name("car.0")),
            first(1, Use::Vehicle, name("car.1")),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|b| (a - b).abs() > 1e-9));
        }
        assert_eq!(first(1, Use::RadarFrame, 0), first(1, Use::RadarFrame, 0));
    }
}
