//! Points that no estimator can use, so many that the input or the field of view and not the road is the reason.

use std::collections::BTreeMap;

use viewshed::frame::gate::{Gate, GateConfig, Rejection};

use super::problems::POINTS;
use super::usable::{self, ABSURD, DROPPED, NO_RANGE, NOT_FINITE};
use super::{Frame, RadarDetection, Recording};

/// Share of all points from which on it is said. A view that is a little narrower than the radar's is common.
const MANY: f64 = 0.2;

/// Share from which on hardly the field of view is the reason.
const MOST: f64 = 0.9;

/// The middle share of points whose span is told: single ones lie anywhere.
const MIDDLE: f64 = 0.98;

/// Frames with the points that an estimator can use, to ask what they agree on.
pub fn frames(recording: &Recording) -> Vec<Frame> {
    let Some(gate) = usable::gate(recording, &GateConfig::default()) else { return recording.frames.clone() };
    let used = |frame: &Frame| {
        let all = frame.detections.iter().filter(|d| !is_outside(usable::rejected(&gate, d)));
        Frame { detections: all.copied().collect(), unwanted: frame.unwanted.clone(), ..*frame }
    };
    recording.frames.iter().map(used).collect()
}

/// Nowhere, or outside the field of view: what weak and fast ones are is the estimators' choice.
fn is_outside(reason: Option<&str>) -> bool {
    let mut outside = Rejection::ALL.into_iter().filter(|reason| reason.is_outside());
    reason.is_some_and(|why| {
        [DROPPED, NOT_FINITE, NO_RANGE, ABSURD].contains(&why) || outside.any(|outside| outside.name() == why)
    })
}

/// Adds it to the recording's problems where many points are nowhere, or outside the field of view.
pub fn check(recording: &mut Recording) {
    let Some(gate) = usable::gate(recording, &GateConfig::default()) else { return };
    if let Some((what, rejected)) = said(recording, &gate) {
        let start = recording.frames.first().map_or(0, |f| f.time_ns);
        recording.problems.add_many(POINTS, what, start, rejected);
    }
}

fn said(recording: &Recording, gate: &Gate) -> Option<(String, u64)> {
    let all: u64 = recording.frames.iter().map(|f| f.detections.len() as u64 + f.refused).sum();
    let detections = || recording.frames.iter().flat_map(|f| &f.detections);
    let mut reasons: BTreeMap<&str, u64> = BTreeMap::new();
    for reason in detections().map(|d| usable::rejected(gate, d)).filter(|reason| is_outside(*reason)) {
        *reasons.entry(reason?).or_default() += 1;
    }
    *reasons.entry(DROPPED).or_default() += recording.frames.iter().map(|f| f.refused).sum::<u64>();
    let rejected: u64 = reasons.values().sum();
    let (most, _) = reasons.into_iter().max_by_key(|(_, n)| *n)?;
    let share = rejected as f64 / all.max(1) as f64;
    if share < MANY {
        return None;
    }
    let mut what = format!("{rejected} of {all} points rejected (most: {most}): ");
    let view = &recording.sensor.field_of_view;
    let degrees = |of: fn(&RadarDetection) -> Option<f32>| {
        middle(detections().filter_map(of).map(|v| f64::from(v).to_degrees()).collect())
    };
    let (name, [low, high], ends) = match most {
        _ if share >= MOST => return Some((what + usable::hint(most), rejected)),
        _ if most == Rejection::Azimuth.name() => {
            ("azimuth in degrees", degrees(|d| Some(d.azimuth_rad))?, view.azimuth_rad.map(f64::to_degrees))
        }
        _ if most == Rejection::Elevation.name() => {
            ("elevation in degrees", degrees(|d| d.elevation_rad)?, view.elevation_rad.map(f64::to_degrees))
        }
        _ if most == Rejection::Range.name() => {
            ("range in metres", middle(detections().map(|d| f64::from(d.range_m)).collect())?, view.range_m)
        }
        _ => return Some((what + usable::hint(most), rejected)),
    };
    let [from, to] = ends;
    what += &format!(
        "the {name} of nearly all lies in {low:.0} to {high:.0}, and the field of view is {from:.0} to {to:.0}; if that is not meant, --fov sets it"
    );
    Some((what, rejected))
}

/// Ends of the middle share of values.
fn middle(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let off = ((1.0 - MIDDLE) / 2.0 * values.len() as f64) as usize;
    Some([*values.get(off)?, *values.get(values.len() - 1 - off)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::by_hand::recording;

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
        check(&mut recording);
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
