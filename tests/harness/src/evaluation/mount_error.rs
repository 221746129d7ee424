//! How the rates move when the estimators are given a wrong mount.
//!
//! A wrong pitch or height makes silent errors: the map looks as good as ever. So every estimator is
//! run again with the mount off by a little each way, and scored against the samples of the true one.

use anyhow::{Result, ensure};
use rayon::prelude::*;
use serde::Serialize;

use super::Options;
use super::replay::Replay;
use super::score::score;
use super::summary::points;
use crate::estimators;
use crate::geometry::pose::SensorPose;
use crate::recording::Recording;

/// How far the mount is taken to be off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Extent {
    pub pitch_deg: f64,
    pub height_m: f64,
}

impl Default for Extent {
    fn default() -> Self {
        Self { pitch_deg: 0.5, height_m: 0.2 }
    }
}

impl Extent {
    /// Pitch up and down (positive: nose taken to be lower than it is), then height.
    pub fn errors(self) -> [Extent; 4] {
        let Self { pitch_deg, height_m } = self;
        [(pitch_deg, 0.0), (-pitch_deg, 0.0), (0.0, height_m), (0.0, -height_m)]
            .map(|(pitch_deg, height_m)| Self { pitch_deg, height_m })
    }
}

/// The rates under one wrong mount.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Mount as given to the estimators minus true mount.
    pub error: Extent,
    pub estimators: Vec<Moved>,
}

/// Rates of one estimator under a wrong mount, and how far they moved in points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    pub name: String,
    pub fvr: Option<f64>,
    pub fir: Option<f64>,
    pub cell_fvr: Option<f64>,
    pub cell_fir: Option<f64>,
    pub fvr_points: Option<f64>,
    pub fir_points: Option<f64>,
    pub cell_fvr_points: Option<f64>,
    pub cell_fir_points: Option<f64>,
}

/// The recording as someone would have it who measured the mount wrongly.
///
/// # Errors
/// A mount that would not be above the road.
pub fn misplaced(recording: &Recording, error: Extent) -> Result<Recording> {
    let pose = &recording.pose;
    let mut position = pose.position;
    position[2] += error.height_m;
    ensure!(
        position[2] > 0.0,
        "{}: a mount at {} m cannot be taken {} m lower; give less with --mount-error=PITCH,HEIGHT",
        recording.name,
        pose.position[2],
        -error.height_m
    );
    let pitch_rad = pose.pitch_rad() + error.pitch_deg.to_radians();
    let mut altered = recording.clone();
    altered.pose = SensorPose::new(position, pose.yaw_rad(), pitch_rad, pose.roll_rad());
    if let Some(camera) = altered.camera.as_mut().filter(|camera| camera.alone) {
        camera.pose = altered.pose;
    }
    Ok(altered)
}

/// Runs every estimator again under each error. `progress` is called after each frame of each estimator.
///
/// # Errors
/// A mount that would not be above the road, or that the estimators refuse.
pub fn sensitivity(
    replay: &Replay,
    extent: Extent,
    options: &Options,
    estimators: &estimators::Options,
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Sensitivity>> {
    extent.errors().into_iter().map(|error| under(replay, error, options, estimators, progress)).collect()
}

fn under(
    replay: &Replay,
    error: Extent,
    options: &Options,
    estimators: &estimators::Options,
    progress: &(dyn Fn() + Sync),
) -> Result<Sensitivity> {
    let altered = misplaced(&replay.recording, error)?;
    let mut running = estimators::all(&altered, estimators)?;
    let estimators = running
        .par_iter_mut()
        .map(|estimator| {
            let score = score(estimator.as_mut(), &altered, &replay.samples, options.grid, &|| progress());
            let (objects, cells) = (score.objects(&replay.samples), score.cell_counts());
            let right = replay.summary.row(&score.name);
            let counts = right.map(|r| r.counts).unwrap_or_default();
            Moved {
                fvr: objects.fvr(),
                fir: objects.fir(),
                cell_fvr: cells.fvr(),
                cell_fir: cells.fir(),
                fvr_points: points(objects.fvr(), counts.fvr()),
                fir_points: points(objects.fir(), counts.fir()),
                cell_fvr_points: points(cells.fvr(), right.and_then(|r| r.cell_fvr())),
                cell_fir_points: points(cells.fir(), right.and_then(|r| r.cell_fir())),
                name: score.name,
            }
        })
        .collect();
    Ok(Sensitivity { error, estimators })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_one_at_a_time_and_both_ways() {
        let errors = Extent { pitch_deg: 0.5, height_m: 0.2 }.errors();
        assert_eq!(errors.map(|e| e.pitch_deg), [0.5, -0.5, 0.0, 0.0]);
        assert_eq!(errors.map(|e| e.height_m), [0.0, 0.0, 0.2, -0.2]);
    }
}
