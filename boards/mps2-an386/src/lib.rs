//! What the MPS2 board with a Cortex-M4F has, as QEMU's `mps2-an386` emulates it.
//!
//! The only unsafe code of this board is here: registers and the stack's limits.
#![no_std]

// nothing panics
use emulated as _;

mod interrupts;
pub mod stack;
pub mod timer;
pub mod uart;

use profile::State;
#[cfg(not(feature = "small"))]
pub use viewshed::unit::profile::reference as profile;
#[cfg(feature = "small")]
pub use viewshed::unit::profile::small as profile;

/// What a board says of its size: range cells, azimuths, elevations, detections.
pub const SHAPE: [usize; 4] = [State::RANGES, State::AZIMUTHS, State::ELEVATIONS, State::DETECTIONS];

/// A register of a peripheral.
#[derive(Clone, Copy)]
struct Register(usize);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: the addresses in this crate are registers of this board, readable at any time
        unsafe { core::ptr::read_volatile(self.0 as *const u32) }
    }

    fn write(self, value: u32) {
        // SAFETY: as above; one core, no interrupts
        unsafe { core::ptr::write_volatile(self.0 as *mut u32, value) }
    }
}

/// What the bench wants to know of this core.
pub struct Core(timer::Timer);

impl Core {
    /// Starts its counter.
    pub fn start() -> Self {
        Self(timer::Timer::start())
    }
}

impl viewshed::bench::files::Core for Core {
    fn ticks(&mut self) -> u32 {
        self.0.ticks()
    }

    fn ticks_per_256(&self) -> u32 {
        timer::TICKS_PER_256
    }

    fn stack(&self) -> [u32; 2] {
        stack::used()
    }
}
