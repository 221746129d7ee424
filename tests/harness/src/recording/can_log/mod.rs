//! Logs of CAN buses, whatever tool wrote them: `candump` with and without `-L`, Vector's ASC, the CSV of SavvyCAN and of
//! python-can.
//!
//! [`text`] makes lines of bytes, a format's reader makes a frame of a line, and [`log`] brings frames into the
//! [order of time](order). Nothing is kept but what is out of order.

pub mod asc;
pub mod candump;
mod columns;
#[cfg(target_os = "linux")]
pub mod live;
pub mod log;
pub mod order;
pub mod python_can;
pub mod savvycan;
pub mod time;

use std::path::Path;

use anyhow::{Context, Result};
use viewshed::wire::frame::{CanFrame, CanId};

use super::file::Source;
use super::problems::Problems;
use super::text;
use time::Stamps;

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
    /// python-can's CSV
    PythonCan,
}

/// The names of all of them, for messages.
pub const FORMATS: &str = "`candump` (with -L, or -t a, d or z), Vector ASC, SavvyCAN CSV or python-can CSV";

/// Text at the start of a file that shows its kind, without remarks before it.
const START: usize = 1 << 20;

/// The first lines of a file, without the remarks before them; those of Vector's tools stay.
fn begin(source: &Source) -> Result<Vec<String>> {
    let mut text = text::Lines::new(source.open()?);
    let (mut lines, mut bytes) = (Vec::new(), 0);
    while let Some(line) = text.next_line().with_context(|| format!("cannot read {}", source.shown()))? {
        if is_remark(&line) {
            continue;
        }
        bytes += line.len();
        lines.push(line.into_owned());
        if bytes > START || lines.len() >= time::SHOWN {
            break;
        }
    }
    Ok(lines)
}

/// What lies before and behind the first of a letter of ASCII. In words as short as these looking at each byte is faster
/// than what searches for any letter.
fn split_at_letter(text: &str, letter: u8) -> Option<(&str, &str)> {
    let at = text.bytes().position(|b| b == letter)?;
    Some((text.get(..at)?, text.get(at + 1..)?))
}

/// Whether a line is for people.
fn is_remark(line: &str) -> bool {
    let line = line.trim_start();
    matches!(line.as_bytes(), [b'#' | b';', ..] | [b'/', b'/', ..])
}

impl Format {
    /// What a file that begins with these lines looks like.
    pub fn of(lines: &[String]) -> Option<Self> {
        if asc::is_log(lines) {
            return Some(Self::Asc);
        }
        if savvycan::is_log(lines) {
            return Some(Self::SavvyCan);
        }
        if python_can::is_log(lines) {
            return Some(Self::PythonCan);
        }
        // the first line may have been cut, and a tool may say something before it
        lines.iter().take(10).find_map(|line| match line {
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
            Self::PythonCan => "python-can CSV",
        }
    }

    /// What brings the lines of a file into the order of time.
    fn sorting(self) -> &'static str {
        match self {
            Self::Candump | Self::Screen => "`sort --stable --key 1,1 FILE > NEW`",
            Self::Asc => "`sort --stable --numeric-sort --key 1,1 FILE > NEW`, and put its headers first again",
            Self::SavvyCan | Self::PythonCan => {
                "`sort --stable --numeric-sort --field-separator , --key 1,1 FILE > NEW`, which leaves the headings first"
            }
        }
    }
}

/// Reads the lines of one log, one after the other.
#[derive(Debug, Clone)]
enum Reader {
    Candump(Stamps),
    Screen(Stamps),
    Asc(asc::Reader),
    SavvyCan(savvycan::Reader),
    PythonCan(python_can::Reader),
}

impl Reader {
    /// For a log that begins with these lines.
    fn new(format: Format, begin: &[String]) -> Self {
        let stamps = || Stamps::of(&begin.iter().filter_map(|line| candump::time(line)).collect::<Vec<_>>());
        match format {
            Format::Candump => Self::Candump(stamps()),
            Format::Screen => Self::Screen(stamps()),
            Format::Asc => Self::Asc(asc::Reader::default()),
            Format::SavvyCan => Self::SavvyCan(savvycan::Reader::default()),
            Format::PythonCan => Self::PythonCan(python_can::Reader::default()),
        }
    }

    /// The frame of a line, or why it is none; nothing of one that is for people.
    fn line(&mut self, line: &str) -> Option<Result<Line, String>> {
        let stamped = |stamps: &mut Stamps, read: Result<Line, String>| {
            if !stamps.differences {
                return Some(read);
            }
            let time_ns = candump::time(line).map(|time| stamps.at(time));
            Some(read.map(|line| Line { time_ns: time_ns.unwrap_or(line.time_ns), ..line }))
        };
        match self {
            _ if is_remark(line) => None,
            Self::Candump(stamps) => stamped(stamps, candump::line(line)),
            Self::Screen(stamps) => stamped(stamps, candump::screen_line(line)),
            Self::Asc(reader) => reader.line(line),
            Self::SavvyCan(reader) => reader.line(line),
            Self::PythonCan(reader) => reader.line(line),
        }
    }
}

/// The frames of a file with their bus in the order of time; `None` if it is no log.
///
/// # Errors
/// A file that cannot be read, and those of [`log::Found::read`].
pub fn of_file(path: &Path, interface: Option<&str>) -> Result<Option<Vec<Line>>> {
    let found = log::find(&Source::of(path)?)?;
    let read = |found: log::Found| found.read(interface, &mut Problems::default(), &mut |_| false);
    Ok(found.map(read).transpose()?.map(|log| log.collect()))
}

/// The lines of a text, as its format's reader has them.
#[cfg(test)]
fn all(format: Format, text: &str) -> Vec<Result<Line, String>> {
    let begin: Vec<String> = text.lines().map(str::to_owned).collect();
    let mut reader = Reader::new(format, &begin);
    begin.iter().filter(|line| !line.trim().is_empty()).filter_map(|line| reader.line(line)).collect()
}

/// A reason without the text it names, so that many of a kind are one problem; what a line should be stays.
fn kind_of(why: &str) -> String {
    match why.split('`').collect::<Vec<_>>()[..] {
        ["not ", ..] => why.to_owned(),
        [before, _, after] => format!("{before}something{after}").trim().to_owned(),
        _ => why.to_owned(),
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

    fn read(text: &[u8], interface: Option<&str>) -> (Vec<Line>, Problems) {
        let mut problems = Problems::default();
        let found = log::find(&Source::of_bytes(text)).unwrap().unwrap();
        let log = found.read(interface, &mut problems, &mut |_| false).unwrap();
        (log.collect(), problems)
    }

    #[test]
    fn each_format_is_known_by_its_begin_and_by_nothing_else() {
        let remarks = "# a remark\n".repeat(200_000);
        for (text, format) in [
            ("(1.0) can0 60A#01\n", Some(Format::Candump)),
            ("60A#01C24910\n(1.0) can0 60A#01\n", Some(Format::Candump)),
            (" (1.0)  can0  60A   [1]  01\n", Some(Format::Screen)),
            ("date today\nbase hex  timestamps absolute\n", Some(Format::Asc)),
            ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n", Some(Format::SavvyCan)),
            ("timestamp,arbitration_id,extended,remote,error,dlc,data\n", Some(Format::PythonCan)),
            ("time_s,class\n1,car\n", None),
            ("(1.0) ttyS0 00FF\n", None),
            ("", None),
        ] {
            for before in ["", "\u{feff}", "\0\0\0", &remarks] {
                let found = log::find(&Source::of_bytes(format!("{before}{text}").as_bytes())).unwrap();
                assert_eq!(found.map(|found| found.format), format, "{text}");
            }
        }
    }

    #[test]
    fn a_skipped_line_says_what_it_should_be() {
        let (_, problems) = read(b"(2.0) can0 60A#01\n(3.0) can0\n(4.0) can0 60A#0\n(5.0) can0 60A#1\n", None);
        assert_eq!(problems.count("line skipped: not `(seconds) interface identifier#data`"), 1);
        assert_eq!(problems.count("line skipped: something is not whole bytes"), 2, "one problem whatever the bytes");
    }

    #[test]
    fn lines_that_are_none_are_counted() {
        let log = b"(2.0) can0 60A#01\n(2.5) can0 60A#02\n(3.0) can1 60A#03\nwhat\n(4.0) can0 60A#0\n# who\n";
        let (lines, problems) = read(log, Some("can0"));
        assert_eq!((lines.len(), problems.count(""), problems.count("line skipped")), (2, 2, 2));
    }
}
