//! How long a frame takes, with the stuff bits of its actual bytes.
//!
//! Classic CAN (ISO 11898-1): start, arbitration, control, data and check sum are stuffed: after five
//! equal bits comes one of the other kind. Delimiter, acknowledgement, end of frame and intermission
//! take 13 more. CAN FD: stuffed up to the data's end, then a stuff count and a check sum with
//! stuff bits at fixed places; from the switch on at the data rate.

use viewshed::wire::frame::{CanFrame, CanId};

/// Bits after the check sum: its delimiter, acknowledgement, end of frame, intermission.
const TAIL: u32 = 13;

/// Bits of a frame, at the nominal rate and at CAN FD's data rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bits {
    pub nominal: u32,
    pub data: u32,
}

/// Bits in the order they are sent.
struct Sequence {
    bits: Vec<bool>,
}

impl Sequence {
    fn push(&mut self, value: u32, count: u32) {
        self.bits.extend((0..count).rev().map(|i| value >> i & 1 == 1));
    }

    /// Stuff bits that come before each bit, in all.
    fn stuff_before(&self) -> Vec<u32> {
        let (mut before, mut stuffed) = (Vec::with_capacity(self.bits.len()), 0);
        let (mut run, mut last) = (0, None);
        for &bit in &self.bits {
            if run == 5 {
                // the stuff bit begins a run of its own
                stuffed += 1;
                (run, last) = (1, last.map(|last: bool| !last));
            }
            run = if last == Some(bit) { run + 1 } else { 1 };
            last = Some(bit);
            before.push(stuffed);
        }
        // one may be due after the last bit
        before.push(stuffed + u32::from(run == 5));
        before
    }
}

/// Bits of a frame.
pub fn of(frame: &CanFrame) -> Bits {
    if frame.fd { fd(frame) } else { classic(frame) }
}

fn identifier(id: CanId, sequence: &mut Sequence, remote_bit: u32) {
    match id {
        CanId::Standard(raw) => {
            sequence.push(u32::from(raw), 11);
            sequence.push(remote_bit, 1);
            sequence.push(0, 1);
        }
        CanId::Extended(raw) => {
            sequence.push(raw >> 18, 11);
            sequence.push(0b11, 2);
            sequence.push(raw & 0x3_FFFF, 18);
            sequence.push(remote_bit, 1);
        }
    }
}

fn classic(frame: &CanFrame) -> Bits {
    let mut s = Sequence { bits: vec![false] };
    identifier(frame.id, &mut s, 0);
    s.push(0, if matches!(frame.id, CanId::Standard(_)) { 1 } else { 2 });
    s.push(frame.data().len() as u32, 4);
    frame.data().iter().for_each(|byte| s.push(u32::from(*byte), 8));
    let sum = crc_15(&s.bits);
    s.push(sum, 15);
    let stuffed = s.stuff_before().last().copied().unwrap_or(0);
    Bits { nominal: s.bits.len() as u32 + stuffed + TAIL, data: 0 }
}

fn crc_15(bits: &[bool]) -> u32 {
    bits.iter().fold(0, |sum: u32, bit| {
        let next = *bit ^ (sum >> 14 & 1 == 1);
        (sum << 1 & 0x7FFF) ^ if next { 0x4599 } else { 0 }
    })
}

fn fd(frame: &CanFrame) -> Bits {
    let mut s = Sequence { bits: vec![false] };
    identifier(frame.id, &mut s, 0);
    // FDF, reserved, BRS
    s.push(0b101, 3);
    let arbitration = s.bits.len();
    s.push(0, 1);
    let length = frame.data().len();
    let code = match length {
        0..=8 => length,
        _ => 9 + [12, 16, 20, 24, 32, 48, 64].iter().position(|l| *l == length).unwrap_or(6),
    };
    s.push(code as u32, 4);
    frame.data().iter().for_each(|byte| s.push(u32::from(*byte), 8));
    let before = s.stuff_before();
    let all = before.last().copied().unwrap_or(0);
    let early = before.get(arbitration).copied().unwrap_or(0);
    // stuff count and check sum, a fixed stuff bit before every fourth
    let sum = if length <= 16 { 4 + 17 + 6 } else { 4 + 21 + 7 };
    Bits { nominal: arbitration as u32 + early + TAIL, data: (s.bits.len() - arbitration) as u32 + all - early + sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard(raw: u16, bytes: &[u8]) -> CanFrame {
        CanFrame::classic(CanId::standard(raw).unwrap(), bytes).unwrap()
    }

    #[test]
    fn an_8_byte_frame_takes_111_bits_and_at_most_24_stuff_bits() {
        // no five equal bits in a row up to the check sum
        let plain = of(&standard(0x2AA, &[0x55; 8])).nominal;
        assert!((111..=114).contains(&plain), "{plain}");
        for fill in [0x00, 0xFF, 0x0F, 0xF8, 0x87, 0x3C] {
            let bits = of(&standard(0x000, &[fill; 8])).nominal;
            assert!((111..=135).contains(&bits), "{fill:#x}: {bits}");
        }
        assert!(of(&standard(0, &[0; 8])).nominal > 125);
    }

    #[test]
    fn a_stuff_bit_begins_the_next_run() {
        let count = |bits: &[u32]| {
            let mut s = Sequence { bits: Vec::new() };
            bits.iter().for_each(|b| s.push(*b, 1));
            s.stuff_before().last().copied().unwrap()
        };
        assert_eq!(count(&[0, 0, 0, 0]), 0);
        assert_eq!(count(&[0, 0, 0, 0, 0]), 1);
        // 00000 I 1111 O: the stuffed one and four more make five
        assert_eq!(count(&[0, 0, 0, 0, 0, 1, 1, 1, 1]), 2);
        assert_eq!(count(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), 2);
    }

    #[test]
    fn the_check_sum_is_cans() {
        // of the number 1 after 14 zeros: the polynomial itself
        let mut bits = vec![false; 14];
        bits.push(true);
        assert_eq!(crc_15(&bits), 0x4599);
        // a check sum checks to nothing
        let mut s = Sequence { bits: bits.clone() };
        s.push(crc_15(&bits), 15);
        assert_eq!(crc_15(&s.bits), 0);
    }

    #[test]
    fn can_fd_sends_most_bits_at_the_data_rate() {
        let frame = CanFrame::fd(CanId::standard(0x2AA).unwrap(), &[0x55; 64]).unwrap();
        let bits = of(&frame);
        assert_eq!(bits.nominal, 17 + 13);
        assert!((1 + 4 + 512 + 32..1 + 4 + 512 + 34).contains(&bits.data), "{bits:?}");
        let extended = CanFrame::classic(CanId::extended(0x0AAA_AAAA).unwrap(), &[0x55; 8]).unwrap();
        assert!((131..=135).contains(&of(&extended).nominal));
    }
}
