//! What a controller has to send to a fixed sensor: its settings until they hold, and that it stands.

use super::configuration::Ars408Configuration;
use super::message::Message;
use super::motion::standing;
use super::state::RadarState;
use crate::fixed::time::Time;
use crate::wire::frame::CanFrame;

/// Speed and yaw rate are sent this often.
pub const MOTION_PERIOD_US: u64 = 50_000;

/// Settings that do not hold are sent again after this, so that a state message lies between.
pub const SETTINGS_PERIOD_US: u64 = 2_000_000;

/// Sends what a sensor wants, frame by frame.
///
/// Settings are compared with what the sensor reads back once a second and are sent again where
/// they differ, as after its restart; with [`store`](Ars408Configuration::store) only the first time,
/// as storing wears its memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ars408Upkeep {
    sensor: u8,
    settings: Ars408Configuration,
    holds: Option<bool>,
    /// When the settings were sent first.
    asked: Option<Time>,
    motion_at: Option<Time>,
    settings_at: Option<Time>,
    /// The yaw rate is still to follow the speed.
    yaw_rate_due: bool,
}

impl Ars408Upkeep {
    /// For the sensor of an id; the settings are not to change that id.
    pub const fn new(sensor: u8, settings: Ars408Configuration) -> Self {
        Self { sensor, settings, holds: None, asked: None, motion_at: None, settings_at: None, yaw_rate_due: false }
    }

    /// Takes a frame of the bus, of which only what the sensor says of itself counts.
    pub fn take(&mut self, frame: &CanFrame) {
        if frame.id == Message::RadarState.id(self.sensor)
            && let Some(state) = RadarState::read(frame.data())
        {
            self.state(&state);
        }
    }

    /// Takes note of what the sensor says of itself.
    pub fn state(&mut self, state: &RadarState) {
        self.holds = Some(state.disagreement(&self.settings).is_none());
    }

    /// Whether the sensor has read the settings back; until then its scans may be of another kind.
    pub fn holds(&self) -> bool {
        self.holds == Some(true)
    }

    /// Whether the sensor is known not to be as it is to be: it reads back other settings, or none for as long as
    /// they are given to hold.
    pub fn disagrees(&self, now: Time) -> bool {
        let waited = self.asked.and_then(|asked| now.since(asked)).is_some_and(|us| us >= SETTINGS_PERIOD_US);
        self.holds.map_or(waited, |holds| !holds)
    }

    /// The next frame to be sent, if one is due; to be called until there is none.
    pub fn poll(&mut self, now: Time) -> Option<CanFrame> {
        let [speed, yaw_rate] = {
            let mut frames = standing(self.sensor);
            [frames.next(), frames.next()]
        };
        if core::mem::take(&mut self.yaw_rate_due) {
            return yaw_rate;
        }
        if !self.holds() && due(self.settings_at, now, SETTINGS_PERIOD_US) {
            self.settings_at = Some(now);
            self.asked.get_or_insert(now);
            let frame = self.settings.frame(self.sensor);
            self.settings.store = None;
            return frame;
        }
        if due(self.motion_at, now, MOTION_PERIOD_US) {
            self.motion_at = Some(now);
            self.yaw_rate_due = true;
            return speed;
        }
        None
    }
}

/// Whether a period is over; at once where the clock stepped back.
fn due(last: Option<Time>, now: Time, period_us: u64) -> bool {
    last.and_then(|last| now.since(last)).is_none_or(|since| since >= period_us)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;
    use std::string::String;
    use std::vec::Vec;

    fn sent(upkeep: &mut Ars408Upkeep, ms: u64) -> Vec<String> {
        let now = Time::from_micros(1000 * ms);
        std::iter::from_fn(|| upkeep.poll(now)).map(|f| format!("{f:?}")).collect()
    }

    /// Clusters with quality, strong ones first, of sensor 2.
    const HOLDS: [u8; 8] = [0x40, 0x1F, 0x40, 0x00, 0x22, 0x18, 0x00, 0x00];

    #[test]
    fn a_sensor_is_told_its_settings_until_they_hold_and_always_that_it_stands() {
        let mut upkeep = Ars408Upkeep::new(2, Ars408Configuration::CLUSTERS);
        assert_eq!(sent(&mut upkeep, 0), ["220#7800000010240000", "320#0000", "321#8000"]);
        assert_eq!(sent(&mut upkeep, 49), [""; 0]);
        assert_eq!(sent(&mut upkeep, 50), ["320#0000", "321#8000"]);
        assert!(!upkeep.holds() && !upkeep.disagrees(Time::from_micros(1_999_999)));
        assert!(upkeep.disagrees(Time::from_micros(2_000_000)), "no answer is none");
        // nothing was read back
        assert_eq!(sent(&mut upkeep, 2000), ["220#7800000010240000", "320#0000", "321#8000"]);
        upkeep.state(&RadarState::read(&HOLDS).unwrap());
        assert!(upkeep.holds() && !upkeep.disagrees(Time::from_micros(5_000_000)));
        assert_eq!(sent(&mut upkeep, 5000), ["320#0000", "321#8000"]);
        // it started over and sends objects again
        let mut objects = HOLDS;
        objects[5] = 0x14;
        upkeep.state(&RadarState::read(&objects).unwrap());
        assert!(upkeep.disagrees(Time::from_micros(5_001_000)));
        assert_eq!(sent(&mut upkeep, 5001), ["220#7800000010240000"]);
    }

    #[test]
    fn settings_are_stored_once() {
        let settings = Ars408Configuration { store: Some(true), ..Ars408Configuration::CLUSTERS };
        let mut upkeep = Ars408Upkeep::new(2, settings);
        assert_eq!(sent(&mut upkeep, 0)[0], "220#F800000010A40000");
        assert_eq!(sent(&mut upkeep, 2000)[0], "220#7800000010240000");
    }

    #[test]
    fn a_clock_that_steps_back_stops_nothing() {
        let mut upkeep = Ars408Upkeep::new(0, Ars408Configuration::CLUSTERS);
        sent(&mut upkeep, 9000);
        assert_eq!(sent(&mut upkeep, 100).len(), 3);
    }
}
