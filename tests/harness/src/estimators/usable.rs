//! How much of a recording estimators can use: a map that rests on nothing is no map.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use anyhow::{Result, bail};

use super::Options;
use crate::recording::Recording;
use crate::recording::frames::Extent;
use crate::recording::usable::{DROPPED, gate, hint, rejected};

/// From this share of usable points on a map rests on something: a broken field lets a few pass by chance.
const LEAST_OF: u64 = 1000;

/// Refuses a radar's recording of whose points none, or hardly one, can be used. One without any point is an empty road,
/// or a radar that is blind: its maps are unknown, and say so.
///
/// # Errors
/// How many points are rejected, why most of them are, and what that may come from.
pub fn check(recording: &Recording, options: &Options) -> Result<()> {
    let Some(gate) = gate(recording, &options.radar_3d.gate) else { return Ok(()) };
    let Extent { detections, refused, .. } = recording.extent();
    let all = detections + refused;
    // of most recordings the first frames decide
    let enough = all.div_ceil(LEAST_OF);
    let (mut used, mut reasons) = (0, BTreeMap::<&str, u64>::new());
    recording.all().parts(&mut |part| {
        for detection in part.iter().flat_map(|frame| &frame.detections) {
            match rejected(&gate, detection) {
                None => used += 1,
                Some(reason) => *reasons.entry(reason).or_default() += 1,
            }
            if used >= enough {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    if used >= enough {
        return Ok(());
    }
    *reasons.entry(DROPPED).or_default() += refused;
    let sum: u64 = reasons.values().sum();
    let most = reasons.into_iter().max_by_key(|(_, n)| *n).map_or(DROPPED, |(reason, _)| reason);
    bail!(
        "{}: {sum} of {all} points rejected (most: {most}): {} A map of the rest would rest on nothing",
        recording.name,
        hint(most)
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::recording;
    use crate::recording::RadarDetection;

    const D: RadarDetection = RadarDetection {
        range_m: 50.0,
        azimuth_rad: 0.1,
        elevation_rad: Some(0.0),
        radial_velocity_mps: 10.0,
        rcs_dbsm: None,
        snr_db: Some(20.0),
    };

    fn said(points: &[RadarDetection], refused: u64) -> String {
        let mut recording = recording(100, 0);
        for frame in &mut recording.frames {
            frame.detections.extend_from_slice(points);
            frame.refused = refused;
        }
        super::super::all(&recording, &Options::default()).err().map(|error| error.to_string()).unwrap_or_default()
    }

    #[test]
    fn a_map_that_would_rest_on_nothing_is_refused_with_the_cause() {
        assert_eq!(said(&[], 0), "", "an empty road");
        assert_eq!(said(&[D], 9), "");
        for (wrong, why) in [
            (RadarDetection { azimuth_rad: 10.0, ..D }, "(most: absurd): angles in degrees?"),
            (RadarDetection { azimuth_rad: 2.0, ..D }, "(most: azimuth): angles in degrees, or a wrong"),
            (RadarDetection { range_m: f32::NAN, ..D }, "(most: not finite): does the sensor send NaN?"),
            (RadarDetection { range_m: 600.0, ..D }, "(most: range): ranges in another unit"),
            (RadarDetection { snr_db: Some(0.0), ..D }, "(most: quality): is the field of the SNR never filled"),
            (RadarDetection { rcs_dbsm: Some(-90.0), ..D }, "(most: rcs): is the field of the RCS never filled"),
            (RadarDetection { radial_velocity_mps: 90.0, ..D }, "(most: velocity): velocities in another unit"),
        ] {
            let said = said(&[wrong, wrong], 0);
            assert!(said.contains("by-hand: 200 of 200 points rejected") && said.contains(why), "{said}");
        }
        let said = said(&[], 3);
        assert!(said.contains("300 of 300 points rejected (most: dropped when read): does the sensor"), "{said}");
    }

    #[test]
    fn a_few_that_pass_by_chance_are_no_map() {
        let mut recording = recording(100, 0);
        let wrong = RadarDetection { azimuth_rad: 40.0, ..D };
        recording.frames.iter_mut().for_each(|frame| frame.detections.extend([wrong; 30]));
        recording.frames[7].detections.push(D);
        let error = check(&recording, &Options::default()).unwrap_err().to_string();
        assert!(error.contains("3000 of 3001 points rejected"), "{error}");
        recording.frames.iter_mut().for_each(|frame| frame.detections.push(D));
        assert!(check(&recording, &Options::default()).is_ok());
    }
}
