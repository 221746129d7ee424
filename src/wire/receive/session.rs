//! Whom a receiver listens to, and how late what it hears is.
//!
//! # Model
//! *Lag.* A frame's scan number is the sender's clock at the measurement. The receiver's clock less that
//! is the delay plus an unknown constant; the smallest seen stands for no delay. What lags more than `D`
//! behind it is refused. A frame faster by more than `D` shows that the smallest was a late one: the
//! session begins anew. The smallest creeps up by 2^-11, so that clocks may drift apart.
//!
//! *Trust.* A session tells nothing before it is `A + D` old and has heard [`ENOUGH`] frames: one of
//! them was in time.
//!
//! *Epochs.* A new epoch begins a new session, and the old one is refused for `A + D`, its late frames
//! for a period of the scan numbers. Should it speak again after `A + D`, in time by its own measure, then
//! two senders use one number: a conflict, until only one of them is heard for a second.

use crate::time::Time;
use crate::wire::message::Epoch;
use crate::wire::scan_number::{PERIOD_US, ScanNumber, TICK_US};

/// Map frames a session must have heard before it is trusted.
pub const ENOUGH: u8 = 8;

/// Silence that ends a session, microseconds: half a period of the scan numbers.
const SILENCE_US: u64 = PERIOD_US as u64 / 2;

/// A conflict lasts this long after its last sign, microseconds.
const CONFLICT_US: u64 = 1_000_000;

/// What the smallest lag may be off by: a tick's rounding, and its creeping up over ten seconds.
const MARGIN_US: u32 = TICK_US + 5000;

/// Age and delay a receiver works with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits {
    /// Greatest age of what is told, microseconds: A.
    pub max_age_us: u32,
    /// Greatest delay from measurement to reception, microseconds: D.
    pub max_delay_us: u32,
}

impl Limits {
    /// 300 ms and 100 ms.
    pub const DEFAULT: Self = Self { max_age_us: 300_000, max_delay_us: 100_000 };

    fn sum_us(&self) -> u64 {
        u64::from(self.max_age_us) + u64::from(self.max_delay_us)
    }
}

/// What an epoch says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// The session's.
    Taken,
    /// A new session: everything before is void.
    New,
    /// Of an epoch that is over.
    OldEpoch,
    /// Of a second sender.
    Conflict,
}

/// What a scan number says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hearing {
    /// In time.
    InTime,
    /// In time, but what came before was not: maps before are void.
    Anew,
    /// Too late.
    Late,
}

/// Who is listened to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Session {
    epoch: Option<Epoch>,
    /// The last frame of this epoch.
    heard: Time,
    /// First map frame, smallest lag and when it last crept up.
    begun: Option<(Time, u32, Time)>,
    /// Last map frame in time.
    map_heard: Time,
    /// Map frames in time.
    count: u8,
    /// Since when there are only late ones.
    late_since: Option<Time>,
    /// When each epoch was left, milliseconds, and which are remembered.
    left_ms: [u32; 16],
    left: u16,
    /// The epoch left last and its smallest lag.
    previous: Option<(Epoch, u32)>,
    conflict: Option<Time>,
}

impl Session {
    pub const NONE: Self = Self {
        epoch: None,
        heard: Time::from_micros(0),
        begun: None,
        map_heard: Time::from_micros(0),
        count: 0,
        late_since: None,
        left_ms: [0; 16],
        left: 0,
        previous: None,
        conflict: None,
    };

    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch
    }

    /// A checked frame of any kind, with its scan number if it has one.
    pub fn enter(&mut self, now: Time, epoch: Epoch, scan: Option<ScanNumber>, limits: &Limits) -> Entry {
        let Some(current) = self.epoch else { return self.begin(now, epoch) };
        if now.since(self.heard).is_none_or(|silence| silence > SILENCE_US) {
            return self.begin(now, epoch);
        }
        if epoch == current {
            self.heard = now;
            return Entry::Taken;
        }
        let left = self.since_left(now, epoch);
        if left.is_some_and(|since| since <= limits.sum_us()) {
            return Entry::OldEpoch;
        }
        if self.conflicting(now) || left.is_some_and(|since| since <= u64::from(PERIOD_US)) {
            if self.speaks_now(now, epoch, scan, limits) {
                self.conflict = Some(now);
                return Entry::Conflict;
            }
            return Entry::OldEpoch;
        }
        self.begin(now, epoch)
    }

    /// Whether a frame of another epoch is of a sender that speaks now: not one that is late by the
    /// measure that epoch had.
    fn speaks_now(&self, now: Time, epoch: Epoch, scan: Option<ScanNumber>, limits: &Limits) -> bool {
        match (self.previous.filter(|(previous, _)| *previous == epoch), scan) {
            (Some((_, least)), Some(scan)) => {
                let behind = behind(scan.lag(now), least);
                behind <= limits.max_delay_us || behind > PERIOD_US / 2
            }
            (None, Some(_)) => self.left >> epoch.number() & 1 == 0,
            (_, None) => false,
        }
    }

    fn begin(&mut self, now: Time, epoch: Epoch) -> Entry {
        if let Some(old) = self.epoch.filter(|old| *old != epoch) {
            if let Some(left) = self.left_ms.get_mut(usize::from(old.number())) {
                *left = milliseconds(now);
            }
            self.left |= 1 << old.number();
            self.previous = self.begun.map(|(_, least, _)| (old, least));
        }
        self.left &= !(1 << epoch.number());
        (self.epoch, self.heard, self.conflict) = (Some(epoch), now, None);
        self.restart();
        Entry::New
    }

    fn restart(&mut self) {
        (self.begun, self.count, self.late_since) = (None, 0, None);
    }

    /// Microseconds since an epoch was left, if it is remembered.
    fn since_left(&mut self, now: Time, epoch: Epoch) -> Option<u64> {
        if self.left >> epoch.number() & 1 == 0 {
            return None;
        }
        let left = self.left_ms.get(usize::from(epoch.number()))?;
        let since = u64::from(milliseconds(now).wrapping_sub(*left)) * 1000;
        if since > u64::from(PERIOD_US) {
            self.left &= !(1 << epoch.number());
        }
        Some(since)
    }

    /// Says something of the same epoch that cannot be true of one sender.
    pub fn contradiction(&mut self, now: Time) {
        self.conflict = Some(now);
    }

    pub fn conflicting(&self, now: Time) -> bool {
        self.conflict.is_some_and(|sign| now.since(sign).is_some_and(|since| since < CONFLICT_US))
    }

    /// The scan number of a map frame.
    pub fn hear(&mut self, now: Time, scan: ScanNumber, limits: &Limits) -> Hearing {
        let lag = scan.lag(now);
        let Some((begun, mut least, crept)) = self.begun else { return self.hear_first(now, lag, Hearing::InTime) };
        // clocks drift apart
        let steps = now.since(crept).unwrap_or(0) >> 11;
        least = modulo(u64::from(least) + steps);
        let crept = Time::from_micros(crept.micros() + (steps << 11));
        self.begun = Some((begun, least, crept));
        let behind = behind(lag, least);
        if behind > limits.max_delay_us && behind <= PERIOD_US / 2 {
            let since = *self.late_since.get_or_insert(now);
            if now.since(since).is_some_and(|late| late < u64::from(PERIOD_US)) {
                return Hearing::Late;
            }
            // nothing but late frames for a whole period: the clocks are not what they were
            return self.hear_first(now, lag, Hearing::Anew);
        }
        if behind > PERIOD_US / 2 {
            if PERIOD_US - behind > limits.max_delay_us {
                return self.hear_first(now, lag, Hearing::Anew);
            }
            self.begun = Some((begun, lag, now));
        }
        self.late_since = None;
        self.map_heard = now;
        self.count = self.count.saturating_add(1);
        Hearing::InTime
    }

    fn hear_first(&mut self, now: Time, lag: u32, hearing: Hearing) -> Hearing {
        self.restart();
        self.begun = Some((now, lag, now));
        (self.map_heard, self.count) = (now, 1);
        hearing
    }

    /// How old a scan is, at most by the fastest frame's delay more.
    pub fn age_us(&self, now: Time, scan: ScanNumber) -> u32 {
        self.begun.map_or(PERIOD_US, |(_, least, _)| behind(scan.lag(now), least))
    }

    /// Whether scans are older than this at one time.
    #[allow(clippy::cast_possible_truncation)] // below 256
    pub fn older_than(&self, now: Time, most_us: u32) -> impl Fn(ScanNumber) -> bool + use<> {
        // how much younger a scan is than the one numbered 0 is a number of ticks
        let age_us = self.age_us(now, ScanNumber::from_byte(0));
        let ticks = (age_us / TICK_US) as u8;
        let most_ticks = (most_us.saturating_sub(age_us % TICK_US) / TICK_US).min(255) as u8;
        let any = self.begun.is_none();
        move |scan| any || ScanNumber::from_byte(ticks).ticks_after(scan) > most_ticks
    }

    /// Whether anything may be told now.
    pub fn trusted(&self, now: Time, limits: &Limits) -> bool {
        let settled = self.begun.is_some_and(|(begun, ..)| now.since(begun).is_some_and(|t| t >= limits.sum_us()));
        // later than this every map has aged, and before it no number comes again
        let current = now.since(self.map_heard).is_some_and(|t| t <= u64::from(limits.max_age_us));
        settled && current && self.count >= ENOUGH && !self.conflicting(now)
    }

    /// Whether a scan may be told now, given that the session is trusted.
    pub fn fresh(&self, now: Time, scan: ScanNumber, limits: &Limits) -> bool {
        self.age_us(now, scan).saturating_add(MARGIN_US) <= limits.max_age_us
    }
}

/// How much a lag is more than another, modulo the period.
fn behind(lag: u32, least: u32) -> u32 {
    if lag < least { lag + PERIOD_US - least } else { lag - least }
}

#[allow(clippy::cast_possible_truncation)] // modulo
fn modulo(us: u64) -> u32 {
    (us % u64::from(PERIOD_US)) as u32
}

#[allow(clippy::cast_possible_truncation)] // modulo 49 days
fn milliseconds(now: Time) -> u32 {
    (now.micros() / 1000) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits::DEFAULT;

    fn ms(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    /// The number of a scan measured at this time by a clock 1.234 s ahead.
    fn scan(measured_ms: u64) -> ScanNumber {
        ScanNumber::at(ms(measured_ms + 1234))
    }

    fn trusting() -> Session {
        let mut s = Session::NONE;
        assert_eq!(s.enter(ms(0), Epoch::new(3), None, &LIMITS), Entry::New);
        for k in 0..10 {
            assert_eq!(s.hear(ms(50 * k + 30), scan(50 * k), &LIMITS), Hearing::InTime);
        }
        assert!(s.trusted(ms(480), &LIMITS));
        s
    }

    #[test]
    fn a_session_is_trusted_after_age_and_delay_and_enough_frames() {
        let mut s = Session::NONE;
        s.enter(ms(0), Epoch::new(3), None, &LIMITS);
        for k in 0..8 {
            assert!(!s.trusted(ms(50 * k + 5), &LIMITS));
            s.hear(ms(50 * k + 5), scan(50 * k), &LIMITS);
        }
        assert!(!s.trusted(ms(404), &LIMITS) && s.trusted(ms(405), &LIMITS));
        assert!(!s.trusted(ms(656), &LIMITS), "300 ms after the last frame");
    }

    #[test]
    fn late_frames_are_refused_and_faster_ones_set_the_measure() {
        let mut s = trusting();
        assert_eq!(s.hear(ms(600), scan(450), &LIMITS), Hearing::Late);
        assert_eq!(s.hear(ms(600), scan(500), &LIMITS), Hearing::InTime);
        assert_eq!(s.hear(ms(600), scan(590), &LIMITS), Hearing::InTime, "20 ms faster");
        assert_eq!(s.hear(ms(600), scan(480), &LIMITS), Hearing::Late, "by the new measure");
        assert_eq!(s.hear(ms(600), scan(2000), &LIMITS), Hearing::Anew, "all before were late");
        assert!(!s.trusted(ms(600), &LIMITS));
    }

    #[test]
    fn age_counts_from_the_measurement() {
        let s = trusting();
        assert!(s.fresh(ms(700), scan(450), &LIMITS) && !s.fresh(ms(760), scan(450), &LIMITS));
    }

    #[test]
    fn what_is_older_is_known_for_all_scans_at_once() {
        let s = trusting();
        for at in [480, 481, 499, 3000] {
            for most_us in [30_000, 299_999, 600_000, 1_000_000, 5_119_999] {
                let older = s.older_than(ms(at), most_us);
                for number in (0..=255).map(ScanNumber::from_byte) {
                    assert_eq!(older(number), s.age_us(ms(at), number) > most_us, "{number:?} at {at} ms, {most_us}");
                }
            }
        }
        assert!(Session::NONE.older_than(ms(0), 1_000_000)(scan(0)));
    }

    #[test]
    fn clocks_may_drift_apart_by_400_parts_in_a_million() {
        let mut s = trusting();
        for k in 10..200_000_u64 {
            let measured = 50 * k;
            let received = Time::from_micros((measured + 30) * 1000 + measured * 1000 / 2500);
            assert_eq!(s.hear(received, scan(measured), &LIMITS), Hearing::InTime, "{k}");
        }
    }

    #[test]
    fn the_old_epoch_is_refused_and_then_a_conflict() {
        let mut s = trusting();
        let mut enter = |at: u64, epoch, scan| s.enter(ms(at), Epoch::new(epoch), scan, &LIMITS);
        assert_eq!(enter(500, 4, None), Entry::New);
        assert_eq!(enter(900, 3, Some(scan(870))), Entry::OldEpoch);
        assert_eq!(enter(901, 3, Some(scan(450))), Entry::OldEpoch, "a late one");
        assert_eq!(enter(901, 3, None), Entry::OldEpoch, "of no known time");
        assert_eq!(enter(901, 3, Some(scan(800))), Entry::Conflict);
        assert_eq!(enter(902, 4, None), Entry::Taken, "but nothing is told");
        assert_eq!(enter(1000, 9, Some(scan(0))), Entry::Conflict, "a third one either");
        assert!(s.conflicting(ms(1999)) && !s.conflicting(ms(2001)));
        let mut enter = |at: u64, epoch| s.enter(ms(at), Epoch::new(epoch), None, &LIMITS);
        assert_eq!(enter(2002, 9), Entry::New, "a restart");
        // the old number may come again when it is forgotten
        (0..6).for_each(|k| assert_eq!(enter(2100 + 1000 * k, 9), Entry::Taken));
        assert_eq!(enter(7200, 4), Entry::New);
    }

    #[test]
    fn two_senders_conflict_for_as_long_as_both_are_heard() {
        let mut s = Session::NONE;
        for k in 0..600 {
            let epoch = Epoch::new(1 + u8::try_from(k & 1).unwrap());
            if s.enter(ms(33 * k), epoch, Some(scan(33 * k)), &LIMITS) != Entry::Conflict {
                s.hear(ms(33 * k), scan(33 * k), &LIMITS);
            }
            assert_eq!(s.conflicting(ms(33 * k)), k >= 14, "{k}");
            assert!(!s.trusted(ms(33 * k), &LIMITS));
        }
    }

    #[test]
    fn silence_ends_a_session() {
        let mut s = trusting();
        assert_eq!(s.enter(ms(3100), Epoch::new(3), None, &LIMITS), Entry::New);
        assert_eq!(s.enter(ms(3000), Epoch::new(3), None, &LIMITS), Entry::New, "so does a clock stepping back");
    }

    #[test]
    fn nothing_but_late_frames_is_a_clock_that_stepped() {
        let mut s = trusting();
        for k in 10..113 {
            assert_eq!(s.hear(ms(50 * k), scan(50 * k - 200), &LIMITS), Hearing::Late, "{k}");
        }
        assert_eq!(s.hear(ms(5700), scan(5500), &LIMITS), Hearing::Anew);
    }
}
