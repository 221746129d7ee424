//! Detections of two frames that seem to be of one thing: what pairs of them say of velocities and of directions.
//!
//! Frames are taken one after the other, and of those that begin no pair nothing is kept. A frame is given in a form that
//! is only made where it is looked at.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Deref;

use super::Frame;
use super::frames::step;
use crate::geometry::pose::SensorPose;

/// Frames that begin pairs, spread over the recording.
pub const MOST_FRAMES: usize = 300;

/// What is slower tells no direction, m/s.
pub const LEAST_SPEED_MPS: f32 = 5.0;

/// Median height of a vehicle's reflections above the road, metres.
pub const USUAL_HEIGHT_M: f64 = 0.9;

/// Time between the detections of a pair that has a direction, seconds.
const PAUSE_S: f64 = 1.0;

/// Pairs of neighbouring frames that agree with the velocities as they stand, and with their opposites.
pub struct Signs {
    step: usize,
    taken: usize,
    before: Option<Frame>,
    as_it_stands: usize,
    reversed: usize,
}

impl Signs {
    /// Of so many frames.
    pub fn new(frames: usize) -> Self {
        let step = step(frames.saturating_sub(1), MOST_FRAMES);
        Self { step, taken: 0, before: None, as_it_stands: 0, reversed: 0 }
    }

    /// Of all these.
    pub fn of(frames: &[Frame]) -> Self {
        let mut signs = Self::new(frames.len());
        frames.iter().for_each(|frame| signs.frame(&frame));
        signs
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &impl Deref<Target = Frame>) {
        if let Some(before) = self.before.take() {
            self.pair(&before, frame);
        }
        if self.taken.is_multiple_of(self.step) {
            self.before = Some((**frame).clone());
        }
        self.taken += 1;
    }

    /// Those that agree with the velocities as they stand, and with their opposites.
    pub fn counted(&self) -> (usize, usize) {
        (self.as_it_stands, self.reversed)
    }

    fn pair(&mut self, before: &Frame, after: &Frame) {
        let passed = seconds(before.time_ns, after.time_ns);
        if !(0.01..=0.5).contains(&passed) {
            return;
        }
        for d in before.detections.iter().filter(|d| f64::from(d.radial_velocity_mps.abs()) * passed >= 0.5) {
            let found = |sign: f64| {
                let range = f64::from(d.range_m) + sign * f64::from(d.radial_velocity_mps) * passed;
                after.detections.iter().any(|a| {
                    (f64::from(a.range_m) - range).abs() < 0.25
                        && (a.azimuth_rad - d.azimuth_rad).abs() < 0.015
                        && (a.radial_velocity_mps - d.radial_velocity_mps).abs() < 0.5
                })
            };
            match (found(1.0), found(-1.0)) {
                (true, false) => self.as_it_stands += 1,
                (false, true) => self.reversed += 1,
                _ => {}
            }
        }
    }
}

/// Directions in the road frame from one detection of a pair to the other, degrees, -90 to 90.
pub struct Directions {
    pose: SensorPose,
    step: usize,
    taken: usize,
    /// Frames that wait for the one of a second later, with their numbers.
    open: VecDeque<(usize, Frame)>,
    found: BTreeMap<usize, Vec<f64>>,
}

impl Directions {
    /// Of so many frames of a sensor that hangs there.
    pub fn new(frames: usize, pose: &SensorPose) -> Self {
        let (open, found) = (VecDeque::new(), BTreeMap::new());
        Self { pose: *pose, step: step(frames, MOST_FRAMES), taken: 0, open, found }
    }

    /// Takes the next frame, of this time.
    pub fn frame(&mut self, time_ns: i64, frame: &impl Deref<Target = Frame>) {
        let (pose, found) = (&self.pose, &mut self.found);
        self.open.retain(|(number, before)| {
            let passed = seconds(before.time_ns, time_ns);
            if passed >= PAUSE_S {
                let near = passed <= 1.3 * PAUSE_S;
                found.insert(*number, if near { directions(before, frame, passed, pose) } else { Vec::new() });
            }
            passed < PAUSE_S
        });
        if self.taken.is_multiple_of(self.step) {
            self.open.push_back((self.taken, (**frame).clone()));
        }
        self.taken += 1;
    }

    /// All of them. After a frame that none follows by a second the clock ran back: what comes then is left out.
    pub fn end(self) -> Vec<f64> {
        let end = self.open.front().map(|(number, _)| *number);
        self.found
            .into_iter()
            .take_while(|(number, _)| end.is_none_or(|end| *number < end))
            .flat_map(|(_, d)| d)
            .collect()
    }
}

fn directions(before: &Frame, after: &Frame, passed: f64, pose: &SensorPose) -> Vec<f64> {
    let mut directions = Vec::new();
    for d in before.detections.iter().filter(|d| d.radial_velocity_mps.abs() >= LEAST_SPEED_MPS) {
        let from = d.road_position(pose, USUAL_HEIGHT_M);
        for a in &after.detections {
            let range = f64::from(d.range_m) + passed * f64::from(d.radial_velocity_mps + a.radial_velocity_mps) / 2.0;
            if (a.radial_velocity_mps - d.radial_velocity_mps).abs() > 1.0 || (f64::from(a.range_m) - range).abs() > 1.0
            {
                continue;
            }
            let to = a.road_position(pose, USUAL_HEIGHT_M);
            let (x, y) = (to[0] - from[0], to[1] - from[1]);
            // across the line of sight everything fits
            if y.hypot(x) < 2.0 * passed * f64::from(d.radial_velocity_mps.abs()) {
                directions.push(axis_deg([x, y]));
            }
        }
    }
    directions
}

/// The direction of a step along a road, whichever way: degrees, -90 to 90.
pub fn axis_deg([x, y]: [f64; 2]) -> f64 {
    folded(y.atan2(x).to_degrees())
}

/// The same axis within -90 to 90 degrees.
pub fn folded(degrees: f64) -> f64 {
    (degrees + 90.0).rem_euclid(180.0) - 90.0
}

fn seconds(before_ns: i64, after_ns: i64) -> f64 {
    after_ns.saturating_sub(before_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::recording::RadarDetection;

    #[test]
    fn directions_end_where_no_frame_is_a_second_later() {
        let mut frames = made_up::recording(40, 0).frames;
        for (k, frame) in (0_u8..).zip(&mut frames) {
            frame.detections.push(RadarDetection {
                range_m: 40.0 + f32::from(k),
                azimuth_rad: 0.0,
                elevation_rad: None,
                radial_velocity_mps: 10.0,
                rcs_dbsm: None,
                snr_db: None,
            });
        }
        let counted = |frames: &[Frame]| {
            let mut directions = Directions::new(frames.len(), &made_up::recording(0, 0).pose);
            frames.iter().for_each(|frame| directions.frame(frame.time_ns, &frame));
            directions.end().len()
        };
        assert_eq!(counted(&frames), 30, "ten frames wait for the end");
        // for an hour's step back nobody is a second later than those just before it
        frames[20..].iter_mut().for_each(|frame| frame.time_ns -= 3_600_000_000_000);
        assert_eq!(counted(&frames), 10);
        assert_eq!(Signs::of(&frames).counted(), (38, 0), "of neighbours it takes but one pair");
    }
}
