//! Radar frames in, visibility out.

pub mod e2e;
pub mod frame;
pub mod serial;
