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
//! | 1 | write a block into the slot of its kind that is not in use | block ([`settings`](crate::unit::settings)) |
//! | 2 | read a block | which one: 2 x its kind, and 1 more for the one that counts from the next restart on instead of the one in use; none: 0; for a part, as it is asked for of all kinds but settings, its place in the block, 2 bytes |
//! | 3 | restart with the newest block | |
//! | 4 | the time, where the unit has no clock of its own | microseconds, 8 bytes |
//! | 5 | say which unit you are | |
//! | 6 | empty both slots of a kind; it counts from the next restart on | `VSCF` settings, `VSHF` heights, `VSLF` lanes, `VSPF` probabilities |
//! | 7 | say how long frames take | |
//! | 8 | a part of a block that is longer than a message; with the last one it is written as by kind 1 | its place in the block, 2 bytes; up to 200 bytes |
//!
//! | kind | from the unit | body |
//! |---|---|---|
//! | 129 | a block was written; it counts from the next restart on | sequence, 4 bytes |
//! | 130 | the block that was asked for | block |
//! | 131 | the unit starts | slot, 1 byte; 255 without a block; the block's sequence, 4 bytes |
//! | 132 | a block was refused, the unit stays in its safe state if it has no other | reason and 16 x its kind, 1 byte; of a parameter: its value as `f32`, 4 bytes, and its name; of other reasons what goes with them ([`can_service`](crate::unit::can_service)), 4 bytes |
//! | 133 | which unit it is, by [`EVERY_SENSOR`] | sensor; 1 for a test bench, which takes scans on this line, else 0; ranges and azimuths of its grid; major, minor and patch number; the chip's number, 4 bytes; the board's name |
//! | 134 | both slots are empty | |
//! | 136 | the part that was asked for | which block and the part's place in it, as asked for; up to 200 bytes, none behind its end |
//! | 137 | a part came | the place in the block from which on parts are missing, 2 bytes |
//! | 135 | how long frames take, where the unit counts it | counts in a second, frames since the start; of a whole frame and of 8 stages: the last count and the greatest; 4 bytes each |

use crate::fixed::bytes::Reader;
use crate::fixed::time::Time;
use crate::sensor::config::ConfigError;
use crate::unit::identity::{Identified, Identity};
use crate::unit::reply::{Piece, Refusal, Said};
use crate::unit::settings::{BlockError, BlockKind, StoredError, Which};
use crate::unit::timing::{Count, Took};
use crate::wire::e2e::Profile;
use crate::wire::serial::MOST_BYTES;

const HEADER: usize = 4;

/// In place of a sensor's number: the unit at the other end, whichever it is.
pub const EVERY_SENSOR: u8 = u8::MAX;

/// Bytes of a part.
pub const PART_LEN: usize = 200;

/// What the integrator asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request<'a> {
    /// Write this block.
    Write(&'a [u8]),
    /// A part of a block to be written, and its place in it.
    Part(u16, &'a [u8]),
    /// Send a block whole.
    Read(Which),
    /// Send the part of a block that begins at this place in it.
    ReadPart(Which, u16),
    /// Start over.
    Restart,
    /// It is this time.
    Time(Time),
    /// Say which unit you are.
    Identify,
    /// Empty both slots of a kind.
    Clear(BlockKind),
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
    /// The part of a block that was asked for, and its place.
    Part(Which, u16, &'a [u8]),
    /// A part came; from this place on they are missing.
    Came(u16),
    /// The unit starts with the block of a slot and its sequence.
    Started(Option<(u8, u32)>),
    /// A block was refused.
    Refused(&'a StoredError),
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
            Self::Part(place, bytes) => {
                let mut message = ServiceMessage::new(8);
                message.put(&place.to_le_bytes());
                message.put(bytes);
                message
            }
            Self::Read(which) => {
                let mut message = ServiceMessage::new(2);
                message.put(&[which.number()]);
                message
            }
            Self::ReadPart(which, place) => {
                let mut message = ServiceMessage::new(2);
                message.put(&[which.number()]);
                message.put(&place.to_le_bytes());
                message
            }
            Self::Restart => ServiceMessage::new(3),
            Self::Time(time) => {
                let mut message = ServiceMessage::new(4);
                message.put(&time.micros().to_le_bytes());
                message
            }
            Self::Identify => return ServiceMessage::new(5).protect(EVERY_SENSOR, counter),
            Self::Clear(kind) => {
                let mut message = ServiceMessage::new(6);
                message.put(&kind.clear_mark());
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
            2 => {
                let (number, rest) = body.split_first().unwrap_or((&0, &[]));
                let which = Which::from_number(*number)?;
                Some(match rest.first_chunk() {
                    None => Self::Read(which),
                    Some(place) => Self::ReadPart(which, u16::from_le_bytes(*place)),
                })
            }
            3 => Some(Self::Restart),
            4 => Reader(body).u64().map(|t| Self::Time(Time::from_micros(t))),
            5 => Some(Self::Identify),
            6 => BlockKind::of_clear_mark(body).map(Self::Clear),
            7 => Some(Self::Timing),
            8 => body.split_first_chunk().map(|(place, bytes)| Self::Part(u16::from_le_bytes(*place), bytes)),
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
                message.put(block);
                message
            }
            Self::Part(which, place, bytes) => {
                let mut message = ServiceMessage::new(136);
                message.put(&[which.number()]);
                message.put(&place.to_le_bytes());
                message.put(bytes);
                message
            }
            Self::Came(place) => {
                let mut message = ServiceMessage::new(137);
                message.put(&place.to_le_bytes());
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
                if let BlockError::Parameter(ConfigError { parameter, value, .. }) = &reason.error {
                    message.put(&value.to_le_bytes());
                    message.put(parameter.as_bytes());
                } else {
                    message.put(&reason.detail());
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
            130 => Some(Self::Block(Piece::new(body))),
            131 => {
                let [slot] = r.take()?;
                let sequence = r.u32()?;
                Some(Self::Started((slot != u8::MAX).then_some((slot, sequence))))
            }
            132 => {
                let [reason] = r.take()?;
                // a number of a parameter is little-endian as all of this line's
                let [a, b, c, d] = r.take().unwrap_or_default();
                let is_of_parameter = reason & 0xF == Refusal::PARAMETER;
                let mut refusal = Refusal::new(reason, if is_of_parameter { [d, c, b, a] } else { [a, b, c, d] });
                if is_of_parameter {
                    refusal.name.iter_mut().zip(r.0).for_each(|(to, from)| *to = *from);
                }
                Some(Self::Refused(refusal))
            }
            133 => Identified::read(body).map(Self::Identified),
            134 => Some(Self::Cleared),
            136 => {
                let ([number], place) = (r.take()?, r.u16()?);
                Some(Self::Part(Which::from_number(number)?, place, Piece::new(r.0)))
            }
            137 => r.u16().map(Self::Came),
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
            Request::Read(Which::in_use(BlockKind::Settings)),
            Request::Read(Which::newest(BlockKind::Settings)),
            Request::ReadPart(Which::in_use(BlockKind::Lanes), 200),
            Request::ReadPart(Which::newest(BlockKind::Probabilities), 0),
            Request::Part(600, &[4; PART_LEN]),
            Request::Restart,
            Request::Time(Time::from_micros(0x0102_0304_0506_0708)),
            Request::Clear(BlockKind::Settings),
            Request::Clear(BlockKind::Heights),
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
        let message = Reply::Refused(&StoredError::of_settings(reason)).message(0, 0);
        assert_eq!(message.bytes()[3..5], [132, 5]);
        assert_eq!(message.bytes()[5..9], 50.0_f32.to_le_bytes());
        assert_eq!(&message.bytes()[9..], b"mount.height_m");
        let Some(Said::Refused(refusal)) = Said::read(message.bytes(), 0) else { panic!() };
        assert_eq!((refusal.reason, refusal.value(), refusal.parameter()), (5, 50.0, "mount.height_m"));
        let empty = Reply::Refused(&StoredError::of_settings(BlockError::Empty)).message(0, 0);
        assert_eq!(Said::read(empty.bytes(), 0), Some(Said::Refused(Refusal::new(1, [0; 4]))));
    }

    #[test]
    fn a_refusal_says_what_the_block_is_of_and_what_goes_with_its_reason() {
        let refused = |kind, error| {
            let message = Reply::Refused(&StoredError { kind, error }).message(0, 0);
            let Some(Said::Refused(refusal)) = Said::read(message.bytes(), 0) else { panic!() };
            (message.bytes()[4], refusal.of_kind(), refusal.detail)
        };
        assert_eq!(
            refused(BlockKind::Settings, BlockError::Layout(0x0102)),
            (3, (Some(BlockKind::Settings), 3), [1, 2, 0, 0])
        );
        assert_eq!(refused(BlockKind::Lanes, BlockError::CheckSum), (0x24, (Some(BlockKind::Lanes), 4), [0; 4]));
        #[cfg(feature = "probability")]
        {
            use crate::probability::TableError;
            let of_table = |error| refused(BlockKind::Probabilities, error);
            let falls = TableError::NotMonotone { azimuth: 3, range: 5 };
            assert_eq!(of_table(BlockError::Table(falls)), (0x39, (Some(BlockKind::Probabilities), 9), [3, 5, 0, 0]));
            let other = TableError::Configuration { table: 1, unit: 0x0102_0304 };
            assert_eq!(of_table(BlockError::Table(other)).2, [1, 2, 3, 4]);
            assert_eq!(of_table(BlockError::Grid([200, 120])).2, [200, 120, 0, 0]);
        }
    }

    #[test]
    fn replies_read_back_and_belong_to_one_sensor() {
        let identity = Identity { board: "a-board", chip: 7, is_bench: true, grid: [100, 64] };
        let part = Piece::new(&[7; PART_LEN]);
        let stages = core::array::from_fn(|k| Count { last: k as u32, worst: 70_000 + k as u32 });
        let took = Took { hz: 480_000_000, frames: 9, frame: Count { last: 1, worst: 2 }, stages };
        for (reply, said) in [
            (Reply::Written(70_000), Said::Written(70_000)),
            (Reply::Block(&[1, 2, 3]), Said::Block(Piece::new(&[1, 2, 3]))),
            (
                Reply::Part(Which::newest(BlockKind::Lanes), 400, &[7; PART_LEN]),
                Said::Part(Which::newest(BlockKind::Lanes), 400, part),
            ),
            (Reply::Came(400), Said::Came(400)),
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
