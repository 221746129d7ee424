//! The static field of view: where the sensor could detect under ideal conditions.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig;
use crate::sensor::config::{ConfigError, above, within};

/// Longest range a field of view may have, metres: squares of centimetres stay in 32 bits.
pub const MAX_RANGE_M: f32 = 400.0;

/// Limits in the sensor frame.
///
/// # Units
/// Degrees (azimuth + left, elevation + up) and metres of slant range.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct FieldOfView {
    /// Rightmost azimuth.
    pub azimuth_min_deg: f32,
    /// Leftmost azimuth.
    pub azimuth_max_deg: f32,
    /// Lowest elevation.
    pub elevation_min_deg: f32,
    /// Highest elevation.
    pub elevation_max_deg: f32,
    /// Shortest range.
    pub range_min_m: f32,
    /// Longest range.
    pub range_max_m: f32,
}

/// The limits in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Azimuth from right to left.
    pub azimuth: [Angle; 2],
    /// Elevation from low to high.
    pub elevation: [Angle; 2],
    /// Slant range, centimetres.
    pub range_cm: [i32; 2],
}

impl FieldOfView {
    /// Checks the limits and rounds them.
    ///
    /// # Errors
    /// Limits that are reversed or not finite, an azimuth beyond 85 degrees (a roadside radar looks
    /// ahead), a range beyond 400 m.
    pub fn limits(&self) -> Result<Limits, ConfigError> {
        within("field_of_view.azimuth_min_deg", self.azimuth_min_deg, -85.0, 85.0)?;
        within("field_of_view.azimuth_max_deg", self.azimuth_max_deg, -85.0, 85.0)?;
        above("field_of_view.azimuth_max_deg", self.azimuth_max_deg, self.azimuth_min_deg)?;
        within("field_of_view.elevation_min_deg", self.elevation_min_deg, -85.0, 85.0)?;
        within("field_of_view.elevation_max_deg", self.elevation_max_deg, -85.0, 85.0)?;
        above("field_of_view.elevation_max_deg", self.elevation_max_deg, self.elevation_min_deg)?;
        within("field_of_view.range_min_m", self.range_min_m, 0.0, MAX_RANGE_M)?;
        within("field_of_view.range_max_m", self.range_max_m, 1.0, MAX_RANGE_M)?;
        above("field_of_view.range_max_m", self.range_max_m, self.range_min_m)?;
        let angle = Angle::from_degrees;
        Ok(Limits {
            azimuth: [angle(self.azimuth_min_deg), angle(self.azimuth_max_deg)],
            elevation: [angle(self.elevation_min_deg), angle(self.elevation_max_deg)],
            range_cm: [math::round_i32(self.range_min_m * 100.0), math::round_i32(self.range_max_m * 100.0)],
        })
    }

    /// Whether a sensor-frame point, metres, lies inside; for start-up tables.
    pub fn contains(&self, [x, y, z]: [f32; 3]) -> bool {
        let ground = math::sqrt(x * x + y * y);
        let range = math::sqrt(ground * ground + z * z);
        let azimuth = math::atan2(y, x).to_degrees();
        let elevation = math::atan2(z, ground).to_degrees();
        range >= self.range_min_m
            && range <= self.range_max_m
            && azimuth >= self.azimuth_min_deg
            && azimuth <= self.azimuth_max_deg
            && elevation >= self.elevation_min_deg
            && elevation <= self.elevation_max_deg
    }
}

impl Limits {
    /// Whether a sensor-frame point, centimetres, lies inside.
    #[allow(clippy::cast_possible_truncation)] // roots of 64-bit squares fit
    pub fn contains(&self, [x, y, z]: [i32; 3]) -> bool {
        let square = |v: i32| i64::from(v) * i64::from(v);
        let ground = (square(x) + square(y)).unsigned_abs().isqrt() as i32;
        let range = (square(x) + square(y) + square(z)).unsigned_abs().isqrt() as i32;
        let within = |v: Angle, [low, high]: [Angle; 2]| v >= low && v <= high;
        range >= self.range_cm[0]
            && range <= self.range_cm[1]
            && within(trig::bearing(x, y), self.azimuth)
            && within(trig::bearing(ground, z), self.elevation)
    }

    /// Whether a sensor-frame point, centimetres, lies between the azimuths and not above the upper limit.
    #[allow(clippy::cast_possible_truncation)] // roots of 64-bit squares fit
    pub fn reaches(&self, [x, y, z]: [i32; 3]) -> bool {
        let square = |v: i32| i64::from(v) * i64::from(v);
        let ground = (square(x) + square(y)).unsigned_abs().isqrt() as i32;
        let azimuth = trig::bearing(x, y);
        azimuth >= self.azimuth[0] && azimuth <= self.azimuth[1] && trig::bearing(ground, z) <= self.elevation[1]
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A usual radar's, for tests.
    pub(crate) const VIEW: FieldOfView = FieldOfView {
        azimuth_min_deg: -60.0,
        azimuth_max_deg: 60.0,
        elevation_min_deg: -16.0,
        elevation_max_deg: 16.0,
        range_min_m: 3.0,
        range_max_m: 200.0,
    };

    #[test]
    fn reversed_limits_are_named() {
        let e = FieldOfView { azimuth_min_deg: 70.0, ..VIEW }.limits().unwrap_err();
        assert_eq!(e.parameter, "field_of_view.azimuth_max_deg");
        let e = FieldOfView { range_min_m: 250.0, ..VIEW }.limits().unwrap_err();
        assert_eq!(e.parameter, "field_of_view.range_max_m");
        let e = FieldOfView { elevation_max_deg: f32::NAN, ..VIEW }.limits().unwrap_err();
        assert_eq!(e.parameter, "field_of_view.elevation_max_deg");
    }

    #[test]
    fn left_is_positive_azimuth() {
        let one_sided = FieldOfView { azimuth_min_deg: 0.0, ..VIEW };
        assert!(one_sided.contains([10.0, 5.0, 0.0]) && !one_sided.contains([10.0, -5.0, 0.0]));
        assert!(VIEW.contains([199.0, 0.0, 0.0]) && !VIEW.contains([201.0, 0.0, 0.0]));
        assert!(!VIEW.contains([10.0, 0.0, -5.0]), "the near range below the lower limit is outside");
        let limits = one_sided.limits().unwrap();
        assert!(limits.contains([1000, 500, 0]) && !limits.contains([1000, -500, 0]));
        assert!(!limits.contains([1000, 0, -500]) && !limits.contains([20_100, 0, 0]));
    }
}
