//! A radar of your own on any microcontroller: its detections in, CAN frames with the map out.
//!
//! Fits a part with 128 kB: what is large lies in two `static`s, and nothing large is moved. On a controller:
//!
//! ```ignore
//! static RADAR: ConstStaticCell<small::Radar> = ConstStaticCell::new(small::Radar::new()); // zeros, so none of the flash
//! static SENDER: ConstStaticCell<Option<small::Sender>> = ConstStaticCell::new(None);
//! let mut own = OwnRadar { radar: RADAR.take(), sender: SENDER.take() };
//! ```

use viewshed::unit::state_of;
use viewshed::{
    Addresses, BroadcastConfig, CanFrame, Condition, ConfigError, Detection, Epoch, Medium, Radar3dConfig, Sensor,
    Time, small,
};

/// Estimator, map and sender.
pub struct OwnRadar<'a> {
    /// Before the start it knows no sensor, and its map is unknown.
    pub radar: &'a mut small::Radar,
    /// None before the start.
    pub sender: &'a mut Option<small::Sender>,
}

impl OwnRadar<'_> {
    /// Begins with a sensor as it is installed; an error names the parameter. `epoch` is one that was not used lately, from a
    /// counter kept over restarts or from noise.
    pub fn start(&mut self, sensor: &Sensor, epoch: Epoch, now: Time) -> Result<(), ConfigError> {
        let header = self.radar.start(sensor, &Radar3dConfig::default())?;
        let broadcast = BroadcastConfig::new(0, Medium::Can(Addresses::STANDARD));
        small::Sender::start(self.sender, broadcast, header, epoch, now)
    }

    /// Takes what the radar measured at this time, all of it: an empty frame is evidence of an empty road.
    /// [`Detection::new`] makes detections of metres and radians. `fault`: the radar says that something is wrong with it.
    pub fn frame(&mut self, measured: Time, detections: &[Detection], fault: bool) {
        let Some(report) = self.radar.report(measured, detections, fault) else { return };
        self.say(report.condition, fault);
        if let Some(sender) = self.sender {
            // a map that cannot be sent now is followed by the next
            let _ = sender.scan(measured, self.radar.map());
        }
    }

    /// The next frame for the bus, if one is due; to be asked until there is none, every few milliseconds.
    pub fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        // a radar that fell silent sees nothing
        let condition = self.radar.expire(now)?;
        if condition == Condition::Stale {
            self.say(condition, false);
        }
        self.sender.as_mut()?.next_frame(now)
    }

    /// What receivers are told of the unit.
    fn say(&mut self, condition: Condition, fault: bool) {
        if let Some(sender) = self.sender {
            let status = sender.status_mut();
            (status.state, status.reason) = state_of(condition, fault);
        }
    }
}
