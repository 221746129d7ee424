//! Fields that a driver announces and never fills: the same value in every point of a recording.
//!
//! No measurement is the same everywhere. Such a field is taken for not measured, and said once: a gate that goes by it
//! would let everything through, or nothing.

use std::collections::BTreeSet;

use super::{Frame, RadarDetection, Recording};

/// Points before a value that drivers write for "nothing" is taken for that.
const LEAST_POINTS: u64 = 10;

/// Points before any other value is: a lone reflector may have the same rounded value for long.
const LEAST_POINTS_OTHER: u64 = 200;

/// Places that these have to lie at, by whole metres of range.
const LEAST_PLACES: usize = 3;

/// What drivers write where they have nothing: zero, the ends of a byte, ARS408's lowest RCS and its highest.
const NOTHING: [f32; 6] = [0.0, -128.0, 127.0, 255.0, -64.0, 63.5];

const TOPIC: &str = "points";

/// A field that may not be there.
pub struct Field {
    name: &'static str,
    of: fn(&RadarDetection) -> Option<f32>,
    /// Takes it away.
    pub unset: fn(&mut RadarDetection),
    /// Any value that never changes is none, and not only what drivers write for "nothing".
    any_value: bool,
}

/// All of them.
pub const FIELDS: [Field; 3] = [
    Field { name: "SNR (or amplitude)", of: |d| d.snr_db, unset: |d| d.snr_db = None, any_value: true },
    Field { name: "RCS", of: |d| d.rcs_dbsm, unset: |d| d.rcs_dbsm = None, any_value: true },
    // a plane in which all points lie is measured by nobody; another one may be a mount's
    Field { name: ELEVATION, of: |d| d.elevation_rad, unset: |d| d.elevation_rad = None, any_value: false },
];

const ELEVATION: &str = "elevation";

/// What the points of a recording have in these fields.
#[derive(Debug, Clone, Default)]
pub struct Unfilled([Values; FIELDS.len()]);

/// The values of one field.
#[derive(Debug, Clone, Default)]
struct Values {
    first: Option<f32>,
    varies: bool,
    points: u64,
    places: BTreeSet<i64>,
}

impl Unfilled {
    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        for (values, field) in self.0.iter_mut().zip(&FIELDS).filter(|(values, _)| !values.varies) {
            frame.detections.iter().for_each(|d| values.take(d, field));
        }
    }

    /// Adds the fields that are never filled to a recording's problems, and says which these are.
    pub fn tell(&self, recording: &mut Recording, start_ns: i64) -> [bool; FIELDS.len()] {
        let mut found = [false; FIELDS.len()];
        for ((values, field), unfilled) in self.0.iter().zip(&FIELDS).zip(&mut found) {
            let Some(value) = values.constant(field) else { continue };
            *unfilled = true;
            if field.name == ELEVATION {
                recording.sensor.has_elevation = false;
            }
            let name = field.name;
            let what = format!("{name} is {value} in every detection, so it is not filled, and taken for not measured");
            recording.problems.add_many(TOPIC, what, start_ns, values.points);
        }
        found
    }
}

impl Values {
    fn take(&mut self, d: &RadarDetection, field: &Field) {
        let Some(value) = (field.of)(d).filter(|_| !self.varies) else { return };
        if *self.first.get_or_insert(value) != value {
            self.varies = true;
            return;
        }
        self.points += 1;
        if self.places.len() < LEAST_PLACES {
            self.places.insert(d.range_m as i64);
        }
    }

    /// The value that all points have that have the field.
    fn constant(&self, field: &Field) -> Option<f32> {
        let value = self.first.filter(|_| !self.varies)?;
        let least = if NOTHING.contains(&value) && (field.any_value || value == 0.0) {
            LEAST_POINTS
        } else if field.any_value {
            LEAST_POINTS_OTHER
        } else {
            return None;
        };
        (self.points >= least && self.places.len() >= LEAST_PLACES).then_some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::recording::frames::{Correction, Frames};

    /// 40 frames of five points whose values are these, by the number of the point.
    fn recording(of: impl Fn(usize) -> [f32; 3]) -> Recording {
        let mut recording = made_up::recording(40, 0);
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
        let survey = recording.frames.survey();
        let unfilled = survey.unfilled.tell(&mut recording, 0);
        recording.frames.correct(Correction { unfilled, ..Correction::default() });
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
