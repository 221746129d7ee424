//! An ARS408's CAN frames in; may a vehicle rely on the sensor at a place of the road? Without a heap.
#![no_std]

use viewshed::query::{self, Answer, Footprint};
use viewshed::small::{Map, Parameters, State};
use viewshed::{Ars408, Ars408Config, CanFrame, ConfigError, Feed, Radar3dConfig, Radar3dParameters, RoadPoint};
use viewshed::{Sensor, Time};

/// One radar's unit, too large for a controller's stack: it lies in a `static`.
pub struct Guard {
    parameters: Option<Parameters>,
    /// As many detections as the grid takes.
    radar: Ars408<{ State::DETECTIONS }>,
    state: State,
    map: Map,
    /// Whether all of the last scan came.
    complete: bool,
}

impl Guard {
    /// Of no radar yet.
    pub const NOWHERE: Self = Self {
        parameters: None,
        radar: Ars408::new(Ars408Config::sensor(0)),
        state: State::new(),
        map: Map::NOWHERE,
        complete: false,
    };

    /// Begins with a sensor as it is installed; an error names the parameter.
    pub fn start(&mut self, sensor: &Sensor) -> Result<(), ConfigError> {
        let parameters = self.parameters.insert(Radar3dParameters::new(sensor, &Radar3dConfig::default())?);
        self.state.reset();
        parameters.prepare(&mut self.map);
        Ok(())
    }

    /// Takes a frame of the bus.
    pub fn take(&mut self, frame: &CanFrame, now: Time) {
        let Self { parameters: Some(parameters), radar, state, map, complete } = self else { return };
        radar.take(frame, now, &mut |scan| {
            state.process(parameters, scan.measured, scan.input, scan.status, map);
            *complete = !scan.incomplete;
        });
    }

    /// Whether a car's length of road is seen and free; after half a second of silence nothing is, and nothing while
    /// parts of the last scan are missing.
    pub fn is_free(&mut self, place: RoadPoint, now: Time) -> Result<bool, ConfigError> {
        let car = Footprint::new(place, 0.0, 4.6, 1.8)?;
        let Some(parameters) = &self.parameters else { return Ok(false) };
        self.state.expire(parameters, now, &mut self.map);
        Ok(self.complete && query::area(&self.map, &car) == Answer::VisibleFree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries<const N: usize>(_: &Ars408<N>) -> usize {
        N
    }

    #[test]
    fn the_radars_list_is_as_long_as_the_grids() {
        static GUARD: Guard = Guard::NOWHERE;
        assert_eq!(entries(&GUARD.radar), State::DETECTIONS);
    }
}
