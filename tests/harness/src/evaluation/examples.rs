//! One instructive found example each of TV, TI, FV and FI, for pictures.
//!
//! # Model
//! A *situation* is a run of successive frames in which one object keeps one outcome. Preferred, in
//! this order: it shows what the outcome is about (the estimator agrees with the exact line of sight
//! where it is true, contradicts it where it is false); some frame lies well inside the field of view
//! at 30 to 150 m; it lasts long; it comes early. Of its frames the middle suitable one is taken.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::Serialize;

use super::counts::Outcome;
use super::samples::{FrameSamples, Sample};
use super::score::Score;
use crate::recording::Recording;

/// Ground distances at which a picture shows both sensor and object well, metres.
const DISTANCE_M: RangeInclusive<f64> = 30.0..=150.0;
/// Distance kept from the azimuth limits, radians (3 degrees).
const BORDER_RAD: f64 = 0.052;
/// A gap between frames that ends a situation, nanoseconds.
const GAP_NS: i64 = 500_000_000;

/// Where an outcome can be seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Example {
    pub outcome: Outcome,
    /// Index into the recording's frames and the samples.
    pub frame: usize,
    /// Index into that frame's objects.
    pub object: usize,
    pub time_ns: i64,
    pub object_id: String,
    pub class: String,
    pub distance_m: f64,
    /// Frames the situation lasts.
    pub lasts: usize,
    /// Whether the exact line of sight at slice height reaches it.
    pub slice_in_sight: bool,
}

/// An example with all frames of its situation.
#[derive(Debug, Clone, PartialEq)]
pub struct Lasting {
    pub example: Example,
    /// Index into the truth's tracks.
    pub track: usize,
    pub first: usize,
    pub last: usize,
}

/// Successive samples (frame, object) of one track with one outcome.
struct Situation {
    outcome: Outcome,
    members: Vec<(usize, usize)>,
}

/// At most one example of each outcome, in the order TV, TI, FV, FI.
pub fn find(recording: &Recording, samples: &[FrameSamples], score: &Score) -> Vec<Example> {
    let all = situations(recording, samples, score);
    Outcome::ALL.iter().filter_map(|&outcome| best(recording, samples, &all, outcome)).collect()
}

fn situations(recording: &Recording, samples: &[FrameSamples], score: &Score) -> Vec<Situation> {
    let mut done = Vec::new();
    let mut open: BTreeMap<usize, Situation> = BTreeMap::new();
    for (k, (frame, verdicts)) in samples.iter().zip(&score.verdicts).enumerate() {
        for (object, (sample, verdict)) in frame.objects.iter().zip(verdicts).enumerate() {
            let outcome = Outcome::of(verdict.visible, sample.detected);
            if let Some(running) = open.get_mut(&sample.track)
                && running.outcome == outcome
                && running.members.last().is_some_and(|&(last, _)| follows(recording, last, k))
            {
                running.members.push((k, object));
            } else {
                let fresh = Situation { outcome, members: vec![(k, object)] };
                done.extend(open.insert(sample.track, fresh));
            }
        }
    }
    done.extend(open.into_values());
    done
}

fn follows(recording: &Recording, last: usize, next: usize) -> bool {
    let time = |k: usize| recording.frames.get(k).map_or(0, |f| f.time_ns);
    (0..GAP_NS).contains(&time(next).saturating_sub(time(last)))
}

/// The situations of an outcome that say most, most telling first, one a track: what an outcome gets wrong worst, where
/// it is a false one.
pub fn most_telling(
    recording: &Recording,
    samples: &[FrameSamples],
    score: &Score,
    outcome: Outcome,
    most: usize,
) -> Vec<Lasting> {
    let all = situations(recording, samples, score);
    let ranked = ranked(recording, samples, &all, outcome);
    let mut found: Vec<Lasting> = Vec::new();
    for lasting in ranked {
        if found.len() < most && found.iter().all(|other| other.track != lasting.track) {
            found.push(lasting);
        }
    }
    found
}

fn best(
    recording: &Recording,
    samples: &[FrameSamples],
    situations: &[Situation],
    outcome: Outcome,
) -> Option<Example> {
    ranked(recording, samples, situations, outcome).into_iter().next().map(|lasting| lasting.example)
}

/// An outcome's situations, the preferred one first.
fn ranked(recording: &Recording, samples: &[FrameSamples], situations: &[Situation], outcome: Outcome) -> Vec<Lasting> {
    let sample = |&(frame, object): &(usize, usize)| &samples[frame].objects[object];
    let rank = |situation: &Situation| {
        let suitable: Vec<_> = situation.members.iter().filter(|m| suits(recording, sample(m))).copied().collect();
        let members = if suitable.is_empty() { &situation.members } else { &suitable };
        let chosen = members[members.len() / 2];
        let telling = telling(outcome, sample(&chosen).slice_in_sight);
        let key = (telling, !suitable.is_empty(), members.len(), Reverse(chosen));
        let frames = (situation.members[0].0, situation.members[situation.members.len() - 1].0);
        (key, chosen, situation.members.len(), frames)
    };
    let mut ranked: Vec<_> = situations.iter().filter(|s| s.outcome == outcome).map(rank).collect();
    ranked.sort_by_key(|(key, ..)| Reverse(*key));
    let lasting = |(frame, object): (usize, usize), lasts, (first, last)| {
        let chosen = &samples[frame].objects[object];
        let track = recording.truth.as_ref()?.tracks.get(chosen.track)?;
        let example = Example {
            outcome,
            frame,
            object,
            time_ns: recording.frames.get(frame)?.time_ns,
            object_id: track.id.clone(),
            class: track.class.clone(),
            distance_m: chosen.distance_m,
            lasts,
            slice_in_sight: chosen.slice_in_sight,
        };
        Some(Lasting { example, track: chosen.track, first, last })
    };
    ranked.into_iter().filter_map(|(_, chosen, lasts, frames)| lasting(chosen, lasts, frames)).collect()
}

/// Whether exact geometry bears the outcome out: true ones agree with it, false ones contradict it.
fn telling(outcome: Outcome, in_sight: bool) -> bool {
    match outcome {
        Outcome::Tv | Outcome::Fi => in_sight,
        Outcome::Ti | Outcome::Fv => !in_sight,
    }
}

fn suits(recording: &Recording, sample: &Sample) -> bool {
    let [low, high] = recording.sensor.field_of_view.azimuth_rad;
    let azimuth = recording.pose.to_spherical(sample.solid.center).azimuth_rad;
    DISTANCE_M.contains(&sample.distance_m) && (low + BORDER_RAD..=high - BORDER_RAD).contains(&azimuth)
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::{frames, recording, sample};
    use super::super::score::made_up::score;
    use super::*;

    #[test]
    fn the_longest_telling_situation_in_good_view_is_found() {
        // track 0: hidden and undetected, near, then far; track 1: undetected though in sight, for longer;
        // track 2: detected
        let samples = frames((0..40).map(|k| {
            let mut objects = vec![sample(1, 60.0, false, true), sample(2, 80.0, true, true)];
            if k < 12 {
                objects.push(sample(0, if k < 5 { 10.0 } else { 40.0 + k as f64 }, false, false));
            }
            objects
        }));
        let recording = recording(40, 3);
        let invisible = score("m", &samples, |s| if s.track == 2 { Some(200) } else { Some(0) });
        let found = find(&recording, &samples, &invisible);
        let outcomes: Vec<_> = found.iter().map(|e| e.outcome).collect();
        assert_eq!(outcomes, [Outcome::Tv, Outcome::Ti]);
        let ti = &found[1];
        assert_eq!((ti.object_id.as_str(), ti.lasts, ti.slice_in_sight), ("0", 12, false));
        assert_eq!(ti.frame, 8, "the middle of frames 5 to 11, which lie at a good distance");
        assert_eq!(samples[ti.frame].objects[ti.object].track, 0);
        assert_eq!(found, find(&recording, &samples, &invisible));
    }

    #[test]
    fn the_worst_are_one_a_vehicle_with_their_first_and_last_frames() {
        // three vehicles that nobody detects and the map calls visible: for 20, 9 and 9 frames, the first one twice
        let samples = frames((0..40).map(|k| {
            let mut objects = vec![sample(0, 60.0, k == 20, false)];
            objects.extend((k < 9).then(|| sample(1, 70.0, false, false)));
            objects.extend((10..19).contains(&k).then(|| sample(2, 80.0, false, false)));
            objects
        }));
        let found = most_telling(&recording(40, 3), &samples, &score("m", &samples, |_| Some(255)), Outcome::Fv, 3);
        let told: Vec<_> = found.iter().map(|l| (l.track, l.first, l.last, l.example.lasts)).collect();
        assert_eq!(told, [(0, 0, 19, 20), (1, 0, 8, 9), (2, 10, 18, 9)]);
    }

    #[test]
    fn a_gap_in_time_ends_a_situation() {
        let samples = frames((0..10).map(|_| vec![sample(0, 60.0, true, true)]));
        let mut recording = recording(10, 1);
        recording.frames[4..].iter_mut().for_each(|f| f.time_ns += 1_000_000_000);
        let found = find(&recording, &samples, &score("m", &samples, |_| Some(255)));
        assert_eq!((found[0].lasts, found[0].frame), (6, 7));
    }
}
