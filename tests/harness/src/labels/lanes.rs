//! Lanes of a site for a unit's configuration, learnt from recordings of its traffic.
//!
//! An integrator rarely has a net of the crossing. A minute or two of the radar's own detections shows where vehicles
//! drive: those that are followed both ways through time for [`proposals`], side by side in one direction, are a lane.
//!
//! # What was tried
//! On four of the training crossings of `tests/recordings/tuning.toml`, each with lanes learnt from 90 s of other traffic
//! there; cells FVR / FIR in percent of `radar-3d`, vehicles from `geometry-slice`. Synthetic data.
//!
//! | lanes | cells | vehicles |
//! |---|---|---|
//! | none | 15.7 / 13.9 | +3.6 / +10.9 |
//! | of the net | 14.7 / 10.5 | +5.3 / +7.7 |
//! | of what moves, followed once | 14.9 / 11.2 | +3.2 / +8.9 |
//! | and smoothed over 12 m | 15.3 / 11.2 | +1.3 / +8.6 |
//! | and followed again with these lanes | 15.5 / 11.4 | +1.1 / +7.9 |
//! | and without mirror images and what is unlikely: kept, since guard rails make few lanes then | 15.2 / 11.5 | +0.9 / +8.2 |
//! | from three recordings of 90 s, not one | 15.8 / 11.2 | +1.2 / +7.9 |
//! | moved to where flanks say the middle is, before smoothing | 15.1 / 11.6 | +3.5 / +9.2 |
//! | ended where nobody drove | 14.6 / 12.4 | +0.4 / +9.6 |
//! | driven on by three, not two | 16.6 / 11.5 | +4.5 / +7.8 |
//!
//! On the six crossings that are reported 17.2 / 11.4 become 16.8 / 10.7, and 15.0 / 10.3 with the net; on the crossing of
//! another generator, from its 50th second on and with lanes learnt before the 45th, 20.9 / 10.5 became 21.8 / 12.1 where
//! a unit is started then, and 10.6 / 13.3 became 9.9 / 15.1 where it has run since the start.
//!
//! # Limits
//! Lanes that were not driven on by two vehicles at least are missing, and so are those the radar does not see. Their
//! ends lie up to 60 m beyond what was driven, along a straight line. Labels that were made of proposals from the same
//! recording know the same lanes: what is judged on such labels is to have its lanes from another recording.

use viewshed::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};

use super::proposals;
use crate::estimators::Lane;
use crate::geometry::polyline::{smoothed, straightened, uncrossed, within};
use crate::recording::Recording;

/// Distance of a lane's places, metres, and over how much to either side they are smoothed.
const STEP_M: f64 = 2.0;
const SMOOTH_M: f64 = 12.0;
/// How far a bend may be from its chord, metres, at first; so many times as much where that needs too many segments.
const STRAIGHT_M: f64 = 0.2;
const WIDER: f64 = 1.25;

/// Lanes of one site, at most as many as a unit has room for; those that most drove on first. Empty where nothing
/// drives. `progress` is told the share that is done.
pub fn learnt(recordings: &[Recording], progress: &(dyn Fn(f64) + Sync)) -> Vec<Lane> {
    counted(recordings, progress).into_iter().map(|(lane, _)| lane).collect()
}

/// The same, each with how many vehicles were followed there.
pub fn counted(recordings: &[Recording], progress: &(dyn Fn(f64) + Sync)) -> Vec<(Lane, usize)> {
    let Some(sensor) = recordings.first() else { return Vec::new() };
    let [x, y, _] = sensor.pose.position;
    let reach_m =
        recordings.iter().map(|r| r.sensor.field_of_view.range_m[1]).fold(0.0, f64::max) + Lane::BEYOND_RANGE_M;
    let mut smooth: Vec<(Vec<[f64; 2]>, usize)> = proposals::lanes(recordings, progress)
        .iter()
        .map(|(points, n)| (within(&smoothed(points, STEP_M, SMOOTH_M), [x, y], reach_m), *n))
        .filter(|(points, _)| points.len() > 1)
        .collect();
    smooth.truncate(MOST_LANES);
    let mut straight_m = STRAIGHT_M;
    loop {
        let lane = |points: &[[f64; 2]]| Lane::of(uncrossed(&straightened(points, straight_m)));
        let lanes: Vec<(Lane, usize)> =
            smooth.iter().filter_map(|(points, n)| lane(points).map(|lane| (lane, *n))).collect();
        if segments(lanes.iter().map(|(lane, _)| lane)) <= MOST_SEGMENTS {
            return lanes;
        }
        straight_m *= WIDER;
    }
}

/// Segments of lanes.
pub fn segments<'a>(lanes: impl IntoIterator<Item = &'a Lane>) -> usize {
    lanes.into_iter().map(|lane| lane.points.len() - 1).sum()
}
