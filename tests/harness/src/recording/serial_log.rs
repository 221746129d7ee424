//! Logs of a serial line, chunk by chunk, in and out.
//!
//! `(1591372012.436348) ttyS0 03A107...`: time of the last byte, device, the bytes in hexadecimal. Like a line of
//! `candump -L`, but without an identifier and a `#`.

use std::fmt;

use super::can_log::candump::{bytes, nanoseconds};

/// One line of a log: some bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    pub time_ns: i64,
    pub device: String,
    pub bytes: Vec<u8>,
}

impl Chunk {
    /// Reads a line; the error says what is wrong with it.
    pub fn parse(line: &str) -> Result<Self, String> {
        let mut words = line.split_whitespace();
        let (Some(time), Some(device), Some(digits), None) = (words.next(), words.next(), words.next(), words.next())
        else {
            return Err("not `(seconds) device bytes`".into());
        };
        let bytes = bytes(digits).ok_or_else(|| format!("`{digits}` is not whole bytes"))?;
        Ok(Self { time_ns: nanoseconds(time)?, device: device.to_owned(), bytes })
    }
}

impl fmt::Display for Chunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let micros = self.time_ns.div_euclid(1000);
        write!(f, "({}.{:06}) {} ", micros.div_euclid(1_000_000), micros.rem_euclid(1_000_000), self.device)?;
        self.bytes.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_go_both_ways_and_frames_are_none() {
        let line = "(12.000345) ttyS0 0003A1";
        let chunk = Chunk { time_ns: 12_000_345_000, device: "ttyS0".into(), bytes: vec![0, 3, 0xA1] };
        assert_eq!((Chunk::parse(line), chunk.to_string()), (Ok(chunk), line.into()));
        for wrong in ["(1.0) can0 123#00", "(1.0) ttyS0 123", "(1.0) ttyS0", "1.0 ttyS0 00", "(1.0) ttyS0 00 R"] {
            assert!(Chunk::parse(wrong).is_err(), "{wrong}");
        }
    }
}
