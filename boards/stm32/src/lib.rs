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

/// The hardware timer's time, in which the loop, the receive queues and the events count.
pub fn now() -> Time {
    Time::from_micros(embassy_time::Instant::now().as_micros())
}
