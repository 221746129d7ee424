//! Which of a recording's points an estimator can use, and why not.

use viewshed::frame::detection::{Detection, Measurement, NotADetection};
use viewshed::frame::gate::{Gate, GateConfig, Rejection};
use viewshed::sensor::noise::NoiseConfig;

use super::sensor::sensor;
use super::{RadarDetection, Recording};

/// Why a point is no detection, as reports say it.
pub const DROPPED: &str = "dropped when read";
pub const NOT_FINITE: &str = "not finite";
pub const NO_RANGE: &str = "range not measurable";
pub const ABSURD: &str = "absurd";

/// A recorded detection as the library takes it.
pub fn measurement(d: &RadarDetection) -> Measurement {
    Measurement {
        range_m: d.range_m,
        azimuth_rad: d.azimuth_rad,
        elevation_rad: d.elevation_rad,
        radial_velocity_mps: d.radial_velocity_mps,
        rcs_dbsm: d.rcs_dbsm,
        snr_db: d.snr_db,
    }
}

/// What is probably wrong, by what most of the points were rejected for.
pub fn hint(reason: &str) -> &'static str {
    match reason {
        DROPPED | NOT_FINITE => "does the sensor send NaN?",
        ABSURD => "angles in degrees?",
        NO_RANGE => "ranges in another unit than metres?",
        _ if reason == Rejection::Range.name() => "ranges in another unit than metres, or a wrong field of view?",
        _ if reason == Rejection::Quality.name() => "is the field of the SNR never filled, or in another unit than dB?",
        _ if reason == Rejection::Rcs.name() => "is the field of the RCS never filled, or in another unit than dBsm?",
        _ if reason == Rejection::Velocity.name() => "velocities in another unit than m/s?",
        _ => "angles in degrees, or a wrong field of view?",
    }
}

/// What was rejected, in words.
pub fn in_words(reason: Rejection) -> &'static str {
    match reason {
        Rejection::Range => "nearer or farther than the field of view",
        Rejection::Azimuth => "beside the field of view",
        Rejection::Elevation => "above or below the field of view",
        Rejection::Quality => "with too low an SNR",
        Rejection::Rcs => "with too low an RCS",
        Rejection::Velocity => "with a velocity no vehicle has",
        Rejection::Overflow => "too many for --max-detections, of crowded places first",
        Rejection::Unwanted => "left out by the radar's own marks",
        Rejection::Refused => "not finite",
    }
}

/// The gate of a recording's radar; `None` where there can be none, which its estimators say.
pub fn gate(recording: &Recording, config: &GateConfig) -> Option<Gate> {
    config.gate(&sensor(recording, &NoiseConfig::default()).field_of_view.limits().ok()?).ok()
}

/// Why an estimator does not use a detection; `None` where it does.
pub fn rejected(gate: &Gate, d: &RadarDetection) -> Option<&'static str> {
    match Detection::new(&measurement(d)) {
        Ok(d) => gate.judge(&d).err().map(Rejection::name),
        Err(NotADetection::NotFinite) => Some(NOT_FINITE),
        Err(NotADetection::Range) => Some(NO_RANGE),
        Err(NotADetection::Absurd) => Some(ABSURD),
    }
}
