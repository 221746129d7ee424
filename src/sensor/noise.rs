//! How well a sensor measures, from its data sheet.

use crate::fixed::math;
use crate::sensor::config::{ConfigError, within};

/// How well the sensor measures; from its data sheet.
///
/// # Units
/// Standard deviations in metres and degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct NoiseConfig {
    /// Range.
    pub range_m: f32,
    /// Azimuth, at worst: radar-3d learns from fixtures that it is better.
    pub azimuth_deg: f32,
    /// Elevation.
    pub elevation_deg: f32,
    /// Radial velocity, m/s.
    pub radial_velocity_mps: f32,
    /// Height above the road at which vehicles usually reflect (bumpers, axles, plates).
    pub reflector_height_m: f32,
}

impl Default for NoiseConfig {
    fn default() -> Self {
        Self { range_m: 0.25, azimuth_deg: 0.5, elevation_deg: 1.0, radial_velocity_mps: 0.15, reflector_height_m: 0.8 }
    }
}

/// The noise model in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    /// Range, centimetres.
    pub range_cm: i32,
    /// Azimuth, 2^-16 rad.
    pub(crate) azimuth: i32,
    /// Elevation, 2^-16 rad.
    pub(crate) elevation: i32,
    /// Radial velocity, cm/s.
    pub radial_velocity_cm_s: i32,
    /// Height of usual reflectors above the road, centimetres.
    pub(crate) reflector_height_cm: i32,
}

impl Noise {
    /// Standard deviation of the azimuth, degrees; for people.
    pub fn azimuth_deg(&self) -> f32 {
        (self.azimuth as f32 / 65536.0).to_degrees()
    }
}

impl NoiseConfig {
    /// Checks the figures and rounds them.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    pub fn noise(&self) -> Result<Noise, ConfigError> {
        let angle = |degrees: f32| math::round_i32(degrees.to_radians() * 65536.0);
        Ok(Noise {
            range_cm: math::round_i32(within("noise.range_m", self.range_m, 0.01, 5.0)? * 100.0),
            azimuth: angle(within("noise.azimuth_deg", self.azimuth_deg, 0.01, 10.0)?),
            elevation: angle(within("noise.elevation_deg", self.elevation_deg, 0.01, 20.0)?),
            radial_velocity_cm_s: math::round_i32(
                within("noise.radial_velocity_mps", self.radial_velocity_mps, 0.01, 5.0)? * 100.0,
            ),
            reflector_height_cm: math::round_i32(
                within("noise.reflector_height_m", self.reflector_height_m, 0.0, 3.0)? * 100.0,
            ),
        })
    }
}
