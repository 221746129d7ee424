//! How far a map can be trusted after a start, and after a gap between frames.
//!
//! The same seconds of a recording are judged twice: with a unit that begins in the middle of the traffic, or misses
//! the frames of a gap, and with one that has run since the recording began. Road cells alone are judged, as exact
//! lines of sight to their centres say (`evaluation/cells.rs`).

use std::ops::AddAssign;

use anyhow::{Result, ensure};
use rayon::prelude::*;
use serde::Serialize;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use crate::estimators::{self, Estimator};
use crate::evaluation::Settings;
use crate::evaluation::counts::rate;
use crate::evaluation::samples::{self, Cell, FrameSamples};
use crate::recording::Recording;

/// What is done to a unit, and how long it is watched.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// Starts, and gaps of each length, in each recording.
    pub times: usize,
    /// Lengths of the gaps, seconds.
    pub gaps_s: Vec<f64>,
    /// How long the unit has run that nothing is done to, at least, seconds.
    pub run_in_s: f64,
    /// How long is judged, seconds.
    pub watched_s: usize,
}

/// Road cells over time, by truth and by what the map says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Cells {
    pub blocked: u64,
    pub blocked_known: u64,
    pub blocked_visible: u64,
    pub clear: u64,
    pub clear_known: u64,
    pub clear_visible: u64,
}

impl AddAssign for Cells {
    fn add_assign(&mut self, o: Self) {
        self.blocked += o.blocked;
        self.blocked_known += o.blocked_known;
        self.blocked_visible += o.blocked_visible;
        self.clear += o.clear;
        self.clear_known += o.clear_known;
        self.clear_visible += o.clear_visible;
    }
}

impl Cells {
    fn of(map: &dyn VisibilityMap, cells: &[(Cell, bool)]) -> Self {
        let mut sum = Self::default();
        for &((i, j), in_sight) in cells {
            let state = map.at(RoadPoint::cell_centre(i, j));
            let (known, visible) = (u64::from(state.visibility != Visibility::Unknown), u64::from(state.visible()));
            if in_sight {
                (sum.clear, sum.clear_known) = (sum.clear + 1, sum.clear_known + known);
                sum.clear_visible += visible;
            } else {
                (sum.blocked, sum.blocked_known) = (sum.blocked + 1, sum.blocked_known + known);
                sum.blocked_visible += visible;
            }
        }
        sum
    }

    /// Of the blocked cells that are known, the share called visible.
    pub fn fvr_of_known(&self) -> Option<f64> {
        rate(self.blocked_visible, self.blocked_known)
    }

    /// Of all blocked cells, the share called visible: unknown is not visible.
    pub fn fvr(&self) -> Option<f64> {
        rate(self.blocked_visible, self.blocked)
    }

    /// Of the clear cells, the share called visible.
    pub fn clear_visible(&self) -> Option<f64> {
        rate(self.clear_visible, self.clear)
    }

    /// Of the blocked cells, the share that is known.
    pub fn blocked_known(&self) -> Option<f64> {
        rate(self.blocked_known, self.blocked)
    }
}

/// One second after a start or a gap: with it, and without.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Second {
    pub after: Cells,
    pub running: Cells,
}

impl AddAssign for Second {
    fn add_assign(&mut self, o: Self) {
        self.after += o.after;
        self.running += o.running;
    }
}

/// What happened to a unit, so many times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Length of the gap, seconds; `None` of a start.
    pub gap_s: Option<f64>,
    pub times: usize,
    /// By whole seconds since the first frame after it.
    pub seconds: Vec<Second>,
}

impl Outcome {
    /// All seconds from one on, up to another, together.
    pub fn between(&self, from: usize, to: usize) -> Second {
        let mut sum = Second::default();
        self.seconds.iter().take(to).skip(from).for_each(|s| sum += *s);
        sum
    }

    /// Adds what happened in another recording.
    pub fn add(&mut self, other: &Self) {
        self.times += other.times;
        self.seconds.iter_mut().zip(&other.seconds).for_each(|(all, one)| *all += *one);
    }
}

/// Frames of a recording by time, in seconds from its first.
struct Clock<'a>(&'a Recording);

impl Clock<'_> {
    fn seconds(&self, frame: usize) -> f64 {
        let time = |k: usize| self.0.frames.get(k).map_or(0, |f| f.time_ns);
        (time(frame) - time(0)) as f64 * 1e-9
    }

    /// The first frame from a time on.
    fn frame(&self, seconds: f64) -> usize {
        (0..self.0.frames.len()).find(|k| self.seconds(*k) >= seconds).unwrap_or(self.0.frames.len())
    }
}

/// Judges a recording; a start first, then gaps in the plan's order. `progress` is called after each of [`steps`].
///
/// # Errors
/// A recording without labels or too short, and what estimators refuse.
pub fn run(
    recording: &Recording,
    plan: &Plan,
    settings: &Settings,
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>> {
    ensure!(recording.truth.is_some(), "{}: it has no labels, so that nothing can be judged", recording.name);
    ensure!(!recording.sensor.frames_independent, "{}: its frames have nothing to do with each other", recording.name);
    let clock = Clock(recording);
    let (first, last) =
        (plan.run_in_s, clock.seconds(recording.frames.len().saturating_sub(1)) - plan.watched_s as f64);
    ensure!(
        last >= first,
        "{}: it has to be {} s long: {} s before the first start and {} s after the last",
        recording.name,
        plan.run_in_s + plan.watched_s as f64,
        plan.run_in_s,
        plan.watched_s
    );
    let every = if plan.times > 1 { (last - first) / (plan.times - 1) as f64 } else { 0.0 };
    let begins: Vec<usize> = (0..plan.times).map(|k| clock.frame(first + every * k as f64)).collect();
    let judged = samples::collect(recording, &settings.evaluation, &|| ());
    let running = watch(recording, settings, 0..recording.frames.len(), None, &judged)?;
    progress();
    let kinds: Vec<Option<f64>> = std::iter::once(None).chain(plan.gaps_s.iter().map(|gap| Some(*gap))).collect();
    kinds
        .into_iter()
        .map(|gap_s| {
            let seconds: Vec<Vec<Second>> = begins
                .par_iter()
                .map(|&begin| {
                    let from = clock.seconds(begin);
                    let end = clock.frame(from + plan.watched_s as f64);
                    let frames = if gap_s.is_some() { 0..end } else { begin..end };
                    let gap = gap_s.map(|gap| clock.frame(from - gap) + 1..begin);
                    let after = watch(recording, settings, frames, gap, &judged)?;
                    let mut seconds = vec![Second::default(); plan.watched_s];
                    for k in begin..end {
                        let second = (clock.seconds(k) - from) as usize;
                        let both = |cells: &[Cells]| cells.get(k).copied().unwrap_or_default();
                        if let Some(sum) = seconds.get_mut(second) {
                            *sum += Second { after: both(&after), running: both(&running) };
                        }
                    }
                    progress();
                    Ok(seconds)
                })
                .collect::<Result<_>>()?;
            let mut sum = Outcome { gap_s, times: 0, seconds: vec![Second::default(); plan.watched_s] };
            for seconds in seconds {
                sum.add(&Outcome { gap_s, times: 1, seconds });
            }
            Ok(sum)
        })
        .collect()
}

/// Calls of `progress` by [`run`].
pub fn steps(plan: &Plan) -> u64 {
    1 + (plan.times * (1 + plan.gaps_s.len())) as u64
}

/// Road cells of each frame by what a new unit says that is given these frames, without those of the gap.
fn watch(
    recording: &Recording,
    settings: &Settings,
    frames: std::ops::Range<usize>,
    gap: Option<std::ops::Range<usize>>,
    judged: &[FrameSamples],
) -> Result<Vec<Cells>> {
    let mut unit: Box<dyn Estimator> = estimators::own(recording, &settings.estimators)?;
    let mut cells = vec![Cells::default(); recording.frames.len()];
    for k in frames {
        if gap.as_ref().is_some_and(|gap| gap.contains(&k)) {
            continue;
        }
        let (Some(frame), Some(sample), Some(cells)) = (recording.frames.get(k), judged.get(k), cells.get_mut(k))
        else {
            continue;
        };
        unit.step(frame);
        *cells = Cells::of(unit.map(), &sample.cells);
    }
    Ok(cells)
}
