//! The spherical grid: what is occupied around the sensor, and the lines of sight through it.
//!
//! ```text
//! evidence -> spherical grid -> raycast -+-> polar map
//!                                        |
//! obstacles -----------------> shadow ---+
//! ```

pub mod axes;
pub mod evidence;
pub mod raycast;
pub mod settling;
pub mod shadow;
pub mod spherical;
mod stack;
