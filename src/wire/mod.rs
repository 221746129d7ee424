//! Radar frames in, visibility out.

pub mod code;
