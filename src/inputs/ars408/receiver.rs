//! CAN frames of one sensor in, complete scans out.

use super::counter::{Advance, MeasurementCounter};
use super::message::Message;
use super::profile::{Ars408Profile, CountRule, General};
use super::quality::{self, Ars408Wanted};
use super::state::{RadarState, Version};
use crate::fixed::time::Time;
use crate::inputs::collected::{Added, Collected};
use crate::inputs::signal::{Signal, word};
use crate::inputs::{RadarScan, count, usable};
use crate::wire::frame::CanFrame;

/// Fields of the status message of a scan of clusters.
pub mod cluster_status {
    use super::Signal;

    /// Clusters of the near scan.
    pub const NEAR: Signal = Signal::new(7, 8);
    /// Clusters of the far scan.
    pub const FAR: Signal = Signal::new(15, 8);
    /// Measurement counter.
    pub const COUNTER: Signal = Signal::new(23, 16);
    /// Version of the interface.
    pub const VERSION: Signal = Signal::new(39, 4);
}

/// Fields of the status message of a scan of objects.
pub mod object_status {
    use super::Signal;

    /// Objects.
    pub const NUMBER: Signal = Signal::new(7, 8);
    /// Measurement counter.
    pub const COUNTER: Signal = Signal::new(15, 16);
    /// Version of the interface.
    pub const VERSION: Signal = Signal::new(31, 4);
}

/// Which sensor is listened to, and to what of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ars408Config {
    /// Its id, 0 to 7.
    pub sensor: u8,
    /// Its kind.
    pub profile: Ars408Profile,
    /// Which entries are wanted, by its own marks.
    pub wanted: Ars408Wanted,
    /// A scan is over when nothing of it has come for so long, whatever is missing; shorter than the
    /// pause between two scans, so that entries whose status message was lost do not fill the gaps of
    /// the scan before.
    pub timeout_us: u32,
}

impl Ars408Config {
    /// An ARS408 of a sensor id: entries it measured, scans over after 30 ms of silence.
    pub const fn sensor(sensor: u8) -> Self {
        Self { sensor, profile: Ars408Profile::ARS408, wanted: Ars408Wanted::MEASURED, timeout_us: 30_000 }
    }
}

/// What a frame led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ars408Outcome<'a> {
    /// It is none of this sensor's.
    NotMine,
    /// It was taken, and nothing is complete yet.
    Taken,
    /// A scan is over.
    Scan(RadarScan<'a>),
    /// A scan is over of which most did not arrive; it is dropped, as it would be taken for a free road.
    Broken {
        /// Entries announced.
        announced: u16,
        /// Entries that arrived.
        arrived: u16,
    },
    /// What the sensor says of itself.
    State(RadarState),
    /// Its software.
    Version(Version),
    /// It does not fit.
    Refused(Refusal),
}

/// Why a frame was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Fewer bytes than the message has.
    TooShort {
        /// Which message.
        message: Message,
        /// Bytes there are.
        length: usize,
    },
    /// No status message announced it: lost, or a log that begins within a scan.
    NoScan,
    /// The same status or entry again.
    Repeated,
    /// More entries than announced.
    Surplus,
    /// Quality of an entry that did not arrive.
    UnknownEntry,
}

/// What was seen and what was wrong, since the start; saturating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ars408Counters {
    /// Frames of this sensor.
    pub frames: u32,
    /// Scans given out.
    pub scans: u32,
    /// Of these, scans of which something was missing.
    pub incomplete: u32,
    /// Scans dropped because most was missing.
    pub broken: u32,
    /// Scans that never came, by the sensor's counter.
    pub lost: u32,
    /// Times the sensor's counter started over.
    pub restarts: u32,
    /// Frames too short.
    pub too_short: u32,
    /// Entries without a status message.
    pub no_scan: u32,
    /// Status messages or entries that came twice.
    pub repeated: u32,
    /// Entries beyond those announced. From the third scan in a row on they are taken.
    pub surplus: u32,
    /// Qualities of entries that did not arrive.
    pub unknown_entry: u32,
    /// Entries at no distance, or beyond 655 m.
    pub no_range: u32,
    /// Entries left out by the sensor's own marks.
    pub unwanted: u32,
    /// Entries dropped because the list was full, of crowded places first.
    pub overflow: u32,
}

/// Collects the scans of one sensor; several on a bus have one each and are all given every frame.
///
/// # Limits
/// `N` entries a scan; of more, crowded places give way first, then the least RCS. Where a status message is lost and scans follow each
/// other without a pause, entries can fill the gaps of the scan before. Whether quality messages follow is learnt: before the
/// first of them, or the first state message, scans are given out without waiting for them. Some gateways and clones announce fewer
/// entries than they send, or none: after two such scans in a row what is announced counts no longer, and a scan is over when
/// nothing more of it comes, until eight in a row had no more than announced.
#[derive(Debug, Clone)]
pub struct Ars408<const N: usize> {
    config: Ars408Config,
    collected: Collected<N>,
    scan: Option<Gathering>,
    /// The last scan has been given out and its entries may go.
    given_out: bool,
    /// Quality messages follow.
    quality: bool,
    counter: MeasurementCounter,
    fault: bool,
    announcements: Announcements,
    counters: Ars408Counters,
}

/// Scans in a row with more entries than announced, from which on these are taken.
const MORE: u8 = 2;
/// Scans in a row without, from which on announcements count again.
const NO_MORE: u8 = 8;

/// Whether as many entries come as are announced.
#[derive(Debug, Clone, Copy, Default)]
struct Announcements {
    /// Kind, entries and latest frame of the scan that was given out last.
    last: Option<(bool, Numbers, Time)>,
    /// More came of the scan under way, or of the last.
    more: bool,
    /// Scans in a row of which more came.
    scans: u8,
    /// Scans in a row since then of which no more came.
    as_announced: u8,
}

impl Announcements {
    const NEW: Self = Self { last: None, more: false, scans: 0, as_announced: 0 };

    /// Whether an entry without a scan is one of the last.
    fn is_of_last(&self, objects: bool, number: u16, now: Time, timeout_us: u32) -> bool {
        self.last.as_ref().is_some_and(|(of, numbers, latest)| {
            let soon = now.since(*latest).is_some_and(|us| us <= u64::from(timeout_us));
            *of == objects && soon && !numbers.contains(number)
        })
    }

    /// Takes note that one came.
    fn beyond(&mut self, number: u16, now: Time) {
        self.more = true;
        if let Some((_, numbers, latest)) = &mut self.last {
            numbers.insert(number);
            *latest = now;
        }
    }

    /// Takes note that a status message came, and says whether entries beyond those it announces are taken.
    fn next(&mut self) -> bool {
        (self.scans, self.as_announced) = match (core::mem::take(&mut self.more), self.scans >= MORE) {
            (true, _) => (self.scans.saturating_add(1), 0),
            (false, true) if self.as_announced < NO_MORE => (self.scans, self.as_announced + 1),
            (false, _) => (0, 0),
        };
        self.scans >= MORE
    }
}

/// A scan under way.
#[derive(Debug, Clone)]
struct Gathering {
    objects: bool,
    number: u16,
    started: Time,
    /// When its latest frame came.
    latest: Time,
    announced: u16,
    /// More may come.
    open: bool,
    arrived: u16,
    /// Of these, entries at no distance.
    refused: u16,
    qualified: u16,
    entries: Numbers,
    qualities: Numbers,
    /// Where the next quality message's entry probably lies.
    next: usize,
}

/// A set of entry numbers.
#[derive(Debug, Clone, Copy, Default)]
struct Numbers([u32; 8]);

impl Numbers {
    /// Adds a number; whether it was not there.
    fn insert(&mut self, number: u16) -> bool {
        let bit = 1 << (number & 31);
        match self.0.get_mut(usize::from(number >> 5)) {
            Some(word) if *word & bit == 0 => {
                *word |= bit;
                true
            }
            _ => false,
        }
    }

    fn contains(&self, number: u16) -> bool {
        self.0.get(usize::from(number >> 5)).is_some_and(|word| word >> (number & 31) & 1 == 1)
    }
}

impl<const N: usize> Ars408<N> {
    /// Before the first frame.
    pub const fn new(config: Ars408Config) -> Self {
        Self {
            config,
            collected: Collected::new(),
            scan: None,
            given_out: false,
            quality: false,
            counter: MeasurementCounter::NEW,
            fault: false,
            announcements: Announcements::NEW,
            counters: Ars408Counters {
                frames: 0,
                scans: 0,
                incomplete: 0,
                broken: 0,
                lost: 0,
                restarts: 0,
                too_short: 0,
                no_scan: 0,
                repeated: 0,
                surplus: 0,
                unknown_entry: 0,
                no_range: 0,
                unwanted: 0,
                overflow: 0,
            },
        }
    }

    /// Takes a frame, any frame of the bus.
    pub fn push(&mut self, frame: &CanFrame, now: Time) -> Ars408Outcome<'_> {
        let message = match Message::of(frame.id) {
            Some((message, sensor)) if sensor == self.config.sensor && message.sent_by_sensor() && !frame.fd => message,
            _ => return Ars408Outcome::NotMine,
        };
        count(&mut self.counters.frames);
        let data = frame.data();
        if data.len() < message.length() {
            count(&mut self.counters.too_short);
            return Ars408Outcome::Refused(Refusal::TooShort { message, length: data.len() });
        }
        let entry = matches!(message, Message::ClusterGeneral | Message::ObjectGeneral);
        if entry || matches!(message, Message::ClusterQuality | Message::ObjectQuality) {
            if self.scan.as_ref().is_some_and(|s| s.timed_out(now, self.config.timeout_us)) {
                // it belongs to a scan whose status message was lost
                if entry {
                    count(&mut self.counters.no_scan);
                }
                return self.end().unwrap_or(Ars408Outcome::Taken);
            }
            if let Some(scan) = &mut self.scan {
                scan.latest = now;
            }
        }
        let word = word(data);
        match message {
            Message::ClusterStatus => self.begin(false, word, now),
            Message::ObjectStatus => self.begin(true, word, now),
            Message::ClusterGeneral => self.entry(false, word, now),
            Message::ObjectGeneral => self.entry(true, word, now),
            Message::ClusterQuality => self.quality(false, word),
            Message::ObjectQuality => self.quality(true, word),
            Message::RadarState => match RadarState::read(data) {
                Some(state) => {
                    self.fault = state.fault();
                    self.quality |= state.quality;
                    Ars408Outcome::State(state)
                }
                None => Ars408Outcome::Taken,
            },
            Message::Version => Version::read(data).map_or(Ars408Outcome::Taken, Ars408Outcome::Version),
            _ => Ars408Outcome::Taken,
        }
    }

    /// Gives out a scan that waits for frames no longer; to be called now and then.
    pub fn poll(&mut self, now: Time) -> Option<Ars408Outcome<'_>> {
        let scan = self.scan.as_ref()?;
        if scan.timed_out(now, self.config.timeout_us) || scan.complete(self.quality) { self.end() } else { None }
    }

    /// What was seen and what was wrong.
    pub fn counters(&self) -> &Ars408Counters {
        &self.counters
    }

    /// Which sensor it listens to.
    pub fn config(&self) -> &Ars408Config {
        &self.config
    }

    fn begin(&mut self, objects: bool, word: u64, now: Time) -> Ars408Outcome<'_> {
        let (announced, number) = self.status(objects, word);
        match self.counter.follow(number) {
            Advance::Same if self.scan.as_ref().is_some_and(|s| s.arrived == 0 && s.announced == announced) => {
                count(&mut self.counters.repeated);
                return Ars408Outcome::Refused(Refusal::Repeated);
            }
            Advance::Lost(scans) => self.counters.lost = self.counters.lost.saturating_add(u32::from(scans)),
            Advance::Restarted => count(&mut self.counters.restarts),
            Advance::Same | Advance::Next => {}
        }
        let unfinished = self.scan.is_some();
        let next = Gathering {
            objects,
            number,
            started: now,
            latest: now,
            announced,
            open: self.announcements.next(),
            arrived: 0,
            refused: 0,
            qualified: 0,
            entries: Numbers::default(),
            qualities: Numbers::default(),
            next: 0,
        };
        if unfinished {
            // the entries of the one before stay until the next frame
            let before = self.scan.replace(next);
            return before.map_or(Ars408Outcome::Taken, |before| self.give_out(before));
        }
        self.scan = Some(next);
        self.end_if_complete()
    }

    /// Entries announced and measurement counter of a status message.
    #[allow(clippy::cast_possible_truncation)] // at most 16 bits
    fn status(&self, objects: bool, word: u64) -> (u16, u16) {
        if objects {
            return (object_status::NUMBER.get(word) as u16, object_status::COUNTER.get(word) as u16);
        }
        let (near, far) = (cluster_status::NEAR.get(word) as u16, cluster_status::FAR.get(word) as u16);
        let announced = match self.config.profile.clusters {
            CountRule::NearAndFar => near + far,
            CountRule::Wide => near << 8 | far,
        };
        (announced, cluster_status::COUNTER.get(word) as u16)
    }

    fn general(&self, objects: bool) -> &General {
        if objects { &self.config.profile.object } else { &self.config.profile.cluster }
    }

    fn entry(&mut self, objects: bool, word: u64, now: Time) -> Ars408Outcome<'_> {
        self.forget_given_out();
        let (number, detection) = self.general(objects).read(word);
        let Some(scan) = self.scan.as_mut().filter(|s| s.objects == objects) else {
            if self.announcements.is_of_last(objects, number, now, self.config.timeout_us) {
                self.announcements.beyond(number, now);
                count(&mut self.counters.surplus);
                return Ars408Outcome::Refused(Refusal::Surplus);
            }
            count(&mut self.counters.no_scan);
            return Ars408Outcome::Refused(Refusal::NoScan);
        };
        // of more than 256 entries numbers come twice
        if scan.entries.contains(number) && scan.announced <= 256 {
            count(&mut self.counters.repeated);
            return Ars408Outcome::Refused(Refusal::Repeated);
        }
        if scan.arrived >= scan.announced {
            self.announcements.more = true;
            if !scan.open {
                count(&mut self.counters.surplus);
                return Ars408Outcome::Refused(Refusal::Surplus);
            }
        }
        scan.entries.insert(number);
        scan.arrived = scan.arrived.saturating_add(1);
        if scan.arrived > scan.announced {
            count(&mut self.counters.surplus);
            scan.announced = scan.arrived;
        }
        match detection.map(|d| self.collected.add(number, d)) {
            None => {
                scan.refused += 1;
                count(&mut self.counters.no_range);
            }
            Some(Added::Full) => count(&mut self.counters.overflow),
            Some(Added::Kept) => {}
        }
        self.end_if_complete()
    }

    #[allow(clippy::cast_possible_truncation)] // 8 bits
    fn quality(&mut self, objects: bool, word: u64) -> Ars408Outcome<'_> {
        let (number, wanted) = if objects {
            (quality::object::NUMBER.get(word) as u16, self.config.wanted.object(word))
        } else {
            (quality::cluster::NUMBER.get(word) as u16, self.config.wanted.cluster(word))
        };
        let Some(scan) = self.scan.as_mut().filter(|s| s.objects == objects) else {
            // of a scan given out without waiting for it; the next one will wait
            self.quality = true;
            return Ars408Outcome::Taken;
        };
        self.quality = true;
        if !scan.entries.contains(number) {
            count(&mut self.counters.unknown_entry);
            return Ars408Outcome::Refused(Refusal::UnknownEntry);
        }
        if !scan.qualities.insert(number) && scan.announced <= 256 {
            count(&mut self.counters.repeated);
            return Ars408Outcome::Refused(Refusal::Repeated);
        }
        scan.qualified += 1;
        if let Some(place) = self.collected.place(number, scan.next) {
            scan.next = place + 1;
            if !wanted {
                count(&mut self.counters.unwanted);
                self.collected.reject(place);
            }
        }
        self.end_if_complete()
    }

    fn forget_given_out(&mut self) {
        if core::mem::take(&mut self.given_out) {
            self.collected.clear();
        }
    }

    fn end_if_complete(&mut self) -> Ars408Outcome<'_> {
        if self.scan.as_ref().is_some_and(|s| s.complete(self.quality)) {
            self.end().unwrap_or(Ars408Outcome::Taken)
        } else {
            Ars408Outcome::Taken
        }
    }

    fn end(&mut self) -> Option<Ars408Outcome<'_>> {
        let scan = self.scan.take()?;
        Some(self.give_out(scan))
    }

    fn give_out(&mut self, scan: Gathering) -> Ars408Outcome<'_> {
        // a scan without entries has none of the scan before
        self.forget_given_out();
        self.given_out = true;
        self.announcements.last = Some((scan.objects, scan.entries, scan.latest));
        if scan.arrived > 0 && scan.qualified == 0 {
            // it has waited in vain
            self.quality = false;
        }
        if !usable(scan.announced, scan.arrived) {
            count(&mut self.counters.broken);
            return Ars408Outcome::Broken { announced: scan.announced, arrived: scan.arrived };
        }
        count(&mut self.counters.scans);
        let missing = scan.announced.saturating_sub(scan.arrived);
        if missing > 0 || (self.quality && scan.qualified < scan.arrived) {
            count(&mut self.counters.incomplete);
        }
        self.collected.finish();
        Ars408Outcome::Scan(RadarScan {
            time: scan.started,
            received: scan.started,
            number: u32::from(scan.number),
            detections: self.collected.wanted(),
            all: self.collected.detections(),
            missing,
            refused: scan.refused,
            fault: self.fault,
        })
    }
}

impl Gathering {
    fn timed_out(&self, now: Time, timeout_us: u32) -> bool {
        // a clock that stepped back would hold the scan for ever
        now.since(self.latest).is_none_or(|silence| silence > u64::from(timeout_us))
    }

    fn complete(&self, quality: bool) -> bool {
        !self.open && self.arrived == self.announced && (!quality || self.qualified == self.announced)
    }
}
