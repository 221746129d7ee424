//! An ARS408's CAN frames in; may a vehicle rely on the sensor at a place of the road? Without a heap.
#![no_std]

use viewshed::query::{self, Answer, Footprint};
use viewshed::small::{Map, Parameters, State};
use viewshed::{Ars408, Ars408Config, CanFrame, ConfigError, Feed, Radar3dConfig, Radar3dParameters, RoadPoint};
use viewshed::{Sensor, Time};

/// One radar's unit: 65 kB of state, on a controller in a `static`.
pub struct Guard {
    parameters: Parameters,
    radar: Ars408<176>,
    state: State,
    map: Map,
}

impl Guard {
    /// Of a sensor as it is installed; an error names the parameter.
    pub fn new(sensor: &Sensor) -> Result<Self, ConfigError> {
        let parameters: Parameters = Radar3dParameters::new(sensor, &Radar3dConfig::default())?;
        let (state, map) = (State::new(), parameters.map());
        Ok(Self { parameters, radar: Ars408::new(Ars408Config::sensor(0)), state, map })
    }

    /// Takes a frame of the bus.
    pub fn take(&mut self, frame: &CanFrame, now: Time) {
        let Self { parameters, radar, state, map } = self;
        radar.take(frame, now, &mut |scan| {
            state.process(parameters, scan.measured, scan.input, scan.status, map);
        });
    }

    /// Whether a car's length of road is seen and free; after half a second of silence nothing is.
    pub fn is_free(&mut self, place: RoadPoint, now: Time) -> Result<bool, ConfigError> {
        self.state.expire(&self.parameters, now, &mut self.map);
        let car = Footprint::new(place, 0.0, 4.6, 1.8)?;
        Ok(query::area(&self.map, &car) == Answer::VisibleFree)
    }
}
