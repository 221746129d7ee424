//! Tracks the machine offers: found in the radar's detections, for a person to accept, mend or reject.
//!
//! The estimators' own obstacles are no proposals, since they would judge themselves. This method has the whole
//! recording at hand, later frames too, and shares no code with them. In the order of the data:
//! `reflections` puts detections on the road and tells fixtures, `tracker` follows what moves through the frames,
//! forwards and backwards, `path` smooths (`motion`). What drives shows the `lanes`; known these, all is followed again,
//! and nobody is mixed up with the vehicle beside. `joining` makes one path of the pieces of a vehicle, `assembly` tells
//! one long vehicle from two that creep in one lane. What stands in lanes is followed there by place alone: `streaks` are
//! what goes on in one place of a vehicle, `vehicles` puts together those whose distance stays while they move, `queues`
//! makes paths of them in place of the tracker's. `exclusion` drops mirror images, `standing` adds the time in which it
//! stood before and after, `shape` puts a box around it, in its lane where `across` tells, and of proposals for one place `exclusion` keeps the best.
//! `following` goes on with those that creep where the ones ahead and behind tell it.
//! `ways` tells which of them drive the same way.
//!
//! [`follow`] uses the same reflections for what a person points at.
//!
//! # Limits
//! Made for roads with lanes, where it needs few mends. In queues some long vehicles come in pieces and some pairs of
//! cars as one. At crossings vehicles that turn or stand change places with their neighbours: there expect to draw.
//!
//! # Cost
//! Three to six seconds of two busy cores for a minute of recording with 256 detections a frame; a crossing with 300,
//! where much stands, has taken ten.

mod across;
mod assembly;
mod exclusion;
pub mod follow;
mod following;
mod joining;
mod lane;
mod lanes;
mod motion;
mod pairs;
mod path;
mod queues;
mod reflections;
mod shape;
mod standing;
mod streaks;
mod tracker;
mod vehicles;
mod ways;

use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use super::tracks::LabelTrack;
use crate::recording::Recording;
use lane::Lane;
use path::Path;
use shape::Extent;

/// Fewest reflections of a proposal.
const FEWEST: usize = 12;
/// Shortest way of a proposal: what stands all the time is no label, metres.
const TRAVEL_M: f64 = 6.0;

/// The same of what keeps to a lane.
const IN_LANE_M: f64 = 2.0;

/// Lowest score that is worth a look.
const LEAST: f64 = 0.8;

/// Lowest score of what tells where a lane is.
const ON_A_LANE: f64 = 0.6;

/// Where and how long the sensor looks.
struct View<'a> {
    sensor: [f64; 2],
    /// Whether it could see something there.
    contains: &'a dyn Fn([f64; 2]) -> bool,
    /// Last frame, seconds since the first.
    latest_s: f64,
}

/// A track that is offered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Proposal {
    pub track: LabelTrack,
    /// 0 to 1: how much speaks for it.
    pub score: f64,
    /// Reflections it was made of.
    pub detections: u32,
    /// Number of the way it drives: those of one way can be decided about together.
    pub way: u32,
}

/// Tracks of a recording, the best first, with ids `p1`, `p2`, ... `progress` is told the share that is done.
pub fn propose(recording: &Recording, progress: &(dyn Fn(f64) + Sync)) -> Vec<Proposal> {
    if recording.sensor.frames_independent {
        return Vec::new();
    }
    let mut instants = reflections::instants(recording);
    // the first time what drives shows the lanes, the second time they tell what is side by side
    let first = paths(&instants, &[], &[], &|share| progress(0.3 * share));
    let lanes = lanes::learn(lanes::driven(&first, &instants));
    reflections::free_lanes(&mut instants, &lanes);
    let shared: Vec<Arc<Lane>> = lanes.iter().cloned().map(Arc::new).collect();
    let paths = paths(&instants, &lanes, &shared, &|share| progress(0.3 + 0.3 * share));
    progress(0.7);
    let paths = joining::abreast(paths, &instants);
    let paths = assembly::assembled(paths, &instants);
    let paths = assembly::assembled(paths, &instants);
    let paths = queues::queued(paths, &shared, &mut instants);
    progress(0.8);
    let paths = joining::through_gaps(paths, &instants);
    let paths = exclusion::without_images(paths);
    let paths = joining::through_gaps(standing::stood(paths, &instants), &instants);
    progress(0.9);
    let mut scored: Vec<(f64, &Path)> = paths
        .iter()
        .filter(|p| {
            p.members.len() >= FEWEST
                && p.travel_m() >= if p.lane.is_some() || !p.queued.is_empty() { IN_LANE_M } else { TRAVEL_M }
        })
        .map(|p| (score(p, &instants), p))
        .filter(|(score, _)| *score >= LEAST)
        .collect();
    // of two in one place the one that stood in a queue has more to show for it
    let queued = |p: &Path| if p.queued.is_empty() { 0 } else { p.members.len() };
    scored.sort_by(|a, b| queued(b.1).cmp(&queued(a.1)).then(b.0.total_cmp(&a.0)));
    let view = View {
        sensor: crate::labels::Site::of(recording).sensor,
        contains: &|[x, y]| recording.sensor.field_of_view.contains(recording.pose.to_spherical([x, y, 1.0])),
        latest_s: instants.last().map_or(0.0, |i| i.time_s),
    };
    let extents: Vec<Extent> = scored.iter().map(|(_, path)| Extent::of(path, &instants)).collect();
    let vehicles: Vec<_> = scored.iter().zip(&extents).map(|((_, path), extent)| (*path, extent.box_m()[1])).collect();
    let lefts_m = across::lefts_m(&vehicles, &instants);
    let all =
        scored.into_iter().zip(extents.iter().zip(lefts_m)).zip(1..).map(|(((score, path), (extent, left_m)), k)| {
            Proposal {
                track: shape::track(path, extent, left_m, &view, format!("p{k}")),
                score,
                detections: path.members.len() as u32,
                way: 0,
            }
        });
    let all: Vec<Proposal> = all.filter(|p| p.track.check().is_ok()).collect();
    let all = exclusion::without_intruders(all, view.sensor);
    let mut all = following::gone_on(all, &view);
    let ways = ways::ways(&all.iter().map(|p| &p.track).collect::<Vec<_>>());
    for (proposal, way) in all.iter_mut().zip(ways) {
        proposal.way = way;
    }
    progress(1.0);
    all
}

/// Lanes that were driven on in these recordings of one site, as places along their middles in the direction of travel;
/// those that most speak for first, each with how many were followed there. `progress` is told the share that is done.
pub fn lanes(recordings: &[Recording], progress: &(dyn Fn(f64) + Sync)) -> Vec<(Vec<[f64; 2]>, usize)> {
    let mut all: Vec<Vec<reflections::Instant>> =
        recordings.iter().filter(|r| !r.sensor.frames_independent).map(reflections::instants).collect();
    let (mut known, mut followed): (Vec<Lane>, Vec<usize>) = (Vec::new(), Vec::new());
    // as for proposals: the second time nobody is mixed up with the vehicle beside
    for pass in 0..2 {
        let shared: Vec<Arc<Lane>> = known.iter().cloned().map(Arc::new).collect();
        let mut driven = Vec::new();
        let count = all.len();
        for (k, instants) in all.iter_mut().enumerate() {
            reflections::free_lanes(instants, &known);
            let done = (pass * count + k) as f64;
            let paths = paths(instants, &known, &shared, &|share| progress((done + share) / (2 * count) as f64));
            // mirror images in rails and walls drive side by side, too
            let mut paths = exclusion::without_images(paths);
            if pass > 0 {
                paths.retain(|path| score(path, instants) >= ON_A_LANE);
            }
            driven.extend(lanes::driven(&paths, instants));
        }
        (known, followed) = lanes::counted(driven).into_iter().unzip();
    }
    progress(1.0);
    known.into_iter().map(|lane| lane.points).zip(followed).collect()
}

/// What moves, followed in both directions of time.
fn paths(
    instants: &[reflections::Instant],
    lanes: &[Lane],
    shared: &[Arc<Lane>],
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<Path> {
    let (forward, backward) = rayon::join(
        || tracker::tracklets(instants, lanes, false, progress),
        || tracker::tracklets(instants, lanes, true, &|_| ()),
    );
    let tracklets = joining::both_ways(&forward, &backward);
    let path = |t: tracker::Tracklet| Path::new(t.members, t.lane.and_then(|k| shared.get(k).cloned()), instants);
    tracklets.into_par_iter().filter_map(path).collect()
}

/// The way that makes a path worth a look.
fn way_m(path: &Path) -> f64 {
    match () {
        // its reflections moved as one
        () if !path.queued.is_empty() => 1.0,
        () if path.lane.is_some() => 2.5,
        () => 15.0,
    }
}

/// Many reflections, a long way and a Doppler that fits speak for a path.
fn score(path: &Path, instants: &[reflections::Instant]) -> f64 {
    let wrong: Vec<f64> = path
        .reflections(instants)
        .filter_map(|(frame, r)| {
            let [vx, vy] = path.at(frame)?.velocity();
            Some((r.doppler_mps - r.sight[0] * vx - r.sight[1] * vy).abs())
        })
        .collect();
    let wrong = wrong.iter().sum::<f64>() / wrong.len().max(1) as f64;
    let many = 1.0 - (-(path.members.len() as f64) / 40.0).exp();
    let far = 1.0 - (-path.travel_m() / way_m(path)).exp();
    many * far * (-(wrong / 0.8).powi(2)).exp()
}
