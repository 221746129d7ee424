//! The unit's end of a serial line: the integrator's requests answered, and what is said without settings.

use crate::fixed::time::Time;
use crate::unit::identity::{Identity, VERSION};
use crate::unit::reply::Piece;
use crate::unit::safe_state::SafeState;
use crate::unit::service::{PART_LEN, Reply, Request};
use crate::unit::settings::{BlockError, BlockKind, SettingsSlots, StoredError, StoredSettings, announced_length};
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
    /// A block that comes in parts, and its sequence once it was written.
    incoming: Piece,
    written: Option<u32>,
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
        let mut service =
            Self { sensor, identity, stored, safe, counter: 0, incoming: Piece::EMPTY, written: None, refused: 0 };
        let position = stored.position();
        service.reply(&Reply::Started(position.ok()), line);
        if let Err(reason) = &position {
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
            Request::Write(block) => {
                self.write(block, slots, line);
            }
            Request::Part(place, bytes) => self.part(usize::from(place), bytes, slots, line),
            Request::Read(which) => {
                let slot = self.stored.find(which, slots);
                let block = slot.map_or(&[][..], |slot| StoredSettings::in_slot(slots, slot));
                self.reply(&Reply::Block(block), line);
            }
            Request::ReadPart(which, place) => match self.stored.find(which, slots) {
                Err(absent) => self.reply(&Reply::Refused(&absent), line),
                Ok(slot) => {
                    let rest = StoredSettings::in_slot(slots, slot).get(usize::from(place)..).unwrap_or(&[]);
                    let part = rest.get(..PART_LEN).unwrap_or(rest);
                    self.reply(&Reply::Part(which, place, part), line);
                }
            },
            Request::Identify => {
                let identity = self.identity;
                self.reply(&Reply::Identified(&identity, VERSION), line);
            }
            Request::Timing => return Some(Asked::Timing),
            Request::Clear(kind) => {
                StoredSettings::clear(kind, slots);
                self.reply(&Reply::Cleared, line);
            }
        }
        Some(Asked::Nothing)
    }

    fn write(&mut self, block: &[u8], slots: &mut impl SettingsSlots, line: &mut impl SerialLine) -> Option<u32> {
        let written = self.stored.write(block, slots);
        match &written {
            Ok(sequence) => self.reply(&Reply::Written(*sequence), line),
            Err(reason) => self.reply(&Reply::Refused(reason), line),
        }
        written.ok()
    }

    /// Takes a part of a block, which is written once it is as long as it says itself.
    fn part(&mut self, place: usize, bytes: &[u8], slots: &mut impl SettingsSlots, line: &mut impl SerialLine) {
        if place == 0 {
            (self.incoming, self.written) = (Piece::EMPTY, None);
        }
        if let Some(sequence) = self.written {
            // the answer may have been lost
            return self.reply(&Reply::Written(sequence), line);
        }
        let came = self.incoming.bytes().len();
        if place == came && !self.incoming.put(place, bytes) {
            let head = if place == 0 { bytes } else { self.incoming.bytes() };
            let kind = BlockKind::of_block(head).unwrap_or(BlockKind::Settings);
            return self.reply(&Reply::Refused(&StoredError { kind, error: BlockError::NoRoom }), line);
        }
        let incoming = self.incoming;
        let length = announced_length(incoming.bytes());
        if length.is_some_and(|length| incoming.bytes().len() >= length) {
            self.written = self.write(incoming.bytes(), slots, line);
            return;
        }
        #[allow(clippy::cast_possible_truncation)] // a block has a kilobyte at most
        self.reply(&Reply::Came(incoming.bytes().len() as u16), line);
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
