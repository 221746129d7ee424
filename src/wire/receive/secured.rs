//! Frames of senders that have a key in, their maps out: nothing else is listened to.
//!
//! # Model
//! Check sum, authenticator, then everything [`Receiver`] does. A message that is not authentic is counted
//! and changes nothing: no map, no epoch, no conflict. One without authenticator is none, or leaving
//! it off would be all a forger had to do.
//!
//! # ReceiverLimits
//! See [`secoc`](crate::wire::secoc): a receiver that starts without a kept freshness value can be shown a recorded past
//! until the sender's next freshness message.

use super::{Accepted, Receiver, ReceiverLimits, Refused};
use crate::fixed::time::Time;
use crate::wire::frame::CanFrame;
use crate::wire::message::{Addresses, NotAMessage, Received};
use crate::wire::secoc::{Key, Opener};

/// Receives the maps of `N` sensors whose messages carry an authenticator.
#[derive(Debug, Clone)]
pub struct SecuredReceiver<K, const N: usize, const A: usize, const W: usize, const P: usize = 1> {
    receiver: Receiver<N, A, W, P>,
    openers: [(u8, Opener<K>); N],
}

impl<K: Key + Clone, const N: usize, const A: usize, const W: usize, const P: usize> SecuredReceiver<K, N, A, W, P> {
    /// Of these sensors, and no others; each waits for its first freshness message.
    pub fn new(sensors: [u8; N], addresses: Addresses, limits: ReceiverLimits, key: &K) -> Self {
        let openers = sensors.map(|number| (number, Opener::new(key.clone())));
        Self { receiver: Receiver::new(sensors, addresses, limits), openers }
    }

    /// Takes of a sensor only what is above this freshness value, kept over a restart.
    pub fn resume(&mut self, sensor: u8, last: u64) {
        self.openers.iter_mut().filter(|(number, _)| *number == sensor).for_each(|(_, opener)| opener.resume_at(last));
    }

    /// The freshness value of a sensor accepted last, to be kept over a restart.
    pub fn freshness(&self, sensor: u8) -> Option<u64> {
        self.openers.iter().find(|(number, _)| *number == sensor)?.1.freshness()
    }

    /// Takes a CAN FD frame; a classic one has no room for an authenticator and is refused.
    ///
    /// # Errors
    /// Why it is not used.
    pub fn frame(&mut self, now: Time, frame: &CanFrame) -> Result<Accepted, Refused> {
        let addresses = self.receiver.addresses;
        let sensor = addresses.message(frame.id).map(|(sensor, _)| sensor);
        self.received(now, Received::from_frame(frame, &addresses), sensor)
    }

    /// Takes a message from a serial line.
    ///
    /// # Errors
    /// Why it is not used.
    pub fn message(&mut self, now: Time, bytes: &[u8]) -> Result<Accepted, Refused> {
        self.received(now, Received::from_bytes(bytes), bytes.get(4).copied())
    }

    fn received(
        &mut self,
        now: Time,
        received: Result<Received<'_>, NotAMessage>,
        sensor: Option<u8>,
    ) -> Result<Accepted, Refused> {
        let now = self.receiver.watch(now);
        let Ok(message) = received else { return self.receiver.received(now, received, sensor) };
        let opener = self.openers.iter_mut().find(|(number, _)| *number == message.sensor);
        match opener.map(|(_, opener)| opener.open(&message)) {
            Some(Err(why)) => Err(self.receiver.refuse(message.sensor, Refused::NotAuthentic(why))),
            Some(Ok(opened)) => self.receiver.received(now, Ok(opened), sensor),
            None => self.receiver.received(now, received, sensor),
        }
    }

    /// Maps, conditions and counters.
    pub fn receiver(&self) -> &Receiver<N, A, W, P> {
        &self.receiver
    }
}
