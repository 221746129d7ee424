//! The messages and their identifiers.

use crate::wire::frame::CanId;

/// A message of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// To the sensor: what it is to send.
    RadarConfiguration,
    /// From it, once a second: how it is set, and its faults.
    RadarState,
    /// To the sensor: a limit on what it sends.
    FilterConfiguration,
    /// To the sensor: the speed of what carries it.
    Speed,
    /// To the sensor: its yaw rate.
    YawRate,
    /// A scan of clusters begins.
    ClusterStatus,
    /// A scan of objects begins.
    ObjectStatus,
    /// An object.
    ObjectGeneral,
    /// How far an object can be trusted.
    ObjectQuality,
    /// An object's class and size.
    ObjectExtended,
    /// The sensor's software, once a second.
    Version,
    /// A cluster.
    ClusterGeneral,
    /// How far a cluster can be trusted.
    ClusterQuality,
}

impl Message {
    /// All messages, by identifier.
    pub const ALL: [Self; 13] = [
        Self::RadarConfiguration,
        Self::RadarState,
        Self::FilterConfiguration,
        Self::Speed,
        Self::YawRate,
        Self::ClusterStatus,
        Self::ObjectStatus,
        Self::ObjectGeneral,
        Self::ObjectQuality,
        Self::ObjectExtended,
        Self::Version,
        Self::ClusterGeneral,
        Self::ClusterQuality,
    ];

    /// Identifier of sensor 0.
    pub const fn base(self) -> u16 {
        match self {
            Self::RadarConfiguration => 0x200,
            Self::RadarState => 0x201,
            Self::FilterConfiguration => 0x202,
            Self::Speed => 0x300,
            Self::YawRate => 0x301,
            Self::ClusterStatus => 0x600,
            Self::ObjectStatus => 0x60A,
            Self::ObjectGeneral => 0x60B,
            Self::ObjectQuality => 0x60C,
            Self::ObjectExtended => 0x60D,
            Self::Version => 0x700,
            Self::ClusterGeneral => 0x701,
            Self::ClusterQuality => 0x702,
        }
    }

    /// Bytes it has; longer ones are taken, as some gateways send all frames with 8.
    pub const fn length(self) -> usize {
        match self {
            Self::Speed | Self::YawRate => 2,
            Self::ObjectStatus | Self::Version => 4,
            Self::FilterConfiguration | Self::ClusterStatus | Self::ClusterQuality => 5,
            Self::ObjectQuality => 7,
            Self::RadarConfiguration
            | Self::RadarState
            | Self::ObjectGeneral
            | Self::ObjectExtended
            | Self::ClusterGeneral => 8,
        }
    }

    /// Whether the sensor sends it, rather than being sent it.
    pub const fn sent_by_sensor(self) -> bool {
        !matches!(self, Self::RadarConfiguration | Self::FilterConfiguration | Self::Speed | Self::YawRate)
    }

    /// Its name in the vendor's description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RadarConfiguration => "RadarConfiguration",
            Self::RadarState => "RadarState",
            Self::FilterConfiguration => "FilterCfg",
            Self::Speed => "SpeedInformation",
            Self::YawRate => "YawRateInformation",
            Self::ClusterStatus => "Cluster_0_Status",
            Self::ObjectStatus => "Obj_0_Status",
            Self::ObjectGeneral => "Obj_1_General",
            Self::ObjectQuality => "Obj_2_Quality",
            Self::ObjectExtended => "Obj_3_Extended",
            Self::Version => "VersionID",
            Self::ClusterGeneral => "Cluster_1_General",
            Self::ClusterQuality => "Cluster_2_Quality",
        }
    }

    /// The identifier for a sensor; only three bits of the sensor id count.
    pub const fn id(self, sensor: u8) -> CanId {
        CanId::Standard(self.base() | (sensor as u16 & 7) << 4)
    }

    /// Message and sensor id of an identifier.
    pub fn of(id: CanId) -> Option<(Self, u8)> {
        let CanId::Standard(raw) = id else { return None };
        #[allow(clippy::cast_possible_truncation)] // three bits
        let sensor = ((raw >> 4) & 7) as u8;
        Self::ALL.into_iter().find(|m| m.base() == raw & !0x70).map(|m| (m, sensor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sensor_id_lies_in_bits_4_to_6() {
        assert_eq!(Message::of(CanId::Standard(0x701)), Some((Message::ClusterGeneral, 0)));
        assert_eq!(Message::of(CanId::Standard(0x63B)), Some((Message::ObjectGeneral, 3)));
        assert_eq!(Message::of(CanId::Standard(0x270)), Some((Message::RadarConfiguration, 7)));
        assert_eq!(Message::of(CanId::Standard(0x68B)), None, "bit 7 is no part of it");
        assert_eq!(Message::of(CanId::Extended(0x701)), None);
        for message in Message::ALL {
            for sensor in 0..8 {
                assert_eq!(Message::of(message.id(sensor)), Some((message, sensor)));
            }
        }
    }
}
