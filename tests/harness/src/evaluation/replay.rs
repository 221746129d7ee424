//! One recording through every estimator: samples, scores and their summary.

use rayon::prelude::*;

use super::Options;
use super::rejected;
use super::samples::{self, FrameSamples};
use super::score::{Score, score};
use super::summary::Summary;
use crate::estimators::Estimator;
use crate::recording::Recording;

/// Everything that replaying a recording gives; what pictures, tables and files are made of.
#[derive(Debug)]
pub struct Replay {
    pub recording: Recording,
    pub samples: Vec<FrameSamples>,
    /// The estimators' scores, in the order of the table, without the bounds.
    pub scores: Vec<Score>,
    pub summary: Summary,
}

impl Replay {
    /// Runs estimators over a recording. `progress` is called after each of [`steps`].
    pub fn new(
        mut recording: Recording,
        estimators: &mut [Box<dyn Estimator>],
        options: &Options,
        progress: &(dyn Fn() + Sync),
    ) -> Self {
        let samples = samples::collect(&recording, options, progress);
        let scores: Vec<Score> = estimators
            .par_iter_mut()
            .map(|e| score(e.as_mut(), &recording, &samples, options.grid, &|| progress()))
            .collect();
        rejected::report(&mut recording, &scores);
        let summary = Summary::new(&recording, &samples, &scores, options);
        Self { recording, samples, scores, summary }
    }

    pub fn score(&self, name: &str) -> Option<&Score> {
        self.scores.iter().find(|s| s.name == name)
    }
}

/// Steps that `progress` will be told of: each frame once for the samples and once an estimator.
pub fn steps(recording: &Recording, estimators: usize) -> u64 {
    let passes = estimators + usize::from(recording.truth.is_some());
    (recording.frames.len() * passes) as u64
}

/// Runs a fresh estimator up to the last of `frames`, and shows it to `visit` at each of them.
pub fn visit(
    recording: &Recording,
    estimator: &mut dyn Estimator,
    frames: &[usize],
    mut visit: impl FnMut(usize, &dyn Estimator),
) {
    let end = frames.iter().max().map_or(0, |last| last + 1);
    for (k, frame) in recording.frames.iter().enumerate().take(end) {
        if recording.sensor.frames_independent {
            estimator.reset();
        }
        estimator.step(frame);
        if frames.contains(&k) {
            visit(k, estimator);
        }
    }
}
