//! The integrator's messages on a unit's serial line: configuration, restart and, in a test bench, time.
//!
//! # Model
//! Messages are stuffed as in [`serial`](crate::wire::serial) and protected by AUTOSAR E2E profile 05 with
//! the data ID `0xC000 | sensor`, so that no radar's and no map's message is taken for one of these. All
//! numbers are little-endian.
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
//! | 2 | read the block in use | |
//! | 3 | restart with the newest block | |
//! | 4 | the time, where the unit has no clock of its own | microseconds, 8 bytes |
//!
//! | kind | from the unit | body |
//! |---|---|---|
//! | 129 | a block was written; it counts from the next restart on | sequence, 4 bytes |
//! | 130 | the block in use | block |
//! | 131 | the unit starts | slot, 1 byte; 255 without a block |
//! | 132 | a block was refused, the unit stays in its safe state if it has no other | reason, 1 byte; of a parameter: its value as `f32`, 4 bytes, and its name |

use crate::fixed::bytes::Reader;
use crate::fixed::time::Time;
use crate::sensor::config::ConfigError;
use crate::unit::settings::{BLOCK_LEN, BlockError};
use crate::wire::e2e::Profile;
use crate::wire::serial::MOST_BYTES;

const HEADER: usize = 4;

/// What the integrator asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request<'a> {
    /// Write this block.
    Write(&'a [u8]),
    /// Send the block in use.
    Read,
    /// Start over.
    Restart,
    /// It is this time.
    Time(Time),
}

/// What the unit answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply<'a> {
    /// A block was written, with this sequence.
    Written(u32),
    /// The block in use.
    Block(&'a [u8]),
    /// The unit starts with the block of a slot.
    Started(Option<u8>),
    /// A block was refused.
    Refused(&'a BlockError),
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
            Self::Restart => ServiceMessage::new(3),
            Self::Time(time) => {
                let mut message = ServiceMessage::new(4);
                message.put(&time.micros().to_le_bytes());
                message
            }
        };
        message.protect(sensor, counter)
    }

    /// Reads a message; `None` for everybody else's and for damaged ones.
    pub fn read(message: &'a [u8], sensor: u8) -> Option<Self> {
        Profile::P05.check(message, data_id(sensor)).ok()?;
        let body = message.get(HEADER..)?;
        match message.get(HEADER - 1)? {
            1 => Some(Self::Write(body)),
            2 => Some(Self::Read),
            3 => Some(Self::Restart),
            4 => Reader(body).u64().map(|t| Self::Time(Time::from_micros(t))),
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
            Self::Started(slot) => {
                let mut message = ServiceMessage::new(131);
                message.put(&[slot.unwrap_or(u8::MAX)]);
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
        };
        message.protect(sensor, counter)
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
        ] {
            let message = request.message(3, 9);
            assert_eq!(Request::read(message.bytes(), 3), Some(request));
            assert_eq!(Request::read(message.bytes(), 4), None);
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
    }
}
