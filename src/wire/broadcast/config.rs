//! What a sender is set to do, and its limits.

use crate::sensor::config::{ConfigError, Problem};
use crate::wire::message::{Addresses, Packing};
use crate::wire::scan_number::{MOST_AGE_US, MOST_DELAY_US};

/// What messages travel on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Medium {
    /// Classic CAN: frames of 8 bytes.
    Can(Addresses),
    /// CAN FD: frames of up to 64 bytes.
    CanFd(Addresses),
    /// A serial line.
    Serial,
}

impl Medium {
    /// How messages are packed for it.
    pub const fn packing(&self, secured: bool) -> Packing {
        match self {
            Self::Can(_) => Packing::Classic,
            Self::CanFd(_) | Self::Serial if secured => Packing::Secured,
            Self::CanFd(_) | Self::Serial => Packing::Long,
        }
    }
}

/// How a sender behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BroadcastConfig {
    /// The sensor's number, 0 to 7 with 11-bit identifiers.
    pub sensor: u8,
    /// What messages travel on.
    pub medium: Medium,
    /// Least time between two frames, microseconds.
    pub gap_us: u32,
    /// Age at which a map is not sent any more, milliseconds.
    pub stale_ms: u16,
    /// Greatest age of a map at its receivers, milliseconds.
    pub max_age_ms: u16,
    /// Greatest delay from measurement to reception, milliseconds.
    pub max_delay_ms: u16,
    /// Time between two status messages, milliseconds; at most 500.
    pub status_ms: u16,
    /// Time in which the whole header, and the freshness value, is sent once, milliseconds.
    pub header_ms: u16,
    /// Whether messages carry an authenticator; they are then taken by `Broadcaster::next_sealed`. Not on
    /// classic CAN, whose frames have no room for it.
    pub secured: bool,
    /// How many of the sender's planes are sent, 1 to 3.
    pub planes: u8,
    /// Time in which the visible range of all azimuths is sent once, milliseconds; `None` for never.
    pub visible_range_ms: Option<u16>,
}

impl BroadcastConfig {
    /// The defaults for a sensor.
    pub const fn new(sensor: u8, medium: Medium) -> Self {
        Self {
            sensor,
            medium,
            gap_us: 1000,
            stale_ms: 100,
            max_age_ms: 300,
            max_delay_ms: 100,
            status_ms: 250,
            header_ms: 490,
            secured: false,
            planes: 3,
            visible_range_ms: None,
        }
    }

    /// Checks it.
    ///
    /// # Errors
    /// Names the first parameter outside its limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        let most_sensor = match self.medium {
            Medium::Can(addresses) | Medium::CanFd(addresses) => addresses.most_sensor(),
            Medium::Serial => u8::MAX,
        };
        within("broadcast.sensor", u32::from(self.sensor), 0, u32::from(most_sensor))?;
        let most_secured = u32::from(!matches!(self.medium, Medium::Can(_)));
        within("broadcast.secured", u32::from(self.secured), 0, most_secured)?;
        within("broadcast.gap_us", self.gap_us, 0, 20_000)?;
        within("broadcast.stale_ms", u32::from(self.stale_ms), 10, u32::from(self.max_delay_ms))?;
        within("broadcast.max_age_ms", u32::from(self.max_age_ms), 50, MOST_AGE_US / 1000)?;
        within("broadcast.max_delay_ms", u32::from(self.max_delay_ms), 10, MOST_DELAY_US / 1000)?;
        within("broadcast.status_ms", u32::from(self.status_ms), 10, 500)?;
        within("broadcast.header_ms", u32::from(self.header_ms), 10, 500)?;
        within("broadcast.planes", u32::from(self.planes), 1, 3)?;
        within("broadcast.visible_range_ms", u32::from(self.visible_range_ms.unwrap_or(100)), 10, 60_000)
    }
}

#[allow(clippy::cast_precision_loss)] // for the message only
#[inline(never)]
pub(super) fn within(parameter: &'static str, value: u32, min: u32, max: u32) -> Result<(), ConfigError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let problem = Problem::OutOfLimits { min: min as f32, max: max as f32 };
    Err(ConfigError { parameter, value: value as f32, problem })
}
