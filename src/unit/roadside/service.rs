//! The integrator's requests on the serial line.

use super::SerialPort;
use crate::unit::service::{Reply, Request};
use crate::unit::session::{Flow, Slots, worst, write};
use crate::unit::settings::{BlockError, Newest, Settings};
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
    /// The block in use, or why there is none.
    settings: Result<Newest, BlockError>,
}

impl Service {
    /// Says what the unit starts with.
    pub fn start(sensor: u8, slots: &impl Slots, line: &mut impl SerialPort) -> Self {
        let settings = Settings::newest([slots.slot(0), slots.slot(1)]).map_err(worst);
        let mut service = Self { sensor, unstuffer: Unstuffer::new(), counter: 0, settings };
        let slot = settings.ok().and_then(|n| u8::try_from(n.slot).ok());
        service.reply(&Reply::Started(slot), line);
        if let Err(reason) = settings {
            service.reply(&Reply::Refused(&reason), line);
        }
        service
    }

    /// What to work with.
    pub fn settings(&self) -> Option<&Settings> {
        self.settings.as_ref().ok().map(|n| &n.settings)
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
                    let outcome = write(block, slots);
                    let reply = match &outcome {
                        Ok(sequence) => Reply::Written(*sequence),
                        Err(reason) => Reply::Refused(reason),
                    };
                    send(&reply, self.sensor, &mut self.counter, line);
                }
                Request::Read => {
                    let used = self.settings.as_ref().ok().map_or(&[][..], |n| slots.slot(n.slot));
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
