//! Logs of a bus or of a serial line, line by line.

use std::path::Path;

use anyhow::{Result, bail};

use crate::recording::can_log::{self, FORMATS, Format, Line};
use crate::recording::file::{self, Content};
use crate::recording::foreign;
use crate::recording::problems::Problems;
use crate::recording::serial_log::Chunk;

/// A line of a log.
pub enum Logged {
    Frame(Line),
    Chunk(Chunk),
}

/// What a log holds.
pub struct Log {
    pub lines: Vec<Logged>,
    /// Lines that are none.
    pub unread: u64,
    /// What is wrong with it, in words.
    pub problems: Vec<String>,
}

impl Log {
    fn new(lines: Vec<Logged>, unread: u64, damage: Option<String>) -> Self {
        let skipped = (unread > 0).then(|| format!("{unread} lines are no frames"));
        Self { lines, unread, problems: skipped.into_iter().chain(damage).collect() }
    }
}

/// The lines of a log.
///
/// # Errors
/// A file that cannot be read, and one that is no log; says what it is.
pub fn read(path: &Path, interface: Option<&str>) -> Result<Log> {
    let Content { bytes, damage } = file::read(path)?;
    if bytes.is_empty() {
        bail!("{} is empty", file::shown(path));
    }
    if let Some(format) = Format::of(&bytes) {
        let mut problems = Problems::default();
        let lines = can_log::read(&bytes, format, interface, &mut problems)?;
        let lines = lines.into_iter().map(Logged::Frame).collect();
        return Ok(Log::new(lines, problems.count("line skipped"), damage));
    }
    let text = String::from_utf8_lossy(&bytes);
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let (mut chunks, mut unread) = (Vec::new(), 0);
    for line in lines {
        match Chunk::parse(line) {
            Ok(chunk) => chunks.push(Logged::Chunk(chunk)),
            Err(_) => unread += 1,
        }
    }
    if chunks.is_empty() {
        let why = foreign::named(&bytes).unwrap_or_else(|| format!("it is no log of {FORMATS}, nor of a serial line"));
        bail!("{} cannot be read: {why}", file::shown(path));
    }
    Ok(Log::new(chunks, unread, damage))
}

impl Logged {
    /// On the log's clock.
    pub fn time_ns(&self) -> i64 {
        match self {
            Self::Frame(line) => line.time_ns,
            Self::Chunk(chunk) => chunk.time_ns,
        }
    }
}
