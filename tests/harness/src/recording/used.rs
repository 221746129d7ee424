//! Points that no estimator can use, so many that the input or the field of view and not the road is the reason.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use viewshed::frame::gate::{Gate, GateConfig, Rejection};

use super::frames::Frames;
use super::problems::POINTS;
use super::usable::{self, ABSURD, DROPPED, NO_RANGE, NOT_FINITE};
use super::{FieldOfView, Frame, RadarDetection, Recording};

/// Share of all points from which on it is said. A view that is a little narrower than the radar's is common.
const MANY: f64 = 0.2;

/// Share from which on hardly the field of view is the reason.
const MOST: f64 = 0.9;

/// The middle share of points whose span is told: single ones lie anywhere.
const MIDDLE: f64 = 0.98;

/// Nowhere, or outside the field of view: what weak and fast ones are is the estimators' choice.
fn is_outside(reason: Option<&str>) -> bool {
    let mut outside = Rejection::ALL.into_iter().filter(|reason| reason.is_outside());
    reason.is_some_and(|why| {
        [DROPPED, NOT_FINITE, NO_RANGE, ABSURD].contains(&why) || outside.any(|outside| outside.name() == why)
    })
}

/// Which points of a recording an estimator can use, and why not.
pub struct Used {
    /// None where there can be none, which estimators say.
    gate: Option<Gate>,
    all: u64,
    refused: u64,
    reasons: BTreeMap<&'static str, u64>,
}

impl Used {
    /// By a recording's field of view.
    pub fn of(recording: &Recording) -> Self {
        let gate = usable::gate(recording, &GateConfig::default());
        Self { gate, all: 0, refused: 0, reasons: BTreeMap::new() }
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        let Some(gate) = &self.gate else { return };
        self.all += frame.detections.len() as u64 + frame.refused;
        self.refused += frame.refused;
        let reasons = frame.detections.iter().map(|d| usable::rejected(gate, d)).filter(|why| is_outside(*why));
        for reason in reasons.flatten() {
            *self.reasons.entry(reason).or_default() += 1;
        }
    }

    /// A frame with the points that an estimator can use, to ask what they agree on.
    pub fn points(&self, frame: &Frame) -> Frame {
        let Some(gate) = &self.gate else { return frame.clone() };
        let used = frame.detections.iter().filter(|d| !is_outside(usable::rejected(gate, d)));
        Frame { detections: used.copied().collect(), unwanted: frame.unwanted.clone(), ..*frame }
    }

    /// Adds it to the recording's problems where many of its points are nowhere, or outside the field of view.
    pub fn tell(&self, recording: &mut Recording, frames: &dyn Frames, start_ns: i64) {
        if self.gate.is_some()
            && let Some((what, rejected)) = self.said(&recording.sensor.field_of_view, frames)
        {
            recording.problems.add_many(POINTS, what, start_ns, rejected);
        }
    }

    fn said(&self, view: &FieldOfView, frames: &dyn Frames) -> Option<(String, u64)> {
        let (all, mut reasons) = (self.all, self.reasons.clone());
        *reasons.entry(DROPPED).or_default() += self.refused;
        let rejected: u64 = reasons.values().sum();
        let (most, _) = reasons.into_iter().max_by_key(|(_, n)| *n)?;
        let share = rejected as f64 / all.max(1) as f64;
        if share < MANY {
            return None;
        }
        let mut what = format!("{rejected} of {all} points rejected (most: {most}): ");
        let degrees = |of: fn(&RadarDetection) -> Option<f32>| middle(frames, of).map(|ends| ends.map(f64::to_degrees));
        let (name, [low, high], ends) = match most {
            _ if share >= MOST => return Some((what + usable::hint(most), rejected)),
            _ if most == Rejection::Azimuth.name() => {
                ("azimuth in degrees", degrees(|d| Some(d.azimuth_rad))?, view.azimuth_rad.map(f64::to_degrees))
            }
            _ if most == Rejection::Elevation.name() => {
                ("elevation in degrees", degrees(|d| d.elevation_rad)?, view.elevation_rad.map(f64::to_degrees))
            }
            _ if most == Rejection::Range.name() => {
                ("range in metres", middle(frames, |d| Some(d.range_m))?, view.range_m)
            }
            _ => return Some((what + usable::hint(most), rejected)),
        };
        let [from, to] = ends;
        what += &format!(
            "the {name} of nearly all lies in {low:.0} to {high:.0}, and the field of view is {from:.0} to {to:.0}; if that is not meant, --fov sets it"
        );
        Some((what, rejected))
    }
}

/// Ends of the middle share of values. How often each comes is counted, as radars on a bus send whole numbers: of days of
/// points the values are few.
fn middle(frames: &dyn Frames, of: fn(&RadarDetection) -> Option<f32>) -> Option<[f64; 2]> {
    let (mut counted, mut all) = (BTreeMap::<Value, usize>::new(), 0_usize);
    frames.each(&mut |frame| {
        for value in frame.detections.iter().filter_map(of).filter(|value| value.is_finite()) {
            *counted.entry(Value(value)).or_default() += 1;
            all += 1;
        }
    });
    let off = ((1.0 - MIDDLE) / 2.0 * all as f64) as usize;
    let at = |place: usize| {
        let mut passed = 0;
        let here = |(_, n): &(&Value, &usize)| {
            passed += *n;
            passed > place
        };
        counted.iter().find(here).map(|(value, _)| f64::from(value.0))
    };
    Some([at(off)?, at((all - 1).checked_sub(off)?)?])
}

/// A value in the order of numbers.
#[derive(Debug, Clone, Copy)]
struct Value(f32);

impl Ord for Value {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Value {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Value {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::recording;

    /// What is said of points at these azimuths, in a view of -57 to 57 degrees.
    fn said_of(azimuths_deg: impl Iterator<Item = f32> + Clone) -> String {
        let mut recording = recording(50, 0);
        for frame in &mut recording.frames {
            frame.detections.extend(azimuths_deg.clone().map(|azimuth| RadarDetection {
                range_m: 50.0,
                azimuth_rad: azimuth.to_radians(),
                elevation_rad: None,
                radial_velocity_mps: 10.0,
                rcs_dbsm: None,
                snr_db: None,
            }));
        }
        let mut used = Used::of(&recording);
        recording.frames.iter().for_each(|frame| used.frame(frame));
        let frames = recording.frames.clone();
        used.tell(&mut recording, &frames, 0);
        recording.problems.iter().map(|p| p.what).collect()
    }

    #[test]
    fn many_points_outside_the_field_of_view_are_told_with_where_they_lie() {
        assert_eq!(said_of((-60..60).map(|k| k as f32)), "");
        let told = said_of((-100..60).map(|k| k as f32));
        assert!(
            told.contains("of 8000 points rejected (most: azimuth): the azimuth in degrees of nearly all lies in -99 to 58, and the field of view is -57 to 57; if that is not meant, --fov"),
            "{told}"
        );
        let told = said_of((100..160).map(|k| k as f32));
        assert!(
            told.ends_with(
                "3000 of 3000 points rejected (most: azimuth): angles in degrees, or a wrong field of view?"
            ),
            "{told}"
        );
    }
}
