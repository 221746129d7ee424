//! The integrator's messages on CAN: blocks in parts, read back, and a restart.
//!
//! # Model
//! Two messages of a sensor, packed and protected as all of its messages are
//! ([`message`](crate::wire::message)): [`REQUEST`] towards the unit, [`ANSWER`] from it. Both have six own
//! bytes, on classic CAN and on CAN FD: a kind, a number, and four more. Blocks are those of
//! [`settings`](crate::unit::settings); they travel in parts of four bytes.
//!
//! | kind | towards the unit | number | four bytes |
//! |---|---|---|---|
//! | 1 | a block begins | 0 | its length (2, big-endian), 0, 0 |
//! | 2 | a part of it | n | its bytes 4 n to 4 n + 3 |
//! | 3 | it is complete: check it, write it into the slot of its kind that is not in use | 0 | its last four bytes |
//! | 4 | read a block | 2 x its kind: the one in use; 1 more: the one that counts from the next restart on | 0 |
//! | 5 | restart with the newest block | 0 | `VSCB` |
//! | 6 | empty both slots of a kind; it counts from the next restart on | 0 | `VSCF` settings, `VSHF` heights, `VSLF` lanes, `VSPF` probabilities |
//! | 7 | say which unit you are | 0 | 0 |
//! | 8 | from now on this chip's unit alone takes requests; 0: every unit | 0 | the chip's number, big-endian |
//!
//! | kind | from the unit | number | four bytes |
//! |---|---|---|---|
//! | 129 | a block was written; it counts from the next restart on | 0 | its sequence, big-endian |
//! | 130 | a part of the block that was asked for | n | its bytes 4 n to 4 n + 3 |
//! | 131 | the unit starts | slot; 255 without a block | the block's sequence, big-endian |
//! | 132 | a block was refused | reason + 16 x its kind | see below |
//! | 133 | letters of the refused parameter's name | n | letters 4 n to 4 n + 3; zeros after the last |
//! | 134 | which unit it is; after 7, and after 8 by the chip that was named | 1 for a test bench, else 0 | the chip's number, big-endian |
//! | 135 | both slots are empty | 0 | 0 |
//!
//! Kinds are 0 settings, 1 heights, 2 lanes, 3 probabilities. Reasons are those of
//! [`BlockError::code`](crate::unit::settings::BlockError::code), with the layout that was
//! found (2 bytes, big-endian), the parameter's value (`f32`, big-endian), a table's bin of azimuth and of range or its
//! grid of ranges and azimuths (1 byte each) or the unit's fingerprint (4 bytes, big-endian), and
//! [`INCOMPLETE`], with the first missing part in the first byte.
//!
//! *Why no damaged block is taken.* Every message is protected, parts are placed by their number, whatever
//! order they come in and however often, and nothing is written unless every part came since the block
//! began, the last four bytes are those that were announced, and the block's own CRC-32 holds over what
//! came: parts of two blocks do not pass. After a block that lacks parts these can be sent alone. A repeated
//! completion is answered again and not written again.
//!
//! *Two units of one number*, as two that are new are, send with the same identifiers. They answer kind 7 at
//! times that follow from their chips' numbers, 64 of them 4 ms apart; kind 8 then names one of them, and the
//! others take nothing until their next start or until kind 8 names all.
//!
//! # Limits
//! There is no authentication on classic CAN: who can send on the bus can configure the unit.

mod tool;
mod unit;

pub use tool::{Answers, Tool};
pub use unit::{CanService, CanServiceConfig};

use crate::fixed::bits::Bits;
use crate::unit::settings::{BlockKind, MOST_BLOCK_LEN, Which};
use crate::wire::broadcast::Medium;
use crate::wire::frame::{CanFrame, fd_length};
use crate::wire::message::{Epoch, Message, Packet, Received};

/// The message towards the unit.
pub const REQUEST: Message = Message::Other(24);

/// The message from the unit.
pub const ANSWER: Message = Message::Other(25);

/// Reason of a refusal: parts of the block are missing.
pub const INCOMPLETE: u8 = 6;

/// Parts of the longest block.
const PARTS: usize = MOST_BLOCK_LEN / 4;

/// Marks a restart: not every message that passes its check sum by chance begins one.
const RESTART: [u8; 4] = *b"VSCB";

/// Parts have numbers of a byte, and what is longer is cut to whole parts.
const _: () = assert!(MOST_BLOCK_LEN.is_multiple_of(4) && PARTS < 256);

/// Which parts came, a bit each.
type Came = Bits<{ PARTS.div_ceil(32) }>;

/// Own bytes of both messages.
type Own = [u8; 6];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BlockRequest {
    Begin { length: u16 },
    Part { number: u8, bytes: [u8; 4] },
    Complete { last: [u8; 4] },
    Read(Which),
    Restart,
    Clear(BlockKind),
    Identify,
    Address { chip: u32 },
}

impl BlockRequest {
    fn own(self) -> Own {
        match self {
            Self::Begin { length } => {
                let [high, low] = length.to_be_bytes();
                own(1, 0, [high, low, 0, 0])
            }
            Self::Part { number, bytes } => own(2, number, bytes),
            Self::Complete { last } => own(3, 0, last),
            Self::Read(which) => own(4, which.number(), [0; 4]),
            Self::Restart => own(5, 0, RESTART),
            Self::Clear(kind) => own(6, 0, kind.clear_mark()),
            Self::Identify => own(7, 0, [0; 4]),
            Self::Address { chip } => own(8, 0, chip.to_be_bytes()),
        }
    }

    fn read(own: &[u8]) -> Option<Self> {
        let (&[kind, number], bytes) = own.split_first_chunk::<2>()?;
        let bytes = *bytes.first_chunk::<4>()?;
        let [a, b, ..] = bytes;
        match kind {
            1 => Some(Self::Begin { length: u16::from_be_bytes([a, b]) }),
            2 => Some(Self::Part { number, bytes }),
            3 => Some(Self::Complete { last: bytes }),
            4 => Which::from_number(number).map(Self::Read),
            5 => (bytes == RESTART).then_some(Self::Restart),
            6 => BlockKind::of_clear_mark(&bytes).map(Self::Clear),
            7 => Some(Self::Identify),
            8 => Some(Self::Address { chip: u32::from_be_bytes(bytes) }),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BlockAnswer {
    Written { sequence: u32 },
    Part { number: u8, bytes: [u8; 4] },
    Started { slot: u8, sequence: u32 },
    Refused { reason: u8, detail: [u8; 4] },
    Name { number: u8, letters: [u8; 4] },
    Identified { is_bench: bool, chip: u32 },
    Cleared,
}

impl BlockAnswer {
    fn own(self) -> Own {
        match self {
            Self::Written { sequence } => own(129, 0, sequence.to_be_bytes()),
            Self::Part { number, bytes } => own(130, number, bytes),
            Self::Started { slot, sequence } => own(131, slot, sequence.to_be_bytes()),
            Self::Refused { reason, detail } => own(132, reason, detail),
            Self::Name { number, letters } => own(133, number, letters),
            Self::Identified { is_bench, chip } => own(134, u8::from(is_bench), chip.to_be_bytes()),
            Self::Cleared => own(135, 0, [0; 4]),
        }
    }

    fn read(own: &[u8]) -> Option<Self> {
        let (&[kind, number], bytes) = own.split_first_chunk::<2>()?;
        let bytes = *bytes.first_chunk::<4>()?;
        match kind {
            129 => Some(Self::Written { sequence: u32::from_be_bytes(bytes) }),
            130 => Some(Self::Part { number, bytes }),
            131 => Some(Self::Started { slot: number, sequence: u32::from_be_bytes(bytes) }),
            132 => Some(Self::Refused { reason: number, detail: bytes }),
            133 => Some(Self::Name { number, letters: bytes }),
            134 => Some(Self::Identified { is_bench: number != 0, chip: u32::from_be_bytes(bytes) }),
            135 => Some(Self::Cleared),
            _ => None,
        }
    }
}

fn own(kind: u8, number: u8, [a, b, c, d]: [u8; 4]) -> Own {
    [kind, number, a, b, c, d]
}

/// Packs and protects one of the messages; `None` on a serial line, or if the addresses hold no such sensor.
fn frame(medium: &Medium, sensor: u8, message: Message, epoch: Epoch, counter: &mut u8, own: Own) -> Option<CanFrame> {
    let (Medium::Can(addresses) | Medium::CanFd(addresses)) = medium else { return None };
    let packet = Packet::new(medium.packing(false), sensor, message, epoch, &own);
    let filled = matches!(medium, Medium::CanFd(_)).then(|| fd_length(packet.bytes().len())).flatten();
    let protected = packet.protect(*counter, filled);
    *counter = packet.packing.profile().next(*counter);
    protected.frame(addresses)
}

/// The message in a frame, if it is this one of this sensor.
fn received<'a>(frame: &'a CanFrame, medium: &Medium, sensor: u8, message: Message) -> Option<&'a [u8]> {
    let (Medium::Can(addresses) | Medium::CanFd(addresses)) = medium else { return None };
    let received = Received::from_frame(frame, addresses).ok()?;
    let mine = (received.sensor, received.message) == (sensor, message) && !received.sealed;
    mine.then_some(received.own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_read_back() {
        for request in [
            BlockRequest::Begin { length: 0x0102 },
            BlockRequest::Part { number: 36, bytes: [1, 2, 3, 4] },
            BlockRequest::Complete { last: [5, 6, 7, 8] },
            BlockRequest::Read(Which::in_use(BlockKind::Settings)),
            BlockRequest::Read(Which::newest(BlockKind::Settings)),
            BlockRequest::Read(Which::newest(BlockKind::Probabilities)),
            BlockRequest::Restart,
            BlockRequest::Clear(BlockKind::Settings),
            BlockRequest::Clear(BlockKind::Lanes),
            BlockRequest::Identify,
            BlockRequest::Address { chip: 0x0102_0304 },
        ] {
            assert_eq!(BlockRequest::read(&request.own()), Some(request));
        }
        for answer in [
            BlockAnswer::Written { sequence: 0x0102_0304 },
            BlockAnswer::Part { number: 3, bytes: [1, 2, 3, 4] },
            BlockAnswer::Started { slot: 255, sequence: 7 },
            BlockAnswer::Refused { reason: 4, detail: [9; 4] },
            BlockAnswer::Name { number: 1, letters: *b"t.he" },
            BlockAnswer::Identified { is_bench: true, chip: 0x0102_0304 },
            BlockAnswer::Cleared,
        ] {
            assert_eq!(BlockAnswer::read(&answer.own()), Some(answer));
        }
        assert_eq!(BlockRequest::read(&own(5, 0, *b"VSCA")), None, "a restart by chance");
        assert_eq!(BlockRequest::read(&own(6, 0, *b"VSCB")), None, "emptied by chance");
        assert_eq!(BlockRequest::read(&own(4, 8, [0; 4])), None, "no such kind");
        assert_eq!(BlockRequest::read(&own(9, 0, [0; 4])), None);
        assert_eq!(BlockRequest::read(&[1, 0, 0, 148, 0]), None);
    }
}
