//! What a sensor says of itself, once a second.

use super::configuration::{Ars408Configuration, Order, Output, Power};
use super::message::Message;
use crate::inputs::signal::{Signal, word};

/// Fields of the state message.
pub mod field {
    use super::Signal;

    /// Stored settings were read at the start.
    pub const STORED_READ: Signal = Signal::new(6, 1);
    /// Settings were stored.
    pub const STORED_WRITTEN: Signal = Signal::new(7, 1);
    /// Farthest distance, 2 m.
    pub const MAX_DISTANCE: Signal = Signal::new(15, 10);
    /// Supply voltage out of range.
    pub const VOLTAGE: Signal = Signal::new(17, 1);
    /// An error that may pass.
    pub const TEMPORARY: Signal = Signal::new(18, 1);
    /// Temperature out of range.
    pub const TEMPERATURE: Signal = Signal::new(19, 1);
    /// Another radar disturbs this one.
    pub const INTERFERENCE: Signal = Signal::new(20, 1);
    /// An error that stays.
    pub const PERSISTENT: Signal = Signal::new(21, 1);
    /// Transmitted power.
    pub const POWER: Signal = Signal::new(25, 3);
    /// Sensor id.
    pub const SENSOR_ID: Signal = Signal::new(34, 3);
    /// Order of the entries.
    pub const ORDER: Signal = Signal::new(38, 3);
    /// Relay output.
    pub const RELAY: Signal = Signal::new(41, 1);
    /// What is sent.
    pub const OUTPUT: Signal = Signal::new(43, 2);
    /// Quality messages.
    pub const QUALITY: Signal = Signal::new(44, 1);
    /// Extended messages.
    pub const EXTENDED: Signal = Signal::new(45, 1);
    /// What of speed and yaw rate is missing.
    pub const MOTION: Signal = Signal::new(47, 2);
    /// Detection threshold; in byte 7, not byte 5 as some drivers have it.
    pub const THRESHOLD: Signal = Signal::new(60, 3);
}

/// Fields of the version message.
pub mod version {
    use super::Signal;

    /// Major release.
    pub const MAJOR: Signal = Signal::new(7, 8);
    /// Minor release.
    pub const MINOR: Signal = Signal::new(15, 8);
    /// Patch level.
    pub const PATCH: Signal = Signal::new(23, 8);
    /// Radio rules of another country.
    pub const COUNTRY: Signal = Signal::new(24, 1);
    /// The range is extended.
    pub const EXTENDED_RANGE: Signal = Signal::new(25, 1);
}

/// A sensor's faults and settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RadarState {
    /// Farthest distance, metres.
    pub max_distance_m: u16,
    /// Sensor id.
    pub sensor_id: u8,
    /// What is sent; `None` for a number without a meaning.
    pub output: Option<Output>,
    /// Transmitted power.
    pub power: Option<Power>,
    /// Order of the entries.
    pub order: Option<Order>,
    /// Quality messages are sent.
    pub quality: bool,
    /// Extended messages of objects are sent.
    pub extended: bool,
    /// Weak targets are wanted.
    pub high_sensitivity: bool,
    /// The relay output may be switched.
    pub relay: bool,
    /// No speed is received.
    pub speed_missing: bool,
    /// No yaw rate is received.
    pub yaw_rate_missing: bool,
    /// Settings were stored.
    pub stored: bool,
    /// Supply voltage out of range.
    pub voltage_error: bool,
    /// Temperature out of range.
    pub temperature_error: bool,
    /// An error that may pass.
    pub temporary_error: bool,
    /// An error that stays.
    pub persistent_error: bool,
    /// Another radar disturbs this one.
    pub interference: bool,
}

/// A setting that did not take effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Disagreement {
    /// Farthest distance.
    MaxDistance,
    /// Sensor id.
    SensorId,
    /// What is sent.
    Output,
    /// Transmitted power.
    Power,
    /// Order of the entries.
    Order,
    /// Quality messages.
    Quality,
    /// Extended messages.
    Extended,
    /// Detection threshold.
    HighSensitivity,
    /// Relay output.
    Relay,
}

impl RadarState {
    /// Reads the message's data; `None` if it is too short.
    #[allow(clippy::cast_possible_truncation)] // 11 and 3 bits
    pub fn read(data: &[u8]) -> Option<Self> {
        if data.len() < Message::RadarState.length() {
            return None;
        }
        let word = word(data);
        let flag = |signal: Signal| signal.get(word) != 0;
        let motion = field::MOTION.get(word);
        Some(Self {
            max_distance_m: 2 * field::MAX_DISTANCE.get(word) as u16,
            sensor_id: field::SENSOR_ID.get(word) as u8,
            output: match field::OUTPUT.get(word) {
                0 => Some(Output::Nothing),
                1 => Some(Output::Objects),
                2 => Some(Output::Clusters),
                _ => None,
            },
            power: match field::POWER.get(word) {
                0 => Some(Power::Standard),
                1 => Some(Power::Minus3Db),
                2 => Some(Power::Minus6Db),
                3 => Some(Power::Minus9Db),
                _ => None,
            },
            order: match field::ORDER.get(word) {
                0 => Some(Order::Any),
                1 => Some(Order::Range),
                2 => Some(Order::Rcs),
                _ => None,
            },
            quality: flag(field::QUALITY),
            extended: flag(field::EXTENDED),
            high_sensitivity: field::THRESHOLD.get(word) == 1,
            relay: flag(field::RELAY),
            speed_missing: motion & 1 != 0,
            yaw_rate_missing: motion & 2 != 0,
            stored: flag(field::STORED_WRITTEN),
            voltage_error: flag(field::VOLTAGE),
            temperature_error: flag(field::TEMPERATURE),
            temporary_error: flag(field::TEMPORARY),
            persistent_error: flag(field::PERSISTENT),
            interference: flag(field::INTERFERENCE),
        })
    }

    /// Whether its measurements cannot be relied on. Interference and missing speeds are no such fault.
    pub const fn fault(&self) -> bool {
        self.voltage_error || self.temperature_error || self.temporary_error || self.persistent_error
    }

    /// The first setting asked for that this state does not have.
    pub fn disagreement(&self, asked: &Ars408Configuration) -> Option<Disagreement> {
        let differs = [
            (asked.max_distance_m.is_some_and(|m| m & !1 != self.max_distance_m), Disagreement::MaxDistance),
            (asked.sensor_id.is_some_and(|id| id != self.sensor_id), Disagreement::SensorId),
            (asked.output.is_some() && asked.output != self.output, Disagreement::Output),
            (asked.power.is_some() && asked.power != self.power, Disagreement::Power),
            (asked.order.is_some() && asked.order != self.order, Disagreement::Order),
            (asked.quality.is_some_and(|q| q != self.quality), Disagreement::Quality),
            (asked.extended.is_some_and(|e| e != self.extended), Disagreement::Extended),
            (asked.high_sensitivity.is_some_and(|h| h != self.high_sensitivity), Disagreement::HighSensitivity),
            (asked.relay.is_some_and(|r| r != self.relay), Disagreement::Relay),
        ];
        differs.into_iter().find(|(differs, _)| *differs).map(|(_, what)| what)
    }
}

/// A sensor's software.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Version {
    /// Major release, minor release, patch level.
    pub release: [u8; 3],
    /// The range is extended.
    pub extended_range: bool,
}

impl Version {
    /// Reads the message's data; `None` if it is too short.
    pub fn read(data: &[u8]) -> Option<Self> {
        let &[major, minor, patch, ..] = data else { return None };
        let long_enough = data.len() >= Message::Version.length();
        long_enough.then(|| Self {
            release: [major, minor, patch],
            extended_range: version::EXTENDED_RANGE.get(word(data)) != 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Object mode with quality and extended messages, near ones first, 250 m.
    const OBJECTS: [u8; 8] = [0x40, 0x1F, 0x40, 0x00, 0x10, 0x34, 0x00, 0x00];

    #[test]
    fn settings_have_their_places() {
        let state = RadarState::read(&OBJECTS).unwrap();
        assert_eq!((state.max_distance_m, state.sensor_id, state.output), (250, 0, Some(Output::Objects)));
        assert_eq!((state.power, state.order), (Some(Power::Standard), Some(Order::Range)));
        assert!(state.quality && state.extended && !state.relay && !state.stored && !state.high_sensitivity);
        assert!(!state.fault() && !state.speed_missing && !state.yaw_rate_missing);
        let other = RadarState::read(&[0x80, 0, 0, 0x01, 0xA3, 0xCA, 0, 0x04]).unwrap();
        assert_eq!((other.sensor_id, other.order, other.output), (3, Some(Order::Rcs), Some(Output::Clusters)));
        assert_eq!(other.power, Some(Power::Minus9Db), "across two bytes");
        assert!(other.relay && other.stored && other.high_sensitivity, "the threshold lies in byte 7");
        assert!(other.speed_missing && other.yaw_rate_missing);
        assert_eq!(RadarState::read(&OBJECTS[..7]), None);
    }

    #[test]
    fn every_fault_has_its_bit_and_interference_is_none() {
        let with = |byte2| RadarState::read(&[0, 0, byte2, 0, 0, 0, 0, 0]).unwrap();
        assert!(with(0x02).voltage_error && with(0x04).temporary_error);
        assert!(with(0x08).temperature_error && with(0x20).persistent_error);
        for byte2 in [0x02, 0x04, 0x08, 0x20] {
            assert!(with(byte2).fault());
        }
        assert!(with(0x10).interference && !with(0x10).fault());
    }

    #[test]
    fn what_was_asked_for_is_compared_with_what_is() {
        let state = RadarState::read(&OBJECTS).unwrap();
        let asked =
            Ars408Configuration { max_distance_m: Some(251), output: Some(Output::Objects), ..Default::default() };
        assert_eq!(state.disagreement(&asked), None, "distances come in steps of 2 m");
        assert_eq!(state.disagreement(&Ars408Configuration::CLUSTERS), Some(Disagreement::Output));
        let far = Ars408Configuration { max_distance_m: Some(196), ..asked };
        assert_eq!(state.disagreement(&far), Some(Disagreement::MaxDistance));
        let other = Ars408Configuration { sensor_id: Some(1), ..Default::default() };
        assert_eq!(state.disagreement(&other), Some(Disagreement::SensorId));
    }

    #[test]
    fn a_version_is_three_numbers() {
        let version = Version::read(&[4, 30, 1, 0]).unwrap();
        assert_eq!((version.release, version.extended_range), ([4, 30, 1], false));
        assert!(Version::read(&[4, 30, 1, 2, 0, 0, 0, 0]).unwrap().extended_range);
        assert_eq!(Version::read(&[4, 30, 1]), None);
    }
}
