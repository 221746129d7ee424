//! The first CMSDK dual timer, free running at 25 MHz.
//!
//! Under QEMU with `-icount shift=6` an instruction takes 64 ns of virtual time, 1.6 ticks: the timer
//! counts instructions, not cycles.

use crate::Register;

const LOAD: Register = Register(0x4000_2000);
const VALUE: Register = Register(0x4000_2004);
const CONTROL: Register = Register(0x4000_2008);
/// Enabled, free running, 32 bits.
const RUN: u32 = 1 << 7 | 1 << 1;

/// Ticks to 256 instructions under `-icount shift=6`: 64 ns each at 25 MHz.
pub const TICKS_PER_256: u32 = 410;

/// The running timer.
pub struct Timer(());

impl Timer {
    /// Starts it.
    pub fn start() -> Self {
        CONTROL.write(0);
        LOAD.write(u32::MAX);
        CONTROL.write(RUN);
        Self(())
    }

    /// Ticks since some moment, modulo 2^32.
    pub fn ticks(&self) -> u32 {
        !VALUE.read()
    }
}
