//! `radar-3d` on the reference grid.

use anyhow::Result;
use viewshed::fixed::time::Time;
use viewshed::map::VisibilityMap;
use viewshed::map::polar::PolarMap;
use viewshed::radar_3d::{Radar3d, Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::unit::profile::reference::State;

use super::{Estimator, PolarCells};
use super::{Intake, MOST_DETECTIONS, polar_cells};
use crate::recording::Frame;

/// Range cells, azimuths and elevations of the reference grid.
pub const RANGES: usize = State::RANGES;
pub const AZIMUTHS: usize = State::AZIMUTHS;
pub const ELEVATIONS: usize = State::ELEVATIONS;

struct Driver<const D: usize> {
    parameters: Box<Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>>,
    state: Box<Radar3d<RANGES, AZIMUTHS, ELEVATIONS, { State::WORDS }, { State::OBSTACLES }, D>>,
    map: Box<PolarMap<RANGES, AZIMUTHS>>,
    intake: Intake,
}

/// The estimator; storage for 256 detections unless more are asked for.
pub fn new(sensor: &Sensor, config: &Radar3dConfig) -> Result<Box<dyn Estimator>> {
    if config.gate.max_detections <= 256 {
        Ok(Box::new(Driver::<256>::new(sensor, config)?))
    } else {
        Ok(Box::new(Driver::<MOST_DETECTIONS>::new(sensor, config)?))
    }
}

/// Runs the estimator over frames and shows its map after each, with the frame's time.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn maps(
    frames: &[Frame],
    sensor: &Sensor,
    config: &Radar3dConfig,
    mut visit: impl FnMut(Time, &PolarMap<RANGES, AZIMUTHS>),
) -> Result<()> {
    let mut driver = Driver::<256>::new(sensor, config)?;
    for frame in frames {
        driver.step(frame);
        visit(Time::from_micros(u64::try_from(frame.time_ns / 1000).unwrap_or(0)), &driver.map);
    }
    Ok(())
}

impl<const D: usize> Driver<D> {
    fn new(sensor: &Sensor, config: &Radar3dConfig) -> Result<Self> {
        let parameters = Box::new(Radar3dParameters::new(sensor, config)?);
        let map = Box::new(parameters.map());
        Ok(Self { parameters, state: Box::new(Radar3d::new()), map, intake: Intake::default() })
    }
}

impl<const D: usize> Estimator for Driver<D> {
    fn name(&self) -> &str {
        "radar-3d"
    }

    fn reset(&mut self) {
        self.state.reset();
        self.map.forget();
    }

    fn step(&mut self, frame: &Frame) {
        let (now, detections, status) = self.intake.take(frame);
        self.state.process(&self.parameters, now, detections, status, &mut self.map);
    }

    fn map(&self) -> &dyn VisibilityMap {
        &*self.map
    }

    fn polar(&self) -> Option<PolarCells<'_>> {
        Some(polar_cells(&self.map))
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        self.intake.counters(self.state.rejections())
    }
}
