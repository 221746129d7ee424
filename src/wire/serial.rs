//! Messages on a serial line: COBS, each ended by a zero byte.
//!
//! # Model
//! Consistent Overhead Byte Stuffing takes the zeros out of a message, so that a zero always is an
//! end and a receiver is in step again with the next one, whatever it lost. One byte more for a
//! message of up to 254 bytes, and the zero.
//!
//! # Limits
//! Messages of up to [`MOST_BYTES`] bytes. A flipped bit in a stuffed message can change many bytes,
//! so what the check sum promises for few flipped bits does not hold here; what remains is one
//! accepted in 65 536.
//!
//! # References
//! S. Cheshire, M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Trans. Networking 7 (1999).

use cobs::{DecodeResult, DecoderState, EncoderState, PushResult};

/// Most bytes of a message on a serial line.
pub const MOST_BYTES: usize = 240;

/// Most bytes a message takes on the line.
pub const MOST_STUFFED: usize = MOST_BYTES + 2;

/// Writes a message as it goes on the line, the ending zero included; its length, or `None` if the
/// message or the buffer is too long or short.
pub fn stuff(message: &[u8], line: &mut [u8]) -> Option<usize> {
    if message.len() > MOST_BYTES {
        return None;
    }
    let mut state = EncoderState::default();
    *line.first_mut()? = 0;
    let mut at = 1;
    for byte in message {
        match state.push(*byte) {
            PushResult::AddSingle(byte) => *line.get_mut(at)? = byte,
            PushResult::ModifyFromStartAndSkip((place, code)) => {
                *line.get_mut(place)? = code;
                *line.get_mut(at)? = 0;
            }
            // needs a run of 254 bytes
            PushResult::ModifyFromStartAndPushAndSkip(_) => return None,
        }
        at += 1;
    }
    let (place, code) = state.finalize();
    *line.get_mut(place)? = code;
    *line.get_mut(at)? = 0;
    Some(at + 1)
}

/// Takes messages out of a stream of bytes.
#[derive(Debug, Clone)]
pub struct Unstuffer {
    message: [u8; MOST_BYTES],
    length: usize,
    /// Bytes of the running block still to come, and whether a zero follows it.
    left: Option<(u8, bool)>,
    broken: bool,
    errors: u32,
}

impl Default for Unstuffer {
    fn default() -> Self {
        Self::new()
    }
}

impl Unstuffer {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self { message: [0; MOST_BYTES], length: 0, left: None, broken: false, errors: 0 }
    }

    /// Takes bytes up to the end of a message. Returns how many it took, and the message if it is
    /// complete; the rest is to be pushed again.
    pub fn push(&mut self, bytes: &[u8]) -> (usize, Option<&[u8]>) {
        for (i, byte) in bytes.iter().enumerate() {
            if let Some(length) = self.take(*byte) {
                return (i + 1, self.message.get(..length));
            }
        }
        (bytes.len(), None)
    }

    /// Takes a byte; the length of the message it completes.
    fn take(&mut self, byte: u8) -> Option<usize> {
        let mut state = match self.left {
            None => DecoderState::Idle,
            Some((left, true)) => DecoderState::Grab(left),
            Some((left, false)) => DecoderState::GrabChain(left),
        };
        if self.broken {
            // wait for the end of the message
            self.broken = byte != 0;
            return None;
        }
        let outcome = state.feed(byte);
        self.left = match state {
            DecoderState::Idle => None,
            DecoderState::Grab(left) => Some((left, true)),
            DecoderState::GrabChain(left) => Some((left, false)),
        };
        match outcome {
            Ok(DecodeResult::DataStart) => self.length = 0,
            Ok(DecodeResult::DataContinue(byte)) => match self.message.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.give_up(byte != 0),
            },
            Ok(DecodeResult::DataComplete) => return Some(self.length),
            Ok(DecodeResult::NoData) => {}
            Err(_) => self.give_up(byte != 0),
        }
        None
    }

    fn give_up(&mut self, wait_for_end: bool) {
        self.errors = self.errors.saturating_add(1);
        self.broken = wait_for_end;
        self.left = None;
    }

    /// Messages given up: too long, or ended in the middle of a block.
    pub fn errors(&self) -> u32 {
        self.errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    fn on_the_line(message: &[u8]) -> Vec<u8> {
        let mut line = [0; MOST_STUFFED];
        let n = stuff(message, &mut line).unwrap();
        line[..n].to_vec()
    }

    fn read(unstuffer: &mut Unstuffer, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut messages = Vec::new();
        while !bytes.is_empty() {
            let (taken, message) = unstuffer.push(bytes);
            messages.extend(message.map(<[u8]>::to_vec));
            bytes = &bytes[taken..];
        }
        messages
    }

    #[test]
    fn zeros_become_distances() {
        assert_eq!(on_the_line(&[0x11, 0, 0x22]), [2, 0x11, 2, 0x22, 0]);
        assert_eq!(on_the_line(&[]), [1, 0]);
        assert_eq!(stuff(&[1; MOST_BYTES + 1], &mut [0; 300]), None);
        assert_eq!(stuff(&[1; 10], &mut [0; 11]), None);
    }

    #[test]
    fn a_message_cut_short_costs_only_itself() {
        let mut line = on_the_line(&[1, 2, 3, 4, 5]);
        line.drain(2..4);
        line.extend(on_the_line(&[9, 0, 9]));
        let mut u = Unstuffer::new();
        assert_eq!(read(&mut u, &line), [vec![9, 0, 9]]);
        assert_eq!(u.errors(), 1);
    }

    #[test]
    fn a_message_too_long_is_given_up_to_its_end() {
        let mut line = vec![0xFF; 300];
        line.push(0);
        line.extend(on_the_line(&[7]));
        let mut u = Unstuffer::new();
        assert_eq!(read(&mut u, &line), [vec![7]]);
    }

    proptest! {
        #[test]
        fn messages_come_back_whatever_the_chunks(
            messages in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0_u8), any::<u8>()], 1..=MOST_BYTES), 1..8),
            chunk in prop::sample::select(&[1_usize, 11, 17, 1000][..]),
        ) {
            let line: Vec<u8> = messages.iter().flat_map(|m| on_the_line(m)).collect();
            let mut u = Unstuffer::new();
            let got: Vec<Vec<u8>> = line.chunks(chunk).flat_map(|bytes| read(&mut u, bytes)).collect();
            prop_assert_eq!(got, messages);
        }

        #[test]
        fn any_bytes_are_taken(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut u = Unstuffer::new();
            read(&mut u, &bytes);
            // two zeros bring any line back into step
            let mut line = vec![0, 0];
            line.extend(on_the_line(&[1, 2]));
            let messages = read(&mut u, &line);
            prop_assert_eq!(messages.last(), Some(&vec![1, 2]));
        }
    }
}
