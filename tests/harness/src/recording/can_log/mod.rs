//! Logs of CAN buses, whatever tool wrote them: `candump` with and without `-L`, Vector's ASC, SavvyCAN's CSV.

pub mod asc;
pub mod candump;
#[cfg(target_os = "linux")]
pub mod live;
pub mod savvycan;

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Result, bail};
use viewshed::wire::frame::{CanFrame, CanId};

use super::file;
use super::problems::Problems;

/// One frame of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// On the clock of the log, which may begin at 0.
    pub time_ns: i64,
    /// Name of the bus, or number of the channel.
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
    /// The frame, if it is one with data.
    pub fn frame(&self) -> Option<&CanFrame> {
        match &self.content {
            Content::Data(frame) => Some(frame),
            _ => None,
        }
    }
}

/// Who wrote a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `candump -L`
    Candump,
    /// `candump`, with one of its time stamps
    Screen,
    /// CANalyzer, CANoe and many others
    Asc,
    SavvyCan,
}

/// The names of all of them, for messages.
pub const FORMATS: &str = "`candump` (with -L, or -t a, d or z), Vector ASC or SavvyCAN CSV";

/// Bytes at the start of a file that show its kind.
const START: usize = 4096;

impl Format {
    /// What a file looks like.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(START)]);
        if asc::is_log(&start) {
            return Some(Self::Asc);
        }
        if savvycan::is_log(&start) {
            return Some(Self::SavvyCan);
        }
        // the first line may have been cut
        let lines = start.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).take(3);
        lines.into_iter().find_map(|line| match line {
            _ if candump::line(line).is_ok() => Some(Self::Candump),
            _ if candump::is_screen(line) => Some(Self::Screen),
            _ => None,
        })
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Candump => "candump -L",
            Self::Screen => "candump",
            Self::Asc => "Vector ASC",
            Self::SavvyCan => "SavvyCAN CSV",
        }
    }

    fn read(self, text: &str) -> Vec<Result<Line, String>> {
        match self {
            Self::Candump => text.lines().filter(|line| !line.trim().is_empty()).map(candump::line).collect(),
            Self::Screen => candump::screen(text),
            Self::Asc => asc::read(text),
            Self::SavvyCan => savvycan::read(text),
        }
    }
}

/// All frames of a log, in its order, of one interface if it is named; lines that are none are counted.
///
/// # Errors
/// Nothing is of the interface that is named; those found are listed.
pub fn read(bytes: &[u8], format: Format, interface: Option<&str>, problems: &mut Problems) -> Result<Vec<Line>> {
    let mut lines: Vec<Line> = Vec::new();
    let (mut last, mut others) = (None, BTreeSet::new());
    for line in format.read(&String::from_utf8_lossy(bytes)) {
        match line {
            Ok(line) if interface.is_some_and(|name| name != line.interface) => drop(others.insert(line.interface)),
            Ok(line) => {
                if last.is_some_and(|last| line.time_ns < last) {
                    problems.add(&line.interface, "time runs backwards", line.time_ns);
                }
                last = Some(line.time_ns);
                lines.push(line);
            }
            Err(why) => problems.add("log", format!("line skipped: {}", kind_of(&why)), last.unwrap_or(0)),
        }
    }
    if let Some(name) = interface.filter(|_| lines.is_empty()) {
        let found: Vec<_> = others.into_iter().collect();
        bail!("no frame on interface {name}; interfaces found: {}", found.join(", "));
    }
    Ok(lines)
}

/// The frames of a file, as [`read`] has them; `None` if it is no such log.
///
/// # Errors
/// A file that cannot be read, and those of [`read`].
pub fn of_file(path: &Path, interface: Option<&str>) -> Result<Option<Vec<Line>>> {
    let bytes = file::bytes(path)?;
    Format::of(&bytes).map(|format| read(&bytes, format, interface, &mut Problems::default())).transpose()
}

/// A reason without the text it names, so that many of a kind are one problem; what a line should be stays.
fn kind_of(why: &str) -> String {
    match why.split('`').collect::<Vec<_>>()[..] {
        ["not ", ..] => why.to_owned(),
        [before, _, after] => format!("{before}something{after}").trim().to_owned(),
        _ => why.to_owned(),
    }
}

/// Seconds with or without a fraction, of any number of digits each, in nanoseconds.
fn seconds(text: &str) -> Option<i64> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) {
        return None;
    }
    let nine: String = fraction.chars().chain("000000000".chars()).take(9).collect();
    let (seconds, fraction): (i64, i64) = (seconds.parse().ok()?, nine.parse().ok()?);
    seconds.checked_mul(1_000_000_000)?.checked_add(fraction)
}

/// Times that count from the line before, counted from the first. Lines without one are left out, those whose frame
/// cannot be read are not.
fn add_up<'a>(times: impl Iterator<Item = &'a mut i64>) {
    let mut now = 0_i64;
    for time in times {
        now = now.saturating_add(*time);
        *time = now;
    }
}

/// 3 or 8 hexadecimal digits; the class of an error frame where it is one.
fn identifier(digits: &str) -> Result<Result<CanId, u32>, String> {
    let raw = u32::from_str_radix(digits, 16).map_err(|_| format!("`{digits}` is no identifier"))?;
    let id = match digits.len() {
        3 => u16::try_from(raw).ok().and_then(CanId::standard),
        8 if raw & ERROR_FLAG != 0 => return Ok(Err(raw & !ERROR_FLAG)),
        8 => CanId::extended(raw),
        _ => None,
    };
    id.map(Ok).ok_or_else(|| format!("`{digits}` is no identifier of 3 or 8 digits"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_format_is_known_by_its_begin_and_by_nothing_else() {
        for (text, format) in [
            ("(1.0) can0 60A#01\n", Some(Format::Candump)),
            ("60A#01C24910\n(1.0) can0 60A#01\n", Some(Format::Candump)),
            (" (1.0)  can0  60A   [1]  01\n", Some(Format::Screen)),
            ("date today\nbase hex  timestamps absolute\n", Some(Format::Asc)),
            ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n", Some(Format::SavvyCan)),
            ("time_s,class\n1,car\n", None),
            ("(1.0) ttyS0 00FF\n", None),
            ("", None),
        ] {
            assert_eq!(Format::of(text.as_bytes()), format, "{text}");
        }
    }

    #[test]
    fn a_skipped_line_says_what_it_should_be() {
        let mut problems = Problems::default();
        read(
            b"(2.0) can0 60A#01\n(3.0) can0\n(4.0) can0 60A#0\n(5.0) can0 60A#1\n",
            Format::Candump,
            None,
            &mut problems,
        )
        .unwrap();
        assert_eq!(problems.count("line skipped: not `(seconds) interface identifier#data`"), 1);
        assert_eq!(problems.count("line skipped: something is not whole bytes"), 2, "one problem whatever the bytes");
    }

    #[test]
    fn times_that_run_backwards_and_lines_that_are_none_are_counted() {
        let mut problems = Problems::default();
        let log = b"(2.0) can0 60A#01\n(1.0) can0 60A#02\n(3.0) can1 60A#03\nwhat\n(4.0) can0 60A#0\n";
        let lines = read(log, Format::Candump, Some("can0"), &mut problems).unwrap();
        assert_eq!((lines.len(), problems.count("runs backwards"), problems.count("line skipped")), (2, 1, 2));
    }
}
