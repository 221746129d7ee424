//! The integrator's requests on the serial line.

use super::SerialPort;
use crate::unit::service::{Reply, Request};
use crate::unit::session::Flow;
use crate::unit::stored::{Slots, Stored};
use crate::wire::message::Packing;
use crate::wire::serial::{MOST_STUFFED, Unstuffer, stuff};

/// Bytes taken in a step.
const MOST_BYTES: usize = 64;

/// Requests in, replies out.
#[derive(Debug)]
pub struct Service {
    sensor: u8,
    unstuffer: Unstuffer,
    counter: u8,
    stored: Stored,
}

impl Service {
    /// Says what the unit starts with.
    pub fn start(sensor: u8, stored: Stored, line: &mut impl SerialPort) -> Self {
        let mut service = Self { sensor, unstuffer: Unstuffer::new(), counter: 0, stored };
        let place = stored.place();
        service.reply(&Reply::Started(place.ok().map(|(slot, _)| slot)), line);
        if let Err(reason) = &place {
            service.reply(&Reply::Refused(reason), line);
        }
        service
    }

    /// Takes what came and answers it. The time is the controller's own here, nobody sets it.
    pub fn poll(&mut self, line: &mut impl SerialPort, slots: &mut impl Slots) -> Flow {
        let mut buffer = [0; MOST_BYTES];
        let came = line.receive(&mut buffer);
        let mut rest = buffer.get(..came).unwrap_or(&[]);
        while !rest.is_empty() {
            let (taken, message) = self.unstuffer.push(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            let Some(request) = message.and_then(|m| Request::read(m, self.sensor)) else { continue };
            match request {
                Request::Restart => return Flow::Restart,
                Request::Time(_) => {}
                Request::Write(block) => {
                    let outcome = self.stored.write(block, slots);
                    let reply = match &outcome {
                        Ok(sequence) => Reply::Written(*sequence),
                        Err(reason) => Reply::Refused(reason),
                    };
                    send(&reply, self.sensor, &mut self.counter, line);
                }
                Request::Read => {
                    let used = self.stored.block(slots);
                    send(&Reply::Block(used), self.sensor, &mut self.counter, line);
                }
            }
        }
        Flow::Continue
    }

    fn reply(&mut self, reply: &Reply<'_>, line: &mut impl SerialPort) {
        send(reply, self.sensor, &mut self.counter, line);
    }
}

fn send(reply: &Reply<'_>, sensor: u8, counter: &mut u8, line: &mut impl SerialPort) {
    let message = reply.message(sensor, *counter);
    *counter = Packing::Long.profile().next(*counter);
    let mut stuffed = [0; MOST_STUFFED];
    if let Some(bytes) = stuff(message.bytes(), &mut stuffed).and_then(|n| stuffed.get(..n)) {
        // asked again if it was lost
        let _ = line.send(bytes);
    }
}
