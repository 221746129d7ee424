//! An estimate of the cycles a frame takes on controllers nobody has measured yet.
//!
//! The emulator says which blocks of instructions run and how often ([`trace`]); what they cost is taken from Arm's table for the
//! Cortex-M4 ([`cortex_m4`]) and from LLVM's model of the Cortex-M7 ([`cortex_m7`]). Both are given as a range, from a memory that
//! never waits to one that waits as often as it can. An estimate, not a measurement: `viewshed configure --timing` asks a real
//! unit for its own.

pub mod cortex_m4;
pub mod cortex_m7;
pub mod trace;

/// From the least to the most.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Range {
    pub least: f64,
    pub most: f64,
}

impl Range {
    /// The same for both ends.
    pub fn of(cycles: f64) -> Self {
        Self { least: cycles, most: cycles }
    }

    /// Both ends with a factor.
    pub fn times(self, factor: f64) -> Self {
        Self { least: self.least * factor, most: self.most * factor }
    }
}

impl std::ops::AddAssign for Range {
    fn add_assign(&mut self, other: Self) {
        self.least += other.least;
        self.most += other.most;
    }
}
