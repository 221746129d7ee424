//! Host-side harness of `viewshed`: recordings in, metrics and pictures out.

pub mod evaluation;
pub mod geometry;
pub mod recording;
pub mod truth;
