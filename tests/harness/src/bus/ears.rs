//! A receiver with or without a key.

use viewshed::fixed::time::Time;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::Addresses;
use viewshed::wire::receive::{Accepted, Receiver, ReceiverLimits, Refused, SecuredReceiver};

/// Key of authenticated messages.
pub type Key = [u8; 16];

/// Receives bare messages, or with a key authenticated ones; never both.
pub enum Ears<const N: usize, const A: usize, const W: usize, const P: usize> {
    Open(Box<Receiver<N, A, W, P>>),
    Secured(Box<SecuredReceiver<Key, N, A, W, P>>),
}

impl<const N: usize, const A: usize, const W: usize, const P: usize> Ears<N, A, W, P> {
    pub fn new(sensors: [u8; N], addresses: Addresses, limits: ReceiverLimits, key: Option<&Key>) -> Self {
        match key {
            None => Self::Open(Box::new(Receiver::new(sensors, addresses, limits))),
            Some(key) => Self::Secured(Box::new(SecuredReceiver::new(sensors, addresses, limits, key))),
        }
    }

    pub fn frame(&mut self, now: Time, frame: &CanFrame) -> Result<Accepted, Refused> {
        match self {
            Self::Open(receiver) => receiver.frame(now, frame),
            Self::Secured(receiver) => receiver.frame(now, frame),
        }
    }

    pub fn message(&mut self, now: Time, bytes: &[u8]) -> Result<Accepted, Refused> {
        match self {
            Self::Open(receiver) => receiver.message(now, bytes),
            Self::Secured(receiver) => receiver.message(now, bytes),
        }
    }

    /// What was received.
    pub fn receiver(&self) -> &Receiver<N, A, W, P> {
        match self {
            Self::Open(receiver) => receiver,
            Self::Secured(receiver) => receiver.receiver(),
        }
    }
}
