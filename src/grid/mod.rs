//! The spherical grid: what is occupied around the sensor, and the lines of sight through it.
//!
//! ```text
//! obstacles -> voxelise -+
//!                        v
//! evidence -----> spherical grid -> raycast -> polar map
//! ```

pub mod axes;
pub mod evidence;
pub mod raycast;
pub mod spherical;
mod stack;
pub mod voxelise;
