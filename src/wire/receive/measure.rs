//! How late frames are: the sender's clock, the smallest lag, and whether the two fit.
//!
//! The rules that use them, with their reasons, are in [`session`](super::session).

use crate::fixed::time::Time;
use crate::wire::scan_number::{CLOCK_US, MOST_AGE_US, MOST_DELAY_US, PERIOD_US, TICK_US};

/// Map frames a measure must be of before it is trusted.
pub const ENOUGH: u8 = 8;

/// What the smallest lag may be off by: a tick's rounding, and its creeping up over ten seconds.
pub(super) const MARGIN_US: u32 = TICK_US + 5000;

/// The smallest lag, and the bound of the sender's clock, give way by 2^-11 of the time passed.
const CREEP: u32 = 11;

/// Age and delay a receiver works with. More than a sender may be set to counts as that: numbers of scans would come again
/// before a receiver drops what they say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReceiverLimits {
    /// Greatest age of what is shown, microseconds: A. At most 1 s.
    pub max_age_us: u32,
    /// Greatest delay from measurement to reception, microseconds: D. At most 500 ms.
    pub max_delay_us: u32,
}

impl ReceiverLimits {
    /// 300 ms and 100 ms.
    pub const DEFAULT: Self = Self { max_age_us: 300_000, max_delay_us: 100_000 };

    /// No more than a sender may be set to.
    pub(super) fn bounded(self) -> Self {
        Self { max_age_us: self.max_age_us.min(MOST_AGE_US), max_delay_us: self.max_delay_us.min(MOST_DELAY_US) }
    }

    /// Age from which what a scan said is dropped, microseconds: what a delta may name, and a late delta's delay.
    pub(super) fn dropped_us(&self) -> u32 {
        400_000 + 2 * self.max_delay_us.max(self.max_age_us)
    }

    /// `A + D`, microseconds.
    pub(super) fn sum_us(&self) -> u64 {
        u64::from(self.max_age_us) + u64::from(self.max_delay_us)
    }
}

/// The sender's clock, as the fastest header had it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SenderClock {
    /// When that came, and what it said: microseconds, modulo [`CLOCK_US`].
    pub(super) at: Time,
    pub(super) us: u64,
    /// The first one, or the first after one faster by more than `D`.
    pub(super) begun: Time,
    /// Whether a header `A + D` later agreed.
    pub(super) confirmed: bool,
}

impl SenderClock {
    /// What it has reached by now, at least.
    pub(super) fn now_us(&self, now: Time) -> u64 {
        let passed = now.since(self.at).unwrap_or(0);
        (self.us + passed - (passed >> CREEP)) % CLOCK_US
    }

    /// The lag that a scan measured now would have.
    pub(super) fn lag(&self, now: Time) -> u32 {
        difference(modulo(now.micros()), modulo(self.now_us(now)))
    }
}

/// The smallest lag.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measure {
    pub(super) begun: Time,
    /// The fastest frame: when it came, and its lag.
    pub(super) at: Time,
    pub(super) lag: u32,
    /// By how much the smallest sank since the measure began, less what is allowed.
    pub(super) sunk: u32,
    /// Map frames in time.
    pub(super) count: u8,
}

impl Measure {
    /// Whether it is old enough and of enough frames.
    pub(super) fn is_settled(&self, now: Time, limits: &ReceiverLimits) -> bool {
        now.since(self.begun).is_some_and(|since| since >= limits.sum_us()) && self.count >= ENOUGH
    }

    pub(super) fn least(&self, now: Time) -> u32 {
        modulo(u64::from(self.lag) + (now.since(self.at).unwrap_or(0) >> CREEP))
    }
}

/// Whether by the header's clock the fastest map frame was in time.
pub(super) fn fits(measure: &Measure, clock: &SenderClock, now: Time, limits: &ReceiverLimits) -> bool {
    let over = difference(measure.least(now) + limits.max_delay_us, clock.lag(now));
    over <= 2 * limits.max_delay_us + MARGIN_US
}

/// How much a lag is more than another, modulo the period.
pub(super) fn difference(lag: u32, least: u32) -> u32 {
    modulo(u64::from(lag) + u64::from(PERIOD_US) - u64::from(least))
}

/// By how much a lag is smaller than the sender's clock allows; 0 if it is not.
pub(super) fn ahead_of(clock: u32, lag: u32, limits: &ReceiverLimits) -> u32 {
    let ahead = difference(clock, lag);
    if ahead > limits.max_delay_us && ahead <= PERIOD_US / 2 { ahead } else { 0 }
}

#[allow(clippy::cast_possible_truncation)] // modulo
pub(super) fn modulo(us: u64) -> u32 {
    (us % u64::from(PERIOD_US)) as u32
}
