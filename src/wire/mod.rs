//! Radar frames in, visibility out.

pub mod code;
pub mod e2e;
pub mod frame;
pub mod header;
pub mod message;
pub mod serial;
pub mod status;
pub mod visible_range;
