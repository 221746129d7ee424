//! Vehicles in queues: paths of what creeps and stands in lanes, made anew from its streaks.
//!
//! # Model
//! What the tracker found of a vehicle before it came into the queue and after it left it is its own; what it made of
//! the reflections of several of them is dropped.

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::lane::Lane;
use super::path::{Path, Queued};
use super::reflections::Instant;
use super::streaks::streaks;
use super::vehicles::{Vehicle, vehicles};

/// Share of its reflections that a vehicle of another lane has already from which on it is that one.
const TAKEN: f64 = 0.4;
/// How long after the beginning and before the end of the queue the tracker has to agree, frames, with how many
/// reflections and which share of them; within as many frames it goes on.
const AGREES: usize = 15;
const ALIKE: usize = 5;
const AGREE: f64 = 0.6;
/// Share of a path's reflections that have to be left for it to stay.
const LEFT: f64 = 0.5;

/// Paths with those of slow vehicles in lanes anew.
pub fn queued(paths: Vec<Path>, lanes: &[Arc<Lane>], instants: &mut [Instant]) -> Vec<Path> {
    let mut found: Vec<(usize, Vehicle)> = lanes
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, lane)| vehicles(streaks(lane, instants)).into_iter().map(move |v| (k, v)))
        .collect();
    found.sort_by_key(|(_, v)| std::cmp::Reverse(v.members.len()));
    // lanes overlap at crossings: what has most is right
    let mut owner: HashMap<(usize, usize), usize> = HashMap::new();
    let mut kept: Vec<(usize, Vehicle)> = Vec::new();
    for (lane, mut v) in found {
        let before = v.members.len();
        v.members.retain(|(m, _)| !owner.contains_key(m));
        if (v.members.len() as f64) < (1.0 - TAKEN) * before as f64 {
            continue;
        }
        owner.extend(v.members.iter().map(|(m, _)| (*m, kept.len())));
        kept.push((lane, v));
    }
    for ((frame, i), ahead_m) in kept.iter().flat_map(|(_, v)| &v.members) {
        instants[*frame].reflections[*i].ahead_m = Some(*ahead_m);
    }
    let mut all: Vec<Vec<(usize, usize)>> =
        kept.iter().map(|(_, v)| v.members.iter().map(|(m, _)| *m).collect()).collect();
    // what the tracker has before and after
    for (k, (_, v)) in kept.iter().enumerate() {
        for end in [End::First, End::Last] {
            let best = paths.iter().filter_map(|p| Some((end.goes_on(p, v, k, &owner)?, p))).max_by_key(|(n, _)| *n);
            let beyond = best.iter().flat_map(|(_, p)| end.beyond(p, v));
            let beyond: Vec<(usize, usize)> = beyond.filter(|m| !owner.contains_key(m)).collect();
            owner.extend(beyond.iter().map(|m| (*m, k)));
            all[k].extend(beyond);
        }
    }
    let instants = &*instants;
    let mut result: Vec<Path> = Vec::new();
    for path in paths {
        let left: Vec<(usize, usize)> = path.members.iter().copied().filter(|m| !owner.contains_key(m)).collect();
        if left.len() == path.members.len() {
            result.push(path);
        } else if left.len() as f64 >= LEFT * path.members.len() as f64 {
            result.extend(Path::new(left, path.lane.clone(), instants));
        }
    }
    let made = all.into_par_iter().zip(&kept).filter_map(|(members, (lane, v))| {
        let lane = lanes.get(*lane)?;
        let queued = vec![Queued { frames: v.first..=v.last, lane: lane.clone() }];
        Path::in_queues(members, Some(lane.clone()), queued, instants)
    });
    result.extend(made.collect::<Vec<Path>>());
    result
}

/// An end of a vehicle's time in the queue.
#[derive(Clone, Copy)]
enum End {
    First,
    Last,
}

impl End {
    /// In how many reflections a path agrees with a vehicle at this end, if it does and goes on soon.
    fn goes_on(self, path: &Path, v: &Vehicle, k: usize, owner: &HashMap<(usize, usize), usize>) -> Option<usize> {
        if path.first > v.last || path.last() < v.first {
            return None;
        }
        let inside = |m: &&(usize, usize)| match self {
            Self::First => (v.first..=v.first + AGREES).contains(&m.0),
            Self::Last => m.0 <= v.last && m.0 + AGREES >= v.last,
        };
        let (all, own) = path
            .members
            .iter()
            .filter(inside)
            .fold((0, 0), |(all, own), m| (all + 1, own + usize::from(owner.get(m) == Some(&k))));
        let next = match self {
            Self::First => self.beyond(path, v).map(|m| v.first - m.0).min()?,
            Self::Last => self.beyond(path, v).map(|m| m.0 - v.last).min()?,
        };
        (own >= ALIKE && own as f64 >= AGREE * all as f64 && next <= AGREES).then_some(own)
    }

    /// A path's reflections before or after the queue.
    fn beyond<'a>(self, path: &'a Path, v: &'a Vehicle) -> impl Iterator<Item = (usize, usize)> + 'a {
        path.members.iter().copied().filter(move |m| match self {
            Self::First => m.0 < v.first,
            Self::Last => m.0 > v.last,
        })
    }
}
