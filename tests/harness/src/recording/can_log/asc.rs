//! Logs of Vector's tools and of those that write like them (`.asc`).
//!
//! ```text
//! date Fri Jun 5 03:46:52.436 pm 2020
//! base hex  timestamps absolute
//!    0.004301 1  60A             Rx   d 4 01 C2 49 10
//!    0.004501 1  18DAF110x       Rx   r
//!    0.016305 CANFD   1 Rx        400  Map        1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B  130000  130  303000
//! ```
//!
//! Times are seconds since the start of the log or, after `timestamps relative`, since the line before. After a frame's
//! bytes more may follow.

use viewshed::wire::frame::{CanFrame, CanId};

use super::{Content, Line, add_up, seconds};

/// Whether a file begins like such a log.
pub fn is_log(start: &str) -> bool {
    start.lines().take(20).any(|line| line.starts_with("base hex") || line.starts_with("base dec"))
}

/// Reads a log. Lines that begin with no time are its headers and remarks.
pub fn read(text: &str) -> Vec<Result<Line, String>> {
    let base = text.lines().find(|line| line.starts_with("base ")).unwrap_or_default();
    let radix = if base.starts_with("base dec") { 10 } else { 16 };
    let mut events: Vec<_> = text.lines().filter_map(|line| event(line, radix)).collect();
    if base.contains("timestamps relative") {
        add_up(events.iter_mut().map(|(time_ns, _)| time_ns));
    }
    let line = |(time_ns, event): (i64, Event<'_>)| {
        let line = |(channel, content): (&str, Content)| Line { time_ns, interface: channel.to_owned(), content };
        event.map(|read| read.map(line))
    };
    events.into_iter().filter_map(line).collect()
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
        ["CANFD", channel, _, id, rest @ ..] => flexible(id, rest, radix).map(|content| (*channel, content)),
        [channel, id, _, "d", length, bytes @ ..] if is_channel(channel) => {
            classic(id, length, bytes, radix).map(|content| (*channel, content))
        }
        [channel, id, _, "r", ..] if is_channel(channel) => {
            identifier(id, radix).map(|id| (*channel, Content::Remote(id)))
        }
        _ => Err("an event that is no frame".into()),
    };
    Some((time_ns, Some(read)))
}

fn is_channel(word: &str) -> bool {
    word.bytes().all(|b| b.is_ascii_digit())
}

/// An identifier; those of 29 bits end with an x.
fn identifier(text: &str, radix: u32) -> Result<CanId, String> {
    let (digits, extended) = text.strip_suffix('x').map_or((text, false), |digits| (digits, true));
    let raw = u32::from_str_radix(digits, radix).map_err(|_| format!("`{text}` is no identifier"))?;
    let id = if extended { CanId::extended(raw) } else { u16::try_from(raw).ok().and_then(CanId::standard) };
    id.ok_or_else(|| format!("`{text}` is no identifier"))
}

fn bytes(words: &[&str], count: usize, radix: u32) -> Result<Vec<u8>, String> {
    let found = words.iter().take(count).map(|word| u8::from_str_radix(word, radix).ok()).collect::<Option<Vec<u8>>>();
    found.filter(|found| found.len() == count).ok_or_else(|| format!("not the {count} bytes it announces"))
}

fn classic(id: &str, length: &str, words: &[&str], radix: u32) -> Result<Content, String> {
    let count = usize::from_str_radix(length, 16).map_err(|_| format!("`{length}` is no length"))?;
    // a length code above 8 is of 8 bytes
    let bytes = bytes(words, count.min(8), radix)?;
    let frame = CanFrame::classic(identifier(id, radix)?, &bytes);
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
    use super::super::candump;
    use super::*;

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
    fn what_is_no_frame_is_counted() {
        let why = |line: &str| match &read(&format!("base hex timestamps absolute\n{line}\n"))[..] {
            [one] => one.clone().unwrap_err(),
            other => panic!("{other:?}"),
        };
        assert_eq!(why("1.0 1  Trigger event"), "an event that is no frame");
        assert_eq!(why("1.0 1  60A Rx d 4 01 C2 49"), "not the 4 bytes it announces");
        assert_eq!(why("1.0 1  8FF Rx d 1 01"), "`8FF` is no identifier");
        let long = format!("1.0 CANFD 1 Rx 400 1 0 f 65 {}", "00 ".repeat(65));
        assert_eq!(why(&long), "65 bytes are no length of CAN FD");
    }
}
