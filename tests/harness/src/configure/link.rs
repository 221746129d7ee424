//! The integrator's end of a line to a unit: what is asked, and what comes back.

use std::time::Instant;

use anyhow::Result;
use viewshed::unit::reply::Said;
use viewshed::unit::settings::{BlockKind, Which};

/// What a unit is asked.
#[derive(Debug, Clone, Copy)]
pub enum Ask<'a> {
    /// Which unit it is.
    Identify,
    /// Of the units of one number this chip's alone takes what follows; 0: all of them.
    Address(u32),
    /// A block, whole.
    Read(Which),
    /// A block from this place on: whole on a bus, a part of it on a serial line.
    ReadPart(Which, u16),
    /// Write this block: whole on a bus and where it fits a message, else its first part.
    Write(&'a [u8]),
    /// What follows the part before, on a serial line.
    Part(&'a [u8], u16),
    /// A part of it again, on a bus.
    Again(&'a [u8], u8),
    /// Start over.
    Restart,
    /// Empty both slots of a kind.
    Clear(BlockKind),
    /// Say how long frames take.
    Timing,
}

/// What came that was no answer: to say what is at the other end when nothing answers.
#[derive(Debug, Clone, Default)]
pub struct Noise {
    /// Bytes, or frames.
    pub pieces: u64,
    /// Messages of viewshed among them, by sensor.
    pub sensors: std::collections::BTreeMap<u8, u64>,
}

/// A line with one unit or several at its other end.
pub trait Link {
    /// Where it is, for people.
    fn place(&self) -> &str;

    /// What its pieces are called.
    fn pieces(&self) -> &'static str;

    /// Talks to the unit of this sensor's number from now on; `None`: whichever there is.
    fn to(&mut self, sensor: Option<u8>);

    /// Asks.
    ///
    /// # Errors
    /// The line is gone, or takes nothing.
    fn ask(&mut self, what: Ask<'_>) -> Result<()>;

    /// The next thing a unit says, until then.
    ///
    /// # Errors
    /// The line is gone.
    fn hear(&mut self, until: Instant) -> Result<Option<Said>>;

    /// What else came so far.
    fn noise(&self) -> &Noise;

    /// Whether several units can be on it.
    fn is_bus(&self) -> bool;

    /// A unit starts over: goes on at the bit rate it has then. A test bench keeps its own.
    ///
    /// # Errors
    /// The line is gone.
    fn restarted(&mut self, is_bench: bool) -> Result<()>;

    /// Tries the next bit rate a unit may have; `false` where there is no other one.
    ///
    /// # Errors
    /// The line is gone.
    fn next_rate(&mut self) -> Result<bool>;
}
