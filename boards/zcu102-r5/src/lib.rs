//! What the Cortex-R5F of a Zynq UltraScale+ has, as QEMU's `xlnx-zcu102` emulates it.
//!
//! The only unsafe code of this board is here: start-up and the stack's limits.
#![no_std]

// nothing panics
use emulated as _;

pub mod can;
pub mod stack;
mod start;

use profile::State;
#[cfg(not(feature = "small"))]
pub use viewshed::unit::profile::reference as profile;
#[cfg(feature = "small")]
pub use viewshed::unit::profile::small as profile;

/// What a board says of its size: range cells, azimuths, elevations, detections.
pub const SHAPE: [usize; 4] = [State::RANGES, State::AZIMUTHS, State::ELEVATIONS, State::DETECTIONS];

/// What the bench wants to know of this core, whose instructions the emulator cannot count.
pub struct Core;

impl viewshed::bench::files::Core for Core {
    fn ticks(&mut self) -> u32 {
        0
    }

    fn ticks_per_256(&self) -> u32 {
        0
    }

    fn stack(&self) -> [u32; 2] {
        stack::used()
    }
}
