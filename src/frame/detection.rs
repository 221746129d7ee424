//! One low-level radar measurement, in the integer units of the target.
//!
//! Public sources disagree on signs (TI counts azimuth to the right, OSI approaching speed), so
//! every decoder converts to the convention fixed here: azimuth + left, elevation + up, radial
//! velocity + receding.

use crate::fixed::angle::Angle;
use crate::fixed::math;

/// A detection, in the sensor frame (x along boresight, y left, z up).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// Slant range, centimetres; never zero.
    pub range_cm: u16,
    /// Azimuth, + left.
    pub azimuth: Angle,
    /// Elevation, + up; `None` where the radar does not measure it.
    pub elevation: Option<Angle>,
    /// Radial velocity, cm/s, + receding.
    pub radial_velocity_cm_s: i16,
    /// Radar cross-section, half dBsm.
    pub rcs_half_dbsm: Option<i16>,
    /// Signal-to-noise ratio, half dB.
    pub snr_half_db: Option<i16>,
    /// Left out by the radar's own marks, see [`Ars408Wanted`](crate::inputs::ars408::quality::Ars408Wanted): no estimator
    /// uses it, and that something was measured there is still known.
    pub marked: bool,
}

/// A measurement in SI units, as files and simulators have it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Slant range, metres.
    pub range_m: f32,
    /// Azimuth, radians, + left.
    pub azimuth_rad: f32,
    /// Elevation, radians, + up.
    pub elevation_rad: Option<f32>,
    /// Radial velocity, m/s, + receding.
    pub radial_velocity_mps: f32,
    /// Radar cross-section, dBsm.
    pub rcs_dbsm: Option<f32>,
    /// Signal-to-noise ratio, dB.
    pub snr_db: Option<f32>,
}

/// Why a measurement is no detection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotADetection {
    /// A value is infinite or not a number.
    NotFinite,
    /// The range is zero, negative or beyond 655.35 m.
    Range,
    /// An angle lies beyond half a turn, or the speed beyond 327.67 m/s.
    Absurd,
}

impl core::fmt::Display for NotADetection {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a value of the detection is infinite or not a number",
            Self::Range => "the detection's range is not within 0.01 to 655.35 m",
            Self::Absurd => "an angle of the detection lies beyond half a turn, or its speed beyond 327.67 m/s",
        })
    }
}

impl core::error::Error for NotADetection {}

/// Largest range a detection can hold, metres.
pub const MAX_RANGE_M: f32 = 655.35;

impl Detection {
    /// Rounds a measurement to the target's units.
    ///
    /// # Errors
    /// Values that are not finite or do not fit; nothing is clamped into a wrong measurement. RCS
    /// and SNR that are not finite count as not measured.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // ranges are checked first
    pub fn new(m: &Measurement) -> Result<Self, NotADetection> {
        let elevation_rad = m.elevation_rad.unwrap_or(0.0);
        if ![m.range_m, m.azimuth_rad, elevation_rad, m.radial_velocity_mps].iter().all(|v| v.is_finite()) {
            return Err(NotADetection::NotFinite);
        }
        let range_cm = math::round(m.range_m * 100.0);
        if !(1.0..=65535.0).contains(&range_cm) {
            return Err(NotADetection::Range);
        }
        let half_turn = core::f32::consts::PI;
        let speed = math::round(m.radial_velocity_mps * 100.0);
        if m.azimuth_rad.abs() > half_turn || elevation_rad.abs() > half_turn / 2.0 || speed.abs() > 32767.0 {
            return Err(NotADetection::Absurd);
        }
        let half_db =
            |v: Option<f32>| v.filter(|v| v.is_finite()).map(|v| math::round_i32(v * 2.0).clamp(-32767, 32767) as i16);
        Ok(Self {
            range_cm: range_cm as u16,
            azimuth: Angle::from_radians(m.azimuth_rad),
            elevation: m.elevation_rad.map(Angle::from_radians),
            radial_velocity_cm_s: speed as i16,
            rcs_half_dbsm: half_db(m.rcs_dbsm),
            snr_half_db: half_db(m.snr_db),
            marked: false,
        })
    }

    /// SNR, else RCS, half dB: what a list that is too full is thinned by, beside where detections came from.
    pub fn strength(&self) -> Option<i16> {
        self.snr_half_db.or(self.rcs_half_dbsm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const M: Measurement = Measurement {
        range_m: 123.456,
        azimuth_rad: 0.1,
        elevation_rad: Some(-0.05),
        radial_velocity_mps: -25.004,
        rcs_dbsm: Some(10.3),
        snr_db: Some(f32::NAN),
    };

    #[test]
    fn units_and_signs_are_the_documented_ones() {
        let d = Detection::new(&M).unwrap();
        assert_eq!(d.range_cm, 12346);
        assert_eq!(d.azimuth.raw(), 1043); // 0.1 / 2 pi * 65536, + left
        assert_eq!(d.elevation.unwrap().raw(), -522);
        assert_eq!(d.radial_velocity_cm_s, -2500);
        assert_eq!(d.rcs_half_dbsm, Some(21));
        assert_eq!(d.snr_half_db, None);
        assert_eq!(d.strength(), Some(21));
    }

    #[test]
    fn what_does_not_fit_is_refused_by_reason() {
        let with = |f: fn(&mut Measurement)| {
            let mut m = M;
            f(&mut m);
            Detection::new(&m)
        };
        assert_eq!(with(|m| m.range_m = f32::NAN), Err(NotADetection::NotFinite));
        assert_eq!(with(|m| m.range_m = -1.0), Err(NotADetection::Range));
        assert_eq!(with(|m| m.range_m = 0.0), Err(NotADetection::Range));
        assert_eq!(with(|m| m.range_m = 700.0), Err(NotADetection::Range));
        assert_eq!(with(|m| m.azimuth_rad = 4.0), Err(NotADetection::Absurd));
        assert_eq!(with(|m| m.radial_velocity_mps = 400.0), Err(NotADetection::Absurd));
        assert_eq!(with(|m| m.elevation_rad = Some(f32::INFINITY)), Err(NotADetection::NotFinite));
    }
}
