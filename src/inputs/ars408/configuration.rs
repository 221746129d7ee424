//! What a sensor is to send, and limits on it.
//!
//! Settings take effect at once and are to be read back from
//! [`RadarState`](super::state::RadarState). Storing them for good wears the sensor's memory: a few
//! times in its life, never at every start.

use super::message::Message;
use crate::inputs::signal::Signal;
use crate::wire::frame::CanFrame;

/// Fields of the configuration message.
pub mod field {
    use super::Signal;

    /// Farthest distance, 2 m; each field has a bit that makes it count.
    pub const MAX_DISTANCE: Signal = Signal::new(15, 10);
    /// Makes it count.
    pub const MAX_DISTANCE_VALID: Signal = Signal::new(0, 1);
    /// Sensor id.
    pub const SENSOR_ID: Signal = Signal::new(34, 3);
    /// Makes it count.
    pub const SENSOR_ID_VALID: Signal = Signal::new(1, 1);
    /// Transmitted power.
    pub const POWER: Signal = Signal::new(39, 3);
    /// Makes it count.
    pub const POWER_VALID: Signal = Signal::new(2, 1);
    /// What is sent.
    pub const OUTPUT: Signal = Signal::new(36, 2);
    /// Makes it count.
    pub const OUTPUT_VALID: Signal = Signal::new(3, 1);
    /// Quality messages.
    pub const QUALITY: Signal = Signal::new(42, 1);
    /// Makes it count.
    pub const QUALITY_VALID: Signal = Signal::new(4, 1);
    /// Extended messages.
    pub const EXTENDED: Signal = Signal::new(43, 1);
    /// Makes it count.
    pub const EXTENDED_VALID: Signal = Signal::new(5, 1);
    /// Order of the entries.
    pub const ORDER: Signal = Signal::new(46, 3);
    /// Makes it count.
    pub const ORDER_VALID: Signal = Signal::new(6, 1);
    /// Store for good.
    pub const STORE: Signal = Signal::new(47, 1);
    /// Makes it count.
    pub const STORE_VALID: Signal = Signal::new(7, 1);
    /// Relay output.
    pub const RELAY: Signal = Signal::new(41, 1);
    /// Makes it count.
    pub const RELAY_VALID: Signal = Signal::new(40, 1);
    /// Detection threshold.
    pub const THRESHOLD: Signal = Signal::new(51, 3);
    /// Makes it count.
    pub const THRESHOLD_VALID: Signal = Signal::new(48, 1);
}

/// What a sensor sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Output {
    /// Nothing.
    Nothing,
    /// Objects it tracks.
    Objects,
    /// Clusters: single reflections, what the estimators want.
    Clusters,
}

/// In which order entries come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Order {
    /// None.
    Any,
    /// Near ones first.
    Range,
    /// Strong ones first.
    Rcs,
}

/// Transmitted power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Power {
    /// Full.
    Standard,
    /// Less by 3 dB.
    Minus3Db,
    /// Less by 6 dB.
    Minus6Db,
    /// Less by 9 dB.
    Minus9Db,
}

/// A change of a sensor's settings; what is `None` stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ars408Configuration {
    /// Farthest distance, metres, in steps of 2, up to 2046.
    pub max_distance_m: Option<u16>,
    /// New sensor id, 0 to 7.
    pub sensor_id: Option<u8>,
    /// What is sent.
    pub output: Option<Output>,
    /// Transmitted power.
    pub power: Option<Power>,
    /// Whether quality messages are sent.
    pub quality: Option<bool>,
    /// Whether extended messages of objects are sent.
    pub extended: Option<bool>,
    /// In which order.
    pub order: Option<Order>,
    /// Whether weak targets are wanted.
    pub high_sensitivity: Option<bool>,
    /// Whether the relay output may be switched.
    pub relay: Option<bool>,
    /// Whether all of this is stored for good. Rarely: it wears the memory.
    pub store: Option<bool>,
}

impl Ars408Configuration {
    /// Clusters with their quality, strong ones first, not stored.
    pub const CLUSTERS: Self = Self {
        max_distance_m: None,
        sensor_id: None,
        output: Some(Output::Clusters),
        power: None,
        quality: Some(true),
        extended: Some(false),
        order: Some(Order::Rcs),
        high_sensitivity: None,
        relay: None,
        store: None,
    };

    /// Objects with their quality, strong ones first, not stored.
    pub const OBJECTS: Self = Self { output: Some(Output::Objects), ..Self::CLUSTERS };

    /// The message's bytes.
    pub fn bytes(&self) -> [u8; 8] {
        let fields = [
            (field::MAX_DISTANCE, field::MAX_DISTANCE_VALID, self.max_distance_m.map(|m| u32::from(m / 2))),
            (field::SENSOR_ID, field::SENSOR_ID_VALID, self.sensor_id.map(u32::from)),
            (field::OUTPUT, field::OUTPUT_VALID, self.output.map(|o| o as u32)),
            (field::POWER, field::POWER_VALID, self.power.map(|p| p as u32)),
            (field::QUALITY, field::QUALITY_VALID, self.quality.map(u32::from)),
            (field::EXTENDED, field::EXTENDED_VALID, self.extended.map(u32::from)),
            (field::ORDER, field::ORDER_VALID, self.order.map(|o| o as u32)),
            (field::THRESHOLD, field::THRESHOLD_VALID, self.high_sensitivity.map(u32::from)),
            (field::RELAY, field::RELAY_VALID, self.relay.map(u32::from)),
            (field::STORE, field::STORE_VALID, self.store.map(u32::from)),
        ];
        let given = |word, (signal, valid, value): (Signal, Signal, Option<u32>)| match value {
            Some(value) => valid.put(signal.put(word, value), 1),
            None => word,
        };
        fields.into_iter().fold(0, given).to_be_bytes()
    }

    /// The frame for the sensor that has this id now; always there.
    pub fn frame(&self, sensor: u8) -> Option<CanFrame> {
        CanFrame::classic(Message::RadarConfiguration.id(sensor), &self.bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn objects_with_everything_stored_is_the_published_example() {
        let configuration = Ars408Configuration {
            output: Some(Output::Objects),
            quality: Some(true),
            extended: Some(true),
            order: Some(Order::Range),
            store: Some(true),
            ..Default::default()
        };
        assert_eq!(format!("{:?}", configuration.frame(0).unwrap()), "200#F8000000089C0000");
    }

    #[test]
    fn clusters_are_asked_for_without_wearing_the_memory() {
        assert_eq!(format!("{:?}", Ars408Configuration::CLUSTERS.frame(2).unwrap()), "220#7800000010240000");
    }

    #[test]
    fn every_field_has_its_place_and_its_bit() {
        let bytes = |c: Ars408Configuration| c.bytes();
        let none = Ars408Configuration::default();
        assert_eq!(bytes(none), [0; 8]);
        assert_eq!(bytes(Ars408Configuration { max_distance_m: Some(250), ..none }), [1, 0x1F, 0x40, 0, 0, 0, 0, 0]);
        assert_eq!(bytes(Ars408Configuration { sensor_id: Some(5), ..none }), [2, 0, 0, 0, 5, 0, 0, 0]);
        assert_eq!(bytes(Ars408Configuration { power: Some(Power::Minus9Db), ..none }), [4, 0, 0, 0, 0x60, 0, 0, 0]);
        assert_eq!(bytes(Ars408Configuration { relay: Some(true), ..none }), [0, 0, 0, 0, 0, 3, 0, 0]);
        assert_eq!(bytes(Ars408Configuration { high_sensitivity: Some(true), ..none }), [0, 0, 0, 0, 0, 0, 3, 0]);
        assert_eq!(bytes(Ars408Configuration { quality: Some(false), ..none }), [0x10, 0, 0, 0, 0, 0, 0, 0]);
    }
}
