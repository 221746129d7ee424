//! Draws of a seed: the same on every machine.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// A stream of draws.
#[derive(Debug, Clone)]
pub struct Random(Pcg64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// Uniform in `0..below`; 0 for 0.
    pub fn below(&mut self, below: u64) -> u64 {
        // the bias of a few billionths is of no concern here
        ((u128::from(self.0.next_u64()) * u128::from(below)) >> 64) as u64
    }

    /// Uniform in `low..high`.
    pub fn between(&mut self, low: u64, high: u64) -> u64 {
        low + self.below(high - low)
    }

    pub fn chance(&mut self, parts_in_1000: u64) -> bool {
        self.below(1000) < parts_in_1000
    }
}
