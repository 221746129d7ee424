//! Several sensors on one road: each alone, and their maps fused.
//!
//! Each is judged alone, on what lies in its own view; the fused map is judged on what lies in any of theirs, at the
//! times of the first, and an object is detected if any detects it. Beside the rates stands what the set shows of the
//! road and what each sensor shows of the same: cells seen, and objects detected.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use rayon::prelude::*;
use serde::Serialize;

use super::counts::rate;
use super::pool::{Seconds, pool};
use super::replay::Replay;
use super::samples::{self, Cell, FrameSamples, Sample};
use super::score::{Score, score};
use super::{Options, Settings, camera as judged};
use crate::estimators::{self, Estimator, fused};
use crate::recording::{Frame, Recording};

/// How old the newest frame of a sensor may be to count, ns.
const LATEST_NS: i64 = 150_000_000;

/// What a set of sensors shows of a road, or one of them alone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Shown {
    /// Object-time-steps in any sensor's view.
    pub objects: u64,
    /// Of them detected.
    pub detected: u64,
    /// Road cells in any sensor's view.
    pub cells: u64,
    /// Of them in exact sight.
    pub in_sight: u64,
    /// Of them called visible.
    pub visible: u64,
    /// Called visible and in exact sight.
    pub rightly: u64,
    /// Objects that no other sensor detects.
    pub added: u64,
}

impl std::ops::AddAssign for Shown {
    fn add_assign(&mut self, o: Self) {
        self.objects += o.objects;
        self.detected += o.detected;
        self.cells += o.cells;
        self.in_sight += o.in_sight;
        self.visible += o.visible;
        self.rightly += o.rightly;
        self.added += o.added;
    }
}

impl Shown {
    /// Share of the objects that are detected.
    pub fn coverage(&self) -> Option<f64> {
        rate(self.detected, self.objects)
    }

    /// Share of the objects that no other sensor detects.
    pub fn adds(&self) -> Option<f64> {
        rate(self.added, self.objects)
    }

    /// Share of the road that is not called visible.
    pub fn hidden(&self) -> Option<f64> {
        rate(self.cells - self.visible, self.cells)
    }

    /// Share of the road that is not in exact sight.
    pub fn truly_hidden(&self) -> Option<f64> {
        rate(self.cells - self.in_sight, self.cells)
    }
}

/// A set judged, its seconds apart: each sensor on its own road, then all fused.
#[derive(Debug)]
pub struct Judged {
    rows: Vec<(String, Seconds)>,
    shown: Vec<Shown>,
    /// Every cell that is judged.
    pub road: Vec<Cell>,
}

/// A set of sensors, or the same of several sites pooled.
#[derive(Debug)]
pub struct SensorSet {
    pub name: String,
    /// Each sensor, then all fused: each judged on its own road.
    pub rows: Vec<(String, Replay)>,
    /// In the same order, all on the road of the set.
    pub shown: Vec<Shown>,
}

impl SensorSet {
    /// Of one site or of several with the same sensors; none of none.
    pub fn pooled(name: &str, sites: &[&Judged], options: &Options) -> Option<Self> {
        let first = sites.first()?;
        let row = |k: usize| {
            let parts: Vec<&Seconds> = sites.iter().map(|s| &s.rows[k].1).collect();
            // the warm-up is left out of the samples
            Some((first.rows[k].0.clone(), pool(name, &parts, 0.0, options)?))
        };
        let rows = (0..first.rows.len()).map(row).collect::<Option<Vec<_>>>()?;
        let mut shown = vec![Shown::default(); first.shown.len()];
        sites.iter().for_each(|site| shown.iter_mut().zip(&site.shown).for_each(|(sum, one)| *sum += *one));
        Some(Self { name: name.to_owned(), rows, shown })
    }
}

/// A sensor's newest frame at a time.
pub fn newest(recording: &Recording, time_ns: i64) -> Option<usize> {
    let k = recording.frames.partition_point(|f| f.time_ns <= time_ns).checked_sub(1)?;
    (time_ns - recording.frames[k].time_ns <= LATEST_NS).then_some(k)
}

/// Steps of [`judge`]: each sensor's samples, each alone, each on the road of the set, fused.
pub fn steps(all: &[Recording]) -> u64 {
    let frames = |recording: &Recording| recording.frames.len() as u64;
    all.iter().map(|r| 2 * frames(r)).sum::<u64>() + (all.len() as u64 + 1) * all.first().map_or(0, frames)
}

/// Judges at least two sensors' recordings of the same traffic; `every`-th frames are judged.
///
/// # Errors
/// More sensors than can be fused, a road that is too large, parameters of estimators that cannot be used.
pub fn judge(all: &[Recording], settings: &Settings, every: usize, progress: &(dyn Fn() + Sync)) -> Result<Judged> {
    let first = all.first().context("no sensor")?;
    let evaluation = &settings.evaluation;
    let share = f64::from(settings.estimators.camera_3d.visible_share);
    let samples: Vec<Vec<FrameSamples>> = all
        .iter()
        .map(|recording| match recording.of_camera() {
            // its frames come at times of their own
            Some(_) => judged::samples(recording, share, evaluation, 1, progress),
            None => samples::collect_every(recording, evaluation, every, progress),
        })
        .collect();
    let union = union(all, &samples);
    let grid = evaluation.grid;
    let judge = |running: &mut dyn Estimator, recording: &Recording, samples: &[FrameSamples]| {
        score(running, recording, samples, grid, &|| progress())
    };
    let alone: Vec<Score> = all
        .par_iter()
        .zip(&samples)
        .map(|(recording, samples)| {
            Ok(judge(&mut *estimators::own(recording, &settings.estimators)?, recording, samples))
        })
        .collect::<Result<_>>()?;
    // each on the road of the set, at the first sensor's times, and fused
    let road = road(&union);
    let each = (0..all.len()).map(|k| &all[k..=k]);
    let mut running: Vec<Box<fused::Fused>> =
        each.chain([all]).map(|members| fuse(members, &road, every, settings)).collect::<Result<_>>()?;
    let on_the_set: Vec<Score> = running.par_iter_mut().map(|e| judge(&mut **e, first, &union)).collect();

    let mut shown: Vec<Shown> = on_the_set.iter().map(called).collect();
    count(&mut shown, all, &samples, &union);
    let mut rows = Vec::new();
    for ((recording, samples), own) in all.iter().zip(&samples).zip(alone) {
        let name = format!("{}, {}", own.name, recording.name);
        rows.push((name, Seconds::new(recording.clone(), samples, vec![own])));
    }
    let fused = on_the_set.into_iter().next_back().context("a row of all")?;
    rows.push((fused.name.clone(), Seconds::new(first.clone(), &union, vec![fused])));
    Ok(Judged { rows, shown, road })
}

/// The estimators of some sensors, fused on a road.
///
/// # Errors
/// More sensors than can be fused, a road that is too large, parameters of estimators that cannot be used.
pub fn fuse(members: &[Recording], road: &[Cell], every: usize, settings: &Settings) -> Result<Box<fused::Fused>> {
    let members = members.iter().map(|r| Ok((estimators::own(r, &settings.estimators)?, r.frames.clone())));
    fused::new(members.collect::<Result<_>>()?, road, every)
}

/// What the set is judged on at each of the first sensor's frames: all objects and cells that any sensor is judged on.
fn union(recordings: &[Recording], samples: &[Vec<FrameSamples>]) -> Vec<FrameSamples> {
    let Some((first, truth)) = recordings.first().and_then(|r| Some((r, r.truth.as_ref()?))) else { return Vec::new() };
    let of_frame = |(frame, own): (&Frame, &FrameSamples)| {
        if !own.counted {
            return FrameSamples::default();
        }
        let seen: Vec<&FrameSamples> = recordings
            .iter()
            .zip(samples)
            .filter_map(|(recording, samples)| samples.get(newest(recording, frame.time_ns)?))
            .collect();
        let mut objects: BTreeMap<usize, Sample> = BTreeMap::new();
        for sample in seen.iter().flat_map(|s| &s.objects) {
            let known = objects.entry(sample.track).or_insert_with(|| sample.clone());
            known.detections = known.detections.max(sample.detections);
            known.detected |= sample.detected;
            known.slice_in_sight |= sample.slice_in_sight;
            known.box_in_sight |= sample.box_in_sight;
        }
        // where they are now, whatever the age of the frame they are known from
        let now = truth.at(frame.time_ns);
        for object in &now {
            if let Some(sample) = objects.get_mut(&object.track) {
                sample.solid = object.solid;
                sample.cells = object.solid.cells().collect();
            }
        }
        let taken: BTreeSet<Cell> = now.iter().flat_map(|o| o.solid.cells()).collect();
        let mut cells: BTreeMap<Cell, bool> = BTreeMap::new();
        for (cell, in_sight) in seen.iter().flat_map(|s| &s.cells).filter(|(cell, _)| !taken.contains(cell)) {
            *cells.entry(*cell).or_default() |= in_sight;
        }
        FrameSamples { counted: true, objects: objects.into_values().collect(), cells: cells.into_iter().collect() }
    };
    first.frames.par_iter().zip(&samples[0]).map(of_frame).collect()
}

/// Every cell that is judged.
fn road(samples: &[FrameSamples]) -> Vec<Cell> {
    let cells =
        samples.iter().flat_map(|s| s.cells.iter().map(|c| c.0).chain(s.objects.iter().flat_map(|o| o.cells.clone())));
    cells.collect::<BTreeSet<_>>().into_iter().collect()
}

/// What a map calls visible of the road.
fn called(score: &Score) -> Shown {
    let c = score.cell_counts();
    let rightly = c.clear - c.clear_not_visible;
    Shown { cells: c.blocked + c.clear, visible: c.blocked_visible + rightly, ..Shown::default() }
}

/// What each of the sensors, and all of them, detect of the set's objects, and have in exact sight of its cells.
fn count(shown: &mut [Shown], recordings: &[Recording], samples: &[Vec<FrameSamples>], union: &[FrameSamples]) {
    let Some((first, (fused, each))) = recordings.first().zip(shown.split_last_mut()) else { return };
    for (frame, all) in first.frames.iter().zip(union).filter(|(_, all)| all.counted) {
        let detected_by = |own: &FrameSamples| -> BTreeSet<usize> {
            own.objects.iter().filter(|o| o.detected).map(|o| o.track).collect()
        };
        let own = recordings.iter().zip(samples).map(|(r, samples)| samples.get(newest(r, frame.time_ns)?));
        let own: Vec<Option<&FrameSamples>> = own.collect();
        let detected: Vec<BTreeSet<usize>> = own.iter().map(|s| s.map_or_else(BTreeSet::new, detected_by)).collect();
        for object in &all.objects {
            let by = detected.iter().filter(|d| d.contains(&object.track)).count();
            fused.objects += 1;
            fused.detected += u64::from(by > 0);
            for (shown, detected) in each.iter_mut().zip(&detected) {
                let is_detected = detected.contains(&object.track);
                shown.objects += 1;
                shown.detected += u64::from(is_detected);
                shown.added += u64::from(is_detected && by == 1);
            }
        }
        let sight_of =
            |own: &FrameSamples| -> BTreeSet<Cell> { own.cells.iter().filter(|c| c.1).map(|c| c.0).collect() };
        let sight: Vec<BTreeSet<Cell>> = own.iter().map(|s| s.map_or_else(BTreeSet::new, sight_of)).collect();
        for (cell, _) in &all.cells {
            fused.in_sight += u64::from(sight.iter().any(|s| s.contains(cell)));
            each.iter_mut().zip(&sight).for_each(|(shown, s)| shown.in_sight += u64::from(s.contains(cell)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::{frames, recording, sample};

    #[test]
    fn the_set_sees_and_detects_what_any_of_them_does() {
        // the second sensor's frames lie 40 ms before the first one's
        let mut both = [recording(3, 3), recording(3, 3)];
        both[1].frames.iter_mut().for_each(|f| f.time_ns -= 40_000_000);
        let mut first = frames((0..3).map(|_| vec![sample(0, 40.0, false, false), sample(1, 60.0, true, true)]));
        let mut second = frames((0..3).map(|_| vec![sample(0, 40.0, true, true), sample(2, 90.0, false, false)]));
        first.iter_mut().for_each(|f| f.cells = vec![((20, 9), false), ((21, 9), true)]);
        second.iter_mut().for_each(|f| f.cells = vec![((20, 9), true), ((22, 9), false)]);
        first[0].counted = false;
        let samples = vec![first, second];
        let set = union(&both, &samples);
        assert!(!set[0].counted && set[1].counted);
        let objects: Vec<(usize, bool, bool)> =
            set[1].objects.iter().map(|o| (o.track, o.detected, o.slice_in_sight)).collect();
        assert_eq!(objects, [(0, true, true), (1, true, true), (2, false, false)]);
        assert_eq!(set[1].cells, [((20, 9), true), ((21, 9), true), ((22, 9), false)]);
        let mut shown = [Shown::default(); 3];
        count(&mut shown, &both, &samples, &set);
        let counts = shown.map(|s| [s.objects, s.detected, s.added, s.in_sight]);
        assert_eq!(counts, [[6, 2, 2, 2], [6, 2, 2, 2], [6, 4, 0, 4]]);
        // a camera that stopped long ago says nothing any more
        assert_eq!(newest(&both[1], 10_000_000_000), None);
    }
}
