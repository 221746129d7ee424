//! Logs of a bus or of a serial line, line by line.

use std::path::Path;

use anyhow::{Result, bail};

use crate::recording::can_log::{self, FORMATS, Format, Line};
use crate::recording::problems::Problems;
use crate::recording::serial_log::Chunk;
use crate::recording::{file, foreign};

/// A line of a log.
pub enum Logged {
    Frame(Line),
    Chunk(Chunk),
}

/// The lines of a log, and how many are none.
///
/// # Errors
/// A file that cannot be read, and one that is no log; says what it is.
pub fn read(path: &Path, interface: Option<&str>) -> Result<(Vec<Logged>, u64)> {
    let bytes = file::bytes(path)?;
    if let Some(format) = Format::of(&bytes) {
        let mut problems = Problems::default();
        let lines = can_log::read(&bytes, format, interface, &mut problems)?;
        return Ok((lines.into_iter().map(Logged::Frame).collect(), problems.count("line skipped")));
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
    Ok((chunks, unread))
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
