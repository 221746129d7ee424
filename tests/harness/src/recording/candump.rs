//! Logs of CAN buses as `candump -L` writes them, line by line, in and out.
//!
//! `(1591372012.436348) can0 60A#01C24910`: time, interface, identifier and data; `##` and a flags
//! nibble before the data of CAN FD, `#R` for a remote frame.

use std::fmt;

use viewshed::wire::frame::{CanFrame, CanId};

/// One line of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub time_ns: i64,
    pub interface: String,
    pub content: Content,
}

/// What was on the bus.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    Data(CanFrame),
    /// A request for data.
    Remote(CanId),
    /// What the controller says of the bus, by its error class.
    Error(u32),
}

/// Set in the identifier of an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;

impl Line {
    /// Reads a line; the error says what is wrong with it.
    pub fn parse(line: &str) -> Result<Self, String> {
        let mut words = line.split_whitespace();
        let (time, interface, frame) = match (words.next(), words.next(), words.next()) {
            (Some(time), Some(interface), Some(frame)) => (time, interface, frame),
            _ => return Err("not `(seconds) interface identifier#data`".into()),
        };
        // `candump -x` says at the end whether the frame was received or sent
        if words.any(|word| word != "R" && word != "T") {
            return Err("more after the frame than `R` or `T`".into());
        }
        Ok(Self { time_ns: nanoseconds(time)?, interface: interface.to_owned(), content: content(frame)? })
    }

    /// The frame, if it is one with data.
    pub fn frame(&self) -> Option<&CanFrame> {
        match &self.content {
            Content::Data(frame) => Some(frame),
            _ => None,
        }
    }
}

/// `(seconds.fraction)` with any number of digits.
pub(super) fn nanoseconds(text: &str) -> Result<i64, String> {
    let wrong = || format!("`{text}` is not a time in brackets");
    let inside = text.strip_prefix('(').and_then(|t| t.strip_suffix(')')).ok_or_else(wrong)?;
    let (seconds, fraction) = inside.split_once('.').unwrap_or((inside, "0"));
    if fraction.is_empty() || !fraction.bytes().chain(seconds.bytes()).all(|b| b.is_ascii_digit()) {
        return Err(wrong());
    }
    let nine: String = fraction.chars().chain("000000000".chars()).take(9).collect();
    let (seconds, fraction): (i64, i64) = (seconds.parse().map_err(|_| wrong())?, nine.parse().map_err(|_| wrong())?);
    seconds.checked_mul(1_000_000_000).and_then(|s| s.checked_add(fraction)).ok_or_else(wrong)
}

fn content(text: &str) -> Result<Content, String> {
    let (id, data) = text.split_once('#').ok_or_else(|| format!("`{text}` has no #"))?;
    let raw = u32::from_str_radix(id, 16).map_err(|_| format!("`{id}` is no identifier"))?;
    let id = match id.len() {
        3 => u16::try_from(raw).ok().and_then(CanId::standard),
        8 if raw & ERROR_FLAG != 0 => return Ok(Content::Error(raw & !ERROR_FLAG)),
        8 => CanId::extended(raw),
        _ => None,
    }
    .ok_or_else(|| format!("`{id}` is no identifier of 3 or 8 digits"))?;
    if data.starts_with('R') {
        return Ok(Content::Remote(id));
    }
    let fd = data.strip_prefix('#').map(|data| data.split_at_checked(1).map_or("", |(_flags, data)| data));
    // a raw length code may follow
    let digits = fd.unwrap_or(data).split('_').next().unwrap_or("");
    let bytes = bytes(digits).ok_or_else(|| format!("`{digits}` is not whole bytes"))?;
    let frame = match fd {
        Some(_) => CanFrame::fd(id, &bytes),
        None => CanFrame::classic(id, &bytes),
    };
    frame.map(Content::Data).ok_or_else(|| format!("{} bytes are too many", bytes.len()))
}

/// Bytes of hexadecimal digits, with or without points between them.
pub(super) fn bytes(digits: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = digits.bytes().filter(|b| *b != b'.').collect();
    let pairs = digits.chunks(2).map(|pair| match std::str::from_utf8(pair) {
        Ok(text) if text.len() == 2 && text.bytes().all(|b| b.is_ascii_hexdigit()) => u8::from_str_radix(text, 16).ok(),
        _ => None,
    });
    pairs.collect()
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let micros = self.time_ns.div_euclid(1000);
        write!(f, "({}.{:06}) {} ", micros.div_euclid(1_000_000), micros.rem_euclid(1_000_000), self.interface)?;
        let id = |id: &CanId| match id {
            CanId::Standard(raw) => format!("{raw:03X}"),
            CanId::Extended(raw) => format!("{raw:08X}"),
        };
        match &self.content {
            Content::Remote(remote) => write!(f, "{}#R", id(remote)),
            Content::Error(class) => write!(f, "{:08X}#", class | ERROR_FLAG),
            Content::Data(frame) => {
                // flags: 1 is a switched bit rate
                write!(f, "{}#{}", id(&frame.id), if frame.fd { "#1" } else { "" })?;
                frame.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
            }
        }
    }
}

/// Whether a file looks like such a log.
pub fn is_log(bytes: &[u8]) -> bool {
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut lines = start.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
    lines.next().is_some_and(|line| Line::parse(line).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Line {
        Line::parse(text).unwrap()
    }

    #[test]
    fn lines_come_back_as_they_were() {
        for text in [
            "(1591372012.436348) can0 60A#01C24910",
            "(0000000001.000001) vcan0 123#",
            "(1436509052.249713) vcan0 18DAF110#0102030405060708",
            "(1436509052.650004) can1 400##1112233445566778899AABBCC",
            "(1436509052.650004) can1 701#R",
            "(1436509052.650004) can1 20000040#",
        ] {
            let written = parse(text).to_string();
            assert_eq!(written.replace("(1.", "(0000000001."), text);
            assert_eq!(parse(&written), parse(text));
        }
    }

    #[test]
    fn what_others_write_is_understood() {
        assert_eq!(parse("(5.25) can0 60A#01C24910").time_ns, 5_250_000_000);
        assert_eq!(parse("(5) can0 60A#01.C2.49.10 R").frame(), parse("(5.0) can0 60a#01c24910").frame());
        assert_eq!(parse("(5.123456789) can0 60A#01").time_ns, 5_123_456_789);
        assert_eq!(parse("(5.1) can0 60A#R8").content, Content::Remote(CanId::Standard(0x60A)));
        assert_eq!(parse("(5.1) can0 60A#1122334455667788_F").frame().unwrap().data().len(), 8);
        assert_eq!(parse("(5.1) can0 60A##0AABB").frame().unwrap().data(), [0xAA, 0xBB]);
    }

    #[test]
    fn what_is_no_frame_is_refused_with_the_reason() {
        for (text, why) in [
            ("", "not `(seconds)"),
            ("5.1 can0 60A#00", "not a time"),
            ("(5.1) can0 60A", "no #"),
            ("(5.1) can0 60A#0", "not whole bytes"),
            ("(5.1) can0 60A#0G", "not whole bytes"),
            ("(5.1) can0 60A#000102030405060708", "too many"),
            ("(5.1) can0 FFF#00", "identifier"),
            ("(5.1) can0 0060A#00", "identifier"),
            ("(5.-1) can0 60A#00", "not a time"),
            ("(99999999999999999999.1) can0 60A#00", "not a time"),
            ("(5.1) can0 60A#00 what", "more after"),
            ("(5.1) can0 60A#é0", "not whole bytes"),
        ] {
            let error = Line::parse(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
