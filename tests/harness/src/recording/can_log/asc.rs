//! Logs of Vector's tools and of those that write like them (`.asc`).
//!
//! ```text
//! date Fri Jun 5 03:46:52.436 pm 2020
//! base hex  timestamps absolute
//!    0.004301 1  60A             Rx   d 4 01 C2 49 10
//!    0.004501 1  18DAF110x       Rx   r
//!    0.006000 1  Cluster_1_General Rx d 4 01 C2 49 10  Length = 222000 BitCount = 114 ID = 1793
//!    0.016305 CANFD   1 Rx        400  Map        1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B  130000  130  303000
//! ```
//!
//! Times are seconds since the start of the log or, after `timestamps relative`, since the line before. After a frame's
//! bytes more may follow. Loggers write `D` for `d` and a header in other letters or indented, version 8.1 the direction
//! of CAN FD after the identifier.

use viewshed::wire::frame::{CanFrame, CanId};

use super::time::{Stamps, seconds};
use super::{Content, Line};

/// Whether a file begins like such a log, or like a piece of one, whose numbers are taken for hexadecimal.
pub fn is_log(lines: &[String]) -> bool {
    let is_frame = |line: &String| matches!(event(line, 16), Some((_, Some(Ok(_)))));
    lines.iter().take(60).any(|line| base(line).is_some()) || lines.iter().take(3).any(is_frame)
}

/// What a line says of the numbers and times after it: `base hex  timestamps absolute`.
fn base(line: &str) -> Option<(u32, bool)> {
    let mut words = line.split_whitespace();
    let is = |word: Option<&str>, what: &str| word.is_some_and(|word| word.eq_ignore_ascii_case(what));
    if !is(words.next(), "base") {
        return None;
    }
    let radix = match words.next()? {
        word if word.eq_ignore_ascii_case("hex") => 16,
        word if word.eq_ignore_ascii_case("dec") => 10,
        _ => return None,
    };
    Some((radix, is(words.nth(1), "relative")))
}

/// Reads line by line.
#[derive(Debug, Clone)]
pub struct Reader {
    radix: u32,
    stamps: Stamps,
}

impl Default for Reader {
    fn default() -> Self {
        Self { radix: 16, stamps: Stamps::default() }
    }
}

impl Reader {
    /// The frame of a line; nothing where it is one of the headers and remarks, which begin with no number.
    pub fn line(&mut self, line: &str) -> Option<Result<Line, String>> {
        if let Some((radix, relative)) = base(line) {
            (self.radix, self.stamps) = (radix, Stamps::new(relative));
            return None;
        }
        let first = line.split_whitespace().next()?;
        if !first.starts_with(|c: char| c.is_ascii_digit() || "-+.,\u{2212}".contains(c)) {
            return None;
        }
        match event(line, self.radix) {
            Some((time_ns, event)) => {
                let time_ns = self.stamps.at(time_ns);
                let line =
                    |(channel, content): (&str, Content)| Line { time_ns, interface: channel.to_owned(), content };
                event.map(|read| read.map(line))
            }
            None => Some(Err(format!("`{first}` is no time"))),
        }
    }
}

/// A frame and its channel, or why a line is none; nothing of what is neither a frame nor a flaw.
type Event<'a> = Option<Result<(&'a str, Content), String>>;

/// What a line with a time says of a bus.
fn event(line: &str, radix: u32) -> Option<(i64, Event<'_>)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (time, rest) = words.split_first()?;
    let time_ns = seconds(time)?;
    let read = match rest {
        // of the whole measurement, once, and of each channel, every second
        ["Start", "of", "measurement", ..] | ["Statistic:", ..] | [_, "Statistic:", ..] => {
            return Some((time_ns, None));
        }
        ["CANFD", channel, _, "ErrorFrame", ..] | [channel, "ErrorFrame", ..] => Ok((*channel, Content::Error(0))),
        ["CANFD", channel, id, direction, rest @ ..] if is_direction(direction) => {
            flexible(id, rest, radix).map(|content| (*channel, content))
        }
        ["CANFD", channel, _, id, rest @ ..] => flexible(id, rest, radix).map(|content| (*channel, content)),
        [channel, id, _, "d" | "D", length, bytes @ ..] if is_channel(channel) => {
            classic(identified(id, rest, radix), length, bytes, radix).map(|content| (*channel, content))
        }
        [channel, id, _, "r" | "R", ..] if is_channel(channel) => {
            identified(id, rest, radix).map(|id| (*channel, Content::Remote(id)))
        }
        _ => Err("an event that is no frame".into()),
    };
    Some((time_ns, Some(read)))
}

fn is_channel(word: &str) -> bool {
    word.bytes().all(|b| b.is_ascii_digit())
}

fn is_direction(word: &str) -> bool {
    ["Rx", "Tx", "TxRq"].iter().any(|direction| word.eq_ignore_ascii_case(direction))
}

/// The identifier of a line: of `ID = 1793` at its end, which is decimal, for before it there may be the message's name.
fn identified(id: &str, words: &[&str], radix: u32) -> Result<CanId, String> {
    let at = words.windows(2).position(|pair| pair == ["ID", "="]);
    let said = at.and_then(|at| identifier(words.get(at + 2)?, 10).ok());
    said.map_or_else(|| identifier(id, radix), Ok)
}

/// An identifier; those of 29 bits end with an x.
fn identifier(text: &str, radix: u32) -> Result<CanId, String> {
    let (digits, extended) = text.strip_suffix(['x', 'X']).map_or((text, false), |digits| (digits, true));
    let raw = u32::from_str_radix(digits, radix).map_err(|_| match text.bytes().any(|b| b.is_ascii_alphabetic()) {
        true => format!("`{text}` is the name of a message and no identifier: log numbers in place of names"),
        false => format!("`{text}` is no identifier"),
    })?;
    let id = if extended { CanId::extended(raw) } else { u16::try_from(raw).ok().and_then(CanId::standard) };
    id.ok_or_else(|| format!("`{text}` is no identifier"))
}

fn bytes(words: &[&str], count: usize, radix: u32) -> Result<Vec<u8>, String> {
    let found = words.iter().take(count).map(|word| u8::from_str_radix(word, radix).ok()).collect::<Option<Vec<u8>>>();
    found.filter(|found| found.len() == count).ok_or_else(|| format!("not the {count} bytes it announces"))
}

fn classic(id: Result<CanId, String>, length: &str, words: &[&str], radix: u32) -> Result<Content, String> {
    let count = usize::from_str_radix(length, 16).map_err(|_| format!("`{length}` is no length"))?;
    // a length code above 8 is of 8 bytes
    let bytes = bytes(words, count.min(8), radix)?;
    let frame = CanFrame::classic(id?, &bytes);
    frame.map(Content::Data).ok_or_else(|| format!("{count} bytes are too many"))
}

/// In the flags of a CANFD line: the frame is one of CAN FD. Channels of CAN FD log classic frames so, too, without it.
const EXTENDED_LENGTH: u32 = 0x1000;

/// After the identifier: a name if there is one, bit rate switch, error state, length code, length, bytes.
fn flexible(id: &str, rest: &[&str], radix: u32) -> Result<Content, String> {
    let flag = |word: &str| word == "0" || word == "1";
    let rest = match rest {
        [name, brs, esi, ..] if !(flag(name) && flag(brs)) && flag(brs) && flag(esi) => &rest[1..],
        _ => rest,
    };
    let [brs, esi, _code, length, words @ ..] = rest else { return Err("an event that is no frame".into()) };
    if !flag(brs) || !flag(esi) {
        return Err("an event that is no frame".into());
    }
    let count: usize = length.parse().map_err(|_| format!("`{length}` is no length"))?;
    let bytes = bytes(words, count, radix)?;
    let id = identifier(id, radix)?;
    // duration and length in bits, then flags; older tools end before them
    let flags = words.get(count + 2).and_then(|word| u32::from_str_radix(word, 16).ok());
    let is_classic =
        flags.is_some_and(|flags| flags & EXTENDED_LENGTH == 0) && *brs == "0" && *esi == "0" && count <= 8;
    let frame = if is_classic { CanFrame::classic(id, &bytes) } else { CanFrame::fd(id, &bytes) };
    frame.map(Content::Data).ok_or_else(|| format!("{count} bytes are no length of CAN FD"))
}

#[cfg(test)]
mod tests {
    use super::super::{Format, all, candump};
    use super::*;

    fn read(text: &str) -> Vec<Result<Line, String>> {
        all(Format::Asc, text)
    }

    /// Lines of `candump -L` that say the same.
    fn same(asc: &str, candump: &[&str]) {
        let expected: Vec<_> = candump.iter().map(|line| candump::line(line)).collect();
        assert_eq!(read(asc), expected);
    }

    #[test]
    fn frames_of_all_kinds_are_read() {
        let head = "date Fri Jun 5 03:46:52.436 pm 2020\nbase hex  timestamps absolute\ninternal events logged\n// version 9.0.0\n\
                    Begin Triggerblock Fri Jun 5 03:46:52.436 pm 2020\n   0.000000 Start of measurement\n";
        let frames = "   0.004301 1  60A             Rx   d 4 01 C2 49 10  Length = 222000 BitCount = 114 ID = 1546\n \
                      0.004501 2  18DAF110x       Tx   d 1 FF\n 0.005000 1  701             Rx   r\n \
                      1.016305 CANFD   1 Rx        400  Map        1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B 130000 130\n";
        let nameless = "1.016306 CANFD   1 Rx        400  1 0 1 1 AB 130000 130 200040 0 0\n 2.5 1  ErrorFrame\nEnd TriggerBlock\n";
        same(
            &format!("{head}{frames}{nameless}"),
            &[
                "(0.004301) 1 60A#01C24910",
                "(0.004501) 2 18DAF110#FF",
                "(0.005) 1 701#R",
                "(1.016305) 1 400##0000102030405060708090A0B",
                "(1.016306) 1 400##0AB",
                "(2.5) 1 20000000#",
            ],
        );
    }

    #[test]
    fn a_channel_of_can_fd_has_classic_frames_too() {
        let line = |brs: u8, rest: &str| format!("base hex timestamps absolute\n1.5 CANFD 1 Rx 60A {brs} 0 {rest}\n");
        let tail = "46500250 4b140250 20011736 2001040d";
        for (brs, flags, as_candump) in [
            (0, "200000", "(1.5) 1 60A#01C24910"),
            (0, "0", "(1.5) 1 60A#01C24910"),
            (0, "1000", "(1.5) 1 60A##001C24910"),
            (1, "303000", "(1.5) 1 60A##101C24910"),
            // only CAN FD switches its bit rate, whatever a tool puts there
            (1, "200040", "(1.5) 1 60A##101C24910"),
        ] {
            same(&line(brs, &format!("4 4 01 C2 49 10 130000 130 {flags} e0006659 {tail}")), &[as_candump]);
        }
        same(&line(0, "4 4 01 C2 49 10"), &["(1.5) 1 60A##001C24910"]);
        same(&line(0, "9 12 00 01 02 03 04 05 06 07 08 09 0A 0B 1 2 0"), &["(1.5) 1 60A##0000102030405060708090A0B"]);
    }

    #[test]
    fn decimal_numbers_and_times_since_the_line_before() {
        same(
            "base dec  timestamps relative\n 0.5 1 1546 Rx d 2 255 16\n 0.25 1 1546 Rx d 1 0\n",
            &["(0.5) 1 60A#FF10", "(0.75) 1 60A#00"],
        );
    }

    #[test]
    fn times_since_the_line_before_count_what_is_no_frame() {
        let events = "0.1 1 60A Rx d 1 01\n1.0 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.01%\n0.2 1 60A Rx d 2 02\n\
                      0.3 CAN 1 Status:chip status error active\n0.4 1 60A Rx d 1 03\n";
        let since_start = [0.1, 1.1, 1.3, 1.6, 2.0];
        let lines = events.lines().zip(since_start);
        let absolute: String =
            lines.map(|(line, time)| format!("{time:.1} {}\n", line.split_once(' ').unwrap().1)).collect();
        let relative = read(&format!("base hex  timestamps relative\n0.0 Start of measurement\n{events}"));
        assert_eq!(relative, read(&format!("base hex  timestamps absolute\n0.0 Start of measurement\n{absolute}")));
        let times: Vec<_> = relative.iter().flatten().map(|line| line.time_ns / 1_000_000).collect();
        // the statistics are no flaw, the frame cut short and the status are
        assert_eq!((&times[..], relative.len()), (&[100, 2000][..], 4));
    }

    #[test]
    fn what_loggers_write_is_the_same() {
        let usual = "base hex  timestamps absolute\n 1.5 1 60A Rx d 4 01 C2 49 10\n 2.0 2 18DAF110x Tx d 1 FF\n";
        for other in [
            usual.replace(" d ", " D "),
            usual.replace("base hex", "  Base Hex"),
            usual.replace("base hex", "BASE HEX"),
            usual.replace("1.5", "1,5").replace("2.0", "2,0"),
            format!("{}{}", "// a remark\n".repeat(50), usual),
            usual
                .replace("60A Rx d 4 01 C2 49 10", "Obj_0 Rx d 4 01 C2 49 10 Length = 2 BitCount = 1 ID = 1546")
                .replace("18DAF110x Tx d 1 FF", "Other Tx d 1 FF ID = 417001744x"),
            "base dec  timestamps absolute\n 1.5 1 1546 Rx D 4 1 194 73 16\n 2.0 2 417001744x Tx D 1 255\n".into(),
            "base hex  timestamps relative\n 1.5 1 60A Rx d 4 01 C2 49 10\n 0,5 2 18DAF110x Tx d 1 FF\n".into(),
        ] {
            same(&other, &["(1.5) 1 60A#01C24910", "(2.0) 2 18DAF110#FF"]);
        }
        same("base hex timestamps absolute\n -0,5 1 60A Rx d 1 01\n", &["(-0.5) 1 60A#01"]);
        // the direction of CAN FD before the identifier and after it
        let tail = "1 0 4 4 01 C2 49 10";
        for order in ["Rx 60A", "60A Rx", "60A Tx Name"] {
            same(&format!("base hex timestamps absolute\n 1.5 CANFD 1 {order} {tail}\n"), &["(1.5) 1 60A##101C24910"]);
        }
    }

    #[test]
    fn what_is_no_frame_is_counted() {
        let why = |line: &str| match &read(&format!("base hex timestamps absolute\n{line}\n"))[..] {
            [one] => one.clone().unwrap_err(),
            other => panic!("{other:?}"),
        };
        assert_eq!(why("1.0 1  Trigger event"), "an event that is no frame");
        assert_eq!(why("1.0 1  60A Rx d 4 01 C2 49"), "not the 4 bytes it announces");
        assert_eq!(why("1.0 1  8FF Rx d 1 01"), "`8FF` is no identifier");
        assert_eq!(why("1;0 1  60A Rx d 1 01"), "`1;0` is no time");
        assert!(why("1.0 1  Obj_0 Rx d 1 01").contains("log numbers in place of names"));
        let long = format!("1.0 CANFD 1 Rx 400 1 0 f 65 {}", "00 ".repeat(65));
        assert_eq!(why(&long), "65 bytes are no length of CAN FD");
    }
}
