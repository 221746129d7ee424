//! Maps in, messages out, one at a time and never too late: the sender.
//!
//! # Model
//! [`Broadcaster::scan`] takes a map, [`Broadcaster::status_mut`] what is to be said of the sender;
//! [`Broadcaster::next_frame`] (CAN, CAN FD) or [`Broadcaster::next_line`] (serial) gives the next frame
//! that is due, or none yet. It never waits. A caller asks after every frame and once a millisecond.
//!
//! What goes first: freshness value, status, header, map, visible range. Between two frames lies the minimum gap.
//!
//! *Refresh.* A map is refreshed whole when the last refresh is 180 ms old, the scans between are encoded
//! against it. The whole header is sent at once at an epoch's start; its groups and the pages of the status go
//! round all the time. So who joins late on classic CAN has the header within half a second and all pages of the status
//! within one and a half; in long form each message has everything.
//!
//! *Probability.* With levels in the header the second plane is that of probability. It goes out by halves, right and left in
//! turn, each with a scan that is 60 ms younger than the last one that brought a half.
//!
//! *What is dropped.* A new map ends the one before: what of that was not handed out is dropped, and
//! the new one begins at the azimuth where the old one broke off, so that on a bus too narrow every
//! azimuth has its turn. What of a map is not handed out within [`BroadcastConfig::stale_ms`] of its
//! measurement is dropped too. Azimuths dropped are counted in the status. Nothing is sent late: a
//! caller aborts what its mailboxes still hold after [`Broadcaster::deadline`].
//!
//! *Quiet.* After the start, after [`Broadcaster::restart`], [`Broadcaster::start_over`] and after a clock that stepped back by more than the greatest
//! delay the epoch is a new one, and no map is sent for the greatest age and delay together: by then nothing of the old
//! epoch is under way.
//!
//! # Limits
//! 50 scans a second. Two maps of `A` rays for each of `P` planes.

mod config;
mod messages;
mod outgoing_plane;
mod pace;

pub use config::{BroadcastConfig, Medium};

use self::config::within;
use self::outgoing_plane::{Next, OutgoingPlane};
use self::pace::Every;
use super::frame::{CanFrame, fd_length};
use super::header::Header;
use super::message::{Epoch, Message, Packet, Packing, Plane};
use super::planes::Planes;
use super::scan_number::ScanNumber;
#[cfg(feature = "secoc")]
use super::secoc::{Key, Sealer};
use super::serial;
use super::status::Status;
use crate::fixed::time::Time;
use crate::sensor::config::ConfigError;

/// Age of the last whole refresh at which the next is due, ticks of 20 ms.
const REFRESH_TICKS: u8 = 9;

/// Age of the last half of the plane of probability at which the other is due: it costs more than visibility, and a
/// receiver holds it for the greatest age, so that one of the same half may be lost.
const PROBABILITY_US: u64 = 60_000;

/// Why a map is not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotSent {
    /// Within 20 ms of the one before, or before that by no more than the greatest delay.
    TooSoon,
    /// The epoch is new and nothing of the old one may be under way.
    Quiet,
}

/// A block or a ray on its way, message by message.
#[derive(Debug, Clone, Copy)]
struct Running {
    plane: usize,
    next: Next,
    /// Messages handed out of it.
    sent: u8,
}

/// The scan being sent.
#[derive(Debug, Clone, Copy)]
struct Outgoing {
    number: ScanNumber,
    measured: Time,
    /// Whether it refreshes everything.
    all: bool,
    running: Option<Running>,
}

/// Sends the maps of one sensor: at most `A` azimuths of `32 W` ranges, the first `P` planes.
#[derive(Debug, Clone)]
pub struct Broadcaster<const A: usize, const W: usize, const P: usize = 1> {
    config: BroadcastConfig,
    header: Header,
    epoch: Epoch,
    synchronised: bool,
    status: Status,
    /// Whether something was dropped for want of time since that was last asked.
    overloaded: bool,
    planes: [OutgoingPlane<A, W>; P],
    scan: Option<Outgoing>,
    /// The scan before, and when it was measured.
    last: Option<Time>,
    /// The last scan that began to refresh everything.
    refreshed: Option<Time>,
    /// The last scan with half of the plane of probability, and whether it was the left one.
    probable: Option<(Time, bool)>,
    /// Where the next map begins.
    from: usize,
    started: Time,
    quiet_until: Time,
    gap: Every,
    status_due: Every,
    header_due: Every,
    range_due: Option<Every>,
    freshness_due: Every,
    page: u8,
    group: u8,
    /// Messages of the header still to be sent at an epoch's start.
    groups_first: u8,
    range_from: usize,
    counters: [u8; 32],
}

impl<const A: usize, const W: usize, const P: usize> Broadcaster<A, W, P> {
    /// Starts an epoch; one that the sender did not use lately, from a counter kept over restarts or
    /// from noise.
    ///
    /// # Errors
    /// Names the parameter that cannot be worked with.
    pub fn new(config: BroadcastConfig, header: Header, epoch: Epoch, now: Time) -> Result<Self, ConfigError> {
        config.check()?;
        let mut new = Self::blank(config, header, epoch, now);
        new.begin(header, now)?;
        Ok(new)
    }

    /// The same where the sender stays: controllers have no stack for a second.
    ///
    /// # Errors
    /// As [`new`](Self::new); there is no sender then.
    pub fn start(
        place: &mut Option<Self>,
        config: BroadcastConfig,
        header: Header,
        epoch: Epoch,
        now: Time,
    ) -> Result<(), ConfigError> {
        *place = None;
        config.check()?;
        Self::fits(&header)?;
        place.insert(Self::blank(config, header, epoch, now)).begin(header, now)
    }

    /// Before its first epoch.
    #[inline(always)] // made where it stays
    pub(crate) fn blank(config: BroadcastConfig, header: Header, epoch: Epoch, now: Time) -> Self {
        Self {
            config,
            header,
            epoch,
            synchronised: false,
            status: Status::starting(header.fingerprint),
            overloaded: false,
            planes: [const { OutgoingPlane::new() }; P],
            scan: None,
            last: None,
            refreshed: None,
            probable: None,
            from: 0,
            started: now,
            quiet_until: now,
            gap: Every::new(now, u64::from(config.gap_us)),
            status_due: Every::new(now, u64::from(config.status_ms) * 1000),
            header_due: Every::new(now, 1),
            range_due: None,
            freshness_due: Every::new(now, u64::from(config.header_ms) * 1000),
            page: 0,
            group: 0,
            groups_first: 0,
            range_from: 0,
            counters: [0; 32],
        }
    }

    /// Begins a new epoch: the mount, the geometry or the configuration changed.
    ///
    /// # Errors
    /// A map larger than this sender's storage.
    pub fn restart(&mut self, header: Header, now: Time) -> Result<(), ConfigError> {
        self.epoch = self.epoch.next();
        self.begin(header, now)
    }

    /// Begins a new epoch on another clock: from here on uptime is counted as well.
    pub fn start_over(&mut self, now: Time) {
        (self.epoch, self.started) = (self.epoch.next(), now);
        self.quiet(now);
    }

    /// Whether maps of this header are sent by a sender of this size.
    ///
    /// # Errors
    /// Names what there is too much of.
    pub fn fits(header: &Header) -> Result<(), ConfigError> {
        let most = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
        within("header.azimuths", u32::from(header.azimuths), 1, most(A.min(super::header::MOST_AZIMUTHS)))?;
        within("header.ranges", u32::from(header.ranges), 1, most((32 * W).min(256)))
    }

    pub(crate) fn begin(&mut self, header: Header, now: Time) -> Result<(), ConfigError> {
        Self::fits(&header)?;
        self.header = Header { planes: planes(P.min(usize::from(self.config.planes))), ..header };
        self.status.fingerprint = header.fingerprint;
        self.header_due = Every::new(now, u64::from(self.config.header_ms) * 1000 / u64::from(self.header_messages()));
        self.quiet(now);
        let messages = usize::from(header.azimuths).div_ceil(self.packing().most_own() - 2) as u64;
        let period = |ms: u16| Every::new(now, u64::from(ms) * 1000 / messages.max(1));
        self.range_due = self.config.visible_range_ms.map(period);
        Ok(())
    }

    /// Messages that the whole header takes.
    fn header_messages(&self) -> u8 {
        if self.packing().is_classic() { self.header.count() } else { 1 }
    }

    fn quiet_us(&self) -> u64 {
        (u64::from(self.config.max_age_ms) + u64::from(self.config.max_delay_ms)) * 1000
    }

    /// A new epoch begins: no map for a while, but the whole header.
    fn quiet(&mut self, now: Time) {
        // this is no want of time
        let overloaded = self.overloaded;
        (self.group, self.groups_first) = (0, self.header_messages());
        self.drop_scan();
        self.overloaded = overloaded;
        self.planes.iter_mut().for_each(OutgoingPlane::forget);
        (self.last, self.refreshed, self.probable, self.from) = (None, None, None, 0);
        self.quiet_until = Time::from_micros(now.micros() + self.quiet_us());
    }

    fn packing(&self) -> Packing {
        self.config.medium.packing(self.config.secured)
    }

    /// What is said of the sender. Uptime, versions, fingerprint and dropped azimuths are filled in.
    pub fn status_mut(&mut self) -> &mut Status {
        &mut self.status
    }

    /// Counts messages of maps that were handed out and did not leave.
    pub fn count_dropped(&mut self, messages: u16) {
        self.status.dropped = self.status.dropped.saturating_add(messages);
        self.overloaded |= messages > 0;
    }

    /// Whether something of a map was dropped since the last call because there was no time to send it.
    pub fn take_overload(&mut self) -> bool {
        core::mem::take(&mut self.overloaded)
    }

    /// Whether the clock is set by a time service.
    pub fn set_synchronised(&mut self, synchronised: bool) {
        self.synchronised = synchronised;
    }

    /// The epoch; it goes on by itself where the clock steps back.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Time at which what was handed out of the current map is to be aborted, should a mailbox still
    /// hold it.
    pub fn deadline(&self) -> Option<Time> {
        let stale = u64::from(self.config.stale_ms) * 1000;
        self.last.map(|measured| Time::from_micros(measured.micros() + stale))
    }

    /// Takes a map measured at this time. What was still to be sent of the one before is dropped.
    ///
    /// # Errors
    /// The map is not sent: `NotSent` says why.
    pub fn scan(&mut self, measured: Time, map: &impl Planes<W>) -> Result<(), NotSent> {
        let number = ScanNumber::at(measured);
        let back = self.last.and_then(|last| last.since(measured)).unwrap_or(0);
        if back > u64::from(self.config.max_delay_ms) * 1000 {
            // the clock stepped back: numbers would come again
            self.epoch = self.epoch.next();
            self.quiet(measured);
            return Err(NotSent::Quiet);
        }
        let since = self.last.and_then(|last| measured.since(last));
        let same = self.last.is_some_and(|last| ScanNumber::at(last) == number);
        // the first scan after a silence may have begun before the last map that said so
        if back > 0 || (same && since.is_some_and(|us| us < 40_000)) {
            return Err(NotSent::TooSoon);
        }
        let wait = self.quiet_until.since(measured).unwrap_or(0);
        if wait > self.quiet_us() {
            // the clock stepped back since the epoch began
            self.epoch = self.epoch.next();
            self.quiet(measured);
        }
        if wait > 0 {
            return Err(NotSent::Quiet);
        }
        self.drop_scan();
        if since.is_none_or(|us| us > 300_000) {
            // scan numbers are distinguished for as long as this
            self.planes.iter_mut().for_each(OutgoingPlane::forget);
            self.refreshed = None;
        }
        let azimuths = usize::from(self.header.azimuths);
        for (outgoing, plane) in self.planes.iter_mut().zip(Plane::ALL).take(usize::from(self.config.planes)) {
            let mut part = 0..azimuths;
            if plane == Plane::Grade && self.header.probability.is_some() {
                let (last, left) = self.probable.map_or((None, true), |(last, left)| (Some(last), left));
                if last.and_then(|last| measured.since(last)).is_some_and(|us| us < PROBABILITY_US) {
                    continue;
                }
                self.probable = Some((measured, !left));
                part = if left { 0..azimuths / 2 } else { azimuths / 2..azimuths };
            }
            outgoing.offer(number, part, |azimuth| map.ray(plane, azimuth));
        }
        let refreshed = self.refreshed.map(ScanNumber::at);
        let all = refreshed.is_none_or(|refreshed| number.ticks_after(refreshed) >= REFRESH_TICKS);
        if all {
            self.refreshed = Some(measured);
        }
        self.last = Some(measured);
        self.scan = Some(Outgoing { number, measured, all, running: None });
        Ok(())
    }

    fn drop_scan(&mut self) {
        let Some(scan) = self.scan.take() else { return };
        self.count_dropped(u16::try_from(self.pending()).unwrap_or(u16::MAX));
        if let Some(running) = scan.running {
            self.from = match running.next {
                Next::Block { start, .. } => start,
                Next::Plain { azimuth } => azimuth,
            };
        }
        self.planes.iter_mut().for_each(OutgoingPlane::give_up);
    }

    /// How many azimuths of the last map are neither handed out nor dropped, those of all planes together.
    pub fn pending(&self) -> u32 {
        self.planes.iter().map(OutgoingPlane::pending).sum()
    }

    /// Whether everything of the last map is handed out or dropped.
    pub fn idle(&self) -> bool {
        self.scan.is_none()
    }

    /// The next CAN frame, if one is due.
    pub fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        let (Medium::Can(addresses) | Medium::CanFd(addresses)) = self.config.medium else { return None };
        self.next_packet(now)?.frame(&addresses)
    }

    /// Writes the next message as it goes on a serial line, if one is due; how many bytes it takes. The
    /// buffer holds [`MOST_STUFFED`](crate::MOST_STUFFED) bytes. None comes of a sender for a CAN bus.
    pub fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize> {
        if self.config.medium != Medium::Serial {
            return None;
        }
        let packet = self.next_packet(now)?;
        serial::stuff(packet.bytes(), line)
    }

    /// The next message, if one is due; never a secured one.
    pub fn next_packet(&mut self, now: Time) -> Option<Packet> {
        if self.config.secured {
            return None;
        }
        let packet = self.next_bare(now)?;
        Some(self.protect(packet))
    }

    /// The next message with its authenticator, if one is due.
    #[cfg(feature = "secoc")]
    pub fn next_sealed<K: Key>(&mut self, now: Time, sealer: &mut Sealer<K>) -> Option<Packet> {
        if !self.config.secured {
            return None;
        }
        let bare = self.next_bare(now)?;
        let sealed = sealer.seal(bare, matches!(self.config.medium, Medium::CanFd(_)));
        Some(self.protect(sealed))
    }

    /// The next message without its protection.
    fn next_bare(&mut self, now: Time) -> Option<Packet> {
        if !self.gap.due(now) {
            return None;
        }
        let packet = self.freshness_packet(now).or_else(|| self.status_packet(now));
        let packet = packet.or_else(|| self.header_packet(now)).or_else(|| self.map_packet(now));
        let packet = packet.or_else(|| self.range_packet(now))?;
        self.gap.next = Time::from_micros(now.micros() + self.gap.period_us);
        Some(packet)
    }

    fn protect(&mut self, packet: Packet) -> Packet {
        let filled = match self.config.medium {
            Medium::CanFd(_) => fd_length(packet.bytes().len()),
            _ => None,
        };
        let Some(counter) = self.counters.get_mut(usize::from(packet.message.number())) else { return packet };
        let protected = packet.protect(*counter, filled);
        *counter = packet.packing.profile().next(*counter);
        protected
    }

    fn packet(&self, message: Message, own: &[u8]) -> Packet {
        Packet::new(self.packing(), self.config.sensor, message, self.epoch, own)
    }
}

/// A bit for each of the first planes.
fn planes(count: usize) -> u8 {
    Plane::ALL.iter().take(count).fold(0, |bits, plane| bits | 1 << plane.index())
}
