//! The road frame: where places on the road are named.
//!
//! Its origin lies on the ground, wherever the integrator chooses; x runs along the road, y to the left, z up.

use crate::fixed::math;
use crate::sensor::config::{ConfigError, within};

/// A point on the road plane, in the road frame.
///
/// # Units
/// Centimetres, x along the road, y to the left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RoadPoint {
    /// Along the road.
    pub x_cm: i32,
    /// To the left.
    pub y_cm: i32,
}

/// Farthest a point named in metres may lie from the origin.
const FARTHEST_M: f32 = 100_000.0;

impl RoadPoint {
    /// From metres along the road and to the left, rounded to centimetres.
    ///
    /// # Errors
    /// A coordinate that is not finite or beyond 100 km.
    pub fn from_metres(x_m: f32, y_m: f32) -> Result<Self, ConfigError> {
        let cm = |name, m| within(name, m, -FARTHEST_M, FARTHEST_M).map(|m| math::round_i32(m * 100.0));
        Ok(Self { x_cm: cm("x_m", x_m)?, y_cm: cm("y_m", y_m)? })
    }

    /// From centimetres.
    pub const fn new(x_cm: i32, y_cm: i32) -> Self {
        Self { x_cm, y_cm }
    }

    /// Centre of the 1 m cell (i, j) = [i, i+1) x [j, j+1) metres.
    pub const fn cell_centre(i: i32, j: i32) -> Self {
        Self { x_cm: i.saturating_mul(100).saturating_add(50), y_cm: j.saturating_mul(100).saturating_add(50) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metres_become_centimetres_forward_and_left() {
        assert_eq!(RoadPoint::from_metres(12.345, -0.5), Ok(RoadPoint::new(1235, -50)));
        assert_eq!(RoadPoint::from_metres(f32::NAN, 0.0).unwrap_err().parameter, "x_m");
        assert_eq!(RoadPoint::from_metres(0.0, 2e5).unwrap_err().parameter, "y_m");
    }

    #[test]
    fn a_cells_centre_lies_half_a_metre_in() {
        assert_eq!(RoadPoint::cell_centre(-1, 2), RoadPoint::new(-50, 250));
    }
}
