//! The messages of a sender, each kind when it is due.

use super::outgoing_plane::{Encoding, Next};
use super::{Broadcaster, Running};
use crate::fixed::time::Time;
use crate::wire::code::block::Basis;
use crate::wire::header::Clock;
use crate::wire::map_message::{self, LIMITS, SEGMENTS};
use crate::wire::message::{Message, Packet, Part, Plane, WIRE_VERSION, Word};
use crate::wire::scan_number::ScanNumber;
use crate::wire::status::PAGES;
use crate::wire::visible_range;

impl<const A: usize, const W: usize, const P: usize> Broadcaster<A, W, P> {
    pub(super) fn status_packet(&mut self, now: Time) -> Option<Packet> {
        if !self.status_due.due(now) {
            return None;
        }
        self.status_due.done(now);
        let uptime_s = now.since(self.started).unwrap_or(0) / 1_000_000;
        self.status.uptime_s = u32::try_from(uptime_s).unwrap_or(u32::MAX);
        self.status.wire_version = WIRE_VERSION;
        if !self.packing().is_classic() {
            return Some(self.packet(Message::Status, &self.status.emit()));
        }
        let own = self.status.emit_page(self.page);
        self.page = (self.page + 1) % PAGES;
        Some(self.packet(Message::Status, &own))
    }

    pub(super) fn header_packet(&mut self, now: Time) -> Option<Packet> {
        if self.groups_first > 0 {
            self.groups_first -= 1;
            self.header_due.next = Time::from_micros(now.micros() + self.header_due.period_us);
        } else if self.header_due.due(now) {
            self.header_due.done(now);
        } else {
            return None;
        }
        let clock = Clock { time_ms: now.micros() / 1000, synchronised: self.synchronised };
        if !self.packing().is_classic() {
            let (own, length) = self.header.emit(&clock);
            return Some(self.packet(Message::Header, own.get(..length)?));
        }
        let own = self.header.emit_group(&clock, self.group);
        self.group = (self.group + 1) % self.header.count();
        Some(self.packet(Message::Header, &own))
    }

    /// Room for the freshness value.
    pub(super) fn freshness_packet(&mut self, now: Time) -> Option<Packet> {
        if !self.config.secured || !self.freshness_due.due(now) {
            return None;
        }
        self.freshness_due.done(now);
        Some(self.packet(Message::Freshness, &[0; 8]))
    }

    pub(super) fn map_packet(&mut self, now: Time) -> Option<Packet> {
        let scan = self.scan.as_ref()?;
        if now.since(scan.measured).is_none_or(|age| age > u64::from(self.config.stale_ms) * 1000) {
            self.drop_scan();
            return None;
        }
        if scan.running.is_none() {
            let running = self.next_running(scan.all)?;
            self.scan.as_mut()?.running = Some(running);
        }
        let scan = self.scan.as_ref()?;
        let (running, number) = (scan.running.as_ref()?, scan.number);
        let (packet, last) = self.message(number, running)?;
        if !last {
            self.scan.as_mut()?.running.as_mut()?.sent += 1;
            return Some(packet);
        }
        let (kind, start, end) = match running.next {
            Next::Block { kind, start, ref block } => (Some(kind), start, block.end),
            Next::Plain { azimuth } => (None, azimuth, azimuth + 1),
        };
        self.planes.get_mut(running.plane)?.encoded(kind, start, end, number);
        self.from = end;
        self.scan.as_mut()?.running = None;
        if self.planes.iter().all(|outgoing| outgoing.pending() == 0) {
            // complete: the next one begins at the right edge again
            (self.scan, self.from) = (None, 0);
        }
        Some(packet)
    }

    fn next_running(&mut self, all: bool) -> Option<Running> {
        let encoding = Encoding { context: self.header.context(self.packing().form()), all };
        let from = self.from;
        let mut planes = self.planes.iter_mut().enumerate();
        planes.find_map(|(plane, outgoing)| outgoing.next(&encoding, from).map(|next| Running { plane, next, sent: 0 }))
    }

    /// The message that is next of a block or a ray, and whether it is the last.
    fn message(&self, scan: ScanNumber, running: &Running) -> Option<(Packet, bool)> {
        let sent = usize::from(running.sent);
        let long = !self.packing().is_classic();
        let plane = Plane::ALL.get(running.plane).copied()?;
        let packet = |part, own: &[u8]| self.packet(Message::Map(plane, part), own);
        match running.next {
            Next::Block { kind, start, ref block } => {
                let first = if kind == Basis::Refresh { Part::Refresh } else { Part::Delta };
                if long {
                    let (own, length) = map_message::words(scan, start, block.words());
                    return Some((packet(first, own.get(..length)?), true));
                }
                let part = Word::at(sent).map_or(first, Part::More);
                let own = map_message::word(scan, start, *block.words().get(sent)?);
                Some((packet(part, &own), sent + 1 == block.words().len()))
            }
            Next::Plain { azimuth } => {
                let ray = self.planes.get(running.plane)?.now(azimuth);
                if long {
                    let (own, length) = map_message::plain(scan, azimuth, ray);
                    return Some((packet(Part::Plain, own.get(..length)?), true));
                }
                let mut segments = [LIMITS]
                    .into_iter()
                    .chain(0..SEGMENTS)
                    .filter(|s| map_message::has_segment(ray.known, *s))
                    .skip(sent);
                let own = map_message::segment(scan, azimuth, ray, segments.next()?);
                Some((packet(Part::Plain, &own), segments.next().is_none()))
            }
        }
    }

    pub(super) fn range_packet(&mut self, now: Time) -> Option<Packet> {
        let mut due = self.range_due.filter(|due| due.due(now))?;
        let measured = self
            .last
            .filter(|last| now.since(*last).is_some_and(|age| age <= u64::from(self.config.stale_ms) * 1000))?;
        due.done(now);
        self.range_due = Some(due);
        let azimuths = usize::from(self.header.azimuths);
        let most = self.packing().most_own() - 2;
        let first = self.range_from;
        self.range_from = if first + most < azimuths { first + most } else { 0 };
        let outgoing = self.planes.first()?;
        let steps =
            (first..(first + most).min(azimuths)).map(|a| visible_range::steps(outgoing.now(a), self.header.cell_cm));
        let (own, length) = visible_range::emit(ScanNumber::at(measured), first, steps);
        Some(self.packet(Message::VisibleRange, own.get(..length)?))
    }
}
