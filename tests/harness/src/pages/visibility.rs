//! What the recording's own unit thought visible at each frame, found beside the page's work.
//!
//! # Model
//! A map is one byte a polar cell, azimuth by azimuth from right to left, near cells first: 0 unknown, 1 invisible,
//! 2 visible, 3 visible and occupied.

use std::sync::Mutex;

use anyhow::Result;
use serde::Serialize;
use viewshed::map::Visibility;

use super::locked;
use crate::estimators::{self, Options};
use crate::recording::Recording;

/// Where the cells of the maps lie.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Cells {
    azimuths: usize,
    ranges: usize,
    /// From right to left, radians from the sensor's heading.
    azimuth_rad: [f64; 2],
    /// The first azimuth that is narrower than the others, the first behind them, how many times.
    narrow: [u8; 3],
    cell_m: f64,
}

/// The maps found so far, one a frame.
#[derive(Debug, Default)]
pub struct Maps(Mutex<(Option<Cells>, Vec<Vec<u8>>)>);

impl Maps {
    /// Runs the estimator from the first frame to the last.
    ///
    /// # Errors
    /// A parameter the library refuses, by name.
    pub fn fill(&self, recording: &Recording, options: &Options) -> Result<()> {
        let mut estimator = estimators::own(recording, options)?;
        for frame in &recording.frames {
            if recording.sensor.frames_independent {
                estimator.reset();
            }
            estimator.step(frame);
            let Some(polar) = estimator.polar() else { return Ok(()) };
            let cells = Cells {
                azimuths: polar.azimuths,
                ranges: polar.ranges,
                azimuth_rad: polar.azimuth_rad,
                narrow: polar.narrow,
                cell_m: polar.cell_m,
            };
            let state = |a, r| {
                let cell = (polar.cell)(a, r);
                match cell.visibility {
                    Visibility::Unknown => 0,
                    Visibility::Invisible => 1,
                    Visibility::Visible if cell.occupied => 3,
                    Visibility::Visible => 2,
                }
            };
            let map = (0..cells.azimuths).flat_map(|a| (0..cells.ranges).map(move |r| (a, r)));
            let map = map.map(|(a, r)| state(a, r)).collect();
            let mut found = locked(&self.0);
            found.0 = Some(cells);
            found.1.push(map);
        }
        Ok(())
    }

    /// The map at a frame; `None` while it is not found yet.
    pub fn at(&self, frame: usize) -> Option<(Cells, Vec<u8>)> {
        let found = locked(&self.0);
        Some((found.0?, found.1.get(frame)?.clone()))
    }
}
