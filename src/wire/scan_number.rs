//! The number of a scan: when it was measured, in ticks of 20 ms of the sender's clock, modulo 256.
//!
//! One byte orders the scans of the last 2.5 s, gives a delta its refresh, and lets a receiver see how
//! late a frame is and how old a map has become, without any set clock: the frame that was fastest
//! shows how the two clocks lie to each other.
//!
//! # Limits
//! At most 50 scans a second. Numbers come again after 5.12 s.

use crate::fixed::time::Time;

/// Length of a tick, microseconds.
pub const TICK_US: u32 = 20_000;

/// Time after which numbers come again, microseconds.
pub const PERIOD_US: u32 = 5_120_000;

/// Greatest age A that may be agreed upon, and greatest delay D, microseconds: both together are less than half a period,
/// and what is dropped by its age is gone before its number comes again.
pub const MOST_AGE_US: u32 = 1_000_000;
/// See [`MOST_AGE_US`].
pub const MOST_DELAY_US: u32 = 500_000;

/// Time after which the header's clock comes again, microseconds: 2^40 ms.
pub const CLOCK_US: u64 = (1 << 40) * 1000;

/// Number of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScanNumber(u8);

impl ScanNumber {
    /// Of a scan measured at this time of the sender's clock.
    #[allow(clippy::cast_possible_truncation)] // modulo 256
    pub const fn at(measured: Time) -> Self {
        // the clock comes again after 2^40 ms, as it does in the header
        Self((measured.micros() % CLOCK_US / TICK_US as u64) as u8)
    }

    /// From the byte in a message.
    pub const fn from_byte(byte: u8) -> Self {
        Self(byte)
    }

    /// As the byte in a message.
    pub const fn byte(self) -> u8 {
        self.0
    }

    /// Ticks from another scan to this one, modulo 256.
    pub const fn ticks_after(self, other: Self) -> u8 {
        self.0.wrapping_sub(other.0)
    }

    /// The number some ticks earlier.
    #[must_use]
    pub const fn before(self, ticks: u8) -> Self {
        Self(self.0.wrapping_sub(ticks))
    }

    /// Whether this scan is newer than another, both of the last 2.5 s.
    pub const fn newer_than(self, other: Self) -> bool {
        matches!(self.ticks_after(other), 1..=127)
    }

    /// When this tick begins within the period, microseconds.
    pub const fn begins_us(self) -> u32 {
        self.0 as u32 * TICK_US
    }

    /// How far a clock is past the beginning of this tick, modulo the period; microseconds.
    #[allow(clippy::cast_possible_truncation)] // modulo
    pub const fn lag(self, now: Time) -> u32 {
        let (now, begins) = ((now.micros() % PERIOD_US as u64) as u32, self.begins_us());
        if now < begins { now + PERIOD_US - begins } else { now - begins }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_order_the_scans_of_half_a_period() {
        let at = |ms: u64| ScanNumber::at(Time::from_micros(ms * 1000));
        assert_eq!((at(0).byte(), at(19).byte(), at(20).byte(), at(5119).byte(), at(5120).byte()), (0, 0, 1, 255, 0));
        assert!(at(5200).newer_than(at(5000)) && !at(5000).newer_than(at(5200)) && !at(40).newer_than(at(41)));
        assert!(at(2540).newer_than(at(0)) && !at(2560).newer_than(at(0)));
        assert_eq!((at(5200).ticks_after(at(5000)), at(60).before(5).byte()), (10, 254));
    }

    #[test]
    fn numbers_are_those_of_the_headers_clock() {
        // a set clock is beyond 2^40 ms, which is no multiple of the period
        for ms in [1_790_000_000_000_u64, (1 << 40) + 30, 1 << 40, (1 << 40) - 1] {
            let header_ms = ms % (1 << 40);
            assert_eq!(u64::from(ScanNumber::at(Time::from_micros(ms * 1000)).byte()), header_ms / 20 % 256, "{ms}");
        }
    }

    #[test]
    fn the_lag_counts_from_the_beginning_of_the_tick() {
        let number = ScanNumber::from_byte(255);
        assert_eq!(number.lag(Time::from_micros(5_100_000)), 0);
        assert_eq!(number.lag(Time::from_micros(5_125_000)), 25_000);
        assert_eq!(number.lag(Time::from_micros(3 * 5_120_000)), 20_000);
    }
}
