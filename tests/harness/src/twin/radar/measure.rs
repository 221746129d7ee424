//! From a peak to what the sensor reports: errors that grow as SNR falls, rounding.

use super::Radar;
use super::cells::Peak;
use super::model::RadarModel;
use crate::recording::RadarDetection;
use crate::twin::random::Dice;

/// Slope of the error signal of a monopulse measurement (Barton and Ward).
const SLOPE: f64 = 1.6;

/// One detection; `None` beyond what the sensor can report.
pub fn measure(radar: &Radar, peak: &Peak, noise: f64, dice: &mut Dice) -> Option<RadarDetection> {
    let RadarModel { resolution, accuracy, antenna, rounding, .. } = &radar.model;
    let spread = |resolution: f64, least: f64| error(resolution, least, peak.power);
    // all four draws are made, so that one more rejection shifts no other
    let errors = [dice.normal(), dice.normal(), dice.normal(), dice.normal()];
    let azimuth_resolution = resolution.azimuth_deg.to_radians() / peak.azimuth_rad.cos().max(0.1);
    let range_m = peak.range_m + errors[0] * spread(resolution.range_m, accuracy.range_m);
    let azimuth_rad = peak.azimuth_rad + errors[1] * spread(azimuth_resolution, accuracy.azimuth_deg.to_radians());
    let elevation_rad = peak.elevation_rad
        + errors[2] * spread(resolution.elevation_deg.to_radians(), accuracy.elevation_deg.to_radians());
    let velocity_mps = peak.velocity_mps + errors[3] * spread(resolution.velocity_mps, accuracy.velocity_mps);
    let round = |value: f64, step: f64| ((value / step).round() * step) as f32;
    let range_m = round(range_m, rounding.range_m);
    if range_m <= 0.0 || f64::from(range_m) > radar.field_of_view.range_m[1] {
        return None;
    }
    let snr_db = 10.0 * peak.power.log10();
    // the sensor knows its own pattern where it believes the target to be
    let believed_rad = if radar.has_elevation { elevation_rad } else { 0.0 };
    let gain_db = 2.0 * antenna.gain_db(azimuth_rad, believed_rad);
    let rcs_dbsm = radar.rcs_dbsm(snr_db + 10.0 * noise.log10(), f64::from(range_m), gain_db);
    Some(RadarDetection {
        range_m,
        azimuth_rad: round(azimuth_rad, rounding.azimuth_rad),
        elevation_rad: radar.has_elevation.then(|| round(elevation_rad, rounding.elevation_rad)),
        radial_velocity_mps: round(velocity_mps, rounding.velocity_mps),
        rcs_dbsm: Some(round(rcs_dbsm, rounding.strength_db)),
        snr_db: Some(round(snr_db, rounding.strength_db)),
    })
}

/// Standard deviation of a measurement at a power over the noise.
fn error(resolution: f64, least: f64, power: f64) -> f64 {
    (resolution / (SLOPE * (2.0 * power).sqrt())).hypot(least)
}

#[cfg(test)]
mod tests {
    use super::super::made_up::radar;
    use super::*;
    use crate::twin::random::Use;

    fn peak(power: f64) -> Peak {
        Peak { bin: [0; 3], power, range_m: 100.0, azimuth_rad: 0.1, elevation_rad: -0.05, velocity_mps: 12.0 }
    }

    #[test]
    fn errors_grow_as_snr_falls_down_to_a_floor() {
        let radar = radar();
        let deviation = |power: f64| {
            let mut dice = Dice::new(1, Use::RadarFrame, 9);
            let errors: Vec<f64> = (0..4000)
                .map(|_| f64::from(measure(&radar, &peak(power), 1.0, &mut dice).unwrap().azimuth_rad) - 0.1)
                .collect();
            (errors.iter().map(|e| e * e).sum::<f64>() / 4000.0).sqrt().to_degrees()
        };
        // 1.6 degrees / (1.6 sqrt(2 x 16)) = 0.177, with 0.15: 0.232
        assert!((deviation(16.0) - 0.232).abs() < 0.02, "{}", deviation(16.0));
        assert!((deviation(1e6) - 0.15).abs() < 0.01, "{}", deviation(1e6));
    }

    #[test]
    fn what_is_reported_has_the_steps_of_the_interface() {
        let radar = radar();
        let d = measure(&radar, &peak(50.0), 1.0, &mut Dice::new(1, Use::RadarFrame, 2)).unwrap();
        assert_eq!(d.range_m * 16.0, (d.range_m * 16.0).round());
        assert_eq!(d.snr_db, Some(17.0));
        assert_eq!(d.rcs_dbsm.unwrap() * 2.0, (d.rcs_dbsm.unwrap() * 2.0).round());
        let mut flat = radar.clone();
        flat.has_elevation = false;
        let d = measure(&flat, &peak(50.0), 1.0, &mut Dice::new(1, Use::RadarFrame, 2)).unwrap();
        assert_eq!(d.elevation_rad, None);
    }
}
