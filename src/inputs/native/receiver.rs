//! Messages in, scans out.

use super::message::{self, Header, MOST_BYTES, NativeEntry, NativeMedium, NoMessage};
use crate::camera::boxes::ImageBox;
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::inputs::collected::{Added, Collected};
use crate::inputs::{RadarScan, count, usable};
use crate::wire::e2e::{Counter, E2eError, Profile, Sequence};
use crate::wire::frame::CanFrame;
use crate::wire::frame::CanId;
use crate::wire::serial::Unstuffer;

/// Which sensor is listened to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NativeConfig {
    /// The sensor.
    pub sensor: u8,
    /// Identifier of its CAN FD frames.
    pub id: CanId,
    /// A scan is over when nothing of it has come for so long, whatever is missing.
    pub timeout_us: u32,
}

impl NativeConfig {
    /// A sensor under its usual identifier; scans are over after 100 ms of silence.
    pub const fn sensor(sensor: u8) -> Self {
        Self { sensor, id: message::id(sensor), timeout_us: 100_000 }
    }

    /// The same for a camera.
    pub const fn camera(sensor: u8) -> Self {
        Self { sensor, id: message::box_id(sensor), timeout_us: 100_000 }
    }
}

/// What a message led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NativeOutcome<'a, T = Detection> {
    /// It is none of this sensor's.
    NotMine,
    /// It was taken, and nothing is complete yet.
    Taken,
    /// A scan is over.
    Scan(RadarScan<'a, T>),
    /// A scan is over of which most did not arrive; it is dropped, as it would be taken for a free road.
    Broken {
        /// Parts announced.
        announced: u16,
        /// Parts that arrived.
        arrived: u16,
    },
    /// It does not fit.
    Refused(Refusal),
}

/// Why a message was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Damaged, too short, or another sensor's.
    Check(E2eError),
    /// Of a version this receiver does not know.
    Version(u8),
    /// Its part is none of the announced ones, or the scan was announced with another number of
    /// parts or another time.
    Inconsistent,
    /// The same part again.
    Repeated,
    /// Of a scan that is over.
    Late,
    /// The scan before was not fetched by [`NativeReceiver::poll`].
    NotPolled,
}

/// What was seen and what was wrong, since the start; saturating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NativeCounters {
    /// Messages whose check sum fits.
    pub messages: u32,
    /// Scans given out.
    pub scans: u32,
    /// Of these, scans of which something was missing.
    pub incomplete: u32,
    /// Scans dropped because most was missing.
    pub broken: u32,
    /// Messages that never came, by their counter.
    pub lost: u32,
    /// Messages damaged, too short, or another sensor's.
    pub damaged: u32,
    /// Messages of an unknown version.
    pub version: u32,
    /// Messages that contradict others.
    pub inconsistent: u32,
    /// Parts that came twice.
    pub repeated: u32,
    /// Parts of scans that were over.
    pub late: u32,
    /// Messages that came before the scan before was fetched.
    pub not_polled: u32,
    /// Detections dropped because the list was full, of crowded places first.
    pub overflow: u32,
}

/// Collects the scans of one sensor from whole messages.
///
/// # Limits
/// `N` detections a scan, thinned where more are sent, or the largest boxes. After [`push`](Self::push), call
/// [`poll`](Self::poll) until it returns `None`: a message can end one scan and begin another.
/// After a restart of the sender up to 8 scans are refused as late.
#[derive(Debug, Clone)]
pub struct NativeReceiver<const N: usize, T: NativeEntry = Detection> {
    config: NativeConfig,
    collected: Collected<N, T>,
    /// The last scan has been given out and its detections may go.
    given_out: bool,
    scan: Option<Scan>,
    /// Number of the newest scan.
    newest: Option<u8>,
    /// A message that ended a scan and is still to be taken.
    waiting: Option<(Time, [u8; MOST_BYTES], usize)>,
    counter: Counter,
    counters: NativeCounters,
}

/// A scan under way.
#[derive(Debug, Clone)]
struct Scan {
    number: u8,
    parts: u8,
    time: Time,
    fault: bool,
    received: Time,
    latest: Time,
    seen: [u32; 8],
    arrived: u16,
    refused: u16,
    medium: NativeMedium,
}

/// A scan number this far before the newest is late; farther, the sender started over.
const LATE: u8 = 8;

impl<const N: usize> NativeReceiver<N> {
    /// Of a radar, before the first message.
    pub const fn new(config: NativeConfig) -> Self {
        Self::empty(config)
    }
}

impl<const N: usize> NativeReceiver<N, ImageBox> {
    /// Of a camera, before the first message.
    pub const fn boxes(config: NativeConfig) -> Self {
        Self::empty(config)
    }
}

impl<const N: usize, T: NativeEntry> NativeReceiver<N, T> {
    pub(crate) const fn empty(config: NativeConfig) -> Self {
        Self {
            config,
            collected: Collected::new(),
            given_out: false,
            scan: None,
            newest: None,
            waiting: None,
            counter: Counter::NEW,
            counters: NativeCounters {
                messages: 0,
                scans: 0,
                incomplete: 0,
                broken: 0,
                lost: 0,
                damaged: 0,
                version: 0,
                inconsistent: 0,
                repeated: 0,
                late: 0,
                not_polled: 0,
                overflow: 0,
            },
        }
    }

    /// Takes a frame, any frame of the bus.
    pub fn push_frame(&mut self, frame: &CanFrame, now: Time) -> NativeOutcome<'_, T> {
        if frame.id == self.config.id { self.push(frame.data(), now) } else { NativeOutcome::NotMine }
    }

    /// Takes a message of up to 240 bytes.
    pub fn push(&mut self, bytes: &[u8], now: Time) -> NativeOutcome<'_, T> {
        if self.waiting.is_some() {
            count(&mut self.counters.not_polled);
            return NativeOutcome::Refused(Refusal::NotPolled);
        }
        let header = match message::read(bytes, T::data_id(self.config.sensor)) {
            Ok((counter, header)) => {
                count(&mut self.counters.messages);
                if let Sequence::SomeLost { lost } = self.counter.follow(Profile::P05, counter, 128) {
                    self.counters.lost = self.counters.lost.saturating_add(u32::from(lost));
                }
                header
            }
            Err(NoMessage::E2e(why)) => {
                count(&mut self.counters.damaged);
                return NativeOutcome::Refused(Refusal::Check(why));
            }
            Err(NoMessage::Version(version)) => {
                count(&mut self.counters.version);
                return NativeOutcome::Refused(Refusal::Version(version));
            }
        };
        if header.part >= header.parts {
            count(&mut self.counters.inconsistent);
            return NativeOutcome::Refused(Refusal::Inconsistent);
        }
        let current = self.scan.as_ref().map(|s| s.number);
        if current != Some(header.scan) {
            if self.newest.is_some_and(|newest| newest.wrapping_sub(header.scan) <= LATE) {
                count(&mut self.counters.late);
                return NativeOutcome::Refused(Refusal::Late);
            }
            if current.is_some() {
                self.wait(bytes, now);
                return self.end().unwrap_or(NativeOutcome::Taken);
            }
        }
        self.take(&header, bytes, now)
    }

    /// Gives out what is over; to be called after each message, until there is nothing more.
    pub fn poll(&mut self, now: Time) -> Option<NativeOutcome<'_, T>> {
        if let Some((came, bytes, length)) = self.waiting.take() {
            let bytes = bytes.get(..length)?;
            let (_, header) = message::read(bytes, T::data_id(self.config.sensor)).ok()?;
            return match self.take(&header, bytes, came) {
                NativeOutcome::Taken => None,
                outcome => Some(outcome),
            };
        }
        let scan = self.scan.as_ref()?;
        // a clock that stepped back would hold the scan for ever
        let silent = now.since(scan.latest).is_none_or(|silence| silence > u64::from(self.config.timeout_us));
        if silent { self.end() } else { None }
    }

    /// What was seen and what was wrong.
    pub fn counters(&self) -> &NativeCounters {
        &self.counters
    }

    /// Which sensor it listens to.
    pub fn config(&self) -> &NativeConfig {
        &self.config
    }

    /// Keeps a message until the scan it ended has been given out.
    fn wait(&mut self, bytes: &[u8], now: Time) {
        let mut kept = [0; MOST_BYTES];
        if let Some(place) = kept.get_mut(..bytes.len()) {
            place.copy_from_slice(bytes);
            self.waiting = Some((now, kept, bytes.len()));
        }
    }

    /// Takes a part of the scan under way, or of a new one.
    fn take(&mut self, header: &Header, bytes: &[u8], now: Time) -> NativeOutcome<'_, T> {
        if core::mem::take(&mut self.given_out) {
            self.collected.clear();
        }
        self.newest = Some(header.scan);
        let scan = self.scan.get_or_insert(Scan {
            number: header.scan,
            parts: header.parts,
            time: header.time,
            fault: false,
            received: now,
            latest: now,
            seen: [0; 8],
            arrived: 0,
            refused: 0,
            medium: header.medium,
        });
        if scan.parts != header.parts || scan.time != header.time {
            count(&mut self.counters.inconsistent);
            return NativeOutcome::Refused(Refusal::Inconsistent);
        }
        let bit = 1 << (header.part & 31);
        match scan.seen.get_mut(usize::from(header.part >> 5)) {
            Some(seen) if *seen & bit == 0 => *seen |= bit,
            _ => {
                count(&mut self.counters.repeated);
                return NativeOutcome::Refused(Refusal::Repeated);
            }
        }
        scan.latest = now;
        scan.fault |= header.fault;
        scan.arrived += 1;
        for entry in message::records(bytes) {
            match entry.map(|entry| self.collected.add(0, entry)) {
                Some(Added::Kept) => {}
                Some(Added::Full) => count(&mut self.counters.overflow),
                None => scan.refused = scan.refused.saturating_add(1),
            }
        }
        if scan.arrived == u16::from(scan.parts) {
            self.end().unwrap_or(NativeOutcome::Taken)
        } else {
            NativeOutcome::Taken
        }
    }

    fn end(&mut self) -> Option<NativeOutcome<'_, T>> {
        let scan = self.scan.take()?;
        self.given_out = true;
        let announced = u16::from(scan.parts);
        if !usable(announced, scan.arrived) {
            count(&mut self.counters.broken);
            return Some(NativeOutcome::Broken { announced, arrived: scan.arrived });
        }
        count(&mut self.counters.scans);
        if scan.arrived < announced {
            count(&mut self.counters.incomplete);
        }
        #[allow(clippy::cast_possible_truncation)] // at most 22
        let missing = (announced - scan.arrived).saturating_mul(scan.medium.detections() as u16);
        Some(NativeOutcome::Scan(RadarScan {
            time: scan.time,
            received: scan.received,
            number: u32::from(scan.number),
            detections: self.collected.detections(),
            all: self.collected.detections(),
            missing,
            refused: scan.refused,
            fault: scan.fault,
        }))
    }
}

/// Collects the scans of one sensor from a serial line.
#[derive(Debug, Clone)]
pub struct NativeSerialReceiver<const N: usize, T: NativeEntry = Detection> {
    unstuffer: Unstuffer,
    receiver: NativeReceiver<N, T>,
}

impl<const N: usize> NativeSerialReceiver<N> {
    /// Of a radar, before the first byte.
    pub const fn new(config: NativeConfig) -> Self {
        Self { unstuffer: Unstuffer::new(), receiver: NativeReceiver::new(config) }
    }
}

impl<const N: usize> NativeSerialReceiver<N, ImageBox> {
    /// Of a camera, before the first byte.
    pub const fn boxes(config: NativeConfig) -> Self {
        Self { unstuffer: Unstuffer::new(), receiver: NativeReceiver::boxes(config) }
    }
}

impl<const N: usize, T: NativeEntry> NativeSerialReceiver<N, T> {
    /// Takes bytes up to the end of a message and says how many: the rest is to be pushed again, after
    /// [`poll`](Self::poll).
    pub fn push(&mut self, bytes: &[u8], now: Time) -> (usize, NativeOutcome<'_, T>) {
        let (taken, message) = self.unstuffer.push(bytes);
        (taken, message.map_or(NativeOutcome::Taken, |message| self.receiver.push(message, now)))
    }

    /// Gives out what is over; to be called after each push, until there is nothing more.
    pub fn poll(&mut self, now: Time) -> Option<NativeOutcome<'_, T>> {
        self.receiver.poll(now)
    }

    /// What was seen and what was wrong.
    pub fn counters(&self) -> &NativeCounters {
        self.receiver.counters()
    }

    /// Messages that were too long or ended in the middle.
    pub fn framing_errors(&self) -> u32 {
        self.unstuffer.errors()
    }
}

const _: () = assert!(NativeMedium::CanFd.detections() == 5 && NativeMedium::Serial.detections() == 22);
