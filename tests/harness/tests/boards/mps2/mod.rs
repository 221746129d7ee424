//! The Cortex-M4F of the MPS2 board.

mod batch;
mod image;
#[cfg(unix)]
mod serial;
