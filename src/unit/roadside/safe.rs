//! What the serial line is told without settings: a status that says why. On the bus this is
//! [`CanService`](crate::unit::can_service::CanService)'s.

use super::SerialPort;
use crate::time::Time;
use crate::wire::message::{Epoch, Message, Packet, Packing};
use crate::wire::serial::{MOST_STUFFED, stuff};
use crate::wire::status::Status;

/// Time between two status messages, microseconds: at least two a second.
const PERIOD_US: u64 = 250_000;

/// When, and with which counter.
#[derive(Debug)]
pub struct SafeState {
    started: Time,
    sent: Option<Time>,
    counter: u8,
}

impl SafeState {
    pub const fn new(now: Time) -> Self {
        Self { started: now, sent: None, counter: 0 }
    }

    /// Sends the status where it is due.
    pub fn poll(&mut self, sensor: u8, epoch: Epoch, status: Status, now: Time, line: &mut impl SerialPort) {
        if self.sent.is_some_and(|sent| now.since(sent).is_some_and(|us| us < PERIOD_US)) {
            return;
        }
        self.sent = Some(now);
        let uptime_s = now.since(self.started).unwrap_or(0) / 1_000_000;
        let status = Status { uptime_s: u32::try_from(uptime_s).unwrap_or(u32::MAX), ..status };
        let packet = Packet::new(Packing::Long, sensor, Message::Status, epoch, &status.emit());
        let packet = packet.protect(self.counter, None);
        self.counter = Packing::Long.profile().next(self.counter);
        let mut stuffed = [0; MOST_STUFFED];
        if let Some(bytes) = stuff(packet.bytes(), &mut stuffed).and_then(|n| stuffed.get(..n)) {
            let _ = line.send(bytes);
        }
    }
}
