//! A vehicle that receives one sensor's maps over CAN, and asks them about the road ahead.

use viewshed::query::{self, Answer, Footprint};
use viewshed::{Addresses, CanFrame, ConfigError, ReceiverLimits, RoadPoint, Time, small};

/// Sensor 0 of this bus.
pub struct Vehicle {
    receiver: small::Receiver,
}

impl Default for Vehicle {
    fn default() -> Self {
        Self { receiver: small::Receiver::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT) }
    }
}

impl Vehicle {
    /// Takes a frame of the bus; others' frames are left alone, and damaged ones are refused and counted.
    pub fn take(&mut self, frame: &CanFrame, now: Time) {
        let _ = self.receiver.frame(now, frame);
    }

    /// Whether the sensor sees all of a car's length of road at this place, along the road: then who is there is among what it
    /// reports. Hidden, unknown, and maps that are too old or that nobody sends, are all a no.
    pub fn is_seen(&self, place: RoadPoint, now: Time) -> Result<bool, ConfigError> {
        let car = Footprint::new(place, 0.0, 4.6, 1.8)?;
        let answer = query::area(&self.receiver.map(0, now), &car);
        // what is occupied is not sent by default, so a receiver takes every cell for it
        Ok(matches!(answer, Answer::VisibleFree | Answer::VisibleOccupied))
    }
}
