//! Bit timing of a classic CAN bus, and what to do when the controller leaves it.

use crate::config::{ConfigError, within};

/// A bus as the integrator knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct BusConfig {
    /// Bits per second.
    pub bit_rate: u32,
    /// Where in the bit it is sampled, thousandths.
    pub sample_point_permille: u16,
    /// Start without acknowledging or sending, until frames prove the bit rate right.
    pub listen_first: bool,
}

impl Default for BusConfig {
    /// What the ARS408 family and most vehicles use.
    fn default() -> Self {
        Self { bit_rate: 500_000, sample_point_permille: 800, listen_first: true }
    }
}

/// A bit in time quanta, synchronisation segment included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BitTiming {
    /// Clock periods to a quantum.
    pub prescaler: u16,
    /// Quanta from the synchronisation segment's end to the sample point.
    pub segment_1: u16,
    /// Quanta after the sample point.
    pub segment_2: u8,
    /// Most quanta a resynchronisation moves the sample point.
    pub jump_width: u8,
}

/// Quanta a bit may have, as every classic controller allows them.
const QUANTA: core::ops::RangeInclusive<u32> = 8..=25;

impl BusConfig {
    /// Checks the figures.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_precision_loss)] // bit rates are small
    pub fn check(&self, bus: &'static str) -> Result<(), ConfigError> {
        let [rate, point] = match bus {
            "radar_bus" => ["radar_bus.bit_rate", "radar_bus.sample_point_permille"],
            _ => ["broadcast_bus.bit_rate", "broadcast_bus.sample_point_permille"],
        };
        within(rate, self.bit_rate as f32, 10_000.0, 1_000_000.0)?;
        within(point, f32::from(self.sample_point_permille), 500.0, 900.0).map(|_| ())
    }

    /// Register values for a controller clocked at `clock_hz`: the finest quantum that meets the bit
    /// rate exactly, with the sample point as near as it gets. `None` if no divider meets the rate.
    #[allow(clippy::cast_possible_truncation)] // at most 25 quanta
    pub fn timing(&self, clock_hz: u32) -> Option<BitTiming> {
        let periods = clock_hz.checked_div(self.bit_rate).filter(|p| p * self.bit_rate == clock_hz)?;
        let quanta = QUANTA.rev().find(|q| periods.is_multiple_of(*q))?;
        let sample = (quanta * u32::from(self.sample_point_permille) + 500) / 1000;
        let sample = sample.clamp(2, quanta - 1);
        let segment_2 = (quanta - sample).min(8);
        Some(BitTiming {
            prescaler: u16::try_from(periods / quanta).ok()?,
            segment_1: (quanta - segment_2 - 1) as u16,
            segment_2: segment_2 as u8,
            jump_width: segment_2.min(4) as u8,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_clocks_meet_the_usual_rates() {
        for clock_hz in [8_000_000, 16_000_000, 24_000_000, 40_000_000, 80_000_000, 100_000_000] {
            for bit_rate in [125_000, 250_000, 500_000, 1_000_000] {
                for sample_point_permille in [750, 800, 875] {
                    let t = BusConfig { bit_rate, sample_point_permille, listen_first: true }.timing(clock_hz).unwrap();
                    let quanta = 1 + u32::from(t.segment_1) + u32::from(t.segment_2);
                    assert_eq!(u32::from(t.prescaler) * quanta * bit_rate, clock_hz);
                    let point = 1000 * (1 + u32::from(t.segment_1)) / quanta;
                    assert!(point.abs_diff(u32::from(sample_point_permille)) <= 65, "{clock_hz} {bit_rate} {point}");
                    assert!(t.jump_width <= t.segment_2 && t.segment_2 <= 8 && t.segment_1 <= 16 + 8);
                }
            }
        }
    }

    #[test]
    fn a_rate_no_divider_meets_is_refused() {
        assert_eq!(BusConfig { bit_rate: 333_333, ..BusConfig::default() }.timing(8_000_000), None);
        assert_eq!(BusConfig { bit_rate: 0, ..BusConfig::default() }.timing(8_000_000), None);
        let wrong = BusConfig { bit_rate: 2_000_000, ..BusConfig::default() };
        assert_eq!(wrong.check("radar_bus").unwrap_err().parameter, "radar_bus.bit_rate");
    }
}
