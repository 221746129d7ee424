//! Threshold over the noise of the neighbourhood, and what noise alone puts above it.
//!
//! # Model
//! Ordered-statistics CFAR along range: the noise of a cell is that of the cell at a rank (3/4) of its
//! window, at least the sensor's own. So one neighbour hides nothing, a long row of strong cells does.
//! Noise power is exponential, so a threshold T (a ratio) lets `exp(-T)` of all cells through.

use std::collections::BTreeMap;

use super::Radar;
use super::cells::{Bin, Peak};
use super::model::Detector;
use crate::twin::random::Dice;

/// Radial velocities that are searched, m/s to each side: 250 km/h.
const FASTEST_MPS: f64 = 70.0;

/// The peaks above their threshold.
pub fn detect(detector: &Detector, peaks: Vec<Peak>) -> Vec<Peak> {
    let threshold = 10_f64.powf(detector.threshold_db / 10.0);
    let mut rows: BTreeMap<[i32; 2], Vec<(i32, f64)>> = BTreeMap::new();
    for p in &peaks {
        rows.entry([p.bin[1], p.bin[2]]).or_default().push((p.bin[0], p.power));
    }
    let passes = |p: &Peak| {
        let Some(row) = rows.get(&[p.bin[1], p.bin[2]]) else { return false };
        p.power > threshold * noise(detector, row, p.bin)
    };
    peaks.iter().copied().filter(passes).collect()
}

/// Noise of the window around a bin, at least 1.
fn noise(detector: &Detector, row: &[(i32, f64)], [range, ..]: Bin) -> f64 {
    let (guard, reach) = (detector.guard_cells as i32, (detector.guard_cells + detector.window_cells) as i32);
    let mut powers: Vec<f64> =
        row.iter().filter(|(r, _)| (guard + 1..=reach).contains(&(r - range).abs())).map(|(_, power)| *power).collect();
    // cells without a peak hold noise; so many may be stronger than the one at the rank
    let above = ((1.0 - detector.rank) * f64::from(2 * detector.window_cells)) as usize;
    if powers.len() <= above {
        return 1.0;
    }
    powers.sort_by(|a, b| b.total_cmp(a));
    powers[above].max(1.0)
}

/// Peaks of noise alone, anywhere the sensor looks.
pub fn false_alarms(radar: &Radar, dice: &mut Dice) -> Vec<Peak> {
    let (model, view) = (&radar.model, &radar.field_of_view);
    let sines = view.azimuth_rad.map(f64::sin);
    let cells = view.range_m[1] / model.resolution.range_m
        * (2.0 * FASTEST_MPS / model.resolution.velocity_mps)
        * ((sines[1] - sines[0]) / model.resolution.azimuth_deg.to_radians().sin());
    let threshold = 10_f64.powf(model.detector.threshold_db / 10.0);
    let count = dice.poisson(model.detector.false_alarms * cells * (-threshold).exp());
    (0..count)
        .map(|_| Peak {
            bin: Bin::default(),
            // an exponential has no memory
            power: threshold + dice.exponential(),
            range_m: dice.between(view.range_m[0], view.range_m[1]),
            azimuth_rad: dice.between(sines[0], sines[1]).asin(),
            elevation_rad: dice.between(view.elevation_rad[0], view.elevation_rad[1]),
            velocity_mps: dice.between(-FASTEST_MPS, FASTEST_MPS),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::made_up::radar;
    use super::*;
    use crate::twin::random::Use;

    fn peak(range: i32, power: f64) -> Peak {
        Peak { bin: [range, 0, 0], power, range_m: 0.0, azimuth_rad: 0.0, elevation_rad: 0.0, velocity_mps: 0.0 }
    }

    #[test]
    fn one_strong_neighbour_hides_nothing_a_long_row_does() {
        let detector = Detector::default();
        let weak = peak(0, 20.0);
        assert_eq!(detect(&detector, vec![weak, peak(5, 1e6)]).len(), 2);
        // 2 x 16 cells, rank 3/4: the ninth strongest is the noise
        let row = |n: i32| (0..n).map(|k| peak(if k % 2 == 0 { 3 + k } else { -2 - k }, 1e3)).chain([weak]).collect();
        assert!(detect(&detector, row(8)).contains(&weak));
        assert!(!detect(&detector, row(9)).contains(&weak));
        assert!(detect(&detector, vec![peak(0, 15.0)]).is_empty(), "12 dB are a factor of 15.8");
    }

    #[test]
    fn false_alarms_come_as_often_as_noise_crosses_the_threshold() {
        let mut radar = radar();
        radar.model.detector.threshold_db = 10.5;
        let mut dice = Dice::new(1, Use::RadarFrame, 1);
        let count: usize = (0..400).map(|_| false_alarms(&radar, &mut dice).len()).sum();
        // 400 ranges x 933 velocities x 62 azimuths, exp(-11.22)
        let expected =
            400.0 * 933.3 * (2.0 * 60_f64.to_radians().sin() / 1.6_f64.to_radians().sin()) * (-10_f64.powf(1.05)).exp();
        assert!((count as f64 / 400.0 - expected).abs() < 0.1 * expected, "{count} {expected}");
    }
}
