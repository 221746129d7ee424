//! Who sends a unit's maps, whatever their kind and size.

use crate::fixed::time::Time;
#[cfg(feature = "probability")]
use crate::probability::Quantiser;
use crate::sensor::config::ConfigError;
#[cfg(feature = "probability")]
use crate::unit::settings::StoredSettings;
use crate::unit::settings::{Settings, SettingsSlots};
use crate::wire::broadcast::{BroadcastConfig, Broadcaster};
use crate::wire::frame::CanFrame;
use crate::wire::header::Header;
use crate::wire::message::Epoch;
use crate::wire::planes::Planes;
use crate::wire::status::{Reason, Status};

/// A sender of maps `M`; each method is [`Broadcaster`]'s.
pub trait MapSender<M>: Sized {
    /// Whether it sends probabilities where there is a table of them.
    const TAKES_TABLES: bool = false;

    /// Whether maps of this header can be sent.
    ///
    /// # Errors
    /// Names what there is too much of.
    fn fits(header: &Header) -> Result<(), ConfigError>;
    /// Starts an epoch, where the sender stays: controllers have no stack for a second. It will have a table of
    /// probabilities where the header says what its bits are.
    ///
    /// # Errors
    /// Names the parameter that cannot be worked with; there is no sender then.
    fn start(
        place: &mut Option<Self>,
        config: BroadcastConfig,
        header: Header,
        epoch: Epoch,
        now: Time,
    ) -> Result<(), ConfigError>;
    /// Takes the table of probabilities; before the first map.
    #[cfg(feature = "probability")]
    fn set_quantiser(&mut self, _: Quantiser) {}
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

/// Starts a sender, where it stays, with the table of probabilities that a unit keeps, if there is one and the sender takes
/// it; and what the unit lacks where one is kept that is not its own, or does not hold. None where a setting cannot be
/// worked with.
#[inline(never)] // what it takes of the stack is free again afterwards
#[allow(unused_variables)] // without room for tables
pub fn start_stored<M, S: MapSender<M>>(
    sender: &mut Option<S>,
    (config, header): (BroadcastConfig, Header),
    settings: &Settings,
    slots: &impl SettingsSlots,
    epoch: Epoch,
    now: Time,
) -> Option<Reason> {
    #[cfg(feature = "probability")]
    if S::TAKES_TABLES {
        let table = StoredSettings::quantiser(settings, &header, slots);
        let lacking = table.is_err().then_some(Reason::NoProbabilities);
        let quantiser = table.ok().flatten();
        let header = Header { probability: quantiser.as_ref().map(Quantiser::levels), ..header };
        let _ = S::start(sender, config, header, epoch, now);
        if let Some((sender, quantiser)) = sender.as_mut().zip(quantiser) {
            sender.set_quantiser(quantiser);
        }
        return lacking;
    }
    let _ = S::start(sender, config, header, epoch, now);
    None
}

impl<M: Planes<W>, const A: usize, const W: usize, const P: usize> MapSender<M> for Broadcaster<A, W, P> {
    fn fits(header: &Header) -> Result<(), ConfigError> {
        Self::fits(header)
    }

    fn start(
        place: &mut Option<Self>,
        config: BroadcastConfig,
        header: Header,
        epoch: Epoch,
        now: Time,
    ) -> Result<(), ConfigError> {
        Self::start(place, config, header, epoch, now)
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
