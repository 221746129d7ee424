//! What is known around a vehicle that is followed: its label as it is, the boxes of others, what always stands.

use std::collections::{HashMap, HashSet};

use super::super::reflections::{Instant, Reflection, STANDS_MPS};
use crate::geometry::solid::Solid;
use crate::labels::near_face::{BoxStep, boxes};
use crate::labels::tracks::LabelTrack;

/// Where something stands for this share of all frames, what stands says nothing.
const ALWAYS: f64 = 0.4;
/// How far outside of another label's box its reflections lie at most, metres.
const ANOTHER_S_M: f64 = 0.3;

/// Share of the frames in which something stands there or in a neighbouring cell, by square metre.
#[derive(Debug)]
pub struct Standing(HashMap<(i32, i32), f64>);

impl Standing {
    pub fn of(instants: &[Instant]) -> Self {
        let mut all: HashMap<(i32, i32), f64> = HashMap::new();
        for instant in instants {
            let stand = instant.reflections.iter().filter(|r| r.doppler_mps.abs() <= STANDS_MPS).map(cell);
            let cells = stand.flat_map(|(x, y)| (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| (x + dx, y + dy))));
            for cell in cells.collect::<HashSet<_>>() {
                *all.entry(cell).or_default() += 1.0 / instants.len() as f64;
            }
        }
        Self(all)
    }

    /// How much a reflection says, 0 to 1: what stands where something always stands says nothing.
    fn weight(&self, r: &Reflection) -> f64 {
        if r.doppler_mps.abs() > STANDS_MPS {
            return 1.0;
        }
        (1.0 - self.0.get(&cell(r)).copied().unwrap_or(0.0) / ALWAYS).max(0.0)
    }
}

/// The square metre a reflection lies in.
fn cell(r: &Reflection) -> (i32, i32) {
    (r.place[0].round() as i32, r.place[1].round() as i32)
}

/// What is there while one vehicle is followed.
pub struct Around<'a> {
    pub instants: &'a [Instant],
    standing: &'a Standing,
    pub sensor: [f64; 2],
    /// Of the vehicle, by its class.
    pub size: [f64; 3],
    /// Its label as it is: boxes by frame.
    pub own: Vec<Option<BoxStep>>,
    /// Boxes of the others by frame.
    pub others: Vec<Vec<Solid>>,
}

impl<'a> Around<'a> {
    pub fn of(
        track: &LabelTrack,
        others: &[LabelTrack],
        instants: &'a [Instant],
        standing: &'a Standing,
        sensor: [f64; 2],
    ) -> Self {
        let mut all: Vec<Vec<Solid>> = vec![Vec::new(); instants.len()];
        for other in others {
            for (own, step) in all.iter_mut().zip(by_frame(other, instants, sensor)) {
                own.extend(step.map(|step| step.solid(other.size())));
            }
        }
        let own = by_frame(track, instants, sensor);
        Self { instants, standing, sensor, size: track.size(), own, others: all }
    }

    pub fn weight(&self, r: &Reflection) -> f64 {
        self.standing.weight(r)
    }

    pub fn seconds(&self, frame: usize) -> f64 {
        self.instants.get(frame).map_or(0.0, |i| i.time_s)
    }

    /// Its label's box.
    pub fn label(&self, frame: usize) -> Option<BoxStep> {
        self.own.get(frame).copied().flatten()
    }

    /// Its label's velocity, m/s.
    pub fn velocity(&self, frame: usize) -> Option<[f64; 2]> {
        let step = self.label(frame)?;
        let beside = frame.checked_sub(1).and_then(|k| self.label(k)).or_else(|| self.label(frame + 1))?;
        let dt_s = beside.time_s - step.time_s;
        (dt_s.abs() > 1e-6).then(|| [0, 1].map(|k| (beside.center[k] - step.center[k]) / dt_s))
    }

    /// Whether a reflection lies in another label's box, and not deeper in one that it is so far beyond.
    pub fn is_another_s(&self, frame: usize, r: &Reflection, beyond_m: f64) -> bool {
        let inside = |other: &Solid| {
            let away_m = other.footprint_distance(r.place);
            away_m < ANOTHER_S_M && away_m <= beyond_m
        };
        self.others.get(frame).is_some_and(|others| others.iter().any(inside))
    }
}

/// A label's box at every frame.
fn by_frame(track: &LabelTrack, instants: &[Instant], sensor: [f64; 2]) -> Vec<Option<BoxStep>> {
    let steps = if track.points.len() < 2 { Vec::new() } else { boxes(track, sensor) };
    let mut next = 0;
    let at = |instant: &Instant| {
        while steps.get(next).is_some_and(|s| s.time_s < instant.time_s - 1e-6) {
            next += 1;
        }
        let after = steps.get(next)?;
        let before = steps.get(next.saturating_sub(1))?;
        if instant.time_s < before.time_s - 1e-6 {
            return None;
        }
        let share = (instant.time_s - before.time_s) / (after.time_s - before.time_s).max(1e-6);
        let center = [0, 1].map(|k| before.center[k] + share.clamp(0.0, 1.0) * (after.center[k] - before.center[k]));
        Some(BoxStep { time_s: instant.time_s, center, heading_rad: after.heading_rad })
    };
    instants.iter().map(at).collect()
}
