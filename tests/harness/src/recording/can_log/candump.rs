//! Logs as `candump -L` writes them, line by line, in and out, and what `candump` prints without `-L`.
//!
//! `(1591372012.436348) can0 60A#01C24910`: time, interface, identifier and data; `##` and a flags
//! nibble before the data of CAN FD, `#R` for a remote frame. On the screen the same frame is
//! ` (1591372012.436348)  can0  60A   [4]  01 C2 49 10`; two digits in the brackets are of CAN FD.

use std::fmt;

use viewshed::wire::frame::{CanFrame, CanId, MOST_BYTES};

use super::time::seconds;
use super::{Content, ERROR_FLAG, Line, identifier, split_at_letter};

/// Reads a line of `candump -L`; the error says what is wrong with it.
pub fn line(line: &str) -> Result<Line, String> {
    // letters of other alphabets have spaces of their own, which hardly a log has
    if line.is_ascii() { of_words(line.split_ascii_whitespace()) } else { of_words(line.split_whitespace()) }
}

fn of_words<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Line, String> {
    let (time, interface, frame) = match (words.next(), words.next(), words.next()) {
        (Some(time), Some(interface), Some(frame)) => (time, interface, frame),
        _ => return Err("not `(seconds) interface identifier#data`".into()),
    };
    // `candump -x` says at the end whether the frame was received or sent
    if words.any(|word| word != "R" && word != "T") {
        return Err("more after the frame than `R` or `T`".into());
    }
    Ok(Line { time_ns: nanoseconds(time)?, interface: interface.to_owned(), content: content(frame)? })
}

/// Reads a line of the screen; the error says what is wrong with it.
pub fn screen_line(line: &str) -> Result<Line, String> {
    let shape = || "not `(seconds) interface identifier [length] bytes`".to_owned();
    let mut words = line.split_whitespace();
    let (Some(time), Some(interface), Some(mut id)) = (words.next(), words.next(), words.next()) else {
        return Err(shape());
    };
    // `candump -x`: direction, bit rate switch, error state
    if id == "RX" || id == "TX" {
        id = words.nth(2).ok_or_else(shape)?;
    }
    let length = words.next().and_then(|word| word.strip_prefix('[')?.strip_suffix(']')).ok_or_else(shape)?;
    let count: usize = length.parse().map_err(|_| shape())?;
    let (time_ns, interface) = (nanoseconds(time)?, interface.to_owned());
    let id = match identifier(id)? {
        Ok(id) => id,
        Err(class) => return Ok(Line { time_ns, interface, content: Content::Error(class) }),
    };
    let mut rest = words.clone();
    if (rest.next(), rest.next()) == (Some("remote"), Some("request")) {
        return Ok(Line { time_ns, interface, content: Content::Remote(id) });
    }
    // after them there may be the bytes as characters
    let digits: String = words.take(count).collect();
    let bytes = bytes(&digits).filter(|bytes| bytes.len() == count);
    let bytes = bytes.ok_or_else(|| format!("not the {count} bytes it announces"))?;
    let frame = if length.len() == 2 { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes) };
    let content = frame.map(Content::Data).ok_or_else(|| format!("{count} bytes are too many"))?;
    Ok(Line { time_ns, interface, content })
}

/// Whether a line is one of the screen.
pub fn is_screen(line: &str) -> bool {
    screen_line(line).is_ok()
}

/// The time a line begins with, whatever follows it.
pub fn time(line: &str) -> Option<i64> {
    nanoseconds(line.split_whitespace().next()?).ok()
}

/// `(seconds.fraction)` with any number of digits.
pub(in crate::recording) fn nanoseconds(text: &str) -> Result<i64, String> {
    let wrong = || format!("`{text}` is not a time in brackets");
    let inside = match text.as_bytes() {
        [b'(', .., b')'] => text.get(1..text.len() - 1),
        _ => None,
    };
    inside.and_then(seconds).ok_or_else(wrong)
}

/// `identifier#data`.
fn content(text: &str) -> Result<Content, String> {
    let (id, data) = split_at_letter(text, b'#').ok_or_else(|| format!("`{text}` has no #"))?;
    let id = match identifier(id)? {
        Ok(id) => id,
        Err(class) => return Ok(Content::Error(class)),
    };
    if data.as_bytes().first() == Some(&b'R') {
        return Ok(Content::Remote(id));
    }
    let fd = match data.as_bytes() {
        [b'#', ..] => Some(data.get(2..).unwrap_or("")),
        _ => None,
    };
    // a raw length code may follow
    let digits = split_at_letter(fd.unwrap_or(data), b'_').map_or_else(|| fd.unwrap_or(data), |(digits, _)| digits);
    let mut buffer = [0; MOST_BYTES];
    let wrong = || format!("`{digits}` is not whole bytes");
    let bytes = match bytes_into(digits, &mut buffer).ok_or_else(wrong)? {
        length if length <= MOST_BYTES => &buffer[..length],
        length => return Err(format!("{length} bytes are too many")),
    };
    let frame = match fd {
        Some(_) => CanFrame::fd(id, bytes),
        None => CanFrame::classic(id, bytes),
    };
    frame.map(Content::Data).ok_or_else(|| format!("{} bytes are too many", bytes.len()))
}

/// Bytes of hexadecimal digits, with or without points between them.
pub(in crate::recording) fn bytes(digits: &str) -> Option<Vec<u8>> {
    let mut bytes = vec![0; digits.len() / 2];
    let length = bytes_into(digits, &mut bytes)?;
    bytes.truncate(length);
    Some(bytes)
}

/// The same into a buffer; how many there are, of which only those are written that it has room for.
fn bytes_into(digits: &str, bytes: &mut [u8]) -> Option<usize> {
    let (mut high, mut length) = (None, 0);
    for digit in digits.bytes().filter(|b| *b != b'.') {
        let digit = char::from(digit).to_digit(16)? as u8;
        let Some(before) = high.take() else {
            high = Some(digit);
            continue;
        };
        if let Some(byte) = bytes.get_mut(length) {
            *byte = before << 4 | digit;
        }
        length += 1;
    }
    high.is_none().then_some(length)
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

#[cfg(test)]
mod tests {
    use super::super::{Format, all};
    use super::*;

    fn parse(text: &str) -> Line {
        line(text).unwrap()
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
            let error = line(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }

    /// Times and content of lines of the screen.
    fn on_screen(text: &str) -> Vec<(i64, Option<Vec<u8>>)> {
        let data = |line: &Line| line.frame().map(|frame| frame.data().to_vec());
        all(Format::Screen, text)
            .into_iter()
            .map(|line| line.unwrap())
            .map(|line| (line.time_ns, data(&line)))
            .collect()
    }

    #[test]
    fn the_screen_is_read_like_the_log() {
        for (screen, log) in [
            (" (1591372012.436348)  can0  60A   [4]  01 C2 49 10", "(1591372012.436348) can0 60A#01C24910"),
            (" (0000000001.000001)  can0  60A   [2]  31 32               '12'", "(1.000001) can0 60A#3132"),
            (" (000.000001)  vcan0  18DAF110   [1]  FF", "(0.000001) vcan0 18DAF110#FF"),
            (
                " (1.5)  can1  TX B -       400  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B",
                "(1.5) can1 400##1000102030405060708090A0B",
            ),
            (" (1.5)  can1  RX - -  701   [8]  remote request", "(1.5) can1 701#R"),
            (" (1.5)  can1  701   [0] ", "(1.5) can1 701#"),
            (
                " (1.5)  can1  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
                "(1.5) can1 20000040#0000000000000000",
            ),
        ] {
            assert_eq!(screen_line(screen), line(log), "{screen}");
        }
        for (text, why) in [
            ("  can0  60A   [4]  01 C2 49 10", "not `(seconds)"),
            (" (1.5)  can0  60A   [4]  01 C2 49", "not the 4 bytes"),
            (" (1.5)  can0  60A   [9]  01 02 03 04 05 06 07 08 09", "too many"),
            (" (1.5)  can0  FFF   [1]  01", "identifier"),
            (" (2020-06-05  15:46:52.4)  can0  60A   [1]  01", "not `(seconds)"),
        ] {
            assert!(screen_line(text).unwrap_err().contains(why), "{text}: {:?}", screen_line(text));
        }
    }

    #[test]
    fn differences_of_time_are_added_up_and_times_since_the_start_are_not() {
        let line = |time: &str, byte: u8| format!(" ({time})  can0  60A   [1]  {byte:02X}\n");
        let of = |times: &[&str]| times.iter().zip(0..).map(|(time, byte)| line(time, byte)).collect::<String>();
        let times = |text: &str| on_screen(text).iter().map(|(time_ns, _)| time_ns / 1_000_000).collect::<Vec<_>>();
        assert_eq!(times(&of(&["000.000000", "000.070000", "000.001000", "000.069000"])), [0, 70, 71, 140]);
        assert_eq!(times(&of(&["000.000000", "000.070000", "000.071000", "000.140000"])), [0, 70, 71, 140]);
        // the first line was cut off; and one was garbled
        let cut = of(&["000.070000", "000.001000", "000.069000", "000.002000", "000.068000"]);
        assert_eq!(times(&cut), [70, 71, 140, 142, 210]);
        let garbled = all(Format::Screen, &cut.replacen("60A", "60", 2));
        let read: Vec<_> = garbled.iter().flatten().map(|line| line.time_ns / 1_000_000).collect();
        assert_eq!(read, [140, 142, 210]);
        // a clock that stepped back
        assert_eq!(times(&of(&["1500.000000", "1500.070000", "1499.000000"])), [1_500_000, 1_500_070, 1_499_000]);
    }
}
