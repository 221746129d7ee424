//! The integrator's messages on a unit's serial line: configuration, restart and, in a test bench, time.
//!
//! # Model
//! Messages are stuffed as in [`serial`](crate::wire::serial) and protected by AUTOSAR E2E profile 05 with
//! the data ID `0xC000 | sensor`, so that no radar's and no map's message is taken for one of these. Whoever does not
//! know the sensor's number asks for it (kind 5) by [`EVERY_SENSOR`]. All numbers are little-endian.
//!
//! | byte | content |
//! |---|---|
//! | 0, 1 | check sum over bytes 2 to the end and the data ID |
//! | 2 | counter |
//! | 3 | kind |
//! | 4 on | body |
//!
//! | kind | towards the unit | body |
//! |---|---|---|
//! | 1 | write a configuration block into the slot not in use | block ([`settings`](crate::unit::settings)) |
//! | 2 | read a block | none: the one in use; 1: the one that counts from the next restart on |
//! | 3 | restart with the newest block | |
//! | 4 | the time, where the unit has no clock of its own | microseconds, 8 bytes |
//! | 5 | say which unit you are | |
//! | 6 | empty both slots; it counts from the next restart on | `VSCF` |
//! | 7 | say how long frames take | |
//!
//! | kind | from the unit | body |
//! |---|---|---|
//! | 129 | a block was written; it counts from the next restart on | sequence, 4 bytes |
//! | 130 | the block that was asked for | block |
//! | 131 | the unit starts | slot, 1 byte; 255 without a block; the block's sequence, 4 bytes |
//! | 132 | a block was refused, the unit stays in its safe state if it has no other | reason, 1 byte; of a parameter: its value as `f32`, 4 bytes, and its name |
//! | 133 | which unit it is, by [`EVERY_SENSOR`] | sensor; 1 for a test bench, which takes scans on this line, else 0; ranges and azimuths of its grid; major, minor and patch number; the chip's number, 4 bytes; the board's name |
//! | 134 | both slots are empty | |
//! | 135 | how long frames take, where the unit counts it | counts in a second, frames since the start; of a whole frame and of 8 stages: the last count and the greatest; 4 bytes each |

use crate::fixed::bytes::Reader;
use crate::fixed::time::Time;
use crate::sensor::config::ConfigError;
use crate::unit::identity::{Identified, Identity};
use crate::unit::said::{Refusal, Said};
use crate::unit::settings::{BLOCK_LEN, BlockError};
use crate::unit::timing::{Count, Took};
use crate::wire::e2e::Profile;
use crate::wire::serial::MOST_BYTES;

const HEADER: usize = 4;

/// In place of a sensor's number: the unit at the other end, whichever it is.
pub const EVERY_SENSOR: u8 = u8::MAX;

/// Marks the emptying of the slots: not every message that passes its check sum by chance does it.
const CLEAR: [u8; 4] = *b"VSCF";

/// What the integrator asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request<'a> {
    /// Write this block.
    Write(&'a [u8]),
    /// Send the block in use.
    Read,
    /// Send the block that counts from the next restart on.
    ReadNewest,
    /// Start over.
    Restart,
    /// It is this time.
    Time(Time),
    /// Say which unit you are.
    Identify,
    /// Empty both slots.
    Clear,
    /// Say how long frames take.
    Timing,
}

/// What the unit answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply<'a> {
    /// A block was written, with this sequence.
    Written(u32),
    /// The block that was asked for.
    Block(&'a [u8]),
    /// The unit starts with the block of a slot and its sequence.
    Started(Option<(u8, u32)>),
    /// A block was refused.
    Refused(&'a BlockError),
    /// Which unit it is, and the version of its firmware.
    Identified(&'a Identity, [u8; 3]),
    /// Both slots are empty.
    Cleared,
    /// How long frames take.
    Took(&'a Took),
}

/// The data ID of a sensor's service messages.
pub const fn data_id(sensor: u8) -> u16 {
    0xC000 | sensor as u16
}

/// A message before it is stuffed.
#[derive(Debug, Clone, Copy)]
pub struct ServiceMessage {
    bytes: [u8; MOST_BYTES],
    length: usize,
}

impl ServiceMessage {
    fn new(kind: u8) -> Self {
        let mut new = Self { bytes: [0; MOST_BYTES], length: 0 };
        new.put(&[0, 0, 0, kind]);
        new
    }

    /// Appends what fits.
    fn put(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        if let Some(place) = self.bytes.get_mut(self.length..end) {
            place.copy_from_slice(bytes);
            self.length = end;
        }
    }

    fn protect(mut self, sensor: u8, counter: u8) -> Self {
        if let Some(message) = self.bytes.get_mut(..self.length) {
            Profile::P05.protect(message, data_id(sensor), counter);
        }
        self
    }

    /// What is to be stuffed.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}

impl<'a> Request<'a> {
    /// Writes the message.
    pub fn message(&self, sensor: u8, counter: u8) -> ServiceMessage {
        let message = match self {
            Self::Write(block) => {
                let mut message = ServiceMessage::new(1);
                message.put(block);
                message
            }
            Self::Read => ServiceMessage::new(2),
            Self::ReadNewest => {
                let mut message = ServiceMessage::new(2);
                message.put(&[1]);
                message
            }
            Self::Restart => ServiceMessage::new(3),
            Self::Time(time) => {
                let mut message = ServiceMessage::new(4);
                message.put(&time.micros().to_le_bytes());
                message
            }
            Self::Identify => return ServiceMessage::new(5).protect(EVERY_SENSOR, counter),
            Self::Clear => {
                let mut message = ServiceMessage::new(6);
                message.put(&CLEAR);
                message
            }
            Self::Timing => ServiceMessage::new(7),
        };
        message.protect(sensor, counter)
    }

    /// Reads a message; `None` for everybody else's and for damaged ones.
    pub fn read(message: &'a [u8], sensor: u8) -> Option<Self> {
        let (kind, body) = (message.get(HEADER - 1)?, message.get(HEADER..)?);
        let asked = if *kind == 5 { EVERY_SENSOR } else { sensor };
        Profile::P05.check(message, data_id(asked)).ok()?;
        match kind {
            1 => Some(Self::Write(body)),
            2 => Some(if body.first().is_some_and(|which| *which != 0) { Self::ReadNewest } else { Self::Read }),
            3 => Some(Self::Restart),
            4 => Reader(body).u64().map(|t| Self::Time(Time::from_micros(t))),
            5 => Some(Self::Identify),
            6 => (body == CLEAR).then_some(Self::Clear),
            7 => Some(Self::Timing),
            _ => None,
        }
    }
}

impl Reply<'_> {
    /// Writes the message.
    pub fn message(&self, sensor: u8, counter: u8) -> ServiceMessage {
        let message = match self {
            Self::Written(sequence) => {
                let mut message = ServiceMessage::new(129);
                message.put(&sequence.to_le_bytes());
                message
            }
            Self::Block(block) => {
                let mut message = ServiceMessage::new(130);
                message.put(block.get(..BLOCK_LEN).unwrap_or(block));
                message
            }
            Self::Started(place) => {
                let (slot, sequence) = place.unwrap_or((u8::MAX, 0));
                let mut message = ServiceMessage::new(131);
                message.put(&[slot]);
                message.put(&sequence.to_le_bytes());
                message
            }
            Self::Refused(reason) => {
                let mut message = ServiceMessage::new(132);
                message.put(&[reason.code()]);
                if let BlockError::Parameter(ConfigError { parameter, value, .. }) = reason {
                    message.put(&value.to_le_bytes());
                    message.put(parameter.as_bytes());
                }
                message
            }
            Self::Identified(identity, firmware) => {
                let mut message = ServiceMessage::new(133);
                message.put(&identity.head(sensor, *firmware));
                message.put(identity.letters());
                return message.protect(EVERY_SENSOR, counter);
            }
            Self::Cleared => ServiceMessage::new(134),
            Self::Took(took) => {
                let mut message = ServiceMessage::new(135);
                message.put(&took.hz.to_le_bytes());
                message.put(&took.frames.to_le_bytes());
                for count in core::iter::once(&took.frame).chain(&took.stages) {
                    message.put(&count.last.to_le_bytes());
                    message.put(&count.worst.to_le_bytes());
                }
                message
            }
        };
        message.protect(sensor, counter)
    }
}

impl Said {
    /// Reads a message of a unit; `None` for everybody else's and for damaged ones.
    pub fn read(message: &[u8], sensor: u8) -> Option<Self> {
        let (kind, body) = (message.get(HEADER - 1)?, message.get(HEADER..)?);
        let by = if *kind == 133 { EVERY_SENSOR } else { sensor };
        Profile::P05.check(message, data_id(by)).ok()?;
        let mut r = Reader(body);
        match kind {
            129 => r.u32().map(Self::Written),
            130 => {
                let mut block = [0xFF; BLOCK_LEN];
                block.iter_mut().zip(body).for_each(|(to, from)| *to = *from);
                Some(Self::Block(block))
            }
            131 => {
                let [slot] = r.take()?;
                let sequence = r.u32()?;
                Some(Self::Started((slot != u8::MAX).then_some((slot, sequence))))
            }
            132 => {
                let [reason] = r.take()?;
                let value = r.f32().filter(|_| reason == Refusal::PARAMETER);
                let mut refusal = Refusal::new(reason, value.map_or([0; 4], f32::to_be_bytes));
                if value.is_some() {
                    refusal.name.iter_mut().zip(r.0).for_each(|(to, from)| *to = *from);
                }
                Some(Self::Refused(refusal))
            }
            133 => Identified::read(body).map(Self::Identified),
            134 => Some(Self::Cleared),
            135 => {
                let count = |r: &mut Reader<'_>| Some(Count { last: r.u32()?, worst: r.u32()? });
                let mut took = Took { hz: r.u32()?, frames: r.u32()?, frame: count(&mut r)?, ..Took::default() };
                for stage in &mut took.stages {
                    *stage = count(&mut r)?;
                }
                Some(Self::Took(took))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::config::Problem;

    #[test]
    fn requests_read_back_and_belong_to_one_sensor() {
        for request in [
            Request::Write(&[1, 2, 3]),
            Request::Read,
            Request::Restart,
            Request::Time(Time::from_micros(0x0102_0304_0506_0708)),
            Request::ReadNewest,
            Request::Clear,
            Request::Timing,
            Request::Identify,
        ] {
            let message = request.message(3, 9);
            assert_eq!(Request::read(message.bytes(), 3), Some(request));
            let others = (request == Request::Identify).then_some(request);
            assert_eq!(Request::read(message.bytes(), 4), others, "who it is everybody is asked");
            let mut damaged = [0; MOST_BYTES];
            let damaged = &mut damaged[..message.bytes().len()];
            damaged.copy_from_slice(message.bytes());
            damaged[3] ^= 0x10;
            assert_eq!(Request::read(damaged, 3), None);
        }
    }

    #[test]
    fn a_refusal_names_the_parameter() {
        let reason = BlockError::Parameter(ConfigError {
            parameter: "mount.height_m",
            value: 50.0,
            problem: Problem::OutOfLimits { min: 0.1, max: 20.0 },
        });
        let message = Reply::Refused(&reason).message(0, 0);
        assert_eq!(message.bytes()[3..5], [132, 5]);
        assert_eq!(message.bytes()[5..9], 50.0_f32.to_le_bytes());
        assert_eq!(&message.bytes()[9..], b"mount.height_m");
        let Some(Said::Refused(refusal)) = Said::read(message.bytes(), 0) else { panic!() };
        assert_eq!((refusal.reason, refusal.value(), refusal.parameter()), (5, 50.0, "mount.height_m"));
        let empty = Reply::Refused(&BlockError::Empty).message(0, 0);
        assert_eq!(Said::read(empty.bytes(), 0), Some(Said::Refused(Refusal::new(1, [0; 4]))));
    }

    #[test]
    fn replies_read_back_and_belong_to_one_sensor() {
        let identity = Identity { board: "a-board", chip: 7, is_bench: true, grid: [100, 64] };
        let mut block = [0xFF; BLOCK_LEN];
        block[..3].copy_from_slice(&[1, 2, 3]);
        let stages = core::array::from_fn(|k| Count { last: k as u32, worst: 70_000 + k as u32 });
        let took = Took { hz: 480_000_000, frames: 9, frame: Count { last: 1, worst: 2 }, stages };
        for (reply, said) in [
            (Reply::Written(70_000), Said::Written(70_000)),
            (Reply::Block(&[1, 2, 3]), Said::Block(block)),
            (Reply::Started(Some((1, 9))), Said::Started(Some((1, 9)))),
            (Reply::Started(None), Said::Started(None)),
            (Reply::Cleared, Said::Cleared),
            (Reply::Took(&took), Said::Took(took)),
        ] {
            let message = reply.message(3, 9);
            assert_eq!(Said::read(message.bytes(), 3), Some(said));
            assert_eq!(Said::read(message.bytes(), 4), None);
        }
        let message = Reply::Identified(&identity, [0, 1, 2]).message(3, 9);
        let Some(Said::Identified(unit)) = Said::read(message.bytes(), 7) else { panic!() };
        assert_eq!((unit.sensor, unit.chip, unit.is_bench, unit.board()), (3, 7, true, "a-board"));
    }
}
