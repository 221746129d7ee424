//! `radar-2d` and `radar-2d-first`: the two readings of the conventional grid.

use anyhow::Result;
use viewshed::frame::health::Condition;
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::radar_2d::{Radar2d, Radar2dConfig, Radar2dParameters, Radar2dReading};
use viewshed::sensor::Sensor;
use viewshed::sensor::road::RoadPoint;

use super::Estimator;
use super::{Intake, MOST_DETECTIONS};
use crate::recording::Frame;

/// Cells along the road, and words of eight cells across: any heading of a 250 m fan fits.
const CELLS: usize = 512;

/// Distance to which cells of the usual 1 m reach in any direction.
pub const MOST_RANGE_M: f64 = (CELLS / 2) as f64;

const WORDS: usize = 64;
/// 0.4 degrees over 120 degrees: 1.4 m at 200 m.
const RAYS: usize = 320;

struct Driver<const D: usize> {
    name: &'static str,
    reading: Radar2dReading,
    parameters: Radar2dParameters,
    state: Box<Radar2d<CELLS, WORDS, RAYS, D>>,
    intake: Intake,
    condition: Condition,
}

/// The estimator; storage for 256 detections unless more are asked for.
pub fn new(
    name: &'static str,
    reading: Radar2dReading,
    sensor: &Sensor,
    config: &Radar2dConfig,
) -> Result<Box<dyn Estimator>> {
    let parameters = Radar2dParameters::new::<CELLS, WORDS, RAYS>(sensor, config)?;
    let (intake, condition) = (Intake::default(), Condition::Starting);
    Ok(if config.gate.max_detections <= 256 {
        Box::new(Driver::<256> { name, reading, parameters, state: Box::default(), intake, condition })
    } else {
        let state: Box<Radar2d<CELLS, WORDS, RAYS, MOST_DETECTIONS>> = Box::default();
        Box::new(Driver { name, reading, parameters, state, intake, condition })
    })
}

impl<const D: usize> VisibilityMap for Driver<D> {
    fn at(&self, point: RoadPoint) -> CellState {
        self.state.map(&self.parameters, self.reading).at(point)
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        self.state.map(&self.parameters, self.reading).cells_in(area, visit);
    }
}

impl<const D: usize> Estimator for Driver<D> {
    fn name(&self) -> &str {
        self.name
    }

    fn reset(&mut self) {
        self.state.reset();
    }

    fn step(&mut self, frame: &Frame) {
        let (now, detections, status) = self.intake.take(frame);
        self.condition = self.state.process(&self.parameters, now, detections, status);
    }

    fn condition(&self) -> Condition {
        self.condition
    }

    fn map(&self) -> &dyn VisibilityMap {
        self
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        self.intake.counters(self.state.rejections())
    }
}
