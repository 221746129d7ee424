//! The road frame: where places on the road are named.
//!
//! Its origin lies on the ground, wherever the integrator chooses; x runs along the road, y to the left, z up.

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

impl RoadPoint {
    /// From centimetres.
    pub const fn new(x_cm: i32, y_cm: i32) -> Self {
        Self { x_cm, y_cm }
    }

    /// Centre of the 1 m cell (i, j) = [i, i+1) x [j, j+1) metres.
    pub const fn cell_centre(i: i32, j: i32) -> Self {
        Self { x_cm: i.saturating_mul(100).saturating_add(50), y_cm: j.saturating_mul(100).saturating_add(50) }
    }
}
