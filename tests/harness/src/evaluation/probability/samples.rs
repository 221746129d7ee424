//! What a probability is of: one object at one frame, with its grade, range and azimuth.

use std::f64::consts::TAU;

use anyhow::Result;
use viewshed::Settings;
use viewshed::fixed::angle::Angle;

use crate::estimators;
use crate::evaluation::calibration::ByTrack;
use crate::evaluation::curve::Grades;
use crate::evaluation::samples::FrameSamples;
use crate::evaluation::score::Score;
use crate::evaluation::units::Units;
use crate::geometry::pose::SensorPose;
use crate::recording::Recording;

/// One object at one frame, as the table takes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Of the best cell under it; `None` where all are unknown.
    pub grade: Option<u8>,
    /// From the sensor along the ground to the middle of its box.
    pub range_cm: i32,
    /// From the boresight's heading.
    pub azimuth: Angle,
    pub detected: bool,
    /// What is drawn again together: its track, or its frame where frames are independent.
    pub unit: usize,
}

/// The samples of one or several recordings; units of different recordings are kept apart.
#[derive(Debug, Clone, Default)]
pub struct Places {
    pub all: Vec<Place>,
    pub units: usize,
    /// What units are: `tracks` or `frames`.
    pub kind: &'static str,
}

impl Places {
    /// Those of one score.
    pub fn of(recording: &Recording, samples: &[FrameSamples], score: &Score) -> Self {
        let units = Units::new(recording, samples);
        let mut all = Vec::new();
        for ((frame, verdicts), units) in samples.iter().zip(&score.verdicts).zip(&units.objects) {
            for ((sample, verdict), &unit) in frame.objects.iter().zip(verdicts).zip(units) {
                let [x, y, _] = sample.solid.center;
                let (range_cm, azimuth) = place(&recording.pose, [x, y]);
                all.push(Place { grade: verdict.grade, range_cm, azimuth, detected: sample.detected, unit });
            }
        }
        Self { all, units: units.object_units, kind: units.kind }
    }

    /// Adds those of another recording.
    pub fn join(&mut self, other: Self) {
        let known = self.units;
        self.all.extend(other.all.into_iter().map(|p| Place { unit: p.unit + known, ..p }));
        self.units += other.units;
        self.kind = other.kind;
    }

    /// What a predictor says of every unit; `None` is unknown.
    pub fn said(&self, p: impl Fn(&Place) -> Option<u8>) -> ByTrack {
        let mut units = vec![Grades::default(); self.units];
        for place in &self.all {
            units[place.unit].add(place.detected, p(place));
        }
        ByTrack::new(&units)
    }
}

/// Ground range and azimuth of a place on the road, as the map of a sensor with this pose counts them.
fn place(pose: &SensorPose, [x, y]: [f64; 2]) -> (i32, Angle) {
    let (dx, dy) = (x - pose.position[0], y - pose.position[1]);
    let turns = (dy.atan2(dx) - pose.yaw_rad()) / TAU;
    ((dx.hypot(dy) * 100.0).round() as i32, Angle::from_degrees(((turns - turns.round()) * 360.0) as f32))
}

/// Fingerprint of what a table depends on, that of the recording's unit. Parameters of obstacles and evidence are
/// among them where they are not the usual ones; they are kept for good then.
///
/// # Errors
/// Those of [`estimators::unit`].
pub fn fingerprint(recording: &Recording, options: &estimators::Options) -> Result<u32> {
    let (sensor, config) = estimators::unit(recording, options)?;
    let mut settings = Settings::of(sensor);
    settings.gate = config.gate;
    settings.visibility = config.visibility;
    settings.health = config.health;
    settings.lanes = config.lanes;
    settings.ground = config.ground;
    let usual = viewshed::Radar3dConfig::default();
    if config.obstacles != usual.obstacles {
        settings.obstacles = Some(Box::leak(Box::new(config.obstacles)));
    }
    if config.evidence != usual.evidence {
        settings.evidence = Some(Box::leak(Box::new(config.evidence)));
    }
    Ok(settings.fingerprint())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::{FarRoad, Lane, Profile};
    use crate::evaluation::samples::made_up::{frames, recording, sample};
    use crate::evaluation::score::made_up::score;

    #[test]
    fn a_place_lies_where_the_map_has_it() {
        let pose = SensorPose::new([10.0, 20.0, 6.0], std::f64::consts::FRAC_PI_2, 0.05, 0.0);
        // looks along the road's y axis
        assert_eq!(place(&pose, [10.0, 50.0]), (3000, Angle::ZERO));
        let (range_cm, azimuth) = place(&pose, [-20.0, 50.0]);
        assert_eq!(range_cm, 4243);
        assert!((azimuth.radians().to_degrees() - 45.0).abs() < 0.01, "to its left: {azimuth:?}");
    }

    #[test]
    fn units_of_two_recordings_stay_apart() {
        let (recording, samples) = (recording(3, 2), frames((0..3).map(|k| vec![sample(0, 50.0, k > 0, true)])));
        let of = |grade: u8| Places::of(&recording, &samples, &score("radar-3d", &samples, |_| Some(grade)));
        let mut both = of(10);
        both.join(of(200));
        assert_eq!((both.units, both.all.len()), (2, 6));
        let said = both.said(|p| p.grade);
        assert_eq!(said.drawn(&[0, 1]).positive[200], 2);
        assert_eq!(said.drawn(&[1, 0]).negative[10], 1);
    }

    #[test]
    fn another_mount_or_another_setting_is_another_configuration() {
        let (recording, options) = (recording(1, 1), estimators::Options::default());
        let fingerprint =
            |recording: &Recording, options: &estimators::Options| fingerprint(recording, options).unwrap();
        let usual = fingerprint(&recording, &options);
        let mut moved = recording.clone();
        moved.pose = SensorPose::new([0.0, 0.0, 6.5], 0.0, 0.0, 0.0);
        let mut set = options.clone();
        set.radar_3d.gate.min_snr_db += 1.0;
        let mut tuned = options.clone();
        tuned.radar_3d.evidence.visible_memory_s += 1.0;
        let (mut lanes, mut far_road, mut ground) = (options.clone(), options.clone(), options.clone());
        lanes.lanes = vec![Lane { points: vec![[0.0, 2.0], [50.0, 2.0]] }];
        far_road.far_road = Some(FarRoad::Degrees(5));
        ground.ground = Profile { points: vec![[0.0, 0.0], [50.0, 1.0]] };
        let told = [set, tuned, lanes, far_road, ground].map(|options| fingerprint(&recording, &options));
        let all = [&[usual, fingerprint(&moved, &options)], &told[..]].concat();
        assert!((0..all.len()).all(|i| (0..i).all(|k| all[i] != all[k])), "{all:x?}");
        assert_eq!(usual, fingerprint(&recording, &options.clone()));
    }
}
