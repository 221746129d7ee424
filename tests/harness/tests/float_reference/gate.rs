//! Which measurements are used: the limits on single ones, and which of too many.

use std::collections::BTreeMap;

use viewshed::fixed::time::Time;
use viewshed::frame::detection::{MAX_RANGE_M, Measurement};
use viewshed::frame::gate::{GateConfig, Rejection};
use viewshed::frame::health::Points;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::{Levelled, Placed, place};

/// Half dB, the step quality and size are judged in.
pub fn half_db(value: Option<f32>) -> Option<f64> {
    value.filter(|v| v.is_finite()).map(|v| (f64::from(v) * 2.0).round())
}

/// Whether a measurement is a detection at all.
pub fn is_detection(m: &Measurement) -> bool {
    let values = [m.range_m, m.azimuth_rad, m.elevation_rad.unwrap_or(0.0), m.radial_velocity_mps];
    values.iter().all(|v| v.is_finite())
        && m.range_m >= 0.005
        && m.range_m <= MAX_RANGE_M
        && f64::from(m.azimuth_rad.abs()) <= std::f64::consts::PI
        && f64::from(m.elevation_rad.unwrap_or(0.0).abs()) <= std::f64::consts::FRAC_PI_2
        && m.radial_velocity_mps.abs() <= 327.67
}

/// The first reason a detection may not be used.
pub fn refusal(m: &Measurement, gate: &GateConfig, view: &FieldOfView) -> Option<Rejection> {
    let within = |v: f64, low: f32, high: f32| v >= f64::from(low) && v <= f64::from(high);
    let margin = gate.elevation_margin_deg;
    let elevation = m.elevation_rad.map(|e| f64::from(e).to_degrees());
    let speed = f64::from(m.radial_velocity_mps).abs();
    if !within(f64::from(m.range_m), view.range_min_m, view.range_max_m) {
        Some(Rejection::Range)
    } else if !within(f64::from(m.azimuth_rad).to_degrees(), view.azimuth_min_deg, view.azimuth_max_deg) {
        Some(Rejection::Azimuth)
    } else if elevation.is_some_and(|e| !within(e, view.elevation_min_deg - margin, view.elevation_max_deg + margin)) {
        Some(Rejection::Elevation)
    } else if half_db(m.snr_db).is_some_and(|s| s < f64::from(gate.min_snr_db) * 2.0) {
        Some(Rejection::Quality)
    } else if half_db(m.rcs_dbsm).is_some_and(|r| r < f64::from(gate.min_rcs_dbsm) * 2.0) {
        Some(Rejection::Rcs)
    } else if !within(speed, gate.min_speed_mps, gate.max_speed_mps) {
        Some(Rejection::Velocity)
    } else {
        None
    }
}

/// The bin a measurement falls into, 2.56 m deep and an arc of 2^21 centimetres times 2^-16 turns wide, as one of 1024 values.
fn bin_of(m: &Measurement) -> u64 {
    let range_cm = (f64::from(m.range_m) * 100.0).round();
    let azimuth = (f64::from(m.azimuth_rad) / std::f64::consts::TAU * 65_536.0).round();
    let (depth, width) = ((range_cm / 256.0).floor(), (range_cm * azimuth / 2_097_152.0).floor());
    let key = depth as u32 * 65_536 + width.rem_euclid(65_536.0) as u32;
    (u64::from(key.wrapping_mul(2_654_435_769)) * 1024) >> 32
}

/// One frame's measurements after the gate.
#[derive(Debug, Default)]
pub struct Scan {
    pub placed: Vec<Placed>,
    pub refused: Vec<Rejection>,
    /// Where the measurements were, used or not.
    pub points: Points,
}

impl Scan {
    /// As many of a frame as the gate allows, in order of arrival: those of the greatest strength, less 32 dB for each that came
    /// from the same place before; of equals the first.
    pub fn new(
        measurements: &[Measurement],
        gate: &GateConfig,
        view: &FieldOfView,
        noise: &NoiseConfig,
        levelled: &Levelled,
    ) -> Self {
        let mut scan = Self::default();
        let (mut places, mut ranks) = (BTreeMap::new(), Vec::new());
        for m in measurements {
            if !is_detection(m) {
                scan.points.refused += 1;
                continue;
            }
            let reason = refusal(m, gate, view);
            match reason {
                Some(Rejection::Range | Rejection::Azimuth | Rejection::Elevation) => scan.points.outside += 1,
                _ => scan.points.inside += 1,
            }
            if let Some(reason) = reason {
                scan.refused.push(reason);
                continue;
            }
            scan.placed.push(place(m, noise, levelled));
            let before = places.entry(bin_of(m)).or_insert(0_u8);
            let strength = half_db(m.snr_db).or(half_db(m.rcs_dbsm)).unwrap_or(32.0);
            ranks.push((strength.clamp(-96.0, 159.0) - 64.0 * f64::from(*before)).max(-96.0));
            *before += u8::from(*before < u8::MAX);
        }
        let mut order: Vec<usize> = (0..scan.placed.len()).collect();
        order.sort_by(|&a, &b| ranks[b].total_cmp(&ranks[a]));
        let late = order.split_off(order.len().min(usize::from(gate.max_detections)));
        scan.refused.extend(late.iter().map(|_| Rejection::Overflow));
        order.sort_unstable();
        scan.placed = order.iter().map(|&i| scan.placed[i]).collect();
        scan
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Random, VIEW, mounts, within};
    use viewshed::frame::detection::Detection;

    #[test]
    fn the_same_detections_pass_for_the_same_reasons() {
        let config = GateConfig { min_speed_mps: 0.5, ..GateConfig::default() };
        let integer = config.gate(&VIEW.limits().unwrap()).unwrap();
        let mut random = Random::new(3);
        let (mut differ, mut reasons) = (0, BTreeMap::new());
        for _ in 0..40_000 {
            let m = random.any_measurement();
            let Ok(d) = Detection::new(&m) else {
                assert!(!is_detection(&m), "{m:?}");
                continue;
            };
            assert!(is_detection(&m), "{m:?}");
            let (got, exact) = (integer.judge(&d).err(), refusal(&m, &config, &VIEW));
            *reasons.entry(exact.map(Rejection::name)).or_insert(0) += 1;
            differ += u32::from(got != exact);
        }
        assert_eq!(reasons.len(), 7, "every reason but overflow occurs, and none: {reasons:?}");
        // measurements within half a step of a limit: 9 of 40 000
        within("judged differently", f64::from(differ), 12.0);
    }

    #[test]
    fn a_crowded_frame_keeps_the_same_detections_in_the_same_order() {
        let config = GateConfig { max_detections: 64, ..GateConfig::default() };
        let noise = NoiseConfig::default();
        let (gate, noises) = (config.gate(&VIEW.limits().unwrap()).unwrap(), noise.noise().unwrap());
        let mut random = Random::new(4);
        for mount in mounts() {
            let levelling = mount.levelling().unwrap();
            let measurements: Vec<Measurement> = (0..400).map(|_| random.measurement()).collect();
            let exact = Scan::new(&measurements, &config, &VIEW, &noise, &Levelled::new(&mount));
            let mut scan = viewshed::frame::scan::Scan::<256>::new();
            let detections: Vec<Detection> = measurements.iter().map(|m| Detection::new(m).unwrap()).collect();
            let points = scan
                .gather(Time::from_micros(0), detections.iter(), false.into(), &gate, |d| noises.place(d, &levelling));
            assert_eq!(
                (points.passed, points.again),
                (400, 0),
                "those that there is no room for were let through, too"
            );
            assert_eq!(Points { passed: 0, ..points }, exact.points);
            assert_eq!((scan.reflections().len(), exact.placed.len()), (64, 64));
            for (got, exact) in scan.reflections().iter().zip(&exact.placed) {
                assert!((f64::from(got.ground_cm) / 100.0 - exact.ground()).abs() < 0.07);
                assert_eq!(got.rcs_half_dbsm.map(|half| f64::from(half) / 2.0), exact.rcs);
            }
            for reason in Rejection::ALL {
                let exact = exact.refused.iter().filter(|r| **r == reason).count();
                assert_eq!(scan.rejections().count(reason) as usize, exact, "{}", reason.name());
            }
        }
    }
}
