//! Lanes of a site for a unit's configuration, learnt from recordings of its traffic.
//!
//! An integrator rarely has a net of the crossing. A minute or two of the radar's own detections shows where vehicles
//! drive: those that are followed both ways through time for [`proposals`], side by side in one direction, are a lane.
//!
//! They are smoothed, followed once more with these lanes, and left out where they are likely to be mirror images: guard rails
//! make false ones. What was tried: `tests/STUDIES.md`.
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
