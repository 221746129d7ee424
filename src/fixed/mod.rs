//! Integers with their scale: angles, time, directions, lengths and rows of bits.
//!
//! Nothing here knows a radar. After start-up the library computes in these only, so that the same input gives
//! the same bits on every machine.

pub mod angle;
pub mod bits;
pub(crate) mod bytes;
pub(crate) mod math;
pub mod time;
pub mod trig;
