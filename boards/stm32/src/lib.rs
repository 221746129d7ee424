//! What the STM32 boards share: drivers of embassy behind the library's traits.
//!
//! Not a board; has no pins, clocks or regions. Unsafe code is in `crash` and `dma`, and where `unit`'s interrupt enters its executor.
#![no_std]

pub mod can;
pub mod crash;
pub mod dma;
pub mod serial;
pub mod unit;

use viewshed::Time;
use viewshed::board::Identity;

/// The hardware timer's time, in which the loop, the receive queues and the events count.
pub fn now() -> Time {
    Time::from_micros(embassy_time::Instant::now().as_micros())
}

/// A board's program on this chip; of the chip's 96-bit number a check sum.
pub fn identity(board: &'static str, grid: [u8; 2]) -> Identity {
    Identity { board, chip: Identity::number(&embassy_stm32::uid::uid()), is_bench: false, grid }
}
