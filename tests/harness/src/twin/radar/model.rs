//! Parameters of a radar, each with its unit and where its value comes from.
//!
//! The defaults are those of an up-to-date 77 GHz traffic radar with elevation: figures that data sheets
//! state (resolutions, beams, list length) are in their range, those that none states are assumptions and
//! said to be.

use anyhow::{Result, ensure};
use serde::{Deserialize, Serialize};

use super::misses::Misses;
use crate::twin::road::Road;

/// Everything that makes one radar another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RadarModel {
    /// Wavelength, metres: 76.5 GHz, the middle of the long-range band (ETSI EN 301 091).
    pub wavelength_m: f64,
    /// SNR of 10 dBsm at 100 m on the boresight, dB. From the radar equation with 12 dBm, 20 dBi to both
    /// sides, 13 ms of coherent time, 12 dB noise figure and 4 dB losses (figures of that order: ITU-R
    /// M.2057 for automotive radars).
    pub reference_snr_db: f64,
    pub antenna: Antenna,
    pub resolution: Resolution,
    pub detector: Detector,
    pub accuracy: Accuracy,
    pub fading: Fading,
    pub road: Road,
    pub mirrors: Mirrors,
    pub interference: Interference,
    /// Longest list of one frame, the strongest stay.
    pub max_detections: usize,
    pub rounding: Rounding,
    /// Frames that show nothing of a vehicle in sight; the default never does, as no data sheet says how often.
    #[serde(skip_serializing_if = "Misses::is_none")]
    pub misses: Misses,
}

/// Gain over the angle from the boresight: 3GPP TR 38.901 table 7.3-1 (and ITU-R M.2101), parabola in dB with a floor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Antenna {
    /// One-way 3 dB beam width, degrees. Traffic radars: 50 to 68 (smartmicro UMRR-12 type 48 manual), wide ones to 100.
    pub azimuth_beam_deg: f64,
    /// One-way 3 dB beam width, degrees: 13 to 14 in the same manual.
    pub elevation_beam_deg: f64,
    /// Deepest fall of the pattern, one way, dB.
    pub side_lobe_db: f64,
}

/// What two scatterers must differ by, in one of these, to be two detections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Resolution {
    /// Range, metres: c / 2B of 300 MHz.
    pub range_m: f64,
    /// Azimuth on the boresight, degrees; grows with 1 / cos to the sides, as an array's does.
    pub azimuth_deg: f64,
    /// Elevation, degrees: not resolved, it scales the error of the one height a cell has.
    pub elevation_deg: f64,
    /// Radial velocity, m/s: wavelength / 2T of 13 ms.
    pub velocity_mps: f64,
    /// Weakest that shows beside the strongest of the same range and velocity, dB: side lobes of the array.
    pub azimuth_side_lobe_db: f64,
}

/// Threshold by ordered statistics: H. Rohling, "Radar CFAR Thresholding in Clutter and Multiple Target
/// Situations", IEEE Trans. AES-19 (1983).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Detector {
    /// Threshold above the estimated noise, dB.
    pub threshold_db: f64,
    /// Range cells to each side that the noise is estimated from.
    pub window_cells: u32,
    /// Cells beside the one tested that are left out.
    pub guard_cells: u32,
    /// Rank of the cell taken as noise, share of the window (Rohling: 3/4).
    pub rank: f64,
    /// Factor on the number of false alarms that noise alone gives.
    pub false_alarms: f64,
}

/// Errors: `resolution / (1.6 sqrt(2 SNR))`, D. Barton and H. Ward, "Handbook of Radar Measurement" (1969),
/// and a part that does not fall with SNR, added in squares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Accuracy {
    /// Least error of range, metres (standard deviation; data sheets: 0.1 to 0.4).
    pub range_m: f64,
    /// Least error of azimuth, degrees (data sheets: 0.1 to 0.5).
    pub azimuth_deg: f64,
    /// Least error of elevation, degrees (data sheets: 0.1 to 1).
    pub elevation_deg: f64,
    /// Least error of radial velocity, m/s (data sheets: 0.03 to 0.1).
    pub velocity_mps: f64,
}

/// How a scatterer's power varies from frame to frame: P. Swerling, "Probability of Detection for
/// Fluctuating Targets" (1954; IRE Trans. IT-6, 1960), as a gamma distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fading {
    /// Shape: 1 is Swerling I, 2 is Swerling III, 0 is none. Cars from behind at W band: gamma of about
    /// this shape (Buller and LeBlanc, IEEE APS 2012).
    pub shape: u32,
    /// Share of the speed by which returns of turning wheels differ, at most: D. Kellner et al., "Wheel
    /// Extraction based on Micro Doppler Distribution using High-Resolution Radar", IEEE ICMIM 2015.
    pub wheel_spread: f64,
}

/// Ghosts: F. Kraus et al., "The Radar Ghost Dataset" (2021, arXiv 2404.01437), and M. Bühren, B. Yang,
/// "Extension of Automotive Radar Target List Simulation to consider further Physical Aspects", ITST 2007.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mirrors {
    /// Loss of a wave thrown on by the side of a truck or bus, one way, dB (assumption: a flat metal wall
    /// loses little, ribs and curtains much). Structures state their own.
    pub vehicle_loss_db: f64,
    /// Greatest distance from a mirror to what shows in it, metres.
    pub reach_m: f64,
}

/// Bursts of other radars: G. Brooker, "Mutual Interference of Millimeter-Wave Radar Systems", IEEE Trans.
/// EMC 49 (2007): mostly a rise of the noise, seldom a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Interference {
    /// Probability that a frame is met.
    pub probability: f64,
    /// Mean rise of the noise in such a frame, dB (exponential).
    pub noise_rise_db: f64,
}

/// Least steps of what is put out, as interfaces of sensors have them; powers of two keep recordings small.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rounding {
    pub range_m: f64,
    pub azimuth_rad: f64,
    pub elevation_rad: f64,
    pub velocity_mps: f64,
    /// Of RCS and SNR, dB.
    pub strength_db: f64,
}

impl Default for RadarModel {
    fn default() -> Self {
        Self {
            wavelength_m: 0.00392,
            reference_snr_db: 40.0,
            antenna: Antenna::default(),
            resolution: Resolution::default(),
            detector: Detector::default(),
            accuracy: Accuracy::default(),
            fading: Fading::default(),
            road: Road::default(),
            mirrors: Mirrors::default(),
            interference: Interference::default(),
            max_detections: 1024,
            rounding: Rounding::default(),
            misses: Misses::default(),
        }
    }
}

impl Default for Antenna {
    fn default() -> Self {
        Self { azimuth_beam_deg: 90.0, elevation_beam_deg: 16.0, side_lobe_db: 25.0 }
    }
}

impl Default for Resolution {
    fn default() -> Self {
        Self { range_m: 0.5, azimuth_deg: 1.6, elevation_deg: 4.0, velocity_mps: 0.15, azimuth_side_lobe_db: 22.0 }
    }
}

impl Default for Detector {
    fn default() -> Self {
        Self { threshold_db: 12.0, window_cells: 16, guard_cells: 2, rank: 0.75, false_alarms: 1.0 }
    }
}

impl Default for Accuracy {
    fn default() -> Self {
        Self { range_m: 0.10, azimuth_deg: 0.15, elevation_deg: 0.4, velocity_mps: 0.05 }
    }
}

impl Default for Fading {
    fn default() -> Self {
        Self { shape: 1, wheel_spread: 0.7 }
    }
}

impl Default for Mirrors {
    fn default() -> Self {
        Self { vehicle_loss_db: 10.0, reach_m: 30.0 }
    }
}

impl Default for Interference {
    fn default() -> Self {
        Self { probability: 0.0, noise_rise_db: 3.0 }
    }
}

impl Default for Rounding {
    fn default() -> Self {
        Self {
            range_m: 1.0 / 16.0,
            azimuth_rad: 1.0 / 2048.0,
            elevation_rad: 1.0 / 512.0,
            velocity_mps: 1.0 / 32.0,
            strength_db: 0.5,
        }
    }
}

impl RadarModel {
    /// # Errors
    /// The first parameter outside its limits, by name.
    pub fn check(&self) -> Result<()> {
        let (a, r, d, e, m) = (&self.antenna, &self.resolution, &self.detector, &self.accuracy, &self.rounding);
        let limits = [
            ("wavelength_m", self.wavelength_m, 0.001, 0.1),
            ("reference_snr_db", self.reference_snr_db, -20.0, 100.0),
            ("antenna.azimuth_beam_deg", a.azimuth_beam_deg, 1.0, 180.0),
            ("antenna.elevation_beam_deg", a.elevation_beam_deg, 1.0, 180.0),
            ("antenna.side_lobe_db", a.side_lobe_db, 0.0, 100.0),
            ("resolution.range_m", r.range_m, 0.05, 10.0),
            ("resolution.azimuth_deg", r.azimuth_deg, 0.1, 30.0),
            ("resolution.elevation_deg", r.elevation_deg, 0.1, 60.0),
            ("resolution.velocity_mps", r.velocity_mps, 0.01, 5.0),
            ("resolution.azimuth_side_lobe_db", r.azimuth_side_lobe_db, 0.0, 100.0),
            // below this the noise alone would fill the list
            ("detector.threshold_db", d.threshold_db, 9.0, 40.0),
            ("detector.window_cells", f64::from(d.window_cells), 2.0, 1000.0),
            ("detector.guard_cells", f64::from(d.guard_cells), 0.0, 100.0),
            ("detector.rank", d.rank, 0.1, 1.0),
            ("detector.false_alarms", d.false_alarms, 0.0, 10.0),
            ("accuracy.range_m", e.range_m, 0.0, 10.0),
            ("accuracy.azimuth_deg", e.azimuth_deg, 0.0, 30.0),
            ("accuracy.elevation_deg", e.elevation_deg, 0.0, 30.0),
            ("accuracy.velocity_mps", e.velocity_mps, 0.0, 10.0),
            ("fading.shape", f64::from(self.fading.shape), 0.0, 100.0),
            ("fading.wheel_spread", self.fading.wheel_spread, 0.0, 1.0),
            ("road.permittivity", self.road.permittivity, 0.0, 100.0),
            ("road.roughness_mm", self.road.roughness_mm, 0.0, 100.0),
            ("mirrors.vehicle_loss_db", self.mirrors.vehicle_loss_db, 0.0, 200.0),
            ("mirrors.reach_m", self.mirrors.reach_m, 0.0, 200.0),
            ("interference.probability", self.interference.probability, 0.0, 1.0),
            ("interference.noise_rise_db", self.interference.noise_rise_db, 0.0, 60.0),
            ("max_detections", self.max_detections as f64, 1.0, 65_536.0),
            ("rounding.range_m", m.range_m, 1e-6, 5.0),
            ("rounding.azimuth_rad", m.azimuth_rad, 1e-9, 0.2),
            ("rounding.elevation_rad", m.elevation_rad, 1e-9, 0.2),
            ("rounding.velocity_mps", m.velocity_mps, 1e-6, 5.0),
            ("rounding.strength_db", m.strength_db, 1e-6, 10.0),
        ];
        for (name, value, low, high) in limits {
            // a NaN lies in no range
            ensure!((low..=high).contains(&value), "model.{name} is {value}, it must lie in {low} to {high}");
        }
        self.misses.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_pass_and_a_wrong_parameter_is_named() {
        RadarModel::default().check().unwrap();
        let mut model = RadarModel::default();
        model.resolution.range_m = f64::NAN;
        assert!(model.check().unwrap_err().to_string().contains("model.resolution.range_m is NaN"));
    }

    #[test]
    fn the_reference_follows_from_the_radar_equation() {
        let model = RadarModel::default();
        let (power_w, gain, rcs, range_m) = (0.01585, 100.0_f64, 10.0, 100.0_f64);
        let received = power_w * gain * gain * model.wavelength_m.powi(2) * rcs
            / ((4.0 * std::f64::consts::PI).powi(3) * range_m.powi(4));
        let noise = 1.38e-23 * 290.0 * 10_f64.powf(1.2) / 0.013;
        let snr_db = 10.0 * (received / noise).log10() - 4.0;
        assert!((snr_db - model.reference_snr_db).abs() < 1.0, "{snr_db}");
    }
}
