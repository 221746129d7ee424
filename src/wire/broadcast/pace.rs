//! When something is due again.

use crate::fixed::time::Time;

/// A moment that comes again and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Every {
    pub next: Time,
    pub period_us: u64,
}

impl Every {
    pub fn new(now: Time, period_us: u64) -> Self {
        Self { next: now, period_us }
    }

    /// Whether it has come; a clock that stepped back does not put it off by more than a period.
    pub fn due(&self, now: Time) -> bool {
        self.next.since(now).is_none_or(|wait| wait == 0 || wait > self.period_us)
    }

    pub fn done(&mut self, now: Time) {
        let late = now.since(self.next).unwrap_or(u64::MAX);
        let from = if late < self.period_us { self.next } else { now };
        self.next = Time::from_micros(from.micros() + self.period_us);
    }
}
