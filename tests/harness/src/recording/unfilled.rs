//! Fields that a driver announces and never fills: the same value in every point of a recording.
//!
//! No measurement is the same everywhere. Such a field is taken for not measured, and said once: a gate that goes by it
//! would let everything through, or nothing.

use super::{RadarDetection, Recording};

/// Points before a value that drivers write for "nothing" is taken for that.
const LEAST_POINTS: usize = 10;

/// Points before any other value is: a lone reflector may have the same rounded value for long.
const LEAST_POINTS_OTHER: usize = 200;

/// Places that these have to lie at, by whole metres of range.
const LEAST_PLACES: usize = 3;

/// What drivers write where they have nothing: zero, the ends of a byte, ARS408's lowest RCS and its highest.
const NOTHING: [f32; 6] = [0.0, -128.0, 127.0, 255.0, -64.0, 63.5];

const TOPIC: &str = "points";

/// A field that may not be there: its name, what it says, and how to take it away.
type Field = (&'static str, fn(&RadarDetection) -> Option<f32>, fn(&mut RadarDetection), bool);

const FIELDS: [Field; 3] = [
    ("SNR (or amplitude)", |d| d.snr_db, |d| d.snr_db = None, true),
    ("RCS", |d| d.rcs_dbsm, |d| d.rcs_dbsm = None, true),
    // a plane in which all points lie is measured by nobody; another one may be a mount's
    ("elevation", |d| d.elevation_rad, |d| d.elevation_rad = None, false),
];

/// Takes fields that are never filled for not measured.
pub fn check(recording: &mut Recording) {
    let start_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    for (name, of, unset, any_value) in FIELDS {
        let Some((value, points)) = constant(recording, of, any_value) else { continue };
        recording.frames.iter_mut().flat_map(|frame| &mut frame.detections).for_each(unset);
        if name == "elevation" {
            recording.sensor.has_elevation = false;
        }
        let what = format!("{name} is {value} in every detection, so it is not filled, and taken for not measured");
        recording.problems.add_many(TOPIC, what, start_ns, points);
    }
}

/// The value that a field has in all points that have it, and how many these are.
fn constant(recording: &Recording, of: fn(&RadarDetection) -> Option<f32>, any_value: bool) -> Option<(f32, u64)> {
    let all = || recording.frames.iter().flat_map(|frame| &frame.detections);
    let value = all().find_map(of)?;
    let (mut points, mut places) = (0, std::collections::BTreeSet::new());
    for d in all() {
        match of(d) {
            Some(v) if v == value => points += 1,
            Some(_) => return None,
            None => continue,
        }
        if places.len() < LEAST_PLACES {
            places.insert(d.range_m as i64);
        }
    }
    let least = if NOTHING.contains(&value) && (any_value || value == 0.0) {
        LEAST_POINTS
    } else if any_value {
        LEAST_POINTS_OTHER
    } else {
        return None;
    };
    (points >= least && places.len() >= LEAST_PLACES).then_some((value, points as u64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::by_hand;

    /// 40 frames of five points whose values are these, by the number of the point.
    fn recording(of: impl Fn(usize) -> [f32; 3]) -> Recording {
        let mut recording = by_hand::recording(40, 0);
        let mut n = 0;
        for frame in &mut recording.frames {
            for k in 0..5_u8 {
                let [snr, rcs, elevation] = of(n);
                n += 1;
                frame.detections.push(RadarDetection {
                    range_m: 20.0 + 10.0 * f32::from(k),
                    azimuth_rad: 0.1 * f32::from(k),
                    elevation_rad: Some(elevation),
                    radial_velocity_mps: 0.0,
                    rcs_dbsm: Some(rcs),
                    snr_db: Some(snr),
                });
            }
        }
        check(&mut recording);
        recording
    }

    #[test]
    fn a_field_that_never_changes_is_not_measured() {
        let varies = |n: usize| n as f32 % 7.0;
        for nothing in [0.0, -128.0, 255.0, -64.0, 2.0] {
            let r = recording(|n| [nothing, varies(n), varies(n)]);
            assert!(r.frames.iter().flat_map(|f| &f.detections).all(|d| d.snr_db.is_none()), "{nothing}");
            assert_eq!(r.problems.count("SNR (or amplitude) is"), 200, "said once, with the points");
            assert!(r.frames[0].detections.iter().all(|d| d.rcs_dbsm.is_some() && d.elevation_rad.is_some()));
            let r = recording(|n| [varies(n), nothing, varies(n)]);
            assert!(r.frames.iter().flat_map(|f| &f.detections).all(|d| d.rcs_dbsm.is_none()), "{nothing}");
        }
        let flat = recording(|n| [varies(n), varies(n), 0.0]);
        assert!(!flat.sensor.has_elevation && flat.frames[3].detections[2].elevation_rad.is_none());
    }

    #[test]
    fn what_changes_once_is_measured() {
        let r = recording(|n| [f32::from(u8::from(n == 77)), f32::from(u8::from(n == 78)), -0.05]);
        assert!(r.problems.is_empty(), "{:?}", r.problems);
        assert!(r.frames[0].detections.iter().all(|d| d.snr_db.is_some() && d.elevation_rad.is_some()));
    }
}
