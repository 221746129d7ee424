//! What a unit says without a block it can run with: a status, and nothing else.

use crate::fixed::time::Time;
use crate::wire::broadcast::Medium;
use crate::wire::frame::{CanFrame, fd_length};
use crate::wire::message::{Epoch, Message, Packet};
use crate::wire::serial;
use crate::wire::status::{PAGES, Reason, Status, UnitState};

/// Time between two status messages, microseconds: at least two a second.
const PERIOD_US: u64 = 250_000;

/// When a status is due on a line, with which counter, and which page of it.
#[derive(Debug, Clone, Copy)]
pub struct SafeState {
    sensor: u8,
    medium: Medium,
    epoch: Epoch,
    started: Time,
    sent: Option<Time>,
    counter: u8,
    page: u8,
}

impl SafeState {
    /// From a start on.
    pub const fn new(sensor: u8, medium: Medium, epoch: Epoch, now: Time) -> Self {
        Self { sensor, medium, epoch, started: now, sent: None, counter: 0, page: 0 }
    }

    /// What is sent now, with the versions and counters of `base`.
    fn status(&self, now: Time, base: Status) -> Status {
        let uptime_s = now.since(self.started).unwrap_or(0) / 1_000_000;
        let uptime_s = u32::try_from(uptime_s).unwrap_or(u32::MAX);
        Status { state: UnitState::Fault, reason: Reason::Configuration, uptime_s, ..base }
    }

    fn next(&mut self, now: Time, base: Status) -> Option<Packet> {
        if self.sent.and_then(|last| now.since(last)).is_some_and(|us| us < PERIOD_US) {
            return None;
        }
        self.sent = Some(now);
        let status = self.status(now, base);
        let packing = self.medium.packing(false);
        let of = |own: &[u8]| Packet::new(packing, self.sensor, Message::Status, self.epoch, own);
        let packet = if packing.is_classic() { of(&status.emit_page(self.page)) } else { of(&status.emit()) };
        let filled = matches!(self.medium, Medium::CanFd(_)).then(|| fd_length(packet.bytes().len())).flatten();
        self.page = (self.page + 1) % PAGES;
        let protected = packet.protect(self.counter, filled);
        self.counter = packing.profile().next(self.counter);
        Some(protected)
    }

    /// The next status on a CAN bus, if one is due.
    pub fn next_frame(&mut self, now: Time, base: Status) -> Option<CanFrame> {
        let (Medium::Can(addresses) | Medium::CanFd(addresses)) = self.medium else { return None };
        self.next(now, base)?.frame(&addresses)
    }

    /// Writes the next status as it goes on a serial line, if one is due; how many bytes it takes.
    pub fn next_line(&mut self, now: Time, base: Status, line: &mut [u8]) -> Option<usize> {
        serial::stuff(self.next(now, base)?.bytes(), line)
    }
}
