//! An ARS408's CAN frames in; may a vehicle rely on the sensor at a place of the road? Without a heap.

use viewshed::query::{self, Answer, Footprint};
use viewshed::{Ars408Config, CanFrame, ConfigError, Feed, Radar3dConfig, RoadPoint, Sensor, Time, small};

/// One radar's unit. What it borrows is too large for a controller's stack, and lies in a `static` each.
pub struct Guard<'a> {
    /// The decoder, with room for as many detections as the grid takes.
    input: &'a mut small::Ars408,
    radar: &'a mut small::Radar,
    /// Whether all of the last scan came.
    complete: bool,
}

impl<'a> Guard<'a> {
    /// A decoder of sensor 0, before its first frame.
    pub const INPUT: small::Ars408 = small::Ars408::new(Ars408Config::sensor(0));

    /// Begins with a sensor as it is installed; an error names the parameter.
    pub fn start(
        input: &'a mut small::Ars408,
        radar: &'a mut small::Radar,
        sensor: &Sensor,
    ) -> Result<Self, ConfigError> {
        radar.start(sensor, &Radar3dConfig::default())?;
        Ok(Self { input, radar, complete: false })
    }

    /// Takes a frame of the bus.
    pub fn take(&mut self, frame: &CanFrame, now: Time) {
        let Self { input, radar, complete } = self;
        input.take(frame, now, &mut |scan| {
            radar.report(scan.measured, scan.input, scan.status);
            *complete = !scan.incomplete;
        });
    }

    /// Whether a car's length of road is seen and free; after half a second of silence nothing is, and nothing while
    /// parts of the last scan are missing.
    pub fn is_free(&mut self, place: RoadPoint, now: Time) -> Result<bool, ConfigError> {
        let car = Footprint::new(place, 0.0, 4.6, 1.8)?;
        self.radar.expire(now);
        Ok(self.complete && query::area(self.radar.map(), &car) == Answer::VisibleFree)
    }
}
