//! Messages, their numbers, their CAN identifiers and the few bytes all of them begin with.
//!
//! # Model
//! A sensor has 32 message numbers; a CAN identifier is `base + 32 * sensor + number`. Two forms:
//!
//! | | classic CAN, 8 bytes | CAN FD and serial, up to 64 bytes |
//! |---|---|---|
//! | protection | profile 11: byte 0, low nibble of byte 1 | profile 05: bytes 0 to 2 |
//! | message number, sensor | by identifier | bytes 3, 4 |
//! | secured | never | highest bit of byte 5 |
//! | epoch | high nibble of byte 1 | low nibble of byte 5 |
//! | own bytes | from byte 2 on | from byte 6 on |
//!
//! The data ID of the protection is `0x8000 | 32 * sensor + number` in both.

use super::code::interval::Form;
use super::e2e::{E2eError, Profile};
use super::frame::{CanFrame, CanId, MOST_BYTES};
use crate::fixed::bits::Bits;

/// Version of the wire format.
pub const WIRE_VERSION: u8 = 1;

/// Message numbers of a sensor.
pub const MESSAGES: usize = 32;

/// Bytes of an authenticator, after the own bytes of a secured message.
pub const SEAL_BYTES: usize = 8;

/// In a long message's byte 5: it is secured.
const SECURED: u8 = 0x80;

/// In the same byte: not used, 0.
const RESERVED: u8 = 0x70;

/// Own bytes of a classic message.
pub const CLASSIC_BYTES: usize = 6;

/// Most own bytes of a long message.
pub const LONG_BYTES: usize = MOST_BYTES - LONG_START;

/// First own byte of a classic message.
const CLASSIC_START: usize = 2;

/// First own byte of a long message.
const LONG_START: usize = 6;

/// Azimuths of a map, a bit each.
pub(super) type Azimuths = Bits<4>;

/// What the bits of a map's cells mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Plane {
    /// Visible or not.
    Visibility,
    /// The finer half of a two-bit grade: clear rather than just visible, nearly visible rather
    /// than blocked. With levels of probability in the header: whether p reaches the upper one.
    Grade,
    /// Occupied at slice height or not.
    Occupancy,
}

impl Plane {
    /// All planes, in the order of their message numbers.
    pub const ALL: [Self; 3] = [Self::Visibility, Self::Grade, Self::Occupancy];

    /// Place among the planes.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Which part of a map a frame carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Part {
    /// Begins a block that decodes alone.
    Refresh,
    /// Begins a block on a refresh it names.
    Delta,
    /// The second, third or fourth word of a block; classic CAN only.
    More(Word),
    /// Cells of one azimuth in plain bits.
    Plain,
}

/// Which word of a block a frame carries, the first not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Word {
    /// The second.
    Second,
    /// The third.
    Third,
    /// The fourth.
    Fourth,
}

impl Word {
    /// Place in the block, from 0.
    pub const fn index(self) -> usize {
        self as usize + 1
    }

    /// From a place in the block.
    pub const fn at(index: usize) -> Option<Self> {
        match index {
            1 => Some(Self::Second),
            2 => Some(Self::Third),
            3 => Some(Self::Fourth),
            _ => None,
        }
    }
}

/// What a message is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// State of the sender.
    Status,
    /// What its maps are of.
    Header,
    /// Guaranteed visible range per azimuth.
    VisibleRange,
    /// Full freshness value of the authentication.
    Freshness,
    /// A part of a map.
    Map(Plane, Part),
    /// Another number: 4 and 5 are the installation's own, 24 and 25 the configuration's
    /// ([`can_service`](crate::unit::can_service)), 26 to 31 a fourth plane's.
    Other(u8),
}

/// Number of the first map message.
const FIRST_MAP: u8 = 6;

/// Message numbers a plane takes.
const PER_PLANE: u8 = 6;

impl Message {
    /// The message's number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Status => 0,
            Self::Header => 1,
            Self::VisibleRange => 2,
            Self::Freshness => 3,
            Self::Map(plane, part) => {
                let part = match part {
                    Part::Refresh => 0,
                    Part::Delta => 1,
                    Part::More(word) => 2 + word as u8,
                    Part::Plain => 5,
                };
                FIRST_MAP + PER_PLANE * plane as u8 + part
            }
            Self::Other(number) => number,
        }
    }

    /// The message of a number; `None` from 32 on.
    pub const fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Status,
            1 => Self::Header,
            2 => Self::VisibleRange,
            3 => Self::Freshness,
            FIRST_MAP..24 => {
                let plane = match (number - FIRST_MAP) / PER_PLANE {
                    0 => Plane::Visibility,
                    1 => Plane::Grade,
                    _ => Plane::Occupancy,
                };
                let part = match (number - FIRST_MAP) % PER_PLANE {
                    0 => Part::Refresh,
                    1 => Part::Delta,
                    2 => Part::More(Word::Second),
                    3 => Part::More(Word::Third),
                    4 => Part::More(Word::Fourth),
                    _ => Part::Plain,
                };
                Self::Map(plane, part)
            }
            4 | 5 | 24..32 => Self::Other(number),
            _ => return None,
        })
    }
}

/// Where a sensor's messages lie among the CAN identifiers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Addresses {
    base: CanId,
}

impl Addresses {
    /// Eight sensors on 0x400 to 0x4FF: clear of ARS408 (0x200 to 0x3FF, 0x600 to 0x7FF) and of
    /// diagnostics.
    pub const STANDARD: Self = Self { base: CanId::Standard(0x400) };

    /// 256 sensors on 0x0400_0000 to 0x0400_1FFF: clear of diagnostics (0x18DAxxxx, 0x18DBxxxx).
    pub const EXTENDED: Self = Self { base: CanId::Extended(0x0400_0000) };

    /// From the first identifier of sensor 0; `None` unless a multiple of 32 with room for a sensor.
    pub const fn new(base: CanId) -> Option<Self> {
        let most = match base {
            CanId::Standard(_) => 0x7FF,
            CanId::Extended(_) => 0x1FFF_FFFF,
        };
        if base.raw().is_multiple_of(32) && base.raw() + 31 <= most { Some(Self { base }) } else { None }
    }

    /// The last sensor there is room for.
    #[allow(clippy::cast_possible_truncation)] // at most 255
    pub const fn most_sensor(&self) -> u8 {
        let (most, sensors) = match self.base {
            // eight sensors on 11 bits leave the identifiers after them alone
            CanId::Standard(_) => (0x7FF, 7),
            CanId::Extended(_) => (0x1FFF_FFFF, 255),
        };
        let room = (most - self.base.raw() - 31) / 32;
        if room < sensors { room as u8 } else { sensors as u8 }
    }

    /// The first identifier of a sensor; `None` if it lies beyond the last.
    pub const fn first(&self, sensor: u8) -> Option<CanId> {
        self.id(sensor, Message::Status)
    }

    /// The identifier of a sensor's message; `None` if the sensor's lie beyond the last.
    pub const fn id(&self, sensor: u8, message: Message) -> Option<CanId> {
        let raw = self.base.raw() + 32 * sensor as u32 + message.number() as u32;
        match self.base {
            #[allow(clippy::cast_possible_truncation)] // checked
            CanId::Standard(_) => {
                if raw <= 0x7FF {
                    CanId::standard(raw as u16)
                } else {
                    None
                }
            }
            CanId::Extended(_) => CanId::extended(raw),
        }
    }

    /// Sensor and message of an identifier, if it is one of these.
    #[allow(clippy::cast_possible_truncation)] // a remainder by 32, and checked
    pub fn message(&self, id: CanId) -> Option<(u8, Message)> {
        let same_length = matches!(
            (self.base, id),
            (CanId::Standard(_), CanId::Standard(_)) | (CanId::Extended(_), CanId::Extended(_))
        );
        let offset = id.raw().checked_sub(self.base.raw()).filter(|_| same_length)?;
        let sensor = u8::try_from(offset / 32).ok()?;
        if sensor > self.most_sensor() {
            return None;
        }
        Some((sensor, Message::from_number((offset % 32) as u8)?))
    }
}

/// The data ID of a message's protection.
pub const fn data_id(sensor: u8, message: Message) -> u16 {
    0x8000 | (sensor as u16 * 32 + message.number() as u16)
}

/// A number that changes at every start of the sender and at every change of what its maps are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Epoch(u8);

impl Epoch {
    /// From a number; its lowest four bits count. To be drawn from non-volatile memory or noise.
    pub const fn new(number: u8) -> Self {
        Self(number & 0x0F)
    }

    /// The next epoch.
    #[must_use]
    pub const fn next(self) -> Self {
        Self::new(self.0 + 1)
    }

    /// 0 to 15.
    pub const fn number(self) -> u8 {
        self.0
    }
}

/// How messages are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Packing {
    /// 8 bytes.
    Classic,
    /// Up to 64 bytes.
    Long,
    /// Up to 64 bytes, the last 8 of them an authenticator.
    Secured,
}

impl Packing {
    /// Whether messages have 8 bytes.
    pub const fn is_classic(self) -> bool {
        matches!(self, Self::Classic)
    }

    /// Most own bytes.
    pub const fn most_own(self) -> usize {
        match self {
            Self::Classic => CLASSIC_BYTES,
            Self::Long => LONG_BYTES,
            Self::Secured => LONG_BYTES - SEAL_BYTES,
        }
    }

    /// The form of a map's code.
    pub const fn form(self) -> Form {
        match self {
            Self::Classic => Form::CLASSIC,
            Self::Long => Form::LONG,
            Self::Secured => Form::LONG_SECURED,
        }
    }

    /// The protection profile.
    pub const fn profile(self) -> Profile {
        match self {
            Self::Classic => Profile::P11,
            Self::Long | Self::Secured => Profile::P05,
        }
    }
}

/// A message as bytes, ready for a frame.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// The sensor it is from.
    pub sensor: u8,
    /// What it is.
    pub message: Message,
    /// How it is packed.
    pub packing: Packing,
    length: u8,
    bytes: [u8; MOST_BYTES],
}

impl core::fmt::Debug for Packet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?} of sensor {}: {:02X?}", self.message, self.sensor, self.bytes())
    }
}

impl Packet {
    /// Packs a message's own bytes; those that do not fit are lost. The protection is written by
    /// [`Packet::protect`].
    #[allow(clippy::cast_possible_truncation)] // at most 64
    pub fn new(packing: Packing, sensor: u8, message: Message, epoch: Epoch, own: &[u8]) -> Self {
        let mut bytes = [0; MOST_BYTES];
        let (start, most) = (if packing.is_classic() { CLASSIC_START } else { LONG_START }, packing.most_own());
        if packing.is_classic() {
            bytes[1] = epoch.0 << 4;
        } else {
            let secured = if packing == Packing::Secured { SECURED } else { 0 };
            (bytes[3], bytes[4], bytes[5]) = (message.number(), sensor, epoch.0 | secured);
        }
        let own = own.get(..most).unwrap_or(own);
        if let Some(to) = bytes.get_mut(start..start + own.len()) {
            to.copy_from_slice(own);
        }
        let length = if packing.is_classic() { 8 } else { start + own.len() };
        Self { sensor, message, packing, length: length as u8, bytes }
    }

    /// Writes counter and check sum. On CAN FD they cover the zeros a frame is filled up with.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // at most 64
    pub fn protect(mut self, counter: u8, filled_to: Option<usize>) -> Self {
        if let Some(length) = filled_to {
            self.length = length.min(MOST_BYTES) as u8;
        }
        let length = usize::from(self.length);
        if let Some(bytes) = self.bytes.get_mut(..length) {
            self.packing.profile().protect(bytes, data_id(self.sensor, self.message), counter);
        }
        self
    }

    /// Room for another so many bytes at the end, filled up with zeros so that all have this length.
    #[cfg_attr(not(feature = "secoc"), allow(dead_code))]
    #[allow(clippy::cast_possible_truncation)] // at most 64
    pub(super) fn lengthen(&mut self, length: usize) -> &mut [u8] {
        self.length = length.clamp(usize::from(self.length), MOST_BYTES) as u8;
        self.bytes.get_mut(..usize::from(self.length)).unwrap_or_default()
    }

    /// All bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or(&[])
    }

    /// As a frame; `None` if the addresses hold no such sensor.
    pub fn frame(&self, addresses: &Addresses) -> Option<CanFrame> {
        let id = addresses.id(self.sensor, self.message)?;
        match self.packing {
            Packing::Classic => CanFrame::classic(id, self.bytes()),
            Packing::Long | Packing::Secured => CanFrame::fd(id, self.bytes()),
        }
    }
}

/// Why bytes are no message of ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotAMessage {
    /// The identifier is none of ours.
    Foreign,
    /// Protection failed.
    Protection(E2eError),
    /// More bytes than the longest message has.
    TooLong {
        /// Bytes there are.
        length: usize,
    },
    /// Number or sensor inside do not fit the identifier.
    Mislabelled {
        /// The message number inside.
        number: u8,
        /// The sensor inside.
        sensor: u8,
    },
}

/// Why a message is not authentic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotAuthentic {
    /// It carries no authenticator.
    Bare,
    /// The freshness value is not known yet.
    NoFreshness,
    /// A freshness message that is not above the last value.
    Old,
    /// The authenticator is another's.
    Code,
}

/// A checked message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received<'a> {
    /// The sensor it is from.
    pub sensor: u8,
    /// What it is.
    pub message: Message,
    /// How it was packed.
    pub packing: Packing,
    /// Epoch of the sender.
    pub epoch: Epoch,
    /// The protection's counter.
    pub counter: u8,
    /// The message's own bytes; in a sealed message with the authenticator after them.
    pub own: &'a [u8],
    /// Whether it is secured and nobody has looked at the authenticator yet.
    pub sealed: bool,
}

impl<'a> Received<'a> {
    /// Checks a frame.
    ///
    /// # Errors
    /// A frame that is not ours, or not intact.
    pub fn from_frame(frame: &'a CanFrame, addresses: &Addresses) -> Result<Self, NotAMessage> {
        let label = addresses.message(frame.id).ok_or(NotAMessage::Foreign)?;
        Self::labelled(frame, label)
    }

    /// Checks a frame whose identifier says sensor and message.
    pub(super) fn labelled(frame: &'a CanFrame, (sensor, message): (u8, Message)) -> Result<Self, NotAMessage> {
        let bytes = frame.data();
        if frame.fd {
            let received = Self::from_bytes(bytes)?;
            return if (received.sensor, received.message) == (sensor, message) {
                Ok(received)
            } else {
                Err(NotAMessage::Mislabelled { number: received.message.number(), sensor: received.sensor })
            };
        }
        let [_, second, own @ ..] = bytes else {
            return Err(NotAMessage::Protection(E2eError::TooShort { length: bytes.len() }));
        };
        if bytes.len() < 8 {
            return Err(NotAMessage::Protection(E2eError::TooShort { length: bytes.len() }));
        }
        let counter = Profile::P11.check(bytes, data_id(sensor, message)).map_err(NotAMessage::Protection)?;
        let epoch = Epoch::new(second >> 4);
        Ok(Self { sensor, message, packing: Packing::Classic, epoch, counter, own, sealed: false })
    }

    /// Checks a long message, as a serial line or a CAN FD frame carries it.
    ///
    /// # Errors
    /// Bytes that are no intact message.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Self, NotAMessage> {
        let [_, _, _, number, sensor, epoch, own @ ..] = bytes else {
            return Err(NotAMessage::Protection(E2eError::TooShort { length: bytes.len() }));
        };
        if bytes.len() > MOST_BYTES {
            return Err(NotAMessage::TooLong { length: bytes.len() });
        }
        let Some(message) = Message::from_number(*number) else {
            return Err(NotAMessage::Mislabelled { number: *number, sensor: *sensor });
        };
        let counter = Profile::P05.check(bytes, data_id(*sensor, message)).map_err(NotAMessage::Protection)?;
        let sealed = epoch & SECURED != 0;
        if epoch & RESERVED != 0 {
            // no sender says so
            return Err(NotAMessage::Mislabelled { number: *number, sensor: *sensor });
        }
        let packing = if sealed { Packing::Secured } else { Packing::Long };
        Ok(Self { sensor: *sensor, message, packing, epoch: Epoch::new(*epoch), counter, own, sealed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_one_message() {
        for number in 0..32 {
            assert_eq!(Message::from_number(number).unwrap().number(), number);
        }
        assert_eq!(Message::from_number(32), None);
        assert_eq!(Message::Map(Plane::Occupancy, Part::More(Word::Fourth)).number(), 22);
        assert_eq!(Message::from_number(7), Some(Message::Map(Plane::Visibility, Part::Delta)));
        assert_eq!(Message::from_number(23), Some(Message::Map(Plane::Occupancy, Part::Plain)));
    }

    #[test]
    fn addresses_go_both_ways_and_stay_clear_of_the_radars() {
        for addresses in [Addresses::STANDARD, Addresses::EXTENDED] {
            for sensor in 0..8 {
                for number in 0..32 {
                    let message = Message::from_number(number).unwrap();
                    let id = addresses.id(sensor, message).unwrap();
                    assert_eq!(addresses.message(id), Some((sensor, message)));
                    if let CanId::Standard(raw) = id {
                        assert!((0x400..0x500).contains(&raw), "{raw:#x}");
                    }
                }
            }
        }
        assert_eq!(Addresses::STANDARD.message(CanId::Standard(0x600)), None);
        assert_eq!(Addresses::STANDARD.message(CanId::Standard(0x3FF)), None);
        assert_eq!(Addresses::STANDARD.message(CanId::Extended(0x400)), None);
        assert_eq!(Addresses::STANDARD.id(100, Message::Status), None);
        assert!(Addresses::new(CanId::Standard(0x410)).is_none() && Addresses::new(CanId::Standard(0x520)).is_some());
    }

    #[test]
    fn a_classic_message_is_these_bytes() {
        let message = Message::Map(Plane::Visibility, Part::Refresh);
        let packet = Packet::new(Packing::Classic, 1, message, Epoch::new(5), &[0xAA, 1, 2, 3, 4, 5]).protect(3, None);
        assert_eq!(packet.bytes()[1..], [0x53, 0xAA, 1, 2, 3, 4, 5]);
        let frame = packet.frame(&Addresses::STANDARD).unwrap();
        assert_eq!(frame.id, CanId::Standard(0x426));
        let received = Received::from_frame(&frame, &Addresses::STANDARD).unwrap();
        assert_eq!(
            (received.sensor, received.message, received.epoch, received.counter),
            (1, message, Epoch::new(5), 3)
        );
        assert_eq!(received.own, [0xAA, 1, 2, 3, 4, 5]);
        // the same bytes under another sensor's identifier
        let other = CanFrame::classic(CanId::Standard(0x406), packet.bytes()).unwrap();
        assert_eq!(Received::from_frame(&other, &Addresses::STANDARD), Err(NotAMessage::Protection(E2eError::Check)));
    }

    #[test]
    fn a_long_message_carries_its_number_and_sensor() {
        let packet = Packet::new(Packing::Long, 2, Message::Header, Epoch::new(9), &[7; 10]).protect(200, Some(16));
        assert_eq!(packet.bytes()[2..7], [200, 1, 2, 9, 7]);
        let received = Received::from_bytes(packet.bytes()).unwrap();
        assert_eq!((received.message, received.own.len()), (Message::Header, 10));
        let frame = CanFrame::fd(CanId::Standard(0x440), packet.bytes()).unwrap();
        assert_eq!(
            Received::from_frame(&frame, &Addresses::STANDARD),
            Err(NotAMessage::Mislabelled { number: 1, sensor: 2 })
        );
        assert!(Received::from_bytes(&packet.bytes()[..15]).is_err(), "cut short");
        assert!(Received::from_bytes(&[]).is_err());
    }
}
