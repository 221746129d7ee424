//! One radar frame: its detections, which of them count, where they lie on the road and how well they repeat, and what a missing one means.

pub mod by_range;
pub mod detection;
pub mod gate;
pub mod health;
pub mod reflection;
pub mod repeatability;
pub mod repeats;
pub mod scan;
pub mod thinning;
pub mod unjudged;
