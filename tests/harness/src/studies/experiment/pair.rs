//! Two sensors' recordings side by side.

use anyhow::{Context, Result};

use crate::estimators::{self, Estimator};
use crate::evaluation::Settings;
use crate::recording::Recording;

/// How old the newest frame of a sensor may be to count, ns.
const LATEST_NS: i64 = 150_000_000;

pub(super) fn estimator(recording: &Recording, settings: &Settings) -> Result<Box<dyn Estimator>> {
    let all = estimators::all(recording, &settings.estimators)?;
    let own = ["radar-3d", "camera-3d"];
    all.into_iter().find(|e| own.contains(&e.name())).context("no estimator for the sensor")
}

/// A sensor's newest frame at a time.
pub(super) fn newest(recording: &Recording, time_ns: i64) -> Option<usize> {
    let k = recording.frames.partition_point(|f| f.time_ns <= time_ns).checked_sub(1)?;
    (time_ns - recording.frames[k].time_ns <= LATEST_NS).then_some(k)
}
