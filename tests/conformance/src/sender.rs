//! Senders: a recording's maps, one after another, and what of them is on the bus when.

use anyhow::{Result, anyhow};
use viewshed::fixed::time::Time;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::frame::CanId;
use viewshed::wire::message::{Epoch, Message, Packet};
use viewshed::wire::serial::{MOST_STUFFED, stuff};
use viewshed_harness::bus::traffic::{A, Maps, W};

use crate::input::Bus;
use crate::random::Random;

/// The sensor every log asks for.
pub const SENSOR: u8 = 2;

/// Time from map to map, microseconds.
pub const SCAN_US: u64 = 66_667;

/// Age at which a sender aborts what its mailboxes still hold of a map, microseconds.
const STALE_US: u64 = 100_000;

/// How often a sender is asked, microseconds.
const POLL_US: u64 = 250;

/// A frame, or the bytes of a message on a serial line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sent {
    /// When its last bit was on the bus, microseconds of true time.
    pub at: u64,
    /// `None` on a serial line.
    pub id: Option<CanId>,
    pub data: Vec<u8>,
    /// Whether it carries the sender's clock.
    pub clock: bool,
}

/// Mailboxes of a controller or a gateway that sends the lowest identifier first.
#[derive(Debug, Clone, Copy)]
pub struct Mailboxes {
    pub count: usize,
    /// Time a frame takes on the bus, others' traffic included, microseconds.
    pub frame_us: u64,
}

/// What a sender does between two starts. Times are true ones, in microseconds.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    pub from: u64,
    pub to: u64,
    pub epoch: Epoch,
    /// How far its clock is ahead of true time.
    pub ahead: u64,
    /// The first map it sends.
    pub first_map: usize,
    /// `None`: first in, first out.
    pub mailboxes: Option<Mailboxes>,
    /// Whether visible ranges are sent, too.
    pub visible_range: bool,
}

/// The maps of an epoch: when each was measured, and which it is.
#[derive(Debug, Clone, Default)]
pub struct Life {
    pub scans: Vec<(u64, usize)>,
}

/// A frame that waits in a mailbox.
struct Waiting {
    sent: Sent,
    abort_at: Option<u64>,
}

struct Sender<'a> {
    bus: Bus,
    plan: &'a Plan,
    broadcaster: Broadcaster<A, W, 2>,
    slots: Vec<Option<Waiting>>,
    /// The bus is busy up to here.
    free: u64,
    measured: u64,
}

/// Sends a recording's maps as planned.
///
/// # Errors
/// Maps the library's sender refuses.
pub fn send(maps: &Maps, bus: Bus, plan: &Plan) -> Result<(Vec<Sent>, Life)> {
    let mut config = BroadcastConfig::new(SENSOR, bus.medium());
    if plan.mailboxes.is_some() {
        config.gap_us = 0;
    }
    config.planes = if maps.header.probability.is_some() { 2 } else { 1 };
    config.visible_range_ms = plan.visible_range.then_some(500);
    let begin = Time::from_micros(plan.from + plan.ahead);
    let mut broadcaster =
        Broadcaster::new(config, maps.header, plan.epoch, begin).map_err(|error| anyhow!("the sender: {error}"))?;
    broadcaster.status_mut().state = viewshed::wire::status::UnitState::Ok;
    let slots = plan.mailboxes.map_or(0, |mailboxes| mailboxes.count);
    let mut sender = Sender {
        bus,
        plan,
        broadcaster,
        slots: (0..slots).map(|_| None).collect(),
        free: plan.from,
        measured: plan.from,
    };
    let (mut all, mut life) = (Vec::new(), Life::default());
    // somewhere within a tick
    let mut next_map = plan.from + Random::new(plan.ahead).below(SCAN_US);
    let mut map = plan.first_map;
    for now in (plan.from..plan.to).step_by(POLL_US as usize) {
        if now >= next_map {
            map = (map + 1) % maps.scans.len();
            if sender.broadcaster.scan(Time::from_micros(next_map + plan.ahead), &maps.scans[map]).is_ok() {
                life.scans.push((next_map, map));
            }
            sender.measured = next_map;
            next_map += SCAN_US;
        }
        all.extend(sender.poll(now));
    }
    Ok((all, life))
}

impl Sender<'_> {
    fn poll(&mut self, now: u64) -> Option<Sent> {
        let Some(Mailboxes { frame_us, .. }) = self.plan.mailboxes else {
            if now < self.free {
                return None;
            }
            let (mut sent, _) = self.next(now)?;
            sent.at = now + self.duration_us(&sent);
            self.free = sent.at;
            return Some(sent);
        };
        for i in 0..self.slots.len() {
            let aborted = |waiting: &Waiting| waiting.abort_at.is_some_and(|at| now + frame_us > at);
            if self.slots[i].as_ref().is_none_or(aborted) {
                self.slots[i] = self.next(now).map(|(sent, abort_at)| Waiting { sent, abort_at });
            }
        }
        if now < self.free {
            return None;
        }
        let id = |slot: &Option<Waiting>| slot.as_ref().and_then(|waiting| waiting.sent.id).map(CanId::raw);
        let lowest = (0..self.slots.len()).filter(|i| self.slots[*i].is_some()).min_by_key(|i| id(&self.slots[*i]))?;
        let mut sent = self.slots[lowest].take()?.sent;
        sent.at = now + frame_us;
        self.free = sent.at;
        Some(sent)
    }

    /// The next message, and when it is to be aborted.
    fn next(&mut self, now: u64) -> Option<(Sent, Option<u64>)> {
        let packet = self.broadcaster.next_packet(Time::from_micros(now + self.plan.ahead))?;
        let abort_at = matches!(packet.message, Message::Map(..)).then_some(self.measured + STALE_US);
        Some((on_bus(self.bus, &packet)?, abort_at))
    }

    fn duration_us(&self, sent: &Sent) -> u64 {
        match self.bus {
            // 500 kbit/s, and 500 k / 2 M
            Bus::Can => 240,
            Bus::CanFd => 350,
            // 230 400 baud
            Bus::Serial => 10_000_000 * sent.data.len() as u64 / 230_400,
        }
    }
}

/// A message as it is on the bus, at no time yet.
pub fn on_bus(bus: Bus, packet: &Packet) -> Option<Sent> {
    let header = packet.message == Message::Header;
    match bus.medium() {
        Medium::Can(addresses) | Medium::CanFd(addresses) => {
            let frame = packet.frame(&addresses)?;
            // group 0 of the header
            let clock = header && (bus == Bus::CanFd || frame.data().get(2).is_some_and(|byte| byte & 0x70 == 0));
            Some(Sent { at: 0, id: Some(frame.id), data: frame.data().to_vec(), clock })
        }
        Medium::Serial => {
            let mut line = [0; MOST_STUFFED];
            let length = stuff(packet.bytes(), &mut line)?;
            Some(Sent { at: 0, id: None, data: line.get(..length)?.to_vec(), clock: header })
        }
    }
}
