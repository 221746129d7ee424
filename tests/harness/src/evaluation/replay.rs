//! One recording through every estimator: samples, scores and their summary.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use anyhow::Result;
use rayon::prelude::*;

use super::Options;
use super::camera;
use super::samples::{self, FrameSamples};
use super::score::{Score, score};
use super::summary::Summary;
use super::unlabelled;
use crate::estimators::{self, Estimator};
use crate::recording::Recording;
use crate::recording::camera::INFO_TOPIC;

/// Everything that replaying a recording gives; what pictures, tables and files are made of.
#[derive(Debug)]
pub struct Replay {
    pub recording: Recording,
    pub samples: Vec<FrameSamples>,
    /// The estimators' scores, in the order of the table, without the bounds.
    pub scores: Vec<Score>,
    pub summary: Summary,
    /// The same of a camera beside the radar.
    pub camera: Option<Box<Replay>>,
}

impl Replay {
    /// Runs estimators over a recording; of an unlabelled one there are no samples. `progress` is called after each of
    /// [`steps`].
    pub fn new(
        recording: Recording,
        estimators: &mut [Box<dyn Estimator>],
        options: &Options,
        progress: &(dyn Fn() + Sync),
    ) -> Self {
        if recording.truth.is_none() {
            return Self::unlabelled(recording, estimators, options, progress);
        }
        let samples = samples::collect(&recording, options, progress);
        let scores: Vec<Score> = estimators
            .par_iter_mut()
            .map(|e| score(e.as_mut(), &recording, &samples, options.grid, &|| progress()))
            .collect();
        let summary = Summary::new(&recording, &samples, &scores, options);
        Self { recording, samples, scores, summary, camera: None }
    }

    fn unlabelled(
        recording: Recording,
        estimators: &mut [Box<dyn Estimator>],
        options: &Options,
        progress: &(dyn Fn() + Sync),
    ) -> Self {
        let (scores, summary) = unlabelled::judge(&recording, estimators, options, progress);
        Self { recording, samples: Vec::new(), scores, summary, camera: None }
    }

    /// Adds the recording's camera, if it has one. A camera that cannot be worked with is reported as a problem of the
    /// input. `progress` is called after each of [`camera_steps`].
    pub fn add_camera(&mut self, estimators: &estimators::Options, options: &Options, progress: &(dyn Fn() + Sync)) {
        let config = &estimators.camera_3d;
        let Some(recording) = camera::recording(&self.recording, f64::from(config.range_max_m)) else { return };
        match Self::of_camera(recording, estimators, options, progress) {
            Ok(camera) => self.camera = Some(Box::new(camera)),
            Err(error) => {
                let first = self.recording.start_ns();
                self.recording.problems.add(INFO_TOPIC, format!("boxes left out: {error:#}"), first);
            }
        }
    }

    /// Runs the camera's estimators over its own recording. `progress` is called after each of [`steps`].
    ///
    /// # Errors
    /// A camera that cannot be worked with.
    pub fn of_camera(
        mut recording: Recording,
        estimators: &estimators::Options,
        options: &Options,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let config = &estimators.camera_3d;
        recording.sensor.field_of_view.range_m[1] = f64::from(config.range_max_m);
        let mut running = estimators::all(&recording, estimators)?;
        if recording.truth.is_none() {
            return Ok(Self::unlabelled(recording, &mut running, options, progress));
        }
        let samples = camera::samples(&recording, f64::from(config.visible_share), options, 1, progress);
        let scores: Vec<Score> = running
            .par_iter_mut()
            .map(|e| score(e.as_mut(), &recording, &samples, options.grid, &|| progress()))
            .collect();
        let summary = Summary::new(&recording, &samples, &scores, options);
        Ok(Self { recording, samples, scores, summary, camera: None })
    }

    pub fn score(&self, name: &str) -> Option<&Score> {
        self.scores.iter().find(|s| s.name == name)
    }

    /// Whether an estimator called a track visible at a frame, and whether it was detected; `None` where it is not counted.
    pub fn judged(&self, estimator: &str, frame: usize, track: usize) -> Option<(bool, bool)> {
        let samples = self.samples.get(frame)?;
        let index = samples.objects.iter().position(|s| s.track == track)?;
        let verdict = self.score(estimator)?.verdicts.get(frame)?.get(index)?;
        Some((verdict.visible, samples.objects.get(index)?.detected))
    }
}

/// Steps that `progress` will be told of: each frame once for the samples and once an estimator.
pub fn steps(recording: &Recording, estimators: usize) -> u64 {
    let passes = estimators + usize::from(recording.truth.is_some());
    (recording.count() * passes) as u64
}

/// Calls of `progress` by [`Replay::add_camera`]: each of the camera's frames for the samples, and for each of its
/// two estimators.
pub fn camera_steps(recording: &Recording) -> u64 {
    let passes = if recording.truth.is_some() { 3 } else { 1 };
    recording.camera.as_ref().map_or(0, |camera| camera.frames.len() as u64 * passes)
}

/// Runs fresh estimators up to the last of `frames`, and shows each to `visit` at each of these, by the numbers of both.
pub fn visit(
    recording: &Recording,
    estimators: &mut [Box<dyn Estimator>],
    frames: &[usize],
    mut visit: impl FnMut(usize, usize, &dyn Estimator),
) {
    let end = frames.iter().max().map_or(0, |last| last + 1);
    let wanted: BTreeSet<usize> = frames.iter().copied().collect();
    let independent = recording.sensor.frames_independent;
    let mut begin = 0;
    recording.all().parts(&mut |part| {
        let mut rest = part.get(..end - begin).unwrap_or(part);
        while !rest.is_empty() {
            let next = wanted.range(begin..).next().map_or(rest.len(), |next| (next + 1 - begin).min(rest.len()));
            let (now, later) = rest.split_at(next);
            estimators.par_iter_mut().for_each(|estimator| {
                for frame in now {
                    if independent {
                        estimator.reset();
                    }
                    estimator.step(frame);
                }
            });
            (begin, rest) = (begin + next, later);
            if wanted.contains(&(begin - 1)) {
                estimators.iter().enumerate().for_each(|(k, estimator)| visit(begin - 1, k, estimator.as_ref()));
            }
        }
        if begin < end { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
}
