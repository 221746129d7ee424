//! The unit's end of a serial line: the integrator's requests answered, and what is said without settings.

use crate::fixed::time::Time;
use crate::unit::identity::{Identity, VERSION};
use crate::unit::safe_state::SafeState;
use crate::unit::service::{Reply, Request};
use crate::unit::settings::{SettingsSlots, StoredSettings};
use crate::unit::timing::Took;
use crate::wire::broadcast::Medium;
use crate::wire::message::{Epoch, Packing};
use crate::wire::serial::{MOST_STUFFED, stuff};
use crate::wire::status::Status;

/// An outgoing serial line.
pub trait SerialLine {
    /// Sends all bytes or none; `false` if the line takes no more now.
    fn send(&mut self, bytes: &[u8]) -> bool;
}

/// What a request asks of the loop around the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Asked {
    /// Nothing: it is answered.
    Nothing,
    /// A start with the newest block.
    Restart,
    /// To take this for the time.
    Time(Time),
    /// How long frames take, from whoever counts that.
    Timing,
}

/// Requests in, replies out, from start to restart.
#[derive(Debug)]
pub(crate) struct SerialService {
    sensor: u8,
    identity: Identity,
    stored: StoredSettings,
    safe: SafeState,
    counter: u8,
    /// Messages the line did not take.
    refused: u16,
}

impl SerialService {
    /// Says what the unit starts with, or why with nothing.
    pub fn start(
        (sensor, identity): (u8, Identity),
        epoch: Epoch,
        now: Time,
        stored: StoredSettings,
        line: &mut impl SerialLine,
    ) -> Self {
        let safe = SafeState::new(sensor, Medium::Serial, epoch, now);
        let mut service = Self { sensor, identity, stored, safe, counter: 0, refused: 0 };
        let place = stored.place();
        service.reply(&Reply::Started(place.ok()), line);
        if let Err(reason) = &place {
            service.reply(&Reply::Refused(reason), line);
        }
        service
    }

    /// The block in use.
    pub fn stored(&self) -> &StoredSettings {
        &self.stored
    }

    /// Takes a message and answers it; `None` if it is none of the integrator's.
    pub fn take(
        &mut self,
        message: &[u8],
        slots: &mut impl SettingsSlots,
        line: &mut impl SerialLine,
    ) -> Option<Asked> {
        match Request::read(message, self.sensor)? {
            Request::Restart => return Some(Asked::Restart),
            Request::Time(time) => return Some(Asked::Time(time)),
            Request::Write(block) => match self.stored.write(block, slots) {
                Ok(sequence) => self.reply(&Reply::Written(sequence), line),
                Err(reason) => self.reply(&Reply::Refused(&reason), line),
            },
            Request::Read => {
                let stored = self.stored;
                self.reply(&Reply::Block(stored.block(slots)), line);
            }
            Request::ReadNewest => {
                let slot = self.stored.newest_slot(slots);
                let block = slot.map_or(&[][..], |slot| StoredSettings::in_slot(slots, slot));
                self.reply(&Reply::Block(block), line);
            }
            Request::Identify => {
                let identity = self.identity;
                self.reply(&Reply::Identified(&identity, VERSION), line);
            }
            Request::Timing => return Some(Asked::Timing),
            Request::Clear => {
                StoredSettings::clear(slots);
                self.reply(&Reply::Cleared, line);
            }
        }
        Some(Asked::Nothing)
    }

    /// Answers how long frames take.
    pub fn tell(&mut self, took: &Took, line: &mut impl SerialLine) {
        self.reply(&Reply::Took(took), line);
    }

    /// Without settings: the status, if it is due, versions and counters as in `base`.
    #[inline(never)] // its buffer is not on the stack while a scan is worked up
    pub fn say_safe(&mut self, now: Time, base: Status, line: &mut impl SerialLine) {
        let mut stuffed = [0; MOST_STUFFED];
        let length = self.safe.next_line(now, base, &mut stuffed);
        if let Some(message) = length.and_then(|n| stuffed.get(..n)) {
            let _ = line.send(message);
        }
    }

    /// Replies the line did not take since the last call. They are asked for again.
    pub fn take_refused(&mut self) -> u16 {
        core::mem::take(&mut self.refused)
    }

    #[inline(never)] // as above
    fn reply(&mut self, reply: &Reply<'_>, line: &mut impl SerialLine) {
        let message = reply.message(self.sensor, self.counter);
        self.counter = Packing::Long.profile().next(self.counter);
        let mut stuffed = [0; MOST_STUFFED];
        let bytes = stuff(message.bytes(), &mut stuffed).and_then(|n| stuffed.get(..n));
        if !bytes.is_some_and(|bytes| line.send(bytes)) {
            self.refused = self.refused.saturating_add(1);
        }
    }
}
