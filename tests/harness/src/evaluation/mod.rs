//! Object-wise and cell-wise comparison of visibility with what the sensor detected.
//!
//! In data-flow order: a recording becomes [`samples`], an estimator's map is [`score`]d against
//! them ([`bounds`] are scores too), and [`summary`] makes rates ([`counts`], [`cells`]), intervals
//! ([`bootstrap`] over [`units`]), [`breakdown`]s, trade-off [`curve`]s and [`comparison`]s of the
//! scores. [`replay`] does all of that for one recording, [`unlabelled`] what is left of it without labels, [`mount_error`] again with a wrong mount,
//! [`calibration`] judges probabilities, which [`probability`] fits,
//! [`paired`] compares two runs, [`camera`] makes samples for a camera beside the radar, [`pool`] joins several, [`over_time`] counts window by window, and
//! [`examples`] picks what is worth a picture.

pub mod bootstrap;
pub mod bounds;
pub mod breakdown;
pub mod calibration;
pub mod camera;
pub mod causes;
pub mod cells;
pub mod comparison;
pub mod counts;
pub mod curve;
pub mod examples;
pub mod mount_error;
pub mod over_time;
pub mod paired;
pub mod pool;
pub mod probability;
pub mod replay;
pub mod returns;
pub mod samples;
pub mod score;
pub mod sensor_set;
pub mod summary;
pub mod units;
pub mod unlabelled;

use serde::{Deserialize, Serialize};

use crate::estimators;
use crate::recording::ReadOptions;

/// Every option of a replay.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    pub reading: ReadOptions,
    pub evaluation: Options,
    pub estimators: estimators::Options,
}

/// The cells an object's visibility is judged on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Grid {
    /// The Cartesian 1 m cells that the footprint overlaps, as in the paper
    #[default]
    Cartesian,
    /// The map's own polar cells, where it has any
    Polar,
}

impl std::fmt::Display for Grid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Cartesian => "cartesian",
            Self::Polar => "polar",
        })
    }
}

/// Every rule of the evaluation that is a choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
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
    /// Cells V_O is judged on.
    pub grid: Grid,
    /// Bootstrap repetitions behind each interval; 0 for none.
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
            grid: Grid::Cartesian,
            bootstrap: 1000,
            seed: 1,
        }
    }
}

/// An evaluation option outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("evaluation option `{name}` is {value}, it must lie in {low} to {high}")]
pub struct OptionOutOfRange {
    pub name: &'static str,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl Options {
    /// # Errors
    /// The first option outside its range, by name.
    pub fn check(&self) -> Result<(), OptionOutOfRange> {
        let ranges = [
            ("min_speed_mps", self.min_speed_mps, 0.0, 100.0),
            ("slice_height_m", self.slice_height_m, 0.0, 20.0),
            ("warm_up_s", self.warm_up_s, 0.0, 86_400.0),
            ("growth_m", self.growth_m, 0.0, 20.0),
            ("growth_azimuth_deg", self.growth_azimuth_deg, 0.0, 45.0),
            ("doppler_tolerance_mps", self.doppler_tolerance_mps, 0.0, 1000.0),
            ("min_detections", f64::from(self.min_detections), 1.0, 1_000_000.0),
            ("bootstrap", f64::from(self.bootstrap), 0.0, 100_000.0),
        ];
        for (name, value, low, high) in ranges {
            // a NaN lies in no range
            if !(low..=high).contains(&value) {
                return Err(OptionOutOfRange { name, value, low, high });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_out_of_range_is_named() {
        assert_eq!(Options::default().check(), Ok(()));
        let wrong = Options { growth_m: f64::NAN, ..Options::default() };
        assert_eq!(wrong.check().unwrap_err().name, "growth_m");
        let none = Options { min_detections: 0, ..Options::default() };
        assert!(none.check().unwrap_err().to_string().contains("`min_detections` is 0"));
    }

    #[test]
    fn an_unknown_key_is_an_error_with_its_line() {
        let error = toml::from_str::<Options>("min_speed_mps = 2.0\nmin_sped = 1.0\n").unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("min_sped"), "{error}");
    }
}
