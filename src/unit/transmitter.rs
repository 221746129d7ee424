//! A polled serial transmitter that never holds up the unit: messages go out whole or are dropped.
//!
//! A line that takes no byte for a while is stalled: from then on it is not waited for, and every message
//! is dropped, and counted by the caller, until it takes bytes again. Nothing waits here to be sent late.
//! Of the message that was under way when it stalled the rest is dropped too; the next thing on the line is
//! [`BREAK`], which spoils that message and ends it, so that a receiver drops it and reads the next one.

/// A transmitter's data register.
pub trait BytePort {
    /// Hands over a byte; `false` if it is not taken now.
    fn put(&mut self, byte: u8) -> bool;
}

/// A byte too much, so that not even a message that lacked nothing but its end passes, and the end.
pub const BREAK: [u8; 2] = [0xFF, 0];

/// Keeps a line in step over stalls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transmitter {
    patience: u32,
    stalled: bool,
    /// Bytes of the break still to be sent after a message that was begun and not ended.
    cut: u8,
}

impl Transmitter {
    /// For a line that is stalled when it has refused a byte so many times.
    pub const fn new(patience: u32) -> Self {
        Self { patience, stalled: false, cut: 0 }
    }

    /// Sends a message that is stuffed as in [`serial`](crate::wire::serial); `false` if it is dropped.
    pub fn send(&mut self, port: &mut impl BytePort, message: &[u8]) -> bool {
        for byte in BREAK.iter().skip(BREAK.len().saturating_sub(usize::from(self.cut))) {
            if !self.put(port, *byte) {
                return false;
            }
            self.cut = self.cut.saturating_sub(1);
        }
        for (k, byte) in message.iter().enumerate() {
            if !self.put(port, *byte) {
                self.cut = if k > 0 { 2 } else { 0 };
                return false;
            }
        }
        true
    }

    fn put(&mut self, port: &mut impl BytePort, byte: u8) -> bool {
        let looks = if self.stalled { 1 } else { self.patience };
        let taken = (0..looks).any(|_| port.put(byte));
        self.stalled = !taken;
        taken
    }

    /// Whether the line takes nothing.
    pub fn stalled(&self) -> bool {
        self.stalled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
    use std::vec;
    use std::vec::Vec;

    struct Line {
        taken: Vec<u8>,
        room: usize,
        looks: u32,
    }

    impl BytePort for Line {
        fn put(&mut self, byte: u8) -> bool {
            self.looks += 1;
            let room = self.room > 0;
            if room {
                self.taken.push(byte);
                self.room -= 1;
            }
            room
        }
    }

    fn message(byte: u8) -> Vec<u8> {
        let mut line = [0; MOST_STUFFED];
        let n = stuff(&[byte; 20], &mut line).unwrap();
        line[..n].to_vec()
    }

    fn read(mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let (mut unstuffer, mut messages) = (Unstuffer::new(), Vec::new());
        while !bytes.is_empty() {
            let (taken, message) = unstuffer.push(bytes);
            messages.extend(message.filter(|m| !m.is_empty()).map(<[u8]>::to_vec));
            bytes = &bytes[taken..];
        }
        messages
    }

    #[test]
    fn whatever_byte_it_stalls_at_whole_messages_follow() {
        for room in 0..=2 * message(1).len() {
            let mut line = Line { taken: Vec::new(), room, looks: 0 };
            let mut transmitter = Transmitter::new(50);
            let sent: Vec<bool> = (1..=4).map(|k| transmitter.send(&mut line, &message(k))).collect();
            let whole = room / message(1).len();
            assert_eq!(sent, [whole > 0, whole > 1, false, false]);
            assert!(transmitter.stalled() && line.looks <= 50 + room as u32 + 4, "{} looks", line.looks);
            line.room = 1000;
            assert!(transmitter.send(&mut line, &message(9)) && !transmitter.stalled());
            // a message that was cut does not pass its check, whatever is left of it
            let got = read(&line.taken);
            let intact = |m: &&Vec<u8>| m.len() == 20 && m.iter().all(|byte| *byte == m[0]);
            let full: Vec<u8> = got.iter().filter(intact).map(|m| m[0]).collect();
            let mut expected = vec![1, 2];
            expected.truncate(whole);
            expected.push(9);
            assert_eq!(full, expected, "room for {room}");
        }
    }
}
