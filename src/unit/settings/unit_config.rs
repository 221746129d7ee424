//! What an integrator sets of a unit beside its sensor and its place: numbers, rates, delays, whether it learns lanes.

use crate::inputs::ars408::configuration::Ars408Configuration;
use crate::obstacles::learnt_lanes;
use crate::sensor::config::{ConfigError, within};

/// What a unit does about the settings of its radar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum ConfigureRadar {
    /// Nothing is sent to it.
    #[default]
    No,
    /// It is set to send clusters until it reads that back, and told twenty times a second that it stands.
    Clusters,
    /// The same with objects.
    Objects,
}

impl ConfigureRadar {
    /// Of the number in a block.
    pub const fn from_number(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::No),
            1 => Some(Self::Clusters),
            2 => Some(Self::Objects),
            _ => None,
        }
    }

    /// The settings that are sent; none for [`No`](Self::No).
    pub const fn settings(self) -> Option<Ars408Configuration> {
        match self {
            Self::No => None,
            Self::Clusters => Some(Ars408Configuration::CLUSTERS),
            Self::Objects => Some(Ars408Configuration::OBJECTS),
        }
    }
}

/// Numbers and rates of a unit on a controller of its own. The daemon on Linux has these in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct UnitConfig {
    /// Number of this sensor among those that broadcast, 0 to 7; its native scans carry the same.
    pub sensor: u8,
    /// The radar's own number on its bus, as an ARS408 is set to, 0 to 7.
    pub radar_id: u8,
    /// Greatest age at which a receiver takes a message of a map, milliseconds; as it is set at the receivers.
    pub max_delay_ms: u16,
    /// Bit rate of the serial line, from [`SERVICE_S`](Self::SERVICE_S) after the start on.
    pub serial_baud: u32,
    /// Whether an ARS408 is configured over its bus.
    pub configure_radar: ConfigureRadar,
    /// Whether what usually stands in the view tells that the radar is in order; by firmware with the feature `monitoring`.
    pub supervise: bool,
    /// Whether the unit learns (`src/obstacles/learnt_lanes.rs`) which way traffic goes; by firmware with the feature `learning`.
    pub learn_lanes: bool,
}

impl Default for UnitConfig {
    fn default() -> Self {
        Self {
            sensor: 0,
            radar_id: 0,
            max_delay_ms: 100,
            serial_baud: Self::SERVICE_BAUD,
            configure_radar: ConfigureRadar::No,
            supervise: false,
            learn_lanes: false,
        }
    }
}

impl UnitConfig {
    /// Bit rate of the serial line at every start: a wrong one in a block locks nobody out.
    pub const SERVICE_BAUD: u32 = 115_200;

    /// How long the line has that bit rate after a start, seconds; longer, until the next start, if a request comes.
    pub const SERVICE_S: u8 = 2;

    /// What a map needs of the greatest delay for its last frames to leave the mailboxes while the next one is made.
    const IN_MAILBOXES_MS: u16 = 20;

    /// Age at which a map is not handed to the drivers any more, milliseconds.
    pub const fn stale_ms(&self) -> u16 {
        self.max_delay_ms.saturating_sub(Self::IN_MAILBOXES_MS)
    }

    /// Checks the figures.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_precision_loss)] // bit rates are small
    pub fn check(&self) -> Result<(), ConfigError> {
        within("unit.sensor", f32::from(self.sensor), 0.0, 7.0)?;
        within("unit.radar_id", f32::from(self.radar_id), 0.0, 7.0)?;
        within("unit.max_delay_ms", f32::from(self.max_delay_ms), 40.0, 500.0)?;
        within("unit.serial_baud", self.serial_baud as f32, 57_600.0, 1_000_000.0)?;
        let most = if cfg!(feature = "monitoring") { 1.0 } else { 0.0 };
        within("unit.supervise", f32::from(u8::from(self.supervise)), 0.0, most)?;
        let most = if learnt_lanes::ROOM { 1.0 } else { 0.0 };
        within("unit.learn_lanes", f32::from(u8::from(self.learn_lanes)), 0.0, most).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_stale_20_ms_before_receivers_refuse_it() {
        assert_eq!(UnitConfig::default().stale_ms(), 80);
        assert_eq!(UnitConfig { max_delay_ms: 60, ..UnitConfig::default() }.stale_ms(), 40);
    }
}
