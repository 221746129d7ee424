//! Whom a receiver listens to, and how late what it hears is: the rules by their numbers.
//!
//! # Model
//! *Session* (rule 1). An epoch has a session from its second intact frame within `A + D` on; one stray
//! frame changes nothing. The epoch before is refused for `A + D`, its late frames for a period of the
//! scan numbers. Should it speak again after `A + D`, in time by its own measure, then two senders use
//! one number: a conflict, until only one of them is heard for a second.
//!
//! *Sender's clock* (rule 2). The header carries the full clock. The headers heard so far bound it from
//! below: what the fastest of them said, and the time passed since, less 2^-11 for drift. A map frame of a
//! scan after that by more than 1.5 s is of another period of the scan numbers, and is refused; one by more
//! than `D` shows that the headers were late, and nothing is shown before the next one; to refuse those would
//! hide what a queue that drains shows. Where headers `A + D` apart agree with one another and with a settled
//! measure, they were not late, and such a frame is refused, too.
//!
//! *Measure* (rule 3). A frame's scan number is the sender's clock at the measurement. The receiver's
//! clock less that is the delay plus an unknown constant; the smallest seen stands for no delay. What lags
//! more than `D` behind it is refused. A smallest that sinks by more than `D`, at once or little by
//! little, was a late one: the measure begins anew. It creeps up by 2^-11, so that clocks may drift.
//!
//! A measure that was not yet trusted when frames in time paused for longer than `A` settles anew: meanwhile a
//! queue may have drained down to it.
//!
//! *Trust* (rule 5). Nothing is shown before the measure is `A + D` old and of [`ENOUGH`](super::ENOUGH) frames, nor
//! while it does not fit the sender's clock.

use core::cell::Cell;

use super::epochs::{Epochs, Mark};
use super::measure::{MARGIN_US, Measure, ReceiverLimits, SenderClock, ahead_of, difference, fits, modulo};
use crate::fixed::time::Time;
use crate::wire::header::Clock;
use crate::wire::message::Epoch;
use crate::wire::scan_number::{CLOCK_US, PERIOD_US, ScanNumber, TICK_US};

/// Silence of a session's epoch after which another may begin one, microseconds.
const SILENCE_US: u64 = PERIOD_US as u64 / 2;

/// A conflict, and another wire version, last this long after their last sign, microseconds.
const SIGN_US: u64 = 1_000_000;

/// A map frame further ahead of the sender's clock was late by more than half a period, microseconds; one nearer
/// shows that the clock is late: three headers were lost.
const MOST_AHEAD_US: u32 = 1_500_000;

/// Without a map frame in time for longer than this, what is held is dropped, microseconds.
const GAP_US: u64 = 1_000_000;

/// The smallest lag may sink by 2^-10 of the time passed: what it crept up and what clocks drift.
const LEAK: u32 = 10;

/// What did not happen yet.
const NEVER: Time = Time::from_micros(u64::MAX);

/// What an epoch says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// The session's.
    Taken,
    /// A new session: everything before is void.
    New,
    /// The first of an epoch that has no session yet.
    First,
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
    /// In time, but maps before are void.
    Anew,
    /// Too late.
    Late,
    /// Of a scan that the sender's clock had not reached.
    Beyond,
}

/// Who is listened to.
#[derive(Debug, Clone)]
pub(super) struct Session {
    epoch: Option<Epoch>,
    /// The last frame of this epoch.
    heard: Time,
    /// The receiver's clock stepped back: nothing holds any more.
    void: Cell<bool>,
    clock: Option<SenderClock>,
    measure: Option<Measure>,
    /// Last map frame in time; before the first the session's beginning.
    map_heard: Time,
    /// Whether a map frame of this session was refused.
    doubt: bool,
    /// Since when all map frames fit measure or clock not.
    misfit_since: Time,
    epochs: Epochs,
    /// The epoch left last and its smallest lag then.
    previous: Option<(Epoch, u32)>,
    conflict: Time,
    other_version: Time,
}

impl Session {
    pub const fn none() -> Self {
        Self {
            epoch: None,
            heard: Time::from_micros(0),
            void: Cell::new(false),
            clock: None,
            measure: None,
            map_heard: Time::from_micros(0),
            doubt: false,
            misfit_since: NEVER,
            epochs: Epochs::NONE,
            previous: None,
            conflict: NEVER,
            other_version: NEVER,
        }
    }

    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch.filter(|_| !self.void.get())
    }

    /// The receiver's clock stepped back.
    pub fn step_back(&self) {
        self.void.set(true);
    }

    /// A checked frame of any kind, with its scan number if it has one.
    pub fn enter(&mut self, now: Time, epoch: Epoch, scan: Option<ScanNumber>, limits: &ReceiverLimits) -> Entry {
        if self.void.get() {
            *self = Self::none();
        }
        let sum_ms = limits.sum_us() / 1000;
        let silence = self.epoch.and_then(|_| now.since(self.heard)).unwrap_or(u64::MAX);
        if self.epoch == Some(epoch) && silence <= u64::from(PERIOD_US) {
            // clock and measure hold, so that what was under way meanwhile is known to be late
            self.heard = now;
            return Entry::Taken;
        }
        if silence <= SILENCE_US {
            let left = self.epochs.since_left(epoch, now);
            if left.is_some_and(|since| u64::from(since) <= sum_ms) {
                return Entry::OldEpoch;
            }
            if left.is_some() || self.conflicting(now) {
                if self.speaks_now(now, epoch, scan, limits) {
                    self.conflict = now;
                    return Entry::Conflict;
                }
                return Entry::OldEpoch;
            }
        }
        if self.epochs.again(epoch, now, sum_ms) { self.begin(now, epoch) } else { Entry::First }
    }

    /// Whether a frame of another epoch is of a sender that speaks now: not one that is late by the
    /// measure that epoch had.
    fn speaks_now(&self, now: Time, epoch: Epoch, scan: Option<ScanNumber>, limits: &ReceiverLimits) -> bool {
        match (self.previous.filter(|(previous, _)| *previous == epoch), scan) {
            (Some((_, least)), Some(scan)) => {
                let behind = difference(scan.lag(now), least);
                behind <= limits.max_delay_us || behind > PERIOD_US / 2
            }
            (None, Some(_)) => !self.epochs.is_left(epoch),
            (_, None) => false,
        }
    }

    fn begin(&mut self, now: Time, epoch: Epoch) -> Entry {
        if let Some(old) = self.epoch.filter(|old| *old != epoch) {
            self.epochs.mark(old, Mark::Left, now);
            self.previous = self.measure.map(|measure| (old, measure.least(now)));
        }
        self.epochs.mark(epoch, Mark::None, now);
        (self.epoch, self.heard, self.map_heard) = (Some(epoch), now, now);
        (self.clock, self.measure) = (None, None);
        (self.doubt, self.misfit_since) = (false, NEVER);
        (self.conflict, self.other_version) = (NEVER, NEVER);
        Entry::New
    }

    /// Says something of the same epoch that cannot be true of one sender.
    pub fn contradiction(&mut self, now: Time) {
        self.conflict = now;
    }

    /// Speaks a wire version that is not known here.
    pub fn other_version(&mut self, now: Time) {
        self.other_version = now;
    }

    pub fn conflicting(&self, now: Time) -> bool {
        lasts(self.conflict, now)
    }

    pub fn speaks_otherwise(&self, now: Time) -> bool {
        lasts(self.other_version, now)
    }

    /// The clock of a header; whether maps before are void.
    pub fn hear_clock(&mut self, now: Time, clock: &Clock, limits: &ReceiverLimits) -> bool {
        let us = clock.time_ms * 1000 % CLOCK_US;
        let delay_us = u64::from(limits.max_delay_us);
        let mut known = self.clock.unwrap_or(SenderClock { at: now, us, begun: now, confirmed: false });
        let ahead = (us + CLOCK_US - known.now_us(now)) % CLOCK_US;
        let faster = ahead < CLOCK_US / 2;
        if faster && ahead > delay_us {
            (known.begun, known.confirmed) = (now, false);
        } else if faster || CLOCK_US - ahead <= delay_us {
            known.confirmed |= now.since(known.begun).is_some_and(|since| since >= limits.sum_us());
        }
        if faster {
            (known.at, known.us) = (now, us);
        }
        self.clock = Some(known);
        // the fastest frame was of a scan that the sender's clock had not reached
        let beyond = |measure: &Measure| ahead_of(known.lag(now), measure.least(now), limits) > 0;
        let void = self.measure.as_ref().is_some_and(beyond);
        if void {
            self.measure = None;
        }
        void
    }

    /// The scan number of a map frame.
    pub fn hear(&mut self, now: Time, scan: ScanNumber, limits: &ReceiverLimits) -> Hearing {
        let lag = scan.lag(now);
        let ahead = self.clock.map_or(0, |clock| ahead_of(clock.lag(now), lag, limits));
        if ahead > MOST_AHEAD_US || (ahead > 0 && self.is_sure(now, limits)) {
            return self.refuse(now, lag, Hearing::Beyond);
        }
        let Some(mut measure) = self.measure else { return self.measure_anew(now, lag, ahead) };
        let behind = difference(lag, measure.least(now));
        if behind > limits.max_delay_us && behind <= PERIOD_US / 2 {
            return self.refuse(now, lag, Hearing::Late);
        }
        if behind > PERIOD_US / 2 {
            let allowed = now.since(measure.at).unwrap_or(0) >> LEAK;
            let sunk = u64::from(measure.sunk).saturating_sub(allowed) + u64::from(PERIOD_US - behind);
            if sunk > u64::from(limits.max_delay_us) {
                return self.measure_anew(now, lag, ahead);
            }
            (measure.at, measure.lag, measure.sunk) = (now, lag, modulo(sunk));
        }
        let pause = now.since(self.map_heard).unwrap_or(0);
        if pause > u64::from(limits.max_age_us) && !measure.is_settled(self.map_heard, limits) {
            // a queue may have drained down to it meanwhile
            (measure.begun, measure.count) = (now, 0);
        }
        measure.count = measure.count.saturating_add(1);
        self.measure = Some(measure);
        self.in_time(now, ahead);
        if pause > GAP_US { Hearing::Anew } else { Hearing::InTime }
    }

    /// Whether headers `A + D` apart and the maps' measure agree on the sender's clock, so that a frame from
    /// after it was late by almost a period.
    fn is_sure(&self, now: Time, limits: &ReceiverLimits) -> bool {
        let (Some(measure), Some(clock)) = (self.measure, self.clock) else { return false };
        clock.confirmed && measure.is_settled(now, limits) && fits(&measure, &clock, now, limits)
    }

    fn measure_anew(&mut self, now: Time, lag: u32, ahead: u32) -> Hearing {
        self.measure = Some(Measure { begun: now, at: now, lag, sunk: 0, count: 1 });
        self.in_time(now, ahead);
        Hearing::Anew
    }

    fn in_time(&mut self, now: Time, ahead: u32) {
        self.map_heard = now;
        if ahead == 0 {
            self.misfit_since = NEVER;
        } else {
            self.misfits(now);
        }
    }

    /// Notes that a frame fits measure or clock not; whether none did for a period.
    fn misfits(&mut self, now: Time) -> bool {
        if self.misfit_since == NEVER {
            self.misfit_since = now;
        }
        let over = now.since(self.misfit_since).is_some_and(|since| since >= u64::from(PERIOD_US));
        if over {
            // the clocks are not what they were
            (self.clock, self.misfit_since) = (None, NEVER);
        }
        over
    }

    fn refuse(&mut self, now: Time, lag: u32, hearing: Hearing) -> Hearing {
        if self.misfits(now) {
            return self.measure_anew(now, lag, 0);
        }
        self.doubt = true;
        hearing
    }

    /// How old a scan is, at most by the fastest frame's delay more.
    pub fn age_us(&self, now: Time, scan: ScanNumber) -> u32 {
        self.measure.map_or(PERIOD_US, |measure| difference(scan.lag(now), measure.least(now)))
    }

    /// Whether scans are older than this at one time.
    #[allow(clippy::cast_possible_truncation)] // below 256
    pub fn older_than(&self, now: Time, most_us: u32) -> impl Fn(ScanNumber) -> bool + use<> {
        // how much younger a scan is than the one numbered 0 is a number of ticks
        let age_us = self.age_us(now, ScanNumber::from_byte(0));
        let ticks = (age_us / TICK_US) as u8;
        let most_ticks = (most_us.saturating_sub(age_us % TICK_US) / TICK_US).min(255) as u8;
        let any = self.measure.is_none();
        move |scan| any || ScanNumber::from_byte(ticks).ticks_after(scan) > most_ticks
    }

    /// Whether anything may be shown now.
    pub fn trusted(&self, now: Time, limits: &ReceiverLimits) -> bool {
        let (Some(measure), Some(clock), false) = (self.measure, self.clock, self.void.get()) else { return false };
        let settled = measure.is_settled(now, limits);
        // later than this every map has aged, and before it no number comes again
        let current = now.since(self.map_heard).is_some_and(|t| t <= u64::from(limits.max_age_us));
        let fits = fits(&measure, &clock, now, limits);
        let sure = clock.confirmed || !self.doubt;
        settled && current && fits && sure && !self.conflicting(now) && !self.speaks_otherwise(now)
    }

    /// Whether a scan may be shown now, given that the session is trusted.
    pub fn fresh(&self, now: Time, scan: ScanNumber, limits: &ReceiverLimits) -> bool {
        self.age_us(now, scan).saturating_add(MARGIN_US) <= limits.max_age_us
    }
}

/// Whether a sign still counts.
fn lasts(sign: Time, now: Time) -> bool {
    now.since(sign).is_some_and(|since| since < SIGN_US)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ReceiverLimits = ReceiverLimits::DEFAULT;

    fn ms(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    /// The number of a scan measured at this time by a clock 1.234 s ahead.
    fn scan(measured_ms: u64) -> ScanNumber {
        ScanNumber::at(ms(measured_ms + 1234))
    }

    fn clock(sent_ms: u64) -> Clock {
        Clock { time_ms: sent_ms + 1234, synchronised: false }
    }

    /// Two frames of an epoch: a session.
    fn begun(at: u64, epoch: u8) -> Session {
        let mut s = Session::none();
        assert_eq!(s.enter(ms(at), Epoch::new(epoch), None, &LIMITS), Entry::First);
        assert_eq!(s.enter(ms(at), Epoch::new(epoch), None, &LIMITS), Entry::New);
        s
    }

    /// A session whose frames take 30 ms.
    fn trusting() -> Session {
        let mut s = begun(0, 3);
        assert!(!s.hear_clock(ms(20), &clock(10), &LIMITS));
        for k in 0..10 {
            let hearing = s.hear(ms(50 * k + 30), scan(50 * k), &LIMITS);
            assert_eq!(hearing, if k == 0 { Hearing::Anew } else { Hearing::InTime });
        }
        assert!(s.trusted(ms(480), &LIMITS));
        s
    }

    #[test]
    fn a_measure_is_trusted_after_age_and_delay_and_enough_frames_and_a_clock() {
        let mut s = begun(0, 3);
        for k in 0..8 {
            assert!(!s.trusted(ms(50 * k + 5), &LIMITS));
            s.hear(ms(50 * k + 5), scan(50 * k), &LIMITS);
        }
        assert!(!s.trusted(ms(405), &LIMITS), "no clock yet");
        s.hear_clock(ms(360), &clock(350), &LIMITS);
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
        assert!(!s.hear_clock(ms(600), &clock(2010), &LIMITS));
        assert_eq!(s.hear(ms(600), scan(2000), &LIMITS), Hearing::Anew, "all before were late");
        assert!(!s.trusted(ms(600), &LIMITS));
    }

    #[test]
    fn a_queue_that_drains_begins_the_measure_anew_again_and_again() {
        let mut s = begun(0, 3);
        let mut delay = 2000;
        for now in (2100..).step_by(5) {
            // a header in every hundred
            if now % 500 == 0 {
                s.hear_clock(ms(now), &clock(now - delay), &LIMITS);
            }
            s.hear(ms(now), scan(now - delay), &LIMITS);
            assert!(!s.trusted(ms(now), &LIMITS) || delay <= 100, "{delay} ms late at {now}");
            // twice as fast as it grew
            delay = if delay > 13 { delay - 8 } else { 5 };
            if now == 2095 + 5 * 250 + 700 {
                break;
            }
        }
        assert!(delay == 5 && s.trusted(ms(4050), &LIMITS));
    }

    #[test]
    fn a_frame_from_after_the_senders_clock_changes_nothing() {
        let mut s = trusting();
        // 2.7 s late, which looks like 2.4 s fast
        assert_eq!(s.hear(ms(600), scan(600 + 5120 - 2700), &LIMITS), Hearing::Beyond);
        assert!(!s.trusted(ms(600), &LIMITS), "a single header may have been as late");
        s.hear_clock(ms(430), &clock(410), &LIMITS);
        assert!(s.trusted(ms(600), &LIMITS), "two are not");
        assert_eq!(s.hear(ms(600), scan(580), &LIMITS), Hearing::InTime);
        // the real header shows that everything before was of the echo
        let mut s = begun(0, 3);
        s.hear_clock(ms(2710), &clock(10), &LIMITS);
        s.hear(ms(2720), scan(20), &LIMITS);
        assert_eq!(s.hear(ms(2725), scan(2720), &LIMITS), Hearing::Late);
        assert!(s.hear_clock(ms(2730), &clock(2725), &LIMITS));
        assert_eq!(s.hear(ms(2740), scan(2720), &LIMITS), Hearing::Anew);
        assert_eq!(s.hear(ms(2740), scan(40), &LIMITS), Hearing::Beyond);
    }

    #[test]
    fn a_frame_ahead_of_the_clock_shows_that_the_headers_were_late() {
        let mut s = trusting();
        // 4.5 s late, which looks like 0.6 s fast: whose fault it is only a header can say
        assert_eq!(s.hear(ms(500), scan(500 + 5120 - 4500), &LIMITS), Hearing::Anew);
        assert!(!s.trusted(ms(901), &LIMITS));
        assert!(s.hear_clock(ms(510), &clock(500), &LIMITS), "the frame's");
        // a clock that came out of a queue, 600 ms late, and frames that came in time
        let mut s = begun(0, 3);
        s.hear_clock(ms(600), &clock(0), &LIMITS);
        (0..20).for_each(|k| _ = s.hear(ms(600 + 50 * k), scan(580 + 50 * k), &LIMITS));
        assert!(!s.trusted(ms(1560), &LIMITS));
        assert!(!s.hear_clock(ms(1560), &clock(1550), &LIMITS), "the header's");
        assert!(s.trusted(ms(1560), &LIMITS));
    }

    #[test]
    fn a_frame_ahead_of_a_clock_that_is_confirmed_is_an_echo_and_changes_nothing() {
        let mut s = trusting();
        s.hear_clock(ms(430), &clock(410), &LIMITS);
        // 4.5 s late, which looks like 0.6 s fast
        assert_eq!(s.hear(ms(500), scan(500 + 5120 - 4500), &LIMITS), Hearing::Beyond);
        assert!(s.trusted(ms(500), &LIMITS));
        assert_eq!(s.hear(ms(510), scan(480), &LIMITS), Hearing::InTime);
        // a sender whose clock was set forward by 0.6 s is heard from its next header on
        assert_eq!(s.hear(ms(520), scan(1100), &LIMITS), Hearing::Beyond);
        assert!(!s.hear_clock(ms(530), &clock(1110), &LIMITS));
        assert_eq!(s.hear(ms(540), scan(1120), &LIMITS), Hearing::Anew);
    }

    #[test]
    fn a_queue_that_drains_down_to_a_measure_of_one_frame_is_not_trusted() {
        let mut s = begun(0, 3);
        s.hear_clock(ms(900), &clock(0), &LIMITS);
        // a frame 900 ms late; then others, later still, which shorten
        assert_eq!(s.hear(ms(910), scan(0), &LIMITS), Hearing::Anew);
        assert_eq!(s.hear(ms(2000), scan(400), &LIMITS), Hearing::Late);
        for k in 0..20 {
            let hearing = s.hear(ms(2500 + k), scan(1580 + 4 * k), &LIMITS);
            assert_eq!(hearing, if k == 0 { Hearing::Anew } else { Hearing::InTime }, "{k}");
            // by then also the clock agrees
            s.hear_clock(ms(2500 + k), &clock(1600 + k), &LIMITS);
            assert!(!s.trusted(ms(2500 + k), &LIMITS), "{k}");
        }
        // frames that go on to come are enough after A + D
        for k in 1..10 {
            assert_eq!(s.hear(ms(2500 + 50 * k), scan(1650 + 50 * k), &LIMITS), Hearing::InTime);
        }
        assert!(s.trusted(ms(2950), &LIMITS), "a delay that stays");
    }

    #[test]
    fn a_pause_after_which_a_settled_measure_goes_on_costs_nothing() {
        let mut s = trusting();
        assert_eq!(s.hear(ms(1400), scan(1370), &LIMITS), Hearing::InTime);
        assert!(s.trusted(ms(1400), &LIMITS));
    }

    #[test]
    fn maps_that_are_later_than_the_header_are_not_told() {
        let mut s = begun(0, 3);
        s.hear_clock(ms(20), &clock(10), &LIMITS);
        (0..20).for_each(|k| _ = s.hear(ms(50 * k + 230), scan(50 * k), &LIMITS));
        assert!(!s.trusted(ms(1180), &LIMITS), "all of them took 230 ms");
    }

    #[test]
    fn a_clock_that_steps_back_ends_the_session() {
        let mut s = trusting();
        s.step_back();
        assert!(!s.trusted(ms(480), &LIMITS) && s.epoch().is_none());
        assert_eq!(s.enter(ms(300), Epoch::new(3), None, &LIMITS), Entry::First);
        assert_eq!(s.enter(ms(301), Epoch::new(3), None, &LIMITS), Entry::New);
    }

    #[test]
    fn one_stray_frame_changes_nothing() {
        let mut s = trusting();
        assert_eq!(s.enter(ms(480), Epoch::new(9), Some(scan(400)), &LIMITS), Entry::First);
        assert_eq!(s.enter(ms(480), Epoch::new(8), None, &LIMITS), Entry::First);
        assert!(s.trusted(ms(480), &LIMITS));
        assert_eq!(s.enter(ms(881), Epoch::new(9), None, &LIMITS), Entry::First, "too long after the other");
        assert_eq!(s.enter(ms(1281), Epoch::new(9), None, &LIMITS), Entry::New);
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
        assert!(Session::none().older_than(ms(0), 1_000_000)(scan(0)));
    }

    #[test]
    fn clocks_may_drift_apart_by_400_parts_in_a_million() {
        for ahead in [0, 800] {
            let mut s = trusting();
            for k in 10..200_000_u64 {
                let measured = 50 * k;
                // from 400 slow to 400 fast, in parts of a million
                let drifted = (measured + 30) * 1000 + measured * (1_000_000 + 400 - ahead) / 1000 - measured * 1000;
                let received = Time::from_micros(drifted);
                assert_eq!(s.hear(received, scan(measured), &LIMITS), Hearing::InTime, "{k}");
                if k % 10 == 0 {
                    s.hear_clock(received, &clock(measured + 20), &LIMITS);
                }
                assert!(s.trusted(received, &LIMITS), "{k}");
            }
        }
    }

    #[test]
    fn the_old_epoch_is_refused_and_then_a_conflict() {
        let mut s = trusting();
        let mut enter = |at: u64, epoch, scan| s.enter(ms(at), Epoch::new(epoch), scan, &LIMITS);
        assert_eq!((enter(500, 4, None), enter(500, 4, None)), (Entry::First, Entry::New));
        assert_eq!(enter(900, 3, Some(scan(870))), Entry::OldEpoch);
        assert_eq!(enter(901, 3, Some(scan(450))), Entry::OldEpoch, "a late one");
        assert_eq!(enter(901, 3, None), Entry::OldEpoch, "of no known time");
        assert_eq!(enter(901, 3, Some(scan(800))), Entry::Conflict);
        assert_eq!(enter(902, 4, None), Entry::Taken, "but nothing is shown");
        assert_eq!(enter(1000, 9, Some(scan(0))), Entry::Conflict, "a third one either");
        assert!(s.conflicting(ms(1999)) && !s.conflicting(ms(2001)));
        let mut enter = |at: u64, epoch| s.enter(ms(at), Epoch::new(epoch), None, &LIMITS);
        assert_eq!((enter(2002, 9), enter(2003, 9)), (Entry::First, Entry::New), "a restart");
        // the old number may come again when it is forgotten
        (0..6).for_each(|k| assert_eq!(enter(2100 + 1000 * k, 9), Entry::Taken));
        assert_eq!(enter(7120, 4), Entry::OldEpoch);
        assert_eq!((enter(7200, 4), enter(7201, 4)), (Entry::First, Entry::New));
    }

    #[test]
    fn two_senders_conflict_for_as_long_as_both_are_heard() {
        let mut s = Session::none();
        for k in 0..600 {
            let epoch = Epoch::new(1 + u8::try_from(k & 1).unwrap());
            if matches!(s.enter(ms(33 * k), epoch, Some(scan(33 * k)), &LIMITS), Entry::Taken | Entry::New) {
                s.hear_clock(ms(33 * k), &clock(33 * k), &LIMITS);
                s.hear(ms(33 * k), scan(33 * k), &LIMITS);
            }
            assert_eq!(s.conflicting(ms(33 * k)), k >= 16, "{k}");
            assert!(!s.trusted(ms(33 * k), &LIMITS));
        }
    }

    #[test]
    fn silence_lets_another_epoch_begin_and_ends_a_session_after_a_period() {
        let mut s = trusting();
        let mut enter = |at: u64, epoch| s.enter(ms(at), Epoch::new(epoch), None, &LIMITS);
        assert_eq!(enter(5100, 3), Entry::Taken);
        assert_eq!((enter(10_300, 3), enter(10_310, 3)), (Entry::First, Entry::New));
        assert_eq!((enter(12_900, 4), enter(12_910, 3)), (Entry::First, Entry::Taken));
        assert_eq!((enter(15_500, 4), enter(15_510, 4)), (Entry::First, Entry::New));
    }

    #[test]
    fn what_waited_while_the_bus_stood_still_is_late() {
        for delay in [150, 2600, 4900] {
            let mut s = trusting();
            assert_eq!(s.enter(ms(480), Epoch::new(3), None, &LIMITS), Entry::Taken);
            let first = 500 + delay;
            assert_eq!(s.enter(ms(first), Epoch::new(3), None, &LIMITS), Entry::Taken);
            for k in 10..112 {
                let hearing = s.hear(ms(50 * k + delay), scan(50 * k), &LIMITS);
                // 4.9 s late looks like 0.2 s fast
                assert!(delay > 3600 || matches!(hearing, Hearing::Late | Hearing::Beyond), "{k}");
                s.hear_clock(ms(50 * k + delay), &clock(50 * k + 10), &LIMITS);
                assert!(!s.trusted(ms(50 * k + delay), &LIMITS), "{k}");
            }
        }
    }

    #[test]
    fn without_a_frame_in_time_for_a_period_the_clocks_are_not_what_they_were() {
        let mut s = trusting();
        for k in 10..112 {
            assert_eq!(s.hear(ms(50 * k), scan(50 * k - 200), &LIMITS), Hearing::Late, "{k}");
        }
        // the first late one was heard at 500 ms
        assert_eq!(s.hear(ms(5619), scan(5419), &LIMITS), Hearing::Late);
        assert_eq!(s.hear(ms(5620), scan(5420), &LIMITS), Hearing::Anew);
        assert!(s.clock.is_none());
    }

    #[test]
    fn a_pause_of_a_second_empties_the_maps_and_keeps_the_measure() {
        let mut s = trusting();
        assert_eq!(s.hear(ms(1481), scan(1451), &LIMITS), Hearing::Anew);
        assert_eq!(s.hear(ms(1481), scan(1341), &LIMITS), Hearing::Late);
        assert!(s.hear_clock(ms(1482), &clock(1480), &LIMITS) || s.trusted(ms(1482), &LIMITS));
    }
}
