//! A radar's clock, read off the unit's own: for radars that stamp their scans.
//!
//! # Model
//! Scans are worked on by the radar's stamps, which are free of what the line adds. Between scans the
//! unit has to know what the radar's clock shows *now*. A stamp `s` that arrives at `t` is `t - s` late;
//! the smallest lag seen is taken for the difference of the clocks, so that no stamp is ever ahead of
//! the radar's clock as read here. The lag kept grows by 2^-11 (490 ppm) of the time that passes, more
//! than any two quartzes differ. A stamp before the last one is a clock that stepped back, however little,
//! and a lag larger by a second or more one that was set: both begin anew.
//!
//! # Limits
//! Times below 2^63 µs. Before the first stamp the unit's own clock is shown.

use crate::fixed::time::Time;

/// A lag this much larger, microseconds, is another clock.
const STEP_US: i64 = 1_000_000;

/// Keeps the difference between a radar's clock and the unit's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RadarClock {
    /// The lag, microseconds, and when it was last looked at.
    kept: Option<(i64, Time)>,
    /// The last stamp.
    stamp: Time,
}

impl RadarClock {
    /// Before the first stamp.
    pub const NEW: Self = Self { kept: None, stamp: Time::from_micros(0) };

    /// A scan with this stamp arrived.
    pub fn stamp(&mut self, stamp: Time, arrived: Time) {
        let lag = signed(arrived).saturating_sub(signed(stamp));
        let lag = match self.kept {
            Some((kept, last)) if stamp >= self.stamp && lag < kept.saturating_add(STEP_US) => {
                let passed = arrived.since(last).and_then(|us| i64::try_from(us).ok()).unwrap_or(0);
                lag.min(kept.saturating_add(passed >> 11))
            }
            _ => lag,
        };
        (self.kept, self.stamp) = (Some((lag, arrived)), stamp);
    }

    /// What the radar's clock shows.
    pub fn now(&self, now: Time) -> Time {
        let lag = self.kept.map_or(0, |(lag, _)| lag);
        Time::from_micros(u64::try_from(signed(now).saturating_sub(lag)).unwrap_or(0))
    }
}

fn signed(time: Time) -> i64 {
    i64::try_from(time.micros()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    #[test]
    fn the_smallest_lag_is_the_clocks_difference() {
        let mut clock = RadarClock::NEW;
        assert_eq!(clock.now(at(5)), at(5));
        // the radar's clock is 1000 s ahead, the line adds 3, 9 and 2 ms
        clock.stamp(at(1_000_000), at(3));
        assert_eq!(clock.now(at(3)), at(1_000_000));
        clock.stamp(at(1_000_066), at(75));
        assert!(clock.now(at(75)).since(at(1_000_071)).is_some_and(|us| us < 1100), "{:?}", clock.now(at(75)));
        clock.stamp(at(1_000_133), at(135));
        assert_eq!(clock.now(at(135)), at(1_000_133));
    }

    #[test]
    fn a_radar_that_starts_over_and_a_line_that_was_stuck() {
        let mut clock = RadarClock::NEW;
        clock.stamp(at(50_000), at(100));
        clock.stamp(at(40), at(1_000));
        assert_eq!(clock.now(at(1_000)), at(40), "its clock began anew");
        clock.stamp(at(1_040), at(5_000));
        assert_eq!(clock.now(at(5_000)), at(1_040), "held up for three seconds");
        clock.stamp(at(4_100), at(5_066));
        assert_eq!(clock.now(at(5_066)), at(4_100), "and free again");
    }

    #[test]
    fn a_clock_that_steps_back_by_any_amount_is_followed_at_once() {
        for step_ms in [67, 100, 300, 499, 500, 700, 999, 1000, 5000] {
            let mut clock = RadarClock::NEW;
            (0..20).for_each(|k| clock.stamp(at(9000 + 66 * k), at(100 + 66 * k)));
            let (stamp, arrived) = (at(9000 + 66 * 20 - step_ms), at(100 + 66 * 20));
            clock.stamp(stamp, arrived);
            assert_eq!(clock.now(arrived), stamp, "{step_ms} ms back: a map measured now is new");
        }
    }

    #[test]
    fn a_radar_slow_by_300_ppm_is_followed_for_a_day() {
        let mut clock = RadarClock::NEW;
        for k in 0..24 * 36_000_u64 {
            let (arrived, stamp) = (k * 100_000, k * 99_970);
            clock.stamp(Time::from_micros(stamp), Time::from_micros(arrived));
            let ahead = clock.now(Time::from_micros(arrived)).since(Time::from_micros(stamp));
            assert!(ahead.is_some_and(|us| us <= 50), "{k}: {ahead:?}");
        }
    }

    proptest! {
        #[test]
        fn no_stamp_is_ahead_of_the_clock_it_came_from(
            difference in -1_000_000_000_i64..1_000_000_000,
            lags in prop::collection::vec(0_u64..2_000_000, 1..100),
        ) {
            let mut clock = RadarClock::NEW;
            for (k, lag) in lags.into_iter().enumerate() {
                let measured = 2_000_000_000 + k as u64 * 66_667;
                let stamp = Time::from_micros(measured.saturating_add_signed(difference));
                let arrived = Time::from_micros(measured + lag);
                clock.stamp(stamp, arrived);
                prop_assert!(clock.now(arrived) >= stamp);
            }
        }
    }
}
