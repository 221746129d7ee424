//! What a receiver is fed: the lines of the protocol in `README.md`.

use std::fmt;
use std::str::FromStr;

use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::Addresses;

/// What messages travel on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bus {
    Can,
    CanFd,
    Serial,
}

impl Bus {
    pub const ALL: [Self; 3] = [Self::Can, Self::CanFd, Self::Serial];

    pub fn name(self) -> &'static str {
        match self {
            Self::Can => "can",
            Self::CanFd => "canfd",
            Self::Serial => "serial",
        }
    }

    pub fn medium(self) -> Medium {
        match self {
            Self::Can => Medium::Can(Addresses::STANDARD),
            Self::CanFd => Medium::CanFd(Addresses::STANDARD),
            Self::Serial => Medium::Serial,
        }
    }
}

/// A line. Times are microseconds of the receiver's clock.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    Start { bus: Bus, sensor: u8 },
    Frame { time: u64, id: CanId, data: Vec<u8> },
    Bytes { time: u64, data: Vec<u8> },
    Look { time: u64 },
    Cells { time: u64 },
    Probability { time: u64 },
}

impl Input {
    /// By the receiver's clock.
    pub fn time(&self) -> Option<u64> {
        match self {
            Self::Start { .. } => None,
            Self::Frame { time, .. }
            | Self::Bytes { time, .. }
            | Self::Look { time }
            | Self::Cells { time }
            | Self::Probability { time } => Some(*time),
        }
    }

    /// As a frame of this bus.
    pub fn frame(&self, bus: Bus) -> Option<CanFrame> {
        let Self::Frame { id, data, .. } = self else { return None };
        match bus {
            Bus::Can => CanFrame::classic(*id, data),
            Bus::CanFd => CanFrame::fd(*id, data),
            Bus::Serial => None,
        }
    }
}

struct Hex<'a>(&'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("-");
        }
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start { bus, sensor } => write!(f, "start {} {sensor}", bus.name()),
            Self::Frame { time, id, data } => write!(f, "frame {time} {:03X} {}", id.raw(), Hex(data)),
            Self::Bytes { time, data } => write!(f, "bytes {time} {}", Hex(data)),
            Self::Look { time } => write!(f, "look {time}"),
            Self::Cells { time } => write!(f, "cells {time}"),
            Self::Probability { time } => write!(f, "probability {time}"),
        }
    }
}

fn bytes(text: &str) -> Option<Vec<u8>> {
    if text == "-" {
        return Some(Vec::new());
    }
    if !text.len().is_multiple_of(2) || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).ok()).collect()
}

impl FromStr for Input {
    type Err = String;

    fn from_str(line: &str) -> Result<Self, String> {
        let fields: Vec<&str> = line.split(' ').collect();
        let time = |text: &str| text.parse::<u64>().ok();
        let input = match fields[..] {
            ["start", bus, sensor] => Bus::ALL
                .into_iter()
                .find(|known| known.name() == bus)
                .zip(sensor.parse().ok().filter(|sensor| *sensor < 8))
                .map(|(bus, sensor)| Self::Start { bus, sensor }),
            ["frame", at, id, data] => {
                let id = u16::from_str_radix(id, 16).ok().and_then(CanId::standard);
                time(at).zip(id).zip(bytes(data)).map(|((time, id), data)| Self::Frame { time, id, data })
            }
            ["bytes", at, data] => time(at).zip(bytes(data)).map(|(time, data)| Self::Bytes { time, data }),
            ["look", at] => time(at).map(|time| Self::Look { time }),
            ["cells", at] => time(at).map(|time| Self::Cells { time }),
            ["probability", at] => time(at).map(|time| Self::Probability { time }),
            _ => None,
        };
        input.ok_or_else(|| format!("`{line}` is no line of tests/conformance/README.md"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_as_they_are_written() {
        for line in [
            "start canfd 7",
            "frame 123 40A 00FF",
            "frame 1 400 -",
            "bytes 9 0102",
            "look 5",
            "cells 9007199254740991",
            "probability 6",
        ] {
            assert_eq!(line.parse::<Input>().unwrap().to_string(), line);
        }
        for line in
            ["start can 8", "start lin 0", "frame 1 800 00", "frame 1 400 0", "look", "look -1", "", "bytes 1 0G"]
        {
            assert!(line.parse::<Input>().unwrap_err().contains(line), "{line}");
        }
    }
}
