//! Authentication of CAN FD and serial messages: AES-CMAC, truncated, with freshness.
//!
//! # Model
//! The last 8 bytes of a secured message are the lowest 16 bits of its freshness value and the first 6
//! bytes of AES-128-CMAC over data ID, freshness value and the bytes from the third on. The value grows
//! by one with every message of a sensor. A receiver takes the nearest value above the last it accepted;
//! the freshness message, twice a second, has all of it, so that either side may begin anew.
//!
//! # Limits
//! A forged message passes once in 2^48. More than 65 535 messages lost in a row are made up for by the
//! next freshness message. A receiver that keeps no value over its restarts can be shown an old one by
//! repeated messages, until the first freshness message of the real sender; hand the last value to
//! [`Opener::resume`].
//!
//! # References
//! RFC 4493, The AES-CMAC Algorithm.

use aes::Aes128;
use cmac::{Cmac, KeyInit, Mac};

use super::frame::fd_length;
pub use super::message::NotAuthentic;
use super::message::{Message, Packet, Packing, Received, SEAL_BYTES, data_id};

/// Where the key comes from: a fuse, a secure element, a file.
pub trait Key {
    /// The key of a sensor.
    fn key(&self, sensor: u8) -> [u8; 16];
}

impl Key for [u8; 16] {
    fn key(&self, _sensor: u8) -> [u8; 16] {
        *self
    }
}

/// Bytes of the message authentication code that are sent.
const MAC_BYTES: usize = SEAL_BYTES - 2;

/// Begin of a long message that is not authenticated: check sum and counter.
const BEGIN: usize = 3;

fn code(key: &impl Key, sensor: u8, message: Message, freshness: u64, bytes: &[&[u8]]) -> Cmac<Aes128> {
    let mut mac = Cmac::<Aes128>::new(&key.key(sensor).into());
    mac.update(&data_id(sensor, message).to_be_bytes());
    mac.update(&freshness.to_be_bytes());
    bytes.iter().for_each(|bytes| mac.update(bytes));
    mac
}

/// Seals the messages of one sensor.
#[derive(Clone)]
pub struct Sealer<K> {
    key: K,
    freshness: u64,
}

impl<K> core::fmt::Debug for Sealer<K> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Sealer").field("freshness", &self.freshness).finish_non_exhaustive()
    }
}

impl<K: Key> Sealer<K> {
    /// Goes on above a freshness value that was never used: kept over restarts, or a set clock.
    pub const fn new(key: K, freshness: u64) -> Self {
        Self { key, freshness }
    }

    /// The freshness value used last.
    pub const fn freshness(&self) -> u64 {
        self.freshness
    }

    /// Puts the authenticator after a message's own bytes; filled up first to a length CAN FD has.
    #[must_use]
    pub(super) fn seal(&mut self, mut packet: Packet, can_fd: bool) -> Packet {
        self.freshness = self.freshness.saturating_add(1);
        let (sensor, message) = (packet.sensor, packet.message);
        let length = packet.bytes().len() + SEAL_BYTES;
        let length = fd_length(length).filter(|_| can_fd).unwrap_or(length);
        let bytes = packet.lengthen(length);
        let full = self.freshness.to_be_bytes();
        if message == Message::Freshness {
            bytes.iter_mut().skip(OWN).zip(full).for_each(|(to, from)| *to = from);
        }
        let [.., high, low] = full;
        let covered = bytes.get(BEGIN..length.saturating_sub(SEAL_BYTES)).unwrap_or(&[]);
        let code: [u8; 16] =
            code(&self.key, sensor, message, self.freshness, &[covered]).finalize().into_bytes().into();
        let seal = [high, low].into_iter().chain(code.into_iter().take(MAC_BYTES));
        bytes.iter_mut().skip(length.saturating_sub(SEAL_BYTES)).zip(seal).for_each(|(to, from)| *to = from);
        packet
    }
}

/// First own byte of a long message.
const OWN: usize = 6;

/// Opens the messages of one sensor.
#[derive(Clone)]
pub struct Opener<K> {
    key: K,
    last: Option<u64>,
}

impl<K> core::fmt::Debug for Opener<K> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Opener").field("last", &self.last).finish_non_exhaustive()
    }
}

impl<K: Key> Opener<K> {
    /// Waits for the first freshness message.
    pub const fn new(key: K) -> Self {
        Self { key, last: None }
    }

    /// Takes only what is above this freshness value.
    pub const fn resume(key: K, last: u64) -> Self {
        Self { key, last: Some(last) }
    }

    /// Takes only what is above this freshness value, from now on.
    pub(super) const fn resume_at(&mut self, last: u64) {
        self.last = Some(last);
    }

    /// The freshness value accepted last.
    pub const fn freshness(&self) -> Option<u64> {
        self.last
    }

    /// Checks the authenticator of a message and takes it off.
    ///
    /// # Errors
    /// A message that is not the sensor's, or is not new.
    pub fn open<'a>(&mut self, message: &Received<'a>) -> Result<Received<'a>, NotAuthentic> {
        let (own, seal) = message.own.split_last_chunk::<SEAL_BYTES>().ok_or(NotAuthentic::Bare)?;
        if !message.sealed || message.packing != Packing::Secured {
            return Err(NotAuthentic::Bare);
        }
        let [high, low, code_sent @ ..] = seal;
        let lowest = u64::from(u16::from_be_bytes([*high, *low]));
        let freshness = if message.message == Message::Freshness {
            let full = u64::from_be_bytes(*own.first_chunk().ok_or(NotAuthentic::Old)?);
            if self.last.is_some_and(|last| full <= last) || full & 0xFFFF != lowest {
                return Err(NotAuthentic::Old);
            }
            full
        } else {
            let last = self.last.ok_or(NotAuthentic::NoFreshness)?;
            let same = (last & !0xFFFF) | lowest;
            if same > last { same } else { same.saturating_add(0x1_0000) }
        };
        // what comes before the own bytes, as it was sent
        let begin = [message.message.number(), message.sensor, message.epoch.number() | 0x80];
        let code = code(&self.key, message.sensor, message.message, freshness, &[&begin, own]);
        // takes as long whatever differs
        code.verify_truncated_left(code_sent).map_err(|_| NotAuthentic::Code)?;
        self.last = Some(freshness);
        Ok(Received { own, sealed: false, ..*message })
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::Epoch;
    use super::*;

    const KEY: [u8; 16] =
        [0x2B, 0x7E, 0x15, 0x16, 0x28, 0xAE, 0xD2, 0xA6, 0xAB, 0xF7, 0x15, 0x88, 0x09, 0xCF, 0x4F, 0x3C];

    #[test]
    fn the_codes_are_those_of_rfc_4493() {
        let message = [
            0x6B, 0xC1, 0xBE, 0xE2, 0x2E, 0x40, 0x9F, 0x96, 0xE9, 0x3D, 0x7E, 0x11, 0x73, 0x93, 0x17, 0x2A, 0xAE, 0x2D,
            0x8A, 0x57, 0x1E, 0x03, 0xAC, 0x9C, 0x9E, 0xB7, 0x6F, 0xAC, 0x45, 0xAF, 0x8E, 0x51, 0x30, 0xC8, 0x1C, 0x46,
            0xA3, 0x5C, 0xE4, 0x11, 0xE5, 0xFB, 0xC1, 0x19, 0x1A, 0x0A, 0x52, 0xEF, 0xF6, 0x9F, 0x24, 0x45, 0xDF, 0x4F,
            0x9B, 0x17, 0xAD, 0x2B, 0x41, 0x7B, 0xE6, 0x6C, 0x37, 0x10,
        ];
        let expected: [(usize, u128); 4] = [
            (0, 0xBB1D_6929_E959_3728_7FA3_7D12_9B75_6746),
            (16, 0x070A_16B4_6B4D_4144_F79B_DD9D_D04A_287C),
            (40, 0xDFA6_6747_DE9A_E630_30CA_3261_1497_C827),
            (64, 0x51F0_BEBF_7E3B_9D92_FC49_7417_7936_3CFE),
        ];
        for (length, code) in expected {
            let mut mac = Cmac::<Aes128>::new(&KEY.into());
            mac.update(&message[..length]);
            assert_eq!(u128::from_be_bytes(mac.finalize().into_bytes().into()), code, "{length} bytes");
        }
    }

    fn sealed(sealer: &mut Sealer<[u8; 16]>, message: Message, own: &[u8], can_fd: bool) -> Packet {
        let packet = Packet::new(Packing::Secured, 3, message, Epoch::new(5), own);
        sealer.seal(packet, can_fd).protect(7, None)
    }

    #[test]
    fn a_sealed_message_is_these_bytes() {
        let mut sealer = Sealer::new(KEY, 0x0102_0304);
        let packet = sealed(&mut sealer, Message::Status, &[1, 2, 3], false);
        assert_eq!(packet.bytes().len(), 6 + 3 + 8);
        assert_eq!(packet.bytes()[2..11], [7, 0, 3, 0x85, 1, 2, 3, 0x03, 0x05]);
        let mut mac = Cmac::<Aes128>::new(&KEY.into());
        mac.update(&[0x80, 0x60, 0, 0, 0, 0, 1, 2, 3, 5, 0, 3, 0x85, 1, 2, 3]);
        assert_eq!(packet.bytes()[11..], mac.finalize().into_bytes()[..6]);
        let filled = sealed(&mut sealer, Message::Status, &[1, 2, 3], true);
        assert_eq!(filled.bytes().len(), 20);
        assert_eq!(filled.bytes()[6..14], [1, 2, 3, 0, 0, 0, 0x03, 0x06]);
    }

    #[test]
    fn keys_do_not_get_into_logs() {
        let shown = std::format!("{:?} {:?}", Sealer::new(KEY, 7), Opener::resume(KEY, 8));
        assert_eq!(shown, "Sealer { freshness: 7, .. } Opener { last: Some(8), .. }");
    }

    #[test]
    fn a_freshness_message_lets_either_side_begin_anew() {
        let mut sealer = Sealer::new(KEY, 0xFFFE);
        let mut opener = Opener::new(KEY);
        let mut pass = |packet: &Packet| {
            let received = Received::from_bytes(packet.bytes()).unwrap();
            opener.open(&received).map(|opened| opened.own.to_vec())
        };
        let early = sealed(&mut sealer, Message::Status, &[9], false);
        assert_eq!(pass(&early), Err(NotAuthentic::NoFreshness));
        let fresh = sealed(&mut sealer, Message::Freshness, &[0; 8], false);
        assert_eq!(pass(&fresh), Ok(0x1_0000_u64.to_be_bytes().to_vec()));
        assert_eq!(pass(&fresh), Err(NotAuthentic::Old), "again");
        let next = sealed(&mut sealer, Message::Status, &[9], false);
        assert_eq!(pass(&next), Ok([9].to_vec()));
        assert_eq!(pass(&next), Err(NotAuthentic::Code), "repeated");
        // some are lost, over the edge of the 16 bits
        for _ in 0..0x1_0000 {
            let _ = sealed(&mut sealer, Message::Status, &[8], false);
        }
        assert_eq!(pass(&sealed(&mut sealer, Message::Status, &[7], false)), Err(NotAuthentic::Code), "too many");
        assert!(pass(&sealed(&mut sealer, Message::Freshness, &[0; 8], false)).is_ok());
        assert_eq!(pass(&sealed(&mut sealer, Message::Status, &[6], false)), Ok([6].to_vec()));
        // the sender begins anew, above
        let mut sealer = Sealer::new(KEY, 1 << 40);
        assert_eq!(pass(&sealed(&mut sealer, Message::Status, &[5], false)), Err(NotAuthentic::Code));
        assert!(pass(&sealed(&mut sealer, Message::Freshness, &[0; 8], false)).is_ok());
        assert_eq!(pass(&sealed(&mut sealer, Message::Status, &[5], false)), Ok([5].to_vec()));
    }

    #[test]
    fn any_changed_byte_and_any_other_key_is_found() {
        let mut sealer = Sealer::new(KEY, 10);
        let packet = sealed(&mut sealer, Message::Status, &[1, 2, 3, 4], false);
        let received = Received::from_bytes(packet.bytes()).unwrap();
        assert!(Opener::resume(KEY, 10).open(&received).is_ok());
        assert_eq!(Opener::resume([0; 16], 10).open(&received), Err(NotAuthentic::Code));
        for place in 0..received.own.len() {
            let mut own = received.own.to_vec();
            own[place] ^= 0x10;
            let forged = Received { own: &own, ..received };
            assert_eq!(Opener::resume(KEY, 10).open(&forged), Err(NotAuthentic::Code), "{place}");
        }
        let renamed = Received { message: Message::Header, ..received };
        assert_eq!(Opener::resume(KEY, 10).open(&renamed), Err(NotAuthentic::Code));
        let bare = Packet::new(Packing::Long, 3, Message::Status, Epoch::new(5), &[0; 20]).protect(0, None);
        assert_eq!(Opener::resume(KEY, 10).open(&Received::from_bytes(bare.bytes()).unwrap()), Err(NotAuthentic::Bare));
    }
}
