//! Logs of a bus or of a serial line, line by line.

use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::recording::can_log::log::Lines;
use crate::recording::can_log::{self, FORMATS, Line};
use crate::recording::file::{self, Source};
use crate::recording::problems::Problems;
use crate::recording::serial_log::Chunk;
use crate::recording::{foreign, text};

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
    let source = Source::of(path)?;
    if source.begin(1)?.is_empty() {
        bail!("{} is empty", file::shown(path));
    }
    if let Some(found) = can_log::log::find(&source)? {
        let mut problems = Problems::default();
        let log = found.read(interface, &mut problems, &mut |_| false)?;
        let mut lines = Vec::new();
        log.each(&mut |line| lines.push(Logged::Frame(line.clone())));
        return Ok(Log::new(lines, problems.count("line skipped"), log.damage().map(str::to_owned)));
    }
    let (mut chunks, mut unread) = (Vec::new(), 0);
    let mut text = text::Lines::new(source.open()?);
    while let Some(line) = text.next_line().with_context(|| format!("cannot read {}", source.shown()))? {
        match Chunk::parse(&line) {
            Ok(chunk) => chunks.push(Logged::Chunk(chunk)),
            Err(_) => unread += 1,
        }
    }
    if chunks.is_empty() {
        let known = foreign::named(&source.read()?.bytes);
        let why = known.unwrap_or_else(|| format!("it is no log of {FORMATS}, nor of a serial line"));
        bail!("{} cannot be read: {why}", file::shown(path));
    }
    Ok(Log::new(chunks, unread, text.source().damage().map(str::to_owned)))
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
