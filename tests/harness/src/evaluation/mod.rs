//! Object-wise and cell-wise comparison of visibility with what the sensor detected.

pub mod cells;
pub mod counts;
pub mod samples;
pub mod score;

use serde::Serialize;

/// Every rule of the evaluation that is a choice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Options {
    /// Objects slower than this are not counted (they still occlude), m/s.
    pub min_speed_mps: f64,
    /// Height at which visibility is judged, metres above the road.
    pub slice_height_m: f64,
    /// Start of a recording that is not counted, seconds.
    pub warm_up_s: f64,
    /// Growth of a footprint in which a detection belongs to its object, metres to each side.
    pub growth_m: f64,
    /// Further growth across the line of sight, degrees of azimuth to each side.
    pub growth_azimuth_deg: f64,
    /// Tolerance between measured and projected radial velocity, m/s.
    pub doppler_tolerance_mps: f64,
    /// Detections an object needs to count as detected.
    pub min_detections: u32,
    /// Bootstrap repetitions behind each interval.
    pub bootstrap: u32,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            min_speed_mps: 1.0,
            slice_height_m: 1.0,
            warm_up_s: 1.0,
            growth_m: 1.0,
            growth_azimuth_deg: 1.0,
            doppler_tolerance_mps: 1.5,
            min_detections: 1,
            bootstrap: 1000,
            seed: 1,
        }
    }
}
