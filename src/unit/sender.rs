//! Who sends a unit's maps, whatever their kind and size.

use crate::fixed::time::Time;
use crate::sensor::config::ConfigError;
use crate::wire::broadcast::{BroadcastConfig, Broadcaster};
use crate::wire::frame::CanFrame;
use crate::wire::header::Header;
use crate::wire::message::Epoch;
use crate::wire::planes::Planes;
use crate::wire::status::Status;

/// A sender of maps `M`; each method is [`Broadcaster`]'s.
pub trait MapSender<M>: Sized {
    /// Whether maps of this header can be sent.
    ///
    /// # Errors
    /// Names what there is too much of.
    fn fits(header: &Header) -> Result<(), ConfigError>;
    /// Starts an epoch.
    ///
    /// # Errors
    /// Names the parameter that cannot be worked with.
    fn start(config: BroadcastConfig, header: Header, epoch: Epoch, now: Time) -> Result<Self, ConfigError>;
    /// Takes a map. It is not sent while the epoch is new, or if the last one was of the same moment: the next
    /// one will be.
    fn offer(&mut self, measured: Time, map: &M);
    /// The next CAN frame, if one is due.
    fn next_frame(&mut self, now: Time) -> Option<CanFrame>;
    /// The next message for a serial line, if one is due.
    fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize>;
    /// When what was handed out is to be aborted.
    fn deadline(&self) -> Option<Time>;
    /// The unit's status, as it is sent next.
    fn status_mut(&mut self) -> &mut Status;
    /// Counts messages that did not leave.
    fn count_dropped(&mut self, messages: u16);
    /// Whether something was dropped for want of time since the last call.
    fn take_overload(&mut self) -> bool;
}

impl<M: Planes<W>, const A: usize, const W: usize, const P: usize> MapSender<M> for Broadcaster<A, W, P> {
    fn fits(header: &Header) -> Result<(), ConfigError> {
        Self::fits(header)
    }

    fn start(config: BroadcastConfig, header: Header, epoch: Epoch, now: Time) -> Result<Self, ConfigError> {
        Self::new(config, header, epoch, now)
    }

    fn offer(&mut self, measured: Time, map: &M) {
        let _ = self.scan(measured, map);
    }

    fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        self.next_frame(now)
    }

    fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize> {
        self.next_line(now, line)
    }

    fn deadline(&self) -> Option<Time> {
        self.deadline()
    }

    fn status_mut(&mut self) -> &mut Status {
        self.status_mut()
    }

    fn count_dropped(&mut self, messages: u16) {
        self.count_dropped(messages);
    }

    fn take_overload(&mut self) -> bool {
        self.take_overload()
    }
}
