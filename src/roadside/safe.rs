//! What is sent without settings: a status that says why.

use super::SerialPort;
use crate::time::Time;
use crate::wire::frame::CanFrame;
use crate::wire::message::{Addresses, Epoch, Message, Packet, Packing};
use crate::wire::serial::{MOST_STUFFED, stuff};
use crate::wire::status::{PAGES, Reason, State, Status};

/// Time between two status messages, microseconds: at least two a second.
const PERIOD_US: u64 = 250_000;

/// When, and what was last.
#[derive(Debug)]
pub struct SafeState {
    started: Time,
    sent: Option<Time>,
    page: u8,
    counters: [u8; 2],
}

impl SafeState {
    pub const fn new(now: Time) -> Self {
        Self { started: now, sent: None, page: 0, counters: [0; 2] }
    }

    /// Sends the status on both lines where it is due; what it says.
    pub fn poll(
        &mut self,
        sensor: u8,
        status: Status,
        now: Time,
        line: &mut impl SerialPort,
        send: impl FnOnce(&CanFrame) -> bool,
    ) -> State {
        let status = Status {
            state: State::Fault,
            reason: Reason::Configuration,
            uptime_s: u32::try_from(now.since(self.started).unwrap_or(0) / 1_000_000).unwrap_or(u32::MAX),
            ..status
        };
        if self.sent.is_some_and(|sent| now.since(sent).is_some_and(|us| us < PERIOD_US)) {
            return status.state;
        }
        self.sent = Some(now);
        let [long, classic] = &mut self.counters;
        let packet = protected(Packing::Long, sensor, &status.emit(), long);
        let mut stuffed = [0; MOST_STUFFED];
        if let Some(bytes) = stuff(packet.bytes(), &mut stuffed).and_then(|n| stuffed.get(..n)) {
            let _ = line.send(bytes);
        }
        let packet = protected(Packing::Classic, sensor, &status.emit_page(self.page), classic);
        self.page = (self.page + 1) % PAGES;
        if let Some(frame) = packet.frame(&Addresses::STANDARD) {
            // the next one says the same
            let _ = send(&frame);
        }
        status.state
    }
}

fn protected(packing: Packing, sensor: u8, own: &[u8], counter: &mut u8) -> Packet {
    let packet = Packet::new(packing, sensor, Message::Status, Epoch::new(0), own).protect(*counter, None);
    *counter = packing.profile().next(*counter);
    packet
}
