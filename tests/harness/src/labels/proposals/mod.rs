//! Tracks the machine offers: found in the radar's detections, for a person to accept, mend or reject.
//!
//! The estimators' own obstacles are no proposals, since they would judge themselves. This method has the whole
//! recording at hand, later frames too, and shares no code with them. In the order of the data:
//! `reflections` puts detections on the road and tells fixtures, `tracker` follows what moves through the frames,
//! forwards and backwards, `path` smooths (`motion`), `joining` makes one path of the pieces of a vehicle, `standing`
//! adds the time in which it stood before and after, and `shape` puts a box around it.
//!
//! # Limits
//! Made for roads with lanes, where it needs few mends. On crossings and in queues vehicles that stand side by side are
//! mixed up more often, and long vehicles come in pieces.
//!
//! # Cost
//! Some three seconds of two cores for a minute of recording with 256 detections a frame.

mod joining;
mod motion;
mod path;
mod reflections;
mod shape;
mod standing;
mod tracker;

use rayon::prelude::*;
use serde::Serialize;

use super::tracks::LabelTrack;
use crate::recording::Recording;
use path::Path;

/// Fewest reflections of a proposal.
const FEWEST: usize = 12;
/// Shortest way of a proposal: what stands all the time is no label, metres.
const TRAVEL_M: f64 = 6.0;

/// Lowest score that is worth a look.
const LEAST: f64 = 0.72;

/// A track that is offered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Proposal {
    pub track: LabelTrack,
    /// 0 to 1: how much speaks for it.
    pub score: f64,
    /// Reflections it was made of.
    pub detections: u32,
}

/// Tracks of a recording, the best first, with ids `p1`, `p2`, ... `progress` is told the share that is done.
pub fn propose(recording: &Recording, progress: &(dyn Fn(f64) + Sync)) -> Vec<Proposal> {
    if recording.sensor.frames_independent {
        return Vec::new();
    }
    let instants = reflections::instants(recording);
    let (forward, backward) = rayon::join(
        || tracker::tracklets(&instants, false, &|share| progress(0.6 * share)),
        || tracker::tracklets(&instants, true, &|_| ()),
    );
    let tracklets = joining::both_ways(&forward, &backward);
    let paths: Vec<Path> = tracklets.into_par_iter().filter_map(|t| Path::new(t.members, &instants)).collect();
    progress(0.7);
    let paths = joining::apart(joining::abreast(paths, &instants), &instants);
    progress(0.8);
    let paths = joining::through_gaps(paths, &instants);
    let paths: Vec<Path> = paths.into_par_iter().map(|path| standing::stood(path, &instants)).collect();
    progress(0.9);
    let mut scored: Vec<(f64, &Path)> = paths
        .iter()
        .filter(|p| p.members.len() >= FEWEST && p.travel_m() >= TRAVEL_M)
        .map(|p| (score(p, &instants), p))
        .filter(|(score, _)| *score >= LEAST)
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let all = scored.into_iter().enumerate().map(|(k, (score, path))| Proposal {
        track: shape::track(path, &instants, recording, format!("p{}", k + 1)),
        score,
        detections: path.members.len() as u32,
    });
    let all = all.filter(|p| p.track.check().is_ok()).collect();
    progress(1.0);
    all
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
    let far = 1.0 - (-path.travel_m() / 15.0).exp();
    many * far * (-(wrong / 0.8).powi(2)).exp()
}
