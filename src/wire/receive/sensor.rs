//! Everything a receiver knows of one sensor.

use super::assembly::{Assembly, Begun, BlockKey};
use super::collector::{Brought, Collector};
use super::measure::ReceiverLimits;
use super::sectors::Sectors;
use super::session::{Entry, Hearing, Session};
use crate::fixed::time::Time;
use crate::wire::code::block::Basis;
use crate::wire::code::ray::Ray;
use crate::wire::code::reading::{self, Ending, Reader};
use crate::wire::e2e::{Counter, Sequence};
use crate::wire::header::{Clock, Header, NotAHeader};
use crate::wire::map_message::{self, Plain};
use crate::wire::message::{Epoch, Message, NotAMessage, NotAuthentic, Part, Plane, Received};
use crate::wire::scan_number::ScanNumber;
use crate::wire::status::Status;
use crate::wire::visible_range::Ranges;

/// What a message brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Accepted {
    /// A part of a map.
    Map {
        /// Its scan.
        scan: ScanNumber,
    },
    /// The header, or a group of it.
    Header,
    /// The status, or a page of it.
    Status,
    /// Another message, for the caller to read.
    Other(Message),
}

/// Why a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refused {
    /// No intact message of ours.
    NotAMessage(NotAMessage),
    /// Secured, and its authenticator was not looked at.
    Sealed,
    /// Not of the sender that has the key, or not new.
    NotAuthentic(NotAuthentic),
    /// The first of an epoch: a session begins with the second.
    FirstOfEpoch,
    /// Of an epoch that is over.
    OldEpoch,
    /// Two senders use this sensor's number.
    Conflict,
    /// Later than the greatest delay.
    Late,
    /// Of a scan the sender's clock had not reached: later than half a period of the scan numbers.
    BeyondClock,
    /// The header is not complete yet.
    NoHeader,
    /// No header that can be used; an unknown wire version, say.
    NotAHeader(NotAHeader),
    /// A map larger than this receiver's storage.
    TooLarge,
    /// The refresh it builds on is not at hand.
    NoRefresh,
    /// Bytes that say something no sender says.
    Malformed,
}

/// What happened so far; numbers stay at their largest value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Messages used.
    pub accepted: u32,
    /// Failed the protection, or mislabelled.
    pub protection: u32,
    /// Not authentic, or nobody had the key to see.
    pub not_authentic: u32,
    /// Lost, by the protection's counters.
    pub lost: u32,
    /// Came with the counter of the one before.
    pub repeated: u32,
    /// Came out of sequence, by more than the counter can show.
    pub out_of_sequence: u32,
    /// Refused as late, by the measure or by the sender's clock.
    pub late: u32,
    /// Refused for their epoch, or in a conflict, or the first of an epoch.
    pub epoch: u32,
    /// Refused for want of a header or a refresh.
    pub early: u32,
    /// Said something no sender says.
    pub malformed: u32,
}

/// How a sensor is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SenderCondition {
    /// Not heard, or not long enough, or not lately, or too late.
    Waiting,
    /// Heard, but its header is not complete.
    NoHeader,
    /// It speaks another version, or of a map that cannot be held.
    Unusable,
    /// Two senders use its number.
    Conflict,
    /// Maps are shown.
    Ok,
}

/// Own bytes a message with a scan number has at least.
const LEAST_DATED: usize = 3;

/// Steps of a counter that still count as some lost.
const MOST_STEP: u8 = 7;

/// What is received of one sensor.
#[derive(Debug, Clone)]
pub struct SensorReceiver<const A: usize, const W: usize, const P: usize> {
    session: Session,
    collector: Collector,
    /// Whether its header fits this receiver's storage.
    fits: bool,
    clock: Option<Clock>,
    status: Option<Status>,
    planes: [Sectors<A, W>; P],
    assemblies: [Assembly; P],
    /// The scan at which old numbers were dropped last.
    purged: Option<ScanNumber>,
    sequences: [Counter; 32],
    counters: Counters,
}

impl<const A: usize, const W: usize, const P: usize> SensorReceiver<A, W, P> {
    /// Nothing heard yet.
    pub(super) const fn new() -> Self {
        Self {
            session: Session::none(),
            collector: Collector::NEW,
            fits: true,
            clock: None,
            status: None,
            planes: [const { Sectors::new() }; P],
            assemblies: [Assembly::NEW; P],
            purged: None,
            sequences: [Counter::NEW; 32],
            counters: Counters {
                accepted: 0,
                protection: 0,
                not_authentic: 0,
                lost: 0,
                repeated: 0,
                out_of_sequence: 0,
                late: 0,
                epoch: 0,
                early: 0,
                malformed: 0,
            },
        }
    }

    /// Its status, as far as it is heard.
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// What its maps are of, once complete.
    pub fn header(&self) -> Option<&Header> {
        self.collector.header().filter(|_| self.fits)
    }

    /// Its clock as it said last.
    pub fn clock(&self) -> Option<&Clock> {
        self.clock.as_ref()
    }

    /// The receiver's clock stepped back: nothing is shown before a new session.
    pub(super) fn step_back(&self) {
        self.session.step_back();
    }

    /// Its epoch.
    pub fn epoch(&self) -> Option<Epoch> {
        self.session.epoch()
    }

    /// What happened so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// How it is doing.
    pub fn condition(&self, now: Time, limits: &ReceiverLimits) -> SenderCondition {
        match () {
            () if self.session.conflicting(now) => SenderCondition::Conflict,
            () if !self.fits || self.session.speaks_otherwise(now) => SenderCondition::Unusable,
            () if self.session.epoch().is_none() => SenderCondition::Waiting,
            () if self.collector.header().is_none() => SenderCondition::NoHeader,
            () if self.session.trusted(now, &limits.bounded()) => SenderCondition::Ok,
            () => SenderCondition::Waiting,
        }
    }

    pub(super) fn trusted(&self, now: Time, limits: &ReceiverLimits) -> bool {
        self.condition(now, limits) == SenderCondition::Ok
    }

    /// A ray and its scan, if that is current.
    pub(super) fn current(
        &self,
        plane: Plane,
        azimuth: usize,
        now: Time,
        limits: &ReceiverLimits,
    ) -> Option<(Ray<W>, ScanNumber)> {
        let sector = self.planes.get(plane.index())?.now(azimuth);
        sector.filter(|(_, scan)| self.session.fresh(now, *scan, limits))
    }

    /// Counts what is refused.
    pub(super) fn refuse(&mut self, why: Refused) -> Refused {
        let c = &mut self.counters;
        let count = match why {
            Refused::NotAMessage(_) => &mut c.protection,
            Refused::Sealed | Refused::NotAuthentic(_) => &mut c.not_authentic,
            Refused::FirstOfEpoch | Refused::OldEpoch | Refused::Conflict => &mut c.epoch,
            Refused::Late | Refused::BeyondClock => &mut c.late,
            Refused::NoHeader | Refused::NoRefresh => &mut c.early,
            Refused::NotAHeader(_) | Refused::TooLarge | Refused::Malformed => &mut c.malformed,
        };
        *count = count.saturating_add(1);
        why
    }

    /// Takes a checked message of this sensor.
    pub(super) fn take(
        &mut self,
        now: Time,
        message: &Received<'_>,
        limits: &ReceiverLimits,
    ) -> Result<Accepted, Refused> {
        match self.take_checked(now, message, limits) {
            Ok(accepted) => {
                self.counters.accepted = self.counters.accepted.saturating_add(1);
                Ok(accepted)
            }
            Err(why) => Err(self.refuse(why)),
        }
    }

    fn take_checked(
        &mut self,
        now: Time,
        message: &Received<'_>,
        limits: &ReceiverLimits,
    ) -> Result<Accepted, Refused> {
        if message.sealed {
            return Err(Refused::Sealed);
        }
        // those of integrators and installations come from anybody and know nothing of the sender's epoch
        if let Message::Other(_) = message.message {
            return Ok(Accepted::Other(message.message));
        }
        let dated = matches!(message.message, Message::Map(..) | Message::VisibleRange);
        let whole = message.own.first().filter(|_| message.own.len() >= LEAST_DATED);
        let scan = whole.filter(|_| dated).map(|byte| ScanNumber::from_byte(*byte));
        match self.session.enter(now, message.epoch, scan, limits) {
            Entry::Taken => {}
            Entry::New => self.forget_all(),
            Entry::First => return Err(Refused::FirstOfEpoch),
            Entry::OldEpoch => return Err(Refused::OldEpoch),
            Entry::Conflict => return Err(Refused::Conflict),
        }
        self.follow(message);
        if dated {
            self.hear(now, scan.ok_or(Refused::Malformed)?, limits)?;
        }
        match message.message {
            Message::Status => {
                let mut status = self.status.unwrap_or_default();
                status.take(message.own).map_err(|_| Refused::Malformed)?;
                self.status = Some(status);
                Ok(Accepted::Status)
            }
            Message::Header => self.take_header(now, message.own, limits),
            Message::Map(plane, part) => self.take_map(message, plane, part),
            Message::VisibleRange => {
                Ranges::parse(message.own).ok_or(Refused::Malformed)?;
                Ok(Accepted::Other(message.message))
            }
            other => Ok(Accepted::Other(other)),
        }
    }

    fn forget_all(&mut self) {
        self.forget_maps();
        (self.collector, self.fits, self.clock, self.status) = (Collector::NEW, true, None, None);
        self.sequences = [Counter::NEW; 32];
    }

    fn forget_maps(&mut self) {
        self.planes.iter_mut().for_each(Sectors::forget);
        self.assemblies.iter_mut().for_each(Assembly::forget);
        self.purged = None;
    }

    /// Follows the protection's counter; it says how the bus is, never how maps are ordered.
    fn follow(&mut self, message: &Received<'_>) {
        let Some(counter) = self.sequences.get_mut(usize::from(message.message.number())) else { return };
        let c = &mut self.counters;
        match counter.follow(message.packing.profile(), message.counter, MOST_STEP) {
            Sequence::Ok => {}
            Sequence::SomeLost { lost } => c.lost = c.lost.saturating_add(u32::from(lost)),
            Sequence::Repeated => c.repeated = c.repeated.saturating_add(1),
            Sequence::Wrong => c.out_of_sequence = c.out_of_sequence.saturating_add(1),
        }
    }

    fn take_header(&mut self, now: Time, own: &[u8], limits: &ReceiverLimits) -> Result<Accepted, Refused> {
        match self.collector.take(own) {
            Ok(Brought::Contradiction) => {
                self.session.contradiction(now);
                return Err(Refused::Conflict);
            }
            Ok(Brought::Clock(clock)) => {
                self.clock = Some(clock);
                if self.session.hear_clock(now, &clock, limits) {
                    self.forget_maps();
                }
            }
            Ok(Brought::Group | Brought::Complete) => {}
            Err(error) => {
                if let NotAHeader::Version { .. } = error {
                    self.session.other_version(now);
                }
                return Err(Refused::NotAHeader(error));
            }
        }
        let fits = |header: &Header| usize::from(header.azimuths) <= A && usize::from(header.ranges) <= 32 * W;
        if self.collector.header().is_some_and(|header| !fits(header)) {
            self.fits = false;
            return Err(Refused::TooLarge);
        }
        Ok(Accepted::Header)
    }

    fn take_map(&mut self, message: &Received<'_>, plane: Plane, part: Part) -> Result<Accepted, Refused> {
        let long = !message.packing.is_classic();
        let map = map_message::parse(message.own, long).ok_or(Refused::Malformed)?;
        let header = self.collector.header().filter(|_| self.fits).ok_or(Refused::NoHeader)?;
        let accepted = Accepted::Map { scan: map.scan };
        if map.start >= usize::from(header.azimuths) {
            return Err(Refused::Malformed);
        }
        let stored = (self.planes.get_mut(plane.index()), self.assemblies.get_mut(plane.index()));
        let (Some(sectors), Some(assembly)) = stored else { return Ok(Accepted::Other(message.message)) };
        let context = header.context(message.packing.form());
        let index = match part {
            Part::Plain => {
                assembly.interrupt();
                let plain = map.plain(message.own, long).ok_or(Refused::Malformed)?;
                if let Plain::Whole(Ray { known, .. }) | Plain::Limits(known) = plain
                    && known.end() > context.ranges
                {
                    return Err(Refused::Malformed);
                }
                sectors.take_plain(map.start, map.scan, &plain);
                return Ok(accepted);
            }
            Part::Refresh | Part::Delta => 0,
            Part::More(_) if long => return Err(Refused::Malformed),
            Part::More(word) => word.index(),
        };
        let block = BlockKey { scan: map.scan, start: u8::try_from(map.start).map_err(|_| Refused::Malformed)? };
        let (words, delta): (&[u64], bool);
        let mut place = reading::Resume::START;
        let begun: Begun;
        if long {
            (words, delta) = (map.words(), part == Part::Delta);
        } else {
            let word = *map.words().first().ok_or(Refused::Malformed)?;
            match assembly.take(block, index, part == Part::Delta, word) {
                Some(more) => begun = more,
                None => return Ok(accepted),
            }
            (words, delta, place) = (begun.words(), begun.delta, begun.reading);
        }
        let kind = match (delta, reading::age(words, context.form)) {
            (false, _) => Basis::Refresh,
            (true, Some(ticks)) => Basis::Delta { ticks },
            (true, None) => return Err(Refused::Malformed),
        };
        let mut reader = BlockReader { sectors, kind, scan: map.scan };
        let ending = reading::decode(words, &context, kind, map.start, &mut place, &mut reader);
        if long {
            assembly.interrupt();
        } else {
            assembly.read_up_to(block, place, matches!(ending, Ending::Complete | Ending::Malformed));
        }
        match ending {
            Ending::Complete | Ending::OutOfWords => Ok(accepted),
            Ending::NoRefresh => Err(Refused::NoRefresh),
            Ending::Malformed => Err(Refused::Malformed),
        }
    }

    /// Looks at the lag of what a scan says.
    fn hear(&mut self, now: Time, scan: ScanNumber, limits: &ReceiverLimits) -> Result<(), Refused> {
        match self.session.hear(now, scan, limits) {
            Hearing::InTime => {}
            Hearing::Anew => self.forget_maps(),
            Hearing::Late => return Err(Refused::Late),
            Hearing::Beyond => return Err(Refused::BeyondClock),
        }
        self.purge(now, scan, limits);
        Ok(())
    }

    /// Once a scan, drops what is so old that its number could come again.
    fn purge(&mut self, now: Time, scan: ScanNumber, limits: &ReceiverLimits) {
        if self.purged == Some(scan) {
            return;
        }
        self.purged = Some(scan);
        let too_old = self.session.older_than(now, limits.dropped_us());
        self.planes.iter_mut().for_each(|sectors| sectors.purge(&too_old));
        self.assemblies.iter_mut().for_each(|assembly| assembly.purge(&too_old));
    }
}

/// Reads a block into sectors.
struct BlockReader<'a, const A: usize, const W: usize> {
    sectors: &'a mut Sectors<A, W>,
    kind: Basis,
    scan: ScanNumber,
}

impl<const A: usize, const W: usize> Reader<W> for BlockReader<'_, A, W> {
    fn was(&self, azimuth: usize) -> Option<Ray<W>> {
        match self.kind {
            Basis::Refresh => None,
            Basis::Delta { ticks } => self.sectors.refresh(azimuth, self.scan.before(ticks)),
        }
    }

    fn take(&mut self, azimuth: usize, ray: &Ray<W>) {
        self.sectors.take(azimuth, self.scan, ray, self.kind == Basis::Refresh);
    }

    fn taken(&self, azimuth: usize) -> Option<Ray<W>> {
        self.sectors.now(azimuth).filter(|(_, scan)| *scan == self.scan).map(|(ray, _)| ray)
    }
}
